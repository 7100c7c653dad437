"""Both free flights at once: their parabolas, the lines that machines draw through them, and the floor they stand on.

The displacement of the flights is averaged over some tenths of a millisecond, far above anything that shakes; what is
left is small enough that every covariance can be written down and solved as it is.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve

from analysis.disturbance import VibrationLine
from analysis.motion import Motion
from analysis.quantity import Quantity
from analysis.reading.flights import SHORTEST_CURVED_S, Flight
from analysis.reading.floor import Floor, Octaves, Sight, Weighing, waves_of
from analysis.reading.knocks import find_knocks

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

BIN_S = 0.5e-3  # at least: a line of 900 Hz still passes
MOST_BINS = 110
FEWEST_BINS = 4  # of one flight, for a straight line with something left over
FEWEST_FOR_LINES = 24  # of both flights
MOST_LINES = 8
LINE_WORTH = 16.0  # of log-likelihood that a line's three numbers must bring, floors weighed anew
LOWEST_LINES = 0.5  # of a period, at least, that the flights with the contact between them must hold ... of the shorter
STEADY = 30.0  # of chi^2 that an amplitude of its own in each flight may bring
REFINEMENTS = 3


@dataclass(frozen=True, slots=True)
class Quiet:
    """What the flights show: each with the covariance between both, the lines with theirs, and the floor.

    ``outgoing`` is None where there is no flight after the contact; ``velocity_covariance`` is that of the two
    velocities at their own ``time_zero_s``.  ``plain`` are the stds in m/s of both velocities with white noise alone.
    """

    incoming: Flight
    outgoing: Flight | None
    velocity_covariance: float
    lines: tuple[VibrationLine, ...]
    floor: Floor
    knocks_s: tuple[tuple[float, float], ...]
    plain: tuple[float, float]
    strengths: Floats  # the likeliest, as ``Sight.weigh`` begins with
    knocks_kept: bool = False  # a knock filled a flight: it could not be left out


@dataclass(frozen=True, slots=True)
class _Bins:
    time_s: Floats
    value_m: Floats
    into: Mask  # of the incoming flight
    each: int  # samples a bin
    step_s: float  # a sample
    std_m: float  # white noise of a bin

    @property
    def resolution_hz(self) -> float:
        """Get how far apart two lines must be to be told apart."""
        return 1.0 / (float(np.ptp(self.time_s)) + self.each * self.step_s)

    @property
    def middle_s(self) -> float:
        """Get the time about which waves are written."""
        return 0.5 * float(self.time_s[0] + self.time_s[-1])


@dataclass(frozen=True, slots=True)
class _Wave:
    frequency_hz: float
    cosine_m: float
    sine_m: float


def read_flights(
    motion: Motion, into: tuple[int, int], out: tuple[int, int] | None, before: Quiet | None = None
) -> Quiet | None:
    """Read the flights between sample pairs (first, last), inclusive, up to which the contact's edges allow.

    The velocities hold at the edge that faces the contact.  ``before`` is what nearly the same flights have shown: no
    lines but its own are looked for.  None where the incoming flight is too short for a line.  Cost: about 10 ms, and
    as much again a line.
    """
    bins = _binned(motion, into, out)
    if bins.into.sum() < FEWEST_BINS:
        return None
    if out is not None and (~bins.into).sum() < FEWEST_BINS:
        out, bins = None, _kept(bins, bins.into)
    zeros = (float(motion.time_s[into[1]]), float(motion.time_s[out[0]]) if out is not None else 0.0)
    knocked, whole = find_knocks(bins.time_s, _without_flights(bins, zeros), bins.into, bins.std_m)
    knocks = tuple((float(bins.time_s[a]), float(bins.time_s[b - 1]) + bins.each * bins.step_s) for a, b in knocked)
    keep = np.ones(bins.time_s.size, dtype=np.bool_)
    for a, b in knocked:
        keep[a:b] = False
    bins = _kept(bins, keep)
    polynomials, drags = _polynomials(bins, zeros)
    straight, line = _straight_lines(bins, polynomials, drags)
    sight = _sight(replace(bins, value_m=bins.value_m - line), drags)
    waves = [_wave(bins, line) for line in before.lines] if before is not None else []
    start = before.strengths if before is not None and before.strengths.size == sight.unknowns else None
    weighing = sight.weigh(_design(bins, waves, polynomials), start)
    if waves:
        waves = _refined(bins, sight, waves, polynomials, weighing.best)
    if before is None and bins.time_s.size >= FEWEST_FOR_LINES:
        while len(waves) < MOST_LINES and polynomials.shape[1] + 3 * len(waves) + 12 < bins.time_s.size:
            more = _with_one_more(bins, sight, waves, polynomials, weighing)
            if more is None:
                break
            waves, weighing = more
    design = _design(bins, waves, polynomials)
    solution, covariance = sight.solve(weighing, design)
    solution[: straight.size] += straight
    white = bins.std_m * np.sqrt(bins.each)
    parts = tuple((weight, sight.powers(at)) for weight, at in weighing.parts)
    floor = Floor(sight.octaves, parts, white, motion.sample_rate_hz)
    flights = _flights(bins, zeros, solution, covariance, white, into, out)
    degree = flights[0].coefficients.size
    plain = np.linalg.inv(polynomials.T @ polynomials) * bins.std_m**2
    return Quiet(
        incoming=flights[0],
        outgoing=flights[1],
        velocity_covariance=float(covariance[1, degree + 1]) if out is not None else 0.0,
        lines=tuple(
            _line(wave, covariance[i : i + 3, i : i + 3], _bend(bins, wave)[1], bins.middle_s)
            for i, wave in zip(range(polynomials.shape[1], design.shape[1], 3), waves, strict=True)
        ),
        floor=floor,
        knocks_s=knocks,
        plain=(float(np.sqrt(plain[1, 1])), float(np.sqrt(plain[degree + 1, degree + 1])) if out is not None else 0.0),
        strengths=weighing.best,
        knocks_kept=whole,
    )


def without_lines(motion: Motion, lines: tuple[VibrationLine, ...]) -> Motion:
    """Return the motion with the lines taken off displacement, velocity, acceleration and force."""
    if not lines:
        return motion
    x, v, a = motion.displacement_m.copy(), motion.velocity_m_per_s.copy(), motion.acceleration_m_per_s2.copy()
    force = motion.force_n.copy()
    for line in lines:
        omega = 2 * np.pi * line.frequency_hz.value
        angle = omega * motion.time_s + line.phase_rad
        sine, cosine = line.amplitude_m.value * np.sin(angle), line.amplitude_m.value * np.cos(angle)
        x -= sine
        v -= omega * cosine
        a += omega**2 * sine
        force += motion.moving_mass_kg * omega**2 * sine
    return replace(motion, displacement_m=x, velocity_m_per_s=v, acceleration_m_per_s2=a, force_n=force)


def _binned(motion: Motion, into: tuple[int, int], out: tuple[int, int] | None) -> _Bins:
    """Return the means of both flights, bins of one length counted from the edges outwards; holes are left out."""
    step = 1.0 / motion.sample_rate_hz
    total = into[1] - into[0] + 1 + (out[1] - out[0] + 1 if out is not None else 0)
    each = max(1, round(BIN_S / step), -(-total // MOST_BINS))
    pieces = []
    for first, last, backwards in ((*into, True), *(((*out, False),) if out is not None else ())):
        count = (last - first + 1) // each
        start = last + 1 - count * each if backwards else first
        pieces.append((start, count))
    time, value, side, thirds = [], [], [], []
    for number, (start, count) in enumerate(pieces):
        stretch = slice(start, start + count * each)
        x = motion.displacement_m[stretch]
        rows = x.reshape(count, each)
        whole = np.isfinite(rows).all(axis=1) & motion.valid[stretch].reshape(count, each).all(axis=1)
        time.append(motion.time_s[stretch].reshape(count, each).mean(axis=1)[whole])
        value.append(rows[whole].mean(axis=1))
        side.append(np.full(int(whole.sum()), number == 0))
        third = np.diff(x, 3)
        thirds.append(third[np.isfinite(third)])
    third = np.abs(np.concatenate(thirds))
    stated = float(np.nanmedian(motion.displacement_std_m))
    white = float(1.4826 * np.median(third) / np.sqrt(20.0)) if third.size > 30 else stated
    return _Bins(
        np.concatenate(time), np.concatenate(value), np.concatenate(side), each, step,
        max(white, 1e-15) / np.sqrt(each),
    )  # fmt: skip


def _kept(bins: _Bins, keep: Mask) -> _Bins:
    return replace(bins, time_s=bins.time_s[keep], value_m=bins.value_m[keep], into=bins.into[keep])


def _straight_lines(bins: _Bins, polynomials: Floats, drags: tuple[int, ...]) -> tuple[Floats, Floats]:
    """Return coefficients of straight flights, (p,), and the lines, (n,).

    They are ten million times the noise: taken off first, so that sums of squares keep their digits.
    """
    free = np.setdiff1d(np.arange(polynomials.shape[1]), drags)
    scale = np.abs(polynomials).max(axis=0)
    coefficients = np.zeros(polynomials.shape[1])
    solution, *_ = np.linalg.lstsq(polynomials[:, free] / scale[free], bins.value_m, rcond=None)
    coefficients[free] = solution / scale[free]
    return coefficients, np.asarray(polynomials @ coefficients)


def _sight(bins: _Bins, drags: tuple[int, ...]) -> Sight:
    octaves = Octaves.of(bins.time_s, bins.each * bins.step_s)
    waves = waves_of(bins.time_s - bins.middle_s, bins.each, bins.step_s, octaves.frequency_hz)
    return Sight(bins.value_m, bins.std_m, drags, octaves, np.hstack(waves))


def _polynomials(bins: _Bins, zeros: tuple[float, float]) -> tuple[Floats, tuple[int, ...]]:
    """Return the columns of both flights' polynomials about their zeros, in SI units, and which are accelerations."""
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


