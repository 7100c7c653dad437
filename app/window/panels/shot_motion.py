"""Velocity, force and residual of a shot over time, measured and simulated over one another."""

import numpy as np
from PySide6.QtCore import QObject, Slot
from PySide6.QtWidgets import QComboBox, QWidget

from analysis.motion import Motion
from analysis.noise_band import band_of
from analysis.quantity import Quantity
from analysis.shot import Shot
from app.report.shot_times import contact_span_ms, time_zero
from app.window.pens import thin, under
from app.window.plots.time_stack import TimeStack
from app.window.theme import Colours
from app.words.prefixes import prefix_for

RESIDUALS = (
    ("force", "Residual of force", "N"),
    ("velocity", "Residual of velocity", "m/s"),
    ("displacement", "Residual of displacement", "m"),
)
BOUNCE_MS = 0.6  # on either side of a bounce that was clicked on


class MotionView(QObject):
    """The whole shot or its first contact, and the choice of what its lowest plot leaves over."""

    def __init__(self, colours: Colours, parent: QWidget) -> None:
        super().__init__(parent)
        self._colours = colours
        self._shot: Shot | None = None
        self.contact_only = False
        self.stack = TimeStack("Velocity, force and residual over time", colours, parent)
        self.velocity = self.stack.add_plot("velocity", "m/s", 3)
        self.force = self.stack.add_plot("force", "N", 4)
        self.residual = self.stack.add_plot("residual", "mN", 2)
        both = (self.velocity, self.force)
        self._simulated = [plot.add_curve("simulated", under(colours.simulated)) for plot in both]
        self._measured = [plot.add_curve("measured", thin(colours.measured)) for plot in both]
        self._band = self.residual.add_band(colours.band, colours.band_edge)
        self._residual = self.residual.add_curve("measured − simulated", thin(colours.residual))
        self.kind = QComboBox(parent)
        self.kind.setAccessibleName("Which residual the lowest plot shows")
        self.kind.setToolTip("Slow effects show in displacement, where the optics' noise is white; fast ones in force")
        for _, words, _ in RESIDUALS:
            self.kind.addItem(words)
        self.kind.currentIndexChanged.connect(self._kind_changed)
        self.stack.clicked.connect(self._zoom_on_bounce)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self._colours = colours
        self.stack.dress(colours)
        for curve in self._measured:
            curve.setPen(thin(colours.measured))
        for curve in self._simulated:
            curve.setPen(under(colours.simulated))
        self._residual.setPen(thin(colours.residual))

    def show_shot(self, shot: Shot) -> None:
        """Show an analysed shot."""
        self._shot = shot
        motion = shot.motion
        assert motion is not None
        zero, _ = time_zero(shot)
        start, step = _grid(motion, zero)
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
        self._show_residual()
        self._mark_events(zero)

    def reset(self) -> None:
        """Show the whole shot, or its first contact."""
        shot = self._shot
        if shot is None or shot.motion is None:
            return
        if self.contact_only:
            self.stack.zoom(*contact_span_ms(shot))
        else:
            zero, _ = time_zero(shot)
            self.stack.zoom(1e3 * (shot.motion.time_s[0] - zero), 1e3 * (shot.motion.time_s[-1] - zero))

    def _show_residual(self) -> None:
        shot = self._shot
        if shot is None or shot.motion is None:
            return
        motion, fit = shot.motion, shot.fit
        kind, _, unit = RESIDUALS[self.kind.currentIndex()]
        if fit is None or not fit.shots:
            self._residual.clear_samples()
            self._band.show_band(0.0, 1.0, np.empty(0))
            return
        overlay, band = fit.shots[0].overlay, band_of(shot)
        if kind == "displacement":
            rest, std = fit.shots[0].residual_m, band.displacement_m
        elif kind == "velocity":
            rest, std = motion.velocity_m_per_s - overlay.velocity_m_per_s, band.velocity_m_per_s
        else:
            rest, std = motion.force_n - overlay.force_n, band.force_n
        start, step = _grid(motion, time_zero(shot)[0])
        scale, words = prefix_for(float(np.nanmax(np.abs(rest), initial=0.0)), unit)
        self.residual.count_in(words)
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

    @Slot(int)
    def _kind_changed(self, _: int) -> None:
        self._show_residual()

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
            self.stack.zoom(near[0] - BOUNCE_MS, near[0] + BOUNCE_MS)


def _grid(motion: Motion, zero: float) -> tuple[float, float]:
    """Return time of the first sample and step, both in ms."""
    return 1e3 * (float(motion.time_s[0]) - zero), 1e3 / motion.sample_rate_hz
