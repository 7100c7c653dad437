"""Open and save sessions, open recent files, compare the selected shot with the model file in use."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot
from PySide6.QtWidgets import QMenu

from analysis.diagnosis import SavedModel
from analysis.shot import Fit
from app.session import Entry, SettingsStore, Workbench, drift_words, is_session
from app.window.controls.file_dialog import PathKind, ask
from app.window.controls.theme import Tone
from app.window.controls.widgets import hover_text
from app.window.panels.layout import Layout
from app.words import counted, localised_text

SESSIONS = "Levimass session (*.json)"


class FilesPresenter(QObject):
    """Connects the workbench with the File menu."""

    recordings_wanted = Signal(list)  # paths

    def __init__(self, workbench: Workbench, store: SettingsStore, panels: Layout, parent: QObject) -> None:
        super().__init__(parent)
        self._workbench, self._store, self._panels = workbench, store, panels
        self.recent = QMenu("Open recent")
        self.recent.setToolTipsVisible(True)
        self.recent.aboutToShow.connect(self._fill)
        self._fill()
        self._name_window()

    @Slot()
    def open_session(self) -> None:
        ask(self._panels, "Open a session", PathKind.FILE, self.open_named, self._folder(), SESSIONS)

    @Slot()
    def save_session(self) -> None:
        start = self._folder() / "session.json"
        ask(self._panels, "Save the session as", PathKind.NEW_FILE, self.save_to, start, SESSIONS)

    @Slot()
    def usual_session(self) -> None:
        self._opened(self._workbench.open_unnamed_session(), "")

    def _folder(self) -> Path:
        path = self._workbench.session.path
        named = path is not None and self._store.settings.session == str(path)
        return path.parent if named and path is not None else self._store.start_folder

    def open_named(self, path: Path) -> None:
        self._opened(self._workbench.open_session(path), str(path))

    def save_to(self, path: Path) -> None:
        self._opened(self._workbench.save_session(path), str(path))

    def _opened(self, problem: str | None, name: str) -> None:
        if problem:
            self._panels.say(problem, Tone.BAD)
            return
        self._store.change({"session": name})
        if name:
            self._store.remember_recent([Path(name)])
        self._name_window()
        entries = self._workbench.session.entries
        self._panels.table.show_session(self._workbench.session)
        self._panels.table.select([entries[-1].number] if entries else [])
        self._panels.say(f"Session {name or 'without a name'}: {counted(len(entries), 'shot')}", Tone.GOOD)

    def _name_window(self) -> None:
        name = self._store.settings.session
        self._panels.window().setWindowTitle(f"{Path(name).stem} – Levimass" if name else "Levimass")

    @Slot()
    def _fill(self) -> None:
        self.recent.clear()
        for path in self._store.recent:
            action = self.recent.addAction(path.name)
            action.setToolTip(hover_text(str(path)))
            action.triggered.connect(partial(self._open_again, path))
        self.recent.setEnabled(bool(self._store.recent))

    def _open_again(self, path: Path, _: bool = False) -> None:
        if not path.exists():
            self._panels.say(f"{path} no longer exists", Tone.BAD)
        elif is_session(path):
            self.open_named(path)
        else:
            self.recordings_wanted.emit([path])


class ModelPresenter(QObject):
    """Shows how well the selected shot agrees with the model file in use."""

    def __init__(
        self,
        workbench: Workbench,
        store: SettingsStore,
        panels: Layout,
        front: Callable[[], Entry | None],
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self._workbench, self._store, self._panels, self._front = workbench, store, panels, front
        self._shown: tuple[SavedModel | None, Fit | None, bool] = (None, None, False)

    def refresh(self) -> None:
        """Update the panel; take a new model file's base model."""
        known = self._workbench.model.loaded_model
        if known is not self._shown[0]:
            self._take_base(known)
        entry = self._front()
        fit = entry.shot.fit if entry is not None and entry.shot is not None else None
        behind = entry is not None and self._workbench.model.needs_refit(entry)
        if known is self._shown[0] and fit is self._shown[1] and behind == self._shown[2]:
            return
        self._shown = (known, fit, behind)
        self._panels.model.show_known(*_agreement(known, fit, behind))

    def _take_base(self, known: SavedModel | None) -> None:
        """Use the base model of the model file for the next shots."""
        if known is None or known.base == self._store.settings.model:
            return
        problem = self._store.change({"model": known.base})
        words = (
            f"The base model of the next shots is now {known.base}; listed shots keep theirs (Ctrl+R analyses copies)"
        )
        self._panels.say(problem or words, Tone.BAD if problem else Tone.NEUTRAL)


def _agreement(known: SavedModel | None, fit: Fit | None, behind: bool) -> tuple[str, Tone]:
    """Return a sentence and its tone: whether the fit is outdated, or how well it agrees with the model file."""
    if behind:
        return "this fit is of an earlier model; the refit with the present one follows", Tone.WARNING
    if known is None or fit is None:
        return "", Tone.NEUTRAL
    if fit.model != known.base:
        return f"the model file has base model {known.base}, this fit has {fit.model}", Tone.WARNING
    far = localised_text(drift_words(known, fit))
    words = f"differs from the model file: {far}" if far else "agrees with the model file"
    return words, Tone.WARNING if far else Tone.GOOD
