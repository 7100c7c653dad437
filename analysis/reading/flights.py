"""Where the block flies free, how fast, and how sure that is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.motion import Motion
from analysis.noise import Noise

Floats = NDArray[np.float64]

FORCE_SIGMAS = 6.0  # a contact must stand this far above the force noise
FORCE_FRACTION = 0.03  # ... and this far above nothing, as a fraction of the peak
REVERSAL_SIGMAS = 4.0  # ... and a reversal this far off both flights
LONGEST_FLIGHT_S = 0.040  # of flight taken on each side: longer adds drift, not knowledge
FEWEST_SAMPLES = 400  # ... but a slow record needs this many
SHORTEST_CURVED_S = 0.003  # a shorter flight carries a straight line only


@dataclass(frozen=True, slots=True)
class ContactSpan:
    """Sample indices between which the block is under force, by threshold; touch and release lie close by."""

    first: int
    last: int
    threshold_n: float
    force_std_n: float


@dataclass(frozen=True, slots=True)
class Flight:
    """A polynomial through the displacement of a free flight, about ``time_zero_s``.

    ``coefficients`` are position, velocity, half acceleration, ... (SI); ``covariance`` is over them.
    ``noise_std_m`` is that of one sample against its neighbours.
    """

    time_zero_s: float
    coefficients: Floats
    covariance: Floats
    noise_std_m: float
    first: int
    last: int

    @property
    def acceleration_m_per_s2(self) -> float:
        """Get the flight's own constant acceleration; 0 where it was too short to show one."""
        return 2.0 * float(self.coefficients[2]) if self.coefficients.size > 2 else 0.0

    def position_m(self, time_s: Floats) -> Floats:
        """Return the flight's displacement in m, continued to any times in s."""
        return np.asarray(np.polynomial.polynomial.polyval(time_s - self.time_zero_s, self.coefficients))

    def velocity(self, time_s: float) -> tuple[float, float]:
        """Return velocity and its standard deviation in m/s at one time in s."""
        tau = time_s - self.time_zero_s
        powers = np.arange(self.coefficients.size)
        row = np.where(powers > 0, powers * tau ** np.maximum(powers - 1, 0), 0.0)
        return float(row @ self.coefficients), float(np.sqrt(row @ self.covariance @ row))


def find_contact(motion: Motion) -> ContactSpan | None:
    """Return the span under force, or None where the record shows no impact.

    The noise of the force is taken from the record's own quiet part (median absolute value), never below the stated.
    Where it hides the force, the contact is looked for in the displacement instead: a reversal between two flights.
    """
    force = motion.force_n
    seen = np.isfinite(force)
    if seen.sum() < 32:
        return None
    absolute = np.abs(force[seen])
    peak = float(absolute.max())
    quiet = absolute[absolute < 0.1 * peak]
    stated = float(np.nanmedian(motion.force_std_n))
    std = max(stated, 1.4826 * float(np.median(quiet)) if quiet.size > 16 else stated)
    threshold = max(FORCE_SIGMAS * std, FORCE_FRACTION * peak)
    if peak < 2.0 * threshold:
        return _find_reversal(motion, threshold, std)
    above = seen & (np.abs(np.where(seen, force, 0.0)) > threshold)
    sustained = np.flatnonzero(above & np.roll(above, 1))
    if sustained.size == 0:
        return _find_reversal(motion, threshold, std)
    return ContactSpan(int(sustained[0]) - 1, int(sustained[-1]), threshold, std)


