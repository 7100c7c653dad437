"""Show and edit the operator's notes on a plot: a dot with a short text, edited in place."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal, Slot
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QLineEdit, QWidget

from analysis.shot import MAX_NOTE_LENGTH, PlotNote
from app.window.controls.theme import Colours
from app.window.controls.widgets import hover_text
from app.window.plots.framed_plot import FramedPlot
from app.window.plots.lines import straight

if TYPE_CHECKING:
    from app.window.plots.plot_view import PlotView

_IN_FRONT = 15  # z value: above the curves, below the cursors
_NEAR_PX = 9  # greatest distance from a note's dot at which a click selects the note
_EDITOR_WIDTH = 24  # in characters
_MIN_HEIGHT = 4  # least height of a plot, in heights of the text, for showing it; in a lower plot it is a tooltip


@dataclass(frozen=True, slots=True)
class NoteAxes:
    """A plot's name and the transformation to its axes: x = (note.x - ``zero``) * ``per_x``, y = note.y * ``per_y``."""

    plot: str  # a key of ``analysis.shot.shot.PLOT_UNITS``
    zero: float = 0.0
    per_x: float = 1.0
    per_y: float = 1.0

    def place(self, note: PlotNote) -> tuple[float, float]:
        """Return a note's position in the plot's units."""
        return (note.x - self.zero) * self.per_x, note.y * self.per_y

    def note(self, x: float, y: float, text: str) -> PlotNote:
        """Return a note at a position in the plot's units."""
        return PlotNote(self.plot, x / self.per_x + self.zero, y / self.per_y, text)


class PlotNotes(QObject):
    """Draws and edits the notes of one view; the notes themselves are stored by the receiver of ``changed``."""

    changed = Signal(object, object)  # note before (None: new) and after (None: removed)

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
        """Set what a plot shows, so that it can have notes."""
        self._axes[plot] = axes
        self._draw()

    def forget_plots(self) -> None:
        """Remove all drawn notes, because the plots show no shot."""
        self._axes.clear()
        self._close_editor()
        self._draw()

    def show(self, notes: Sequence[PlotNote]) -> None:
        """Show these notes, each in its plot."""
        if tuple(notes) != self._notes:
            self._notes = tuple(notes)
            self._draw()

    def apply_colours(self) -> None:
        for drawn in self._drawn:
            drawn.apply_colours(self._view.colours)

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
        """Return plot, x and y at a position in the scene; None outside the plots that can have notes."""
        for plot in self._axes:
            if plot.isVisible() and plot.view.sceneBoundingRect().contains(scene):
                spot = plot.view.mapSceneToView(scene)
                return plot, float(spot.x()), float(spot.y())
        return None

    def place_of(self, x: float) -> tuple[FramedPlot, float, float] | None:
        """Return the first plot that can have notes, x, and the y of its last (measured) curve there, or None."""
        plot = next((plot for plot in self._axes if plot.isVisible()), None)
        if plot is None:
            return None
        bottom, top = plot.view.viewRange()[1]
        values = (float(curve.value_at(x)) for curve in getattr(plot, "sampled", ())[::-1] if curve.isVisible())
        y = next((value for value in values if bottom <= value <= top), 0.5 * (bottom + top))
        return plot, x, y

    def note_at(self, scene: QPointF) -> PlotNote | None:
        """Return the note whose dot or text is at a position in the scene, or None."""
        return next((drawn.note for drawn in self._drawn[::-1] if drawn.is_at(scene)), None)

    # writing ------------------------------------------------------------------------------------------------------

    def write(self, place: tuple[FramedPlot, float, float], before: PlotNote | None = None) -> None:
        """Open the editor for a new note at a position, or for the note ``before`` at that position."""
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
        """Open the editor for a drawn note."""
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
    """A note drawn as a dot with its text on the side that has room."""

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
        self.apply_colours(colours)
        self._turn()
        self._fit()

    @property
    def is_whole(self) -> bool:
        """Get whether the text is shown too, not only the dot."""
        return bool(self._text.isVisible())

    def _fit(self, *_: object) -> None:
        self._text.setVisible(self.plot.view.height() >= _MIN_HEIGHT * self._text.boundingRect().height())

    def apply_colours(self, colours: Colours) -> None:
        self._dot.setBrush(pg.mkBrush(colours.cursor_a))
        self._dot.setPen(straight(colours.plot))
        self._text.setColor(colours.text)
        self._text.fill = pg.mkBrush(f"{colours.plot}d0")
        self._text.border = straight(colours.cursor_a)
        self._text.update()

    def _turn(self, *_: object) -> None:
        """Put the text to the left of a dot in the right half of the plot, and below a dot in the upper half."""
        (left, right), (bottom, top) = self.plot.view.viewRange()
        x, y = self.place
        self._text.setAnchor((1.0 if x > 0.5 * (left + right) else 0.0, 0.0 if y > 0.5 * (bottom + top) else 1.0))

    def is_at(self, scene: QPointF) -> bool:
        """Return whether the dot or the text is at a position in the scene."""
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
    """A one-line editor over the plot: Enter or a click elsewhere accepts the text, Esc discards the change."""

    done = Signal(str)
    left = Signal()

    def __init__(self, text: str, parent: QWidget) -> None:
        super().__init__(text, parent)
        self.setAccessibleName("Note on the plot")
        self.setPlaceholderText("note; Enter saves it")
        self.setMaxLength(MAX_NOTE_LENGTH)
        self.selectAll()
        self.editingFinished.connect(self._finished)

    def place(self, at: QPointF) -> None:
        """Move the editor to a position, wholly inside its parent."""
        parent = self.parentWidget()
        width = min(parent.width(), _EDITOR_WIDTH * self.fontMetrics().horizontalAdvance("n"))
        height = self.sizeHint().height()
        x = max(0, min(round(at.x()), parent.width() - width))
        y = max(0, min(round(at.y()) - height // 2, parent.height() - height))
        self.setGeometry(x, y, width, height)

    def event(self, event: QEvent) -> bool:
        """Accept Esc here, because the window's shortcut for Esc would abort the capture."""
        shortcut = event.type() == QEvent.Type.ShortcutOverride
        if shortcut and isinstance(event, QKeyEvent) and event.key() == Qt.Key.Key_Escape:
            event.accept()
            return True
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            event.accept()
            self.left.emit()
            return
        super().keyPressEvent(event)

    def end(self) -> None:
        self.blockSignals(True)  # hiding moves the focus, which would otherwise accept the text
        self.hide()
        self.deleteLater()

    @Slot()
    def _finished(self) -> None:
        self.done.emit(" ".join(self.text().split()))
