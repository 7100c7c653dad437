"""Let the operator assign the channels of foreign files, i.e. of files from other programs."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Slot

from analysis.shot import Progress, Role, Stop
from app.session import ChannelSummary, SettingsStore, Workbench, summarise_channels
from app.window.panels.layout import Layout
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

    def __init__(self, workbench: Workbench, store: SettingsStore, panels: Layout, parent: QObject) -> None:
        super().__init__(parent)
        self._workbench, self._store, self._sheet = workbench, store, panels.mapping
        self._waiting: list[Path] = []
        self._path: Path | None = None
        self._busy = False  # whether a job reads or saves
        self._sheet.applied.connect(self._applied)

    @Slot(object)
    def ask(self, paths: list[Path]) -> None:
        """Add files to the queue of files whose channels must be assigned."""
        self._waiting += paths

    def refresh(self) -> None:
        """Start reading the next file."""
        if not self._busy and self._waiting and not self._sheet.isVisible():
            self._read(self._waiting.pop(0))

    def _read(self, path: Path) -> None:
        self._path = path

        def work(_: Progress, __: Stop) -> tuple[ForeignContents, Sequence[ChannelSummary]] | None:
            if is_foreign(path):  # a mapping for the folder may have been saved since
                return None
            contents = foreign_channels(path)
            try:
                return contents, summarise_channels(contents)
            except Exception:  # a library may raise anything; channels can be assigned without a proposal
                return contents, ()

        def take(found: tuple[ForeignContents, Sequence[ChannelSummary]] | None) -> None:
            if found is None:
                self._open(path)
                return
            self._busy = False
            contents, looks = found
            settings = self._store.settings
            self._sheet.ask(contents, settings.moving_mass_kg, settings.rest_frequency_hz, looks)

        self._submit(path, work, take)

    def _submit(self, path: Path, work: Callable[[Progress, Stop], object], take: Callable[[Any], None]) -> None:
        self._busy = True
        self._workbench.short_jobs.submit(path.name, work, "foreign", take, self._failed)

    def _open(self, path: Path) -> None:
        self._busy = False
        self._sheet.hide()
        self._workbench.open_paths([path])

    def _failed(self, why: str | None) -> None:
        self._busy = False
        if why and self._sheet.isVisible():
            self._sheet.refuse(why)

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
        if path is None or self._busy:
            return

        def work(_: Progress, __: Stop) -> None:
            if isinstance(mapping, MotionColumns):
                save_columns(path, mapping)
            else:
                read_foreign(path, mapping)  # raises before an invalid mapping is saved
                write_mapping(mapping, path.with_name(FOLDER_MAPPING) if for_folder else mapping_path(path))

        self._submit(path, work, lambda _: self._open(path))
