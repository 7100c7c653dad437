"""Noise and cyclic error of a displacement record that the tests draw without simulating its beats."""

import cmath
import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

from instrument.bench.optics import Optics
from instrument.bench.sines import path_vibration

Floats = NDArray[np.float64]


def displacement_noise_m(optics: Optics, sample_rate_hz: float, record_rate_hz: float, *, both: bool = True) -> float:
    """Return the standard deviation of displacement at ``record_rate_hz``, decimated from ``sample_rate_hz``.

    Phase variance 1 / (N SNR) a beat over N averaged samples; ``both``: PD0 is taken off sample by sample.
    """
    averaged = sample_rate_hz / record_rate_hz
    variance = 10 ** (-optics.measurement_snr_db / 10) / averaged
    if both and optics.with_reference:
        variance += 10 ** (-optics.reference_snr_db / 10) / averaged
    return optics.wavelength_m / (4 * math.pi) * math.sqrt(variance)


class NoiseKind(StrEnum):
    """How the noise of a displacement record is coloured."""

    WHITE = "white"  # the optics alone
    LOW_PASSED = "low_passed"  # the same after a 10 kHz filter
    DRIFTING = "drifting"  # white and a random walk
    FLOOR = "floor"  # white and the building


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise of a displacement record; ``white_m`` is the standard deviation of one sample."""

    kind: NoiseKind = NoiseKind.WHITE
    white_m: float = 1e-10
    cut_hz: float = 10e3
    walk_share: float = 0.05  # of white_m, each sample's step
    floor_m: float = 3e-10

    def draw(self, samples: int, rate_hz: float, random: np.random.Generator) -> Floats:
        """Return ``samples`` of noise in m at ``rate_hz``."""
        white: Floats = self.white_m * random.standard_normal(samples + 1000)
        if self.kind is NoiseKind.LOW_PASSED:
            white = sosfilt(butter(4, self.cut_hz, fs=rate_hz, output="sos"), white)
        white = white[1000:]  # without the filter's beginning
        if self.kind is NoiseKind.DRIFTING:
            white = white + np.cumsum(self.walk_share * self.white_m * random.standard_normal(samples))
        if self.kind is NoiseKind.FLOOR:
            floor = path_vibration(self.floor_m, int(random.integers(2**31)))
            white = white + floor.motion(np.arange(samples) / rate_hz)[0]
        return white


def cyclic_m(optics: Optics, x_m: Floats) -> Floats:
    """Return the displacement error of the leak: lambda/(4 pi) times the phase of the sum of both lights."""
    if optics.leak_m == 0.0:
        return np.zeros_like(x_m)
    scale = optics.wavelength_m / (4 * math.pi)
    leak = optics.leak_m / scale * cmath.exp(2j * math.pi * optics.leak_turns)
    # the beat is cos(rest - x / scale); the leak stands at -(1 - order) x / scale against the same rest
    turned = leak * np.exp(1j * (x_m / scale) * optics.leak_order)
    error: Floats = -scale * np.angle(1.0 + turned)
    return error
