"""Plots of a shot, measured and simulated: velocity, force and residual over time; gap; force against deflection."""

import numpy as np
from PySide6.QtCore import QObject, Qt, Slot
from PySide6.QtWidgets import QWidget

from analysis.diagnosis import Diagnosis
from analysis.shot import Fit, Floats, Motion, Overlay, Quantity, Shot
from analysis.uncertainty import NoiseBand, verdict_band
from app.report import contact_span_ms, deflection_of, grid_ms, time_zero
from app.window.controls.widgets import combo_box
from app.window.plots.cursors import DISTANCE
from app.window.plots.curve import PointCurve, SampledCurve
from app.window.plots.lines import MEASURED, RESIDUAL, SIMULATED, CrispCurve, LineStyle
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.plot_notes import NoteAxes
from app.window.plots.time_plot import TimeStack
from app.words import prefix_for

RESIDUALS = (
    ("force", "Residual of force", "N"),
    ("velocity", "Residual of velocity", "m/s"),
    ("displacement", "Residual of displacement", "m"),
)
MIN_SIGNIFICANT_RATIO = (
    2.0  # least significant rms of a residual over its band; slow site vibration alone reaches up to 2
)
BOUNCE_MS = 0.6  # time shown on each side of a clicked bounce


class MotionView(QObject):
    """Velocity, force and a selectable residual over the whole shot or the first contact."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._shot: Shot | None = None
        self._judged_by: Diagnosis | None = None
        self._chosen = False  # whether the operator has selected the residual
        self.band_words = ""
        self.stack = TimeStack("Velocity, force and residual over time", parent)
        self.velocity = self.stack.add_plot("velocity", "m/s", 3)
        self.force = self.stack.add_plot("force", "N", 4)
        self.residual = self.stack.add_plot("residual", "mN", 2)
        both = (self.velocity, self.force)
        self._simulated = [plot.add_curve("simulated", SIMULATED) for plot in both]
        self._measured = [plot.add_curve("measured", MEASURED) for plot in both]
        self._band = self.residual.add_band()
        self._residual = self.residual.add_curve("measured − simulated", RESIDUAL)
        hover = "Slow effects are clearest in displacement, where the optical noise is white; fast effects in force"
        items = [(words, name) for name, words, _ in RESIDUALS]
        self.kind = combo_box("Which residual the lowest plot shows", hover, parent, items)
        self.kind.currentIndexChanged.connect(self._show_residual)
        self.kind.activated.connect(self._kind_chosen)
        for plot in self.stack.plots:
            plot.view.clicked.connect(self._zoom_on_bounce)

    def show_shot(self, shot: Shot, band_from: Diagnosis | None = None) -> None:
        """Show an analysed shot, with the noise band of the diagnosis ``band_from`` if given."""
        self._shot, self._judged_by = shot, band_from
        zero, _ = time_zero(shot)
        self.stack.notes.describe(self.velocity, NoteAxes("velocity", zero, 1e3))
        self.stack.notes.describe(self.force, NoteAxes("force", zero, 1e3))
        for curves, source in ((self._measured, shot.motion), (self._simulated, _overlay_of(shot))):
            _show(curves[0], shot, source, "velocity_m_per_s")
            _show(curves[1], shot, source, "force_n")
        if not self._chosen:
            self._choose_residual()
        self._show_residual()
        self._mark_events(zero)

    def choose(self, contact_only: bool) -> None:
        """Set the time range to which the plots reset: the first contact or the whole shot."""
        shot = self._shot
        if shot is not None and shot.motion is not None:
            begin_s, end_s = shot.motion.time_s[[0, -1]] - time_zero(shot)[0]
            self.stack.whole = contact_span_ms(shot) if contact_only else (1e3 * begin_s, 1e3 * end_s)

    @Slot()
    def _show_residual(self) -> None:
        shot = self._shot
        if shot is None or shot.motion is None:
            return
        motion, fit = shot.motion, shot.fit
        kind, _, unit = RESIDUALS[self.kind.currentIndex()]
        if fit is None or not fit.shots:
            self.band_words = ""
            self._residual.clear_samples()
            self._band.show_band(0.0, 1.0, np.empty(0))
            self.residual.name_value("residual", unit)  # removes the previous shot's unit and scale
            self.residual.view.setYRange(-1.0, 1.0, padding=0)
            return
        band, self.band_words = verdict_band(shot, self._judged_by)
        rest, std = _residual_of(motion, fit, kind, band)
        zero, _ = time_zero(shot)
        start, step = grid_ms(shot)
        scale, words = prefix_for(float(np.nanmax(np.abs(rest), initial=0.0)), unit)
        self.residual.name_value("residual", words)
        self.stack.notes.describe(self.residual, NoteAxes(f"residual of {kind}", zero, 1e3, scale))
        self._residual.show_samples(start, step, scale * rest)
        self._band.show_band(start, step, 2 * scale * std)
        self.residual.free_y()

    def _choose_residual(self) -> None:
        """Select the residual that exceeds its band most; if none is significant, that of the force."""
        shot = self._shot
        if shot is None or shot.motion is None or shot.fit is None or not shot.fit.shots:
            return
        band, _ = verdict_band(shot, self._judged_by)
        sizes = [_size(*_residual_of(shot.motion, shot.fit, kind, band)) for kind, _, _ in RESIDUALS]
        chosen = int(np.argmax(sizes)) if max(sizes) > MIN_SIGNIFICANT_RATIO else 0
        self.kind.blockSignals(True)
        self.kind.setCurrentIndex(chosen)
        self.kind.blockSignals(False)

    def _mark_events(self, zero: float) -> None:
        impact = self._shot.impact if self._shot is not None else None
        times: list[float] = []
        if impact is not None:
            for reading in (impact.touch_time_s, impact.release_time_s):
                if isinstance(reading, Quantity):
                    times.append(1e3 * (reading.value - zero))
        for plot in self.stack.plots:
            plot.mark(times)

    @Slot(int)
    def _kind_chosen(self, _: int) -> None:
        self._chosen = True

    @Slot(float)
    def _zoom_on_bounce(self, at_ms: float) -> None:
        """Zoom to the clicked bounce."""
        if self._shot is None or self._shot.impact is None:
            return
        zero, _ = time_zero(self._shot)
        left, right = self.stack.span
        reach = 0.02 * (right - left)
        peaks = [1e3 * (t - zero) for t in self._shot.impact.bounce_peaks_s]
        near = [t for t in peaks if abs(t - at_ms) < reach]
        if near:
            self.stack.zoom(near[0] - BOUNCE_MS, near[0] + BOUNCE_MS)


def _residual_of(motion: Motion, fit: Fit, kind: str, band: NoiseBand) -> tuple[Floats, Floats]:
    """Return the residual of displacement, velocity or force, and the standard deviation of its band, each (n,)."""
    overlay = fit.shots[0].overlay
    if kind == "displacement":
        return fit.shots[0].residual_m, band.displacement_m
    if kind == "velocity":
        return motion.velocity_m_per_s - overlay.velocity_m_per_s, band.velocity_m_per_s
    return motion.force_n - overlay.force_n, band.force_n


def _size(rest: Floats, std: Floats) -> float:
    """Return the rms of a residual divided by its band's standard deviation."""
    seen = np.isfinite(rest) & np.isfinite(std) & (std > 0.0)
    return float(np.sqrt(np.mean((rest[seen] / std[seen]) ** 2))) if seen.any() else 0.0


