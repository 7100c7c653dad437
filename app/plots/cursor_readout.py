"""What lies between the cursors, as a small table below the plots; copied as text."""

from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QWidget

from app.plots.cursors import Cursors
from app.wording import number


class CursorReadout(QFrame):
    """Follows one pair of cursors; hidden while they are."""

    def __init__(self, cursors: Cursors, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._cursors = cursors
        self.setProperty("card", True)
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 4, 8, 4)
        self._table = QLabel(self)
        self._table.setTextFormat(Qt.TextFormat.RichText)
        self._table.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._table.setAccessibleName("Between the cursors")
        copy = QPushButton("Copy as text", self)
        copy.setToolTip("Copy times, values, differences, mean, rms and slope between the cursors  (Ctrl+Shift+C)")
        copy.clicked.connect(self.copy)
        row.addWidget(self._table, 1)
        row.addWidget(copy, 0, Qt.AlignmentFlag.AlignTop)
        cursors.moved.connect(self.refresh)
        self.setVisible(False)

    @Slot()
    def refresh(self) -> None:
        """Show the present measures."""
        self.setVisible(self._cursors.shown)
        if not self._cursors.shown:
            return
        a, b = self._cursors.times
        span_s = (b - a) * 1e-3
        rate = f"{number(1 / abs(span_s), 5)} Hz" if span_s else "–"
        heads = ("", "at A", "at B", "B − A", "mean", "rms", "slope a second", "")
        head = "".join(f"<td align='right' style='padding: 0 9px'><b>{text}</b></td>" for text in heads)
        rows = [
            f"<tr><td colspan='8'><b>A</b> {a:.4f} ms &nbsp; <b>B</b> {b:.4f} ms &nbsp; "
            f"<b>B − A</b> {b - a:.4f} ms &nbsp; ({rate})</td></tr><tr>{head}</tr>"
        ]
        for m in self._cursors.measures():
            cells = (m.at_a, m.at_b, m.difference, m.mean, m.rms, m.slope_per_s)
            text = "".join(f"<td align='right' style='padding: 0 9px'>{number(cell, 5)}</td>" for cell in cells)
            rows.append(f"<tr><td>{m.name}</td>{text}<td>{m.unit}</td></tr>")
        self._table.setText(f"<table cellspacing='0'>{''.join(rows)}</table>")

    @Slot()
    def copy(self) -> None:
        """Put the measures on the clipboard as tab-separated text."""
        QGuiApplication.clipboard().setText(self._cursors.text())
