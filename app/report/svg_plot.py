"""Plots as inline SVG: axes with ticks, curves with at most two points per pixel that keep all peaks.

Own code, because ``--report`` should need neither Qt (an application object) nor matplotlib (100 MB for a few axes),
and because inline elements take their colours from the page's style sheet, on screen and in print.
"""

import math
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from itertools import pairwise

import numpy as np

from analysis.shot import Floats
from app.words import Markup, tag

WIDTH = 760  # width of a plot that spans the page, in CSS pixels
_LEFT, _RIGHT, _TOP, _BOTTOM = 66, 10, 8, 40  # margins; _LEFT grows for long labels
_DIGIT = 6.4  # width of a label's character


@cache
def style_sheet() -> str:
    """Return the style sheet of a report and its figures."""
    return resources.files("resources").joinpath("report.css").read_text(encoding="utf-8")


@dataclass(frozen=True, slots=True)
class Line:
    """A curve of shape (n,), with gaps at NaN.  ``kind`` is its class in the style sheet."""

    x: Floats
    y: Floats
    kind: str


@dataclass(frozen=True, slots=True)
class Band:
    """A band from -half to +half along x; arrays of shape (n,)."""

    x: Floats
    half: Floats


@dataclass(frozen=True, slots=True)
class Dot:
    """One point with its standard uncertainty; ``words`` is its tooltip."""

    x: float
    y: float
    std: float
    words: str = ""


@dataclass(frozen=True, slots=True)
class NoteMark:
    """An operator's note at a position in the plot; it is left out if x is outside the axes."""

    x: float
    y: float
    text: str


@dataclass(frozen=True, slots=True)
class Plot:
    """One set of axes with its content.  ``x_span`` None: the range of the lines.  ``lines`` are drawn in order."""

    x_label: str
    y_label: str
    lines: tuple[Line, ...] = ()
    bands: tuple[Band, ...] = ()
    dots: tuple[Dot, ...] = ()
    marks: tuple[float, ...] = field(default=())  # x of vertical lines
    x_span: tuple[float, float] | None = None
    zero_line: bool = False
    remarks: tuple[NoteMark, ...] = ()


