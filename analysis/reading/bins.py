"""The displacement of both free flights averaged in bins of about half a millisecond, shorter than any vibration."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Motion
from analysis.signal import LEAST_NOISE_M, white_noise

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

BIN_S = 0.5e-3  # at least: a line of 900 Hz still passes
MOST_BINS = 110


@dataclass(frozen=True, slots=True)
class Bins:
    time_s: Floats
    value_m: Floats
    into: Mask  # of the incoming flight
    each: int  # samples per bin
    step_s: float  # a sample
    std_m: float  # white noise of a bin

    @property
    def resolution_hz(self) -> float:
        """Get the smallest distance of two lines that can be resolved."""
        return 1.0 / (float(np.ptp(self.time_s)) + self.each * self.step_s)

    @property
    def middle_s(self) -> float:
        """Get the time about which waves are written."""
        return 0.5 * float(self.time_s[0] + self.time_s[-1])


def binned(motion: Motion, into: tuple[int, int], out: tuple[int, int] | None) -> Bins:
    """Return the bins of both flights, of one length, counted from the contact outwards, without those with holes."""
    step = 1.0 / motion.sample_rate_hz
    total = into[1] - into[0] + 1 + (out[1] - out[0] + 1 if out is not None else 0)
    each = max(1, round(BIN_S / step), -(-total // MOST_BINS))
    pieces = []
    for first, last, backwards in ((*into, True), *(((*out, False),) if out is not None else ())):
        count = (last - first + 1) // each
        start = last + 1 - count * each if backwards else first
        pieces.append((start, count))
    time, value, side, thirds = [], [], [], []
    for number, (start, count) in enumerate(pieces):
        stretch = slice(start, start + count * each)
        x = motion.displacement_m[stretch]
        rows = x.reshape(count, each)
        whole = np.isfinite(rows).all(axis=1) & motion.valid[stretch].reshape(count, each).all(axis=1)
        time.append(motion.time_s[stretch].reshape(count, each).mean(axis=1)[whole])
        value.append(rows[whole].mean(axis=1))
        side.append(np.full(int(whole.sum()), number == 0))
        third = np.diff(x, 3)
        thirds.append(third[np.isfinite(third)])
    third = np.concatenate(thirds)
    stated = float(np.nanmedian(motion.displacement_std_m))
    white = white_noise(third) if third.size > 30 else stated
    return Bins(
        np.concatenate(time), np.concatenate(value), np.concatenate(side), each, step,
        max(white, LEAST_NOISE_M) / np.sqrt(each),
    )  # fmt: skip


def select(bins: Bins, keep: Mask) -> Bins:
    return replace(bins, time_s=bins.time_s[keep], value_m=bins.value_m[keep], into=bins.into[keep])
