"""The optics' own floor: a displacement of some tenths of a nanometre that never rests."""

import numpy as np
from numpy.typing import NDArray

from instrument.bench.sines import Sines

Floats = NDArray[np.float64]
LINES = 64
LOWEST_HZ, HIGHEST_HZ = 4.0, 800.0


class Floor:
    """Many lines, closer together the lower they are, so that the spectrum falls as 1/f; any time can be asked for."""

    def __init__(self, rms_m: float, seed: int) -> None:
        """Get ready ``rms_m`` (m, whole band) of vibration; the same seed gives the same floor."""
        random = np.random.default_rng((seed, 0xF1))
        edges = np.geomspace(LOWEST_HZ, HIGHEST_HZ, LINES + 1)
        frequency_hz = random.uniform(edges[:-1], edges[1:])
        amplitude = random.rayleigh(1.0, LINES) / frequency_hz**0.5
        amplitude *= rms_m / np.sqrt(np.sum(amplitude**2) / 2)
        self._sines = Sines(2 * np.pi * frequency_hz, amplitude, random.uniform(0, 2 * np.pi, LINES))

    def at(self, start_s: float, spacing_s: float, n: int) -> tuple[Floats, Floats]:
        """Return displacement (m) and velocity (m/s) at ``n`` times of equal spacing."""
        return self._sines.at(start_s, spacing_s, n)
