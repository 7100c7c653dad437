"""The floor of the site on LIVE: its third-octaves over the criteria, its lines and what they cost, in words."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.reading.site import CENTRES_HZ, CRITERIA_M_PER_S, MachineLine, SiteFloor
from app.window.controls.theme import LIGHT
from app.window.panels.live import (
    CRITERIA,
    LABELLED,
    NO_FLOOR,
    SiteFloorPanel,
    floor_words,
    line_words,
)

LINES = (
    MachineLine(49.971, 3e-9, "the mains"),
    MachineLine(8.0, 40e-9, "a pump", cost=1.24),
    MachineLine(100.0, 0.2e-9, "a transformer"),
    MachineLine(24.3, 5e-9, "a motor", cost=3.0),
    MachineLine(200.0, 0.05e-9, "a fan", cost=1.9),
)
FLOOR = SiteFloor(2.0, CENTRES_HZ, np.full(CENTRES_HZ.size, 2e-6), np.arange(3.0), np.ones(3), LINES, "VC-D", 0.00012)


@pytest.fixture
def panel(qtbot):
    one = SiteFloorPanel()
    qtbot.addWidget(one)
    return one


def test_the_four_fastest_lines_are_told_in_the_order_of_their_frequency() -> None:
    assert line_words(FLOOR) == [
        "8.00 Hz  40 nm  a pump",
        "24.30 Hz  5 nm  a motor",
        "49.97 Hz  3 nm  the mains",
        "100.00 Hz  200 pm  a transformer",
    ]
    assert line_words(replace(FLOOR, lines=())) == []


def test_the_criterion_and_the_uncertainty_to_expect_are_one_line() -> None:
    assert floor_words(FLOOR) == "Floor vibration meets VC-D. Expected u(COR) now: 0.0001"
    assert floor_words(replace(FLOOR, criterion="")).startswith("Floor vibration meets no criterion. Expected")


def test_what_costs_is_said_worst_first(panel) -> None:
    panel.show_floor(FLOOR)
    said = panel.advice.text().split("\n")
    assert said[0] == "A motor at 24.3 Hz costs you a factor 3.0 in the uncertainty of the restitution."
    assert "fan at 200.0 Hz costs you a factor 1.9" in said[1]
    assert panel.summary.text() == floor_words(FLOOR)
    assert panel.lines.text().split("\n") == line_words(FLOOR)


def test_the_criteria_are_levels_in_micrometres_per_second(panel) -> None:
    for name, curve, label in zip(CRITERIA, panel.plot.plot.sampled[:-1], panel._names, strict=True):
        x, y = curve.getData()
        level = 1e6 * CRITERIA_M_PER_S[name]
        assert 10 ** np.asarray(x) == pytest.approx([8.0, 80.0]) and 10 ** np.asarray(y) == pytest.approx(level)
        assert label.isVisible() == (name in LABELLED) and label.textItem.toPlainText() == name
        assert 10 ** label.pos().y() == pytest.approx(level) and 80.0 < 10 ** label.pos().x() < 90.0
    panel.apply_colours(LIGHT)
    assert {label.color.name() for label in panel._names} == {LIGHT.faint}


def _range(panel) -> tuple[list[float], list[float]]:
    x, y = panel.plot.plot.view.viewRange()
    return [10**value for value in x], [10**value for value in y]


def test_the_axes_hold_the_criteria_and_the_floor(panel) -> None:
    low, high = 1e6 * CRITERIA_M_PER_S["VC-G"] / 1.6, 1.6e6 * CRITERIA_M_PER_S["VC-A"]
    x, y = _range(panel)
    assert x == pytest.approx([CENTRES_HZ[0], CENTRES_HZ[-1]]) and y == pytest.approx([low, high])
    bands = np.geomspace(1e-9, 1e-3, CENTRES_HZ.size)
    panel.show_floor(replace(FLOOR, third_octave_m_per_s=bands))
    assert _range(panel)[1] == pytest.approx([1e-3 / 1.6, 1.6e3])
    at, level = panel._curve.getData()
    assert 10 ** np.asarray(at) == pytest.approx(CENTRES_HZ) and 10 ** np.asarray(level) == pytest.approx(1e6 * bands)
    assert panel.plot.columns["rms velocity (m/s)"] is bands
    assert panel.plot.columns["frequency (Hz)"] is CENTRES_HZ
    panel.show_floor(None)
    assert _range(panel)[1] == pytest.approx([low, high])
    assert [words.text() for words in (panel.summary, panel.lines, panel.advice)] == [NO_FLOOR, "", ""]


def test_a_band_without_motion_is_shown_at_the_bottom(panel) -> None:
    panel.show_floor(replace(FLOOR, third_octave_m_per_s=np.zeros(CENTRES_HZ.size)))
    assert np.isfinite(panel._curve.getData()[1]).all()
    assert _range(panel)[1][0] == pytest.approx(1e-6 / 1.6)
