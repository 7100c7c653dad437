"""The noise of a whole shot: the optics' white noise and a floor that never rests, by maximum likelihood.

Some milliseconds of quiet flight cannot show how far a floor wanders in fifty, so the floor is learnt from everything
a model leaves over, anew for every model that is compared: white noise plus Ornstein-Uhlenbeck processes
(d x = -x/tau dt + s dW; a long tau is a random walk), whose likelihood a Kalman filter gives exactly, gaps included
(Harvey, "Forecasting, Structural Time Series Models and the Kalman Filter", ch. 3).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import minimize

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
SHORTEST_TAU_S, LONGEST_TAU_S = 3e-4, 1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _gains(valid, white, q0, phi0, p0, q1, phi1, p1, gain, scale):  # type: ignore[no-untyped-def]
    """Write the Kalman gains, shape (n, 2), and 1/std of the innovations, shape (n,); about 15 ns a sample."""
    a, b, c = p0, 0.0, p1
    for i in range(valid.size):
        if i > 0:
            a, b, c = phi0 * phi0 * a + q0, phi0 * phi1 * b, phi1 * phi1 * c + q1
        if not valid[i]:
            gain[i, 0], gain[i, 1], scale[i] = 0.0, 0.0, 0.0
            continue
        variance = a + 2 * b + c + white
        k0, k1 = (a + b) / variance, (b + c) / variance
        gain[i, 0], gain[i, 1], scale[i] = k0, k1, 1.0 / math.sqrt(variance)
        a, b, c = a - k0 * (a + b), b - k0 * (b + c), c - k1 * (b + c)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovations(columns, gain, scale, phi0, phi1, out):  # type: ignore[no-untyped-def]
    """Write the innovations of every column over their std; about 5 ns a value."""
    n, width = columns.shape
    state = np.zeros((2, width))
    row = 0
    for i in range(n):
        if scale[i] == 0.0:
            for k in range(width):
                state[0, k] *= phi0
                state[1, k] *= phi1
            continue
        k0, k1, s = gain[i, 0], gain[i, 1], scale[i]
        for k in range(width):
            error = columns[i, k] - state[0, k] - state[1, k]
            out[row, k] = error * s
            state[0, k] = phi0 * (state[0, k] + k0 * error)
            state[1, k] = phi1 * (state[1, k] + k1 * error)
        row += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _log_likelihood(values, valid, white, q0, phi0, p0, q1, phi1, p1):  # type: ignore[no-untyped-def]
    """Return the log-likelihood of one gapped series; about 20 ns a sample."""
    a, b, c = p0, 0.0, p1
    s0, s1, total = 0.0, 0.0, 0.0
    for i in range(valid.size):
        if i > 0:
            a, b, c = phi0 * phi0 * a + q0, phi0 * phi1 * b, phi1 * phi1 * c + q1
            s0, s1 = phi0 * s0, phi1 * s1
        if not valid[i]:
            continue
        variance = a + 2 * b + c + white
        error = values[i] - s0 - s1
        total -= 0.5 * (error * error / variance + math.log(6.283185307179586 * variance))
        k0, k1 = (a + b) / variance, (b + c) / variance
        s0, s1 = s0 + k0 * error, s1 + k1 * error
        a, b, c = a - k0 * (a + b), b - k0 * (b + c), c - k1 * (b + c)
    return total


@dataclass(frozen=True, slots=True)
class Floor:
    """White noise of ``white_m`` a sample and up to two wandering parts of ``rms_m`` with memories ``tau_s``."""

    white_m: float
    rms_m: tuple[float, float]
    tau_s: tuple[float, float]
    spacing_s: float

    @property
    def std_m(self) -> float:
        """Get the standard deviation of one sample, floor and white noise together."""
        return math.sqrt(self.white_m**2 + self.rms_m[0] ** 2 + self.rms_m[1] ** 2)

    @property
    def parameters(self) -> int:
        """Get how many numbers were learnt."""
        return 1 + 2 * sum(rms > 0 for rms in self.rms_m)

    def _kalman(self) -> tuple[float, float, float, float, float, float, float]:
        phi = [math.exp(-self.spacing_s / tau) for tau in self.tau_s]
        var = [rms**2 for rms in self.rms_m]
        q = [v * -math.expm1(-2 * self.spacing_s / tau) for v, tau in zip(var, self.tau_s, strict=True)]
        return (self.white_m**2, q[0], phi[0], var[0], q[1], phi[1], var[1])

    def whiten(self, columns: Floats, valid: Mask) -> Floats:
        """Return ``columns``, shape (n, k), as unit white noise where their noise is this one; shape (m, k).

        One row a valid sample; the first rows know the floor's own spread, so no sample is lost.
        """
        kalman = self._kalman()
        gain, scale = np.empty((valid.size, 2)), np.empty(valid.size)
        _gains(valid, *kalman, gain, scale)
        out = np.empty((int(valid.sum()), columns.shape[1]))
        _innovations(np.ascontiguousarray(columns), gain, scale, kalman[2], kalman[5], out)
        return out

    def log_likelihood(self, values: Floats, valid: Mask) -> float:
        """Return the log-likelihood of one series, shape (n,), NaN allowed where not ``valid``."""
        return float(_log_likelihood(values, valid, *self._kalman()))

    def psd(self, frequency_hz: Floats) -> Floats:
        """Return the one-sided power density in m^2/Hz."""
        total = np.full(frequency_hz.shape, 2 * self.white_m**2 * self.spacing_s)
        for rms, tau in zip(self.rms_m, self.tau_s, strict=True):
            total += 4 * rms**2 * tau / (1 + (2 * np.pi * frequency_hz * tau) ** 2)
        return total

    def draw(self, samples: int, random: np.random.Generator) -> Floats:
        """Return one realisation, shape (samples,), in m."""
        total = self.white_m * random.standard_normal(samples)
        for rms, tau in zip(self.rms_m, self.tau_s, strict=True):
            if rms > 0:
                phi = math.exp(-self.spacing_s / tau)
                step = rms * math.sqrt(-math.expm1(-2 * self.spacing_s / tau)) * random.standard_normal(samples)
                step[0] = rms * random.standard_normal()
                for i in range(1, samples):
                    step[i] += phi * step[i - 1]
                total += step
        return total


def learn(
    series: Sequence[Floats], valid: Sequence[Mask], spacing_s: float, *, start: Floor | None = None, parts: int = 2
) -> tuple[Floor, float]:
    """Return the most likely floor of ``series`` (in m, one a shot) and its log-likelihood.

    Up to ``parts`` wandering parts are taken, each only where it pays by the Bayesian information criterion.
    With ``start`` the search begins there and keeps its number of parts.  About 10-30 ms for three shots.
    """
    values = [np.where(v, s, 0.0) for s, v in zip(series, valid, strict=True)]
    count = max(1, sum(int(v.sum()) for v in valid))
    rough = math.sqrt(sum(float(np.sum(s[v] ** 2)) for s, v in zip(values, valid, strict=True)) / count)
    quick = [np.diff(s, 3)[v[3:] & v[:-3]] for s, v in zip(values, valid, strict=True)]
    white = 1.4826 * float(np.median(np.abs(np.concatenate(quick)))) / math.sqrt(20) if count > 8 else rough
    white = max(white, 1e-3 * rough, 1e-18)

    def likelihood(floor: Floor) -> float:
        return sum(floor.log_likelihood(s, v) for s, v in zip(values, valid, strict=True))

    def search(begin: Floor, number: int) -> tuple[Floor, float]:
        def unpack(z: Floats) -> Floor:
            rms, tau = [0.0, 0.0], [1e-2, 1e-2]
            for j in range(number):
                rms[j] = math.exp(min(max(float(z[1 + 2 * j]), -60.0), 20.0))
                share = 1 / (1 + math.exp(-min(max(float(z[2 + 2 * j]), -40.0), 40.0)))
                tau[j] = SHORTEST_TAU_S * (LONGEST_TAU_S / SHORTEST_TAU_S) ** share
            return Floor(math.exp(min(max(float(z[0]), -60.0), 20.0)), (rms[0], rms[1]), (tau[0], tau[1]), spacing_s)

        def pack(floor: Floor) -> Floats:
            z = [math.log(floor.white_m)]
            for j in range(number):
                share = math.log(floor.tau_s[j] / SHORTEST_TAU_S) / math.log(LONGEST_TAU_S / SHORTEST_TAU_S)
                share = min(max(share, 1e-3), 1 - 1e-3)
                z += [math.log(max(floor.rms_m[j], 1e-2 * floor.white_m)), math.log(share / (1 - share))]
            return np.array(z)

        found = minimize(
            lambda z: -likelihood(unpack(z)),
            pack(begin),
            method="Nelder-Mead",
            options={
                "xatol": 1e-2,
                "fatol": 2e-2,
                "maxfev": 80 + 120 * number,
                "initial_simplex": _simplex(pack(begin)),
            },
        )
        return unpack(found.x), -float(found.fun)

    if start is not None:
        return search(start, sum(rms > 0 for rms in start.rms_m))
    best = Floor(rough, (0.0, 0.0), (1e-2, 1e-2), spacing_s)
    best_value = likelihood(best)
    wander = max(rough, white)
    for number, taus in ((1, (5e-3, 1e-2)), (2, (3e-2, 1e-3)))[:parts]:
        rms = (wander, 0.0) if number == 1 else (wander, 0.3 * wander)
        trial, value = search(Floor(white, rms, taus, spacing_s), number)
        if 2 * (value - best_value) < 2 * math.log(count):
            break
        best, best_value = trial, value
    return best, best_value


def _simplex(z: Floats) -> Floats:
    corners = np.repeat(z[None, :], z.size + 1, axis=0)
    for j in range(z.size):
        corners[j + 1, j] += 0.3 if j == 0 else 0.7
    return corners
