"""What the model left over before and after the diagnosis: the residual of one shot, and the errors in numbers."""

import numpy as np
from PySide6.QtCore import Qt, Slot
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from analysis.diagnosis.result import Diagnosis, Errors, Verdict
from analysis.shot import Shot
from app.report.shot_times import time_zero
from app.window.pens import thin
from app.window.plots.cursor_readout import CursorReadout
from app.window.plots.time_stack import TimeStack
from app.window.theme import Colours
from app.words.prefixes import prefix_for
from app.words.wording import DASH, number, short_name, with_prefix

CELL = "<td align='right' style='padding: 0 6px'>"


class Residuals(QWidget):
    """Two linked plots with the band of noise, and the table of errors."""

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 0, 0, 0)
        self._heading = QLabel("RESIDUAL OF DISPLACEMENT", self)
        self._heading.setProperty("heading", True)
        self._heading.setWordWrap(True)
        column.addWidget(self._heading)
        self.stack = TimeStack("Residual before and after", colours, self)
        self._plots = [self.stack.add_plot(name, "nm", 1) for name in ("before", "after")]
        self._bands = [plot.add_band(colours.band, colours.band_edge) for plot in self._plots]
        self._curves = [plot.add_curve("residual", thin(colours.residual)) for plot in self._plots]
        self.stack.setMinimumHeight(8 * self.fontMetrics().lineSpacing())
        self.stack.label_time("time from first touch (ms)")
        self.stack.reset_wanted.connect(self.reset)
        column.addWidget(self.stack, 1)
        column.addWidget(CursorReadout(self.stack, self))
        self._errors = QLabel(self)
        self._errors.setTextFormat(Qt.TextFormat.RichText)
        self._errors.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        column.addWidget(self._errors)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self.stack.dress(colours)
        for curve in self._curves:
            curve.setPen(thin(colours.residual))

    def clear(self) -> None:
        """Show nothing."""
        self._errors.setText("")
        self._forget()

    def _forget(self) -> None:
        """Draw nothing: a picture of other shots would pass for these."""
        for curve, band in zip(self._curves, self._bands, strict=True):
            curve.clear_samples()
            band.show_band(0.0, 1.0, np.zeros(0))
        self.stack.tell((), "")

    def show_diagnosis(self, diagnosis: Diagnosis, shots: list[Shot]) -> None:
        """Show the first of these shots that was analysed, and the errors of all."""
        self._errors.setText(_errors_table(diagnosis))
        shown = next((i for i, shot in enumerate(shots) if shot.motion is not None), None)
        if shown is None or shown >= len(diagnosis.fit_after.shots):
            self._heading.setText(
                "RESIDUAL OF FORCE: in the numbers below" if diagnosis.fit_after.model == "driven" else ""
            )
            self._forget()
            return
        shot = shots[shown]
        motion = shot.motion
        assert motion is not None
        self.stack.tell((shot,), shot.name)
        zero, words = time_zero(shot)
        self.stack.label_time(words)
        self._heading.setText(f"RESIDUAL OF DISPLACEMENT, {short_name(shot.name)} (band: noise, ±2 σ)")
        # What stays unexplained is not noise, though a floor that wanders may take it for some.
        known = diagnosis.verdict not in (Verdict.PARTLY_EXPLAINED, Verdict.UNEXPLAINED)
        noise_m = (
            np.full_like(motion.displacement_m, diagnosis.fit_after.noise_std_m) if known else motion.displacement_std_m
        )
        start, step = 1e3 * (float(motion.time_s[0]) - zero), 1e3 / motion.sample_rate_hz
        fits = (diagnosis.fit_before, diagnosis.fit_after)
        for fit, plot, curve, band in zip(fits, self._plots, self._curves, self._bands, strict=True):
            if shown < len(fit.shots):
                left = np.asarray(fit.shots[shown].residual_m)
                factor, unit = prefix_for(float(np.nanmax(np.abs(left), initial=0.0)), "m")
                plot.count_in(unit)
                curve.show_samples(start, step, factor * left)
                band.show_band(start, step, 2.0 * factor * noise_m)
        self.reset()

    @Slot()
    def reset(self) -> None:
        """Show the whole shot."""
        samples = self._curves[0].samples
        if len(samples):
            start, step = self._curves[0].grid
            self.stack.zoom(start, start + step * len(samples))


def _errors_table(diagnosis: Diagnosis) -> str:
    heads = "".join(f"{CELL}<b>{head}</b></td>" for head in ("displacement", "velocity", "force", "χ²/ν"))
    rows = (
        ("before", diagnosis.error_before),
        ("after", diagnosis.error_after),
        ("held out, before", diagnosis.error_held_out_before),
        ("held out, after", diagnosis.error_held_out_after),
    )
    body = "".join(f"<tr><td>{name}</td>{_cells(errors)}</tr>" for name, errors in rows)
    return f"<table cellspacing='0'><tr><td>rms</td>{heads}</tr>{body}</table>"


def _cells(errors: Errors | None) -> str:
    if errors is None:
        return f"{CELL}{DASH}</td>" * 4
    values = (
        with_prefix(errors.displacement_rms_m, "m"),
        with_prefix(errors.velocity_rms_m_per_s, "m/s"),
        with_prefix(errors.force_rms_n, "N"),
        number(errors.reduced_chi2, 4),
    )
    return "".join(f"{CELL}{value}</td>" for value in values)
