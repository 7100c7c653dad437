"""Plots of one shot's residual before and after a diagnosis, and the table of errors."""

import math
from collections.abc import Sequence

import numpy as np
from PySide6.QtWidgets import QWidget

from analysis.diagnosis import Diagnosis
from analysis.drive import DriveCurves
from analysis.shot import Shot
from analysis.uncertainty import diagnosed_band
from app.report import grid_ms, time_zero
from app.window.plots.cursors import SECONDS, CursorReadout
from app.window.plots.lines import RESIDUAL
from app.window.plots.time_plot import TimeStack
from app.window.widgets import text_label, vertical
from app.words import Markup, lines, number, prefix_for, repeatability_words, short_name, tag
from levimass import is_drive


class Residuals(QWidget):
    """Two linked residual plots with the band of noise and floor vibration, and the table of errors."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        column = vertical(self, (6, 0, 0, 0))
        self._heading = text_label("RESIDUAL OF DISPLACEMENT", self, heading=True, wrap=True)
        column.addWidget(self._heading)
        self.stack = TimeStack("Residual before and after", self)
        self._plots = [self.stack.add_plot(name, "nm", 1) for name in ("before", "after")]
        self._bands = [plot.add_band() for plot in self._plots]
        self._curves = [plot.add_curve("residual", RESIDUAL) for plot in self._plots]
        self.stack.setMinimumHeight(8 * self.fontMetrics().lineSpacing())
        self.stack.label_time("time from first touch (ms)")
        column.addWidget(self.stack, 1)
        column.addWidget(CursorReadout(self.stack, self))
        self.forces = ForceResiduals(self)
        column.addWidget(self.forces.stack, 1)
        column.addWidget(CursorReadout(self.forces.stack, self))
        self._errors = text_label("", self, selectable=True)
        self._errors.setToolTip(
            "Rms residuals over the same samples at the same bandwidth.\nJoint χ²/ν: of all shots fitted together, "
            "against the noise that the diagnosis found; the panel MODEL shows that of one shot's own fit."
        )
        column.addWidget(self._errors)

    @property
    def stack_in_view(self) -> TimeStack:
        """Get the visible plots."""
        return self.forces.stack if self.forces.stack.isVisibleTo(self) else self.stack

    def clear(self) -> None:
        self._errors.setText("")
        self._forget()

    def _forget(self) -> None:
        """Clear the plots of the previous diagnosis."""
        for curve, band in zip(self._curves, self._bands, strict=True):
            curve.clear_samples()
            band.show_band(0.0, 1.0, np.zeros(0))
        self.stack.set_shots((), "")
        self.forces.show_curves(None, None, None)

    def show_forces(self, shot: Shot, before: DriveCurves, after: DriveCurves) -> None:
        """Show a drive's force residual under the fits before and after the diagnosis."""
        against = repeatability_words(after.repeatability.repeats, after.repeatability.what)
        self._heading.setText(f"RESIDUAL OF FORCE, {short_name(shot.name)} (band: ±2 × {against})")
        self.forces.show_curves(shot, before, after)

    def show_diagnosis(self, diagnosis: Diagnosis, shots: list[Shot]) -> None:
        """Show the residual of the first analysed shot, and the errors of all shots."""
        self._errors.setText(_errors_table(diagnosis))
        shot = next((shot for shot in shots if shot.motion is not None), None)  # also the first in the fits
        driven = is_drive(diagnosis.fit_after.model)
        self.stack.setVisible(not driven)
        self.forces.stack.setVisible(driven)
        if driven or shot is None or not diagnosis.fit_after.shots:
            self._heading.setText("RESIDUAL OF FORCE" if driven else "")
            self._forget()
            return
        self.forces.show_curves(None, None, None)
        motion = shot.motion
        assert motion is not None
        self.stack.set_shots((shot,), shot.name)
        self.stack.label_time(time_zero(shot)[1])
        noise_m, what = diagnosed_band(diagnosis, shot)
        self._heading.setText(f"RESIDUAL OF DISPLACEMENT, {short_name(shot.name)} (band: {what}, ±2 σ)")
        start, step = grid_ms(shot)
        fits = (diagnosis.fit_before, diagnosis.fit_after)
        for fit, plot, curve, band in zip(fits, self._plots, self._curves, self._bands, strict=True):
            if fit.shots:
                left = np.asarray(fit.shots[0].residual_m)
                factor, unit = prefix_for(float(np.nanmax(np.abs(left), initial=0.0)), "m")
                plot.name_value(plot.title, unit)
                curve.show_samples(start, step, factor * left)
                band.show_band(start, step, 2.0 * factor * noise_m)
        self.stack.show_whole(start, start + step * motion.time_s.size)


