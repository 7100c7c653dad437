"""COMPARE: several shots overlaid from first touch on, and the trend of a number against impact speed."""

import pyqtgraph as pg
from PySide6.QtCore import QObject, Qt, Slot
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QPushButton, QSplitter, QVBoxLayout, QWidget

from analysis.uncertainty import of_series, with_unit
from app.report import contact_span_ms, time_zero
from app.session import Entry
from app.window.panels.trend import TrendPlot
from app.window.pens import series_pen
from app.window.plots.cursor_readout import CursorReadout
from app.window.plots.curve import SampledCurve
from app.window.plots.framed_plot import ON_TOP
from app.window.plots.legend import Legend
from app.window.plots.plot_view import PlotView, in_front
from app.window.plots.time_plot import TimePlot
from app.window.plots.time_stack import TimeStack
from app.window.theme import Colours
from app.window.widgets import text_label
from app.words import short_name

MOST = 8
LOW_LINES = 18  # of text: a page lower than these has no room for words beside its plots


class _CurveNumbers(QObject):
    """The numbers are on their curves, spread over the view."""

    def __init__(self, plot: TimePlot, parent: QObject) -> None:
        super().__init__(parent)
        self._plot = plot
        self._curves: list[SampledCurve] = []
        self._items: list[pg.TextItem] = []
        plot.view.sigXRangeChanged.connect(self.place)

    def show(self, curves: list[SampledCurve], numbers: list[str], colours: Colours) -> None:
        """Put these numbers on these curves."""
        while len(self._items) < len(curves):
            item = pg.TextItem(anchor=(0.5, 0.5))
            item.setZValue(ON_TOP)
            self._plot.addItem(item, ignoreBounds=True)
            self._items.append(item)
        self._curves = curves
        for index, item in enumerate(self._items):
            item.setVisible(index < len(curves))
            if index < len(curves):
                item.setText(numbers[index], colours.series[index % len(colours.series)])
                item.fill = pg.mkBrush(colours.plot)
        self.place()

    @Slot()
    def place(self) -> None:
        """Spread the numbers over the view."""
        (left, right), _ = self._plot.view.viewRange()
        for index, curve in enumerate(self._curves):
            at = left + (index + 1) / (len(self._curves) + 1) * (right - left)
            value = curve.value_at(at)
            seen = value == value
            self._items[index].setVisible(seen)
            if seen:
                self._items[index].setPos(at, value)


