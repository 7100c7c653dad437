"""The legend of a panel, above its plots: a sample of each line with its name."""

from collections.abc import Iterator, Sequence

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetrics, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.window.plots.lines import density
from app.window.widgets import FlowLayout, clear_layout, text_label

Look = QPen | tuple[str, str]


_SAMPLE, _GAP = 26, 6


def legend_height(entries: Sequence[tuple[str, Look]], width: int, font: QFont) -> int:
    """Return the height of the entries in a picture of this width."""
    return sum(1 for _ in _rows(entries, width, QFontMetrics(font))) * (QFontMetrics(font).height() + 4)


def paint_legend(painter: QPainter, entries: Sequence[tuple[str, Look]], width: int) -> None:
    """Draw the entries at the top of a picture, in the painter's font and pen."""
    metrics, words = painter.fontMetrics(), painter.pen()
    line = metrics.height() + 4
    for number, row in enumerate(_rows(entries, width, metrics)):
        middle = number * line + line // 2
        for x, name, look in row:
            if isinstance(look, QPen):
                painter.setPen(_sample_pen(look))
                painter.drawLine(x, middle, x + _SAMPLE, middle)
            else:
                painter.fillRect(x, middle - 4, _SAMPLE, 8, QColor(look[0]))
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


def _sample_pen(look: QPen) -> QPen:
    pen = QPen(look)
    pen.setWidthF(max(2.0, pen.widthF() / density()))  # in logical pixels, unlike a plot's
    return pen


class LineSample(QWidget):
    """A sample of a line or of a band."""

    def __init__(self, look: Look, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._band = None if isinstance(look, QPen) else QColor(look[0])
        self._pen = _sample_pen(look) if isinstance(look, QPen) else QPen(QColor(look[1]), 1, Qt.PenStyle.DashLine)
        self.setFixedSize(QSize(_SAMPLE, 14))

    def paintEvent(self, _: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(self._pen)
        if self._band is None:
            painter.drawLine(0, self.height() // 2, self.width(), self.height() // 2)
            return
        inside = self.rect().adjusted(0, 2, 0, -3)
        painter.fillRect(inside, self._band)
        for y in (inside.top(), inside.bottom()):
            painter.drawLine(inside.left(), y, inside.right(), y)


class Legend(QWidget):
    """The entries side by side."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._row = FlowLayout(self)
        self._entries: list[tuple[str, Look]] = []

    @property
    def entries(self) -> list[tuple[str, Look]]:
        return list(self._entries)

    def show_entries(self, entries: Sequence[tuple[str, Look]]) -> None:
        """Show these entries: a pen for a line; the colours of surface and edges for a band."""
        if list(entries) == self._entries:
            return
        self._entries = list(entries)
        clear_layout(self._row)
        for name, look in entries:
            entry = QWidget(self)
            pair = QHBoxLayout(entry)
            pair.setContentsMargins(0, 0, 2 * _GAP, 0)
            pair.setSpacing(_GAP)
            pair.addWidget(LineSample(look, entry), 0, Qt.AlignmentFlag.AlignVCenter)
            pair.addWidget(text_label(name, entry, faint=True))
            self._row.addWidget(entry)
            entry.show()
