"""The noise of the displacement: what the quiet flight shows of it, and how data and models are whitened alike.

The noise is described as autoregressive (Burg's method: J. P. Burg, 1975; stable for any data), because the phase
is white only inside the decimator's band and a rig's floor is not.  Whitening is the prediction-error filter.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
MIN_QUIET_SAMPLES = 64


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
    """An autoregressive noise: n_t + a_1 n_(t-1) + ... + a_p n_(t-p) = e_t, e white.

    ``prediction_error`` is (1, a_1, ..., a_p); ``std_m`` is that of one sample, ``innovation_std_m`` that of e.
    ``samples`` were used to learn it; ``trusted`` False says that they were too few or not there at all.
    """

    std_m: float
    innovation_std_m: float
    prediction_error: Floats
    samples: int
    trusted: bool = True

    @property
    def order(self) -> int:
        """Get the number of past samples that the filter looks back on."""
        return int(self.prediction_error.size) - 1

    def whiten(self, columns: Floats, valid: Mask) -> Floats:
        """Filter ``columns``, shape (n,) or (n, k), to unit white noise where their noise is this one.

        Only samples whose whole past of ``order`` samples is valid come out; shape (m,) or (m, k), m <= n.
        """
        flat = np.ascontiguousarray(columns, dtype=np.float64).reshape(columns.shape[0], -1)
        index = np.flatnonzero(self.whole(valid))
        out = np.empty((index.size, flat.shape[1]))
        _prediction_errors(flat, self.prediction_error / self.innovation_std_m, index, out)
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

    def psd(self, frequency_hz: Floats, sample_rate_hz: float) -> Floats:
        """Return the one-sided power density in m^2/Hz at ``frequency_hz``."""
        angle = 2 * np.pi * np.asarray(frequency_hz)[:, None] / sample_rate_hz
        response = np.exp(-1j * angle * np.arange(self.prediction_error.size)) @ self.prediction_error
        return np.asarray(2 * self.innovation_std_m**2 / sample_rate_hz / np.abs(response) ** 2)


def white(std_m: float, *, samples: int = 0, trusted: bool = True) -> Noise:
    """Return white noise of the given standard deviation."""
    return Noise(std_m, std_m, np.ones(1), samples, trusted)


def estimate(quiet: Sequence[Floats], *, order: int = 12, trend: int = 2) -> Noise:
    """Learn the noise from stretches of quiet flight (displacement in m, uniformly sampled, no gaps).

    The order is the one of least Bayesian information criterion up to ``order``: white noise stays white.

    A polynomial of degree ``trend`` is taken out of each stretch (the flight itself, and drags too slow to tell from
    it).  With fewer than MIN_QUIET_SAMPLES in all, white noise from third differences is given, not ``trusted``.
    """
    stretches = [np.asarray(q, dtype=np.float64) for q in quiet if len(q) > 3 * (trend + 2)]
    total = sum(s.size for s in stretches)
    if total < MIN_QUIET_SAMPLES:
        rest = [np.diff(np.asarray(q), 3) for q in quiet if len(q) >= 8]
        if not rest:
            return white(float("nan"), trusted=False)
        joined = np.concatenate(rest)
        return white(float(1.4826 * np.median(np.abs(joined)) / np.sqrt(20.0)), samples=total, trusted=False)
    residues = [detrended(s, trend) for s in stretches]
    freedom = total - (trend + 1) * len(stretches)
    variance = sum(float(r @ r) for r in residues) / freedom
    order = max(0, min(order, freedom // 40))
    filter_, fraction = _burg(residues, order)
    return Noise(float(np.sqrt(variance)), float(np.sqrt(variance * fraction)), filter_, total)


def detrended(values: Floats, degree: int) -> Floats:
    """Return ``values``, shape (n,), without their least-squares polynomial of ``degree``."""
    grid = np.linspace(-1.0, 1.0, values.size)
    basis = np.polynomial.legendre.legvander(grid, degree)
    coefficients, *_ = np.linalg.lstsq(basis, values, rcond=None)
    return np.asarray(values - basis @ coefficients)


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
        criterion = total * np.log(fraction) + order * np.log(total)
        if criterion < least:
            best, best_fraction, least = filter_, fraction, criterion
    return best, best_fraction
