"""Decimate the phase of a beat to the motion's sample rate, block by block."""

from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.shot import Floats
from analysis.signal.filters import decimator_taps
from analysis.signal.tuning import Tuning

Singles = NDArray[np.float32]
_SPARE = 1024  # spare inputs, so that blocks of varying size do not reallocate the memory each time
_KERNEL: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz", "nnan"},
}


@njit(**_KERNEL)
def _filter(phase: Floats, taps: Floats, factor: int, outputs: int, out: Floats) -> None:
    """Write the dot products of the taps with windows of phase ``factor`` apart; 12 multiply-adds per input sample."""
    length = taps.shape[0]
    for k in range(outputs):
        stretch = phase[k * factor : k * factor + length]
        total = 0.0
        for i in range(length):
            total += taps[i] * stretch[i]
        out[k] = total


@njit(**_KERNEL)
def _describe(
    phase: Floats,
    power: Singles,
    factor: int,
    length: int,
    outputs: int,
    mean: Floats,
    rough: Floats,
) -> None:
    """Write mean power and local roughness of the phase over the central ``factor`` inputs of each output.

    Roughness is the squared third difference, divided by 20, of four neighbouring means of ``factor // 4`` phases (at
    least one): the variance of one mean if the motion is smooth.
    """
    part = max(1, factor // 4)
    for k in range(outputs):
        start = k * factor + (length - factor) // 2
        near = power[start : start + factor]
        total = np.float32(0)
        for i in range(factor):
            total += near[i]
        mean[k] = total / factor
        start = k * factor + (length - 4 * part) // 2
        p0, p1 = phase[start : start + part], phase[start + part : start + 2 * part]
        p2, p3 = phase[start + 2 * part : start + 3 * part], phase[start + 3 * part : start + 4 * part]
        m0, m1, m2, m3 = 0.0, 0.0, 0.0, 0.0
        for i in range(part):
            m0 += p0[i]
            m1 += p1[i]
            m2 += p2[i]
            m3 += p3[i]
        third = (m3 - 3 * m2 + 3 * m1 - m0) / part
        rough[k] = third * third / 20


@njit(**_KERNEL)
def _decimate(
    phase: Floats, power: Singles, kept: int, phases: Floats, powers: Singles, taps: Floats, factor: int, out: Floats
) -> int:
    """Append new inputs to the ``kept`` ones and write ``out``, shape (3, outputs); return the number of inputs kept.

    Costs 2.5 ns per input at a factor of 6.
    """
    total: int = kept + phase.shape[0]
    for i in range(phase.shape[0]):  # not a slice: numba takes seconds to compile the slice's shape-error message
        phases[kept + i] = phase[i]
        powers[kept + i] = power[i]
    outputs = out.shape[1]
    _filter(phases, taps, factor, outputs, out[0])
    _describe(phases, powers, factor, taps.shape[0], outputs, out[1], out[2])
    used: int = outputs * factor
    for i in range(total - used):
        phases[i] = phases[used + i]
        powers[i] = powers[used + i]
    return total - used


@njit(**_KERNEL)
def group_means(phase: Floats, power: Singles, group: int) -> tuple[Floats, Singles]:
    """Return the means of ``group`` neighbouring phases and powers, shape (n // group,).  Costs 0.3 ns per input."""
    groups = phase.shape[0] // group
    phases, powers = np.empty(groups), np.empty(groups, np.float32)
    for k in range(groups):
        turns, light = 0.0, np.float32(0)
        for i in range(group):
            turns += phase[k * group + i]
            light += power[k * group + i]
        phases[k], powers[k] = turns / group, light / np.float32(group)
    return phases, powers


def filtered(phase: Floats, taps: Floats) -> Floats:
    """Return the dot products of ``taps`` with every window of their length, shape (n - taps + 1,).

    Equal samples give equal values wherever a stream was cut, which a library convolution does not guarantee.
    """
    out = np.empty(max(0, phase.size - taps.size + 1))
    _filter(phase, taps, 1, out.size, out)
    return out


@lru_cache(maxsize=32)
def noise_ratio(tuning: Tuning, factor: int) -> float:
    """Return std of a decimated phase / sqrt(mean roughness), both for white noise on the counts."""
    window = tuning.window
    part = max(1, factor // 4)
    third = np.repeat([1.0, -3.0, 3.0, -1.0], part) / (part * np.sqrt(20.0))

    def gain(fine: Floats) -> float:
        spread = np.zeros((fine.size - 1) * tuning.decimation + 1)
        spread[:: tuning.decimation] = fine
        return float(np.sum(np.convolve(spread, window) ** 2))

    return float(np.sqrt(gain(decimator_taps(factor, tuning.spread)) / gain(third)))


class PhaseDecimator:
    """Decimates the phases of a ``BeatReader`` by ``factor``; output k is centred on phase k factor + 6 factor."""

    def __init__(self, factor: int, first_phase: int = 0, spread: float = 0.0) -> None:
        if factor < 2:
            raise ValueError(f"a phase is decimated by at least 2, not {factor}")
        self.factor = factor
        self.taps = decimator_taps(factor, spread)
        self.index = -(-first_phase // factor)  # index of the next output
        self._skip = self.index * factor - first_phase
        self._phase = np.empty(0)
        self._power: Singles = np.empty(0, np.float32)
        self._kept = 0

    def feed(self, phase: Floats, power: Singles) -> tuple[int, Floats, Floats]:
        """Decimate phases in cycles, with powers, shape (m,); return (first output's index, phase, power and noise).

        The phase has shape (k,); power and noise, shape (2, k), are the mean power, and the noise variance in cycles^2
        of a mean of ``factor // 4`` phases.
        """
        if self._skip:
            dropped = min(self._skip, phase.size)
            self._skip -= dropped
            phase, power = phase[dropped:], power[dropped:]
        total = self._kept + phase.size
        if self._phase.size < total:
            self._phase = np.concatenate((self._phase[: self._kept], np.empty(phase.size + _SPARE)))
            self._power = np.concatenate((self._power[: self._kept], np.empty(phase.size + _SPARE, np.float32)))
        out = np.empty((3, max(0, (total - self.taps.size) // self.factor + 1)))
        self._kept = _decimate(phase, power, self._kept, self._phase, self._power, self.taps, self.factor, out)
        first = self.index
        self.index += out.shape[1]
        return first, out[0], out[1:]
