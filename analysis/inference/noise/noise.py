"""The noise of the displacement: what the quiet flight shows of it, and how data and models are whitened alike.

Three parts: the white phase noise of the beat; a floor that wanders with a correlation time (the building; an
Ornstein-Uhlenbeck process, density falling with f^2 above its corner); and whatever colour those two leave, as an
autoregressive filter (Burg's method, 1975).  Whitening is the Kalman filter of the first two, whose innovations are
white from the first sample on and across gaps, followed by the prediction-error filter of the third.  A structured
floor rather than a long free filter: a hidden mode or a vibration of the frame must not be learned as noise.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
MIN_QUIET_SAMPLES = 64
_CORRELATION_TIMES_S = tuple(np.geomspace(1e-3, 30e-3, 7))  # a corner between 160 and 5 Hz: what buildings do
_QUICK_TIMES_S = (20e-6, 50e-6, 120e-6)  # ... between 8 and 1.3 kHz: what filters of the beat do


@njit(cache=True, nogil=True, error_model="numpy")
def _innovations(columns, valid, white, floor, memory, filtered, out):  # type: ignore[no-untyped-def]
    """Write the normalised Kalman innovations of every column; invalid rows become 0; about 5 flops a value."""
    n, count = columns.shape
    variance = floor
    for k in range(count):
        filtered[k] = 0.0
    for i in range(n):
        if valid[i]:
            total = variance + white
            scale = 1.0 / np.sqrt(total)
            gain = variance / total
            for k in range(count):
                surprise = columns[i, k] - filtered[k]
                out[i, k] = surprise * scale
                filtered[k] = memory * (filtered[k] + gain * surprise)
            variance *= 1.0 - gain
        else:
            for k in range(count):
                out[i, k] = 0.0
                filtered[k] *= memory
        variance = memory * memory * variance + floor * (1.0 - memory * memory)


@njit(cache=True, nogil=True, error_model="numpy")
def _prediction_errors(columns, filter_, index, out):  # type: ignore[no-untyped-def]
    """Write the filtered rows at ``index``; one multiply-add a value and tap."""
    for row in range(index.size):
        at = index[row]
        for k in range(columns.shape[1]):
            out[row, k] = filter_[0] * columns[at, k]
        for lag in range(1, filter_.size):
            for k in range(columns.shape[1]):
                out[row, k] += filter_[lag] * columns[at - lag, k]


@dataclass(frozen=True, slots=True)
class Noise:
    """Stationary noise of a uniformly sampled displacement.

    ``white_std_m`` of one sample; ``floor_std_m`` and ``floor_time_s`` (correlation time) of the wandering part;
    ``colour`` (1, a_1, ..., a_p) divided by its innovation is the prediction-error filter of what those two leave.
    ``samples`` were used to learn it; ``trusted`` False says that they were too few or not there at all.
    """

    white_std_m: float
    floor_std_m: float
    floor_time_s: float
    colour: Floats
    sample_interval_s: float
    samples: int
    trusted: bool = True

    @property
    def std_m(self) -> float:
        """Get the standard deviation of one sample, the floor included."""
        return float(np.hypot(self.white_std_m, self.floor_std_m))

    @property
    def only_white(self) -> bool:
        """Get whether there is neither floor nor colour."""
        return self.floor_std_m == 0.0 and self.order == 0 and float(self.colour[0]) == 1.0

    @property
    def order(self) -> int:
        """Get the number of past samples that the colour's filter looks back on."""
        return int(self.colour.size) - 1

    @property
    def _memory(self) -> float:
        return float(np.exp(-self.sample_interval_s / self.floor_time_s)) if self.floor_std_m > 0 else 0.0

    def louder(self, factor: float) -> "Noise":
        """Return noise of the same colour and so much the std."""
        return replace(self, white_std_m=factor * self.white_std_m, floor_std_m=factor * self.floor_std_m)

    def whiten(self, columns: Floats, valid: Mask) -> Floats:
        """Filter ``columns``, shape (n,) or (n, k), to unit white noise where their noise is this one.

        Rows that are not valid, or lack ``order`` valid rows before them, are left out: shape (m,) or (m, k), m <= n.
        Linear, and the same for every column: data and derivatives go through alike.  About 2 ns a value.
        """
        flat = np.ascontiguousarray(columns, dtype=np.float64).reshape(columns.shape[0], -1)
        between = np.empty_like(flat)
        white, floor = self.white_std_m**2, self.floor_std_m**2
        _innovations(flat, np.ascontiguousarray(valid), white, floor, self._memory, np.empty(flat.shape[1]), between)
        index = np.flatnonzero(self.whole(valid))
        if self.order == 0:
            out = np.asarray(between[index] * self.colour[0])
        else:
            out = np.empty((index.size, flat.shape[1]))
            _prediction_errors(between, self.colour, index, out)
        return out if columns.ndim == 2 else out[:, 0]

    def whole(self, valid: Mask) -> Mask:
        """Return which samples come out of ``whiten``, shape (n,)."""
        keep = np.zeros(valid.shape, dtype=np.bool_)
        p = self.order
        if valid.size <= p:
            return keep
        count = np.concatenate([[0], np.cumsum(valid)])
        keep[p:] = count[p + 1 :] - count[: valid.size - p] == p + 1
        return keep

    def psd(self, frequency_hz: Floats) -> Floats:
        """Return the one-sided power density in m^2/Hz at ``frequency_hz``."""
        angle = 2 * np.pi * np.asarray(frequency_hz, dtype=np.float64) * self.sample_interval_s
        plain = _density(angle, self.white_std_m**2, self.floor_std_m**2, self._memory)
        response = np.exp(-1j * angle[:, None] * np.arange(self.colour.size)) @ self.colour
        return np.asarray(2 * self.sample_interval_s * plain / np.abs(response) ** 2)


