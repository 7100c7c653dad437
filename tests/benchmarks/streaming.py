"""The simulated bench at 30 MS/s, 12 bit, paced by the clock, through trigger, demodulation, recording and window.

``python -m tests.benchmarks.streaming [--seconds 60] [--no-window]`` prints what was lost (target: nothing), the
longest time the screen stood still (target: 50 ms), memory and how busy the machine was.  Shots are taken and
analysed all the while.  Recordings are deleted as they come, so that the disk does not fill.
With ``--pages`` no shot is taken: how busy is the window's process at LIVE (target: 0.20 of a core) and at a page that
stands still (target: 0.03)?
"""

import argparse
import contextlib
import os
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from analysis.pipeline import analyse
from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisSettings, Progress, Shot
from instrument.bench.digitizer import BenchDigitizer
from instrument.capture.analysis_thread import ShotAnalysis
from instrument.capture.capture import Capture
from instrument.capture.snapshot import Snapshot
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import CaptureSettings, Digitizer
from instrument.process.subprocess_digitizer import SubprocessDigitizer

RATE_HZ = 30e6
SHOT = CaptureSettings(RATE_HZ, 5_000_000, 250_000)
FRAME_S = 1 / 30
TICK_MS = 5


def children() -> list[int]:
    """Return the process numbers of this process and of those it started (Linux)."""
    started = [int(child) for task in Path("/proc/self/task").glob("*/children") for child in task.read_text().split()]
    return [os.getpid(), *started]


def resident_bytes() -> int:
    """Return the memory that all our processes hold, what they share counted once, mapped recordings not counted."""
    total, shared = 0, 0
    for process in children():
        with contextlib.suppress(OSError):
            for line in Path(f"/proc/{process}/status").read_text().splitlines():
                if line.startswith("RssAnon"):
                    total += int(line.split()[1]) * 1024
                elif line.startswith("RssShmem"):
                    shared = max(shared, int(line.split()[1]) * 1024)
    return total + shared


