"""The trigger level is drawn, with its value, on the light switch's trace."""

import numpy as np
import pytest
from PySide6.QtWidgets import QWidget

from analysis.shot.recording import Channel, Recording, Role, Setup
from app.window.main_window import open_window
from app.window.panels import live
from app.window.panels.live import LivePanel
from app.window.panels.shot_raw import RawView, curves_of
from instrument.live.live_view import LiveWindow
from tests.app.rigs import still_bench

CHANNELS = tuple(Channel(role, 1e-3, 0.5 if role is Role.SWITCH else 0.0) for role in Role)
SWITCH = next(n for n, channel in enumerate(CHANNELS) if channel.role is Role.SWITCH)


def recording(trigger: int | None) -> Recording:
    counts = np.zeros((4000, len(CHANNELS)), np.int16)
    counts[1000:, SWITCH] = 3000
    counts[999, SWITCH] = 1000
    return Recording("shot", counts, 1e6, CHANNELS, Setup(0.02), trigger_sample=trigger)


@pytest.fixture
def roomy(monkeypatch):
    """Show the raw signals of LIVE on any screen and with any font."""
    monkeypatch.setattr(live, "MIN_RAW", -1000)


def lines_of(plot):
    return [
        line
        for line in plot.view.childGroup.childItems()
        if getattr(line, "angle", None) == 0 and hasattr(line, "label")
    ]


@pytest.mark.parametrize("trigger", [None, 1000])
def test_a_shot_shows_the_level_at_which_it_was_triggered(qtbot, trigger):
    parent = QWidget()
    qtbot.addWidget(parent)
    view = RawView(parent)
    taken = recording(trigger)
    view.show_recording(taken, 0.0)
    assert view.show_curves(curves_of(taken))
    plot = view.stack.plots[2]
    lines = lines_of(plot)
    assert [line.value() for line in lines] == ([] if trigger is None else [pytest.approx(2.5)])
    if trigger is not None:
        assert lines[0].label.format == "trigger, 2.5 V"
        untriggered = recording(None)
        view.show_recording(untriggered, 0.0)
        assert view.show_curves(curves_of(untriggered)) and not lines_of(plot)


def test_live_shows_the_thresholds_that_were_set_and_keeps_them_in_view(qtbot, roomy):
    panel = LivePanel()
    qtbot.addWidget(panel)
    panel.resize(1000, 1000)
    panel.show()
    raw = LiveWindow(20_000).view(np.arange(2000) / 30e6, np.zeros((2000, 3), np.float32), None, 0)
    panel.show_raw(raw, CHANNELS, (0.8, 2.0))
    plots = panel.raw.plots
    lines = lines_of(plots[SWITCH])
    assert [(line.value(), line.label.format) for line in lines] == [
        (0.8, "trigger low, 0.8 V"),
        (2.0, "trigger high, 2 V"),
    ]
    low, high = plots[SWITCH].view.viewRange()[1]
    assert low < 0.0 and high > 2.0  # the switch is at 0 V
    assert not any(lines_of(plot) for n, plot in enumerate(plots) if n != SWITCH)
    panel.show_raw(raw, CHANNELS)
    assert not lines_of(plots[SWITCH])


def test_live_shows_learned_thresholds_as_such(qtbot, roomy):
    panel = LivePanel()
    qtbot.addWidget(panel)
    panel.resize(1000, 1000)
    panel.show()
    raw = LiveWindow(20_000).view(np.arange(2000) / 30e6, np.zeros((2000, 3), np.float32), None, 0)
    panel.show_raw(raw, CHANNELS, (None, 0.64), True)
    (line,) = lines_of(panel.raw.plots[SWITCH])
    assert (line.value(), line.label.format) == (0.64, "trigger high (from the signal), 0.64 V")
    assert line.toolTip() == line.label.format  # in a low plot its name is read there


def test_a_running_bench_tells_the_thresholds_that_it_learned(qtbot, tmp_path, warm_kernels, roomy):
    """Only thresholds that were set had a line."""
    window = open_window(tmp_path, still_bench, apart=False)
    qtbot.addWidget(window)
    window.show()
    try:
        switch = window.panels.live.raw.plots[SWITCH]
        qtbot.waitUntil(lambda: bool(switch.levels), timeout=20_000)
        levels = dict(switch.levels)
        samples = window.rig.latest().live.raw_v[:, SWITCH]
        assert [words.split(",")[0] for words in levels] == [
            "trigger low (from the signal)",
            "trigger high (from the signal)",
        ]
        low, high = levels.values()  # which side is up is not known before the first step: both stand there
        assert low < samples.min() <= samples.max() < high
        range_v = abs(window.rig.channels[SWITCH].volts_per_count) * 2.0**12
        assert high - low < range_v
    finally:
        window.close()
