"""The steps of the short tour, and its start at the first start of the program."""

from PySide6.QtCore import QObject, Slot

from app.session import Choices
from app.window.layout import Layout
from app.window.panels.tour import Step


class TourPresenter(QObject):
    """Starts the tour and remembers that it was seen."""

    def __init__(self, choices: Choices, panels: Layout, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._choices, self._panels = choices, panels
        self.tour = panels.tour
        self.tour.ended.connect(self._ended)

    def start_once(self) -> None:
        """Start the tour unless it was seen before."""
        if not self._choices.settings.tour_done:
            self.start()

    @Slot()
    def toggle_tour(self) -> None:
        """Start the tour, or end it."""
        if self.tour.isVisible():
            self.tour.finish()
        else:
            self.start()

    def start(self) -> None:
        """Start the tour from its first callout."""
        p = self._panels
        self.tour.begin(
            (
                Step(
                    p.controls.arm,
                    "Press ARM",
                    "Nothing needs to be plugged in: the simulated bench pushes its block by itself. Press ARM (space) "
                    "and the next push becomes a shot. You can do it now; the tour stays.",
                ),
                Step(
                    p.banner,
                    "The state, and what to do",
                    "One word, readable from afar: READY, ARMED, CAPTURED, ANALYSING, FAULT. Beside it: what to do.",
                ),
                Step(
                    p.numbers,
                    "The numbers of the shot",
                    "Each with its standard uncertainty; hover to read how it was found, press Budget (B) for where "
                    "the uncertainty comes from.",
                ),
                Step(
                    p.table,
                    "The session",
                    "Every shot taken or opened. Select several to compare (Ctrl+3) or to diagnose (D): it says what "
                    "the model lacks.",
                ),
                Step(
                    p.work,
                    "Your own rig",
                    "Set-up (F3) finds a digitizer and checks its signals; Settings (F2) takes mass, air and "
                    "wavelength; F1 shows every key.",
                ),
            )
        )

    @Slot()
    def _ended(self) -> None:
        if not self._choices.settings.tour_done:
            self._choices.change({"tour_done": True})
        self._panels.controls.arm.setFocus()
