"""Spectra of the raw beats for a view: where the power is, and how it moves."""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from analysis.shot.recording import Recording

Floats = NDArray[np.float64]
_EMPTY_DB = -200.0


@dataclass(frozen=True, slots=True)
class Spectrum:
    """One-sided power density of a channel in V^2/Hz, shape (f,), averaged over ``averages`` stretches."""

    frequency_hz: Floats
    density_v2_per_hz: Floats
    averages: int

    @property
    def density_db(self) -> Floats:
        """Get the density in dB relative to 1 V^2/Hz."""
        return np.asarray(10 * np.log10(np.maximum(self.density_v2_per_hz, 10 ** (_EMPTY_DB / 10))))


@dataclass(frozen=True, slots=True)
class Spectrogram:
    """Power density in dB relative to 1 V^2/Hz, shape (t, f), float32."""

    time_s: Floats
    frequency_hz: Floats
    density_db: NDArray[np.float32]


def welch(recording: Recording, column: int, stretch: int = 4096, averages: int = 200) -> Spectrum:
    """Return the spectrum of one column: Hann windows of ``stretch`` samples, spread evenly over the record.

    At most ``averages`` stretches are read (half overlapping where the record is short), so a long record costs no
    more than a short one.  Raises ValueError on fewer than 16 samples.
    """
    stretch = _stretch(recording, stretch)
    count = int(np.clip(2 * recording.samples // stretch - 1, 1, averages))
    density, _ = _densities(recording, column, stretch, count)
    mean = density.mean(axis=0, dtype=np.float64)
    return Spectrum(_frequencies(recording, stretch), mean, count)


def spectrogram(recording: Recording, column: int, columns: int = 400, stretch: int = 1024) -> Spectrogram:
    """Return at most ``columns`` spectra of ``stretch`` samples each, evenly spaced in time.

    Raises ValueError on fewer than 16 samples.
    """
    stretch = _stretch(recording, stretch)
    count = int(np.clip(2 * recording.samples // stretch - 1, 1, columns))
    density, start = _densities(recording, column, stretch, count)
    decibel = 10 * np.log10(np.maximum(density, np.float32(10 ** (_EMPTY_DB / 10))))
    return Spectrogram(
        np.asarray((start + 0.5 * (stretch - 1)) / recording.sample_rate_hz, np.float64),
        _frequencies(recording, stretch),
        decibel.astype(np.float32),
    )


def _stretch(recording: Recording, stretch: int) -> int:
    if recording.samples < 16:
        raise ValueError(f"{recording.samples} samples are too few for a spectrum (at least 16)")
    return min(stretch, 1 << int(np.log2(recording.samples)))


def _frequencies(recording: Recording, stretch: int) -> Floats:
    return np.asarray(np.arange(stretch // 2 + 1) * (recording.sample_rate_hz / stretch), np.float64)


def _densities(
    recording: Recording, column: int, stretch: int, count: int
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    start = np.linspace(0, recording.samples - stretch, count).astype(np.int64)
    raw = np.stack([recording.counts[s : s + stretch, column] for s in start]).astype(np.float32)
    raw -= raw.mean(axis=1, keepdims=True)
    window = np.hanning(stretch + 1)[:-1].astype(np.float32)
    power = np.abs(scipy.fft.rfft(raw * window, axis=1)) ** 2
    power[:, 1:-1] *= 2
    volts = recording.channels[column].volts_per_count
    scale = volts**2 / (recording.sample_rate_hz * float(np.sum(window.astype(np.float64) ** 2)))
    return np.asarray(power * np.float32(scale), np.float32), start
