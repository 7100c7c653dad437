"""Between files of other programs and the sheet that asks which of their channels is which."""

from dataclasses import dataclass, replace
from pathlib import Path

from PySide6.QtCore import QObject, Slot

from analysis.shot.recording import Role
from analysis.shot.shot import Progress, Stop
from app.session.channel_looks import ChannelLook, looks_of
from app.session.choices import Choices
from app.session.jobs import Job
from app.session.workbench import Workbench
from app.window.layout import Layout
from app.window.panels.mapping_sheet import Answer
from instrument.files.foreign.contents import ForeignContents
from instrument.files.foreign.mapping import (
    OF_FOLDER,
    is_foreign,
    own_mapping,
    read_mapping,
    remembered_mapping,
    write_mapping,
)
from instrument.files.foreign.reading import foreign_channels, read_foreign
from instrument.files.motion_columns import MotionColumns
from instrument.files.motion_file import keep_columns


@dataclass(frozen=True, slots=True)
class _Seen:
    """A file's channels, and what they look like."""

    held: ForeignContents
    looks: tuple[ChannelLook, ...]


class MappingPresenter(QObject):
    """Asks for one file after another; files are read in the short_jobs' thread."""

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
        """Take what the short_jobs' thread read, and go on with the next file."""
        job = self._job
        if job is not None and job.done.is_set():
            self._job = None
            settings = self._choices.settings
            if isinstance(job.result, _Seen):
                seen = job.result
                self._sheet.ask(seen.held, settings.moving_mass_kg, settings.rest_frequency_hz, seen.looks)
            elif isinstance(job.result, Path):
                self._sheet.hide()
                self._workbench.open_paths([job.result])
            elif job.problem and self._sheet.isVisible():
                self._sheet.refuse(job.problem)
        if self._job is None and self._waiting and not self._sheet.isVisible():
            self._read(self._waiting.pop(0))

    def _read(self, path: Path) -> None:
        self._path = path

        def work(_: Progress, __: Stop) -> _Seen | Path:
            if is_foreign(path):  # the folder's mapping may be there by now
                return path
            held = foreign_channels(path)
            try:
                return _Seen(held, looks_of(held))
            except Exception:  # whatever a format's library raises: the channels can be told without a look at them
                return _Seen(held, ())

        self._job = self._workbench.short_jobs.submit(path.name, work, "foreign")

    def can_swap(self, path: Path) -> bool:
        """Return whether PD0 and PD1 of a file can be exchanged: one of another program, which has both."""
        mapping = remembered_mapping(path)
        if mapping is None:
            return False
        roles = {channel.role for channel in read_mapping(mapping).channels}
        return {Role.REFERENCE, Role.MEASUREMENT} <= roles

    def swap(self, path: Path, number: int) -> None:
        """Exchange PD0 and PD1 of a file of another program, for good, and analyse it again."""
        mapping = remembered_mapping(path)
        if mapping is None:
            return
        known = read_mapping(mapping)
        other = {Role.REFERENCE: Role.MEASUREMENT, Role.MEASUREMENT: Role.REFERENCE}
        channels = tuple(replace(channel, role=other.get(channel.role, channel.role)) for channel in known.channels)
        write_mapping(replace(known, channels=channels), own_mapping(path))
        self._workbench.reanalyse([number])

    @Slot(object)
    def _applied(self, answer: Answer) -> None:
        path = self._path
        if path is None or self._job is not None:
            return

        def work(_: Progress, __: Stop) -> Path:
            if isinstance(answer.mapping, MotionColumns):
                keep_columns(path, answer.mapping)
                return path
            read_foreign(path, answer.mapping)  # a mapping that does not work is not remembered
            write_mapping(answer.mapping, path.with_name(OF_FOLDER) if answer.for_folder else own_mapping(path))
            return path

        self._job = self._workbench.short_jobs.submit(path.name, work, "foreign")
