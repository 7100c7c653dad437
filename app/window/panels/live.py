"""LIVE page: beat frequency, velocity and force as running curves and large digits; raw signals; site vibration."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QSizePolicy, QVBoxLayout, QWidget

from analysis.reading import CENTRES_HZ, CRITERIA_M_PER_S, SiteFloor
from analysis.shot import Channel, Floats, Role
from app.window.controls.commands import with_keys
from app.window.controls.theme import Colours, Themed
from app.window.controls.widgets import added, horizontal, push_button, scrolled, text_label, vertical
from app.window.plots.cursors import CursorAxis, CursorReadout
from app.window.plots.lines import MEASURED, LineStyle
from app.window.plots.plain_plot import LogPlot
from app.window.plots.time_plot import TimeStack
from app.words import DASH, localised_number, localised_text, number, with_prefix
from instrument.live import CHANNEL_NAMES, LiveView

FREQUENCY = CursorAxis("Hz", "Hz", logarithmic=True)
UM_PER_S = 1e6
CRITERIA = ("VC-A", "VC-B", "VC-C", "VC-D", "VC-E", "VC-F", "VC-G")
LABELLED = ("VC-A", "VC-D", "VC-G")  # all seven names would overlap
MAX_LINES = 4
NO_FLOOR = "Floor vibration: leave the block at rest for one to two seconds."


def line_words(floor: SiteFloor) -> list[str]:
    """Return the strongest spectral lines with their probable causes, one text per line."""
    strongest = sorted(floor.lines, key=lambda line: -line.amplitude_m * line.frequency_hz)[:MAX_LINES]
    return [
        f"{localised_number(f'{line.frequency_hz:.2f}')} Hz  {with_prefix(line.amplitude_m, 'm')}  {line.cause}"
        for line in sorted(strongest, key=lambda line: line.frequency_hz)
    ]


def floor_words(floor: SiteFloor) -> str:
    """Return the vibration criterion met and the expected u(COR) in one line."""
    meets = f"meets {floor.criterion}" if floor.criterion else "meets no criterion"
    return localised_text(f"Floor vibration {meets}. Expected u(COR) now: {floor.cor_std:.1g}")


class SiteFloorPanel(Themed, QWidget):
    """The third-octave plot and its summary; the last floor vibration stays until a new one is measured."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._shown: SiteFloor | None = None
        row = horizontal(self)
        self.plot = LogPlot("Floor vibration in third-octaves", ("velocity", "µm/s"), "frequency", FREQUENCY, self)
        self.plot.setFixedHeight(150)
        self._names: list[pg.TextItem] = []
        for name in CRITERIA:
            level = UM_PER_S * CRITERIA_M_PER_S[name]
            self.plot.add_curve(name, LineStyle("marker")).show_points(np.array([8.0, 80.0]), np.array([level, level]))
            label = pg.TextItem(name, anchor=(0.0, 0.5))
            label.setPos(np.log10(82.0), np.log10(level))
            label.setVisible(name in LABELLED)
            self.plot.plot.addItem(label)
            self._names.append(label)
        self._curve = self.plot.add_curve("floor vibration", LineStyle("measured", width=3))
        row.addWidget(self.plot, 1)
        words = QVBoxLayout()
        self.summary, self.lines, self.advice = self._said = [
            added(words, text_label("", self, selectable=True, wrap=True)) for _ in range(3)
        ]
        words.addWidget(CursorReadout(self.plot, self))
        words.addStretch(1)
        row.addLayout(words, 1)
        self._show(np.empty(0), NO_FLOOR)

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        for label in self._names:
            label.setColor(colours.faint)

    def show_floor(self, floor: SiteFloor | None) -> None:
        """Show a measured floor vibration; None: nothing measured yet."""
        if floor is self._shown:
            return
        self._shown = floor
        if floor is None:
            self._show(np.empty(0), NO_FLOOR)
            return
        level = UM_PER_S * np.maximum(floor.third_octave_m_per_s, 1e-12)
        advice = "\n".join(f"{sentence}." for sentence in floor.advice)
        self._show(level, floor_words(floor), "\n".join(line_words(floor)), advice)
        self.plot.columns = {"frequency (Hz)": CENTRES_HZ, "rms velocity (m/s)": floor.third_octave_m_per_s}

    def _show(self, level: Floats, summary: str, lines: str = "", advice: str = "") -> None:
        """Show levels in µm/s, (k,) or none, in a range that contains the criteria too, and what is said of them."""
        for label, words in zip(self._said, (summary, lines, advice), strict=True):
            label.setText(words)
        self._curve.show_points(CENTRES_HZ[: level.size], level)
        levels = [*level, *(UM_PER_S * CRITERIA_M_PER_S[name] for name in (CRITERIA[0], CRITERIA[-1]))]
        self.plot.show_range((float(CENTRES_HZ[0]), float(CENTRES_HZ[-1])), (min(levels) / 1.6, 1.6 * max(levels)))