def _overlay_of(shot: Shot) -> Overlay | None:
    return shot.fit.shots[0].overlay if shot.fit is not None and shot.fit.shots else None


def _show(curve: SampledCurve, shot: Shot, source: Motion | Overlay | None, quantity: str) -> None:
    """Show a quantity of a shot's motion or of its fitted model, at the same times; clear it without a source."""
    if source is None:
        curve.clear_samples()
    else:
        curve.show_samples(*grid_ms(shot), getattr(source, quantity))


class GapView:
    """The gap between block and plate (the paper's Fig. 7), which only the fitted model gives, and the force below."""

    def __init__(self, parent: QWidget) -> None:
        self.stack = TimeStack("Gap between block and plate", parent)
        self._gap_plot = self.stack.add_plot("gap", "µm", 3)
        self._force_plot = self.stack.add_plot("force", "N", 2)
        self._gap = self._gap_plot.add_curve("simulated", SIMULATED)
        self._simulated = self._force_plot.add_curve("simulated", SIMULATED)
        self._measured = self._force_plot.add_curve("measured", MEASURED)
        self._gap_plot.mark_level(0.0, "below: overlap")

    def show_shot(self, shot: Shot) -> None:
        """Show an analysed shot."""
        zero, _ = time_zero(shot)
        self.stack.notes.describe(self._gap_plot, NoteAxes("gap", zero, 1e3, 1e6))
        self.stack.notes.describe(self._force_plot, NoteAxes("force", zero, 1e3))
        overlay = _overlay_of(shot)
        _show(self._measured, shot, shot.motion, "force_n")
        _show(self._simulated, shot, overlay, "force_n")
        self._gap.show_samples(*grid_ms(shot), np.empty(0) if overlay is None else 1e6 * np.asarray(overlay.gap_m))
        self.stack.whole = contact_span_ms(shot)


