"""Evaluate sums of sines at arbitrary times, and interpolate between nodes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PATH_LINES = 64
PATH_LOWEST_HZ, PATH_HIGHEST_HZ = 4.0, 800.0
_PHASE_STEP = 0.45  # rad of the fastest sine between nodes
_STRETCH = 512  # nodes summed at a time: 0.15 s at 250 Hz


@dataclass(frozen=True)
class Sines:
    """A displacement sum A_k sin(omega_k t + phi_k); arrays of shape (k,), in rad/s, m and rad."""

    omega: Floats
    amplitude_m: Floats
    phase: Floats

    def plus(self, other: "Sines") -> "Sines":
        """Return the sum of both."""
        pairs = ((self.omega, other.omega), (self.amplitude_m, other.amplitude_m), (self.phase, other.phase))
        return Sines(*(np.concatenate(pair) for pair in pairs))

    def motion(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return displacement (m) and velocity (m/s) at ascending times, shape (n,).

        The sums are evaluated at nodes spaced by the fastest sine, and interpolated to the fifth degree: error 2e-7.
        Cost: 2 ns per sine and millisecond of record at 250 Hz, and 8 ns per time.
        """
        if not self.omega.size:
            return np.zeros_like(time_s), np.zeros_like(time_s)
        spacing_s = self._nodes[0]
        first, last = (int(np.floor(float(t) / spacing_s)) for t in (time_s[0], time_s[-1]))
        stretches = range(first // _STRETCH, (last + 1) // _STRETCH + 1)
        begin_s = stretches[0] * _STRETCH * spacing_s
        sums = np.concatenate([self._stretch(k) for k in stretches], axis=1)
        moved: tuple[Floats, Floats] = _interpolate_fifth(begin_s, spacing_s, sums, time_s)
        return moved

    def _stretch(self, k: int) -> Floats:
        """Return displacement and its first two derivatives (3, _STRETCH) at the nodes of stretch ``k``.

        The newest two stretches are kept, as a stream read in short blocks needs the same stretch many times.
        """
        kept = self._stretches
        if k in kept:
            return kept[k]
        spacing_s, turn = self._nodes
        sums = np.zeros((3, _STRETCH))
        start = _on_circle(self.omega * (k * _STRETCH * spacing_s) + self.phase)
        _add_sines(start, turn, self.omega, self.amplitude_m, sums)
        kept[k] = sums
        if len(kept) > 2:
            del kept[next(iter(kept))]
        return sums

    @cached_property
    def _stretches(self) -> dict[int, Floats]:
        return {}

    @cached_property
    def _nodes(self) -> tuple[float, Floats]:
        """Get the spacing in s of the nodes of ``motion``, and each sine's rotation from one node to the next."""
        spacing_s = _PHASE_STEP / float(self.omega.max())
        return spacing_s, _on_circle(self.omega * spacing_s)

    def acceleration(self, spacing_s: float, n: int) -> tuple[Floats, Floats]:
        """Return acceleration (m/s2) and jerk (m/s3) at ``n`` times of equal spacing from time zero on."""
        sums = np.zeros((3, n))
        start, turn = _on_circle(self.phase), _on_circle(self.omega * spacing_s)
        _add_sines(start, turn, self.omega, -(self.omega**2) * self.amplitude_m, sums)
        return sums[0], sums[1]


def _on_circle(angle: Floats) -> Floats:
    """Return cosine and sine of angles (k,), shape (2, k)."""
    return np.stack((np.cos(angle), np.sin(angle)))


def path_vibration(rms_m: float, seed: int) -> Sines:
    """Return the optical path's vibration: sines spaced logarithmically, with an amplitude density as 1/f.

    ``rms_m`` is the rms displacement over the whole band; the same seed draws the same sines.
    """
    random = np.random.default_rng((seed, 0xF1))
    edges = np.geomspace(PATH_LOWEST_HZ, PATH_HIGHEST_HZ, PATH_LINES + 1)
    frequency_hz = random.uniform(edges[:-1], edges[1:])
    amplitude = random.rayleigh(1.0, PATH_LINES) / frequency_hz**0.5
    amplitude *= rms_m / np.sqrt(np.sum(amplitude**2) / 2)
    return Sines(2 * np.pi * frequency_hz, amplitude, random.uniform(0, 2 * np.pi, PATH_LINES))


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc"})  # the sum over sines, in any order
def _add_sines(start, turn, omega, amplitude, sums) -> None:  # type: ignore[no-untyped-def]
    """Add sines and their first two derivatives to ``sums`` (3, n), rotating all sines from one time to the next.

    ``start`` and ``turn``, (2, k), are each sine's (cos, sin) at the first time, and its rotation from one time to the
    next.  Cost: about 0.5 ns per sine and time.
    """
    c, s, dc, ds = start[0].copy(), start[1].copy(), turn[0], turn[1]
    speed, bend = amplitude * omega, -amplitude * omega * omega
    for i in range(sums.shape[1]):
        moved, rate, bent = 0.0, 0.0, 0.0
        for k in range(omega.shape[0]):
            moved += amplitude[k] * s[k]
            rate += speed[k] * c[k]
            bent += bend[k] * s[k]
            turned = c[k] * dc[k] - s[k] * ds[k]
            s[k] = s[k] * dc[k] + c[k] * ds[k]
            c[k] = turned
        sums[0, i] += moved
        sums[1, i] += rate
        sums[2, i] += bent


@njit(cache=True, nogil=True, error_model="numpy")
def _interpolate_fifth(begin_s: float, spacing_s: float, nodes: Floats, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the quintic Hermite interpolant and its slope at ascending times, shape (n,).

    ``nodes`` (3, m): value, slope and curvature, from ``begin_s`` on.  Cost: about 8 ns per time.
    """
    x, v, a = nodes[0], nodes[1], nodes[2]
    result, rate = np.empty(time_s.shape[0]), np.empty(time_s.shape[0])
    last = x.shape[0] - 2
    for i in range(time_s.shape[0]):
        at = (time_s[i] - begin_s) / spacing_s
        j = min(int(at), last)
        u = at - j
        # the polynomial x_j + slope u + bend u^2 / 2 + u^3 (c3 + c4 u + c5 u^2) that meets node j + 1
        slope, bend = spacing_s * v[j], spacing_s * spacing_s * a[j]
        d = x[j + 1] - x[j] - slope - 0.5 * bend
        e = spacing_s * v[j + 1] - slope - bend
        f = spacing_s * spacing_s * a[j + 1] - bend
        c3, c4, c5 = 10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f
        result[i] = x[j] + u * (slope + u * (0.5 * bend + u * (c3 + u * (c4 + u * c5))))
        rate[i] = (slope + u * (bend + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / spacing_s
    return result, rate


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
        u = (t - node_s[j]) / h
        d = value[j + 1] - value[j]
        a = h * slope[j] - d
        b = d - h * slope[j + 1]
        w = 1.0 - u
        result[i] = value[j] + u * (d + w * (a * w + b * u))
        rate[i] = (d + (w - u) * (a * w + b * u) + u * w * (b - a)) / h
    return result, rate


def interpolate(node_s: Floats, value: Floats, slope: Floats, time_s: Floats) -> Floats:
    """Return the cubic Hermite interpolant of nodes at ascending times."""
    result: Floats = interpolate_with_slope(node_s, value, slope, time_s)[0]
    return result
