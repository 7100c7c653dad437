"""Residuals of a diagnosis: of all shots with a hovered candidate's contribution, and of one shot; table of errors."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QWidget

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis
from analysis.drive import DriveCurves
from analysis.shot import Floats, Shot
from analysis.uncertainty import diagnosis_band
from app.report import grid_ms, time_zero
from app.session import CandidateResidual, by_evidence
from app.window.controls.theme import Colours, Themed, Tone
from app.window.controls.widgets import add_row, added, heading_label, push_button, text_label, vertical
from app.window.panels.effects import CandidateBars
from app.window.plots.cursors import SECONDS, TIME, CursorAxis, CursorReadout
from app.window.plots.lines import RESIDUAL
from app.window.plots.residual_grid import MOST, Cell, Overlay, ResidualGrid
from app.window.plots.time_plot import TimePlot, TimeStack
from app.words import Markup, joined, lines, number, prefix_for, repeatability_words, short_name, tag

MAX_COMPARED_SHOTS = 4  # most shots in the comparison of two candidates


def explained(left_m: Floats, curve_m: Floats) -> Overlay:
    """Return the overlay of a residual (n,) from a curve (k,) of its means over k equal parts of the record."""
    middles = (np.arange(curve_m.size) + 0.5) * (left_m.size / max(1, curve_m.size)) - 0.5
    signature_m = np.interp(np.arange(left_m.size), middles, curve_m)
    return Overlay(signature_m, left_m - signature_m)


class ResidualOverlay(Themed, QWidget):
    """The grid of residuals before and after a diagnosis, with the hovered candidate's contribution.

    A button shows the residuals with the best and the second-best candidate side by side.
    """

    pointed = Signal(object)  # effect of the hovered candidate

    def __init__(self, bars: CandidateBars, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._diagnosis: Diagnosis | None = None
        self._shots: list[Shot] = []
        self._accepted = False
        self._found: Mapping[Effect, CandidateResidual] = {}
        self._effect: Effect | None = None
        column = vertical(self, (6, 0, 0, 0))
        self._heading = heading_label("", self, wrap=True)
        hover = "Residuals with the best and with the second-best candidate, side by side"
        self.neighbour = push_button("Compare best two", hover, self, checkable=True)
        self.neighbour.toggled.connect(self._draw)
        add_row(column, self._heading, self.neighbour)
        self.grid = added(column, ResidualGrid(self), 1)
        self.said = added(column, text_label("", self, wrap=True))
        self.said.setMinimumHeight(2 * self.fontMetrics().lineSpacing())
        bars.pointed.connect(self.point_at)

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        self._draw()

    def show_diagnosis(self, diagnosis: Diagnosis | None, shots: list[Shot], accepted: bool) -> None:
        """Show the residuals of all shots; ``accepted``: the effects found are in the model, so show only "after"."""
        if diagnosis is not self._diagnosis:
            self._found, self._effect = {}, None
            self.neighbour.setChecked(False)
        self._diagnosis, self._shots, self._accepted = diagnosis, shots, accepted
        self._draw()

    def show_found(self, found: Mapping[Effect, CandidateResidual]) -> None:
        """Set the residuals of the candidates fitted so far."""
        self._found = dict(found)
        self._draw()

    @Slot(object)
    def point_at(self, effect: Effect | None) -> None:
        """Overlay what a candidate would explain; None removes the overlay."""
        self._effect = effect
        if effect is not None:
            self.pointed.emit(effect)
        self._draw_overlay()

    def _pair(self) -> tuple[CandidateResidual, CandidateResidual] | None:
        """Return the residuals of the two best fitted candidates, or None until two are fitted."""
        if self._diagnosis is None:
            return None
        ranked = [self._found.get(candidate.effect) for candidate in by_evidence(self._diagnosis.candidates)]
        there = [remainder for remainder in ranked if remainder is not None and remainder.left_m is not None]
        return (there[0], there[1]) if len(there) > 1 else None

    @Slot()
    def _draw(self) -> None:
        found, pair = self._diagnosis, self._pair()
        self.neighbour.setVisible(found is not None)
        self.neighbour.setEnabled(pair is not None)
        if found is None:
            self.grid.show_cells(())
            self._heading.setText("")
            self.said.setText("")
            return
        if pair is not None and self.neighbour.isChecked():
            self._draw_pair(*pair)
            return
        self.grid.show_cells(self._cells(found))
        count = len(self.grid.cells)
        more = f" (first {MOST} of {len(self._shots)})" if len(self._shots) > count else ""
        which = "AFTER" if self._accepted else "BEFORE (grey) AND AFTER (blue)"
        self._heading.setText(f"RESIDUAL OF DISPLACEMENT {which}, {count} SHOT{'S' if count != 1 else ''}{more}")
        self._draw_overlay()

    def _cells(self, found: Diagnosis) -> list[Cell]:
        cells = []
        before, after = found.fit_before.shots, found.fit_after.shots
        for place, shot in enumerate(shot for shot in self._shots if shot.motion is not None):
            if place >= min(len(before), len(after)) or shot.motion is None:
                break
            noise_m, _ = diagnosis_band(found, shot)
            left = None if self._accepted else np.asarray(before[place].residual_m)
            time_ms = 1e3 * (shot.motion.time_s - time_zero(shot)[0])
            title = short_name(shot.name)
            cells.append(Cell(title, time_ms, left, np.asarray(after[place].residual_m), noise_m))
        return cells

    def _draw_pair(self, first: CandidateResidual, second: CandidateResidual) -> None:
        assert self._diagnosis is not None
        cells = []
        for place, cell in enumerate(self._cells(self._diagnosis)[:MAX_COMPARED_SHOTS]):
            for remainder in (first, second):
                left = remainder.left_m[place] if remainder.left_m is not None else cell.after_m
                title = f"{cell.title}: {remainder.effect.words}"
                cells.append(Cell(title, cell.time_ms, None, left, cell.noise_m))
        self.grid.show_cells(cells)
        names = [remainder.effect.words for remainder in (first, second)]
        self._heading.setText("RESIDUALS WITH THE BEST AND WITH THE SECOND-BEST CANDIDATE")
        chi2 = [number(remainder.reduced_chi2, 3) for remainder in (first, second)]
        self.said.setText(f"Joint χ²/ν {chi2[0]} with {names[0]}, {chi2[1]} with {names[1]}")

    def _explained(self, found: Diagnosis, effect: Effect) -> tuple[Sequence[Overlay | None], str]:
        """Return the overlay of each shot for a candidate, and the sentence below the grid.

        The overlay comes from the candidate's joint fit or, until that has finished, from the diagnosis's own curve.
        """
        remainder = self._found.get(effect)
        candidate = next((one for one in found.candidates if one.effect == effect), None)
        lefts = [np.asarray(shot.residual_m) for shot in found.fit_before.shots]
        words = effect.words
        if remainder is not None and remainder.left_m is not None:
            pairs = zip(lefts, remainder.left_m, strict=False)
            overlays = [Overlay(left - remains, remains) for left, remains in pairs if left.shape == remains.shape]
            how = f"χ²/ν {number(remainder.reduced_chi2, 3)}"
        elif candidate is not None and candidate.explains_m is not None:
            overlays = [explained(*pair) for pair in zip(lefts, candidate.explains_m, strict=False)]
            how = "first order" if candidate.delta_bic is None else "as fitted in the diagnosis"
        elif remainder is not None:
            return (), f"{words}: its fit did not converge"
        else:
            return (), f"{words}: not fitted in full yet"
        colour, rest = self.colours.simulated, self.colours.signs[Tone.GOOD]
        samples = [tag("span", "━", style=f"color:{shown}") for shown in (colour, rest)]
        return overlays, joined(tag("b", words), ": ", samples[0], " explained, ", samples[1], f" remaining; {how}")

    def _draw_overlay(self) -> None:
        found = self._diagnosis
        if found is None or (self.neighbour.isChecked() and self._pair() is not None):
            return
        words = "Point at a candidate to see what it explains and what remains."
        overlays: Sequence[Overlay | None] = ()
        if self._effect is not None:
            overlays, words = self._explained(found, self._effect)
        self.grid.overlay(overlays)
        self.said.setText(words)


class BeforeAfter(TimeStack):
    """Two linked plots of a residual, before and after a diagnosis, each with a band."""

    def __init__(self, name: str, unit: str, bottom: str, axis: CursorAxis, parent: QWidget) -> None:
        super().__init__(name, parent, axis)
        for title in ("before", "after"):
            self.add_plot(title, unit, 1)
        self.bands = [plot.add_band() for plot in self.plots]
        self.setMinimumHeight(8 * self.fontMetrics().lineSpacing())
        self.label_time(bottom)

    def forget(self) -> None:
        """Clear the plots of the previous diagnosis."""
        self.set_shots((), "")
        for plot, band in zip(self.plots, self.bands, strict=True):
            band.show_band(0.0, 1.0, np.zeros(0))
            for curve in plot.sampled:
                curve.clear_samples()


def _scaled(plot: TimePlot, residual: Floats, unit: str) -> float:
    """Set the prefix of a plot's unit for a residual (n,), and return the factor that belongs to it."""
    factor, prefixed = prefix_for(float(np.nanmax(np.abs(residual), initial=0.0)), unit)
    plot.name_value(plot.title, prefixed)
    return factor


