"""Plots of a report, read back from their SVG: every mark stands where its number belongs."""

import math
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.report.svg_plot import WIDTH, Band, Dot, Line, NoteMark, Plot, decimate_curve, draw, ticks


class Read(HTMLParser):
    """The elements of one plot, the frame of its axes, and places turned back into numbers."""

    def __init__(self, plot: Plot, **size: int) -> None:
        super().__init__()
        self.of: list[tuple[str, dict[str, str], str]] = []
        self.feed(draw(plot, **size))
        frame = self.all("rect", "frame")[0][0]
        self.left, self.top = float(frame["x"]), float(frame["y"])
        self.right, self.bottom = self.left + float(frame["width"]), self.top + float(frame["height"])

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.of.append((tag, dict(attrs), ""))

    handle_startendtag = handle_starttag

    def handle_data(self, data: str) -> None:
        tag, attributes, text = self.of.pop()
        self.of.append((tag, attributes, text + data))

    def all(self, tag: str, class_: str) -> list[tuple[dict[str, str], str]]:
        return [(given, text) for name, given, text in self.of if name == tag and given.get("class") == class_]

    def scale(self, kind: str) -> Any:
        """Return the function from a place to its number that the ticks of an axis state."""
        ticked = [
            (float(at["x" if kind == "x" else "y"]), _number(text)) for at, text in self.all("text", f"tick-{kind}")
        ]
        places, values = np.array(ticked).T
        if kind == "y":
            places = places - 3.5  # the text's base line below its level
        slope, zero = np.polyfit(places, values, 1)
        assert np.abs(np.polyval((slope, zero), places) - values).max() < 0.12 * abs(slope)
        return lambda place: slope * np.asarray(place, float) + zero

    def points(self, class_: str) -> tuple[np.ndarray, np.ndarray]:
        (path,) = self.all("path", class_)
        x, y = np.array([pair.split() for pair in re.split("[MLZ]", path[0]["d"]) if pair], float).T
        return self.scale("x")(x), self.scale("y")(y)


def _number(text: str) -> float:
    return float(text.replace("\u2212", "-"))


X, Y = np.array([0.0, 1.0, 2.5, 4.0]), np.array([-30.0, 10.0, 70.0, 20.0])


def test_a_line_stands_where_the_ticks_say_and_fills_the_axes_but_for_a_margin() -> None:
    seen = Read(Plot("time (s)", "force (N)", (Line(X, Y, "measured"),)), height=300)
    x, y = seen.points("measured")
    assert x == pytest.approx(X, abs=0.01) and y == pytest.approx(Y, abs=0.4)
    assert seen.scale("x")([seen.left, seen.right]) == pytest.approx([0.0, 4.0], abs=0.01)
    assert seen.scale("y")([seen.bottom, seen.top]) == pytest.approx([-36.0, 76.0], abs=0.5)  # 6 % of 100 each
    (svg,) = [given for name, given, _ in seen.of if name == "svg"]
    assert (svg["viewbox"], svg["aria-label"]) == (f"0 0 {WIDTH} 300", "force (N) against time (s)")
    (grid,) = {len(seen.all("line", "grid"))}
    assert grid == len(seen.all("text", "tick-x")) + len(seen.all("text", "tick-y"))


def test_a_given_span_cuts_and_only_what_is_inside_sets_the_height() -> None:
    plot = Plot("x", "y", (Line(X, Y, "measured"),), x_span=(0.5, 3.0), marks=(0.4, 0.6, 3.1))
    seen = Read(plot)
    assert seen.scale("x")([seen.left, seen.right]) == pytest.approx([0.5, 3.0], abs=0.01)
    assert seen.scale("y")([seen.bottom, seen.top]) == pytest.approx([6.4, 73.6], abs=0.4)  # of 10 to 70
    (mark,) = seen.all("line", "mark")
    assert seen.scale("x")(mark[0]["x1"]) == pytest.approx(0.6, abs=0.01) and mark[0]["x1"] == mark[0]["x2"]


