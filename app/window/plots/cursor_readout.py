"""The table of cursor readings below a plot."""

from PySide6.QtCore import Qt, Slot
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QWidget

from app.window.plots.plot_view import PlotView
from app.words import DASH, local, number

LOW_LINES = 40  # of text: in a lower window the table is only shown on hovering


class CursorReadout(QFrame):
    """The table of one plot; hidden while cursors or plot are."""

    def __init__(self, plot: PlotView, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._plot, self._cursors = plot, plot.cursors
        self.setProperty("card", True)
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 4, 8, 4)
        self._table = QLabel(self)
        self._table.setTextFormat(Qt.TextFormat.RichText)
        self._table.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        copy = QPushButton("Copy as text", self)
        copy.setToolTip("Copy places, values, differences, mean, rms and slope between the cursors  (Ctrl+Shift+C)")
        copy.clicked.connect(plot.copy_cursors)
        row.addWidget(self._table, 1)
        row.addWidget(copy, 0, Qt.AlignmentFlag.AlignTop)
        self._cursors.moved.connect(self.refresh)
        self.words = ""  # the whole table
        self.setVisible(False)

    @Slot()
    def refresh(self) -> None:
        """Show the present readings."""
        shown = self._cursors.shown and not self._plot.isHidden()
        if self.isHidden() == shown:
            self.setVisible(shown)
        if not shown or not self._plot.isVisible():
            return
        axis = self._cursors.axis
        a, b = map(axis.value, self._cursors.places)
        span = abs(b - a) * axis.scale
        rate = f" &nbsp; ({number(1 / span, 5) if span else DASH} {axis.inverse})" if axis.inverse else ""
        heads = ("", "at A", "at B", "B − A", "mean", "rms", axis.slope_words, "")
        head = "".join(f"<td align='right' style='padding: 0 9px'><b>{text}</b></td>" for text in heads)
        named = (("A", a), ("B", b), ("B − A", b - a))
        places = " &nbsp; ".join(f"<b>{name}</b> {local(f'{place:.4f}')} {axis.unit}" for name, place in named)
        rows = [f"<tr><td colspan='8'>{places}{rate}</td></tr>"]
        measures = self._cursors.measures()
        if measures:
            rows.append(f"<tr>{head}</tr>")
        for m in measures:
            cells = (m.at_a, m.at_b, m.difference, m.mean, m.rms, m.slope)
            text = "".join(f"<td align='right' style='padding: 0 9px'>{number(cell, 5)}</td>" for cell in cells)
            rows.append(f"<tr><td>{m.name}</td>{text}<td>{m.unit}</td></tr>")
        table = f"<table cellspacing='0'>{''.join(rows)}</table>"
        low = self.window().height() < LOW_LINES * self.fontMetrics().lineSpacing()
        self._table.setText(f"<table cellspacing='0'>{rows[0]}</table>" if low else table)
        self._table.setToolTip(table if low else "")
        self.words = table
