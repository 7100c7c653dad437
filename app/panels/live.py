"""LIVE: beat frequency, velocity and force while samples stream, in digits that carry two metres; the raw signals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QVBoxLayout, QWidget

from app.plots.time_stack import TimeStack
from app.theme import Colours, sized, thin
from app.wording import DASH, local

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LiveTrace:
    """What the screen shows of a running stream: arrays of shape (n,) on one uniform grid, newest last.

    ``window_s`` is the length the axis shows, so that it does not move while the first samples come in.
    """

    end_s: float
    rate_hz: float
    window_s: float
    beat_hz: Floats
    velocity_m_per_s: Floats
    force_n: Floats


@dataclass(frozen=True, slots=True)
class RawTrace:
    """A short stretch of raw samples in volts, (name, values (m,)) a channel."""

    rate_hz: float
    channels: tuple[tuple[str, Floats], ...]


ROWS = (
    ("beat", "beat of PD1", "MHz", 1e-6, "{:.5f}", "-0.00000"),
    ("velocity", "velocity", "m/s", 1.0, "{:+.4f}", "+0.0000"),
    ("force", "force", "N", 1.0, "{:+.3f}", "+0.000"),
)


class LivePanel(QWidget):
    """Three plots that roll, three large numbers, and the raw signals beside them."""

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        grid = QGridLayout(self)
        grid.setContentsMargins(6, 6, 6, 6)
        grid.setHorizontalSpacing(8)
        self.stack = TimeStack("Beat frequency, velocity and force, live", colours, self)
        self._plots = {name: self.stack.add_plot(title, unit) for name, title, unit, *_ in ROWS}
        self._curves = {name: plot.add_curve("measured", thin(colours.measured)) for name, plot in self._plots.items()}
        self._plots["beat"].minimum_span = 0.02
        self._plots["velocity"].minimum_span = 0.01
        self._plots["force"].minimum_span = 0.05
        self.stack.label_time("time before now (ms)")
        grid.addWidget(self.stack, 0, 0, 4, 1)
        self._numbers: dict[str, QLabel] = {}
        for line, (name, title, unit, _, _, widest) in enumerate(ROWS):
            grid.addWidget(self._tile(name, title, unit, widest), line, 1)
        self.raw = TimeStack("Raw signals, live", colours, self)
        self._raw_plots = [self.raw.add_plot(title, "V") for title in ("PD0", "PD1", "switch")]
        self._raw_curves = [plot.add_curve("samples", thin(colours.measured)) for plot in self._raw_plots]
        for plot in self._raw_plots:
            plot.minimum_span = 0.1
        self.raw.label_time("time (ms)")
        self.raw.setMinimumWidth(300)
        grid.addWidget(self.raw, 3, 1)
        grid.setColumnStretch(0, 1)
        for line in range(3):
            grid.setRowStretch(line, 0)
        grid.setRowStretch(3, 1)
        self._waiting = QLabel("No samples yet.", self)
        self._waiting.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._waiting.setProperty("faint", True)
        grid.addWidget(self._waiting, 0, 0, 4, 1)
        self.dress(colours)

    def _tile(self, name: str, title: str, unit: str, widest: str) -> QFrame:
        tile = QFrame(self)
        tile.setProperty("card", True)
        column = QVBoxLayout(tile)
        column.setContentsMargins(12, 4, 12, 4)
        column.setSpacing(0)
        heading = QLabel(f"{title}  ({unit})", tile)
        heading.setProperty("faint", True)
        value = QLabel(DASH, tile)
        value.setFont(sized(self.font(), 3.0, bold=True))
        value.setMinimumWidth(value.fontMetrics().horizontalAdvance(widest + "0"))
        value.setAlignment(Qt.AlignmentFlag.AlignRight)
        value.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        value.setAccessibleName(f"{title} in {unit}")
        column.addWidget(heading)
        column.addWidget(value)
        self._numbers[name] = value
        return tile

    def text(self, name: str) -> str:
        """Return the digits shown for "beat", "velocity" or "force"."""
        return self._numbers[name].text()

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self._colours = colours
        self.stack.dress(colours)
        self.raw.dress(colours)
        for curve in (*self._curves.values(), *self._raw_curves):
            curve.setPen(thin(colours.measured))

    def show_trace(self, trace: LiveTrace | None) -> None:
        """Show the newest stretch of the stream; None: nothing streams."""
        self._waiting.setVisible(trace is None or len(trace.velocity_m_per_s) == 0)
        if trace is None or len(trace.velocity_m_per_s) == 0:
            for label in self._numbers.values():
                label.setText(DASH)
            return
        values = {"beat": trace.beat_hz, "velocity": trace.velocity_m_per_s, "force": trace.force_n}
        left = -1e3 * trace.window_s
        if self.stack.span != (left, 0.0):
            self.stack.plots[0].view.setXRange(left, 0.0, padding=0)
        step = 1e3 / trace.rate_hz
        for name, _, _, scale, form, _ in ROWS:
            samples = values[name]
            self._curves[name].show_samples(-step * (len(samples) - 1), step, scale * samples)
            self._plots[name].fit_y()
            tail = samples[-max(1, int(0.05 * trace.rate_hz)) :]
            seen = tail[np.isfinite(tail)]
            self._numbers[name].setText(local(form.format(scale * float(seen.mean()))) if len(seen) else DASH)

    def show_raw(self, raw: RawTrace | None) -> None:
        """Show the newest raw samples."""
        if raw is None or not raw.channels:
            return
        step = 1e3 / raw.rate_hz
        longest = max(len(values) for _, values in raw.channels)
        if self.raw.span != (0.0, step * longest):
            self.raw.plots[0].view.setXRange(0.0, step * longest, padding=0)
        for index, (plot, curve) in enumerate(zip(self._raw_plots, self._raw_curves, strict=True)):
            present = index < len(raw.channels)
            plot.setVisible(present)
            if present:
                name, values = raw.channels[index]
                if plot.title != name:
                    plot.title = name
                    plot.setLabel("left", f"{name} (V)")
                curve.show_samples(0.0, step, values)
                plot.fit_y()
