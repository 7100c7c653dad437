"""Base class of all plot widgets: cursors, keys, history of views, notes, and a menu with export."""

from collections.abc import Sequence
from functools import partial

import pyqtgraph as pg
from PySide6.QtCore import QPoint, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QContextMenuEvent, QGuiApplication, QHideEvent, QKeyEvent, QMouseEvent, QShowEvent
from PySide6.QtWidgets import QMenu, QWidget

from app.window.controls.theme import Colours, Themed
from app.window.plots.cursors import TIME, CursorAxis, Cursors
from app.window.plots.framed_plot import FramedPlot, Span, ViewState
from app.window.plots.lines import LineStyle
from app.window.plots.plot_notes import PlotNotes

SETTLED_MS = 300  # time without movement after which a view is added to the history
PAN = 0.1  # shift per press of an arrow key, as a fraction of the view
ZOOM = 0.8
NUDGE = 0.01  # shift of a cursor per key press, as a fraction of the view


class PlotView(Themed, pg.GraphicsLayoutWidget):
    """One plot, or several stacked plots with a common x axis; subclasses draw the curves."""

    export_wanted = Signal(object, str)  # this view, and "png", "svg" or "csv"
    plots: tuple[FramedPlot, ...] = ()  # from top to bottom
    table_words = "Save the samples in view as CSV …"  # menu entry; empty if there is no CSV

    def __init__(self, name: str, axis: CursorAxis = TIME, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.name = name
        self.legend: Sequence[tuple[str, LineStyle]] = ()  # the panel's legend, for saved pictures
        self.shows: tuple[object, ...] = ()  # the shots whose curves are drawn
        self.setAccessibleName(name)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.ci.layout.setSpacing(2)
        self.ci.layout.setContentsMargins(4, 4, 10, 4)
        self.cursors = Cursors(self, axis)
        self.notes = PlotNotes(self)
        self._history = ViewHistory()
        self._settling = QTimer(self)
        self._settling.setSingleShot(True)
        self._settling.setInterval(SETTLED_MS)
        self._settling.timeout.connect(self.record_view)

    def join(self, plot: FramedPlot) -> None:
        """Add a plot below the others."""
        self.addItem(plot, row=len(self.plots), col=0)
        self.plots = (*self.plots, plot)
        plot.view.moved.connect(self.record_view_later)
        plot.apply_colours(self.colours)

    @property
    def span(self) -> Span:
        (left, right), _ = self.plots[0].view.viewRange()
        return float(left), float(right)

    def show_span(self, left: float, right: float) -> None:
        """Show this range of x; a y range set by the operator stays."""
        self.plots[0].view.setXRange(left, right, padding=0)

    def reset(self) -> None:
        raise NotImplementedError

    def set_shots(self, shots: Sequence[object], words: str) -> None:
        """Set the shots whose curves are drawn, and the title of saved pictures."""
        if [*map(id, self.shows)] != [*map(id, shots)]:  # by identity: == would compare the shots' arrays
            self._history.clear()
        if not shots:
            self.notes.forget_plots()
        self.shows = tuple(shots)
        self.setAccessibleDescription(words)

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        self.setBackground(colours.plot)
        for plot in self.plots:
            plot.apply_colours(colours)
        self.cursors.apply_colours()
        self.notes.apply_colours()

    # history of views --------------------------------------------------------------------------------------------

    @property
    def states(self) -> tuple[ViewState, ...]:
        return tuple(plot.state for plot in self.plots)

    @Slot()
    def record_view_later(self) -> None:
        """Add the view to the history once it has stopped moving."""
        self._settling.start()

    @Slot()
    def record_view(self) -> None:
        """Add the view to the history now."""
        self._history.note(self.states)

    def step_view(self, by: int) -> bool:
        """Go back (-1) or forward (1) in the history; return whether there was a view to show."""
        self._settling.stop()
        self.record_view()
        states = self._history.step(by)
        if states is not None:
            for plot, state in zip(self.plots, states, strict=True):
                plot.restore(state)
        return states is not None

    # cursors ----------------------------------------------------------------------------------------------------

    @Slot(bool)
    def show_cursors(self, shown: bool) -> None:
        self.cursors.show(shown, *self.span)

    @Slot()
    def toggle_cursors(self) -> None:
        self.show_cursors(not self.cursors.shown)

    @Slot()
    def copy_cursors(self) -> None:
        """Copy the cursor readings as tab-separated text."""
        if self.cursors.shown:
            QGuiApplication.clipboard().setText(self.cursors.text())

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.cursors.moved.emit()

    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self.cursors.moved.emit()

    # keys and menu ----------------------------------------------------------------------------------------------

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move and zoom with the arrow keys; with Shift move cursor A, with Ctrl cursor B; Home resets."""
        left, right = self.span
        width = right - left
        key, modifiers = event.key(), event.modifiers()
        if modifiers & Qt.KeyboardModifier.AltModifier:  # Alt+arrows are commands of the window
            event.ignore()
            return
        side = int(key == Qt.Key.Key_Right) - int(key == Qt.Key.Key_Left)
        if side and modifiers & (Qt.KeyboardModifier.ShiftModifier | Qt.KeyboardModifier.ControlModifier):
            if not self.cursors.shown:
                self.show_cursors(True)
            self.cursors.step("A" if modifiers & Qt.KeyboardModifier.ShiftModifier else "B", side * NUDGE * width)
        elif side:
            self.show_span(left + side * PAN * width, right + side * PAN * width)
            self.record_view_later()
        elif key in (Qt.Key.Key_Up, Qt.Key.Key_Plus, Qt.Key.Key_Down, Qt.Key.Key_Minus):
            closer = key in (Qt.Key.Key_Up, Qt.Key.Key_Plus)
            middle, half = 0.5 * (left + right), 0.5 * width * (ZOOM if closer else 1 / ZOOM)
            self.show_span(middle - half, middle + half)
            self.record_view_later()
        elif key == Qt.Key.Key_Home:
            self.reset()
        else:
            event.ignore()
            return
        event.accept()

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        self.menu(event.pos()).popup(event.globalPos())
        event.accept()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        note = self.notes.note_at(self.mapToScene(event.position().toPoint()))
        if note is None or event.button() != Qt.MouseButton.LeftButton:
            super().mouseDoubleClickEvent(event)
            return
        event.accept()
        self.notes.edit(note)

    @Slot()
    def write_note(self) -> bool:
        """Open the editor for a note at cursor A if the cursors are shown, else in the middle of the view.

        Returns whether the plot can have notes.
        """
        left, right = self.span
        place = self.notes.place_of(self.cursors.places[0] if self.cursors.shown else 0.5 * (left + right))
        if place is not None:
            self.notes.write(place)
        return place is not None

    def open_menu(self) -> None:
        """Open the menu at the widget's corner, for a key press."""
        self.menu().popup(self.mapToGlobal(QPoint(20, 20)))

    def menu(self, at: QPoint | None = None) -> QMenu:
        """Return a new menu: view, cursors, notes, export; ``at`` is the clicked position in the widget, if any."""
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("Reset the view", self.reset)
        menu.addAction("Back", partial(self.step_view, -1))
        menu.addAction("Forward", partial(self.step_view, 1))
        cursors = menu.addAction("Cursors")
        cursors.setCheckable(True)
        cursors.setChecked(self.cursors.shown)
        cursors.toggled.connect(self.show_cursors)
        copy = menu.addAction("Copy the cursor readings", self.copy_cursors)
        copy.setEnabled(self.cursors.shown)
        menu.addSeparator()
        self._add_notes(menu, at)
        menu.addAction("Save as PNG …", partial(self.export_wanted.emit, self, "png"))
        menu.addAction("Save as SVG …", partial(self.export_wanted.emit, self, "svg"))
        if self.table_words:
            menu.addAction(self.table_words, partial(self.export_wanted.emit, self, "csv"))
        return menu

    def _add_notes(self, menu: QMenu, at: QPoint | None) -> None:
        """Add the menu entries for notes, unless the plot can have none."""
        left, right = self.span
        if at is None:
            if self.notes.place_of(0.5 * (left + right)) is not None:
                menu.addAction("Write a note on the plot", self.write_note)
                menu.addSeparator()
            return
        scene = self.mapToScene(at)
        note, place = self.notes.note_at(scene), self.notes.place_at(scene)
        if note is not None:
            menu.addAction("Edit the note", partial(self.notes.edit, note))
            menu.addAction("Remove the note", partial(self.notes.remove, note))
        elif place is not None:
            menu.addAction("Write a note here", partial(self.notes.write, place))
        if note is not None or place is not None:
            menu.addSeparator()


def in_front(plots: Sequence[PlotView]) -> PlotView:
    """Return the focused view, else the first."""
    return next((plot for plot in plots if plot.hasFocus()), plots[0])


MOST = 100
States = tuple[ViewState, ...]  # one per plot


class ViewHistory:
    """A history of view states; a state added after going back replaces those that followed."""

    def __init__(self) -> None:
        self._states: list[States] = []
        self._place = -1

    def clear(self) -> None:
        self._states, self._place = [], -1

    def note(self, state: States) -> None:
        """Add a state, unless it is the present one."""
        if self._place >= 0 and self._states[self._place] == state:
            return
        self._states = [*self._states[: self._place + 1], state][-MOST:]
        self._place = len(self._states) - 1

    def step(self, by: int) -> States | None:
        """Go back (-1) or forward (1); return the state there, or None at either end."""
        place = self._place + by
        if not 0 <= place < len(self._states):
            return None
        self._place = place
        return self._states[place]