_LINE = 16.0  # times its floor: above what chance does in thousands of bins (e^-16 each)


def white(std_m: float, sample_interval_s: float = 1e-5, *, samples: int = 0, trusted: bool = True) -> Noise:
    """Return white noise of the given standard deviation."""
    return Noise(std_m, 0.0, 1.0, np.ones(1), sample_interval_s, samples, trusted)


def estimate(
    incoming: Floats,
    outgoing: Floats,
    sample_interval_s: float,
    *,
    order: int = 8,
    trend: int = 2,
    above_hz: float = 0.0,
) -> Noise:
    """Learn the noise from the two stretches of quiet flight (displacement in m, no gaps; either may be short).

    A polynomial of degree ``trend`` is taken out of each (the flight, and drags too slow to tell from it).  White
    level and floor maximise Whittle's likelihood of the periodograms; where the stretches are too short to show the
    floor's corner, the longest correlation time they allow is taken, which errs towards larger uncertainties.  The
    outgoing flight is learned from only where it is as quiet as the incoming one, or wanders without a line where the
    incoming one is too short to show a floor: what rings in it may be an effect.
    With ``above_hz`` only what is quicker is looked at, and the floor is one of quick correlation: what is slower is
    described elsewhere.
    With fewer than MIN_QUIET_SAMPLES in all, white noise from third differences is given, not ``trusted``.
    """
    pieces = [np.asarray(p, dtype=np.float64) for p in (incoming, outgoing)]
    long = [p for p in pieces if p.size >= MIN_QUIET_SAMPLES]
    if not long:
        rest = [np.diff(p, 3) for p in pieces if p.size >= 8]
        if not rest:
            return white(float("nan"), sample_interval_s, trusted=False)
        spread = float(1.4826 * np.median(np.abs(np.concatenate(rest))) / np.sqrt(20.0))
        return white(spread, sample_interval_s, samples=sum(p.size for p in pieces), trusted=False)
    if above_hz > 0.0:
        least = 2 * np.pi * above_hz * sample_interval_s
        return _structured([_quick_periodogram(p, least) for p in long], sample_interval_s, _QUICK_TIMES_S)
    spectra = [_periodogram(p, trend) for p in long]
    noise = _structured(spectra[:1], sample_interval_s)
    if len(long) == 2:
        angle, power, _ = spectra[1]
        expected = _density(angle, noise.white_std_m**2, noise.floor_std_m**2, noise._memory)
        low, low_in = angle < 0.1 * np.pi, spectra[0][0] < 0.1 * np.pi
        both = _structured(spectra, sample_interval_s) if _alike(power / expected, ~low, low_in) else None
        if both is not None and (_alike(power / expected, low, low_in) or _only_shown(noise, both, angle, power)):
            noise = both
        else:
            long = long[:1]
    return _coloured(noise, [detrended(p, trend) for p in long], order)