def _without_flights(bins: _Bins, zeros: tuple[float, float]) -> Floats:
    design, _ = _polynomials(bins, zeros)
    scale = np.abs(design).max(axis=0)
    solution, *_ = np.linalg.lstsq(design / scale, bins.value_m, rcond=None)
    return np.asarray(bins.value_m - design / scale @ solution)


def _waves_of(bins: _Bins, frequency_hz: Floats) -> tuple[Floats, Floats]:
    return waves_of(bins.time_s - bins.middle_s, bins.each, bins.step_s, frequency_hz)


def _columns(bins: _Bins, wave: _Wave) -> Floats:
    """Return the columns of cosine, sine and, about this wave, frequency: (n, 3), each of the order of one."""
    bend, size = _bend(bins, wave)
    return np.column_stack([*_waves_of(bins, np.array([wave.frequency_hz])), bend / size])


def _bend(bins: _Bins, wave: _Wave) -> tuple[Floats, float]:
    """Return how a wave changes with its frequency, (n, 1) in m/Hz, and how large that is."""
    cosine, sine = _waves_of(bins, np.array([wave.frequency_hz]))
    bend = 2 * np.pi * (bins.time_s - bins.middle_s)[:, None] * (wave.sine_m * cosine - wave.cosine_m * sine)
    return bend, max(float(np.abs(bend).max()), 1e-300)


