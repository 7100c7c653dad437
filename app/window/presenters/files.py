"""Open and save sessions, and open recent files."""

from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot
from PySide6.QtWidgets import QMenu

from app.session import Choices, Workbench, is_session
from app.window.file_dialog import Want, ask
from app.window.layout import Layout
from app.window.theme import Tone

KINDS = "Levimass session (*.json)"


class FilesPresenter(QObject):
    """Connects the workbench with the File menu."""

    said = Signal(str, Tone)
    recordings_wanted = Signal(list)  # paths

    def __init__(self, workbench: Workbench, choices: Choices, panels: Layout, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._workbench, self._choices, self._panels = workbench, choices, panels
        self.recent = QMenu("Open recent")
        self.recent.setToolTipsVisible(True)
        self.recent.aboutToShow.connect(self._fill)
        self._fill()
        self._name_window()

    @Slot()
    def open_session(self) -> None:
        """Ask for a session file and open it."""
        ask(self._panels, "Open a session", Want.FILE, self._open_asked, self._folder(), KINDS)

    @Slot()
    def save_session(self) -> None:
        """Ask for a file and save the session there from now on."""
        start = self._folder() / "session.json"
        ask(self._panels, "Save the session as", Want.NEW_FILE, self._save_asked, start, KINDS)

    @Slot()
    def usual_session(self) -> None:
        """Open the unnamed session."""
        self._opened(self._workbench.usual_session(), "")

    def _folder(self) -> Path:
        path = self._workbench.session.path
        named = path is not None and self._choices.settings.session == str(path)
        return path.parent if named and path is not None else self._choices.start_folder

    def _open_asked(self, paths: list[Path]) -> None:
        self.open_named(paths[0])

    def open_named(self, path: Path) -> None:
        """Open the session in this file."""
        problem = self._workbench.open_session(path)
        self._opened(problem, "" if problem else str(path))

    def _save_asked(self, paths: list[Path]) -> None:
        problem = self._workbench.save_session(paths[0])
        self._opened(problem, "" if problem else str(paths[0]))

    def _opened(self, problem: str | None, name: str) -> None:
        if problem:
            self.said.emit(problem, Tone.BAD)
            return
        self._choices.change({"session": name})
        if name:
            self._choices.remember_recent([Path(name)])
        self._name_window()
        entries = self._workbench.session.entries
        self._panels.table.show_session(self._workbench.session)
        self._panels.table.select([entries[-1].number] if entries else [])
        self.said.emit(f"Session {name or 'without a name'}: {len(entries)} shots", Tone.GOOD)

    def _name_window(self) -> None:
        name = self._choices.settings.session
        self._panels.window().setWindowTitle(f"{Path(name).stem} – Levimass" if name else "Levimass")

    @Slot()
    def _fill(self) -> None:
        self.recent.clear()
        for path in self._choices.recent:
            action = self.recent.addAction(path.name)
            action.setToolTip(str(path))
            action.triggered.connect(partial(self._open_again, path))
        self.recent.setEnabled(bool(self._choices.recent))

    def _open_again(self, path: Path, _: bool = False) -> None:
        if not path.exists():
            self.said.emit(f"{path} no longer exists", Tone.BAD)
        elif is_session(path):
            self.open_named(path)
        else:
            self.recordings_wanted.emit([path])
