"""The one legend of a panel: a sample of each line style with its name, above the plots and never over the data."""

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from app.clear_layout import clear_layout


class LineSample(QWidget):
    """A short stretch of a line, or of a band."""

    def __init__(self, pen: QPen, band: str | None = None, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._pen = QPen(pen)
        self._pen.setWidth(max(2, pen.width()))
        self._band = band
        self.setFixedSize(QSize(26, 14))

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the sample."""
        painter = QPainter(self)
        if self._band is not None:
            painter.fillRect(self.rect().adjusted(0, 2, 0, -2), QColor(self._band))
            return
        painter.setPen(self._pen)
        painter.drawLine(0, self.height() // 2, self.width(), self.height() // 2)


class Legend(QWidget):
    """Entries side by side."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(6)

    def show_entries(self, entries: list[tuple[str, QPen | str]]) -> None:
        """Show these entries: a pen for a line, a colour name for a band."""
        clear_layout(self._row)
        for name, look in entries:
            sample = LineSample(look if isinstance(look, QPen) else QPen(), None if isinstance(look, QPen) else look)
            self._row.addWidget(sample, 0, Qt.AlignmentFlag.AlignVCenter)
            label = QLabel(name, self)
            label.setProperty("faint", True)
            self._row.addWidget(label)
            self._row.addSpacing(8)
        self._row.addStretch(1)