def _only_shown(short: Noise, both: Noise, angle: Floats, power: Floats) -> bool:
    """Return whether a longer flight shows a floor that a short one cannot; a line above it is no floor."""
    if short.floor_std_m > 0 or both.floor_std_m == 0:
        return False
    shown = _density(angle, both.white_std_m**2, both.floor_std_m**2, both._memory)
    return float(np.max(power / shown)) < _LINE


def _alike(ratio: Floats, part: Mask, of_model: Mask) -> bool:
    """Return whether the power in ``part`` exceeds its model by no more than three standard errors of both."""
    bins, model_bins = int(part.sum()), max(4, int(of_model.sum()))
    if bins == 0:
        return True
    return float(np.mean(ratio[part])) < 1 + 3 * float(np.sqrt(2 / bins + 2 / model_bins))


def detrended(values: Floats, degree: int) -> Floats:
    """Return ``values``, shape (n,), without their least-squares polynomial of ``degree``."""
    grid = np.linspace(-1.0, 1.0, values.size)
    basis = np.polynomial.legendre.legvander(grid, degree)
    coefficients, *_ = np.linalg.lstsq(basis, values, rcond=None)
    return np.asarray(values - basis @ coefficients)


def _density(angle: Floats, white_: float, floor: float, memory: float) -> Floats:
    """Return the power density per sample of white noise plus an Ornstein-Uhlenbeck floor of variance ``floor``."""
    wandering = floor * (1 - memory * memory) / (1 - 2 * memory * np.cos(angle) + memory * memory)
    return np.asarray(white_ + wandering)


def _periodogram(values: Floats, trend: int) -> tuple[Floats, Floats, float]:
    """Return (angles, power per sample, degrees of freedom a bin), the bins that detrending empties left out."""
    taper = np.sin(np.pi * (np.arange(values.size) + 0.5) / values.size) ** 2
    spectrum = np.fft.rfft(detrended(values, trend) * taper)
    power = np.abs(spectrum) ** 2 / np.sum(taper**2)
    angle = 2 * np.pi * np.arange(power.size) / values.size
    inside = slice(trend + 1, power.size - 1)
    return angle[inside], power[inside], 0.5  # a Hann taper makes about two neighbouring bins say the same


def _quick_periodogram(values: Floats, least_angle: float) -> tuple[Floats, Floats, float]:
    """Return the periodogram above an angle, of second differences, so that what is slow does not leak into it."""
    angle, power, weight = _periodogram(np.diff(values, 2), 0)
    kept = angle >= least_angle
    return angle[kept], power[kept] / (2 * np.sin(angle[kept] / 2)) ** 4, weight


