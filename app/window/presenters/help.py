"""Help commands: the short tour, manual, log folder."""

from importlib import resources
from pathlib import Path

from PySide6.QtCore import QObject, QUrl, Signal, Slot
from PySide6.QtGui import QDesktopServices

from app.session import SettingsStore
from app.window.layout import Layout
from app.window.panels.help import Step
from app.window.theme import Tone

DOCS = Path(__file__).resolve().parents[3] / "docs"


class HelpPresenter(QObject):
    """Starts the tour and stores that it was seen; opens manual and log folder with the system's programs."""

    said = Signal(str, Tone)

    def __init__(self, store: SettingsStore, panels: Layout, log_folder: Path, parent: QObject) -> None:
        super().__init__(parent)
        self._store, self._panels, self._log_folder = store, panels, log_folder
        self.tour = panels.tour
        self.tour.ended.connect(self._ended)

    def start_once(self) -> None:
        """Start the tour unless it was seen before."""
        if not self._store.settings.tour_done:
            self.start()

    @Slot()
    def toggle_tour(self) -> None:
        if self.tour.isVisible():
            self.tour.close()
        else:
            self.start()

    def start(self) -> None:
        """Start the tour from its first callout."""
        p = self._panels
        self.tour.begin(
            (
                Step(
                    p.controls.arm,
                    "Press ARM",
                    "Nothing needs to be plugged in: the simulated bench pushes its block by itself. Press ARM (space) "
                    "and the next push becomes a shot. You can do it now; the tour stays.",
                ),
                Step(
                    p.banner,
                    "The state, and what to do",
                    "One word, readable from afar: READY, ARMED, CAPTURED, ANALYSING, FAULT. Beside it: what to do.",
                ),
                Step(
                    p.numbers,
                    "The numbers of the shot",
                    "Each with its standard uncertainty; hover to read how it was found, press Budget (B) for where "
                    "the uncertainty comes from.",
                ),
                Step(
                    p.table,
                    "The session",
                    "Every shot taken or opened. Select several to compare (Ctrl+3) or to diagnose (D): it says what "
                    "the model lacks.",
                ),
                Step(
                    p.work,
                    "Your own rig",
                    "Set-up (F3) finds a digitizer and checks its signals; Settings (F2) takes mass, air and "
                    "wavelength; F1 shows every key.",
                ),
            )
        )

    @Slot()
    def _ended(self) -> None:
        if not self._store.settings.tour_done:
            self._store.change({"tour_done": True})
        self._panels.controls.arm.setFocus()

    @Slot()
    def show_manual(self) -> None:
        """Open the tutorial if it is installed, else show a message."""
        tutorial = DOCS / "tutorial.md"
        if not tutorial.exists():
            tutorial = Path(str(resources.files("resources").joinpath("tutorial.md")))
        if tutorial.exists():
            self._open(tutorial)
        else:
            self.said.emit("The tutorial is not installed here; see the short tour (F4)", Tone.NEUTRAL)

    @Slot()
    def show_log(self) -> None:
        self._open(self._log_folder)

    def _open(self, path: Path) -> None:
        opened = QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))
        self.said.emit(f"{path}" if opened else f"No program opens it here; it is {path}", Tone.NEUTRAL)
