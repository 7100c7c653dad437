"""Choose a beat's band-pass, and its local oscillator in every part of the recording."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.shot import AnalysisError

BATCH = 64  # decimated samples read with one oscillator; their input stays in the first cache
PHASE_STEPS = 65536  # the oscillator advances by whole 1/65536 cycles per decimated sample: exact in integers
IMAGE_REJECTION_DB = 90.0
ALIAS_LIMIT = 0.012  # largest noise power folded onto the beat by decimation, relative to the noise kept there
_MAX_TAPS = 4096
_GRID = 4096
_SHARES = (4, 8, 12, 16, 24, 32, 48, 64, 96, 128)
_KAISERS = (8.6, 9.8)
_CUTS = (0.0, 0.5, 0.8, 1.1, 1.5, 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class Tuning:
    """A complex band-pass and decimator for one beat, with an oscillator that can be set from batch to batch.

    ``window`` is the real low-pass, shape (length,), valid for oscillators between ``low_hz`` and ``high_hz`` and beats
    within ``half_width_hz`` of the oscillator.
    """

    sample_rate_hz: float
    decimation: int  # recorded samples per phase
    low_hz: float
    high_hz: float
    half_width_hz: float
    window: NDArray[np.float64]

    @property
    def length(self) -> int:
        """Get the number of recorded samples from which one phase is read."""
        return int(self.window.size)

    @property
    def phase_rate_hz(self) -> float:
        return self.sample_rate_hz / self.decimation

    @property
    def delay_samples(self) -> float:
        """Get the distance in samples from the first sample of a window to its centre."""
        return 0.5 * (self.length - 1)

    @property
    def effective_samples(self) -> float:
        """Get the number of samples that one phase averages; the phase's variance is 1 / (SNR effective_samples)."""
        window = self.window
        return float(window.sum() ** 2 / np.sum(window**2))

    @property
    def spread(self) -> float:
        """Get the window's second moment about its centre in decimated samples squared, a measure of its smoothing."""
        window = self.window
        position = np.arange(window.size) - self.delay_samples
        return float(np.sum(window * position**2) / window.sum() / self.decimation**2)

    def steps(self, frequency_hz: float) -> int:
        """Return the oscillator nearest to a frequency, in 1 / PHASE_STEPS cycles per decimated sample."""
        return round(frequency_hz * self.decimation * PHASE_STEPS / self.sample_rate_hz)

    def oscillator_hz(self, steps: int) -> float:
        return steps * self.sample_rate_hz / (self.decimation * PHASE_STEPS)


@lru_cache(maxsize=64)
def tune(
    sample_rate_hz: float,
    low_hz: float,
    high_hz: float,
    half_width_hz: float,
    min_phase_rate_hz: float,
    divides: int = 0,
) -> Tuning:
    """Return the cheapest band-pass for oscillators ``low_hz`` to ``high_hz`` and beats within ``half_width_hz``.

    The image of a real beat at f lies at -f; the image and its aliases stay ``IMAGE_REJECTION_DB`` below the beat, and
    decimation folds at most ``ALIAS_LIMIT`` of noise onto the beat.  The decimation divides ``divides`` (0: no
    restriction).  Raises AnalysisError if no window of up to 4096 taps meets this, as the beat comes too near zero or
    the Nyquist frequency.
    """
    lowest, highest = low_hz - half_width_hz, high_hz + half_width_hz
    if not 0 < lowest <= highest < sample_rate_hz / 2:
        raise AnalysisError(
            f"beat between {lowest / 1e6:.4g} and {highest / 1e6:.4g} MHz leaves the digitizer's band "
            f"of 0 to {sample_rate_hz / 2e6:.4g} MHz"
        )
    fastest = max(1, int(sample_rate_hz / max(min_phase_rate_hz, 2.4 * half_width_hz)))
    image_edge = min(2 * low_hz, sample_rate_hz - 2 * high_hz) - half_width_hz
    best: tuple[float, int, NDArray[np.float64]] | None = None
    for decimation in range(fastest, 0, -1):
        if divides % decimation:
            continue
        least = 20.0 / decimation + 4.0
        if best is not None and best[0] <= least + _SHARES[0]:
            break  # smaller decimations cannot be cheaper
        for share in _SHARES:
            if share * decimation > _MAX_TAPS or (best is not None and least + share >= best[0]):
                break
            window = _window(sample_rate_hz, decimation, share, half_width_hz, image_edge)
            if window is not None:
                best = (least + share, decimation, window)
                break
    if best is None:
        middle = 0.5 * (low_hz + high_hz)
        edge = "zero" if 4 * middle < sample_rate_hz else f"the Nyquist frequency of {sample_rate_hz / 2e6:g} MHz"
        raise AnalysisError(
            f"beat between {lowest / 1e6:.4g} and {highest / 1e6:.4g} MHz comes too near {edge}: "
            "it is indistinguishable from its mirror image"
        )
    _, decimation, window = best
    window.flags.writeable = False
    return Tuning(sample_rate_hz, decimation, low_hz, high_hz, half_width_hz, window)


