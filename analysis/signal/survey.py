"""Survey one beat before it is demodulated: amplitude, frequencies and signal-to-noise ratio in short stretches."""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from analysis.shot import AnalysisError

STRETCH_S = 40e-6
SPACING_S = 1e-3
_MAX_STRETCHES = 2000
_SATURATED = 0.9  # share of the samples at the rail: a sine clipped at a sixth of its height
_PINNED_RATIO = 3.0  # clipped: more than this many times as many samples at the extremes as one count inside them
_APART = 5  # bins, beyond which the window's side lobes are below a third of a percent
_EDGE = 8
_MIN_STRETCHES = 8
_DARK_RATIO = 0.02  # of the median peak power, below which a stretch holds no beat
_SEEN_RATIO = 13.0  # least ratio of peak power to mean noise power: one noise bin in 400,000 exceeds it


@dataclass(frozen=True, slots=True)
class Survey:
    """A beat surveyed in short stretches that begin at ``sample``; arrays of shape (stretches,).

    ``seen`` is False for a stretch without a beat.
    """

    offset_counts: float
    amplitude_counts: float
    snr_db: float  # A^2 / (2 sigma^2) over the whole band
    sample: NDArray[np.int64]
    stretch: int  # samples per stretch
    frequency_hz: NDArray[np.float64]
    seen: NDArray[np.bool_]
    clipped_fraction: float
    harmonics: float  # amplitude of the stronger of the 2nd and 3rd harmonic, relative to the beat

    @property
    def low_hz(self) -> float:
        return float(self.frequency_hz[self.seen].min())

    @property
    def high_hz(self) -> float:
        return float(self.frequency_hz[self.seen].max())


def survey(counts: NDArray[np.int16], sample_rate_hz: float, bits: int, what: str) -> Survey:
    """Survey the beat of one column, shape (n,), in 40 to 2000 stretches, one per ms: a few percent of a long record.

    Raises AnalysisError, naming ``what``, if the column is too short, flat, saturated or without a beat.
    """
    length = int(2 ** np.clip(np.round(np.log2(STRETCH_S * sample_rate_hz)), 8, 12))
    if counts.size < length:
        raise AnalysisError(f"{what}: {counts.size} samples are too short to find a beat in (at least {length})")
    stretches = int(np.clip(counts.size / (SPACING_S * sample_rate_hz), 40, _MAX_STRETCHES))
    stretches = min(stretches, max(1, counts.size // length))
    sample = np.linspace(0, counts.size - length, stretches).astype(np.int64)
    raw = np.stack([counts[s : s + length] for s in sample])
    low, high = int(raw.min()), int(raw.max())
    if high - low < 2:
        raise AnalysisError(f"{what}: the channel is flat at {low} counts: no light, or not connected")
    rail = 1 << (bits - 1)
    clipped = 0.0
    if high >= rail - 1 or low <= -rail:
        clipped = float(((raw >= rail - 1) | (raw <= -rail)).mean())
    clipped = max(clipped, _excess_pinning(raw, low, high))
    if clipped > _SATURATED:
        raise AnalysisError(f"{what}: saturated: {100 * clipped:.0f} % of the samples are at the rail")

    offset = float(raw.mean())
    window = np.hanning(length + 1)[:-1].astype(np.float32)
    spectrum = scipy.fft.rfft((raw - np.float32(offset)) * window, axis=1)
    power = spectrum.real**2 + spectrum.imag**2
    power[:, :4] = 0.0
    power[:, -2:] = 0.0
    peak = np.argmax(power, axis=1)
    rows = np.arange(stretches)
    noise = np.median(power[:, 5:-2:3], axis=1).astype(np.float64) / np.log(2.0)
    height = power[rows, peak]
    seen = height > _SEEN_RATIO * np.maximum(noise, 1e-12)
    if seen.any():
        seen &= height > _DARK_RATIO * np.median(height[seen])  # without light, rounding alone has peaks too
    if not seen.any() or seen.mean() < 0.2:
        raise AnalysisError(f"{what}: no beat found, only noise ({high - low} counts from peak to peak)")
    frequency = (peak + _peak_offset(power, rows, peak)) * sample_rate_hz / length
    near = np.clip(peak[:, None] + np.arange(-2, 3), 0, power.shape[1] - 1)
    beat = power[rows[:, None], near].astype(np.float64).sum(axis=1) - 5 * noise
    scale = np.sum(window.astype(np.float64) ** 2)
    amplitude = np.sqrt(np.maximum(4 * beat[seen] / (scale * length), 0.0))
    variance = np.median(noise[seen]) / scale  # of one sample
    typical = float(np.median(amplitude))
    snr = 0.5 * typical**2 / max(variance, 1 / 12 * 1e-3)
    harmonics = _harmonics(power[seen], frequency[seen] * length / sample_rate_hz, noise[seen])
    return Survey(
        offset, typical, float(10 * np.log10(max(snr, 1e-9))), sample, length, frequency, seen, clipped, harmonics
    )


def _excess_pinning(raw: NDArray[np.int16], low: int, high: int) -> float:
    """Return the fraction of samples clipped at a level below the digitizer's rail.

    A sine spends little time within a count of its extremes, at most 2.4 times as much as within the next count; more
    time is clipping.
    """
    extreme = float(((raw == high) | (raw == low)).mean())
    next_in = float(((raw == high - 1) | (raw == low + 1)).mean())
    expected = 4 * np.sqrt(2.0 / max(high - low, 1)) / np.pi  # twice a sine's share within a count of its extremes
    return extreme if extreme > expected + 0.01 and extreme > _PINNED_RATIO * next_in else 0.0


def _harmonics(power: NDArray[np.float32], peak: NDArray[np.float64], noise: NDArray[np.float64]) -> float:
    """Return the amplitude of the stronger of the second and third (folded) harmonic, relative to the beat.

    A harmonic is measured only in stretches in which it folds neither onto the beat nor onto the edges of the band.
    """
    size = 2 * (power.shape[1] - 1)
    rows = np.arange(power.shape[0])
    beat = np.median(power.max(axis=1))
    strongest = 0.0
    for order in (2, 3):
        folded = np.mod(order * peak, size)
        place = np.rint(np.minimum(folded, size - folded)).astype(np.int64)
        seen = (np.abs(place - peak) > _APART) & (place > _EDGE) & (place < power.shape[1] - 1 - _EDGE)
        if seen.sum() < _MIN_STRETCHES:
            continue
        near = np.max([power[rows[seen], place[seen] + k] for k in (-1, 0, 1)], axis=0)
        strongest = max(strongest, float(np.median(near - 2 * noise[seen])) / float(beat))
    return float(np.sqrt(max(strongest, 0.0)))


def _peak_offset(power: NDArray[np.float32], rows: NDArray[np.int64], peak: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the peak's distance in bins from the highest bin, by a parabola through the logarithms of three bins."""
    left, mid, right = (np.log(np.maximum(power[rows, peak + k].astype(np.float64), 1e-30)) for k in (-1, 0, 1))
    bend = np.minimum(left - 2 * mid + right, -1e-30)  # zero for three equal bins
    return np.asarray(np.clip(0.5 * (left - right) / bend, -0.5, 0.5))