def _with_one_more(
    bins: _Bins, sight: Sight, waves: list[_Wave], polynomials: Floats, weighing: Weighing
) -> tuple[list[_Wave], Weighing] | None:
    """Return the waves with one more, and the floors weighed anew; None where none is worth its three numbers.

    A line is looked for above the likeliest floor, then above one that nowhere rises towards higher frequencies: a
    strong one has been taken for floor.
    """
    design = _design(bins, waves, polynomials)
    calm = np.concatenate([np.minimum.accumulate(weighing.best[:-1]), weighing.best[-1:]])
    for at in (weighing.best, calm):
        found = _strongest(bins, sight, at, design)
        if found is None:
            continue
        tried = _refined(bins, sight, [*waves, found], polynomials, at)
        weighed = sight.weigh(_design(bins, tried, polynomials), at)
        if weighed.worth - weighing.worth > LINE_WORTH and _is_steady(bins, sight, tried, polynomials, weighed.best):
            tried = _refined(bins, sight, tried, polynomials, weighed.best)
            return tried, weighed
    return None


def _is_steady(bins: _Bins, sight: Sight, waves: list[_Wave], polynomials: Floats, at: Floats) -> bool:
    """Tell whether the last wave runs through both flights alike, and stands apart from the others.

    What rings in one flight alone was struck by the impact: it is the block's or the plate's, and not to be taken off.
    """
    *others, last = waves
    if any(abs(last.frequency_hz - wave.frequency_hz) < 0.7 * bins.resolution_hz for wave in others):
        return False
    if bins.into.all():
        return True
    design = _design(bins, waves, polynomials)
    apart = np.where(bins.into, 1.0, 0.0)[:, None] * _columns(bins, last)[:, :2]
    without, within = sight.likelihood(at, design), sight.likelihood(at, np.hstack([design, apart]))
    return 2.0 * (within - without) < STEADY


def _design(bins: _Bins, waves: list[_Wave], polynomials: Floats) -> Floats:
    return np.column_stack([polynomials, *(_columns(bins, wave) for wave in waves)])


