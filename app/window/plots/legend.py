"""The one legend of a panel: a sample of each line style with its name, above the plots and never over the data."""

from collections.abc import Sequence

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from app.window.clear_layout import clear_layout
from app.window.pens import density

Look = QPen | tuple[str, str]


class LineSample(QWidget):
    """A short stretch of a line, or of a band."""

    def __init__(self, look: Look, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._band = None if isinstance(look, QPen) else QColor(look[0])
        self._pen = QPen(look) if isinstance(look, QPen) else QPen(QColor(look[1]), 1, Qt.PenStyle.DashLine)
        if self._band is None:  # in logical pixels, unlike a plot's
            self._pen.setWidthF(max(2.0, self._pen.widthF() / density()))
        self.setFixedSize(QSize(26, 14))

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the sample."""
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
    """Entries side by side."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(6)
        self._entries: list[tuple[str, Look]] = []

    def show_entries(self, entries: Sequence[tuple[str, Look]]) -> None:
        """Show these entries: a pen for a line; the colours of surface and edges for a band."""
        if list(entries) == self._entries:
            return
        self._entries = list(entries)
        clear_layout(self._row)
        for name, look in entries:
            self._row.addWidget(LineSample(look, self), 0, Qt.AlignmentFlag.AlignVCenter)
            label = QLabel(name, self)
            label.setProperty("faint", True)
            self._row.addWidget(label)
            self._row.addSpacing(8)
        self._row.addStretch(1)
