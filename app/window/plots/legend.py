"""The legend above the plots of a panel: a sample of each line with its name."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from app.window.controls.theme import Colours, Themed
from app.window.controls.widgets import FlowLayout, clear_layout, horizontal, text_label
from app.window.plots.lines import LineStyle, density

_SAMPLE, _GAP = 26, 6


class LineSample(Themed, QWidget):
    """A widget with a sample of a line or of a band."""

    def __init__(self, look: LineStyle, colours: Colours, parent: QWidget) -> None:
        super().__init__(parent)
        self._look = look
        self.colours = colours
        self.setFixedSize(_SAMPLE, 14)

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the line through the middle, or fill the widget with the band."""
        painter, look, place = QPainter(self), self._look, self.rect().adjusted(0, 3, 0, -3)
        if look.edges:
            painter.fillRect(place, QColor(look.of(self.colours)))
            painter.setPen(QPen(QColor(LineStyle(look.edges).of(self.colours)), 1, Qt.PenStyle.DashLine))
            heights = [place.top(), place.bottom()]
        else:
            pen = look.pen(self.colours)
            pen.setWidthF(max(2.0, pen.widthF() / density()))  # in logical pixels, unlike pens of plots
            painter.setPen(pen)
            heights = [place.top() + place.height() // 2]
        for y in heights:
            painter.drawLine(place.left(), y, place.left() + place.width(), y)


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
            pair = horizontal(entry, (0, 0, 2 * _GAP, 0), _GAP)
            pair.addWidget(LineSample(look, self.colours, entry), 0, Qt.AlignmentFlag.AlignVCenter)
            pair.addWidget(text_label(name, entry, faint=True))
            self._row.addWidget(entry)
            entry.show()