def _strongest(bins: _Bins, sight: Sight, at: Floats, design: Floats) -> _Wave | None:
    """Return the sine that explains most beside the design above a floor, None where it is nothing."""
    shorter = min(float(np.ptp(bins.time_s[side])) for side in (bins.into, ~bins.into) if side.any())
    lowest, highest = LOWEST_LINES / max(shorter, 1e-12), 0.45 / (bins.each * bins.step_s)
    if highest <= lowest:
        return None
    frequency = np.arange(lowest, highest, 0.2 * bins.resolution_hz)
    factor = sight.factor(at)
    design = design / np.abs(design).max(axis=0)
    across = cho_solve(factor, design, check_finite=False)
    inner = np.linalg.inv(design.T @ across)
    cosine, sine = _waves_of(bins, frequency)

    def project(columns: Floats) -> Floats:
        return np.asarray(cho_solve(factor, columns, check_finite=False) - across @ (inner @ (across.T @ columns)))

    rest = project(sight.value_m / sight.white_m)
    pc, ps = project(cosine), project(sine)
    cc, ss, cs = (cosine * pc).sum(axis=0), (sine * ps).sum(axis=0), (cosine * ps).sum(axis=0)
    c, s = cosine.T @ rest, sine.T @ rest
    determinant = cc * ss - cs**2
    sure = determinant > 1e-6 * (cc + ss) ** 2
    determinant = np.where(sure, determinant, 1.0)
    drop = np.where(sure, (ss * c**2 - 2 * cs * c * s + cc * s**2) / determinant, 0.0)
    best = int(drop.argmax())
    if drop[best] < LINE_WORTH:
        return None
    a = (ss[best] * c[best] - cs[best] * s[best]) / determinant[best]
    b = (cc[best] * s[best] - cs[best] * c[best]) / determinant[best]
    return _Wave(float(frequency[best]), float(a) * bins.std_m, float(b) * bins.std_m)


def _refined(bins: _Bins, sight: Sight, waves: list[_Wave], polynomials: Floats, at: Floats) -> list[_Wave]:
    """Return all waves fitted together with their frequencies above one floor (Gauss-Newton)."""
    known = Weighing(((1.0, at),), at, 0.0)
    most = 0.2 * bins.resolution_hz
    for _ in range(REFINEMENTS):
        solution, _ = sight.solve(known, _design(bins, waves, polynomials))
        moved = []
        for k, wave in enumerate(waves):
            cosine, sine, bend = solution[polynomials.shape[1] + 3 * k :][:3]
            shift = float(np.clip(bend / _bend(bins, wave)[1], -most, most))
            moved.append(_Wave(wave.frequency_hz + shift, float(cosine), float(sine)))
        waves = moved
    return waves


def _flights(
    bins: _Bins, zeros: tuple[float, float], solution: Floats, covariance: Floats, white_m: float,
    into: tuple[int, int], out: tuple[int, int] | None,
) -> tuple[Flight, Flight | None]:  # fmt: skip
    made: list[Flight] = []
    place = 0
    for side, zero, ends in ((bins.into, zeros[0], into), (~bins.into, zeros[1], out)):
        if ends is None:
            continue
        tau = bins.time_s[side]
        size = 3 if np.ptp(tau) >= SHORTEST_CURVED_S and side.sum() >= 8 else 2
        part = slice(place, place + size)
        made.append(Flight(zero, solution[part], covariance[part, part], white_m, *ends))
        place += size
    return made[0], made[1] if len(made) > 1 else None


def _wave(bins: _Bins, line: VibrationLine) -> _Wave:
    turn = line.phase_rad + 2 * np.pi * line.frequency_hz.value * bins.middle_s
    size = line.amplitude_m.value
    return _Wave(line.frequency_hz.value, float(size * np.sin(turn)), float(size * np.cos(turn)))


def _line(wave: _Wave, covariance: Floats, bend_size: float, middle_s: float) -> VibrationLine:
    amplitude = float(np.hypot(wave.cosine_m, wave.sine_m))
    along = np.array([wave.cosine_m, wave.sine_m]) / max(amplitude, 1e-300)
    spread = float(np.sqrt(along @ covariance[:2, :2] @ along))
    phase = float(np.arctan2(wave.cosine_m, wave.sine_m) - 2 * np.pi * wave.frequency_hz * middle_s)
    return VibrationLine(
        Quantity(wave.frequency_hz, float(np.sqrt(covariance[2, 2])) / bend_size, "both free flights"),
        Quantity(amplitude, spread, "both free flights"),
        float(np.remainder(phase, 2 * np.pi)),
    )
