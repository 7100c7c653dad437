"""Fit both free flights jointly: parabolas, steady lines of machines, the floor's spectrum; knocks are left out.

The displacement of the flights is averaged in bins shorter than any vibration period.  The number of bins is small
enough for their full covariance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.reading.flight import SHORTEST_CURVED_S, Bins, Flight, binned, select
from analysis.reading.floor_spectrum import FlightObservation, FloorEstimate, FloorSpectrum, Octaves
from analysis.reading.vibration_lines import (
    Wave,
    add_line,
    design_matrix,
    frequency_derivative,
    line_of,
    refined,
    wave_of,
)
from analysis.shot import Floats, Motion, VibrationLine

Mask = NDArray[np.bool_]

MIN_BINS = 4  # fewest bins of one flight, for a straight line with a residual
MIN_FOR_LINES = 24  # fewest bins of both flights for a search of lines
MAX_LINES = 8
LOUD = 25.0  # power of a knock over that of the quiet part: five times its amplitude
FADED = 4.0  # the same ratio at which a knock has ended
WINDOW = 4  # bins over which power is averaged
MIN_LEFT = 10  # bins of a flight that must remain without a knock


@dataclass(frozen=True, slots=True)
class Flights:
    """Both flights, the steady lines and the floor's spectrum.

    ``outgoing`` is None if there is no flight after the contact; ``velocity_covariance`` is that of the two velocities
    at their own ``time_zero_s``.  ``plain`` are the stds in m/s of both velocities under white noise alone.
    """

    incoming: Flight
    outgoing: Flight | None
    velocity_covariance: float
    lines: tuple[VibrationLine, ...]
    floor: FloorSpectrum
    knocks_s: tuple[tuple[float, float], ...]
    plain: tuple[float, float]
    strengths: Floats  # the likeliest, as a start for ``estimate_floor``
    unremovable_knock: bool = False  # a knock fills a flight, so it could not be left out


def read_flights(
    motion: Motion, into: tuple[int, int], out: tuple[int, int] | None, before: Flights | None = None
) -> Flights | None:
    """Fit the flights between sample pairs (first, last), inclusive.

    The velocities are those at the ends adjacent to the contact.  ``before`` is an earlier fit of nearly the same
    flights: its lines are refined, and no others are searched.  None if the incoming flight is too short.  Cost: about
    10 ms, and another 10 ms per line.
    """
    bins = binned(motion, into, out)
    if bins.into.sum() < MIN_BINS:
        return None
    if out is not None and (~bins.into).sum() < MIN_BINS:
        out, bins = None, select(bins, bins.into)
    zeros = (float(motion.time_s[into[1]]), float(motion.time_s[out[0]]) if out is not None else 0.0)
    bins, knocks, unremovable_knock = _without_knocks(bins, zeros)
    polynomials, drags = _polynomials(bins, zeros)
    straight, line = _unweighted(bins, polynomials, drags)
    octaves = Octaves.of(bins.time_s, bins.each * bins.step_s)
    waves_of_floor = np.hstack(bins.waves(octaves.frequency_hz))
    observation = FlightObservation(bins.value_m - line, bins.std_m, drags, octaves, waves_of_floor)
    if before is None:
        waves, estimate = _search_lines(bins, observation, polynomials)
    else:
        waves, estimate = _refine_lines(bins, observation, polynomials, before)
    design = design_matrix(bins, waves, polynomials)
    weights, points = estimate.mixture()
    solution, covariance = observation.solve(weights, points, design)
    solution[: straight.size] += straight
    white = bins.std_m * np.sqrt(bins.each)
    floor = FloorSpectrum(octaves, weights @ observation.powers(points), white, motion.sample_rate_hz)
    degree = 3 if 2 in drags else 2  # columns of the incoming flight
    first, second = slice(0, degree), slice(degree, polynomials.shape[1])
    plain = np.linalg.inv(polynomials.T @ polynomials) * bins.std_m**2
    return Flights(
        incoming=Flight(zeros[0], solution[first], covariance[first, first], white, *into),
        outgoing=Flight(zeros[1], solution[second], covariance[second, second], white, *out) if out else None,
        velocity_covariance=float(covariance[1, degree + 1]) if out is not None else 0.0,
        lines=tuple(
            line_of(wave, covariance[i : i + 3, i : i + 3], frequency_derivative(bins, wave)[1], bins.middle_s)
            for i, wave in zip(range(polynomials.shape[1], design.shape[1], 3), waves, strict=True)
        ),
        floor=floor,
        knocks_s=knocks,
        plain=(float(np.sqrt(plain[1, 1])), float(np.sqrt(plain[degree + 1, degree + 1])) if out is not None else 0.0),
        strengths=estimate.best,
        unremovable_knock=unremovable_knock,
    )


def _without_knocks(bins: Bins, zeros: tuple[float, float]) -> tuple[Bins, tuple[tuple[float, float], ...], bool]:
    """Return the bins outside knocks, (start, end) of every knock in s, and whether one could not be left out."""
    departure_m = bins.value_m - _unweighted(bins, _polynomials(bins, zeros)[0])[1]
    knocked, unremovable = find_knocks(departure_m, bins.into, bins.std_m)
    half_s = 0.5 * (bins.each - 1) * bins.step_s  # from a bin's middle to its first and to its last sample
    knocks = tuple((float(bins.time_s[a]) - half_s, float(bins.time_s[b - 1]) + half_s) for a, b in knocked)
    keep = np.ones(bins.time_s.size, dtype=np.bool_)
    for a, b in knocked:
        keep[a:b] = False
    return select(bins, keep), knocks, unremovable


def _search_lines(bins: Bins, observation: FlightObservation, polynomials: Floats) -> tuple[list[Wave], FloorEstimate]:
    """Return the steady lines found in the flights, and the floor's strengths estimated with them."""
    waves: list[Wave] = []
    estimate = observation.estimate_floor(design_matrix(bins, waves, polynomials))
    size = bins.time_s.size
    while size >= MIN_FOR_LINES and len(waves) < MAX_LINES and polynomials.shape[1] + 3 * len(waves) + 12 < size:
        more = add_line(bins, observation, waves, polynomials, estimate)
        if more is None:
            break
        waves, estimate = more
    return waves, estimate


