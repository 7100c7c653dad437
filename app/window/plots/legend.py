"""The legend above the plots of a panel: a sample of each line with its name."""

from collections.abc import Iterator, Sequence

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetrics, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.window.controls.theme import Colours, Themed
from app.window.controls.widgets import FlowLayout, clear_layout, text_label
from app.window.plots.lines import LineStyle, density

_SAMPLE, _GAP = 26, 6


def legend_height(entries: Sequence[tuple[str, LineStyle]], width: int, font: QFont) -> int:
    """Return the height of the legend in a picture of this width."""
    return sum(1 for _ in _rows(entries, width, QFontMetrics(font))) * (QFontMetrics(font).height() + 4)


def paint_legend(painter: QPainter, entries: Sequence[tuple[str, LineStyle]], width: int, colours: Colours) -> None:
    """Draw the legend at the top of a picture, in the painter's font and pen."""
    metrics, words = painter.fontMetrics(), painter.pen()
    line = metrics.height() + 4
    for number, row in enumerate(_rows(entries, width, metrics)):
        middle = number * line + line // 2
        for x, name, look in row:
            _paint_sample(painter, look, colours, QRect(x, middle - 4, _SAMPLE, 8))
            painter.setPen(words)
            painter.drawText(x + _SAMPLE + _GAP, middle + metrics.ascent() // 2 - 1, name)


def _rows(
    entries: Sequence[tuple[str, LineStyle]], width: int, metrics: QFontMetrics
) -> Iterator[list[tuple[int, str, LineStyle]]]:
    row: list[tuple[int, str, LineStyle]] = []
    x = _GAP
    for name, look in entries:
        needed = _SAMPLE + _GAP + metrics.horizontalAdvance(name) + 3 * _GAP
        if row and x + needed > width:
            yield row
            row, x = [], _GAP
        row.append((x, name, look))
        x += needed
    if row:
        yield row


def _paint_sample(painter: QPainter, look: LineStyle, colours: Colours, place: QRect) -> None:
    """Draw a line through the middle of ``place``, or a band that fills it."""
    if look.edges:
        painter.fillRect(place, QColor(look.of(colours)))
        painter.setPen(QPen(QColor(LineStyle(look.edges).of(colours)), 1, Qt.PenStyle.DashLine))
        heights = [place.top(), place.bottom()]
    else:
        pen = look.pen(colours)
        pen.setWidthF(max(2.0, pen.widthF() / density()))  # in logical pixels, unlike pens of plots
        painter.setPen(pen)
        heights = [place.top() + place.height() // 2]
    for y in heights:
        painter.drawLine(place.left(), y, place.left() + place.width(), y)


class LineSample(Themed, QWidget):
    """A widget with a sample of a line or of a band."""

    def __init__(self, look: LineStyle, colours: Colours, parent: QWidget) -> None:
        super().__init__(parent)
        self._look = look
        self.colours = colours
        self.setFixedSize(QSize(_SAMPLE, 14))

    def paintEvent(self, _: QPaintEvent) -> None:
        _paint_sample(QPainter(self), self._look, self.colours, self.rect().adjusted(0, 3, 0, -3))


LOW_LINES = 18  # height of a low page in lines of text


def is_low(page: QWidget) -> bool:
    """Return whether a page is too low for text above its plots, which is then shown as a tooltip."""
    return page.height() < LOW_LINES * page.fontMetrics().lineSpacing()


class Legend(Themed, QWidget):
    """The legend widget: all entries side by side."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._row = FlowLayout(self)
        self.entries: list[tuple[str, LineStyle]] = []

    def show_entries(self, entries: Sequence[tuple[str, LineStyle]]) -> None:
        if list(entries) == self.entries:
            return
        self.entries = list(entries)
        clear_layout(self._row)
        for name, look in entries:
            entry = QWidget(self)
            pair = QHBoxLayout(entry)
            pair.setContentsMargins(0, 0, 2 * _GAP, 0)
            pair.setSpacing(_GAP)
            pair.addWidget(LineSample(look, self.colours, entry), 0, Qt.AlignmentFlag.AlignVCenter)
            pair.addWidget(text_label(name, entry, faint=True))
            self._row.addWidget(entry)
            entry.show()