def test_dots_have_their_bars_their_words_and_a_margin() -> None:
    dots = (Dot(1.0, 5.0, 2.0, "first"), Dot(3.0, 8.0, 0.5))
    seen = Read(Plot("x", "y", dots=dots), width=400)
    assert seen.scale("x")([seen.left, seen.right]) == pytest.approx([0.88, 3.12], abs=0.01)
    at = [seen.scale(axis)([float(given[f"c{axis}"]) for given, _ in seen.all("circle", "dot")]) for axis in "xy"]
    assert at[0] == pytest.approx([1.0, 3.0], abs=0.01) and at[1] == pytest.approx([5.0, 8.0], abs=0.05)
    bars = [seen.scale("y")([float(given["y1"]), float(given["y2"])]) for given, _ in seen.all("line", "bar")]
    assert np.array(bars) == pytest.approx(np.array([[3.0, 7.0], [7.5, 8.5]]), abs=0.05)
    assert [text for name, _, text in seen.of if name == "title"] == ["first"]
    assert seen.scale("y")([seen.bottom, seen.top]) == pytest.approx([3 - 0.06 * 5.5, 8.5 + 0.06 * 5.5], abs=0.05)


@pytest.mark.parametrize(("level", "seen"), [(-1.0, 1), (1.0, 0)])
def test_a_zero_line_is_drawn_between_values_of_both_signs_and_always_in_view(level: float, seen: int) -> None:
    shown = Read(Plot("x", "y", (Line(X, np.array([level, 2.0, 3.0, 4.0]), "measured"),), zero_line=True))
    lines = shown.all("line", "zero")
    assert len(lines) == 1  # zero is within the margin at least
    assert shown.scale("y")(lines[0][0]["y1"]) == pytest.approx(0.0, abs=0.05)
    assert not Read(Plot("x", "y", (Line(X, Y, "measured"),))).all("line", "zero")
    assert seen == int(shown.scale("y")(shown.bottom) < -0.5)


def test_a_band_reaches_to_both_sides_and_sets_the_height_by_all_but_its_extremes() -> None:
    x = np.linspace(0.0, 1.0, 101)
    half = np.full(101, 2.0)
    half[[3, 50, 51]] = 1e6  # the edge of a gap
    half[70] = np.nan
    seen = Read(Plot("x", "y", (Line(x, 0 * x, "measured"),), bands=(Band(x, half),)))
    assert seen.scale("y")([seen.bottom, seen.top]) == pytest.approx([-2.24, 2.24], abs=0.03)
    _, y = seen.points("band")
    assert y.size == 200 and np.median(y[:100]) == pytest.approx(2.0, abs=0.03) == -np.median(y[100:])
    assert not [
        given["d"]
        for given, _ in Read(Plot("x", "y", bands=(Band(x, 0 * x + np.nan),))).all("path", "band")
        if given["d"]
    ]


@pytest.mark.parametrize(
    ("x", "y", "side", "below"),
    [(0.1, 0.9, "remark-right", True), (0.9, 0.9, "remark-left", True), (0.1, 0.1, "remark-right", False)],
)
def test_a_remark_s_text_lies_towards_the_middle_of_the_plot(x: float, y: float, side: str, below: bool) -> None:
    frame = Line(np.array([0.0, 1.0]), np.array([0.0, 1.0]), "measured")
    seen = Read(Plot("x", "y", (frame,), remarks=(NoteMark(x, y, "look"), NoteMark(1.1, 5.0, "outside"))))
    ((given, text),) = seen.all("text", side)
    ((dot, _),) = seen.all("circle", "remark-dot")
    assert text == "look" and [seen.scale("x")(dot["cx"]), seen.scale("y")(dot["cy"])] == pytest.approx(
        [x, y], abs=0.01
    )
    assert (float(given["x"]) > float(dot["cx"])) == (side == "remark-right")
    assert (float(given["y"]) > float(dot["cy"])) == below
    assert seen.scale("y")(seen.top) < 1.2  # what is outside makes no room


