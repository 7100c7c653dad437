"""Thousands of simulated shots in a row: ``python -m tests.benchmarks.soak [--shots 2000] [--fit] [--apart]``.

Bench as fast as it is read, light switch, recording, live picture and analysis; recordings are deleted as they come.
Prints memory, threads and file handles after warm-up and at the end (targets: memory < 1 % more, the others equal),
and fails where a shot was lost, cut short or not analysed.  ``--apart``: digitizer and analysis in processes of their
own, as the program has them; memory is then that of all three.
"""

import argparse
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

from analysis.pipeline import read
from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisSettings, Progress, Shot
from instrument.bench.digitizer import BenchDigitizer
from instrument.bench.rig import Bench
from instrument.capture.acquisition import State
from instrument.capture.analysis_thread import ShotAnalysis, fit_here
from instrument.capture.capture import Capture
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import CaptureSettings
from instrument.process.subprocess_digitizer import SubprocessDigitizer
from instrument.process.subprocess_worker import SubprocessAnalysis
from tests.benchmarks.streaming import resident_bytes, sweep

RATE_HZ = 8e6
SHOT = CaptureSettings(RATE_HZ, 400_000, 60_000)
WARM_UP = 0.2  # of the shots
LOOK_EVERY = 5  # shots
LINES = 20


def handles() -> int:
    """Return the number of open file handles of this process."""
    return len(list(Path("/proc/self/fd").iterdir()))


class _Seen:
    """Memory, threads and handles against the number of shots."""

    def __init__(self) -> None:
        self.shots: list[int] = []
        self.values: list[tuple[float, float, float]] = []

    def look(self, shots: int) -> None:
        """Read all three."""
        self.shots.append(shots)
        self.values.append((resident_bytes(), threading.active_count(), handles()))

    def growth(self, warm_shots: float) -> dict[str, tuple[float, float]]:
        """Return (median of the first quarter after warm-up, of the last quarter) of each."""
        warm = [values for shots, values in zip(self.shots, self.values, strict=True) if shots >= warm_shots]
        quarter = max(1, len(warm) // 4)
        columns = zip(*warm, strict=True)
        return {
            name: (median(column[:quarter]), median(column[-quarter:]))
            for name, column in zip(("memory", "threads", "handles"), columns, strict=True)
        }

    def __str__(self) -> str:
        memory, threads, open_ = self.values[-1]
        return f"{memory / 1e6:7.1f} MB  {threads:.0f} threads  {open_:.0f} handles"


def soak(
    shots: int, *, fit: bool, apart: bool = False, say: Callable[[str], None] = print
) -> dict[str, tuple[float, float]]:
    """Take ``shots`` shots; return (after warm-up, at the end) of memory in bytes, threads and handles."""
    settings = AnalysisSettings(fit=fit)
    analyst = SubprocessAnalysis()

    def analysed(recording: Recording, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
        if apart:
            return analyst.read(recording, settings, progress, cancelled)
        return read(recording, settings, progress=progress, cancelled=cancelled)

    def fitted(shot: Shot, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
        return analyst.fit(shot, progress, cancelled) if apart else fit_here(shot, progress, cancelled)

    seen = _Seen()
    problems: deque[str] = deque(maxlen=20)
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bench = partial(BenchDigitizer, Bench(seed=7), real_time=False, first_push_s=0.02, push_every_s=0.01)
        digitizer = SubprocessDigitizer(bench) if apart else bench()
        options = CaptureOptions(folder, SHOT)
        with Capture(digitizer, options, analysis=ShotAnalysis(analysed, fitted, 8), say=problems.append) as capture:
            settled = asked = 0
            while settled < shots:
                now = capture.latest()
                if now.state is State.FAULT:
                    raise SystemExit(f"fault after {settled} shots: {now.message}; {list(problems)}")
                for shot in sorted((new for new in now.finished if new.number > settled), key=lambda shot: shot.number):
                    if shot.number != settled + 1:
                        raise SystemExit(f"shots {settled + 1} to {shot.number - 1} were passed over")
                    settled = shot.number
                    if shot.problem or shot.shot is None or shot.shot.motion is None:
                        problems.append(f"{shot.name}: {shot.problem or (shot.shot and shot.shot.problem)}")
                if now.state in (State.IDLE, State.ANALYSING) and now.shots == asked and len(now.waiting) < 4:
                    capture.arm()  # while the shot before is still being analysed
                    asked += 1
                if not seen.shots or settled >= seen.shots[-1] + LOOK_EVERY:
                    sweep(folder, keep=20)
                    seen.look(settled)
                    if settled % (LOOK_EVERY * max(1, shots // LOOK_EVERY // LINES)) < LOOK_EVERY:
                        say(f"{settled:6d} shots {settled / (time.perf_counter() - begun):5.2f}/s  {seen}")
                time.sleep(0.01)
    analyst.close()
    say(f"{settled} shots in {time.perf_counter() - begun:.0f} s; problems: {list(problems) or 'none'}")
    return seen.growth(WARM_UP * shots)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--shots", type=int, default=2000)
    parser.add_argument("--fit", action="store_true", help="fit the base model too")
    parser.add_argument("--apart", action="store_true", help="digitizer and analysis in processes of their own")
    options = parser.parse_args()
    for key, (first, last) in soak(options.shots, fit=options.fit, apart=options.apart).items():
        print(f"{key:8s} {first:14.0f} after warm-up {last:14.0f} at the end  {100 * (last - first) / first:+.2f} %")


if __name__ == "__main__":
    main()
