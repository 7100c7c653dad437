"""Integer taps for filters that multiply 16-bit samples with 16-bit taps and add up in 32 bits."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.signal.intrinsics import WIDTH

_MOST = 65535  # of the taps' absolute sum: full-scale samples of 16 bits then stay below 2^31
_LARGEST = 32700
_STRAY = 2.0  # most that rounding, with two errors carried on, moves one tap


@njit(cache=True, nogil=True, error_model="numpy")
def _round(window, turns, room, taps, gains):  # type: ignore[no-untyped-def]
    """Mix a symmetric window with oscillators and round to whole numbers; 10 ns a tap.

    Each error is carried on to the next two taps, e[k] becoming e[k] - 2 cos(w) e[k-1] + e[k-2], which is zero at +-w,
    the oscillator's frequency.  It is carried towards the centre, where the last error shifts no phase.
    """
    length = window.shape[0]
    half = length // 2
    cosine, sine = np.empty(half), np.empty(half)
    for row in range(turns.shape[0]):
        step = 2.0 * np.pi * turns[row]
        even_sum, odd_sum, largest = 0.0, 0.0, 0.0
        for k in range(half):
            angle = step * (k - 0.5 * (length - 1))
            cosine[k], sine[k] = np.cos(angle), -np.sin(angle)
            even_sum += 2 * abs(window[k] * cosine[k])
            odd_sum += 2 * abs(window[k] * sine[k])
            largest = max(largest, abs(window[k]))
        scale = min(room / max(even_sum, odd_sum), _LARGEST / largest)
        twice = 2.0 * np.cos(step)
        for part in range(2):
            mirrored = 1 - 2 * part
            wave = sine if part else cosine
            last, before, gain = 0.0, 0.0, 0.0
            for k in range(half):
                wanted = scale * window[k] * wave[k] - twice * last + before
                nearest = np.rint(wanted)
                before, last = last, nearest - wanted
                gain += 2 * nearest * wave[k]
                taps[row, part, k] = np.int16(nearest)
                taps[row, part, length - 1 - k] = np.int16(mirrored * nearest)
            gains[row, part] = 0.5 / gain


@dataclass(frozen=True, slots=True, eq=False)
class IntegerTaps:
    """Complex band-passes with integer taps, one per oscillator, and the gains that restore their sums.

    ``taps`` int16 (oscillators, 2, length rounded up to ``WIDTH``): real part, even about the centre, and imaginary
    part, odd.  ``restore`` float32 (oscillators, 3): the gain of either sum, and the part of a constant offset in the
    first; the second sum is free of it.
    """

    taps: NDArray[np.int16]
    restore: NDArray[np.float32]


def integer_taps(window: NDArray[np.float64], turns: NDArray[np.float64], offset_counts: float) -> IntegerTaps:
    """Return ``window`` mixed with each oscillator, as integers of the largest scale that cannot overflow.

    ``window`` is symmetric, of an even number of taps; ``turns`` (oscillators,) are the oscillators in cycles per
    sample, their phase zero at the window's centre, so that the angle read is the beat's there for any oscillator.
    As even and odd functions the taps shift no phase at any frequency; at the oscillator the gains of both parts, and
    so the rejection of the image, are exact.
    """
    taps = np.zeros((turns.size, 2, -(-window.size // WIDTH) * WIDTH), np.int16)
    gains = np.empty((turns.size, 2))
    _round(np.asarray(window).copy(), turns, _MOST - _STRAY * window.size, taps, gains)
    steady = offset_counts * gains[:, :1] * taps[:, 0].sum(axis=1, dtype=np.int64)[:, None]
    return IntegerTaps(taps, np.concatenate((gains, steady), axis=1).astype(np.float32))
