"""Sums of sines at any times, and interpolation between their nodes."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PATH_LINES = 64
PATH_LOWEST_HZ, PATH_HIGHEST_HZ = 4.0, 800.0


@dataclass(frozen=True, slots=True)
class Sines:
    """Displacement sum A_k sin(omega_k t + phi_k); arrays of shape (k,), in rad/s, m and rad."""

    omega: Floats
    amplitude_m: Floats
    phase: Floats

    def plus(self, other: "Sines") -> "Sines":
        """Return both sums together."""
        pairs = ((self.omega, other.omega), (self.amplitude_m, other.amplitude_m), (self.phase, other.phase))
        return Sines(*(np.concatenate(pair) for pair in pairs))

    def at(self, start_s: float, spacing_s: float, n: int) -> tuple[Floats, Floats]:
        """Return displacement (m) and velocity (m/s) at ``n`` times of equal spacing."""
        x, v = np.zeros(n), np.zeros(n)
        _add_sines(start_s, spacing_s, self.omega, self.amplitude_m, self.phase, x, v)
        return x, v

    def acceleration(self, start_s: float, spacing_s: float, n: int) -> tuple[Floats, Floats]:
        """Return acceleration (m/s2) and its rate (m/s3) at ``n`` times of equal spacing."""
        a, jerk = np.zeros(n), np.zeros(n)
        _add_sines(start_s, spacing_s, self.omega, -(self.omega**2) * self.amplitude_m, self.phase, a, jerk)
        return a, jerk


class PathVibration:
    """Vibration of the optical path: a sum of sines, denser at low frequencies, with a spectrum that falls as 1/f."""

    def __init__(self, rms_m: float, seed: int) -> None:
        """Draw the sines from the seed; ``rms_m`` is the rms displacement of the whole band."""
        random = np.random.default_rng((seed, 0xF1))
        edges = np.geomspace(PATH_LOWEST_HZ, PATH_HIGHEST_HZ, PATH_LINES + 1)
        frequency_hz = random.uniform(edges[:-1], edges[1:])
        amplitude = random.rayleigh(1.0, PATH_LINES) / frequency_hz**0.5
        amplitude *= rms_m / np.sqrt(np.sum(amplitude**2) / 2)
        self._sines = Sines(2 * np.pi * frequency_hz, amplitude, random.uniform(0, 2 * np.pi, PATH_LINES))

    def at(self, start_s: float, spacing_s: float, n: int) -> tuple[Floats, Floats]:
        """Return displacement (m) and velocity (m/s) at ``n`` times of equal spacing."""
        return self._sines.at(start_s, spacing_s, n)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc"})  # the sum over sines, in any order
def _add_sines(
    start_s: float, spacing_s: float, omega: Floats, amplitude: Floats, phase: Floats, x: Floats, v: Floats
) -> None:
    """Add sines by rotation, all of them from one time to the next.  Cost: about 0.4 ns per sine and time."""
    c, s = np.cos(omega * start_s + phase), np.sin(omega * start_s + phase)
    dc, ds = np.cos(omega * spacing_s), np.sin(omega * spacing_s)
    speed = amplitude * omega
    for i in range(x.shape[0]):
        moved, rate = 0.0, 0.0
        for k in range(omega.shape[0]):
            moved += amplitude[k] * s[k]
            rate += speed[k] * c[k]
            turned = c[k] * dc[k] - s[k] * ds[k]
            s[k] = s[k] * dc[k] + c[k] * ds[k]
            c[k] = turned
        x[i] += moved
        v[i] += rate


@njit(cache=True, nogil=True, error_model="numpy")
def interpolate_with_slope(node_s: Floats, value: Floats, slope: Floats, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the cubic Hermite interpolant of nodes at ascending times, and its slope.  Cost: about 10 ns per time."""
    result, rate = np.empty(time_s.shape[0]), np.empty(time_s.shape[0])
    j = 0
    last = node_s.shape[0] - 2
    for i in range(time_s.shape[0]):
        t = time_s[i]
        while j < last and node_s[j + 1] <= t:
            j += 1
        h = node_s[j + 1] - node_s[j]
        u = (t - node_s[j]) / h if h > 0.0 else 0.0
        d = value[j + 1] - value[j]
        a = h * slope[j] - d
        b = d - h * slope[j + 1]
        w = 1.0 - u
        result[i] = value[j] + u * (d + w * (a * w + b * u))
        rate[i] = (d + (w - u) * (a * w + b * u) + u * w * (b - a)) / h if h > 0.0 else slope[j]
    return result, rate


def interpolate(node_s: Floats, value: Floats, slope: Floats, time_s: Floats) -> Floats:
    """Return the cubic Hermite interpolant of nodes at ascending times."""
    result: Floats = interpolate_with_slope(node_s, value, slope, time_s)[0]
    return result
