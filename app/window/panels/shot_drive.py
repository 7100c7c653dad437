"""Views of a drive: measured and modelled force and their residual, against time, speed and position."""

from dataclasses import replace

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSplitter, QWidget

from analysis.drive import DriveCurves
from analysis.shot import Floats
from analysis.uncertainty import with_unit
from app.window.controls.widgets import text_label
from app.window.plots.cursors import DISTANCE, SECONDS, SPEED, CursorAxis
from app.window.plots.lines import BAND, MEASURED, RESIDUAL, SIMULATED, LineStyle
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.plot_notes import NoteAxes
from app.window.plots.plot_view import PlotView
from app.window.plots.time_plot import TimeStack
from app.words import DASH, number, repeatability_words

NOTHING: Floats = np.empty(0)


class DriveView:
    """Three pages, against time, speed and position, by the names of the SHOT page's views."""

    def __init__(self, parent: QWidget) -> None:
        self.curves: DriveCurves | None = None  # None: nothing is drawn
        self.stack = TimeStack("Velocity, force and residual of a drive over time", parent, SECONDS)
        velocity = self.stack.add_plot("velocity", "m/s", 3)
        force = self.stack.add_plot("force", "N", 4)
        residual = self.stack.add_plot("residual", "N", 3)
        self._note_axes = {velocity: NoteAxes("velocity"), force: NoteAxes("force")}
        self._note_axes[residual] = NoteAxes("residual of force")
        self._velocity = velocity.add_points("measured", MEASURED)
        self._modelled = force.add_points("modelled", SIMULATED)
        self._measured = force.add_points("measured", MEASURED)
        self._band = residual.add_band()
        self._residual = residual.add_points("measured − modelled", RESIDUAL)
        self.stack.label_time("time from the first sample")
        self.speed = ForceAgainst("speed", "velocity", SPEED, parent)
        self.place = ForceAgainst("position", "position along the guide", DISTANCE, parent)
        self.pages: dict[str, QWidget] = {"whole": self.stack, "contact": self.speed, "deflection": self.place}
        self.plots: tuple[PlotView, ...] = (self.stack, *self.speed.plots, *self.place.plots)
        self.say = text_label("", parent, faint=True, selectable=True, wrap=True)

    def legend(self) -> list[tuple[str, LineStyle]]:
        below = "band"
        if self.curves is not None:
            below = f"±2 × {repeatability_words(self.curves.repeatability)}"
        return [
            ("measured", MEASURED),
            ("modelled (fitted to this record)", SIMULATED),
            ("measured − modelled", RESIDUAL),
            (below, BAND),
        ]

    def show_curves(self, curves: DriveCurves | None) -> None:
        self.curves = curves
        if curves is None:
            for curve in (self._velocity, self._measured, self._modelled, self._residual):
                curve.clear_samples()
            self._band.show_band(0.0, 1.0, NOTHING)
            for page in (self.speed, self.place):
                page.show_force(NOTHING, NOTHING, NOTHING, 0.0)
            return
        for plot, axes in self._note_axes.items():
            self.stack.notes.describe(plot, axes)
        time, half = curves.time_s, 2.0 * curves.repeatability.force_n
        self.stack.show_whole(float(time[0]), float(time[-1]))
        self._velocity.show_points(time, curves.velocity_m_per_s)
        self._measured.show_points(time, curves.measured_n)
        self._modelled.show_points(time, curves.modelled_n)
        self._residual.show_points(time, curves.residual_n)
        self._band.show_band(float(time[0]), float(time[-1] - time[0]), np.full(2, half))
        self.speed.show_force(curves.velocity_m_per_s, curves.measured_n, curves.modelled_n, half)
        self.place.show_force(1e3 * curves.displacement_m, curves.measured_n, curves.modelled_n, half)
        rms = float(np.sqrt(np.nanmean(curves.residual_n**2)))
        times = number(rms / curves.repeatability.force_n, 2) if curves.repeatability.force_n > 0.0 else DASH
        against = repeatability_words(curves.repeatability)
        self.say.setText(
            f"residual {number(rms, 3)} N rms, {times} times {against} "
            f"({number(curves.repeatability.force_n, 2)} N under this shot's own fit); "
            f"compared up to {number(curves.bandwidth_hz, 3)} Hz"
        )


class ForceAgainst(QSplitter):
    """Plots of force (above) and residual (below) against speed or position."""

    def __init__(self, what: str, bottom: str, axis: CursorAxis, parent: QWidget) -> None:
        super().__init__(Qt.Orientation.Vertical, parent)
        self._bottom = with_unit(bottom, axis.unit)
        self._note_axes = NoteAxes(f"force vs {what}", 0.0, 1.0 / axis.scale)
        self._force = PlainPlot(f"Force against {what}", ("force", "N"), bottom, axis, self)
        self._residual_plot = PlainPlot(f"Residual of force against {what}", ("residual", "N"), bottom, axis, self)
        self.plots = (self._force, self._residual_plot)
        self._modelled = self._force.add_curve("modelled", SIMULATED)
        self._measured = self._force.add_curve("measured", MEASURED)
        self._band = self._residual_plot.plot.add_band()
        self._residual = self._residual_plot.add_curve("measured − modelled", RESIDUAL)
        self._residual_plot.plot.view.setXLink(self._force.plot.view)
        self._force.plot.hide_bottom_values()
        self.setSizes([300, 200])
        self.setChildrenCollapsible(False)

    def show_force(self, x: Floats, measured_n: Floats, modelled_n: Floats, half_n: float) -> None:
        """Show forces (n,) at x (n,), with NaN between separate curves, and a band of half width ``half_n``."""
        rest = measured_n - modelled_n
        self._measured.show_points(x, measured_n)
        self._modelled.show_points(x, modelled_n)
        self._residual.show_points(x, rest)
        self._force.columns = {self._bottom: x, "measured (N)": measured_n, "modelled (N)": modelled_n}
        self._residual_plot.columns = {self._bottom: x, "residual (N)": rest}
        if not np.isfinite(x).any():
            self._band.show_band(0.0, 1.0, NOTHING)
            return
        left, right = float(np.nanmin(x)), float(np.nanmax(x))
        spare = 0.04 * (right - left) + 1e-12
        span = (left - spare, right + spare)
        self._force.notes.describe(self._force.plot, self._note_axes)
        below = replace(self._note_axes, plot=f"residual of {self._note_axes.plot}")
        self._residual_plot.notes.describe(self._residual_plot.plot, below)
        self._band.show_band(span[0], span[1] - span[0], np.full(2, half_n))
        both = np.concatenate([measured_n, modelled_n])
        for plot, values in ((self._force, both), (self._residual_plot, np.append(rest, (half_n, -half_n)))):
            low, high = float(np.nanmin(values)), float(np.nanmax(values))
            room = 0.06 * (high - low) + 1e-12
            plot.show_range(span, (low - room, high + room))