WINDOW_MS = 2000.0  # fixed, so that the axis does not move
MIN_RAW = 9  # least height of the raw signals, in lines of text
DIGITS_S = 0.19  # least stream time between updates of digits and raw signals, so that they can be read
RAW_SHOWN = 150  # samples shown of each raw signal: about forty periods of the beat
ROWS = (
    ("beat", "beat of PD1", "MHz", 1e-6, "{:.5f}", "-0.00000"),
    ("velocity", "velocity", "m/s", 1.0, "{:+.4f}", "+0.0000"),
    ("force", "force", "N", 1.0, "{:+.3f}", "+0.000"),
)


def _digits(form: str, value: float) -> str:
    """Return the value as text; a value rounded to zero gets no sign, because the sign would flicker."""
    text = form.format(value)
    return text if float(text) else form.replace("+", " ").format(0.0)


def _levels(thresholds_v: tuple[float | None, float | None], learned: bool) -> dict[str, float]:
    """Return the known thresholds of the trigger by their labels."""
    named = zip(("low", "high"), thresholds_v, strict=True)
    how = " (from the signal)" if learned else ""
    return {f"trigger {name}{how}, {number(v, 3)} V": v for name, v in named if v is not None}


def _too_soon(now_s: float, last_s: float) -> bool:
    """Return whether it is too soon after ``last_s`` to update; both in stream time, which restarts with a stream."""
    return 0.0 < now_s - last_s < DIGITS_S