class ForceResiduals:
    """Two linked plots of a drive's force residual over the whole record, before and after the diagnosis."""

    def __init__(self, parent: QWidget) -> None:
        self.stack = TimeStack("Residual of force before and after", parent, SECONDS)
        self._plots = [self.stack.add_plot(name, "N", 1) for name in ("before", "after")]
        self._bands = [plot.add_band() for plot in self._plots]
        self._curves = [plot.add_points("measured − modelled", RESIDUAL) for plot in self._plots]
        self.stack.setMinimumHeight(8 * parent.fontMetrics().lineSpacing())
        self.stack.label_time("time from the first sample (s)")
        self.stack.hide()

    def show_curves(self, shot: Shot | None, before: DriveCurves | None, after: DriveCurves | None) -> None:
        self.stack.set_shots((shot,) if shot is not None else (), shot.name if shot is not None else "")
        for found, plot, curve, band in zip((before, after), self._plots, self._curves, self._bands, strict=True):
            if found is None:
                curve.show_points(np.zeros(0), np.zeros(0))
                band.show_band(0.0, 1.0, np.zeros(0))
                continue
            begin, end = float(found.time_s[0]), float(found.time_s[-1])
            factor, unit = prefix_for(float(np.nanmax(np.abs(found.residual_n), initial=0.0)), "N")
            plot.name_value(plot.title, unit)
            curve.show_points(found.time_s, factor * found.residual_n)
            half = np.full(2, 2.0 * factor * found.repeatability.force_n)
            band.show_band(begin, end - begin, half)
            self.stack.show_whole(begin, end)


def _errors_table(diagnosis: Diagnosis) -> Markup:
    rows = (
        ("before", diagnosis.error_before),
        ("after", diagnosis.error_after),
        ("validation shots, before", diagnosis.error_held_out_before),
        ("validation shots, after", diagnosis.error_held_out_after),
    )
    measured = (
        (head, unit, [getattr(errors, name, math.nan) for _, errors in rows])
        for head, name, unit in (
            ("displacement", "displacement_rms_m", "m"),
            ("velocity", "velocity_rms_m_per_s", "m/s"),
            ("force", "force_rms_n", "N"),
        )
    )
    columns = [_column(*column) for column in measured if any(map(math.isfinite, column[2]))]  # a drive: force
    chi2 = [number(getattr(errors, "reduced_chi2", math.nan), 4) for _, errors in rows]
    cells = zip(*columns, [tag("b", "joint χ²/ν"), *chi2], strict=True)
    body = [
        tag("tr", tag("td", name), [tag("td", cell, align="right", style="padding: 0 6px") for cell in line])
        for name, line in zip(("rms", *(name for name, _ in rows)), cells, strict=True)
    ]
    return tag("table", body, cellspacing=0)


def _column(head: str, unit: str, values: Sequence[float]) -> list[str]:
    """Return a column whose cells all have one unit, because "141 nm" above "152 pm" would look like an increase."""
    most = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    factor, words = prefix_for(most, unit)
    return [lines((tag("b", head), f"({words})")), *(number(factor * value, 3) for value in values)]