class Residuals(QWidget):
    """The residual of one shot, or of a drive's force, with its band; the table of errors."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        column = vertical(self, (6, 0, 0, 0))
        self._heading = added(column, heading_label("RESIDUAL OF DISPLACEMENT", self, wrap=True))
        self.stack = BeforeAfter("Residual before and after", "nm", "time from first touch", TIME, self)
        self.curves = [plot.add_curve("residual", RESIDUAL) for plot in self.stack.plots]
        title = "Residual of force before and after"
        self.forces = BeforeAfter(title, "N", "time from the first sample", SECONDS, self)
        self.force_curves = [plot.add_points("measured − modelled", RESIDUAL) for plot in self.forces.plots]
        self.forces.hide()
        for stack in (self.stack, self.forces):
            column.addWidget(stack, 1)
            column.addWidget(CursorReadout(stack, self))
        self._errors = text_label("", self, selectable=True)
        self._errors.setToolTip(
            "Rms residuals over the same samples at the same bandwidth.\nJoint χ²/ν: of all shots fitted together, "
            "against the noise that the diagnosis found; the panel MODEL shows that of one shot's own fit."
        )
        column.addWidget(self._errors)

    @property
    def stack_in_view(self) -> TimeStack:
        """Get the visible plots."""
        return self.forces if self.forces.isVisibleTo(self) else self.stack

    def clear(self) -> None:
        self._errors.setText("")
        self.stack.forget()
        self.forces.forget()

    def show_forces(self, shot: Shot, before: DriveCurves, after: DriveCurves) -> None:
        """Show a drive's force residual over the whole record, under the fits before and after the diagnosis."""
        against = repeatability_words(after.repeatability)
        self._heading.setText(f"RESIDUAL OF FORCE, {short_name(shot.name)} (band: ±2 × {against})")
        self.forces.set_shots((shot,), shot.name)
        drawn = zip((before, after), self.forces.plots, self.force_curves, self.forces.bands, strict=True)
        for found, plot, curve, band in drawn:
            begin, end = float(found.time_s[0]), float(found.time_s[-1])
            factor = _scaled(plot, found.residual_n, "N")
            curve.show_points(found.time_s, factor * found.residual_n)
            band.show_band(begin, end - begin, np.full(2, 2.0 * factor * found.repeatability.force_n))
            self.forces.show_whole(begin, end)

    def show_diagnosis(self, diagnosis: Diagnosis, shots: list[Shot]) -> None:
        """Show the residual of the first analysed shot, and the errors of all shots."""
        self._errors.setText(_errors_table(diagnosis))
        shot = next((shot for shot in shots if shot.motion is not None), None)  # also the first in the fits
        driven = diagnosis.drive is not None
        self.stack.setVisible(not driven)
        self.forces.setVisible(driven)
        self.forces.forget()
        if driven or shot is None or not diagnosis.fit_after.shots:
            self._heading.setText("RESIDUAL OF FORCE" if driven else "")
            self.stack.forget()
            return
        motion = shot.motion
        assert motion is not None
        self.stack.set_shots((shot,), shot.name)
        self.stack.label_time(time_zero(shot)[1])
        noise_m, what = diagnosis_band(diagnosis, shot)
        self._heading.setText(f"RESIDUAL OF DISPLACEMENT, {short_name(shot.name)} (band: {what}, ±2 σ)")
        start, step = grid_ms(shot)
        fits = (diagnosis.fit_before, diagnosis.fit_after)
        for fit, plot, curve, band in zip(fits, self.stack.plots, self.curves, self.stack.bands, strict=True):
            if fit.shots:
                left = np.asarray(fit.shots[0].residual_m)
                factor = _scaled(plot, left, "m")
                curve.show_samples(start, step, factor * left)
                band.show_band(start, step, 2.0 * factor * noise_m)
        self.stack.show_whole(start, start + step * motion.time_s.size)


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
