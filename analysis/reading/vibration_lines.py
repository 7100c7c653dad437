"""Find the steady sines of machines in both free flights, fit them jointly with the floor, and subtract them."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.compiled import solve_triangle
from analysis.reading.flight import Bins
from analysis.reading.floor_spectrum import FlightObservation, FloorEstimate
from analysis.reading.restricted_likelihood import Likelihood
from analysis.shot import Floats, Motion, Quantity, VibrationLine

LINE_WORTH = 16.0  # log-likelihood gain required of a line's three parameters, with the floor re-estimated
LOWEST_LINES = 0.5  # least periods of a line in the shorter flight
STEADY = 30.0  # largest gain in chi^2 by separate amplitudes in the two flights
REFINEMENTS = 3


@dataclass(frozen=True, slots=True)
class Wave:
    frequency_hz: float
    cosine_m: float
    sine_m: float


def without_lines(motion: Motion, lines: tuple[VibrationLine, ...]) -> Motion:
    """Return the motion with the lines subtracted from displacement, velocity, acceleration and force."""
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


def _columns(bins: Bins, wave: Wave) -> Floats:
    """Return the columns of cosine, sine and frequency derivative about this wave: (n, 3), each of the order of one."""
    bend, size = frequency_derivative(bins, wave)
    return np.column_stack([*bins.waves(np.array([wave.frequency_hz])), bend / size])


def frequency_derivative(bins: Bins, wave: Wave) -> tuple[Floats, float]:
    """Return the derivative of a wave by its frequency, (n, 1) in m/Hz, and the largest of its absolute values."""
    cosine, sine = bins.waves(np.array([wave.frequency_hz]))
    bend = 2 * np.pi * (bins.time_s - bins.middle_s)[:, None] * (wave.sine_m * cosine - wave.cosine_m * sine)
    return bend, max(float(np.abs(bend).max()), 1e-300)


def add_line(
    bins: Bins, observation: FlightObservation, waves: list[Wave], polynomials: Floats, estimate: FloorEstimate
) -> tuple[list[Wave], FloorEstimate] | None:
    """Return the waves with one more, and the floor re-estimated; None if no line is worth its three parameters.

    A line is searched above the likeliest floor, then above one that does not rise towards higher frequencies, since
    the floor estimate may have absorbed a strong line.
    """
    design = design_matrix(bins, waves, polynomials)
    white, *octaves, drag = estimate.best
    likelihood, frequency = observation.likelihood(design), _frequencies(bins)
    sines = observation.padded(np.hstack(bins.waves(frequency)))
    for at in (estimate.best, np.array([white, *np.minimum.accumulate(octaves), drag])):
        line = _strongest_line(likelihood.at(at), frequency, sines, bins.std_m)
        if line is None:
            continue
        more = refined(bins, observation, [*waves, line], polynomials, at)
        weighed = observation.estimate_floor(design_matrix(bins, more, polynomials), (at, estimate.best))
        pays = weighed.worth - estimate.worth > LINE_WORTH
        if pays and _is_steady(bins, observation, more, polynomials, weighed.best):
            finer = refined(bins, observation, more, polynomials, weighed.best)
            if _are_resolved(bins, finer):  # two lines that have met are not determined apart
                return finer, weighed
    return None


def _are_resolved(bins: Bins, waves: list[Wave]) -> bool:
    """Return whether all frequencies differ by most of the resolution of the flights."""
    frequency_hz = np.sort([wave.frequency_hz for wave in waves])
    return bool(np.all(np.diff(frequency_hz) >= 0.7 * bins.resolution_hz))


def _is_steady(bins: Bins, observation: FlightObservation, waves: list[Wave], polynomials: Floats, at: Floats) -> bool:
    """Return whether the last wave is the same in both flights, and resolved from the other waves.

    A vibration in one flight only was excited by the impact: it belongs to block or plate, not to a machine.
    """
    if not _are_resolved(bins, waves):
        return False
    if bins.into.all():
        return True
    design = design_matrix(bins, waves, polynomials)
    apart = np.where(bins.into, 1.0, 0.0)[:, None] * _columns(bins, waves[-1])[:, :2]
    without, within = (observation.likelihood(each).at(at) for each in (design, np.hstack([design, apart])))
    return 2.0 * (within.profile - without.profile) < STEADY


def design_matrix(bins: Bins, waves: list[Wave], polynomials: Floats) -> Floats:
    return np.column_stack([polynomials, *(_columns(bins, wave) for wave in waves)])


def _frequencies(bins: Bins) -> Floats:
    """Return the frequencies, shape (f,) in Hz, at which a line is searched; none if both flights are too short."""
    shorter = min(float(np.ptp(bins.time_s[side])) for side in (bins.into, ~bins.into) if side.any())
    lowest, highest = LOWEST_LINES / max(shorter, 1e-12), 0.45 / (bins.each * bins.step_s)
    return np.arange(lowest, highest, 0.2 * bins.resolution_hz)


def _strongest_line(here: Likelihood, frequency_hz: Floats, waves: Floats, white_m: float) -> Wave | None:
    """Return the sine that explains most of the residual above a floor; None if it gains less than LINE_WORTH.

    ``waves``, shape (r, 2 f), are cosines and sines of ``frequency_hz``, shape (f,), at the rows of ``here``.
    """
    if not frequency_hz.size:
        return None
    (white,) = here.whitened
    regressors = white.half[:, 1:]

    def left_of(rows: Floats) -> Floats:
        return np.asarray(rows - regressors @ (here.covariance @ (regressors.T @ rows)))

    rest = left_of(white.half[:, 0])
    cosine, sine = np.hsplit(left_of(solve_triangle(white.root, waves, lower=True)), 2)
    cc, ss, cs = (cosine**2).sum(axis=0), (sine**2).sum(axis=0), (cosine * sine).sum(axis=0)
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
    return Wave(float(frequency_hz[best]), float(a) * white_m, float(b) * white_m)


def refined(
    bins: Bins, observation: FlightObservation, waves: list[Wave], polynomials: Floats, at: Floats
) -> list[Wave]:
    """Return all waves fitted jointly, including frequencies, above one floor (Gauss-Newton)."""
    most = 0.2 * bins.resolution_hz
    for _ in range(REFINEMENTS):
        solution, _ = observation.solve(np.ones(1), at[None], design_matrix(bins, waves, polynomials))
        moved = []
        for k, wave in enumerate(waves):
            cosine, sine, bend = solution[polynomials.shape[1] + 3 * k :][:3]
            shift = float(np.clip(bend / frequency_derivative(bins, wave)[1], -most, most))
            moved.append(Wave(wave.frequency_hz + shift, float(cosine), float(sine)))
        waves = moved
    return waves


def wave_of(bins: Bins, line: VibrationLine) -> Wave:
    turn = line.phase_rad + 2 * np.pi * line.frequency_hz.value * bins.middle_s
    size = line.amplitude_m.value
    return Wave(line.frequency_hz.value, float(size * np.sin(turn)), float(size * np.cos(turn)))


def line_of(wave: Wave, covariance: Floats, bend_size: float, middle_s: float) -> VibrationLine:
    amplitude = float(np.hypot(wave.cosine_m, wave.sine_m))
    along = np.array([wave.cosine_m, wave.sine_m]) / max(amplitude, 1e-300)
    spread = float(np.sqrt(along @ covariance[:2, :2] @ along))
    phase = float(np.arctan2(wave.cosine_m, wave.sine_m) - 2 * np.pi * wave.frequency_hz * middle_s)
    return VibrationLine(
        Quantity(wave.frequency_hz, float(np.sqrt(covariance[2, 2])) / bend_size, "both free flights"),
        Quantity(amplitude, spread, "both free flights"),
        float(np.remainder(phase, 2 * np.pi)),
    )
