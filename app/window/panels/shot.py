"""SHOT page: views of one shot over time, force against deflection, gap, raw signals."""

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QButtonGroup, QPushButton, QStackedWidget, QWidget

from analysis.diagnosis import Diagnosis
from analysis.drive import DriveCurves
from analysis.shot import Recording, Shot
from app.report import time_zero
from app.window.controls.commands import with_keys
from app.window.controls.widgets import FlowLayout, keep_place, push_button, text_label, vertical
from app.window.panels.shot_drive import DriveView
from app.window.panels.shot_motion import SLOPE, DeflectionView, GapView, MotionView
from app.window.panels.shot_raw import RawCurves, RawView
from app.window.plots.cursors import CursorReadout
from app.window.plots.legend import Legend, is_low
from app.window.plots.lines import BAND, MEASURED, RESIDUAL, SIMULATED, LineStyle
from app.window.plots.plot_view import PlotView, in_front
from app.words import lines, tag

VIEWS = {  # name -> (label, tooltip)
    "whole": ("Whole shot", "Velocity, force and residual of the whole shot"),
    "contact": ("First contact", "The bounces at first contact (the paper's Fig. 5)"),
    "deflection": (
        "Force vs deflection", "Force against deflection of the plate (Fig. 6); its slope is the stiffness"
    ),
    "gap": ("Gap", "Distance between block and plate (Fig. 7); below zero the two overlap"),
    "raw": ("Raw signals", "Photodiode and light-switch signals, every sample"),
}  # fmt: skip
DRIVE_VIEWS = {  # the views of a drive, with the same keys
    "whole": ("Over time", "Velocity, force and residual over the whole record"),
    "contact": ("Force vs speed", "Measured and modelled force against speed, and the residual"),
    "deflection": ("Force vs position", "Measured and modelled force against position, and the residual"),
}
NO_SHOT = "No shot yet. Press ARM (space), then push the block through the light switch."


