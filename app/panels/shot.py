"""SHOT: one shot, measured and simulated over one another, the residual below, and the paper's three views."""

import numpy as np
from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import (
    QButtonGroup,
    QComboBox,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from analysis.motion import Motion
from analysis.quantity import Quantity
from analysis.recording import Recording
from analysis.shot import Shot
from app.panels.shot_deflection import DeflectionView
from app.panels.shot_gap import GapView
from app.panels.shot_raw import RawView
from app.plots.cursor_readout import CursorReadout
from app.plots.legend import Legend
from app.plots.shot_times import contact_span_ms, time_zero
from app.plots.time_stack import TimeStack
from app.theme import Colours, thin, under

VIEWS = (
    ("whole", "Whole shot", "1", "Velocity, force and residual of the whole shot"),
    ("contact", "First contact", "2", "The bounces at first contact (the paper's Fig. 5)"),
    (
        "deflection",
        "F against deflection",
        "3",
        "Force against deflection of the plate (Fig. 6); its slope is the stiffness",
    ),
    ("gap", "Gap", "4", "Distance between block and plate (Fig. 7); below zero the two overlap"),
    ("raw", "Raw signals", "5", "What the photodiodes and the light switch gave, every sample"),
)
RESIDUALS = (
    ("force", "Residual of force", "mN", 1e3),
    ("velocity", "Residual of velocity", "µm/s", 1e6),
    ("displacement", "Residual of displacement", "nm", 1e9),
)


class ShotPanel(QWidget):
    """The plots of the shot that is selected."""

    view_changed = Signal(str)
    export_wanted = Signal(object, str)
    raw_wanted = Signal(object)  # the recording whose raw curves are to be made

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        self._shot: Shot | None = None
        self._view = "whole"
        self._undrawn: set[str] = set()  # views that do not show this shot yet
        self.stack = TimeStack("Velocity, force and residual over time", colours, self)
        self.velocity = self.stack.add_plot("velocity", "m/s", 3)
        self.force = self.stack.add_plot("force", "N", 4)
        self.residual = self.stack.add_plot("residual", "mN", 2)
        self._simulated = [
            self.velocity.add_curve("simulated", under(colours.simulated)),
            self.force.add_curve("simulated", under(colours.simulated)),
        ]
        self._measured = [
            self.velocity.add_curve("measured", thin(colours.measured)),
            self.force.add_curve("measured", thin(colours.measured)),
        ]
        self._band = self.residual.add_band(colours.band, colours.band_edge)
        self._residual = self.residual.add_curve("measured − simulated", thin(colours.residual))
        self.deflection = DeflectionView(colours, self)
        self.gap = GapView(colours, self)
        self.raw = RawView(colours, self)
        self._pages = QStackedWidget(self)
        for page in (self.stack, self.deflection, self.gap.stack, self.raw.stack):
            self._pages.addWidget(page)
        self._legend = Legend(self)
        self._empty = QLabel("No shot yet. Press ARM (space), then push the block through the light switch.", self)
        self._empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._empty.setProperty("faint", True)
        self._empty.setWordWrap(True)
        self._pages.addWidget(self._empty)
        self._readouts = [CursorReadout(s.cursors, self) for s in self.stacks]
        self._build()
        for stack in self.stacks:
            stack.reset_wanted.connect(self.reset)
            stack.export_wanted.connect(self._export)
        self.stack.clicked.connect(self._zoom_on_bounce)
        self.dress(colours)
        self.show_shot(None)

    @property
    def stacks(self) -> tuple[TimeStack, ...]:
        """Get the stacks of linked plots."""
        return self.stack, self.gap.stack, self.raw.stack

    @property
    def view(self) -> str:
        """Get the view shown: one of ``VIEWS``."""
        return self._view

    @property
    def shot(self) -> Shot | None:
        """Get the shot shown."""
        return self._shot

    def current_stack(self) -> TimeStack | None:
        """Return the stack in view, or None where the view is not over time."""
        page = self._pages.currentWidget()
        return page if isinstance(page, TimeStack) else None

    def _build(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 2)
        column.setSpacing(4)
        bar = QHBoxLayout()
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        for name, words, key, tip in VIEWS:
            button = QPushButton(words, self)
            button.setCheckable(True)
            button.setToolTip(f"{tip}  ({key})")
            button.setProperty("view", name)
            self._group.addButton(button)
            self._buttons[name] = button
            bar.addWidget(button)
        self._group.buttonClicked.connect(self._view_pressed)
        bar.addStretch(1)
        self._cursor_button = QPushButton("Cursors", self)
        self._cursor_button.setCheckable(True)
        self._cursor_button.setToolTip("Two cursors: differences, mean, rms and slope between them  (C)")
        self._cursor_button.toggled.connect(self.show_cursors)
        bar.addWidget(self._cursor_button)
        self._menu_button = QPushButton("Save plot …", self)
        self._menu_button.setToolTip("Save this plot as PNG, SVG or CSV; also by right click  (Ctrl+P)")
        self._menu_button.clicked.connect(self.open_menu)
        bar.addWidget(self._menu_button)
        column.addLayout(bar)
        line = QHBoxLayout()
        line.addWidget(self._legend, 1)
        self._residual_kind = QComboBox(self)
        self._residual_kind.setAccessibleName("Which residual the lowest plot shows")
        self._residual_kind.setToolTip(
            "Slow effects show in displacement, where the optics' noise is white; fast ones in force"
        )
        for _, words, unit, _ in RESIDUALS:
            self._residual_kind.addItem(f"{words} ({unit})")
        self._residual_kind.currentIndexChanged.connect(self._residual_changed)
        line.addWidget(self._residual_kind)
        column.addLayout(line)
        column.addWidget(self._pages, 1)
        for readout in self._readouts:
            column.addWidget(readout)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self._colours = colours
        self.stack.dress(colours)
        self.deflection.dress(colours)
        self.gap.dress(colours)
        self.raw.dress(colours)
        for curve in self._measured:
            curve.setPen(thin(colours.measured))
        for curve in self._simulated:
            curve.setPen(under(colours.simulated))
        self._residual.setPen(thin(colours.residual))
        self._label_lines()

    def _label_lines(self) -> None:
        c = self._colours
        if self._view == "raw":
            entries = [("every sample, extremes kept", thin(c.measured))]
        elif self._view == "gap":
            entries = [("measured", thin(c.measured)), ("simulated", under(c.simulated))]
        elif self._view == "deflection":
            entries = [
                ("measured", thin(c.measured)),
                ("simulated", under(c.simulated)),
                ("slope", thin(c.residual, Qt.PenStyle.DashLine)),
            ]
        else:
            entries = [
                ("measured", thin(c.measured)),
                ("simulated (fitted to this shot)", under(c.simulated)),
                ("measured − simulated", thin(c.residual)),
                ("noise, ±2 standard deviations", c.band),
            ]
        self._legend.show_entries(entries)

    def show_shot(self, shot: Shot | None, recording: Recording | None = None) -> None:
        """Show this shot; None shows what to do to get one."""
        self._shot = shot
        self.raw.show_recording(recording, 0.0 if shot is None else time_zero(shot)[0])
        if shot is None or shot.motion is None:
            if shot is None:
                text = "No shot yet. Press ARM (space), then push the block through the light switch."
            else:
                why = shot.problem or ""
                text = f"{shot.name} could not be analysed.\n\n{why}\n\nIts raw samples are kept: Raw signals (5)."
            self._empty.setText(text)
            self.set_view(self._view)
            return
        zero, words = time_zero(shot)
        for stack in self.stacks:
            stack.label_time(words)
        motion = shot.motion
        start, step = 1e3 * (float(motion.time_s[0]) - zero), 1e3 / motion.sample_rate_hz
        self._measured[0].show_samples(start, step, motion.velocity_m_per_s)
        self._measured[1].show_samples(start, step, motion.force_n)
        overlay = shot.fit.shots[0].overlay if shot.fit is not None and shot.fit.shots else None
        if overlay is not None:
            begin = 1e3 * (float(overlay.time_s[0]) - zero)
            self._simulated[0].show_samples(begin, step, overlay.velocity_m_per_s)
            self._simulated[1].show_samples(begin, step, overlay.force_n)
        else:
            for curve in self._simulated:
                curve.clear_samples()
        self._show_residual(motion, start, step)
        self._mark_events(zero)
        self._undrawn = {"deflection", "gap"}
        self.set_view(self._view)
        self.reset()

    def _show_residual(self, motion: Motion, start: float, step: float) -> None:
        kind, _, unit, scale = RESIDUALS[self._residual_kind.currentIndex()]
        self.residual.unit = unit
        self.residual.setLabel("left", f"residual ({unit})")
        fit = self._shot.fit if self._shot is not None else None
        if fit is None or not fit.shots:
            self._residual.clear_samples()
            self._band.show_band(0.0, 1.0, np.empty(0))
            return
        overlay = fit.shots[0].overlay
        if kind == "displacement":
            rest, std = fit.shots[0].residual_m, motion.displacement_std_m
        elif kind == "velocity":
            rest, std = motion.velocity_m_per_s - overlay.velocity_m_per_s, motion.velocity_std_m_per_s
        else:
            rest, std = motion.force_n - overlay.force_n, motion.force_std_n
        self._residual.show_samples(start, step, scale * rest)
        self._band.show_band(start, step, 2 * scale * std)
        self.residual.free_y()

    def _mark_events(self, zero: float) -> None:
        impact = self._shot.impact if self._shot is not None else None
        times: list[float] = []
        if impact is not None:
            for reading in (impact.touch_time_s, impact.release_time_s):
                if isinstance(reading, Quantity):
                    times.append(1e3 * (reading.value - zero))
        for plot in self.stack.plots:
            plot.mark(times, self._colours.marker)

    @Slot(object)
    def _view_pressed(self, button: QPushButton) -> None:
        self.set_view(str(button.property("view")))
        self.reset()

    def set_view(self, view: str) -> None:
        """Show one of ``VIEWS``."""
        self._view = view
        self._buttons[view].setChecked(True)
        pages: dict[str, QWidget] = {
            "deflection": self.deflection, "gap": self.gap.stack, "raw": self.raw.stack,
        }  # fmt: skip
        analysed = self._shot is not None and self._shot.motion is not None
        page = pages.get(view, self.stack) if analysed or (view == "raw" and self.raw.has_samples) else self._empty
        self._pages.setCurrentWidget(page)
        self._residual_kind.setVisible(page is self.stack)
        self._legend.setVisible(page is not self._empty)
        self._draw(view)
        self._cursor_button.setEnabled(isinstance(page, TimeStack))
        stack = self.current_stack()
        for readout, owner in zip(self._readouts, self.stacks, strict=True):
            readout.setVisible(owner is stack and owner.cursors.shown)
        self._cursor_button.setChecked(stack is not None and stack.cursors.shown)
        self._label_lines()
        self.view_changed.emit(view)

    def _draw(self, view: str) -> None:
        """Draw what only this view shows, when it is looked at."""
        if view == "raw" and self.raw.wanted is not None:
            self.raw_wanted.emit(self.raw.wanted)
        if self._shot is None or self._shot.motion is None or view not in self._undrawn:
            return
        self._undrawn.discard(view)
        if view == "deflection":
            self.deflection.show_shot(self._shot)
        else:
            motion, zero = self._shot.motion, time_zero(self._shot)[0]
            self.gap.show_shot(self._shot, 1e3 * (float(motion.time_s[0]) - zero), 1e3 / motion.sample_rate_hz)

    @Slot()
    def reset(self) -> None:
        """Bring the view back to what its name says."""
        shot = self._shot
        if self._view == "raw":
            self.raw.reset()
        if shot is None or shot.motion is None:
            return
        zero, _ = time_zero(shot)
        left, right = 1e3 * (shot.motion.time_s[0] - zero), 1e3 * (shot.motion.time_s[-1] - zero)
        if self._view == "contact":
            self.stack.zoom(*contact_span_ms(shot))
        elif self._view == "whole":
            self.stack.zoom(left, right)
        elif self._view == "gap":
            self.gap.reset()
        elif self._view == "deflection":
            self.deflection.reset()

    @Slot(int)
    def _residual_changed(self, _: int) -> None:
        if self._shot is not None and self._shot.motion is not None:
            motion = self._shot.motion
            zero, _ = time_zero(self._shot)
            self._show_residual(motion, 1e3 * (float(motion.time_s[0]) - zero), 1e3 / motion.sample_rate_hz)

    @Slot(float)
    def _zoom_on_bounce(self, at_ms: float) -> None:
        """Zoom every linked plot to the bounce that was clicked on; elsewhere a click does nothing."""
        if self._shot is None or self._shot.impact is None:
            return
        zero, _ = time_zero(self._shot)
        left, right = self.stack.span
        reach = 0.02 * (right - left)
        peaks = [1e3 * (t - zero) for t in self._shot.impact.bounce_peaks_s]
        near = [t for t in peaks if abs(t - at_ms) < reach]
        if near:
            self.stack.zoom(near[0] - 0.6, near[0] + 0.6)

    @Slot(bool)
    def show_cursors(self, shown: bool) -> None:
        """Show or hide the cursors of the view in front."""
        stack = self.current_stack()
        if stack is not None and stack.cursors.shown != shown:
            stack.show_cursors(shown)

    @Slot()
    def toggle_cursors(self) -> None:
        """Turn the cursors on or off."""
        if self._cursor_button.isEnabled():
            self._cursor_button.toggle()

    @Slot()
    def copy_cursors(self) -> None:
        """Copy what lies between the cursors in front."""
        stack = self.current_stack()
        for readout, owner in zip(self._readouts, self.stacks, strict=True):
            if owner is stack and owner.cursors.shown:
                readout.copy()

    @Slot()
    def open_menu(self) -> None:
        """Open the menu of the plot in front."""
        page = self._pages.currentWidget()
        if isinstance(page, TimeStack | DeflectionView):
            page.open_menu()

    @Slot(str)
    def _export(self, kind: str) -> None:
        self.export_wanted.emit(self._pages.currentWidget(), kind)
