"""The scale of the small plots of DIAGNOSIS, and that what they draw stands where the scale says."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtGui import QColor, QImage

from app.window.controls.theme import LIGHT, Tone
from app.window.plots.residual_grid import MOST, Cell, Overlay, ResidualGrid, SymLog, scale_of


@given(st.floats(1e-12, 1e-3), st.floats(1.1, 1e6), st.floats(-1.0, 1.0))
def test_a_place_on_the_scale_belongs_to_one_value(linear: float, ratio: float, place: float) -> None:
    scale = SymLog(linear, linear * ratio)
    value = math.copysign(linear * ((1 + ratio) ** abs(place) - 1), place)  # equal steps are equal factors of 1 + v/l
    assert scale.place(np.array([value, -value])) == pytest.approx([place, -place], abs=1e-9)
    beyond = scale.place(np.array([2 * scale.most, -2 * scale.most, np.nan, 0.0]))
    assert beyond[[0, 1, 3]].tolist() == [1.0, -1.0, 0.0] and np.isnan(beyond[2])


@pytest.mark.parametrize(
    ("linear", "most", "above"),
    [
        (2e-10, 5e-8, [1e-9, 1e-8]),
        (1e-10, 1e-8, [1e-10, 1e-9, 1e-8]),
        (1e-10, 1e-7, [1e-9, 1e-7]),  # every second of four
        (1e-12, 1e-6, [1e-12, 1e-9, 1e-6]),
        (2e-9, 9e-9, []),
    ],
)
def test_ticks_are_decades_of_both_signs_with_the_largest_among_them(linear, most, above) -> None:
    expected = [-v for v in above[::-1]] + [0.0] + above
    assert SymLog(linear, most).ticks() == pytest.approx(expected, rel=1e-9, abs=0.0)


def test_a_common_scale_is_linear_up_to_the_noise_and_reaches_the_largest_value() -> None:
    curves = [np.array([1e-9, -7e-9, np.nan]), np.array([2e-9]), np.full(3, np.nan), np.empty(0)]
    assert scale_of(curves, 1e-10) == SymLog(1e-10, 7e-9)
    assert scale_of(curves, 5e-9) == SymLog(5e-9, pytest.approx(5e-9 * 10**0.7, abs=0.0))  # at least 0.7 decades more
    for unknown in (math.nan, 0.0, math.inf):
        assert scale_of(curves, unknown) == SymLog(pytest.approx(7e-11, abs=0.0), 7e-9)
    assert scale_of([], math.nan) == SymLog(0.01, pytest.approx(0.01 * 10**0.7))
    assert scale_of([np.zeros(3)], math.nan).linear == 1.0


def _cell(values: list[float], noise: float = 1e-10, before: np.ndarray | None = None) -> Cell:
    after = np.repeat(values, 100)
    return Cell("shot-1", np.linspace(-5.0, 20.0, after.size), before, after, np.full(after.size, noise))


def _grid(qtbot, cells: list[Cell]) -> ResidualGrid:
    grid = ResidualGrid()
    qtbot.addWidget(grid)
    grid.apply_colours(LIGHT)
    grid.resize(600, 400)
    grid.show_cells(cells)
    return grid


def _rows(grid: ResidualGrid, colour: str) -> tuple[np.ndarray, np.ndarray]:
    """Return (x, y) of the pixels of a colour."""
    image = grid.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    wanted = QColor(colour).rgb() & 0xFFFFFF
    pixels = np.frombuffer(image.constBits(), np.uint32).reshape(image.height(), -1)[:, : image.width()] & 0xFFFFFF
    y, x = np.nonzero(pixels == wanted)
    return x, y


def test_a_residual_is_drawn_where_the_scale_puts_it(qtbot) -> None:
    levels = [-1e-8, -1e-9, 0.0, 1e-9, 1e-8]
    grid = _grid(qtbot, [_cell(levels, 5e-11)])
    assert grid.scale == SymLog(pytest.approx(1e-10, abs=0.0), pytest.approx(1e-8, abs=0.0))
    x, y = _rows(grid, LIGHT.residual)
    edges = np.linspace(x.min(), x.max() + 1, 6)
    drawn = [np.median(y[(x > a + 5) & (x < b - 5)]) for a, b in pairwise(edges)]
    middle, half = drawn[2], (drawn[0] - drawn[4]) / 2
    assert half > 100 and (middle - np.array(drawn)) / half == pytest.approx(
        grid.scale.place(np.array(levels)), abs=0.01
    )
    inside, heights = _rows(grid, LIGHT.band)  # two standard deviations: to where the linear part ends
    assert (heights.max() - heights.min()) / 2 / half == pytest.approx(grid.scale.place(np.array([1e-10]))[0], abs=0.02)
    assert inside.max() - inside.min() > 0.9 * (x.max() - x.min())


def test_what_a_candidate_explains_is_drawn_over_its_own_shot_and_goes(qtbot) -> None:
    before = np.full(300, 8e-9)
    grid = _grid(qtbot, [_cell([0.0] * 3, before=before), _cell([0.0] * 3)])
    assert _rows(grid, LIGHT.marker)[0].size > 50  # before
    assert not _rows(grid, LIGHT.simulated)[0].size
    grid.overlay([None, Overlay(np.full(300, 4e-9), np.full(300, -2e-9))])
    x, y = _rows(grid, LIGHT.simulated)
    remains = _rows(grid, LIGHT.signs[Tone.GOOD])[1]
    assert x.min() > 300 and y.max() < remains.min()
    grid.overlay([])
    assert not _rows(grid, LIGHT.simulated)[0].size


@pytest.mark.filterwarnings("ignore:All-NaN")
def test_a_gap_is_not_bridged_and_no_more_shots_are_shown_than_fit(qtbot) -> None:
    after = np.concatenate((np.full(100, 5e-9), np.full(100, np.nan), np.full(100, 5e-9)))
    grid = _grid(qtbot, [Cell("a", np.linspace(0.0, 1.0, 300), None, after, np.full(300, 1e-10))])
    x, _ = _rows(grid, LIGHT.residual)
    assert np.diff(np.unique(x)).max() == pytest.approx(np.ptp(x) / 3, rel=0.1)
    many = _grid(qtbot, [_cell([1e-9])] * (MOST + 3))
    assert len(many.cells) == MOST == 12
    assert many.accessibleDescription().startswith("12 shots; up to 1 nm, noise band 0.2 nm")
    unknown = _grid(qtbot, [_cell([1e-9], noise=math.nan), _cell([1e-9], noise=3e-10), _cell([1e-9], noise=1e-10)])
    assert unknown.scale.linear == pytest.approx(4e-10, abs=0.0)  # twice the median of those that are known
