"""The name of a plot's values, written into the plot where its value axis is too low for it."""

import pyqtgraph as pg
from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QFontMetricsF

from app.window.plots.framed_plot import FramedPlot
from app.window.theme import Colours

ON_TOP = 30
_MARGIN = 8  # of the text item


class Caption(pg.TextItem):
    """Words in the upper left corner of a plot; hidden as long as the value axis carries them whole."""

    def __init__(self, plot: FramedPlot) -> None:
        super().__init__("", anchor=(0, 0))
        self._words = ""
        self._view = plot.view
        self.setParentItem(self._view)
        self.setZValue(ON_TOP)
        self.hide()
        plot.getAxis("left").fitted.connect(self._label_fitted)
        self._view.sigResized.connect(self._fit)

    @property
    def shown(self) -> str:
        """Get the words, "" while the axis says them."""
        return str(self.toPlainText()) if self.isVisible() else ""

    def say(self, words: str) -> None:
        """Set the words; where the plot is narrower than they are, their end is left out."""
        self._words = words
        self._fit()

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self.setColor(colours.text)
        self.fill = pg.mkBrush(f"{colours.plot}a0")  # what lies behind is seen

    @Slot(bool)
    def _label_fitted(self, whole: bool) -> None:
        self.setVisible(not whole)

    @Slot()
    def _fit(self) -> None:
        room = self._view.width() - _MARGIN
        self.setText(QFontMetricsF(self.textItem.font()).elidedText(self._words, Qt.TextElideMode.ElideRight, room))
