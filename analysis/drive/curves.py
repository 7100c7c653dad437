"""Curves of a driven record for plots: the measured force, and the fitted model's force for the measured motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Fit, Floats, Motion

if TYPE_CHECKING:
    from analysis.drive.repeatability import Repeatability

GAP = 1.5  # time between samples, in steps, beyond which a curve is broken


@dataclass(frozen=True, slots=True, eq=False)
class DriveCurves:
    """Arrays of shape (n,) in order of time, low-passed at ``bandwidth_hz``; NaN separates the compared stretches."""

    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    measured_n: Floats
    modelled_n: Floats
    repeatability: Repeatability
    bandwidth_hz: float

    @property
    def residual_n(self) -> Floats:
        """Get the measured force minus the modelled force."""
        return self.measured_n - self.modelled_n


def drive_curves(motion: Motion, fit: Fit) -> DriveCurves:
    """Return the curves of one record under a fit.  Raises AnalysisError.

    Cost: one pass of the derivative filters over the record, about 10 us per sample.
    """
    from analysis.drive.driven_fit import filtered_noise_n  # imports the regression, which a window does not need
    from analysis.drive.regression import delay_of, regress
    from analysis.drive.repeatability import repeatability_of
    from analysis.drive.stretch import Table, prepare

    table = Table.of(prepare([motion]))
    known = {name: quantity.value for name, quantity in fit.parameters.items()}
    held = regress(table, [effect.name for effect in fit.effects], None, None, known)
    measured = table.force(delay_of(held.nonlinear))
    stretch = table.stretches[0]
    breaks = 1 + np.flatnonzero(np.diff(table.time_s) > GAP * stretch.step / stretch.sample_rate_hz)
    return DriveCurves(
        time_s=_with_breaks(table.time_s, breaks, between=True),
        displacement_m=_with_breaks(table.displacement_m, breaks),
        velocity_m_per_s=_with_breaks(table.velocity_m_per_s, breaks),
        measured_n=_with_breaks(measured, breaks),
        modelled_n=_with_breaks(measured - held.residual_n, breaks),
        repeatability=repeatability_of(table, held, filtered_noise_n([motion], table.stretches, held)),
        bandwidth_hz=stretch.bandwidth_hz,
    )


def _with_breaks(column: Floats, breaks: NDArray[np.int64], *, between: bool = False) -> Floats:
    """Return a column with one sample inserted at every break: NaN, or the mean of its neighbours if ``between``."""
    filling = 0.5 * (column[breaks - 1] + column[breaks]) if between else np.full(breaks.size, np.nan)
    return np.insert(column, breaks, filling)
