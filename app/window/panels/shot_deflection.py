"""Force against deflection of the plate (the paper's Fig. 6): measured, simulated, and the slope."""

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from analysis.shot import Quantity, Shot
from app.window.pens import thin, under
from app.window.plots.crisp import CrispCurve
from app.window.plots.cursors import CursorAxis
from app.window.plots.plain_plot import PlainPlot, XyCurve
from app.window.plots.plot_notes import NoteAxes
from app.window.theme import Colours

Floats = NDArray[np.float64]
DEFLECTION = CursorAxis("mm", "m", 1e-3)
BRANCHES = ("loading", "unloading")


class DeflectionView(PlainPlot):
    """Force in N against deflection in mm from first touch, positive into the plate.

    Loading and unloading are separate curves, so that the cursors give the slope of each.
    """

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        words = "deflection of the plate from first touch (mm)"
        super().__init__("Force against deflection", ("force", "N"), words, DEFLECTION, parent)
        self._simulated = [self.add_curve(f"simulated, {branch}") for branch in BRANCHES]
        self._measured = [self.add_curve(f"measured, {branch}") for branch in BRANCHES]
        self._slope = CrispCurve()
        self.plot.addItem(self._slope)
        self.dress(colours)

    def dress(self, colours: Colours) -> None:
        super().dress(colours)
        for curve in self._measured:
            curve.setPen(thin(colours.measured))
        for curve in self._simulated:
            curve.setPen(under(colours.simulated))
        self._slope.setPen(thin(colours.residual, Qt.PenStyle.DashLine))

    def show_shot(self, shot: Shot) -> None:
        """Show the contact of this shot."""
        for curve in (*self._measured, *self._simulated):
            curve.show_points(np.empty(0), np.empty(0))
        self._slope.setData(np.empty(0), np.empty(0))
        self.columns = {}
        motion, impact = shot.motion, shot.impact
        if motion is None or impact is None or not isinstance(impact.touch_time_s, Quantity):
            return
        touch = impact.touch_time_s.value
        release = impact.release_time_s.value if isinstance(impact.release_time_s, Quantity) else touch + 0.03
        chosen = (motion.time_s > touch - 1e-3) & (motion.time_s < release + 1e-3)
        if not np.any(chosen):
            return
        at_touch = np.interp(touch, motion.time_s, motion.displacement_m)
        deflection = 1e3 * (at_touch - motion.displacement_m[chosen])
        force = motion.force_n[chosen]
        self.notes.describe(self.plot, NoteAxes("force vs deflection", 0.0, 1e3))
        _show_branches(self._measured, deflection, force)
        self.columns = {"deflection_mm": deflection, "force_n": force}
        if shot.fit is not None and shot.fit.shots:
            overlay = shot.fit.shots[0].overlay
            model = 1e3 * (at_touch - overlay.displacement_m[chosen])
            _show_branches(self._simulated, model, overlay.force_n[chosen])
            self.columns |= {"deflection_simulated_mm": model, "force_simulated_n": overlay.force_n[chosen]}
        self._draw_slope(impact.stiffness_slope_n_per_m, deflection, force)
        finite = np.isfinite(deflection) & np.isfinite(force)
        if finite.any():
            x, y = deflection[finite], force[finite]
            spare_x, spare_y = 0.05 * np.ptp(x) + 1e-6, 0.08 * np.ptp(y) + 1e-6
            self.show_range((x.min() - spare_x, x.max() + spare_x), (y.min() - spare_y, y.max() + spare_y))

    def _draw_slope(self, slope: object, deflection: Floats, force: Floats) -> None:
        if not isinstance(slope, Quantity) or not math.isfinite(slope.value):
            return
        deep = deflection > 0.5 * np.nanmax(deflection)
        middle_x, middle_y = float(np.nanmean(deflection[deep])), float(np.nanmean(force[deep]))
        ends = np.array([0.0, float(np.nanmax(deflection))])
        self._slope.setData(ends, middle_y + 1e-3 * slope.value * (ends - middle_x))


def _show_branches(curves: list[XyCurve], deflection: Floats, force: Floats) -> None:
    """Split the contact into loading and unloading at the greatest deflection."""
    if not np.isfinite(deflection).any():
        return
    turn = int(np.nanargmax(deflection))
    curves[0].show_points(deflection[: turn + 1], force[: turn + 1])
    curves[1].show_points(deflection[turn:], force[turn:])