def _structured(
    spectra: Sequence[tuple[Floats, Floats, float]],
    sample_interval_s: float,
    times_s: tuple[float, ...] = _CORRELATION_TIMES_S,
) -> Noise:
    """Return white noise plus floor of greatest Whittle likelihood, or white alone where a floor does not pay."""
    angle = np.concatenate([s[0] for s in spectra])
    power = np.concatenate([s[1] for s in spectra])
    weight = spectra[0][2]
    samples = int(2 * power.size)
    flat = float(np.mean(power))
    alone = float(np.sum(np.log(flat) + power / flat)) * weight
    tried: list[tuple[float, float, float, float]] = []
    for time_s in times_s:
        memory = float(np.exp(-sample_interval_s / time_s))
        shape = _density(angle, 0.0, 1.0, memory)
        white_, floor = _two_levels(power, shape)
        model = white_ + floor * shape
        tried.append((float(np.sum(np.log(model) + power / model)) * weight, time_s, white_, floor))
    least = min(t[0] for t in tried)
    if alone - least < 4.0:  # two more numbers must earn their keep
        return white(float(np.sqrt(flat)), sample_interval_s, samples=samples)
    _, time_s, white_, floor = [t for t in tried if t[0] < least + 1.0][-1]
    return Noise(float(np.sqrt(white_)), float(np.sqrt(floor)), float(time_s), np.ones(1), sample_interval_s, samples)


def _two_levels(power: Floats, shape: Floats) -> tuple[float, float]:
    """Return the levels (a, b) of greatest Whittle likelihood for a density a + b shape, both positive.

    Fisher scoring on the logarithms: positive by construction, and stable from any start.
    """
    a = float(np.mean(power[power.size // 2 :])) + 1e-300
    b = max(float(np.sum(power) / np.sum(shape)) * 0.5, 1e-6 * a / float(np.mean(shape)))
    for _ in range(60):
        model = a + b * shape
        first = a / model
        second = 1 - first
        excess = power / model - 1
        # Two unknowns: the normal equations are solved by hand, which is quicker than calling for it.
        score_a, score_b = float(first @ excess), float(second @ excess)
        aa, ab, bb = float(first @ first) + 1e-9, float(first @ second), float(second @ second) + 1e-9
        determinant = aa * bb - ab * ab
        step_a = min(max((bb * score_a - ab * score_b) / determinant, -1.0), 1.0)
        step_b = min(max((aa * score_b - ab * score_a) / determinant, -1.0), 1.0)
        a, b = a * math.exp(step_a), b * math.exp(step_b)
        if max(abs(step_a), abs(step_b)) < 1e-6:
            break
    return a, b


def _coloured(noise: Noise, residues: list[Floats], highest: int) -> Noise:
    """Return the noise with the colour that it leaves in the quiet flight, of the order that pays for itself."""
    whitened = [noise.whiten(r, np.ones(r.size, dtype=np.bool_)) for r in residues]
    total = sum(w.size for w in whitened)
    highest = max(0, min(highest, total // 60))
    filter_, fraction = _burg(whitened, highest)
    if filter_.size == 1:
        return noise
    variance = fraction * sum(float(w @ w) for w in whitened) / total
    colour = filter_ / np.sqrt(variance)
    return Noise(
        noise.white_std_m, noise.floor_std_m, noise.floor_time_s, colour, noise.sample_interval_s, noise.samples
    )


def _burg(residues: list[Floats], highest: int) -> tuple[Floats, float]:
    """Return the best prediction-error filter up to order ``highest`` and the fraction of the variance it leaves."""
    forward = [r.copy() for r in residues]
    backward = [r.copy() for r in residues]
    total = sum(r.size for r in residues)
    filter_, fraction = np.ones(1), 1.0
    best, best_fraction, least = filter_, fraction, 0.0
    for order in range(1, highest + 1):
        ahead = [f[1:] for f in forward]
        behind = [b[:-1] for b in backward]
        power = sum(float(f @ f + b @ b) for f, b in zip(ahead, behind, strict=True))
        if power <= 0:
            break
        reflection = -2 * sum(float(f @ b) for f, b in zip(ahead, behind, strict=True)) / power
        forward = [f + reflection * b for f, b in zip(ahead, behind, strict=True)]
        backward = [b + reflection * f for f, b in zip(ahead, behind, strict=True)]
        longer = np.concatenate([filter_, [0.0]])
        filter_ = longer + reflection * longer[::-1]
        fraction *= 1 - reflection * reflection
        criterion = total * np.log(fraction) + 2 * order * np.log(total)
        if criterion < least:
            best, best_fraction, least = filter_, fraction, criterion
    return best, best_fraction
