"""A driven record as its plots want it: the force that was measured beside the one that the fit makes of the motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.shot.fit import Fit
from analysis.shot.motion import Motion

if TYPE_CHECKING:
    from analysis.drive.repeat import Floor

Floats = NDArray[np.float64]
GAP = 1.5  # steps without a sample: there a curve is broken


@dataclass(frozen=True, slots=True, eq=False)
class DriveCurves:
    """Arrays of shape (n,), time rising; NaN parts stretches that were compared from those that were not.

    All passed the low-pass of ``bandwidth_hz``; ``below`` is what the drive repeats to, or its noise.
    """

    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    measured_n: Floats
    modelled_n: Floats
    below: Floor
    bandwidth_hz: float

    @property
    def residual_n(self) -> Floats:
        """Get measured less modelled."""
        return self.measured_n - self.modelled_n


def drive_curves(motion: Motion, fit: Fit) -> DriveCurves:
    """Return the curves of one record under a fit.  Raises AnalysisError.

    Cost: the derivative filters over the record once, some 10 us a sample.
    """
    from analysis.drive.fit import noise_n  # with the regression: a window knows the curves without it
    from analysis.drive.regress import delay_of, regress
    from analysis.drive.repeat import floor
    from analysis.drive.run import prepare
    from analysis.drive.table import Table

    table = Table.of(prepare([motion]))
    known = {name: quantity.value for name, quantity in fit.parameters.items()}
    held = regress(table, fit.effects, None, None, known)
    measured = table.force(delay_of(held.bent))
    run = table.runs[0]
    breaks = 1 + np.flatnonzero(np.diff(table.time_s) > GAP * run.step / run.sample_rate_hz)
    return DriveCurves(
        time_s=_parted(table.time_s, breaks, between=True),
        displacement_m=_parted(table.displacement_m, breaks),
        velocity_m_per_s=_parted(table.velocity_m_per_s, breaks),
        measured_n=_parted(measured, breaks),
        modelled_n=_parted(measured - held.residual_n, breaks),
        below=floor(table, held, noise_n([motion], table.runs, held)),
        bandwidth_hz=run.bandwidth_hz,
    )


def _parted(column: Floats, breaks: NDArray[np.int64], *, between: bool = False) -> Floats:
    """Return a column with one sample more at every break: NaN, or the time ``between`` its neighbours."""
    filling = 0.5 * (column[breaks - 1] + column[breaks]) if between else np.full(breaks.size, np.nan)
    return np.insert(column, breaks, filling)
