"""Choosing the band-pass a beat is read through: where to mix, how far to decimate, how long a window."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.shot import AnalysisError

PHASE_STEPS = 65536  # the local oscillator advances by whole 1/65536 cycles a decimated sample: exact in integers
IMAGE_REJECTION_DB = 90.0
ALIAS_LIMIT = 0.015  # noise power folded onto the beat by decimation, relative to its own
_MAX_TAPS = 4096
_MAX_DECIMATION = 40
_GRID = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Tuning:
    """A complex band-pass and decimator for one beat.

    ``taps`` is complex, shape (decimation, taps // decimation) and float32 in effect: tap p + q * decimation of the
    window, mixed with the local oscillator, sits at [p, q].  ``delay_samples`` from a window's first sample to its
    centre.
    """

    sample_rate_hz: float
    decimation: int
    oscillator_steps: int  # cycles a decimated sample, in 1 / PHASE_STEPS
    low_hz: float
    high_hz: float
    taps: NDArray[np.complex128]

    @property
    def length(self) -> int:
        """Get the number of taps."""
        return int(self.taps.size)

    @property
    def oscillator_hz(self) -> float:
        """Get the frequency of the local oscillator in Hz."""
        return self.oscillator_steps * self.sample_rate_hz / (self.decimation * PHASE_STEPS)

    @property
    def phase_rate_hz(self) -> float:
        """Get the rate of the decimated samples in samples/s."""
        return self.sample_rate_hz / self.decimation

    @property
    def window(self) -> NDArray[np.float64]:
        """Get the real window before mixing, shape (length,)."""
        flat = self.taps.T.reshape(-1)
        position = np.arange(flat.size) - self.delay_samples
        return np.asarray((flat * np.exp(2j * np.pi * self.oscillator_hz / self.sample_rate_hz * position)).real)

    @property
    def delay_samples(self) -> float:
        """Get the distance from the first sample of a window to its centre."""
        return 0.5 * (self.length - 1)


@lru_cache(maxsize=64)
def tune(sample_rate_hz: float, low_hz: float, high_hz: float, min_phase_rate_hz: float, divides: int = 0) -> Tuning:
    """Return the cheapest band-pass that reads a beat wandering between ``low_hz`` and ``high_hz``.

    The image of a real beat at f lies at -f; it and its folds are held ``IMAGE_REJECTION_DB`` below the beat, and
    decimation folds no more than ``ALIAS_LIMIT`` of noise onto it; the decimation divides ``divides`` (0: any does).
    Raises AnalysisError where no window of up to 4096 taps can do so, because the beat comes too near zero or the
    Nyquist frequency.
    """
    if not 0 < low_hz <= high_hz < sample_rate_hz / 2:
        raise AnalysisError(
            f"beat between {low_hz / 1e6:.4g} and {high_hz / 1e6:.4g} MHz leaves the digitizer's band "
            f"of 0 to {sample_rate_hz / 2e6:.4g} MHz"
        )
    centre = 0.5 * (low_hz + high_hz)
    half_width = 0.5 * (high_hz - low_hz)
    image_edge = min(2 * centre - half_width, sample_rate_hz - 2 * centre - half_width)
    fastest = min(_MAX_DECIMATION, max(1, int(sample_rate_hz / max(min_phase_rate_hz, 2.4 * half_width))))
    best: tuple[float, int, int, NDArray[np.float64]] | None = None
    for decimation in range(fastest, 0, -1):
        if divides % decimation:
            continue
        for share in (6, 12, 18, 24, 36, 48, 66, 96, 132):
            if share * decimation > _MAX_TAPS:
                break
            cost = share + 20.0 / decimation
            if best is not None and cost >= best[0]:
                break
            window = _window(sample_rate_hz, decimation, share, half_width, image_edge)
            if window is not None:
                best = (cost, decimation, share, window)
                break
    if best is None:
        edge = "zero" if 2 * centre < sample_rate_hz / 2 else f"the Nyquist frequency of {sample_rate_hz / 2e6:g} MHz"
        raise AnalysisError(
            f"beat between {low_hz / 1e6:.4g} and {high_hz / 1e6:.4g} MHz comes too near {edge}: "
            "its mirror image cannot be told from it"
        )
    _, decimation, share, window = best
    steps = round(centre * decimation * PHASE_STEPS / sample_rate_hz)
    oscillator = steps / (decimation * PHASE_STEPS)
    position = np.arange(window.size) - 0.5 * (window.size - 1)
    taps = window * np.exp(-2j * np.pi * oscillator * position)
    table = np.ascontiguousarray(taps.reshape(share, decimation).T)
    table.flags.writeable = False
    return Tuning(sample_rate_hz, decimation, steps, low_hz, high_hz, table)


def _window(
    rate_hz: float, decimation: int, share: int, half_width_hz: float, image_edge_hz: float
) -> NDArray[np.float64] | None:
    length = share * decimation
    if length < 8:
        return None
    grid = max(_GRID, 8 * length)
    frequency = np.arange(grid // 2 + 1) * (rate_hz / grid)
    for kaiser in (8.6, 9.6, 11.0):
        main_lobe = rate_hz / length * np.sqrt(1 + (kaiser / np.pi) ** 2)  # from the centre to the first null
        for cut in (0.0, 0.25, 0.5, 0.75, 1.0, 1.3, 1.6, 2.0):
            if max(half_width_hz, cut * half_width_hz) + 0.6 * main_lobe > image_edge_hz:
                continue
            n = np.arange(length) - 0.5 * (length - 1)
            taps: NDArray[np.float64] = np.asarray(
                np.sinc(2 * cut * half_width_hz / rate_hz * n) * np.kaiser(length, kaiser), np.float64
            )
            taps = taps / taps.sum()
            power: NDArray[np.float64] = np.asarray(np.abs(np.fft.rfft(taps, grid)) ** 2, np.float64)
            inside = power[frequency <= half_width_hz]
            if inside.min() < 0.1:
                continue
            beyond = power[frequency >= image_edge_hz]
            if beyond.size and beyond.max() > 10 ** (-IMAGE_REJECTION_DB / 10) * inside.min():
                continue
            if _folded(power, frequency, rate_hz, decimation, half_width_hz) <= ALIAS_LIMIT:
                return taps
    return None


def _folded(
    power: NDArray[np.float64],
    frequency: NDArray[np.floating[Any]],
    rate_hz: float,
    decimation: int,
    half_width_hz: float,
) -> float:
    """Return the worst noise power folded onto a beat within +-half_width, relative to the power kept there."""
    at = np.linspace(-half_width_hz, half_width_hz, 33)
    kept = np.interp(np.abs(at), frequency, power)
    folded = np.zeros_like(at)
    for k in range(1, decimation):
        alias = np.mod(at + k * rate_hz / decimation + rate_hz / 2, rate_hz) - rate_hz / 2
        folded += np.interp(np.abs(alias), frequency, power)
    return float(np.max(folded / kept))