def _find_reversal(motion: Motion, threshold_n: float, force_std_n: float) -> ContactSpan | None:
    """Return the span in which the displacement has left the incoming flight and not yet joined the outgoing one."""
    x = motion.displacement_m
    seen = np.flatnonzero(motion.valid & np.isfinite(x))
    if seen.size < 64:
        return None
    turn = int(seen[int(x[seen].argmin())])
    guard = max(4, (int(seen[-1]) - int(seen[0])) // 20)
    edges = []
    for first, last, towards in ((seen[0], turn - guard, 1), (turn + guard, seen[-1], -1)):
        flight = fit_flight(motion, int(first), int(last), nearest=turn)
        if flight is None or flight.last - flight.first < 16:
            return None
        speed, speed_std = flight.velocity(float(motion.time_s[turn]))
        if speed * towards >= 0.0 or abs(speed) < 20.0 * speed_std:
            return None  # it does not fly towards the turning point, or hardly
        path = np.arange(turn - towards * guard, turn + towards, towards)
        away = np.abs(x[path] - flight.position_m(motion.time_s[path])) > REVERSAL_SIGMAS * flight.noise_std_m
        back = np.flatnonzero(~away)  # the last sample that still lies on the flight
        edges.append(int(path[back[-1]]) if back.size else int(path[0]))
    return ContactSpan(edges[0], edges[1], threshold_n, force_std_n)


def fit_flight(motion: Motion, first: int, last: int, *, nearest: int, noise: Noise | None = None) -> Flight | None:
    """Fit the flight between samples ``first`` and ``last`` (inclusive), keeping the part close to sample ``nearest``.

    Quadratic where the flight is long enough, so that drag and tilt do not bend the velocity at its end; straight
    where it is short.  With ``noise`` data and polynomial are whitened alike (generalised least squares): a floor that
    wanders moves the velocity more than its size among white noise would tell.  None with fewer than 4 valid samples.
    """
    longest = max(round(LONGEST_FLIGHT_S * motion.sample_rate_hz), FEWEST_SAMPLES)
    if nearest >= last:
        first = max(first, last - longest)
    else:
        last = min(last, first + longest)
    index = np.arange(max(first, 0), min(last, motion.time_s.size - 1) + 1)
    index = index[motion.valid[index] & np.isfinite(motion.displacement_m[index])]
    if index.size < 4:
        return None
    zero = float(motion.time_s[min(max(nearest, 0), motion.time_s.size - 1)])
    tau = motion.time_s[index] - zero
    degree = 2 if tau[-1] - tau[0] >= SHORTEST_CURVED_S and index.size >= 12 else 1
    scale = float(np.abs(tau).max())
    design = np.vander(tau / scale, degree + 1, increasing=True)
    values = motion.displacement_m[index]
    freedom = max(index.size - degree - 1, 1)
    if noise is None:
        solution, *_ = np.linalg.lstsq(design, values, rcond=None)
        residual = values - design @ solution
        stated = float(np.nanmedian(motion.displacement_std_m[index]))
        std = float(np.sqrt(residual @ residual / freedom)) if freedom >= 8 else stated
        covariance = np.linalg.inv(design.T @ design) * max(std, 1e-30) ** 2
    else:
        std = noise.white_std_m
        solution, covariance = _whitened_fit(noise, np.column_stack([values - values[0], design]), index)
        solution[0] += values[0]
    unscale = scale ** -np.arange(degree + 1.0)
    return Flight(zero, solution * unscale, covariance * np.outer(unscale, unscale), std, int(index[0]), int(index[-1]))


def _whitened_fit(noise: Noise, columns: Floats, index: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Return generalised least-squares solution and covariance; the first column is the data, holes stay holes."""
    span = int(index[-1] - index[0]) + 1
    valid = np.zeros(span, dtype=np.bool_)
    valid[index - index[0]] = True
    spread = np.zeros((span, columns.shape[1]))
    spread[valid] = columns
    white = noise.whiten(spread, valid)
    solution, *_ = np.linalg.lstsq(white[:, 1:], white[:, 0], rcond=None)
    residual = white[:, 0] - white[:, 1:] @ solution
    freedom = max(white.shape[0] - solution.size, 1)
    inverse = np.linalg.inv(white[:, 1:].T @ white[:, 1:])
    scatter = max(1.0, float(residual @ residual) / freedom)  # Birge: never better known than it fits
    return np.asarray(solution, dtype=np.float64), np.asarray(inverse * scatter, dtype=np.float64)
