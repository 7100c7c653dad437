"""The bandwidth in which force and motion of a driven record are compared, chosen from the record itself."""

import itertools
from functools import lru_cache

import numpy as np

from analysis.shot import AnalysisError, Floats, Motion
from analysis.signal import MAX_BANDWIDTH_SHARE, derivative_filters, derivatives, stretches

CLEAR = 100.0  # signal over noise power at the edge: noise of 1 % in a regressor biases its coefficient by as much
BANDS_AN_OCTAVE = 4
LEAST_FILTERS = 60.0  # a record must last so many times the filter's time 1 / bandwidth: each end costs ten
_PIECES = 6  # of the record, for the spectrum


def bandwidth_of(motion: Motion) -> float:
    """Return the bandwidth in Hz in which force and motion are compared.

    The wider of two: up to where the motion's power is ``CLEAR`` times its noise, and up to where mass times the noise
    of the acceleration equals the noise of the force.  At most what the derivative filters can do, at least what
    leaves the record longer than the filter.  Raises AnalysisError where the record is too short or nothing moves.
    """
    rate = motion.sample_rate_hz
    start, stop = max(
        stretches(np.isfinite(motion.displacement_m) & np.isfinite(motion.force_n)),
        key=lambda ends: ends[1] - ends[0],
        default=(0, 0),
    )
    place, force = motion.displacement_m[start:stop], motion.force_n[start:stop]
    if place.size < LEAST_FILTERS / MAX_BANDWIDTH_SHARE:
        least = round(LEAST_FILTERS / MAX_BANDWIDTH_SHARE)
        raise AnalysisError(f"{place.size} samples without a gap are too short to fit a slider (at least {least})")
    noise_m = float(np.nanmedian(motion.displacement_std_m))
    if float(np.ptp(place)) < 20.0 * noise_m:
        raise AnalysisError(f"displacement_m: no motion, nothing goes further than its noise of {noise_m:.2g} m")
    widest, narrowest = MAX_BANDWIDTH_SHARE * rate, LEAST_FILTERS * rate / place.size
    clear = min(widest, max(narrowest, _clear_hz(place, rate, noise_m)))
    even = _equal_noise_hz(place, force, rate, clear, (noise_m, force_noise(motion)))
    return min(widest, max(clear, even))


def force_noise(motion: Motion) -> float:
    """Return the standard deviation in N of one force sample's white noise.

    The motion's own estimate counts everything that changes from sample to sample as noise; where the drive itself
    changes so fast, the top of the force's spectrum gives a smaller, truer value.
    """
    from scipy.signal import welch  # with all of scipy.stats: not at every start

    known = np.isfinite(motion.force_n)
    start, stop = max(stretches(known), key=lambda ends: ends[1] - ends[0])
    steps = np.diff(motion.force_n[start:stop])
    frequency, density = welch(steps, motion.sample_rate_hz, nperseg=min(256, steps.size))
    top = frequency > 0.8 * frequency[-1]
    through = (2.0 * np.sin(np.pi * frequency[top] / motion.sample_rate_hz)) ** 2
    white = np.sqrt(float(np.median(density[top] / through)) * motion.sample_rate_hz / 2.0)
    return min(float(np.nanmedian(motion.force_std_n)), float(white))


def _equal_noise_hz(place: Floats, force: Floats, rate: float, clear: float, noise: tuple[float, float]) -> float:
    """Return the bandwidth at which mass times the noise of the acceleration is the noise of the force."""
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
    """Return bandwidths and the noise gains of the acceleration in them, at a sample rate of 1 Hz."""
    shares = np.geomspace(0.005, MAX_BANDWIDTH_SHARE, 40).tolist()
    return tuple((share, derivative_filters(1.0, share).acceleration_gain) for share in shares)


def _clear_hz(place: Floats, rate: float, noise_m: float) -> float:
    """Return the highest frequency at which the displacement's power is ``CLEAR`` times its white noise.

    Differentiation raises noise and motion alike, so their ratio is that of the displacement.  The spectrum is taken
    of second differences: they are so flat that the window does not leak the slow motion over the fast one.
    """
    from scipy.signal import welch  # with all of scipy.stats: not at every start

    second = np.diff(place, 2)
    frequency, density = welch(second, rate, nperseg=min(second.size, max(64, second.size // _PIECES)))
    frequency, density = frequency[1:], density[1:]
    seen = density / (2.0 * np.sin(np.pi * frequency / rate)) ** 4
    top = seen[frequency > 0.8 * frequency[-1]]
    repeatability = min(2.0 * noise_m**2 / rate, float(np.median(top)))
    edges = frequency[0] * 2.0 ** (np.arange(200) / BANDS_AN_OCTAVE)
    clear = float(frequency[0])
    for low, high in itertools.pairwise(edges):
        inside = (frequency >= low) & (frequency < high)
        if inside.any() and float(np.mean(seen[inside])) > CLEAR * repeatability:
            clear = float(high)
    return clear