def _window(
    rate_hz: float, decimation: int, share: int, half_width_hz: float, image_edge_hz: float
) -> NDArray[np.float64] | None:
    length = share * decimation
    if length < 8:
        return None
    grid = max(_GRID, 8 * length)
    frequency = np.arange(grid // 2 + 1) * (rate_hz / grid)
    n = np.arange(length) - 0.5 * (length - 1)
    for kaiser in _KAISERS:
        main_lobe = rate_hz / length * np.sqrt(1 + (kaiser / np.pi) ** 2)  # from the centre to the first null
        if half_width_hz + 0.6 * main_lobe > image_edge_hz:
            continue
        bell = np.kaiser(length, kaiser)
        for cut in _CUTS:
            taps: NDArray[np.float64] = np.sinc(2 * cut * half_width_hz / rate_hz * n) * bell
            taps = taps / taps.sum()
            power: NDArray[np.float64] = np.asarray(np.abs(np.fft.rfft(taps, grid)) ** 2, np.float64)
            inside = power[frequency <= half_width_hz]
            if inside.min() < 0.25:
                continue
            beyond = power[frequency >= image_edge_hz]
            if beyond.size and beyond.max() > 10 ** (-IMAGE_REJECTION_DB / 10) * inside.min():
                break  # a wider cut only comes closer to the image
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
    """Return the largest noise power folded onto a beat within +-half_width, relative to the power kept there."""
    at = np.linspace(-half_width_hz, half_width_hz, 17)
    kept = np.interp(np.abs(at), frequency, power)
    fold = np.arange(1, decimation)[:, None] * (rate_hz / decimation)
    alias = np.mod(at + fold + rate_hz / 2, rate_hz) - rate_hz / 2
    folded = np.interp(np.abs(alias).ravel(), frequency, power).reshape(alias.shape).sum(axis=0)
    return float(np.max(folded / kept))


@dataclass(frozen=True, slots=True, eq=False)
class OscillatorSchedule:
    """The oscillator of every batch, which follows the beat so that a narrow band is enough.

    ``steps`` (g,) are the oscillators in 1 / PHASE_STEPS cycles; ``batch`` (b,) is each batch's index into ``steps``.
    """

    steps: NDArray[np.int64]
    batch: NDArray[np.int32]

    @property
    def nominal(self) -> int:
        """Get the oscillator to which phases are relative, in steps."""
        return int(self.steps[self.steps.size // 2])


def fixed_schedule(tuning: Tuning, frequency_hz: float) -> OscillatorSchedule:
    return OscillatorSchedule(np.array([tuning.steps(frequency_hz)], np.int64), np.zeros(1, np.int32))


def following_schedule(
    tuning: Tuning, sample: NDArray[np.int64], frequency_hz: NDArray[np.float64], samples: int, spacing_hz: float
) -> OscillatorSchedule:
    """Return the schedule of a beat of ``frequency_hz`` (n,) at ``sample`` (n,), interpolated linearly and rounded.

    ``samples`` is the recording's length, ``spacing_hz`` the distance between oscillators.
    """
    batches = samples // (BATCH * tuning.decimation) + 1
    centre = (np.arange(batches) + 0.5) * (BATCH * tuning.decimation)
    wanted = np.interp(centre, sample, frequency_hz)
    rounded = np.rint(wanted / spacing_hz).astype(np.int64)
    values, batch = np.unique(rounded, return_inverse=True)
    steps = np.array([tuning.steps(float(v) * spacing_hz) for v in values], np.int64)
    return OscillatorSchedule(steps, batch.reshape(-1).astype(np.int32))
