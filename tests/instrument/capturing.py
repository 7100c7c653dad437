"""A capture of a known digitizer, for tests: runs in a folder, waits for states, checks the samples."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisSettings, Shot
from instrument.capture.capture import Capture
from instrument.capture.snapshot import Snapshot
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import CaptureSettings
from instrument.devices.ring import Ring
from tests.instrument.fake_digitizer import FIRST, HIGH, PERIOD, RATE_HZ, FakeDigitizer, samples

SETTINGS = CaptureSettings(RATE_HZ, 20_000, 4_000)


def append(ring: Ring, counts: np.ndarray) -> None:
    """Write samples of shape (n, channels) into a ring, whatever their number."""
    done = 0
    while done < counts.shape[0]:
        view = ring.space(counts.shape[0] - done)
        view[:] = counts[done : done + view.shape[0]]
        ring.commit(view.shape[0])
        done += view.shape[0]


def until(capture: Capture, true: Callable[[Snapshot], bool], longest_s: float = 20.0) -> Snapshot:
    """Return the first snapshot of which ``true`` holds."""
    end = time.monotonic() + longest_s
    while not true(now := capture.latest()):
        assert time.monotonic() < end, now
        time.sleep(0.002)
    return now


def analysed(recording: Recording, progress: Callable[[str, float], None], cancelled: Callable[[], bool]) -> Shot:
    progress("looking", 0.5)
    return Shot(
        recording.name, recording.path, AnalysisSettings(), recording.setup, recording.sample_rate_hz,
        recording.samples, recording.trigger_time_s, None, None, None,
    )  # fmt: skip


class Capturing:
    """A capture in a folder, with what it said."""

    def __init__(self, folder: Path, digitizer: FakeDigitizer | None = None, **how: object) -> None:
        self.digitizer = digitizer or FakeDigitizer()
        self.said: list[str] = []
        options = how.pop("options", CaptureOptions(folder, SETTINGS))
        self.capture = Capture(self.digitizer, options, say=self.said.append, **how)  # type: ignore[arg-type]

    def __enter__(self) -> "Capturing":
        self.capture.start()
        return self

    def __exit__(self, *exception: object) -> None:
        assert self.capture.close()
        assert self.digitizer.closed


def assert_true_samples(recording: Recording) -> int:
    """Check that a recording holds the fake's samples around a step, and return the number of its first one."""
    assert recording.trigger_sample is not None
    trigger = recording.trigger_sample
    first = None
    for k in range(800):  # which of the fake's steps, up or down, it was
        at = FIRST + k // 2 * PERIOD + k % 2 * HIGH - trigger
        if at >= 0 and np.array_equal(recording.counts[: trigger + 1], samples(at, trigger + 1)):
            first = at
            break
    assert first is not None
    np.testing.assert_array_equal(recording.counts, samples(first, recording.samples))
    return first