class ShotPanel(QWidget):
    """The SHOT page: the plots of the last selected shot."""

    raw_wanted = Signal(object)  # the Recording whose raw curves are needed
    drive_wanted = Signal(object)  # the Shot whose modelled force is needed

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._shot: Shot | None = None
        self._of = ""  # name of the shot for saved pictures
        self._driven = False
        self.view = "whole"  # name of the view, one of ``VIEWS``
        self._undrawn: set[str] = set()  # views not drawn yet
        self.motion = MotionView(self)
        self.stack = self.motion.stack
        self.deflection = DeflectionView(self)
        self.gap = GapView(self)
        self.raw = RawView(self)
        self.drive = DriveView(self)
        self._page_of = {"deflection": self.deflection, "gap": self.gap.stack, "raw": self.raw.stack}  # else stack
        self._pages = QStackedWidget(self)
        pages: tuple[PlotView, ...] = (self.stack, *self._page_of.values())
        self.plots = (*pages, *self.drive.plots)
        all_pages: list[QWidget] = [*pages, *self.drive.pages.values()]
        for page in all_pages:
            self._pages.addWidget(page)
        self._legend = Legend(self)
        self._empty = text_label(NO_SHOT, self, faint=True, selectable=True, wrap=True)
        self._empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._pages.addWidget(self._empty)
        self._build()
        for plot in self.plots:
            plot.cursors.moved.connect(self._cursors_moved)
        self._judged_by: Diagnosis | None = None
        self.show_shot(None)

    def plot_in_front(self) -> PlotView | None:
        """Return the focused plot of the view, else its first, or None."""
        shown = [plot for plot in self.plots if plot.isVisibleTo(self)]
        return in_front(shown) if shown else None

    def _build(self) -> None:
        column = vertical(self, (6, 6, 6, 2), 4)
        bar = FlowLayout()
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        for name in VIEWS:
            button = push_button("", "", self, self._view_pressed, name, checkable=True)
            self._group.addButton(button)
            self._buttons[name] = button
            bar.addWidget(button)
        hover = with_keys("Two cursors: differences, mean, rms and slope between them", "on_plot:toggle_cursors")
        self._cursor_button = push_button("Cursors", hover, self, checkable=True)
        self._cursor_button.toggled.connect(self.show_cursors)
        bar.addWidget(self._cursor_button)
        hover = "Save this plot as PNG, SVG or CSV; also by right click"
        self.save_plot = push_button("Save plot …", hover, self, command="on_plot:open_menu")
        bar.addWidget(self.save_plot)
        column.addLayout(bar)
        bar.addWidget(self.motion.kind)
        column.addWidget(self._legend)
        column.addWidget(self.drive.say)
        column.addWidget(self._pages, 1)
        for plot in self.plots:
            column.addWidget(CursorReadout(plot, self))

    def _label_lines(self) -> None:
        entries: list[tuple[str, LineStyle]] = [("measured", MEASURED), ("simulated", SIMULATED)]
        if self._driven:
            entries = self.drive.legend()
        elif self.view == "raw":
            entries = [("reading the samples …" if self._reading else "every sample, extremes kept", MEASURED)]
        elif self.view == "deflection":
            entries.append(("slope", SLOPE))
        elif self.view != "gap":
            entries[1] = ("simulated (fitted to this shot)", SIMULATED)
            entries.append(("measured − simulated", RESIDUAL))
            entries.append((f"{self.motion.band_words or 'noise, path drift and floor vibration'}, ±2 σ", BAND))
        self._legend.show_entries(entries)
        for plot in self.plots:
            plot.legend = entries
        self._show_words()

    @property
    def _reading(self) -> bool:
        """Get whether the raw view is waiting for its curves."""
        return self.view == "raw" and self.raw.has_samples and self.raw.wanted is not None

    def show_shot(
        self,
        shot: Shot | None,
        recording: Recording | None = None,
        words: str = "",
        band_from: Diagnosis | None = None,
    ) -> None:
        """Show a shot with the title ``words``; without a shot show ``words``, or how to take a shot.

        ``band_from`` is the diagnosis with a valid verdict on the shot; the noise band is then taken from it.
        """
        self._shot, self._judged_by = shot, band_from
        self._of = words or (shot.name if shot is not None else "")
        for plot in self.plots:
            plot.set_shots((), "")
        self._driven = shot is not None and not shot.settings.collides
        self._name_views()
        self.raw.show_recording(recording, 0.0 if shot is None else time_zero(shot)[0])
        if shot is None or shot.motion is None:
            if shot is not None:
                why = f"{shot.name} could not be analysed.\n\n{shot.problem or ''}"
                words = f"{why}\n\nIts samples are there: Raw signals (5)."
            self._empty.setText(words or NO_SHOT)
            self._undrawn = set()
        else:
            for stack in (self.stack, self.gap.stack, self.raw.stack):
                stack.label_time(time_zero(shot)[1])
            self._undrawn = {"drive"} if self._driven else {"motion", "deflection", "gap"}
        self.drive.show_curves(None)
        self.set_view(self.view)
        self.reset()

    def _view_pressed(self, view: str) -> None:
        self.set_view(view)
        self.reset()

    def set_view(self, view: str) -> None:
        """Show one of ``VIEWS``."""
        self.view = view if not self._driven or view in DRIVE_VIEWS else "whole"
        view = self.view
        self._buttons[view].setChecked(True)
        others = self.drive.pages if self._driven else self._page_of
        analysed = self._shot is not None and self._shot.motion is not None
        there = analysed or (view == "raw" and self.raw.has_samples)
        page: QWidget = others.get(view, self.stack) if there else self._empty
        self._draw(view)
        self.motion.choose(contact_only=view == "contact")
        self._pages.setCurrentWidget(page)
        self.motion.kind.setVisible(page is self.stack)
        self._show_words()
        for button in (self._cursor_button, self.save_plot):
            button.setEnabled(page is not self._empty)
        self._cursors_moved()
        self._label_lines()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._show_words()

    def _show_words(self) -> None:
        """Show legend and summary; on a low screen show them as tooltips, unless the plot is empty."""
        low = is_low(self)
        shown = self._pages.currentWidget() is not self._empty
        self._legend.setVisible(shown and (not low or self._reading))
        self.drive.say.setVisible(shown and self._driven and (not low or self.drive.curves is None))
        entries = [words for words, _ in self._legend.entries]
        said = tag("span", lines([*entries, self.drive.say.text()] if self._driven else entries))
        for plot in self.plots:
            plot.setToolTip(said if low else "")

    def _draw(self, view: str) -> None:
        """Draw a view when it is first shown, or request the curves that it needs."""
        if view == "raw" and self.raw.wanted is not None:
            self.raw_wanted.emit(self.raw.wanted)
        what = "drive" if self._driven else "motion" if view in ("whole", "contact") else view
        if self._shot is None or what not in self._undrawn:
            return
        self._undrawn.discard(what)
        if what == "drive":
            if self._shot.fit is not None:
                self.drive.say.setText("modelling the force …")
                self.drive_wanted.emit(self._shot)
            else:
                why = self._shot.fit_problem or self._shot.problem or "no model was fitted"
                self.drive.say.setText(f"the force was not modelled: {why}")
            return
        if what == "motion":
            self.motion.show_shot(self._shot, self._judged_by)
        else:
            (self.gap if what == "gap" else self.deflection).show_shot(self._shot)
        self._page_of.get(what, self.stack).set_shots((self._shot,), self._of)

    def show_drive(self, shot: Shot, curves: DriveCurves) -> None:
        """Show the modelled force of a drive, if its shot is still displayed."""
        if shot is not self._shot:
            return
        self.drive.show_curves(curves)
        for plot in self.drive.plots:
            plot.set_shots((shot,), self._of)
        self.reset()
        self._label_lines()

    def _name_views(self) -> None:
        """Set the labels of the buttons for a collision or a drive."""
        for name, button in self._buttons.items():
            words, hover = (VIEWS | DRIVE_VIEWS if self._driven else VIEWS)[name]
            button.setText(words)
            button.setToolTip(with_keys(hover, f"show_view:{name}"))
            button.setVisible(not self._driven or name in DRIVE_VIEWS)
        keep_place(self.motion.kind, not self._driven)  # so that all views' plots start at the same height

    def show_raw(self, curves: RawCurves) -> None:
        if self.raw.show_curves(curves) and self._shot is not None:
            self.raw.stack.set_shots((self._shot,), self._of)
        self._label_lines()

    def reset(self) -> None:
        """Reset the plots of the view; of a drive, those of all views."""
        for plot in self.drive.plots if self._driven else (self._page_of.get(self.view, self.stack),):
            plot.reset()

    @Slot(bool)
    def show_cursors(self, shown: bool) -> None:
        plot = self.plot_in_front()
        if plot is not None and plot.cursors.shown != shown:
            plot.show_cursors(shown)

    @Slot()
    def _cursors_moved(self) -> None:
        plot = self.plot_in_front()
        self._cursor_button.setChecked(plot is not None and plot.cursors.shown)
