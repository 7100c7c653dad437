"""A shot while its samples arrive, and the thread that writes them to disk at the same time."""

import re
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.shot import DELIVERED_KEY, RATE_CONTRADICTED, Channel, Gap, Progress, Recording, Role, Setup, Stop
from instrument.background import Task, WorkerThread
from instrument.devices import CaptureSettings
from instrument.files import (
    ENDED_EARLY,
    RecordingError,
    RecordingExists,
    RecordingWriter,
    one_line,
    read_recording,
    write_recording,
)
from instrument.trigger import middle_of_step

_LOOK_S = 0.02  # between two checks for new samples
_MAX_NAMES = 100_000
_LEVEL_REACH_S = 50e-6  # distance from the step at which the light switch's two levels are measured
_ENOUGH = 0.9  # share of the samples after the trigger below which a shot counts as cut short


@dataclass(slots=True)
class GrowingShot:
    """A shot that one thread fills and another writes to disk, in memory allocated at its trigger.

    ``counts`` has shape (samples of the settings, channels).
    """

    settings: CaptureSettings
    channels: tuple[Channel, ...]
    setup: Setup
    source: str
    started_at: str
    trigger_sample: int
    counts: NDArray[np.int16]
    unseen_loss_s: float = 0.0  # a loss shorter than this may go unnoticed
    doubtful_rate_hz: float | None = None  # the rate by the computer's clock, where it contradicts the stated one
    filled: int = 0
    written: int = 0  # samples already on disk
    gaps: list[Gap] = field(default_factory=list)
    ended_early: str | None = None
    aborted: bool = False  # True: the operator ended it early
    complete: bool = False
    grown: threading.Event = field(default_factory=threading.Event)

    @property
    def room(self) -> int:
        """Get the number of samples still missing."""
        return int(self.counts.shape[0]) - self.filled

    def append(self, counts: NDArray[np.int16]) -> None:
        """Append samples of shape (n, channels), at most ``room`` of them."""
        taken = min(self.room, counts.shape[0])
        self.counts[self.filled : self.filled + taken] = counts[:taken]
        self.filled += taken
        self.grown.set()

    def lost(self, samples_lost: int | None) -> None:
        """Note that samples were lost before the next one."""
        if self.filled > 0:
            self.gaps.append(Gap(self.filled, samples_lost))

    def finish(self, reason: str | None = None, *, aborted: bool = False) -> None:
        """End the shot; ``reason`` says why samples are missing.  Nothing is added after this."""
        after = self.settings.samples - self.settings.pre_trigger_samples
        if reason is not None and self.filled - self.trigger_sample < _ENOUGH * after:
            self.ended_early, self.aborted = reason, aborted
        for column, channel in enumerate(self.channels):
            if channel.role is Role.SWITCH:
                reach = max(32, round(_LEVEL_REACH_S * self.settings.sample_rate_hz))
                seen = self.counts[: self.filled, column]
                self.trigger_sample = middle_of_step(seen, self.trigger_sample, reach)
        self.complete = True
        self.grown.set()

    @property
    def extra(self) -> Mapping[str, Any]:
        """Get the metadata of the capture that are saved with the shot."""
        own: dict[str, Any] = {
            "lmm:capture": {
                "source": self.source,
                "samples": self.settings.samples,
                "pre_trigger_samples": self.settings.pre_trigger_samples,
            }
        }
        if self.unseen_loss_s:
            own["lmm:capture"]["unseen_loss_s"] = self.unseen_loss_s
        if self.doubtful_rate_hz is not None:
            own[DELIVERED_KEY] = self.doubtful_rate_hz
        if self.ended_early is not None:
            own[ENDED_EARLY] = self.ended_early
        return {"global": own}

    def recording(self, name: str) -> Recording:
        """Return the shot as a recording in memory; it shares the shot's counts, read-only."""
        counts = self.counts[: self.filled]
        counts.flags.writeable = False
        causes = (("gap", self.gaps), ("cut_short", self.ended_early), (RATE_CONTRADICTED, self.doubtful_rate_hz))
        flags = [flag for flag, cause in causes if cause]
        return Recording(
            name=name,
            counts=counts,
            sample_rate_hz=self.settings.sample_rate_hz,
            channels=self.channels,
            setup=self.setup,
            trigger_sample=self.trigger_sample if self.trigger_sample < self.filled else None,
            gaps=tuple(self.gaps),
            started_at=self.started_at,
            flags=tuple(flags),
            extra=self.extra,
        )


