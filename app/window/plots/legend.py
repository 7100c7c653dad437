"""The legend of a panel, above its plots: a sample of each line with its name."""

from collections.abc import Iterator, Sequence

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetrics, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.window.plots.lines import Look, density
from app.window.theme import Colours, Dressed
from app.window.widgets import FlowLayout, clear_layout, text_label

_SAMPLE, _GAP = 26, 6


def legend_height(entries: Sequence[tuple[str, Look]], width: int, font: QFont) -> int:
    """Return the height of the entries in a picture of this width."""
    return sum(1 for _ in _rows(entries, width, QFontMetrics(font))) * (QFontMetrics(font).height() + 4)


def paint_legend(painter: QPainter, entries: Sequence[tuple[str, Look]], width: int, colours: Colours) -> None:
    """Draw the entries at the top of a picture, in the painter's font and pen."""
    metrics, words = painter.fontMetrics(), painter.pen()
    line = metrics.height() + 4
    for number, row in enumerate(_rows(entries, width, metrics)):
        middle = number * line + line // 2
        for x, name, look in row:
            if look.edges:
                painter.fillRect(x, middle - 4, _SAMPLE, 8, QColor(look.of(colours)))
            else:
                painter.setPen(_sample_pen(look, colours))
                painter.drawLine(x, middle, x + _SAMPLE, middle)
            painter.setPen(words)
            painter.drawText(x + _SAMPLE + _GAP, middle + metrics.ascent() // 2 - 1, name)


def _rows(
    entries: Sequence[tuple[str, Look]], width: int, metrics: QFontMetrics
) -> Iterator[list[tuple[int, str, Look]]]:
    row: list[tuple[int, str, Look]] = []
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


def _sample_pen(look: Look, colours: Colours) -> QPen:
    pen = look.pen(colours)
    pen.setWidthF(max(2.0, pen.widthF() / density()))  # in logical pixels, unlike a plot's
    return pen


class LineSample(Dressed, QWidget):
    """A sample of a line or of a band."""

    def __init__(self, look: Look, colours: Colours, parent: QWidget) -> None:
        super().__init__(parent)
        self._look = look
        self.colours = colours
        self.setFixedSize(QSize(_SAMPLE, 14))

    def paintEvent(self, _: QPaintEvent) -> None:
        painter = QPainter(self)
        if not self._look.edges:
            painter.setPen(_sample_pen(self._look, self.colours))
            painter.drawLine(0, self.height() // 2, self.width(), self.height() // 2)
            return
        inside = self.rect().adjusted(0, 2, 0, -3)
        painter.setPen(QPen(QColor(Look(self._look.edges).of(self.colours)), 1, Qt.PenStyle.DashLine))
        painter.fillRect(inside, QColor(self._look.of(self.colours)))
        for y in (inside.top(), inside.bottom()):
            painter.drawLine(inside.left(), y, inside.right(), y)


class Legend(Dressed, QWidget):
    """The entries side by side."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._row = FlowLayout(self)
        self._entries: list[tuple[str, Look]] = []

    @property
    def entries(self) -> list[tuple[str, Look]]:
        return list(self._entries)

    def show_entries(self, entries: Sequence[tuple[str, Look]]) -> None:
        """Show these entries, each with its name."""
        if list(entries) == self._entries:
            return
        self._entries = list(entries)
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
