"""Save and load model files, test their predictions, and compare them with the selected shot."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot

from analysis.diagnosis import SavedModel
from analysis.shot import Fit
from app.session import Choices, Entry, Workbench, drift_words
from app.window.file_dialog import Want, ask
from app.window.layout import Layout
from app.window.theme import Tone
from app.words import local_words

KINDS = "Levimass model (*.toml)"


class ModelPresenter(QObject):
    """Connects the workbench with the commands on model files."""

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
        self._shown: tuple[SavedModel | None, Fit | None, bool] = (None, None, False)
        self._known: SavedModel | None = None
        self._chosen: Path | None = None

    @property
    def _folder(self) -> Path:
        return self._chosen or self._choices.start_folder

    def refresh(self) -> None:
        """Show how the selected shot agrees with the model file in use."""
        known = self._workbench.model.known
        if known is not self._known:
            self._known = known
            self._take_base()
        entry = self._front()
        fit = entry.shot.fit if entry is not None and entry.shot is not None else None
        behind = entry is not None and self._workbench.model.is_behind(entry)
        if known is self._shown[0] and fit is self._shown[1] and behind == self._shown[2]:
            return
        self._shown = (known, fit, behind)
        self._panels.model.show_known(*_agreement(known, fit, behind))

    def _take_base(self) -> None:
        known = self._workbench.model.known
        if known is None or known.base == self._choices.settings.model:
            return
        problem = self._choices.change({"model": known.base})
        words = f"The next shots' base model is now {known.base}; those in the list keep theirs (Ctrl+R: as copies)"
        self.said.emit(problem or words, Tone.BAD if problem else Tone.NEUTRAL)

    @Slot()
    def save_model(self) -> None:
        """Ask for a file and save the model of the selected shots, or of all."""
        ask(self._panels, "Save the model", Want.NEW_FILE, self._save_asked, self._folder / "model.toml", KINDS)

    def _save_asked(self, paths: list[Path]) -> None:
        self._chosen = paths[0].parent
        self._workbench.exports.save_model(self._panels.table.numbers, paths[0])

    @Slot()
    def load_model(self) -> None:
        """Ask for a model file and use it."""
        ask(self._panels, "Open a model", Want.FILE, self._load_asked, self._folder, KINDS)

    @Slot()
    def test_model(self) -> None:
        """Ask for a model file and test its predictions on the selected shots, or on all."""
        ask(self._panels, "Test a model's predictions", Want.FILE, self._test_asked, self._folder, KINDS)

    def _test_asked(self, paths: list[Path]) -> None:
        self._chosen = paths[0].parent
        self._workbench.exports.test_model(self._panels.table.numbers, paths[0])

    def _load_asked(self, paths: list[Path]) -> None:
        self._chosen = paths[0].parent
        self._workbench.model.load(paths[0])


def _agreement(known: SavedModel | None, fit: Fit | None, behind: bool) -> tuple[str, Tone]:
    """Return whether a fit is of an earlier model, or how it agrees with the model file."""
    if behind:
        return "this fit is of an earlier model; the fit with the present one follows", Tone.WARNING
    if known is None or fit is None:
        return "", Tone.NEUTRAL
    if fit.model != known.base:
        return f"the model file is of base {known.base}, this fit of {fit.model}", Tone.WARNING
    far = local_words(drift_words(known, fit))
    words = f"differs from the model file: {far}" if far else "agrees with the model file"
    return words, Tone.WARNING if far else Tone.GOOD
