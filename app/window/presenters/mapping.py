"""Let the operator assign the channels of foreign files, i.e. of files from other programs."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QObject, Slot

from analysis.shot import Progress, Role, Stop
from app.session import ChannelSummary, Job, SettingsStore, Workbench, summarise_channels
from app.window.layout import Layout
from instrument.files import (
    FOLDER_MAPPING,
    ForeignContents,
    ForeignMapping,
    MotionColumns,
    find_mapping,
    foreign_channels,
    is_foreign,
    mapping_path,
    read_foreign,
    read_mapping,
    save_columns,
    write_mapping,
)


class MappingPresenter(QObject):
    """Shows the assignment sheet for one file after another; short jobs read the files."""

    def __init__(
        self, workbench: Workbench, store: SettingsStore, panels: Layout, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._workbench, self._store, self._sheet = workbench, store, panels.mapping
        self._waiting: list[Path] = []
        self._path: Path | None = None
        self._job: Job | None = None
        self._sheet.applied.connect(self._applied)

    @Slot(object)
    def ask(self, paths: list[Path]) -> None:
        """Add files to the queue of files whose channels must be assigned."""
        self._waiting += paths

    def refresh(self) -> None:
        """Collect the file that a job has read, and start the next one."""
        job = self._job
        if job is not None and job.done.is_set():
            self._job = None
            settings = self._store.settings
            if isinstance(job.result, tuple):
                contents, looks = job.result
                self._sheet.ask(contents, settings.moving_mass_kg, settings.rest_frequency_hz, looks)
            elif isinstance(job.result, Path):
                self._sheet.hide()
                self._workbench.open_paths([job.result])
            elif job.problem and self._sheet.isVisible():
                self._sheet.refuse(job.problem)
        if self._job is None and self._waiting and not self._sheet.isVisible():
            self._read(self._waiting.pop(0))

    def _read(self, path: Path) -> None:
        self._path = path

        def work(_: Progress, __: Stop) -> tuple[ForeignContents, Sequence[ChannelSummary]] | Path:
            if is_foreign(path):  # a mapping for the folder may have been saved since
                return path
            contents = foreign_channels(path)
            try:
                return contents, summarise_channels(contents)
            except Exception:  # a library may raise anything; channels can be assigned without a proposal
                return contents, ()

        self._job = self._workbench.short_jobs.submit(path.name, work, "foreign")

    def swap(self, path: Path, number: int) -> None:
        """Exchange PD0 and PD1 in the mapping of a file and repeat the analysis."""
        mapping = find_mapping(path)
        if mapping is None:
            return
        known = read_mapping(mapping)
        other = {Role.REFERENCE: Role.MEASUREMENT, Role.MEASUREMENT: Role.REFERENCE}
        channels = tuple(replace(channel, role=other.get(channel.role, channel.role)) for channel in known.channels)
        write_mapping(replace(known, channels=channels), mapping_path(path))
        self._workbench.reanalyse([number])

    @Slot(object, bool)
    def _applied(self, mapping: ForeignMapping | MotionColumns, for_folder: bool) -> None:
        path = self._path
        if path is None or self._job is not None:
            return

        def work(_: Progress, __: Stop) -> Path:
            if isinstance(mapping, MotionColumns):
                save_columns(path, mapping)
            else:
                read_foreign(path, mapping)  # raises before an invalid mapping is saved
                write_mapping(mapping, path.with_name(FOLDER_MAPPING) if for_folder else mapping_path(path))
            return path

        self._job = self._workbench.short_jobs.submit(path.name, work, "foreign")
