"""``python -m tests.benchmarks.screen``: frames a second of the heaviest pictures, and the start to a usable window.

A frame is a change of the view, the decimation it asks for, and the whole widget painted by the raster engine.
"""

import json
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QApplication

from analysis.shot.recording import Channel, Recording, Role, Setup
from app.session.session import Session
from app.window.main_window import open_window
from app.window.panels.compare import ComparePanel
from app.window.panels.shot import ShotPanel
from app.window.panels.shot_raw import curves_of
from tests.app import rigs, synthetic
from tests.app.on_screen import read_entries

FRAMES = 40
TARGET_MS = 1000 / 30


def _frames(name: str, widget: pg.GraphicsView, move: Callable[[int], None], application: QApplication) -> None:
    wall, own = [], []
    for frame in range(FRAMES):
        begun, spent = time.perf_counter(), time.thread_time()
        move(frame)
        widget.viewport().repaint()
        application.processEvents()
        wall.append(1e3 * (time.perf_counter() - begun))
        own.append(1e3 * (time.thread_time() - spent))
    median, share = statistics.median(wall), statistics.median(own)
    verdict = "holds 30 Hz" if share < TARGET_MS else "misses 30 Hz"
    print(f"{name:<48}{median:7.1f} ms, of the processor {share:6.1f} ms (worst {max(own):.1f})   {verdict}")


def _recording() -> Recording:
    samples = 5_000_000
    phase = 2 * np.pi * 2.7e6 / 30e6 * np.arange(samples)
    beat = np.round(12000 * np.cos(phase)).astype(np.int16)
    counts = np.stack((beat, beat, beat), axis=1)
    roles = (Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH)
    return Recording("raw", counts, 30e6, tuple(Channel(role, 1e-4) for role in roles), Setup(0.01785), 200_000)


def main() -> None:
    """Print one line a picture, and the start."""
    application = QApplication.instance() or QApplication([])
    assert isinstance(application, QApplication)
    shots = [synthetic.shot(f"shot-{index}", 0.15 + 0.03 * index, index) for index in range(1, 9)]
    panel = ShotPanel()
    panel.resize(1400, 800)
    panel.show()
    recording = _recording()
    panel.show_shot(shots[0], recording)
    begun = time.perf_counter()
    curves = curves_of(recording)
    made = time.perf_counter()
    panel.raw.show_curves(curves)
    panel.set_view("raw")
    shown = time.perf_counter()
    print(f"{'raw view of 3 x 5 M samples: made in a thread':<48}{1e3 * (made - begun):7.1f} ms")
    print(f"{'                             shown':<48}{1e3 * (shown - made):7.1f} ms")

    def zoom_raw(frame: int) -> None:
        left, width = 5.0 + frame, 150.0 * 0.8**frame
        panel.raw.stack.zoom(left, left + max(width, 0.01))

    _frames("raw, 3 x 5 M samples, zooming in", panel.raw.stack, zoom_raw, application)
    panel.set_view("whole")
    _frames(
        "one shot with residual and band, panning",
        panel.stack,
        lambda f: panel.stack.zoom(-60 + f, 60 + f),
        application,
    )
    session = Session()
    for shot in shots:
        session.add(shot)
    compare = ComparePanel()
    compare.resize(1400, 800)
    compare.show()
    compare.show_entries(list(session.entries))
    _frames("eight overlaid shots, panning", compare.stack, lambda f: compare.stack.zoom(-60 + f, 60 + f), application)
    panel.close()
    compare.close()
    with tempfile.TemporaryDirectory() as folder:
        _start(Path(folder), application)


def _start(folder: Path, application: QApplication) -> None:
    chosen = {"levimass_settings": 1, "folder": str(folder / "data"), "edge": "rising"}  # not a block on its way back
    (folder / "settings.json").write_text(json.dumps(chosen))
    begun = time.perf_counter()
    window = open_window(folder, rigs.quick_bench)
    window.show()
    application.processEvents()
    shown = time.perf_counter() - begun
    while not (window.panels.controls.arm.isEnabled() and window.rig.channels):
        application.processEvents()
    usable = time.perf_counter() - begun
    print(f"{'window shown, and ARM answers (target 2 s)':<48}{shown:7.2f} s {usable:7.2f} s")
    longest, busiest, last, spent = 0.0, 0.0, time.perf_counter(), time.thread_time()
    window.rig_presenter.arm()
    end = last + 60.0
    while not read_entries(window.workbench.session) and last < end:
        application.processEvents()
        now, own = time.perf_counter(), time.thread_time()
        longest, busiest = max(longest, now - last), max(busiest, own - spent)
        last, spent = now, own
    words = "longest stop of the screen during a whole shot"
    print(f"{words:<48}{1e3 * longest:7.1f} ms, of the processor {1e3 * busiest:6.1f} ms")
    window.close()


if __name__ == "__main__":
    main()
