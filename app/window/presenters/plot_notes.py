"""The operator's notes on the plots of the shot in front: shown, and kept in the session as they are written."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal, Slot

from analysis.shot.shot import PlotNote
from app.session.session import Entry, Session
from app.window.layout import Layout
from app.window.theme import Tone


class PlotNotesPresenter(QObject):
    """Between the session and the plots of SHOT and SPECTRUM."""

    said = Signal(str, Tone)

    def __init__(self, session: Session, panels: Layout, front: Callable[[], Entry | None], parent: QObject) -> None:
        super().__init__(parent)
        self._session, self._panels, self._front = session, panels, front
        self._plots = (*panels.shot.plots, *panels.spectrum.plots)
        self._number: int | None = None
        for plot in self._plots:
            plot.notes.changed.connect(self._changed)

    def refresh(self) -> None:
        """Show the notes of the shot in front."""
        entry = self._front()
        self._number = entry.number if entry is not None else None
        for plot in self._plots:
            plot.notes.show(entry.plot_notes if entry is not None else ())

    @Slot()
    def note_on_plot(self) -> None:
        """Open the line for a note on the plot in front."""
        plot = self._panels.plot_in_front()
        if plot not in self._plots or not plot.write_note():
            self.said.emit("Notes are written on the plots of a shot: SHOT (Ctrl+2), SPECTRUM (Ctrl+4)", Tone.NEUTRAL)

    @Slot(object, object)
    def _changed(self, before: PlotNote | None, after: PlotNote | None) -> None:
        if self._number is not None:
            self._session.change_plot_note(self._number, before, after)
            self.refresh()
