"""LIVE: its value axes stand still while noise runs through them, and go along when the block moves."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtTest import QTest

from analysis.reading.site import CRITERIA_M_PER_S, read_site
from analysis.shot.recording import Channel, Role
from analysis.signal.stream import LiveChunk
from app.window.panels import live
from app.window.panels.live import CRITERIA, LivePanel
from instrument.bench.frame import frame_of
from instrument.bench.site import Site
from instrument.live.live_view import LiveView, LiveWindow

RATE_HZ, PER_FRAME = 1e4, 350


@pytest.fixture
def panel(qtbot):
    shown = LivePanel()
    qtbot.addWidget(shown)
    shown.resize(1000, 700)
    shown.show()
    return shown


def views(frames: int, moving: range, speed: float) -> list[LiveView]:
    """Return what the frames of a stream show, the block moving in some of them."""
    window, random, shown = LiveWindow(20_000), np.random.default_rng(1), []
    for frame in range(frames):
        time_s = (frame * PER_FRAME + np.arange(PER_FRAME)) / RATE_HZ
        velocity = 1e-3 * random.standard_normal(PER_FRAME) + (speed if frame in moving else 0.0)
        window.add(LiveChunk(time_s, 2.7e6 - 3e6 * velocity, velocity, 20 * velocity, 2.7e6, None))
        shown.append(window.view(np.empty(0), np.empty((0, 0), np.float32), None, 0))
    return shown


def test_the_value_axis_stands_still_in_noise_and_follows_a_push(panel):
    plot = panel.stack.plots[1]
    ranges = []
    for view in views(200, range(60, 70), -0.3):
        panel.show_live(view)
        bottom, top = plot.view.viewRange()[1]
        seen = view.velocity_m_per_s
        assert bottom <= seen.min() and seen.max() <= top  # nothing is ever cut off
        ranges.append((bottom, top))
    assert len(set(ranges[10:60])) == 1
    assert ranges[65][0] < -0.3 < ranges[55][0]
    assert len(set(ranges[70:])) <= 3  # wide while the push is in view, close again when it has run out
    assert ranges[-1][1] - ranges[-1][0] < 0.05
    shown = panel.numbers["velocity"].text()
    assert abs(float(shown)) < 1e-3


def test_a_time_that_is_only_rounded_otherwise_draws_no_axis_anew(panel, monkeypatch):
    monkeypatch.setattr(live, "MIN_RAW", -1000)  # room on any screen
    panel.resize(1000, 701)
    channels = tuple(Channel(role, 1e-3) for role in (Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH))
    moved = []
    panel.raw.plots[0].view.sigXRangeChanged.connect(lambda *_: moved.append(1))
    window = LiveWindow(20_000)
    for frame in range(20):
        time_s = (31_234_567 * frame + np.arange(2000)) / 30e6  # a step that floats cannot all tell alike
        panel.show_raw(window.view(time_s, np.zeros((2000, 3), np.float32), None, 0), channels)
    assert len(moved) == 1


def test_digits_change_five_times_a_second_and_curves_with_every_picture(panel):
    (view,) = views(1, range(0), 0.0)
    texts, drawn = [], []
    for frame in range(6):
        speed = np.full_like(view.velocity_m_per_s, 0.01 * frame)
        panel.show_live(replace(view, time_s=view.time_s + 0.1 * frame, velocity_m_per_s=speed))
        texts.append(float(panel.numbers["velocity"].text()))
        drawn.append(panel._curves["velocity"].samples[-1])
    assert drawn == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.04, 0.05])
    assert texts == pytest.approx([0.0, 0.0, 0.02, 0.02, 0.04, 0.04])
    panel.show_live(None)
    panel.show_live(replace(view, time_s=view.time_s + 0.55))
    assert panel.numbers["velocity"].text() != live.DASH  # at once after a silence


def test_raw_signals_are_drawn_five_times_a_second_and_at_once_where_a_threshold_moves(panel, monkeypatch):
    monkeypatch.setattr(live, "MIN_RAW", 1)
    panel.resize(1000, 1000)
    QTest.qWait(20)
    channels = tuple(Channel(role, 1e-3) for role in (Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH))
    shown = []
    for frame in range(6):
        raw_v = np.full((200, 3), float(frame), np.float32)
        view = replace(views(1, range(0), 0.0)[0], raw_time_s=0.1 * frame + np.arange(200) / RATE_HZ, raw_v=raw_v)
        panel.show_raw(view, channels)
        shown.append(float(panel._raw_curves[0].samples[-1]))
    assert shown == [0.0, 0.0, 2.0, 2.0, 4.0, 4.0]
    panel.show_raw(view, channels, (0.8, 2.0))
    assert float(panel._raw_curves[0].samples[-1]) == 5.0


def test_an_axis_left_wide_by_hand_is_close_again_after_a_reset(panel):
    plot = panel.stack.plots[1]
    for view in views(20, range(0), 0.0):
        panel.show_live(view)
    before = plot.view.viewRange()[1]
    plot.view.y_set_by_user.emit(True)
    plot.view.setYRange(2 * before[0], 2 * before[1], padding=0)
    panel.show_live(view)
    assert plot.view.viewRange()[1][1] == pytest.approx(2 * before[1])
    plot.free_y()
    assert plot.view.viewRange()[1][1] < 1.2 * before[1]


@pytest.mark.parametrize(("lines", "seen"), [(1, True), (1000, False)])
def test_raw_signals_are_whole_or_not_there(panel, monkeypatch, lines, seen):
    """How many lines fit depends on the fonts; that too few show nothing must not."""
    channels = tuple(Channel(role, 1e-3) for role in (Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH))
    time_s = np.arange(200) / RATE_HZ
    view = replace(views(1, range(0), 0.0)[0], raw_time_s=time_s, raw_v=np.zeros((200, 3), np.float32))
    with monkeypatch.context() as patch:
        patch.setattr(live, "MIN_RAW", lines)
        panel.resize(1000, 990)
        QTest.qWait(20)
        panel.show_raw(view, channels)
        assert panel.raw.isVisible() is seen
    panel.resize(1000, 1000)
    QTest.qWait(20)
    panel.show_raw(view, channels)
    assert panel.raw.isVisible()


def test_raw_signals_without_room_cost_nothing_and_are_there_when_there_is_room(panel, monkeypatch):
    channels = tuple(Channel(role, 1e-3) for role in (Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH))
    raw_v = np.random.default_rng(1).standard_normal((200, 3)).astype(np.float32)
    view = replace(views(1, range(0), 0.0)[0], raw_time_s=np.arange(200) / RATE_HZ, raw_v=raw_v)
    with monkeypatch.context() as patch:
        patch.setattr(live, "MIN_RAW", 1000)
        panel.resize(1000, 990)
        QTest.qWait(20)
        panel.show_raw(view, channels)
        assert not panel.raw.isVisible()
        assert all(len(curve.samples) == 0 for curve in panel._raw_curves)
    panel.hold.setChecked(True)  # no newer samples come, the held ones are shown
    monkeypatch.setattr(live, "MIN_RAW", 1)
    panel.resize(1000, 1000)
    QTest.qWait(20)
    assert panel.raw.isVisible()
    for column, curve in enumerate(panel._raw_curves):
        assert np.array_equal(curve.samples, raw_v[-live.RAW_SHOWN :, column])


def test_the_floor_of_the_site_is_shown_with_its_lines_and_advice(panel):
    rate = 2500.0
    time_s = np.arange(round(2 * rate)) / rate
    still = frame_of(Site(third_octave_m_per_s=4e-7), 1).motion(time_s)[1]
    floor = read_site(still + 5e-5 * np.sin(2 * np.pi * 24.9 * time_s), rate)
    panel.floor.show_floor(None)
    assert "rest" in panel.floor.summary.text() and not panel.floor.lines.text()
    (view,) = views(1, range(0), 0.0)
    panel.show_live(replace(view, floor=floor))
    assert "u(COR)" in panel.floor.summary.text() and "24.9" in panel.floor.lines.text()
    assert "costs you a factor" in panel.floor.advice.text()
    assert panel.floor.plot.columns["rms velocity (m/s)"] is floor.third_octave_m_per_s


def test_before_the_block_has_rested_the_criteria_stand_where_they_belong(panel):
    (left, right), (low, high) = panel.floor.plot.plot.view.viewRange()
    assert 10**left == pytest.approx(4.0, rel=0.2) and 10**right == pytest.approx(400.0, rel=0.2)
    assert 0.3 < 10**low < 0.78 and 50 < 10**high < 150  # VC-G to VC-A in µm/s
    for name, curve in zip(CRITERIA, panel.floor.plot.plot.sampled[:-1], strict=True):
        x, y = curve.getData()
        assert 10**x == pytest.approx([8.0, 80.0]) and 10**y == pytest.approx(2 * [1e6 * CRITERIA_M_PER_S[name]])
