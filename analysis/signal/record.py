"""Make a Motion from a record demodulated elsewhere, with this program's filters and the record's own noise."""

import numpy as np

from analysis.shot import AnalysisError, Floats, Motion, NotSeen
from analysis.signal.filters import FLAT_SHARE, derivative_gains, derivatives
from analysis.signal.noise import noise_of_column

BANDWIDTH_SHARE = 0.2  # of the sample rate: the largest bandwidth, and the default
MAX_JITTER = 0.2  # of a step: a record with times farther off an even grid is refused
_EVEN = 1e-3  # of a step: with smaller deviations the grid counts as even
_LONGEST_GAP = 10_000  # steps
_MIN_SAMPLES = 32


def motion_from_displacement(
    time_s: Floats,
    displacement_m: Floats | None,
    velocity_m_per_s: Floats | None,
    force_n: Floats | None,
    moving_mass_kg: float | None,
    moving_mass_u_kg: float = 0.0,
    bandwidth_hz: float | None = None,
) -> Motion:
    """Return the Motion of a record with times of shape (n,) and at least displacement or velocity, shape (n,).

    Missing rows (steps of a whole number of sample intervals) become NaN, flagged "gap".  Times that jitter by up to
    ``MAX_JITTER`` of a step are interpolated (cubic) to an even grid, flagged "uneven_time"; larger jitter is refused.
    If displacement is given, velocity is its derivative by this program's filters and a velocity column is ignored.
    Otherwise displacement is the integral of velocity, whose noise grows as a random walk; its std states this.
    ``force_n``, if given, is the measured force; otherwise force is mass times acceleration, or NaN without a mass.
    The noise is estimated from the record's fourth differences, at least the rounding of its numbers.  Raises
    AnalysisError, in one line, naming the column at fault.
    """
    grid, given, problems = _even(*_checked(time_s, displacement_m, velocity_m_per_s, force_n))
    rate = (grid.size - 1) / (grid[-1] - grid[0])
    bandwidth = BANDWIDTH_SHARE * rate if bandwidth_hz is None else min(bandwidth_hz, BANDWIDTH_SHARE * rate)
    displacement, std, walk_m_per_sqrt_s = _displacement(given, rate)
    velocity, acceleration = derivatives(displacement, rate, bandwidth)
    finite = np.isfinite(displacement)
    gains = derivative_gains(finite, rate, bandwidth, walk=walk_m_per_sqrt_s is not None)
    size = walk_m_per_sqrt_s if walk_m_per_sqrt_s is not None else std[0]
    velocity_std, acceleration_std = size * gains[0], size * gains[1]
    std[~finite] = np.nan

    mass = float("nan") if moving_mass_kg is None else float(moving_mass_kg)
    if mass <= 0:
        raise AnalysisError(f"moving_mass_kg: {mass:g} must be above zero")
    force, force_std = mass * acceleration, mass * acceleration_std
    if "force_n" in given:
        force = given["force_n"]
        force_std = np.where(np.isfinite(force), noise_of_column(force, "force_n"), np.nan)
    return Motion(
        time_s=grid,
        displacement_m=displacement,
        velocity_m_per_s=velocity,
        acceleration_m_per_s2=acceleration,
        force_n=force,
        displacement_std_m=std,
        velocity_std_m_per_s=velocity_std,
        acceleration_std_m_per_s2=acceleration_std,
        force_std_n=force_std,
        valid=finite,
        sample_rate_hz=float(rate),
        bandwidth_hz=float(bandwidth),
        displacement_band_hz=FLAT_SHARE * float(rate),
        moving_mass_kg=mass,
        moving_mass_u_kg=moving_mass_u_kg,
        wavelength_m=None,
        rest_frequency_hz=NotSeen("a motion record has no beats"),
        flags=problems,
        force_measured="force_n" in given,
    )


def _checked(
    time_s: Floats, displacement_m: Floats | None, velocity_m_per_s: Floats | None, force_n: Floats | None
) -> tuple[Floats, dict[str, Floats]]:
    """Return the times and the given columns by name as arrays.  Raises AnalysisError for wrong sizes or times."""
    time = np.asarray(time_s, dtype=np.float64)
    if displacement_m is None and velocity_m_per_s is None:
        raise AnalysisError("neither displacement_m nor velocity_m_per_s is given")
    if time.ndim != 1 or time.size < _MIN_SAMPLES:
        raise AnalysisError(f"time_s: {time.size} rows are too short (at least {_MIN_SAMPLES})")
    if not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0):
        raise AnalysisError("time_s: must be finite and rise from row to row")
    columns = {"displacement_m": displacement_m, "velocity_m_per_s": velocity_m_per_s, "force_n": force_n}
    given = {name: np.asarray(column, dtype=np.float64) for name, column in columns.items() if column is not None}
    for name, column in given.items():
        if column.shape != time.shape:
            raise AnalysisError(f"{name}: {column.size} values for {time.size} times")
    return time, given


def _displacement(given: dict[str, Floats], rate_hz: float) -> tuple[Floats, Floats, float | None]:
    """Return displacement and its std, (n,) each, and its random walk's growth (None unless velocity is integrated)."""
    if "displacement_m" in given:
        displacement = given["displacement_m"]
        return displacement, np.full(displacement.size, noise_of_column(displacement, "displacement_m")), None
    velocity = given["velocity_m_per_s"]
    if not np.all(np.isfinite(velocity)):
        raise AnalysisError("velocity_m_per_s: has missing values, over which it cannot be integrated")
    noise = noise_of_column(velocity, "velocity_m_per_s")
    displacement = np.concatenate(([0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1])))) / rate_hz
    return displacement, noise / rate_hz * np.sqrt(np.arange(velocity.size) + 1.0), noise / np.sqrt(rate_hz)


def _even(time: Floats, given: dict[str, Floats]) -> tuple[Floats, dict[str, Floats], tuple[str, ...]]:
    steps = np.diff(time)
    step = float(np.median(steps))
    places = np.concatenate(([0.0], np.cumsum(np.rint(steps / step))))
    if np.any(np.rint(steps / step) < 1) or places[-1] > time.size + _LONGEST_GAP:
        raise AnalysisError(f"time_s: steps from {steps.min():g} to {steps.max():g} s are no even sampling")
    step, start = np.polyfit(places, time, 1)
    off = np.abs(time - start - step * places) / step
    if off.max() > MAX_JITTER:
        row = int(np.argmax(off))
        raise AnalysisError(f"time_s: row {row + 1} is {off.max():.0%} of a step off an even grid of {step:g} s")
    problems: list[str] = []
    size = int(places[-1]) + 1
    index = places.astype(np.int64)
    if off.max() > _EVEN:
        problems.append("uneven_time")
        target = start + step * places
        given = {name: _interpolated(target, time, column) for name, column in given.items()}
    else:
        start, step = time[0], (time[-1] - time[0]) / (size - 1)
    if size > time.size:
        problems.append("gap")
    spread = {name: np.full(size, np.nan) for name in given}
    for name, column in given.items():
        spread[name][index] = column
    return start + step * np.arange(size), spread, tuple(problems)


def _interpolated(target: Floats, time: Floats, column: Floats) -> Floats:
    """Return a column interpolated to ``target`` by the cubic through the four rows around each target."""
    first = np.clip(np.searchsorted(time, target) - 2, 0, time.size - 4)
    out = np.zeros(target.shape)
    for j in range(4):
        weight = np.ones(target.shape)
        for k in range(4):
            if k != j:
                weight *= (target - time[first + k]) / (time[first + j] - time[first + k])
        out += weight * column[first + j]
    return out