class LivePanel(QWidget):
    """The LIVE page: three running plots, three large numbers, the raw signals, site vibration."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._draw_due: Callable[[], None] | None = None  # draws the newest raw signals once there is room for them
        grid = QGridLayout(scrolled("Live", self))  # on a low screen the user scrolls to the site vibration
        grid.setContentsMargins(6, 4, 6, 4)
        grid.setHorizontalSpacing(8)
        self.stack = TimeStack("Beat frequency, velocity and force, live", self)
        self._plots = {name: self.stack.add_plot(title, unit) for name, title, unit, *_ in ROWS}
        self._curves = {name: plot.add_points("measured", MEASURED) for name, plot in self._plots.items()}
        for plot, span in zip(self._plots.values(), (0.02, 0.01, 0.05), strict=True):
            plot.minimum_span = span
            plot.steady = True
        self.stack.label_time("time before now")
        self.stack.show_whole(-WINDOW_MS, 0.0)
        grid.addWidget(self.stack, 0, 0, 5, 1)
        self.numbers: dict[str, QLabel] = {}
        self._digits_s = -math.inf  # stream time at which the digits were set
        self._raw_shown: tuple[object, float] = (None, -math.inf)  # (channels, levels) and stream time last drawn
        for line, (name, title, unit, _, _, widest) in enumerate(ROWS):
            grid.addWidget(self._tile(name, title, unit, widest), line, 1)
        hover = "Freeze the curves to measure on them; acquisition continues, ARM resumes the curves"
        self.hold = push_button("Hold", with_keys(hover, "toggle:live.hold"), self, checkable=True)
        grid.addWidget(self.hold, 3, 1)
        self.raw = TimeStack("Raw signals, live", self)
        self._raw_plots = [self.raw.add_plot(title, "V") for title in CHANNEL_NAMES.values()]
        self._raw_curves = [plot.add_curve("samples", MEASURED) for plot in self._raw_plots]
        for plot in self._raw_plots:
            plot.minimum_span = 0.1
            plot.steady = True
        self.raw.label_time("time of the newest samples")
        self.raw.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)  # the digits come first
        grid.addWidget(self.raw, 4, 1)
        self.plots = (self.stack, self.raw)
        for line, plot in enumerate(self.plots, 5):
            grid.addWidget(CursorReadout(plot, self), line, 0, 1, 2)
        self.floor = SiteFloorPanel(self)
        grid.addWidget(self.floor, 7, 0, 1, 2)
        grid.setColumnStretch(0, 1)
        grid.setRowStretch(4, 1)
        self._waiting = text_label("No samples yet.", self, faint=True)
        self._waiting.setAlignment(Qt.AlignmentFlag.AlignCenter)
        grid.addWidget(self._waiting, 0, 0, 5, 1)

    def _tile(self, name: str, title: str, unit: str, widest: str) -> QFrame:
        tile = QFrame(self)
        tile.setProperty("card", True)
        column = vertical(tile, (12, 2, 12, 2), 0)
        value = text_label(DASH, tile, selectable=True, bold=True, size=3.0)
        value.setMinimumWidth(value.fontMetrics().horizontalAdvance(widest + "0"))
        value.setAlignment(Qt.AlignmentFlag.AlignRight)
        value.setAccessibleName(f"{title} in {unit}")
        column.addWidget(text_label(f"{title}  ({unit})", tile, faint=True))
        column.addWidget(value)
        self.numbers[name] = value
        return tile

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Show the raw signals if there is room."""
        super().resizeEvent(event)
        room = self.stack.geometry().bottom() - self.hold.geometry().bottom()
        self.raw.setVisible(room >= MIN_RAW * self.fontMetrics().lineSpacing())
        if self._draw_due is not None and not self.raw.isHidden():
            self._draw_due()

    def show_live(self, view: LiveView | None) -> None:
        """Show the newest part of the stream; None or an empty view means that there is no stream."""
        if self.hold.isChecked():
            return
        silent = view is None or len(view.time_s) == 0
        self._waiting.setVisible(silent)
        if view is None or silent:
            self._waiting.setText((view.problem if view is not None else None) or "No samples yet.")
            self._digits_s = -math.inf
            for label in self.numbers.values():
                label.setText(DASH)
            for curve in self._curves.values():
                curve.clear_samples()
            return
        self.floor.show_floor(view.floor)
        time_ms = 1e3 * (view.time_s - view.time_s[-1])
        if self.stack.span != (-WINDOW_MS, 0.0):
            self.stack.show_span(-WINDOW_MS, 0.0)
        values = {"beat": view.beat_frequency_hz, "velocity": view.velocity_m_per_s, "force": view.force_n}
        recent = time_ms > -50.0
        now_s = float(view.time_s[-1])
        fresh = not _too_soon(now_s, self._digits_s)
        self._digits_s = now_s if fresh else self._digits_s
        for name, _, _, scale, form, _ in ROWS:
            samples = scale * values[name]
            self._curves[name].show_points(time_ms, samples)
            self._plots[name].fit_y()
            if not fresh:
                continue
            seen = samples[recent & np.isfinite(samples)]
            digits = localised_number(_digits(form, float(seen.mean()))) if len(seen) else DASH
            self.numbers[name].setText(digits)
            self.numbers[name].setAccessibleDescription(digits)
        for plot in self.plots:
            plot.cursors.moved.emit()  # their readings change with the curves

    def show_raw(
        self,
        view: LiveView,
        channels: tuple[Channel, ...],
        thresholds_v: tuple[float | None, float | None] = (None, None),
        learned: bool = False,
    ) -> None:
        """Show the newest raw samples; ``channels`` describe the columns.

        ``thresholds_v`` are the low and the high threshold of the trigger, None if unknown; ``learned``: determined
        from the signal.
        """
        if self.hold.isChecked() or len(view.raw_time_s) < 2 or view.raw_v.shape[1] != len(channels):
            return
        levels = _levels(thresholds_v, learned)
        what, now_s = (channels, levels), float(view.raw_time_s[-1])
        if what == self._raw_shown[0] and _too_soon(now_s, self._raw_shown[1]):
            return
        self._raw_shown = what, now_s
        if self.raw.isHidden():
            self._draw_due = partial(self._draw_raw, view, channels, levels)
        else:
            self._draw_raw(view, channels, levels)

    def _draw_raw(self, view: LiveView, channels: tuple[Channel, ...], levels: dict[str, float]) -> None:
        self._draw_due = None
        step = 1e3 * float(view.raw_time_s[1] - view.raw_time_s[0])
        length = step * min(RAW_SHOWN, len(view.raw_time_s))
        if abs(self.raw.span[1] - length) > 1e-3 * length:  # not just rounding of the times
            self.raw.show_span(0.0, length)
        for index, (plot, curve) in enumerate(zip(self._raw_plots, self._raw_curves, strict=True)):
            present = index < len(channels)
            plot.setVisible(present)
            if present:
                name = CHANNEL_NAMES[channels[index].role]
                if plot.title != name:
                    plot.name_value(name, plot.unit)
                of_switch = channels[index].role is Role.SWITCH
                plot.show_levels(levels if of_switch else {})
                curve.show_samples(0.0, step, view.raw_v[-RAW_SHOWN:, index])
                plot.fit_y()