def test_nothing_and_a_single_level_still_have_axes() -> None:
    empty = Read(Plot("x", "y"))
    assert empty.scale("x")([empty.left, empty.right]) == pytest.approx([0.0, 1.0], abs=0.01)
    flat = Read(Plot("x", "y", (Line(X, np.full(4, 40.0), "measured"),)))
    assert flat.scale("y")([flat.bottom, flat.top]) == pytest.approx([38.0, 42.0], abs=0.05)
    zero = Read(Plot("x", "y", (Line(X, np.zeros(4), "measured"),)))
    assert zero.scale("y")([zero.bottom, zero.top]) == pytest.approx([-0.5, 0.5], abs=0.01)


def test_a_loop_keeps_its_order_and_loses_only_points_that_share_a_pixel() -> None:
    turn = np.linspace(0.0, 2 * np.pi, 5000)
    seen = Read(Plot("x", "y", (Line(np.cos(turn), np.sin(turn), "measured"),)), width=300)
    x, y = seen.points("measured")
    assert 300 < x.size < 2500 and np.hypot(x, y) == pytest.approx(1.0, abs=0.02)
    assert np.all(np.diff(np.unwrap(np.arctan2(y, x))) > -0.02)
    gap = np.cos(turn)
    gap[2000:2500] = np.nan
    (path,) = Read(Plot("x", "y", (Line(gap, np.sin(turn), "measured"),))).all("path", "measured")
    assert path[0]["d"].count("M") == 2


@given(st.floats(-1e6, 1e6), st.floats(1e-9, 1e6), st.integers(2, 14))
def test_ticks_are_the_finest_round_places_of_which_there_are_few_enough(low: float, span: float, most: int) -> None:
    high = low + span
    if not high - low > 1e-6 * abs(low):
        return
    places, decimals = ticks(low, high, most)
    steps = [m * 10.0**k for k in range(-12, 8) for m in (1, 2, 5)]
    if any(abs((high - low) / step / most - 1) < 1e-9 for step in steps):
        return  # rounding decides
    fitting = next(n for n, step in enumerate(steps) if (high - low) / step < most)

    def multiples(step: float) -> list[float]:
        return [n * step for n in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]

    alone = len(multiples(steps[fitting])) < 2  # one tick gives no scale: the next finer ones
    step = steps[fitting - alone]
    assert len(places) >= 2 and (alone or len(places) <= most)
    tolerance = 1e-6 * step
    expected = multiples(step)
    assert places == pytest.approx(expected, abs=tolerance)
    assert all(abs(float(f"{place:.{decimals}f}") - place) <= tolerance for place in places)
    assert decimals == 0 or any(abs(float(f"{place:.{decimals - 1}f}") - place) > tolerance for place in (step,))


def test_a_span_without_width_has_one_tick() -> None:
    assert ticks(2.5, 2.5, 5) == ([2.5], 3) == ticks(2.5, math.inf, 5)


@given(st.integers(0, 2**32 - 1), st.integers(3, 40), st.booleans())
def test_thinned_out_a_column_keeps_its_lowest_and_highest_in_their_order(seed: int, columns: int, gaps: bool) -> None:
    random = np.random.default_rng(seed)
    x, y = np.sort(random.uniform(-1.0, 11.0, 400)), random.normal(size=400)
    if gaps:
        y[random.random(400) < 0.5] = np.nan
    left, right = 0.0, 10.0
    at, kept = decimate_curve(x, y, left, right, columns)
    begin, end = np.searchsorted(x, (left, right))
    x, y = x[begin : end + 1], y[begin : end + 1]
    if x.size <= 2 * columns:
        assert np.array_equal(at, x) and np.array_equal(kept, y, equal_nan=True)
        return
    column = np.minimum(((x - left) / (right - left) * columns).astype(int), columns - 1)
    pairs = iter(zip(at.reshape(-1, 2), kept.reshape(-1, 2), strict=True))
    for number in np.unique(column):
        places, pair = next(pairs)
        inside = y[column == number]
        assert places == pytest.approx(left + (number + 0.5) * (right - left) / columns)
        finite = inside[np.isfinite(inside)]
        if not finite.size:
            assert np.isnan(pair).all()
            continue
        assert sorted(pair) == [finite.min(), finite.max()]
        if np.isfinite(inside[[0, -1]]).all() and inside[0] != inside[-1]:
            assert (pair[0] <= pair[1]) == (inside[0] <= inside[-1])
    assert next(pairs, None) is None