@dataclass(frozen=True, slots=True)
class Recorded:
    """A shot after the attempt to save it: on disk, or only in memory for the reason ``problem``."""

    shot: GrowingShot
    recording: Recording
    problem: str | None
    partial: RecordingWriter | None = None  # the incomplete files of a shot that could not be saved


class Recorder:
    """Saves one shot after another; ``done`` is called in this thread."""

    def __init__(self, done: Callable[[Recorded], None]) -> None:
        self._done = done
        self._numbers: dict[Path, int] = {}  # number of the last shot in each folder
        self._worker = WorkerThread[Task]("recorder")
        self.start = self._worker.start
        self._ended = 0  # shots saved, or kept in memory

    def begin(self, shot: GrowingShot, folder: Path) -> None:
        """Save ``shot`` under the next free name in ``folder`` as it grows."""
        self._worker.add(Task("saving", partial(self._record, shot, folder)))

    def close(self, timeout_s: float) -> bool:
        """Save the queued shots, all of which must be complete, and end the thread.  Returns whether it ended."""
        return self._worker.close(timeout_s, finish=True)

    def _record(self, shot: GrowingShot, folder: Path, _: Progress, __: Stop) -> None:
        recorded = self._save(shot, folder)
        self._ended += 1
        self._done(recorded)

    def _save(self, shot: GrowingShot, folder: Path) -> Recorded:
        writer: RecordingWriter | None = None
        name = ""
        try:
            writer = self._open(shot, folder)
            name = writer.stem.name
            writer.trigger(shot.trigger_sample)
            gaps = 0
            while True:
                complete = shot.complete  # read first: once it is True, ``filled`` is final
                if shot.filled > shot.written:
                    writer.append(shot.counts[shot.written : shot.filled])
                    shot.written = writer.samples
                for gap in shot.gaps[gaps:]:
                    writer.gap(gap.sample_start, gap.samples_lost)
                    gaps += 1
                if complete:
                    break
                shot.grown.wait(_LOOK_S)
                shot.grown.clear()
            writer.trigger(shot.trigger_sample)
            if shot.ended_early is not None:
                writer.more(shot.extra)
            return Recorded(shot, read_recording(writer.close()), None)
        except Exception as error:  # for any cause, the shot must not be lost
            problem = str(error) if isinstance(error, RecordingError) else f"unexpected: {one_line(repr(error))}"
            if writer is not None:
                writer.release()
            while not shot.complete:
                shot.grown.wait(_LOOK_S)
                shot.grown.clear()
            return Recorded(shot, shot.recording(name or self._name_without_file(folder)), problem, writer)

    def _name_without_file(self, folder: Path) -> str:
        """Return a unique name for a shot in memory for which no file could be opened."""
        number = self._numbers.get(folder)
        return f"shot-unsaved-{self._ended + 1}" if number is None else f"shot-{number:04d}"

    def _open(self, shot: GrowingShot, folder: Path) -> RecordingWriter:
        number = self._numbers.get(folder) or _highest_number(folder)
        for _ in range(_MAX_NAMES):
            number += 1
            self._numbers[folder] = number
            try:
                return RecordingWriter(
                    folder / f"shot-{number:04d}",
                    shot.settings.sample_rate_hz,
                    shot.channels,
                    shot.setup,
                    started_at=shot.started_at,
                    extra=shot.extra,
                )
            except RecordingExists:
                continue
        raise RecordingError(folder, "no free name shot-N")


def _highest_number(folder: Path) -> int:
    """Return the highest N of the files shot-N.* in ``folder``, 0 where there are none."""
    try:
        found = [match for entry in folder.iterdir() if (match := re.match(r"shot-(\d{1,9})\.", entry.name))]
    except OSError:
        return 0
    return max((int(match[1]) for match in found), default=0)


def save_elsewhere(recording: Recording, folder: Path) -> Path:
    """Write a recording that is only in memory to ``folder`` under a free name.  Raises RecordingError."""
    for number in range(1, _MAX_NAMES):
        name = recording.name if number == 1 else f"{recording.name}-{number}"
        try:
            return write_recording(recording, folder / name)
        except RecordingExists:
            continue
    raise RecordingError(folder, f"no free name {recording.name}-N")
