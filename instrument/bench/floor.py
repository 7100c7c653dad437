"""The building's floor: a displacement of some tenths of a nanometre that never rests."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

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
        self._omega = 2 * np.pi * frequency_hz
        self._amplitude_m = amplitude
        self._phase = random.uniform(0, 2 * np.pi, LINES)

    def at(self, start_s: float, spacing_s: float, n: int) -> tuple[Floats, Floats]:
        """Return displacement (m) and velocity (m/s) at ``n`` times of equal spacing."""
        x, v = np.zeros(n), np.zeros(n)
        _add_lines(start_s, spacing_s, self._omega, self._amplitude_m, self._phase, x, v)
        return x, v


@njit(cache=True, nogil=True, error_model="numpy")
def _add_lines(
    start_s: float, spacing_s: float, omega: Floats, amplitude: Floats, phase: Floats, x: Floats, v: Floats
) -> None:
    """Add sines by rotation.  Cost: about 2 ns a line and time."""
    for k in range(omega.shape[0]):
        c, s = np.cos(omega[k] * start_s + phase[k]), np.sin(omega[k] * start_s + phase[k])
        dc, ds = np.cos(omega[k] * spacing_s), np.sin(omega[k] * spacing_s)
        for i in range(x.shape[0]):
            x[i] += amplitude[k] * s
            v[i] += amplitude[k] * omega[k] * c
            c, s = c * dc - s * ds, s * dc + c * ds
