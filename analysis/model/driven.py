"""A slider under a measured force: the inverse model, linear in its parameters, by least squares on the force.

F = M a + c v + f_0, and what an effect adds; the identification of robots and drives ("inverse dynamic identification
model": M. Gautier, 1997; Janot, Gautier, Brunot, EMPS benchmark, 2019).  Velocity and acceleration come from the
displacement through this program's own filters; the force is taken as measured.  Noise of the displacement would bias
the mass low (errors in the regressor): the bandwidth is chosen so that it stays far below the motion's acceleration.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.fit import Fit
from analysis.motion import Motion
from analysis.quantity import Quantity
from analysis.shot import AnalysisError
from analysis.signal.filters import derivative_gains, derivatives

Floats = NDArray[np.float64]
BASE = ("moving_mass_kg", "viscous_coefficient_n_s_per_m", "offset_n")
BANDWIDTHS = (0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.1, 0.14, 0.2)  # of the sample rate
REACH = 3.0  # of the derivative filters, in 1 / bandwidth
STANDSTILL_SIGMAS = 5.0
FEWEST_SAMPLES = 200
EFFECTS: dict[str, tuple[str, Callable[["Run"], Floats]]] = {
    "coulomb_friction": ("force_n", lambda run: np.sign(run.velocity_m_per_s)),
    "quadratic_drag": ("coefficient_n_s2_per_m2", lambda run: run.velocity_m_per_s * np.abs(run.velocity_m_per_s)),
    "bearing_gradient": ("stiffness_n_per_m", lambda run: run.displacement_m - run.displacement_m.mean()),
}


@dataclass(frozen=True, slots=True)
class Run:
    """The samples of one record that are used; arrays of shape (n,), ascending in time."""

    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    acceleration_m_per_s2: Floats
    force_n: Floats
    sample_rate_hz: float
    bandwidth_hz: float


@dataclass(frozen=True, slots=True)
class Regression:
    """A least-squares solution over one or several runs; ``residual_n`` has one array a run.

    ``covariance`` carries the remainder's correlation in time (sums over blocks), so that a remainder of
    thousands of neighbouring samples is not taken for thousands of independent ones.
    """

    names: tuple[str, ...]
    values: Floats
    covariance: Floats
    residual_n: tuple[Floats, ...]
    independent_samples: float

    @property
    def rms_n(self) -> float:
        """Get the root mean square of the remaining force."""
        return rms(self.residual_n)

    def quantity(self, name: str) -> Quantity:
        """Return a parameter by its name."""
        place = self.names.index(name)
        return Quantity(float(self.values[place]), float(np.sqrt(self.covariance[place, place])), "least squares on F")


def rms(pieces: Sequence[Floats]) -> float:
    """Return the root mean square of several arrays together."""
    return float(np.sqrt(sum(float(p @ p) for p in pieces) / max(1, sum(p.size for p in pieces))))


def prepare(motion: Motion, bandwidth_hz: float | None = None) -> Run:
    """Return the samples to fit; the bandwidth of the derivatives, unless given, is the one that leaves the least.

    Too narrow and the reversals are rounded off, too wide and the encoder's steps are differentiated.  Raises
    AnalysisError where there is no force or no motion.
    """
    if not np.isfinite(motion.force_n).any() or np.nanstd(motion.force_n) == 0.0:
        raise AnalysisError("force_n: a driven slider needs the measured force")
    rate = motion.sample_rate_hz
    if bandwidth_hz is None:
        common = round(REACH / BANDWIDTHS[0])  # the same samples for all that are compared
        trials = [_cut(motion, share * rate, common) for share in BANDWIDTHS]
        bandwidth_hz = min(trials, key=lambda run: rms([_left_over(run)])).bandwidth_hz
    return _cut(motion, bandwidth_hz, round(REACH * rate / bandwidth_hz))


def _cut(motion: Motion, bandwidth_hz: float, edge: int) -> Run:
    velocity, acceleration = derivatives(motion.displacement_m, motion.sample_rate_hz, bandwidth_hz)
    gain = derivative_gains(motion.valid, motion.sample_rate_hz, bandwidth_hz)[0]
    use = np.isfinite(velocity) & np.isfinite(acceleration) & np.isfinite(motion.force_n)
    use[:edge] = use[-edge:] = False
    # at a standstill the sign of the velocity is noise
    use &= np.abs(np.nan_to_num(velocity)) > STANDSTILL_SIGMAS * np.nan_to_num(gain * motion.displacement_std_m)
    if use.sum() < FEWEST_SAMPLES:
        raise AnalysisError(f"{int(use.sum())} samples of motion under force are too few to fit a slider")
    columns = (motion.time_s, motion.displacement_m, velocity, acceleration, motion.force_n)
    time_s, x, v, a, force = (np.asarray(column[use], dtype=np.float64) for column in columns)
    return Run(time_s, x, v, a, force, motion.sample_rate_hz, bandwidth_hz)


def _left_over(run: Run) -> Floats:
    columns = design(run, tuple(EFFECTS))  # all of them: a filter must not be chosen to make up for a missing effect
    values, *_ = np.linalg.lstsq(columns, run.force_n, rcond=None)
    return np.asarray(run.force_n - columns @ values)


def design(run: Run, effects: Sequence[str] = ()) -> Floats:
    """Return the columns of base and effects, shape (n, 3 + effects)."""
    base = [run.acceleration_m_per_s2, run.velocity_m_per_s, np.ones(run.time_s.size)]
    return np.stack([*base, *(EFFECTS[name][1](run) for name in effects)], axis=1)


def regress(runs: Sequence[Run], effects: Sequence[str] = ()) -> Regression:
    """Return the least-squares solution of base and effects over all runs."""
    names = (*BASE, *(f"{name}.{EFFECTS[name][0]}" for name in effects))
    columns = [design(run, effects) for run in runs]
    whole = np.concatenate(columns)
    scale = np.linalg.norm(whole, axis=0)
    if (scale == 0.0).any() or np.linalg.cond(whole / scale) > 1e8:
        raise AnalysisError("the motion does not tell mass, drag and offset apart")
    values, *_ = np.linalg.lstsq(whole / scale, np.concatenate([run.force_n for run in runs]), rcond=None)
    values = values / scale
    residual = tuple(run.force_n - part @ values for run, part in zip(runs, columns, strict=True))
    inverse = np.linalg.inv((whole / scale).T @ (whole / scale))
    meat = sum(_long_run(part / scale * rest[:, None]) for part, rest in zip(columns, residual, strict=True))
    covariance = inverse @ np.asarray(meat) @ inverse / np.outer(scale, scale)
    return Regression(names, values, covariance, residual, sum(_independent(rest) for rest in residual))


def fit_driven(motions: Sequence[Motion], effects: Sequence[str] = ()) -> Fit:
    """Return the slider's fit; it has no shots, as nothing collides.  Raises AnalysisError."""
    began = time.perf_counter()
    runs = [prepare(motion) for motion in motions]
    found = regress(runs, effects)
    noise_n = float(np.median([np.nanmedian(motion.force_std_n) for motion in motions]))
    freedom = max(1, sum(run.time_s.size for run in runs) - found.values.size)
    square = sum(float(rest @ rest) for rest in found.residual_n)
    return Fit(
        model="driven",
        parameters={name: found.quantity(name) for name in found.names},
        covariance=found.covariance,
        shots=(),
        reduced_chi2=square / freedom / noise_n**2 if noise_n > 0.0 else float("nan"),
        noise_std_m=float(np.median([np.nanmedian(motion.displacement_std_m) for motion in motions])),
        converged=True,
        effects=tuple(effects),
        seconds=time.perf_counter() - began,
    )


def _long_run(scores: Floats) -> Floats:
    """Return the covariance of the scores' sum, from sums over blocks longer than they remember; shape (k, k)."""
    length = max(1, round(4.0 * scores.shape[0] ** (1.0 / 3.0)))
    blocks = np.add.reduceat(scores, np.arange(0, scores.shape[0], length), axis=0)
    return np.asarray(blocks.T @ blocks)


def _independent(residual: Floats) -> float:
    """Return how many independent samples a remainder is worth."""
    variance = float(residual @ residual)
    if variance == 0.0:
        return float(residual.size)
    return residual.size * variance / max(variance, float(_long_run(residual[:, None])[0, 0]))
