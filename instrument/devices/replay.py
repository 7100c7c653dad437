"""A digitizer that plays back recordings, in real time or as fast as they are read."""

import contextlib
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Recording, Role, Setup
from instrument.devices.digitizer import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError
from instrument.devices.source_options import SourceOptions
from instrument.files import RecordingError, find_recordings, is_motion_record, open_recording


class ReplayDigitizer(Digitizer):
    """Plays one recording per ``arm``, in turn.

    A recording is played from its first sample to its last.  Its gaps are reported as ``lost_before``, and its trigger
    as ``trigger_sample`` if it has no light-switch channel.  If ``real_time``, samples arrive at their rate; a late
    reader loses none.
    """

    def __init__(
        self,
        recordings: Sequence[Recording | Path | str],
        *,
        real_time: bool = True,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] | None = None,
    ) -> None:
        files = find_recordings(r for r in recordings if not isinstance(r, Recording))
        shots: list[Recording | Path] = [r for r in recordings if isinstance(r, Recording)]
        shots += [f for f in files if not is_motion_record(f)]
        if not shots:
            raise DigitizerError("nothing to replay", "name a recording, or a folder that holds some")
        self._shots = shots
        self._real_time = real_time
        self._clock = clock
        self._stopped = threading.Event()
        self._stopped.set()
        self._sleep = sleep or self._stopped.wait
        self._index = -1
        self._played = True
        self._at: int  # this and the next are set by ``arm``
        self._started_at: float
        for _ in range(len(shots) - 1):  # skip unreadable recordings
            with contextlib.suppress(DigitizerError):
                self._upcoming()
                break
        self._playing = self._upcoming()

    @property
    def capabilities(self) -> Capabilities:
        shot = self._upcoming()
        return Capabilities(
            name=f"replay of {shot.name}",
            channels=shot.channels,
            bits=shot.setup.digitizer_bits,
            rates_hz=(shot.sample_rate_hz,),
            max_samples=shot.samples,
            hardware_trigger=shot.column(Role.SWITCH) is None and shot.trigger_sample is not None,
            real_time=False,
        )

    @property
    def setup(self) -> Setup:
        return self._upcoming().setup

    def default_settings(self) -> CaptureSettings:
        """Return the settings that play all of the next recording."""
        shot = self._upcoming()
        return CaptureSettings(shot.sample_rate_hz, shot.samples, shot.trigger_sample or 0)

    def arm(self, settings: CaptureSettings) -> None:
        """Start the next recording.  Raises DigitizerError if it cannot be read or has another rate."""
        self._stopped.set()
        shot = self._upcoming()
        if settings.sample_rate_hz != shot.sample_rate_hz:
            raise DigitizerError(
                f"{shot.name} was taken at {shot.sample_rate_hz:g} samples/s, not {settings.sample_rate_hz:g}",
                "arm with the recording's own rate",
            )
        self._at = 0
        self._played = True
        self._started_at = self._clock()
        self._stopped.clear()

    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        """Fill ``buffer`` with the samples due by now; a gap begins a new block."""
        if self._stopped.is_set():
            return Block(0, ended=True)
        shot = self._playing
        due = self._wait_for_due(shot, min(buffer.shape[0], shot.samples - self._at), timeout_s)
        stop = min(self._at + buffer.shape[0], due, *(g.sample_start for g in shot.gaps if g.sample_start > self._at))
        length = stop - self._at
        if length <= 0:
            return Block(0, ended=self._stopped.is_set())
        buffer[:length] = shot.counts[self._at : stop]
        lost: int | None = 0
        for gap in shot.gaps:
            if gap.sample_start == self._at:
                lost = None if gap.samples_lost is None else (lost or 0) + gap.samples_lost
        trigger = shot.trigger_sample if shot.column(Role.SWITCH) is None else None
        block = Block(
            samples=length,
            lost_before=lost,
            ended=stop == shot.samples,
            trigger_sample=trigger - self._at if trigger is not None and self._at <= trigger < stop else None,
        )
        self._at = stop
        if block.ended:
            self._stopped.set()
        return block

    def stop(self) -> None:
        self._stopped.set()

    def _wait_for_due(self, shot: Recording, wanted: int, timeout_s: float) -> int:
        """Wait for at least one sample, up to ``timeout_s``; return the index after the last sample due by now."""
        if not self._real_time:
            return shot.samples
        rate = shot.sample_rate_hz
        # wait for only half a buffer, so that a large buffer does not make the replay jerky
        aim = self._started_at + (self._at + max(1, wanted // 2)) / rate
        wait = min(aim - self._clock(), timeout_s)
        if wait > 0:
            self._sleep(wait)
        return min(shot.samples, round((self._clock() - self._started_at) * rate))

    def _upcoming(self) -> Recording:
        """Return the recording being played, or the next one if that is over."""
        if self._played and self._stopped.is_set():
            self._index = (self._index + 1) % len(self._shots)
            shot = self._shots[self._index]
            if not isinstance(shot, Recording):
                try:
                    shot = open_recording(shot)
                except RecordingError as error:
                    raise DigitizerError(str(error), "replay another recording") from error
            self._playing = shot
            self._played = False
        return self._playing


def open_digitizer(path: str, _: SourceOptions) -> ReplayDigitizer:
    """Return a digitizer that plays the recordings at a path."""
    if not Path(path).exists():
        raise DigitizerError(f"nothing to replay at {path}", "name a recording, or a folder that holds some")
    return ReplayDigitizer([path])
