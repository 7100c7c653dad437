"""Estimate a displacement's noise from quiet flight: white noise and one wandering part.

Both are estimated by the Whittle likelihood of the flights' periodograms (J. R. Stat. Soc. B 15, 1953), which uses no
model of the collision.  A fit whose residual exceeds this noise therefore lacks an effect.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.polynomial.legendre import legvander

from analysis.inference.model.samples import Samples
from analysis.inference.noise.floor import Floor, white_by_differences, white_floor
from analysis.inference.noise.kalman import Mask
from analysis.inference.noise.site import STILL_FRAME, Site
from analysis.shot import Floats
from analysis.signal import MIN_NOISE_M, stretches

Spectrum = tuple[Floats, Floats]  # angles, powers per sample
_FEWEST = 24  # fewest samples of a flight for a noise estimate
_TREND = 2  # degree of the subtracted polynomial: the flight, and drag too slow to distinguish from it
_CORRELATION_TIMES_S = tuple(np.geomspace(1e-3, 30e-3, 7))  # corner frequencies between 160 and 5 Hz
_WEIGHT = 0.5  # degrees of freedom per bin: a Hann taper correlates about two neighbouring bins
_PAYS = 4.0  # log-likelihood gain required of a wandering part, which has two parameters
_ALLOWED = 2.0  # log-likelihood below the best, up to which flights allow a noise: two standard deviations
_AS_LIKELY = 1.0  # log-likelihood below the best within which the longest correlation time is chosen
_MIN_WHITE = 0.1  # least white noise, as a fraction of the density at the highest frequencies
_LINE = 16.0  # power of a line over the noise; chance exceeds it with probability e^-16 per bin
_BESIDE_A_LINE = 2.0  # bins left out on either side of a line, where subtracting it takes noise away as well
_NO_LINES = np.empty(0)
_QUICK = 0.1 * np.pi  # radians per sample, above which a wandering part is negligible


def noise_of_flights(shots: Sequence[Samples], site: Site = STILL_FRAME) -> tuple[Floor, bool]:
    """Return the noise estimated from the quiet flights of shots, and whether these are long enough for an estimate.

    On a moving frame (``site``) only frequencies above the frame's motion are used, and the frame's spectrum is kept as
    read.  If flights are too short to show the corner frequency of a wandering part, the longest correlation time
    compatible with them is chosen, which errs towards larger uncertainties.  Outgoing flights are used if they are as
    quiet as the incoming ones, or if only they are long enough to show a wandering part and show no line: a line may be
    an effect.  If no flight is long enough, the noise is white, from third differences.
    """
    spacing_s = shots[0].spacing_s
    incoming, outgoing = _spectra_of_flights(shots, site)
    strengths = (0.0,) * site.bands
    if not incoming and not outgoing:
        return replace(white_floor(_by_differences(shots), spacing_s), site=strengths), False
    noise = likeliest_noise(incoming or outgoing, spacing_s)
    if incoming and outgoing:
        noise = _with_outgoing(noise, incoming, outgoing, spacing_s)
    return replace(noise, site=strengths), True


def flights_allow(noise: Floor, shots: Sequence[Samples], site: Site) -> bool:
    """Return whether the quiet flights are nearly as likely under white noise and wander of ``noise`` as under any.

    The frequencies and flights are those of ``noise_of_flights``.  False without a flight that is long enough.
    """
    incoming, outgoing = _spectra_of_flights(shots, site)
    if not incoming and not outgoing:
        return False
    angle, power = (np.concatenate(part) for part in zip(*incoming, *outgoing, strict=True))

    best = likeliest_noise([*incoming, *outgoing], noise.spacing_s)
    given, least = (_unlikelihood(power, _density(one, angle)) for one in (noise, best))
    return given - least < _ALLOWED


def _spectra_of_flights(shots: Sequence[Samples], site: Site) -> tuple[list[Spectrum], list[Spectrum]]:
    """Return the spectra of the incoming and of the outgoing flights."""
    spacing_s = shots[0].spacing_s
    incoming = _spectra([_flight(shot, shot.course.quiet_in) for shot in shots], spacing_s, site)
    return incoming, _spectra([_flight(shot, shot.course.quiet_out) for shot in shots], spacing_s, site)


def _spectra(flights: Sequence[Floats], spacing_s: float, site: Site) -> list[Spectrum]:
    """Return the spectra of the flights that are long enough, above the motion and without the lines of the frame."""
    turn = 2 * np.pi * spacing_s
    frequency_hz, random = site.vibration.frequency_hz, site.vibration.random
    above, lines = turn * float(frequency_hz[random].max(initial=0.0)), turn * frequency_hz[~random]
    spectra = [spectrum_of(flight, above, lines) for flight in flights if flight.size >= _FEWEST]
    return [spectrum for spectrum in spectra if spectrum[0].size]


def _flight(shot: Samples, part: slice) -> Floats:
    """Return the longest gapless stretch of averaged samples, in m, within ``part`` of the motion's samples."""
    first, last = -(-part.start // shot.factor), part.stop // shot.factor
    begin, end = max(stretches(shot.valid[first:last]), key=lambda one: one[1] - one[0], default=(0, 0))
    return np.asarray(shot.displacement_m[first:last][begin:end] / shot.weight)


def _by_differences(shots: Sequence[Samples]) -> float:
    series = [shot.displacement_m / shot.weight for shot in shots]
    return max(white_by_differences(series, [shot.valid for shot in shots]), MIN_NOISE_M)


def _with_outgoing(noise: Floor, incoming: list[Spectrum], outgoing: list[Spectrum], spacing_s: float) -> Floor:
    """Return the noise of incoming and outgoing flights together if these agree, else of the incoming ones alone."""
    both = likeliest_noise([*incoming, *outgoing], spacing_s)
    angle, power = (np.concatenate(part) for part in zip(*outgoing, strict=True))
    before = np.concatenate([angles for angles, _ in incoming])
    ratio, slow = power / _density(noise, angle), angle < _QUICK
    if not _power_not_above(ratio, ~slow, before >= _QUICK):
        return noise
    if _power_not_above(ratio, slow, before < _QUICK):
        return both
    wanders_there = noise.rms_m[0] == 0.0 and both.rms_m[0] > 0.0
    return both if wanders_there and float(np.max(power / _density(both, angle))) < _LINE else noise


def _power_not_above(ratio: Floats, part: Mask, of_noise: Mask) -> bool:
    """Return whether the power in ``part`` exceeds the noise by no more than three standard errors."""
    bins = int(part.sum())
    if bins == 0:
        return True
    return float(np.mean(ratio[part])) < 1 + 3 * math.sqrt(2 / bins + 2 / max(4, int(of_noise.sum())))


def spectrum_of(values: Floats, above: float = 0.0, lines: Floats = _NO_LINES) -> Spectrum:
    """Return (angles, power per sample) of a flight, without its polynomial, known ``lines`` and the bins of both.

    If ``above`` is positive, bins below this angle are left out, and the spectrum is that of second differences divided
    by their response, so that slower motion does not leak into it.  Lines are subtracted, those within a bin as one:
    in a flight of 12 ms a line and what its taper leaks would otherwise take all bins of 300 Hz on either side.
    """
    moved = values if above == 0.0 else np.diff(values, 2)
    taper = np.sin(np.pi * (np.arange(moved.size) + 0.5) / moved.size) ** 2
    degree = _TREND if above == 0.0 else 0
    columns = [legvander(np.linspace(-1.0, 1.0, moved.size), degree)]
    sorted_lines = np.sort(lines) if above > 0.0 else _NO_LINES
    for line in sorted_lines[np.diff(sorted_lines, prepend=-np.inf) > 2 * np.pi / moved.size]:
        turned = line * np.arange(moved.size)
        sine = np.column_stack([np.cos(turned), np.sin(turned)])
        columns.append(np.hstack([sine, sine * np.linspace(-1.0, 1.0, moved.size)[:, None]]))  # near this frequency
    known = np.column_stack(columns)
    left = moved - known @ np.linalg.lstsq(known, moved, rcond=None)[0]
    power = np.abs(np.fft.rfft(left * taper)) ** 2 / np.sum(taper**2)
    angle = 2 * np.pi * np.arange(power.size) / moved.size
    inside = slice(degree + 1, power.size - 1)
    angle, power = angle[inside], power[inside]
    if above > 0.0:
        kept = angle >= above
        for line in lines:
            kept &= np.abs(angle - line) > _BESIDE_A_LINE * 2 * np.pi / moved.size
        angle, power = angle[kept], power[kept] / (2 * np.sin(angle[kept] / 2)) ** 4
    return angle, power


def likeliest_noise(spectra: Sequence[Spectrum], spacing_s: float) -> Floor:
    """Return the likeliest white noise, with a wandering part if it raises the Whittle log-likelihood by _PAYS."""
    angle, power = (np.concatenate(part) for part in zip(*spectra, strict=True))
    power = np.maximum(power, MIN_NOISE_M**2)
    flat = float(np.mean(power))
    alone = _unlikelihood(power, np.full(power.size, flat))
    tried: list[tuple[float, float, float, float]] = []
    for tau_s in _CORRELATION_TIMES_S:
        shape = _wandering(angle, 1.0, math.exp(-spacing_s / tau_s))
        white, floor = _two_levels(power, shape)
        tried.append((_unlikelihood(power, white + floor * shape), tau_s, white, floor))
    least = min(t[0] for t in tried)
    if alone - least < _PAYS:
        return white_floor(math.sqrt(flat), spacing_s)
    _, tau_s, white, floor = [t for t in tried if t[0] < least + _AS_LIKELY][-1]
    quickest = float(_wandering(np.array([np.pi]), floor, math.exp(-spacing_s / tau_s))[0])
    white = max(white, _MIN_WHITE * (white + quickest))
    return Floor(math.sqrt(white), (math.sqrt(floor), 0.0), (float(tau_s), 1e-2), spacing_s)


def _unlikelihood(power: Floats, density: Floats) -> float:
    """Return the negative Whittle log-likelihood of powers under a noise with these spectral densities."""
    return _WEIGHT * float(np.sum(np.log(density) + power / density))


def _density(noise: Floor, angle: Floats) -> Floats:
    """Return the spectral density of a noise at angles per sample, as power per sample."""
    parts = (_wandering(angle, rms_m**2, math.exp(-noise.spacing_s / tau_s)) for rms_m, tau_s in noise.wander)
    return np.asarray(noise.white_m**2 + sum(parts, np.zeros(angle.size)))


def _wandering(angle: Floats, variance: float, memory: float) -> Floats:
    return np.asarray(variance * (1 - memory**2) / (1 - 2 * memory * np.cos(angle) + memory**2))


@njit(cache=True, nogil=True, error_model="numpy")
def _two_levels(power, shape):  # type: ignore[no-untyped-def]
    """Return the positive levels (a, b) of greatest Whittle likelihood for a density a + b shape.

    Fisher scoring on the logarithms keeps both positive and is stable from any start.  About 5 ns per bin and step.
    """
    count = power.size
    a = np.mean(power[count // 2 :]) + 1e-300
    b = max(np.sum(power) / np.sum(shape) * 0.5, 1e-6 * a / np.mean(shape))
    lowest, highest = np.min(shape), np.max(shape)
    for _ in range(60):
        aa, ab, bb, score_a, score_b = 1e-9, 0.0, 1e-9, 0.0, 0.0
        for i in range(count):
            model = a + b * shape[i]
            first, excess = a / model, power[i] / model - 1.0
            second = 1.0 - first
            aa, ab, bb = aa + first * first, ab + first * second, bb + second * second
            score_a, score_b = score_a + first * excess, score_b + second * excess
        determinant = aa * bb - ab * ab
        step_a = min(max((bb * score_a - ab * score_b) / determinant, -1.0), 1.0)
        step_b = min(max((aa * score_b - ab * score_a) / determinant, -1.0), 1.0)
        a, b = a * math.exp(step_a), b * math.exp(step_b)
        a_ends = abs(step_a) < 1e-6 or (step_a < 0.0 and a < 1e-9 * b * lowest)  # converged, or vanishing beside b
        b_ends = abs(step_b) < 1e-6 or (step_b < 0.0 and b * highest < 1e-9 * a)
        if a_ends and b_ends:
            break
    return a, b
