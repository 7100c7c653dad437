"""Between files of other programs and the sheet that asks which of their channels is which."""

from pathlib import Path

from PySide6.QtCore import QObject, Slot

from app.session.choices import Choices
from app.session.jobs import Asked, Job, Report
from app.session.workbench import Workbench
from app.window.layout import Layout
from app.window.panels.mapping_sheet import Answer
from instrument.foreign.contents import ForeignContents
from instrument.foreign.mapping import write_mapping
from instrument.foreign.reading import foreign_channels, read_foreign
from instrument.foreign.remembered import OF_FOLDER, is_foreign, own_mapping


class MappingPresenter(QObject):
    """Asks for one file after another; files are read in the errands' thread."""

    def __init__(self, workbench: Workbench, choices: Choices, panels: Layout, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._workbench, self._choices, self._sheet = workbench, choices, panels.mapping
        self._waiting: list[Path] = []
        self._path: Path | None = None
        self._job: Job | None = None
        self._sheet.applied.connect(self._applied)

    @Slot(object)
    def ask(self, paths: list[Path]) -> None:
        """Ask for these files' channels, one file after the other."""
        self._waiting += paths

    def refresh(self) -> None:
        """Take what the errands' thread read, and go on with the next file."""
        job = self._job
        if job is not None and job.done.is_set():
            self._job = None
            settings = self._choices.settings
            if isinstance(job.result, ForeignContents):
                self._sheet.ask(job.result, settings.moving_mass_kg, settings.rest_frequency_hz)
            elif isinstance(job.result, Path):
                self._sheet.hide()
                self._workbench.open_paths([job.result])
            elif job.problem and self._sheet.isVisible():
                self._sheet.refuse(job.problem)
        if self._job is None and self._waiting and not self._sheet.isVisible():
            self._read(self._waiting.pop(0))

    def _read(self, path: Path) -> None:
        self._path = path

        def work(_: Report, __: Asked) -> ForeignContents | Path:
            return path if is_foreign(path) else foreign_channels(path)  # the folder's mapping may be there by now

        self._job = self._workbench.errands.submit(path.name, work, "foreign")

    @Slot(object)
    def _applied(self, answer: Answer) -> None:
        path = self._path
        if path is None or self._job is not None:
            return

        def work(_: Report, __: Asked) -> Path:
            read_foreign(path, answer.mapping)  # a mapping that does not work is not remembered
            write_mapping(answer.mapping, path.with_name(OF_FOLDER) if answer.for_folder else own_mapping(path))
            return path

        self._job = self._workbench.errands.submit(path.name, work, "foreign")