class ComparePanel(QWidget):
    """Overlay to the left, trend to the right."""

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        self._entries: list[Entry] = []
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 2)
        bar = QHBoxLayout()
        for words, tip, slot in (
            ("Whole shot", "The whole length of the shots  (1)", self.show_whole),
            ("First contact", "The bounces at first contact  (2)", self.show_contact),
        ):
            button = QPushButton(words, self)
            button.setToolTip(tip)
            button.clicked.connect(slot)
            bar.addWidget(button)
        self._say = text_label("", self, faint=True, wrap=True)
        bar.addWidget(self._say, 1)
        self._which = QComboBox(self)
        self._which.setAccessibleName("Number whose trend is shown")
        self._which.setToolTip("The number plotted against impact speed; a slope means that it is not constant")
        self._numbers_followed = of_series()
        for number in self._numbers_followed:
            self._which.addItem(with_unit(number.title, number.shown_unit), number.key)
        self._which.currentIndexChanged.connect(self._trend_chosen)
        bar.addWidget(self._which)
        column.addLayout(bar)
        self._legend = Legend(self)
        column.addWidget(self._legend)
        split = QSplitter(Qt.Orientation.Horizontal, self)
        self.stack = TimeStack("Overlaid shots", colours, split)
        self._velocity = self.stack.add_plot("velocity", "m/s", 2)
        self._force = self.stack.add_plot("force", "N", 3)
        self.stack.label_time("time from first touch (ms)")
        self._velocity_curves = self._curves(self._velocity)
        self._force_curves = self._curves(self._force)
        self._numbers = _CurveNumbers(self._velocity, self)
        right = QWidget(split)
        right_column = QVBoxLayout(right)
        right_column.setContentsMargins(6, 0, 0, 0)
        self.trend = TrendPlot(colours, right)
        self._repeatability = text_label("", right, selectable=True, wrap=True)
        right_column.addWidget(self.trend, 1)
        right_column.addWidget(self._repeatability)
        split.setSizes([620, 380])
        split.setChildrenCollapsible(False)
        column.addWidget(split, 1)
        for plot in (self.stack, self.trend):
            column.addWidget(CursorReadout(plot, self))
        self.stack.reset_wanted.connect(self.show_whole)
        self.dress(colours)
        self.show_entries([])

    def _curves(self, plot: object) -> list[SampledCurve]:
        return [plot.add_curve("", series_pen(self._colours, index)) for index in range(MOST)]  # type: ignore[attr-defined]

    def dress(self, colours: Colours) -> None:
        self._colours = colours
        self.stack.dress(colours)
        self.trend.dress(colours)
        for curves in (self._velocity_curves, self._force_curves):
            for index, curve in enumerate(curves):
                curve.setPen(series_pen(colours, index))
        self._label_lines()

    def _label_lines(self) -> None:
        shown = self._entries[-MOST:]
        self._numbers.show(self._velocity_curves[: len(shown)], [str(e.number) for e in shown], self._colours)
        entries = [
            (f"{e.number}  {short_name(e.name)}", series_pen(self._colours, index)) for index, e in enumerate(shown)
        ]
        self._legend.show_entries(entries)
        self.stack.legend = entries

    def show_entries(self, entries: list[Entry]) -> None:
        """Overlay the last eight of these entries and show the trend of all."""
        self._entries = [entry for entry in entries if entry.shot is not None and entry.shot.motion is not None]
        shown = self._entries[-MOST:]
        for index in range(MOST):
            velocity, force = self._velocity_curves[index], self._force_curves[index]
            present = index < len(shown)
            velocity.setVisible(present)
            force.setVisible(present)
            if not present:
                velocity.clear_samples()
                force.clear_samples()
                continue
            shot = shown[index].shot
            assert shot is not None and shot.motion is not None
            zero, _ = time_zero(shot)
            start, step = 1e3 * (float(shot.motion.time_s[0]) - zero), 1e3 / shot.motion.sample_rate_hz
            velocity.label = force.label = f"{shown[index].number} {shown[index].name}"
            velocity.show_samples(start, step, shot.motion.velocity_m_per_s)
            force.show_samples(start, step, shot.motion.force_n)
        count = len(self._entries)
        if count == 0:
            self._say.setText("Select shots in the table below (Ctrl or Shift with a click) to overlay them.")
        elif count > MOST:
            self._say.setText(f"the last {MOST} of {count} selected shots are overlaid; the trend includes all")
        else:
            self._say.setText("")
        self._label_lines()
        numbered = ", ".join(str(entry.number) for entry in self._entries)
        self.stack.tell([e.shot for e in shown], f"Shots {', '.join(str(e.number) for e in shown)}")
        self.trend.tell([e.shot for e in self._entries], f"Shots {numbered}")
        self._trend_chosen(0)
        self.show_whole()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep room for the plots."""
        super().resizeEvent(event)
        self._show_words()

    def _show_words(self) -> None:
        """Show legend and repeatability; on a low page the plots need their room, and the words come on hovering."""
        low = self.height() < LOW_LINES * self.fontMetrics().lineSpacing()
        self._legend.setVisible(not low)
        self._repeatability.setVisible(not low)
        self.stack.setToolTip("<br>".join(words for words, _ in self._legend.entries) if low else "")
        self.trend.setToolTip(self._repeatability.text() if low else "")

    def choose_trend(self, key: str) -> None:
        """Show the trend of the number with this key."""
        self._which.setCurrentIndex(self._which.findData(key))

    @property
    def repeatability(self) -> str:
        """Get the words below the trend."""
        return self._repeatability.text()

    @Slot()
    def show_whole(self) -> None:
        """Show the whole length."""
        curves = [curve for curve in self._velocity_curves if len(curve.samples)]
        if curves:
            left = min(curve.grid[0] for curve in curves)
            right = max(curve.grid[0] + curve.grid[1] * len(curve.samples) for curve in curves)
            self.stack.zoom(left, right)

    @Slot()
    def show_contact(self) -> None:
        """Show the first bounces."""
        shots = [entry.shot for entry in self._entries if entry.shot is not None]
        if shots:
            self.stack.zoom(*contact_span_ms(shots[-1]))

    @Slot(int)
    def _trend_chosen(self, _: int) -> None:
        shots = [entry.shot for entry in self._entries if entry.shot is not None]
        self._repeatability.setText(self.trend.show_trend(self._numbers_followed[self._which.currentIndex()], shots))
        self._show_words()

    def plot_in_front(self) -> PlotView:
        """Return the trend where it has the focus, else the overlaid shots."""
        return in_front((self.stack, self.trend))
