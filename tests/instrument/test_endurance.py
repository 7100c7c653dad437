"""Many shots in a row leave no thread or memory behind; thousands: python -m tests.benchmarks.soak."""

import gc
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisSettings, Progress, Shot
from instrument.capture.analysis_thread import ShotAnalysis
from instrument.capture.capture import Capture
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import CaptureSettings
from tests.instrument.fake_digitizer import RATE_HZ, FakeDigitizer

PROC = Path("/proc/self")


def held() -> tuple[int, int, int]:
    """Return memory in bytes, threads and open handles."""
    gc.collect()
    pages = int((PROC / "statm").read_text().split()[1])
    return pages * 4096, threading.active_count(), len(list((PROC / "fd").iterdir()))


def analysed(recording: Recording, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
    total = int(recording.counts.sum())  # touches every page of the file
    return Shot(
        f"{recording.name} {total}", recording.path, AnalysisSettings(), recording.setup, None, None, None,
        None, None, None,
    )  # fmt: skip


@pytest.mark.skipif(not (PROC / "statm").exists(), reason="memory and handles are read from /proc")
def test_a_hundred_shots_leave_no_memory_threads_or_handles_behind(tmp_path: Path) -> None:
    settings = CaptureSettings(RATE_HZ, 200_000, 4_000)
    with Capture(FakeDigitizer(), CaptureOptions(tmp_path, settings), analysis=ShotAnalysis(analysed)) as capture:
        capture.arm(automatic=True)
        after = {}
        end = time.monotonic() + 60
        for shots in (40, 140):
            while capture.latest().shots < shots or len(capture.latest().waiting) > 3:
                assert time.monotonic() < end
                time.sleep(0.005)
                for path in sorted(tmp_path.glob("*.sigmf-data"))[:-5]:
                    path.unlink()
                    path.with_suffix(".sigmf-meta").unlink()
            after[shots] = held()
    # a hundred shots of 1.2 MB each: keeping one in ten would show
    assert after[140][0] - after[40][0] < 12_000_000
    assert after[140][1] == after[40][1]
    assert abs(after[140][2] - after[40][2]) <= 4  # files being written or analysed at that moment