BRANCHES = ("loading", "unloading")
SLOPE = LineStyle("residual", Qt.PenStyle.DashLine)


class DeflectionView(PlainPlot):
    """Plot of force in N against deflection in mm from first touch, positive into the plate.

    Loading and unloading are separate curves, so that the cursors read the slope of each.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        words = "deflection of the plate from first touch"
        super().__init__("Force against deflection", ("force", "N"), words, DISTANCE, parent)
        self._simulated = [self.add_curve(f"simulated, {branch}", SIMULATED) for branch in BRANCHES]
        self._measured = [self.add_curve(f"measured, {branch}", MEASURED) for branch in BRANCHES]
        self._slope = CrispCurve(look=SLOPE)
        self.plot.addItem(self._slope)

    def show_shot(self, shot: Shot) -> None:
        for curve in (*self._measured, *self._simulated):
            curve.clear_samples()
        self._slope.setData(np.empty(0), np.empty(0))
        self.columns = {}
        found = deflection_of(shot, _overlay_of(shot))
        if found is None:
            return
        self.notes.describe(self.plot, NoteAxes("force vs deflection", 0.0, 1e3))
        _show_branches(self._measured, *found.measured)
        deflection, force = found.measured
        self.columns = {"deflection_mm": deflection, "force_n": force}
        if found.simulated is not None:
            _show_branches(self._simulated, *found.simulated)
            self.columns |= dict(zip(("deflection_simulated_mm", "force_simulated_n"), found.simulated, strict=True))
        if found.slope is not None:
            self._slope.setData(*found.slope)
        finite = np.isfinite(deflection) & np.isfinite(force)
        if finite.any():
            x, y = deflection[finite], force[finite]
            spare_x, spare_y = 0.05 * np.ptp(x) + 1e-6, 0.08 * np.ptp(y) + 1e-6
            self.show_range((x.min() - spare_x, x.max() + spare_x), (y.min() - spare_y, y.max() + spare_y))


def _show_branches(curves: list[PointCurve], deflection: Floats, force: Floats) -> None:
    """Show loading and unloading, split at the greatest deflection, as two curves."""
    if not np.isfinite(deflection).any():
        return
    turn = int(np.nanargmax(deflection))
    curves[0].show_points(deflection[: turn + 1], force[: turn + 1])
    curves[1].show_points(deflection[turn:], force[turn:])
