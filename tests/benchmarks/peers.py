"""The methods others use on such beats, for comparison only: analytic signal, zero crossings, STFT ridge."""

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import ShortTimeFFT, hilbert

Floats = NDArray[np.float64]


def analytic_signal(counts: NDArray[np.int16], sample_rate_hz: float) -> Floats:
    """Return the frequency in Hz at every sample: Hilbert transform, unwrapped angle, gradient."""
    signal = counts.astype(np.float64)
    angle = np.unwrap(np.angle(hilbert(signal - signal.mean())))
    return np.gradient(angle) * (sample_rate_hz / (2 * np.pi))


@njit(nogil=True, error_model="numpy")
def zero_crossings(counts: NDArray[np.int16], column: int, offset: float, per_fit: int) -> tuple[Floats, Floats]:
    """Return (position in samples, cycles a sample) of straight lines fitted to rising zero crossings.

    The method of this field (zero-crossing fitting): crossings by linear interpolation, then one least-squares line
    through every ``per_fit`` of them.
    """
    samples = counts.shape[0]
    room = samples // (2 * per_fit) + 2
    position, frequency = np.empty(room), np.empty(room)
    found, fits = 0, 0
    sum_t = sum_kt = origin = 0.0
    before = counts[0, column] - offset
    centre = 0.5 * (per_fit - 1)
    spread = per_fit * (per_fit * per_fit - 1.0) / 12.0
    for i in range(1, samples):
        now = counts[i, column] - offset
        if before < 0.0 <= now:
            crossing = i - now / (now - before)
            if found == 0:
                origin = crossing
            t = crossing - origin
            sum_t += t
            sum_kt += (found - centre) * t
            found += 1
            if found == per_fit:
                position[fits] = origin + sum_t / per_fit
                frequency[fits] = spread / sum_kt
                fits += 1
                found = 0
                sum_t = sum_kt = 0.0
        before = now
    return position[:fits], frequency[:fits]


def ridge(counts: NDArray[np.int16], sample_rate_hz: float, output_rate_hz: float) -> Floats:
    """Return the frequency in Hz at ``output_rate_hz``: peak of a short-time spectrum, parabola through three bins."""
    hop = round(sample_rate_hz / output_rate_hz)
    signal = counts.astype(np.float32)
    transform = ShortTimeFFT(np.hanning(hop).astype(np.float32), hop, sample_rate_hz, mfft=hop)
    power = np.log(np.abs(transform.stft(signal - signal.mean())) ** 2 + 1e-12)
    power[:3] = power.min()
    peak = np.clip(np.argmax(power, axis=0), 1, power.shape[0] - 2)
    columns = np.arange(power.shape[1])
    left, mid, right = (power[peak + k, columns] for k in (-1, 0, 1))
    return (peak + 0.5 * (left - right) / (left - 2 * mid + right)) * transform.delta_f
