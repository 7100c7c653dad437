"""Help: versions and licences, messages, manual, log folder."""

from importlib import resources
from pathlib import Path

from PySide6.QtCore import QObject, QUrl, Signal, Slot
from PySide6.QtGui import QDesktopServices

from app.window.layout import Layout
from app.window.theme import Tone

DOCS = Path(__file__).resolve().parents[3] / "docs"


class HelpPresenter(QObject):
    """Shows sheets, and opens manual and log with the system's programs."""

    said = Signal(str, Tone)

    def __init__(self, panels: Layout, log_folder: Path, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._panels, self._log_folder = panels, log_folder
        panels.work.notices.list_wanted.connect(self.toggle_messages)

    @Slot()
    def toggle_about(self) -> None:
        """Show or hide versions and licences."""
        self._panels.about.toggle()

    @Slot()
    def toggle_messages(self) -> None:
        """Show or hide the list of messages."""
        self._panels.messages.toggle()

    @Slot()
    def show_manual(self) -> None:
        """Open the tutorial where it is installed."""
        tutorial = DOCS / "tutorial.md"
        if not tutorial.exists():
            tutorial = Path(str(resources.files("resources").joinpath("tutorial.md")))
        if tutorial.exists():
            self._open(tutorial)
        else:
            self.said.emit("The tutorial is not installed here; see the short tour (F4)", Tone.NEUTRAL)

    @Slot()
    def show_log(self) -> None:
        """Open the folder of the log."""
        self._open(self._log_folder)

    def _open(self, path: Path) -> None:
        opened = QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))
        self.said.emit(f"{path}" if opened else f"No program opens it here; it is {path}", Tone.NEUTRAL)
