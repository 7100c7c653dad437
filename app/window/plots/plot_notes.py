"""The operator's notes on a plot: a dot and a short text in its place, written into a line that opens there."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal, Slot
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QLineEdit, QWidget

from analysis.shot import LONGEST, PlotNote
from app.window.plots.framed_plot import FramedPlot
from app.window.plots.lines import straight
from app.window.theme import Colours
from app.window.widgets import hover_text

if TYPE_CHECKING:
    from app.window.plots.plot_view import PlotView

_IN_FRONT = 15  # of the curves, behind the cursors
_NEAR_PX = 9  # this far from a note's dot a press still means the note
_EDITOR_WIDTH = 24  # characters
_LEAST_HEIGHT = (
    4  # of a plot, in heights of the text: lower, a note's text lies over the curves and is shown on hovering
)


@dataclass(frozen=True, slots=True)
class NoteAxes:
    """Which of the shot's plots this is, and how its axes count: x = (note's x - ``zero``) ``per_x``, y likewise."""

    plot: str  # a name of ``analysis.shot.shot.UNITS``
    zero: float = 0.0
    per_x: float = 1.0
    per_y: float = 1.0

    def place(self, note: PlotNote) -> tuple[float, float]:
        """Return where a note stands in the plot's own units."""
        return (note.x - self.zero) * self.per_x, note.y * self.per_y

    def note(self, x: float, y: float, text: str) -> PlotNote:
        """Return the note at a place of the plot."""
        return PlotNote(self.plot, x / self.per_x + self.zero, y / self.per_y, text)


class PlotNotes(QObject):
    """The notes of one view.  It draws and edits; whoever keeps the notes answers ``changed``."""

    changed = Signal(object, object)  # the note before and after: None where it is new, or removed

    def __init__(self, view: "PlotView") -> None:
        super().__init__(view)
        self._view = view
        self._axes: dict[FramedPlot, NoteAxes] = {}
        self._notes: tuple[PlotNote, ...] = ()
        self._drawn: list[_DrawnNote] = []
        self._editor: NoteEditor | None = None
        self._at: tuple[FramedPlot, float, float] | None = None
        self._before: PlotNote | None = None

    def describe(self, plot: FramedPlot, axes: NoteAxes) -> None:
        """Say what a plot shows from now on."""
        self._axes[plot] = axes
        self._draw()

    def forget_plots(self) -> None:
        """Draw no notes: the plots show no shot."""
        self._axes.clear()
        self._close_editor()
        self._draw()

    def show(self, notes: Sequence[PlotNote]) -> None:
        """Show these notes, each in the plot that it belongs to."""
        if tuple(notes) != self._notes:
            self._notes = tuple(notes)
            self._draw()

    def dress(self) -> None:
        """Set the colours of the view."""
        for drawn in self._drawn:
            drawn.dress(self._view.colours)

    def _draw(self) -> None:
        for drawn in self._drawn:
            drawn.remove()
        self._drawn = [
            _DrawnNote(plot, axes, note, self._view.colours)
            for plot, axes in self._axes.items()
            for note in self._notes
            if note.plot == axes.plot
        ]

    # places -------------------------------------------------------------------------------------------------------

    def place_at(self, scene: QPointF) -> tuple[FramedPlot, float, float] | None:
        """Return plot, x and y at a place of the scene; None outside of the plots that can have notes."""
        for plot in self._axes:
            if plot.isVisible() and plot.view.sceneBoundingRect().contains(scene):
                spot = plot.view.mapSceneToView(scene)
                return plot, float(spot.x()), float(spot.y())
        return None

    def place_of(self, x: float) -> tuple[FramedPlot, float, float] | None:
        """Return plot, x and y of its last curve, the measured one, at ``x``; None where no plot can have notes."""
        plot = next((plot for plot in self._axes if plot.isVisible()), None)
        if plot is None:
            return None
        bottom, top = plot.view.viewRange()[1]
        values = (float(curve.value_at(x)) for curve in getattr(plot, "sampled", ())[::-1] if curve.isVisible())
        y = next((value for value in values if bottom <= value <= top), 0.5 * (bottom + top))
        return plot, x, y

    def note_at(self, scene: QPointF) -> PlotNote | None:
        """Return the note whose dot or text is at a place of the scene."""
        return next((drawn.note for drawn in self._drawn[::-1] if drawn.is_at(scene)), None)

    # writing ------------------------------------------------------------------------------------------------------

    def write(self, place: tuple[FramedPlot, float, float], before: PlotNote | None = None) -> None:
        """Open the line for a new note at a place, or for ``before``, which stands there."""
        self._close_editor()
        self._at, self._before = place, before
        plot, x, y = place
        editor = NoteEditor("" if before is None else before.text, self._view)
        editor.done.connect(self._written)
        editor.left.connect(self._close_editor)
        self._editor = editor
        editor.place(self._view.mapFromScene(plot.view.mapViewToScene(pg.Point(x, y))))
        editor.show()
        editor.setFocus()

    def edit(self, note: PlotNote) -> None:
        """Open the line for a note that is drawn."""
        drawn = next((drawn for drawn in self._drawn if drawn.note is note), None)
        if drawn is not None:
            self.write((drawn.plot, *drawn.place), note)

    def remove(self, note: PlotNote) -> None:
        self.changed.emit(note, None)

    @Slot(str)
    def _written(self, text: str) -> None:
        at, before = self._at, self._before
        self._close_editor()
        if at is None:
            return
        if before is not None:
            self.changed.emit(before, replace(before, text=text) if text else None)
        elif text:
            plot, x, y = at
            self.changed.emit(None, self._axes[plot].note(x, y, text))

    @Slot()
    def _close_editor(self) -> None:
        editor, self._editor, self._at = self._editor, None, None
        if editor is not None:
            had_focus = editor.hasFocus()
            editor.end()
            if had_focus:
                self._view.setFocus()


