"""The thread that writes shots to disk while their samples are received."""

import queue
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from analysis.shot import Recording
from instrument.capture.growing_shot import GrowingShot
from instrument.files import RecordingError, RecordingExists, RecordingWriter, one_line, read_recording, write_recording

_LOOK_S = 0.02  # between two looks for new samples
_MOST_NAMES = 100_000


@dataclass(frozen=True, slots=True)
class Recorded:
    """A shot after its saving: ``recording`` is on disk, or only in memory if ``problem`` says why."""

    shot: GrowingShot
    recording: Recording
    problem: str | None
    partial: RecordingWriter | None = None  # the incomplete files of a shot that could not be saved


class Recorder:
    """Saves one shot after another; ``done`` is called in this thread."""

    def __init__(self, done: Callable[[Recorded], None]) -> None:
        self._done = done
        self._waiting: queue.SimpleQueue[tuple[GrowingShot, Path] | None] = queue.SimpleQueue()
        self._numbers: dict[Path, int] = {}  # of the last shot in each folder
        self._thread = threading.Thread(target=self._run, name="levimass recorder", daemon=True)
        self.start = self._thread.start
        self._ended = 0  # shots saved, or kept in memory

    def begin(self, shot: GrowingShot, folder: Path) -> None:
        """Save ``shot`` under the next free name in ``folder`` as it grows."""
        self._waiting.put((shot, folder))

    def close(self, timeout_s: float = 30.0) -> bool:
        """Save the queued shots, all of which must be complete, and end the thread.  Returns whether it ended."""
        self._waiting.put(None)
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (item := self._waiting.get()) is not None:
            recorded = self._save(*item)
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
                complete = shot.complete  # read before ``filled``, so that no sample is missed
                if shot.filled > shot.written:
                    writer.append(shot.counts[shot.written : shot.filled])
                    shot.written = writer.samples
                for gap in shot.gaps[gaps:]:
                    writer.gap(gap.sample_start, gap.samples_lost)
                    gaps += 1
                if complete and shot.written == shot.filled:
                    break
                shot.grown.wait(_LOOK_S)
                shot.grown.clear()
            writer.trigger(shot.trigger_sample)
            if shot.ended_early is not None:
                writer.more(shot.extra)
            return Recorded(shot, read_recording(writer.close()), None)
        except Exception as error:  # whatever the cause, the shot must not be lost
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
        for _ in range(_MOST_NAMES):
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
    for number in range(1, _MOST_NAMES):
        name = recording.name if number == 1 else f"{recording.name}-{number}"
        try:
            return write_recording(recording, folder / name)
        except RecordingExists:
            continue
    raise RecordingError(folder, f"no free name {recording.name}-N")