def draw(plot: Plot, *, width: int = WIDTH, height: int = 220) -> Markup:
    """Return the plot as an ``svg`` element; its accessible name consists of the axis labels."""
    x_low, x_high = plot.x_span or _span([line.x for line in plot.lines], [d.x for d in plot.dots], 0.0)
    if plot.dots and plot.x_span is None:
        spare = 0.06 * (x_high - x_low)
        x_low, x_high = x_low - spare, x_high + spare
    inside = [(np.asarray(line.x) >= x_low) & (np.asarray(line.x) <= x_high) for line in plot.lines]
    ends = [d.y + sign * d.std for d in plot.dots for sign in (-1, 1)] + ([0.0] if plot.zero_line else [])
    ends += [remark.y for remark in plot.remarks if x_low <= remark.x <= x_high]
    for band in plot.bands:
        seen = band.half[(band.x >= x_low) & (band.x <= x_high) & np.isfinite(band.half)]
        reach = float(np.quantile(seen, 0.95)) if seen.size else 0.0  # quantile: the band is unbounded at gaps
        ends += [-reach, reach]
    y_low, y_high = _span([line.y[m] for line, m in zip(plot.lines, inside, strict=True)], ends, 0.06)
    levels, decimals = ticks(y_low, y_high, max(4, (height - _TOP - _BOTTOM) // 28))
    labels = [_label(level, decimals) for level in levels]
    left = max(_LEFT, round(28 + _DIGIT * max(map(len, labels), default=0)))
    frame = _Frame(width, height, left, x_low, x_high, y_low, y_high)
    parts = [tag("rect", class_="frame", x=left, y=_TOP, width=frame.inner_width, height=frame.inner_height)]
    parts += [frame.band(band) for band in plot.bands]
    parts += _axes(frame, plot, list(zip(levels, labels, strict=True)))
    parts += [tag("line", class_="mark", x1=_r(frame.x(m)), x2=_r(frame.x(m)), y1=_TOP, y2=frame.bottom)
              for m in plot.marks if x_low <= m <= x_high]  # fmt: skip
    if plot.zero_line and y_low < 0.0 < y_high:
        level = _r(frame.y(0.0))
        parts.append(tag("line", class_="zero", x1=left, x2=width - _RIGHT, y1=level, y2=level))
    parts += [frame.line(line) for line in plot.lines]
    parts += [frame.dot(dot) for dot in plot.dots]
    parts += [frame.remark(remark) for remark in plot.remarks if x_low <= remark.x <= x_high]
    words = f"{plot.y_label} against {plot.x_label}"
    return tag("svg", parts, viewBox=f"0 0 {width} {height}", role="img", aria_label=words)


def decimate_curve(x: Floats, y: Floats, left: float, right: float, columns: int) -> tuple[Floats, Floats]:
    """Decimate to at most two points per column, the lowest and the highest, so that no peak is lost.

    ``x`` (n,) must rise; samples outside [left, right] are left out.  A column without finite values gives NaN.
    """
    begin, end = np.searchsorted(x, (left, right), side="left")
    x, y = x[begin : end + 1], y[begin : end + 1]
    if x.size <= 2 * columns or right <= left:
        return x, y
    column = np.clip(((x - left) * (columns / (right - left))).astype(np.int64), 0, columns - 1)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    low, high = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
    rising = y[starts] <= y[np.append(starts[1:], y.size) - 1]
    both = np.stack([np.where(rising, low, high), np.where(rising, high, low)], axis=1)
    at = left + (column[starts] + 0.5) * (right - left) / columns
    return np.repeat(at, 2), both.ravel()


def ticks(low: float, high: float, most: int) -> tuple[list[float], int]:
    """Return at most ``most`` round tick positions within [low, high], and the number of decimals of their labels.

    If only one tick would remain, which gives no scale, the next finer step is used.
    """
    span = high - low
    if not (math.isfinite(span) and span > 0.0):
        return [low], 3
    power = 10.0 ** math.floor(math.log10(span / most))
    pairs = [*pairwise(power * m for m in (0.5, 1, 2, 5, 10))]
    finer, step = next((pair for pair in pairs if span / pair[1] < most), pairs[-1])
    places = _multiples(step, low, high)
    if len(places) < 2:
        step, places = finer, _multiples(finer, low, high)
    return places, max(0, -math.floor(math.log10(step) + 1e-9))


def _multiples(step: float, low: float, high: float) -> list[float]:
    return [step * n for n in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


@dataclass(frozen=True, slots=True)
class _Frame:
    width: int
    height: int
    left: int
    x_low: float
    x_high: float
    y_low: float
    y_high: float

    @property
    def inner_width(self) -> int:
        return self.width - self.left - _RIGHT

    @property
    def inner_height(self) -> int:
        return self.height - _TOP - _BOTTOM

    @property
    def bottom(self) -> int:
        return self.height - _BOTTOM

    def x(self, value: float | Floats) -> float | Floats:
        return self.left + (value - self.x_low) * (self.inner_width / (self.x_high - self.x_low))

    def y(self, value: float | Floats) -> float | Floats:
        return self.bottom - (value - self.y_low) * (self.inner_height / (self.y_high - self.y_low))

    def line(self, line: Line) -> Markup:
        x, y = np.asarray(line.x, float), np.asarray(line.y, float)
        if x.size and bool(np.all(np.diff(x) > 0)):
            x, y = decimate_curve(x, y, self.x_low, self.x_high, self.inner_width)
            px, py = np.asarray(self.x(x)), np.asarray(self.y(y))
        else:
            px, py = _apart(np.asarray(self.x(x)), np.asarray(self.y(y)))
        return tag("path", class_=line.kind, d=_path(px, np.clip(py, _TOP, self.bottom)))

    def band(self, band: Band) -> Markup:
        x, half = decimate_curve(band.x, band.half, self.x_low, self.x_high, self.inner_width // 2)
        known = np.isfinite(half)
        x, half = x[known], half[known]
        px = np.concatenate([np.asarray(self.x(x)), np.asarray(self.x(x))[::-1]])
        py = np.concatenate([np.asarray(self.y(half)), np.asarray(self.y(-half))[::-1]])
        return tag("path", class_="band", d=_path(px, np.clip(py, _TOP, self.bottom)) + "Z" if x.size else "")

    def dot(self, dot: Dot) -> Markup:
        px = _r(float(self.x(dot.x)))
        ends = [_r(float(self.y(dot.y + sign * dot.std))) for sign in (-1, 1)]
        bar = tag("line", class_="bar", x1=px, x2=px, y1=ends[0], y2=ends[1])
        title = tag("title", dot.words) if dot.words else Markup()
        return tag("g", bar, tag("circle", class_="dot", cx=px, cy=_r(float(self.y(dot.y))), r=3.5), title)

    def remark(self, remark: NoteMark) -> Markup:
        px, py = float(self.x(remark.x)), float(self.y(remark.y))
        right, upper = px > self.left + 0.5 * self.inner_width, py < _TOP + 0.5 * self.inner_height
        kind = "remark-left" if right else "remark-right"  # side of the dot on which the text is
        at = {"x": _r(px + (-7 if right else 7)), "y": _r(py + (15 if upper else -7))}
        spot = tag("circle", class_="remark-dot", cx=_r(px), cy=_r(py), r=3)
        return tag("g", spot, tag("text", remark.text, class_=kind, **at))


def _axes(frame: _Frame, plot: Plot, levels: list[tuple[float, str]]) -> list[Markup]:
    parts = []
    places, decimals = ticks(frame.x_low, frame.x_high, max(4, frame.inner_width // 70))
    for place in places:
        px = _r(frame.x(place))
        parts.append(tag("line", class_="grid", x1=px, x2=px, y1=_TOP, y2=frame.bottom))
        parts.append(tag("text", _label(place, decimals), x=px, y=frame.bottom + 15, class_="tick-x"))
    for level, label in levels:
        py = float(frame.y(level))
        parts.append(tag("line", class_="grid", x1=frame.left, x2=frame.width - _RIGHT, y1=_r(py), y2=_r(py)))
        parts.append(tag("text", label, x=frame.left - 6, y=_r(py + 3.5), class_="tick-y"))
    middle = _TOP + frame.inner_height / 2
    parts.append(tag("text", plot.x_label, x=frame.left + frame.inner_width / 2, y=frame.height - 6, class_="label"))
    turned = f"translate(13 {_r(middle)}) rotate(-90)"
    parts.append(tag("text", plot.y_label, transform=turned, class_="label"))
    return parts


def _label(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    return "0" if float(text) == 0.0 else text.replace("-", "\u2212")


def _span(arrays: list[Floats], more: list[float], spare: float) -> tuple[float, float]:
    values = np.concatenate([*(np.asarray(a, float) for a in arrays), np.asarray(more, float)])
    values = values[np.isfinite(values)]
    if values.size == 0:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    room = spare * (high - low)
    if high - low <= 1e-12 * max(abs(low), abs(high), 1e-300):
        room = 0.05 * abs(high) or 0.5
    return low - room, high + room


def _apart(px: Floats, py: Floats) -> tuple[Floats, Floats]:
    """Drop points on the same pixel as their predecessor; used for loops, which ``decimate_curve`` cannot decimate."""
    cell = np.stack([np.round(px * 1.5), np.round(py * 1.5)])
    with np.errstate(invalid="ignore"):
        keep = np.append(True, np.any(cell[:, 1:] != cell[:, :-1], axis=0)) if px.size else np.zeros(0, bool)
    return px[keep], py[keep]


def _path(px: Floats, py: Floats) -> str:
    parts = []
    pen = "M"
    for a, b in zip(px.tolist(), py.tolist(), strict=True):
        if math.isfinite(a) and math.isfinite(b):
            parts.append(f"{pen}{a:.1f} {b:.1f}")
            pen = "L"
        else:
            pen = "M"
    return "".join(parts)


def _r(value: float | Floats) -> str:
    return f"{float(value):.1f}"