class _DrawnNote:
    """A dot at the note's place, its text beside it on the side that has room."""

    def __init__(self, plot: FramedPlot, axes: NoteAxes, note: PlotNote, colours: Colours) -> None:
        self.plot, self.note, self.place = plot, note, axes.place(note)
        self._dot = pg.ScatterPlotItem([self.place[0]], [self.place[1]], size=7, pxMode=True)
        self._text = pg.TextItem(note.text)
        self._text.setPos(*self.place)
        for item in (self._dot, self._text):
            item.setZValue(_IN_FRONT)
            plot.addItem(item, ignoreBounds=True)
        self._dot.setToolTip(hover_text(note.text))
        plot.view.sigRangeChanged.connect(self._turn)
        plot.view.sigResized.connect(self._fit)
        self.dress(colours)
        self._turn()
        self._fit()

    @property
    def is_whole(self) -> bool:
        """Get whether the text is shown too."""
        return bool(self._text.isVisible())

    def _fit(self, *_: object) -> None:
        self._text.setVisible(self.plot.view.height() >= _LEAST_HEIGHT * self._text.boundingRect().height())

    def dress(self, colours: Colours) -> None:
        self._dot.setBrush(pg.mkBrush(colours.cursor_a))
        self._dot.setPen(straight(colours.plot))
        self._text.setColor(colours.text)
        self._text.fill = pg.mkBrush(f"{colours.plot}d0")
        self._text.border = straight(colours.cursor_a)
        self._text.update()

    def _turn(self, *_: object) -> None:
        """Let the text lie to the left in the right half of the plot, and below the dot in the upper half."""
        (left, right), (bottom, top) = self.plot.view.viewRange()
        x, y = self.place
        self._text.setAnchor((1.0 if x > 0.5 * (left + right) else 0.0, 0.0 if y > 0.5 * (bottom + top) else 1.0))

    def is_at(self, scene: QPointF) -> bool:
        """Return whether dot or text are at a place of the scene."""
        if not self.plot.isVisible():
            return False
        dot = self.plot.view.mapViewToScene(pg.Point(*self.place))
        near = abs(dot.x() - scene.x()) <= _NEAR_PX and abs(dot.y() - scene.y()) <= _NEAR_PX
        on_text = self._text.mapRectToScene(self._text.boundingRect()).contains(scene)
        return near or (self.is_whole and bool(on_text))

    def remove(self) -> None:
        self.plot.view.sigRangeChanged.disconnect(self._turn)
        self.plot.view.sigResized.disconnect(self._fit)
        for item in (self._dot, self._text):
            self.plot.view.removeItem(item)


class NoteEditor(QLineEdit):
    """One line over the plot: Enter or a click elsewhere keeps the text, Esc leaves it as it was."""

    done = Signal(str)
    left = Signal()

    def __init__(self, text: str, parent: QWidget) -> None:
        super().__init__(text, parent)
        self.setAccessibleName("Note on the plot")
        self.setPlaceholderText("note; Enter keeps it")
        self.setMaxLength(LONGEST)
        self.selectAll()
        self.editingFinished.connect(self._finished)

    def place(self, at: QPointF) -> None:
        """Stand at a place of the plot, wholly inside it."""
        parent = self.parentWidget()
        width = min(parent.width(), _EDITOR_WIDTH * self.fontMetrics().horizontalAdvance("n"))
        height = self.sizeHint().height()
        x = max(0, min(round(at.x()), parent.width() - width))
        y = max(0, min(round(at.y()) - height // 2, parent.height() - height))
        self.setGeometry(x, y, width, height)

    def event(self, event: QEvent) -> bool:
        """Take Esc before the window does, which aborts by it."""
        shortcut = event.type() == QEvent.Type.ShortcutOverride
        if shortcut and isinstance(event, QKeyEvent) and event.key() == Qt.Key.Key_Escape:
            event.accept()
            return True
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Leave by Esc."""
        if event.key() == Qt.Key.Key_Escape:
            event.accept()
            self.left.emit()
            return
        super().keyPressEvent(event)

    def end(self) -> None:
        """Go without keeping anything."""
        self.blockSignals(True)  # hiding takes the focus away, which would count as done
        self.hide()
        self.deleteLater()

    @Slot()
    def _finished(self) -> None:
        self.done.emit(" ".join(self.text().split()))