def processor_seconds() -> float:
    """Return the processor time of all our processes, in s."""
    ticks = 0
    for process in children():
        with contextlib.suppress(OSError):
            spent = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
            ticks += int(spent[11]) + int(spent[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def waited_for_a_core_s() -> float:
    """Return how long this process's first thread was ready to run and had no core, in s."""
    return int(Path(f"/proc/self/task/{os.getpid()}/schedstat").read_text().split()[1]) / 1e9


@dataclass
class Seen:
    """What was observed while it ran."""

    frames: int = 0
    waits_s: list[tuple[float, float]] = field(default_factory=list)  # since the frame before; of it without a core
    memory: list[int] = field(default_factory=list)
    last_s: tuple[float, float] | None = None
    end: Snapshot | None = None

    def frame(self) -> None:
        """Count a frame of the screen."""
        now = time.perf_counter(), waited_for_a_core_s()
        if self.last_s is not None:
            self.waits_s.append((now[0] - self.last_s[0], now[1] - self.last_s[1]))
        self.last_s = now
        self.frames += 1


def digitizer_of(options: argparse.Namespace) -> Digitizer:
    """Return the bench as the command line asks for it: in a process of its own, or in this one."""
    opener = partial(BenchDigitizer, memory_s=options.memory, push_every_s=3.0)
    return opener() if options.in_process else SubprocessDigitizer(opener)


def analyse_shot(recording: Recording, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
    """Analyse as the window does."""
    return analyse(recording, AnalysisSettings(), progress=progress, cancelled=cancelled)


def thread_seconds() -> dict[str, tuple[float, float]]:
    """Return (processor time, time spent waiting for a core) of each thread of this process, in s (Linux)."""
    names = {str(t.native_id): t.name for t in threading.enumerate()}
    spent: dict[str, tuple[float, float]] = {}
    for task in Path("/proc/self/task").iterdir():
        ran, waited = (int(n) / 1e9 for n in (task / "schedstat").read_text().split()[:2])
        name = names.get(task.name, "helpers of the analysis and of Qt")
        before = spent.get(name, (0.0, 0.0))
        spent[name] = before[0] + ran, before[1] + waited
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


class _Application:
    """The window, offscreen, on a bench of ours; its own timer pulls, another one measures."""

    def __init__(self, folder: Path, options: argparse.Namespace) -> None:
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
        from PySide6.QtCore import Qt, QTimer
        from PySide6.QtWidgets import QApplication

        from app.session.settings import Settings
        from app.session.settings_store import save
        from app.window.main_window import open_window

        self.application = QApplication.instance() or QApplication(["levimass"])
        chosen = Settings(sample_rate_hz=RATE_HZ, duration_s=SHOT.samples / RATE_HZ, folder=str(folder))
        problem = save(folder / "settings" / "settings.json", chosen)
        assert problem is None, problem

        self.window = open_window(folder / "settings", lambda source: digitizer_of(options))
        self.window.show()
        self.rig = self.window.rig
        self.ticks = QTimer()
        self.ticks.setTimerType(Qt.TimerType.PreciseTimer)

    def until(self, true: Callable[[], bool]) -> None:
        """Let the window live until ``true`` holds."""
        while not true():
            self.application.processEvents()
            time.sleep(0.002)

    def show(self, page: int, seconds: float) -> None:
        """Show a page for so long, nobody touching anything."""
        from PySide6.QtCore import QEventLoop, QTimer

        self.window.panels.tabs.setCurrentIndex(page)
        loop = QEventLoop()
        QTimer.singleShot(round(seconds * 1e3), loop.quit)
        loop.exec()

    def run(self, seconds: float, seen: Seen, folder: Path) -> None:
        """Let the window live, a tick every 5 ms telling how long the screen stood still."""
        from PySide6.QtCore import QEventLoop, QTimer

        def tick() -> None:
            seen.frame()
            if seen.frames % 200 == 0:
                seen.end = self.rig.latest()
                seen.memory.append(resident_bytes())

        self.ticks.timeout.connect(tick)
        self.ticks.start(TICK_MS)
        sweeper = threading.Event()
        deleting = threading.Thread(target=lambda: [sweep(folder) for _ in iter(lambda: sweeper.wait(1.0), True)])
        deleting.start()
        loop = QEventLoop()  # not the application's own: quitting that would close the window
        QTimer.singleShot(round(seconds * 1e3), loop.quit)
        loop.exec()
        self.ticks.stop()
        seen.end = self.rig.latest()
        sweeper.set()
        deleting.join()


def report(seen: Seen, seconds: float, stream_s: float, busy_s: float, threads: dict[str, tuple[float, float]]) -> None:
    """Print the figures."""
    end = seen.end
    assert end is not None
    signal = end.signal
    half = seen.memory[len(seen.memory) // 2 :] or [0]
    warm = seen.memory[len(seen.memory) // 4 : len(seen.memory) // 2] or [0]
    print(f"state at the end      {end.state} {end.message}")
    print(f"lost                  {signal.samples_lost} samples at {signal.losses} places     (target 0)")
    print(f"streamed              {stream_s:.1f} s of samples in {seconds:.1f} s")
    print(f"shots                 {end.shots} captured, {len(end.waiting)} waiting for analysis")
    worst = sorted(seen.waits_s)[-5:]
    print(f"screen stood longest  {worst[-1][0] * 1e3:.1f} ms     (target 50 ms)")
    longest = ", ".join(f"{1e3 * wait:.0f} ({1e3 * no_core:.0f})" for wait, no_core in worst)
    print(f"    the five longest  {longest} ms of {seen.frames} ticks (of it ready, but other programs had the cores)")
    own = max(wait - no_core for wait, no_core in seen.waits_s)
    print(f"    without that      {1e3 * own:.0f} ms longest")
    print(f"passed over on screen {end.live.skipped / max(1.0, RATE_HZ * seconds):.1%} of the samples")
    print(f"memory                {max(warm) / 1e6:.0f} MB after warm-up, {max(half) / 1e6:.0f} MB at most after that")
    print(f"processor             {busy_s / stream_s:.2f} s a second of samples, all processes; {os.cpu_count()} cores")
    print("    of the wall: on a core, waiting for a core (other programs), else asleep or waiting for the interpreter")
    for name, (ran, waited) in sorted(threads.items(), key=lambda item: -item[1][0]):
        print(f"    {ran / seconds:5.2f} {waited / seconds:5.2f}  {name}")


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--memory", type=float, default=0.5, help="s of samples the bench holds before it loses them")
    parser.add_argument("--in-process", action="store_true", help="the bench in this process, not in one of its own")
    parser.add_argument("--no-window", action="store_true")
    parser.add_argument("--no-analysis", action="store_true")
    parser.add_argument("--pages", action="store_true", help="how busy the window is at two pages, no shot taken")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.no_window:
            digitizer = digitizer_of(options)
            analysis = None if options.no_analysis else analyse_shot
            with Capture(digitizer, CaptureOptions(folder, SHOT), analysis=ShotAnalysis(analysis)) as capture:
                while capture.latest().signal.switch_toggles < 2:  # kernels compiled, the first push seen
                    time.sleep(0.1)
                capture.arm(automatic=True)
                measured(capture.latest, lambda seen: without_window(capture, options.seconds, seen, folder))
        else:
            shown = _Application(folder, options)
            shown.until(
                lambda: shown.rig.latest().signal.switch_toggles >= 2 and not shown.window.workbench.jobs.open_jobs
            )
            if options.pages:
                pages(shown, options.seconds)
            else:
                shown.rig.set_rearm(True)
                shown.rig.arm()
                shown.until(lambda: shown.rig.latest().shots >= 2)  # the first analyses have compiled what they need
                measured(shown.rig.latest, lambda seen: shown.run(options.seconds, seen, folder))
            shown.window.close()


def pages(shown: _Application, seconds: float) -> None:
    """Print how busy the window's process is while a page is shown, by thread."""
    from app.window.panels.layout import Layout

    for name, page in (("LIVE", Layout.LIVE), ("DIAGNOSIS, standing still", Layout.DIAGNOSIS)):
        shown.show(page, 3.0)
        before = thread_seconds()
        shown.show(page, seconds)
        spent = spent_since(before)
        print(f"{sum(ran for ran, _ in spent.values()) / seconds:.3f} of a core at {name}")
        for thread, (ran, _) in sorted(spent.items(), key=lambda item: -item[1][0]):
            print(f"    {ran / seconds:.3f}  {thread}")


def spent_since(before: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Return how much more than ``before`` each thread has had and waited for, as ``thread_seconds`` does."""
    spent = {}
    for name, after in thread_seconds().items():
        ran, waited = before.get(name, (0.0, 0.0))
        spent[name] = max(0.0, after[0] - ran), max(0.0, after[1] - waited)
    return spent


def measured(latest: Callable[[], Snapshot], run: Callable[[Seen], None]) -> None:
    """Run and print what was seen, what it cost the processor, and how much of the stream it was."""
    seen = Seen()
    busy, before = processor_seconds(), thread_seconds()
    begun, first = time.perf_counter(), latest()
    run(seen)
    seconds = time.perf_counter() - begun
    spent = spent_since(before)
    assert seen.end is not None
    stream_s = (seen.end.signal.samples_read - first.signal.samples_read) / RATE_HZ
    lost = seen.end.signal.losses - first.signal.losses
    print(f"lost while measured   {lost} times")
    report(seen, seconds, stream_s, processor_seconds() - busy, spent)


if __name__ == "__main__":
    main()