def _refine_lines(
    bins: Bins, observation: FlightObservation, polynomials: Floats, before: Flights
) -> tuple[list[Wave], FloorEstimate]:
    """Return the lines of an earlier fit refined, and the floor's strengths estimated with those lines."""
    waves = [wave_of(bins, line) for line in before.lines]
    starts = (before.strengths,) if before.strengths.size == observation.unknowns else ()
    estimate = observation.estimate_floor(design_matrix(bins, waves, polynomials), starts)
    return refined(bins, observation, waves, polynomials, estimate.best) if waves else waves, estimate


def _unweighted(bins: Bins, polynomials: Floats, left_out: tuple[int, ...] = ()) -> tuple[Floats, Floats]:
    """Return the coefficients, (p,), of an unweighted fit of the flights, and its displacement, (n,).

    Without the accelerations this displacement is ten million times the noise.  Subtracting it first keeps the
    precision of sums of squares.
    """
    free = np.setdiff1d(np.arange(polynomials.shape[1]), left_out)
    scale = np.abs(polynomials).max(axis=0)
    coefficients = np.zeros(polynomials.shape[1])
    solution, *_ = np.linalg.lstsq(polynomials[:, free] / scale[free], bins.value_m, rcond=None)
    coefficients[free] = solution / scale[free]
    return coefficients, np.asarray(polynomials @ coefficients)


def _polynomials(bins: Bins, zeros: tuple[float, float]) -> tuple[Floats, tuple[int, ...]]:
    """Return the columns of both flights' polynomials about their zeros, in SI units, and the acceleration columns."""
    columns: list[Floats] = []
    drags = []
    for side, zero in ((bins.into, zeros[0]), (~bins.into, zeros[1])):
        if not side.any():
            continue
        tau = bins.time_s - zero
        columns += [side.astype(np.float64), np.where(side, tau, 0.0)]
        if np.ptp(tau[side]) >= SHORTEST_CURVED_S and side.sum() >= 8:
            drags.append(len(columns))
            columns.append(np.where(side, tau**2 + ((bins.each**2 - 1) / 12.0) * bins.step_s**2, 0.0))
    return np.stack(columns, axis=1), tuple(drags)


def find_knocks(rest_m: Floats, into: Mask, white_m: float) -> tuple[list[tuple[int, int]], bool]:
    """Return (start, stop) of the bins of every knock, and whether one fills a flight and could not be left out.

    ``rest_m`` (n,) is the residual of the flights' parabolas, in bins.  A knock is a stretch in which the power of
    second differences, which suppress slow motion, is far above that of the quiet part of both flights.
    """
    power = np.zeros(rest_m.size)
    for side in (into, ~into):
        index = np.flatnonzero(side)
        if index.size >= WINDOW:
            second = np.zeros(index.size)
            second[1:-1] = np.diff(rest_m[index], 2) ** 2
            second[0], second[-1] = second[1], second[-2]
            power[index] = np.convolve(second, np.ones(WINDOW) / WINDOW, mode="same")
    quiet = max(float(np.quantile(power, 0.35)), 6.0 * white_m**2)
    loud = power > LOUD * quiet
    if not loud.any() or loud.mean() > 0.5:
        return [], bool(loud.any())
    found: list[tuple[int, int]] = []
    kept = False
    for side in (into, ~into):
        index = np.flatnonzero(side)
        hot = np.flatnonzero(loud[index])
        if hot.size == 0:
            continue
        start, stop = int(hot[0]), int(hot[-1]) + 1
        ringing = power[index] > FADED * quiet
        while stop < index.size and ringing[stop]:
            stop += 1
        start, stop = max(0, start - WINDOW), min(index.size, stop + WINDOW)
        if start < MIN_LEFT and index.size - stop >= MIN_LEFT:
            start = 0  # the part before the knock is too short for a line
        if index.size - (stop - start) < MIN_LEFT:
            kept = True
            continue
        found.append((int(index[start]), int(index[stop - 1]) + 1))
    return found, kept
