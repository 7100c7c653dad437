"""The slider's fit in the form that everything else reads."""

import time
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.drive.bandwidth import force_noise
from analysis.drive.mass import FLAG, MASS, Weighed, weigh
from analysis.drive.regress import Regression, regress, rms
from analysis.drive.repeat import Floor, floor
from analysis.drive.run import Run, low_pass, prepare
from analysis.drive.search import accept
from analysis.drive.table import Table
from analysis.shot.fit import Fit
from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity
from analysis.shot.shot import Stop
from analysis.signal.filters import derivative_filters

Floats = NDArray[np.float64]


def fit_driven(motions: Sequence[Motion], effects: Sequence[str] = (), stop: Stop = lambda: False) -> Fit:
    """Return the slider's fit; it has no shots, as nothing collides.  Raises AnalysisError, Cancelled."""
    began = time.perf_counter()
    table = Table.of(prepare(motions), stop)
    free = accept(table, effects)
    weighed = weigh(motions, free)
    found = regress(table, free.laws, None, free.bent, weighed.fixed)
    below = floor(table, found, noise_n(motions, table.runs, found))
    return as_fit(motions, found, weighed, below, time.perf_counter() - began)


def as_fit(motions: Sequence[Motion], found: Regression, weighed: Weighed, below: Floor, seconds: float) -> Fit:
    """Return a regression as a Fit; its chi2 is against what the drive repeats to."""
    parameters = {name: found.quantity(name) for name in found.names}
    covariance = found.covariance
    if weighed.fixed and weighed.stated is not None:
        parameters[MASS] = weighed.stated
        covariance = covariance.copy()
        covariance[found.names.index(MASS), found.names.index(MASS)] = weighed.stated.std**2
    return Fit(
        model="driven",
        parameters=parameters,
        covariance=covariance,
        shots=(),
        reduced_chi2=chi2(found.rms_n, below),
        noise_std_m=float(np.median([np.nanmedian(motion.displacement_std_m) for motion in motions])),
        converged=True,
        effects=found.laws,
        flags=() if weighed.agrees else (FLAG,),
        seconds=seconds,
    )


def chi2(error_n: float, below: Floor) -> float:
    """Return how many times the floor's square an error's square is."""
    return (error_n / below.force_n) ** 2 if below.force_n > 0.0 else float("nan")


def noise_n(motions: Sequence[Motion], runs: Sequence[Run], found: Regression) -> float:
    """Return the noise of the filtered force, that of the acceleration contained."""
    rate, bandwidth = runs[0].sample_rate_hz, runs[0].bandwidth_hz
    force = rms(np.array([force_noise(motion) for motion in motions]))
    place = rms(np.array([np.nanmedian(motion.displacement_std_m) for motion in motions]))
    through = float(np.linalg.norm(low_pass(rate, bandwidth)))
    weight = found.quantity(MASS).value * derivative_filters(rate, bandwidth).acceleration_gain
    return float(np.hypot(force * through, weight * place))


def foretold_force(table: Table, effects: Sequence[str], parameters: Mapping[str, Quantity]) -> Floats:
    """Return what a saved model leaves of the force, shape (m,): unchanged but for the offset, a record's own."""
    known = {name: quantity.value for name, quantity in parameters.items() if name != "offset_n"}
    return regress(table, effects, None, None, known).residual_n
