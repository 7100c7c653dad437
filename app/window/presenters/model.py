"""The model as a file: saved for the next session or another machine, loaded, and held against the shot in front."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot

from analysis.diagnosis.model_file import SavedModel
from analysis.fit import Fit
from app.session.choices import Choices
from app.session.model_in_use import drift_words
from app.session.session import Entry
from app.session.workbench import Workbench
from app.window.file_question import Want, ask
from app.window.layout import Layout
from app.window.theme import Tone

KINDS = "Levimass model (*.toml)"


class ModelPresenter(QObject):
    """Between the workbench and what asks for a model file."""

    said = Signal(str, Tone)

    def __init__(
        self,
        workbench: Workbench,
        choices: Choices,
        panels: Layout,
        front: Callable[[], Entry | None],
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._workbench, self._choices, self._panels, self._front = workbench, choices, panels, front
        self._shown: tuple[SavedModel | None, Fit | None] = (None, None)
        self._taken: SavedModel | None = None
        self._chosen: Path | None = None

    @property
    def _folder(self) -> Path:
        return self._chosen or self._choices.start_folder

    def refresh(self) -> None:
        """Say how the shot in front agrees with the model file, where one is in use."""
        known = self._workbench.model.known
        if known is not self._taken:
            self._taken = known
            self._take_base()
        entry = self._front()
        fit = entry.shot.fit if entry is not None and entry.shot is not None else None
        if (known, fit) == (None, None) or (known is self._shown[0] and fit is self._shown[1]):
            return
        self._shown = (known, fit)
        if known is None or fit is None:
            self._panels.model.show_known("", Tone.NEUTRAL)
        elif fit.model != known.base:
            self._panels.model.show_known(
                f"the model file is of base {known.base}, this fit of {fit.model}", Tone.WARNING
            )
        else:
            far = drift_words(known, fit)
            words = f"differs from the model file: {far}" if far else "agrees with the model file"
            self._panels.model.show_known(words, Tone.WARNING if far else Tone.GOOD)

    def _take_base(self) -> None:
        known = self._workbench.model.known
        if known is None or known.base == self._choices.settings.model:
            return
        problem = self._choices.change({"model": known.base})
        words = f"The next shots' base model is now {known.base}; those in the list keep theirs (Ctrl+R: as copies)"
        self.said.emit(problem or words, Tone.BAD if problem else Tone.NEUTRAL)

    @Slot()
    def save_model(self) -> None:
        """Ask for a file and save the model of the selected shots, or of all, there."""
        ask(self._panels, "Save the model", Want.NEW_FILE, self._save_asked, self._folder / "model.toml", KINDS)

    def _save_asked(self, paths: list[Path]) -> None:
        self._chosen = paths[0].parent
        self._workbench.papers.save_model(self._panels.table.numbers, paths[0])

    @Slot()
    def load_model(self) -> None:
        """Ask for a model file and use it."""
        ask(self._panels, "Open a model", Want.FILE, self._load_asked, self._folder, KINDS)

    @Slot()
    def foretell(self) -> None:
        """Ask for a model file and say what it foretells of the selected shots, or of all; nothing is changed."""
        ask(self._panels, "Put a model to the test", Want.FILE, self._foretell_asked, self._folder, KINDS)

    def _foretell_asked(self, paths: list[Path]) -> None:
        self._chosen = paths[0].parent
        self._workbench.papers.foretell(self._panels.table.numbers, paths[0])

    def _load_asked(self, paths: list[Path]) -> None:
        self._chosen = paths[0].parent
        self._workbench.model.load(paths[0])
