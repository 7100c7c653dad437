"""Choose the bandwidth in which force and motion of a driven record are compared, from the record itself."""

import itertools
import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from analysis.shot import AnalysisError, Floats, Motion
from analysis.signal import MAX_BANDWIDTH_SHARE, derivative_filters, derivatives, stretches

CLEAR = 100.0  # signal-to-noise power ratio at the band edge: 1 % noise in a regressor biases its coefficient by 1 %
BANDS_AN_OCTAVE = 4
MIN_FILTERS = 60.0  # least length of a record in units of 1 / bandwidth; the filter takes ten of them at each end
_PIECES = 6  # number of segments of the record for its spectrum


def bandwidth_of(motion: Motion) -> float:
    """Return the bandwidth in Hz in which force and motion are compared.

    It is the wider of two: the band in which the motion's power is at least ``CLEAR`` times its noise, and the band in
    which mass times acceleration noise is at most the force noise.  The derivative filters limit it from above, the
    length of the record from below.  Raises AnalysisError if the record is too short or nothing moves.
    """
    rate = motion.sample_rate_hz
    piece = _longest(np.isfinite(motion.displacement_m) & np.isfinite(motion.force_n))
    place, force = motion.displacement_m[piece], motion.force_n[piece]
    if place.size < MIN_FILTERS / MAX_BANDWIDTH_SHARE:
        least = math.ceil(MIN_FILTERS / MAX_BANDWIDTH_SHARE)
        raise AnalysisError(f"{place.size} samples without a gap are too short to fit a slider (at least {least})")
    noise_m = float(np.nanmedian(motion.displacement_std_m))
    if float(np.ptp(place)) < 20.0 * noise_m:
        raise AnalysisError(f"displacement_m: no motion, nothing goes further than its noise of {noise_m:.2g} m")
    widest, narrowest = MAX_BANDWIDTH_SHARE * rate, MIN_FILTERS * rate / place.size
    clear = min(widest, max(narrowest, _clear_hz(place, rate, noise_m)))
    even = _equal_noise_hz(place, force, rate, clear, (noise_m, force_noise(motion)))
    return min(widest, max(clear, even))


def force_noise(motion: Motion) -> float:
    """Return the standard deviation in N of one force sample's white noise.

    The motion's own estimate counts every change from sample to sample as noise.  If the drive itself changes that
    fast, the top of the force's spectrum gives a smaller and more accurate value.
    """
    force = motion.force_n[_longest(np.isfinite(motion.force_n))]
    *_, white = _spectrum(force, motion.sample_rate_hz, 1, 256)
    return min(float(np.nanmedian(motion.force_std_n)), float(np.sqrt(white * motion.sample_rate_hz / 2.0)))


def _longest(known: NDArray[np.bool_]) -> slice:
    return slice(*max(stretches(known), key=lambda ends: ends[1] - ends[0], default=(0, 0)))


def _spectrum(column: Floats, rate: float, order: int, segment: int) -> tuple[Floats, Floats, float]:
    """Return frequencies in Hz, the power density of a column at them, and that at the top, which is white noise.

    Welch's method is applied to the differences of this ``order`` in segments of so many samples.  Their spectrum is
    flat, so that the window does not leak power of slow motion into fast motion.
    """
    from scipy.signal import welch  # slow import (all of scipy.stats): not at every start

    steps = np.diff(column, order)
    frequency, density = (one[1:] for one in welch(steps, rate, nperseg=min(segment, steps.size)))
    density = density / (2.0 * np.sin(np.pi * frequency / rate)) ** (2 * order)
    return frequency, density, float(np.median(density[frequency > 0.8 * frequency[-1]]))


def _equal_noise_hz(place: Floats, force: Floats, rate: float, clear: float, noise: tuple[float, float]) -> float:
    """Return the largest bandwidth in which mass times the noise of the acceleration is below the force noise."""
    velocity, acceleration = derivatives(place, rate, clear)
    columns = np.stack([acceleration, velocity, np.sign(velocity), np.ones(place.size)], axis=1)
    known = np.isfinite(columns).all(axis=1)
    mass = abs(float(np.linalg.lstsq(columns[known], force[known], rcond=1e-8)[0][0]))
    best = 0.0
    for share, gain in _acceleration_gains():
        if mass * noise[0] * gain * rate**2 < noise[1] * np.sqrt(2.0 * share):
            best = share * rate
    return best


@lru_cache(maxsize=1)
def _acceleration_gains() -> tuple[tuple[float, float], ...]:
    """Return pairs of a bandwidth and the noise gain of the acceleration in it, at a sample rate of 1 Hz."""
    shares = np.geomspace(0.005, MAX_BANDWIDTH_SHARE, 40).tolist()
    return tuple((share, derivative_filters(1.0, share).acceleration_gain) for share in shares)


def _clear_hz(place: Floats, rate: float, noise_m: float) -> float:
    """Return the highest frequency at which the displacement's power is ``CLEAR`` times its white noise.

    Differentiation amplifies noise and motion alike, so their ratio is that of the displacement.
    """
    frequency, seen, top = _spectrum(place, rate, 2, max(64, (place.size - 2) // _PIECES))
    white = min(2.0 * noise_m**2 / rate, top)
    edges = frequency[0] * 2.0 ** (np.arange(200) / BANDS_AN_OCTAVE)
    clear = float(frequency[0])
    for low, high in itertools.pairwise(edges):
        inside = (frequency >= low) & (frequency < high)
        if inside.any() and float(np.mean(seen[inside])) > CLEAR * white:
            clear = float(high)
    return clear
