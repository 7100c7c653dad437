"""The simulated bench at 30 MS/s, 12 bit, paced by the clock, through trigger, demodulation, recording and window.

``python -m tests.benchmarks.streaming [--seconds 60] [--no-window]`` prints what was lost (target: nothing), the
longest time the screen stood still (target: 50 ms), memory and how busy the machine was.  Shots are taken and
analysed all the while.  Recordings are deleted as they come, so that the disk does not fill.
"""

import argparse
import os
import resource
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from analysis.pipeline import analyse
from analysis.recording import Recording
from analysis.shot import AnalysisSettings, Progress, Shot
from instrument.bench.digitizer import BenchDigitizer
from instrument.capture import Capture, CaptureOptions
from instrument.digitizer import CaptureSettings
from instrument.snapshot import Snapshot

RATE_HZ = 30e6
SHOT = CaptureSettings(RATE_HZ, 5_000_000, 250_000)
FRAME_S = 1 / 30


def resident_bytes() -> int:
    """Return the memory that this process holds, mapped recordings not counted."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("RssAnon"):
            return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


@dataclass
class Seen:
    """What was observed while it ran."""

    frames: int = 0
    longest_s: float = 0.0
    memory: list[int] = field(default_factory=list)
    last_s: float | None = None
    end: Snapshot | None = None

    def frame(self) -> None:
        """Count a frame of the screen."""
        now = time.perf_counter()
        if self.last_s is not None:
            self.longest_s = max(self.longest_s, now - self.last_s)
        self.last_s = now
        self.frames += 1


def analyse_shot(recording: Recording, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
    """Analyse as the window does."""
    return analyse(recording, AnalysisSettings(), progress, cancelled)


def thread_seconds() -> dict[str, float]:
    """Return the processor time of each thread of this process, in s (Linux)."""
    tick = os.sysconf("SC_CLK_TCK")
    names = {str(t.native_id): t.name for t in threading.enumerate()}
    spent: dict[str, float] = {}
    for task in Path("/proc/self/task").iterdir():
        numbers = (task / "stat").read_text().rsplit(")", 1)[1].split()
        name = names.get(task.name, "demodulation of a shot and others")
        spent[name] = spent.get(name, 0.0) + (int(numbers[11]) + int(numbers[12])) / tick
    return spent


def sweep(folder: Path, keep: int = 3) -> None:
    """Delete all but the newest recordings."""
    for path in sorted(folder.glob("*.sigmf-meta"))[:-keep]:
        path.unlink(missing_ok=True)
        path.with_suffix(".sigmf-data").unlink(missing_ok=True)


def without_window(capture: Capture, seconds: float, seen: Seen, folder: Path) -> None:
    """Pull snapshots as a window would."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        seen.end = capture.latest()
        seen.frame()
        if seen.frames % 30 == 0:
            seen.memory.append(resident_bytes())
            sweep(folder)
        time.sleep(FRAME_S)


def report(seen: Seen, seconds: float, stream_s: float, busy_s: float, threads: dict[str, float]) -> None:
    """Print the figures."""
    end = seen.end
    assert end is not None
    signal = end.signal
    half = seen.memory[len(seen.memory) // 2 :] or [0]
    warm = seen.memory[len(seen.memory) // 4 : len(seen.memory) // 2] or [0]
    print(f"state at the end      {end.state} {end.message}")
    print(f"lost                  {signal.samples_lost} samples at {signal.losses} places     (target 0)")
    print(f"streamed              {stream_s:.1f} s of samples in {seconds:.1f} s")
    print(f"shots                 {end.shots} captured, {end.analysing} waiting for analysis")
    print(f"screen stood longest  {seen.longest_s * 1e3:.1f} ms between frames 33 ms apart, {seen.frames} frames")
    print(f"screen late by        {max(0.0, seen.longest_s - FRAME_S) * 1e3:.1f} ms     (target 50 ms)")
    print(f"passed over on screen {end.live.skipped / max(1.0, RATE_HZ * seconds):.1%} of the samples")
    print(f"memory                {max(warm) / 1e6:.0f} MB after warm-up, {max(half) / 1e6:.0f} MB at most after that")
    print(f"processor             {busy_s / stream_s:.2f} s a second of samples with the bench; {os.cpu_count()} cores")
    for name, spent in sorted(threads.items(), key=lambda item: -item[1]):
        print(f"    {spent / stream_s:5.2f}  {name}")


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--memory", type=float, default=0.5, help="s of samples the bench holds before it loses them")
    parser.add_argument("--no-window", action="store_true")
    parser.add_argument("--no-analysis", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        digitizer = BenchDigitizer(memory_s=options.memory, push_every_s=1.0)
        capture = Capture(
            digitizer, CaptureOptions(folder, SHOT), analyse=None if options.no_analysis else analyse_shot
        )
        with capture:
            while capture.latest().signal.switch_toggles < 2:  # kernels compiled, the first push seen
                time.sleep(0.1)
            capture.arm(automatic=True)
            seen = Seen()
            busy, before = time.process_time(), thread_seconds()
            begun, first = time.perf_counter(), capture.latest().signal.samples_read
            without_window(capture, options.seconds, seen, folder)
            seconds = time.perf_counter() - begun
            spent = {name: s - before.get(name, 0.0) for name, s in thread_seconds().items()}
            assert seen.end is not None
            stream_s = (seen.end.signal.samples_read - first) / RATE_HZ
            report(seen, seconds, stream_s, time.process_time() - busy, spent)


if __name__ == "__main__":
    main()
