"""The floor under the rig as flights show it: a random motion whose spectrum is one of a few shapes, and how strong.

A flight of some milliseconds does not show how far the floor wanders in tens of them, so no one shape is chosen: every
shape and strength is weighed by how likely it makes the flights (restricted maximum likelihood, Patterson & Thompson,
Biometrika 58, 1971), and what follows is the mixture of all.  Shapes: a random walk that is held back (density falling
with f^2 above a corner), the same once more integrated (f^4), and the curve of a building at a vibration criterion
(Gordon, SPIE 1619, 1991: the same velocity in each third of an octave from 8 to 80 Hz), and white.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Floats = NDArray[np.float64]

CORNERS = (1 / 32, 1 / 8, 1 / 2, 2.0)  # correlation times, of the whole time that the flights span
STRENGTHS = np.geomspace(1e-3, 1e11, 48)  # variance of the floor, in units of the white noise of a bin
LEAST_WEIGHT = 0.01
_CRITERION_HZ = np.geomspace(1.0, 400.0, 120)


@dataclass(frozen=True, slots=True)
class Shape:
    """A floor's covariance with unit variance; ``kind`` "white", "walk", "smooth" or "criterion"."""

    kind: str
    time_s: float = 0.0  # correlation time

    def covariance(self, lag_s: Floats) -> Floats:
        """Return the covariance at lags of any shape."""
        lag = np.abs(lag_s)
        if self.kind == "white":
            return np.asarray(lag == 0.0, dtype=np.float64)
        if self.kind == "walk":
            return np.asarray(np.exp(-lag / self.time_s))
        if self.kind == "smooth":
            return np.asarray((1.0 + lag / self.time_s) * np.exp(-lag / self.time_s))
        weight = _criterion_weights()
        return np.asarray(np.cos(2 * np.pi * lag[..., None] * _CRITERION_HZ) @ weight)

    def matrix(self, time_s: Floats) -> Floats:
        """Return the covariance between all pairs of times, (n, n), positive by construction."""
        if self.kind != "criterion":
            return self.covariance(time_s[:, None] - time_s[None, :])
        angle = 2 * np.pi * time_s[:, None] * _CRITERION_HZ
        root = np.sqrt(_criterion_weights())
        waves = np.concatenate([np.cos(angle) * root, np.sin(angle) * root], axis=1)
        return np.asarray(waves @ waves.T)

    def psd(self, frequency_hz: Floats) -> Floats:
        """Return the one-sided density in 1/Hz; nothing for "white", which belongs to the samples, not to the floor."""
        omega = 2 * np.pi * np.asarray(frequency_hz, dtype=np.float64)
        if self.kind == "white":
            return np.zeros_like(omega)
        if self.kind == "walk":
            return np.asarray(4.0 * self.time_s / (1.0 + (omega * self.time_s) ** 2))
        if self.kind == "smooth":
            return np.asarray(8.0 * self.time_s / (1.0 + (omega * self.time_s) ** 2) ** 2)
        return _criterion_psd(np.asarray(frequency_hz, dtype=np.float64))


def _criterion_psd(frequency_hz: Floats) -> Floats:
    f = np.clip(frequency_hz, 0.3, None)
    velocity = np.minimum(1.0, f / 8.0) * np.minimum(1.0, (80.0 / f) ** 2)
    density = velocity**2 / f**3
    return np.asarray(density / _criterion_scale())


@lru_cache(maxsize=1)
def _criterion_scale() -> float:
    f = _CRITERION_HZ
    velocity = np.minimum(1.0, f / 8.0) * np.minimum(1.0, (80.0 / f) ** 2)
    return float(np.trapezoid(velocity**2 / f**3, f))


@lru_cache(maxsize=1)
def _criterion_weights() -> Floats:
    weight = np.gradient(_CRITERION_HZ) * _criterion_psd(_CRITERION_HZ)
    return np.asarray(weight / weight.sum())


@dataclass(frozen=True, slots=True)
class Floor:
    """A mixture of floors: ``parts`` are (weight, shape, variance in m^2); ``white_std_m`` is that of one sample."""

    parts: tuple[tuple[float, Shape, float], ...]
    white_std_m: float
    sample_rate_hz: float

    @property
    def rms_m(self) -> float:
        """Get the floor's rms displacement in m, without the white noise of the samples: the median of the mixture."""
        size = np.array([0.0 if shape.kind == "white" else variance for _, shape, variance in self.parts])
        order = np.argsort(size)
        reached = np.cumsum(np.array([part[0] for part in self.parts])[order])
        return float(np.sqrt(size[order[int(np.searchsorted(reached, 0.5 * reached[-1]))]]))

    def difference_std_m(self, lag_s: float) -> float:
        """Return the std of how far the floor moves within a time."""
        lag = np.array([lag_s])
        return float(np.sqrt(sum(w * 2 * v * (1 - shape.covariance(lag)[0]) for w, shape, v in self.parts)))

    def bend_std_m(self, lag_s: float) -> float:
        """Return the std of the floor's third difference: what a parabola through it misses one step beyond."""
        lags, weights = np.asarray(lag_s * np.arange(4), np.float64), np.array([20.0, -30.0, 12.0, -2.0])
        squares = (w * v * float(weights @ s.covariance(lags)) for w, s, v in self.parts if s.kind != "white")
        return float(np.sqrt(max(sum(squares), 0.0)))

    def psd(self, frequency_hz: Floats) -> Floats:
        """Return the one-sided density of white noise and floor in m^2/Hz."""
        white = 2.0 * self.white_std_m**2 / self.sample_rate_hz
        return np.asarray(white + sum(w * v * shape.psd(frequency_hz) for w, shape, v in self.parts))

    def velocity_rms_m_per_s(self, bandwidth_hz: float) -> float:
        """Return the floor's rms velocity below a bandwidth."""
        f = np.geomspace(0.5, bandwidth_hz, 400)
        density = self.psd(f) - 2.0 * self.white_std_m**2 / self.sample_rate_hz
        return float(np.sqrt(np.trapezoid((2 * np.pi * f) ** 2 * density, f)))


@dataclass(frozen=True, slots=True)
class Weighing:
    """How likely each floor is for one set of bins; ``covariance`` are those of the likeliest, scaled to white bins.

    ``parts`` are (weight, index of shape, strength), the likeliest first.
    """

    shapes: tuple[Shape, ...]
    scaled: tuple[Floats, ...]  # covariance matrices of each shape over the bins, in units of the white noise
    parts: tuple[tuple[float, int, float], ...]

    def total(self, part: int) -> Floats:
        """Return the covariance matrix of the bins in one part, in units of the white noise."""
        _, shape, strength = self.parts[part]
        return np.asarray(np.eye(self.scaled[shape].shape[0]) + strength * self.scaled[shape])


def shapes_for(span_s: float) -> tuple[Shape, ...]:
    """Return the shapes worth trying on flights that span a time."""
    bent = tuple(Shape(kind, corner * span_s) for kind in ("walk", "smooth") for corner in CORNERS)
    return (Shape("white"), Shape("criterion"), *bent)


def weigh(shapes: tuple[Shape, ...], time_s: Floats, values: Floats, design: Floats) -> Weighing:
    """Weigh every shape and strength by its restricted likelihood.

    ``values`` (n,) and ``design`` (n, p) are divided by the white noise of a bin.  Cost: one symmetric eigenvalue
    problem of n - p a shape, about a millisecond at n = 90.
    """
    full, _ = np.linalg.qr(design / np.maximum(np.abs(design).max(axis=0), 1e-300), mode="complete")
    null = full[:, design.shape[1] :]
    rest = null.T @ values
    scaled = tuple(shape.matrix(time_s) for shape in shapes)
    likelihood = np.empty((len(shapes), STRENGTHS.size))
    for k, matrix in enumerate(scaled):
        level, turn = np.linalg.eigh(null.T @ matrix @ null)
        power = (turn.T @ rest) ** 2
        spread = 1.0 + STRENGTHS[:, None] * np.maximum(level, 0.0)[None, :]
        likelihood[k] = -0.5 * (np.log(spread) + power / spread).sum(axis=1)
    weight = np.exp(likelihood - likelihood.max())
    order = np.argsort(weight, axis=None)[::-1]
    kept = [int(i) for i in order if weight.flat[i] > LEAST_WEIGHT * weight.flat[order[0]]]
    total = float(sum(weight.flat[i] for i in kept))
    parts = tuple(
        (float(weight.flat[i]) / total, i // STRENGTHS.size, float(STRENGTHS[i % STRENGTHS.size])) for i in kept
    )
    return Weighing(shapes, scaled, parts)


def likelihood(weighing: Weighing, values: Floats, design: Floats) -> float:
    """Return the log-likelihood of the bins under the likeliest floor, the design's coefficients at their best."""
    factor = cho_factor(weighing.total(0), lower=True, check_finite=False)
    design = design / np.maximum(np.abs(design).max(axis=0), 1e-300)
    across = cho_solve(factor, design, check_finite=False)
    solution = np.linalg.solve(design.T @ across, across.T @ values)
    rest = values - design @ solution
    chi2 = float(rest @ cho_solve(factor, rest, check_finite=False))
    return -float(np.log(np.diag(factor[0])).sum()) - 0.5 * chi2


def solve(weighing: Weighing, values: Floats, design: Floats) -> tuple[Floats, Floats]:
    """Return coefficients (p,) and covariance (p, p) of the mixture: generalised least squares in every part."""
    size = np.maximum(np.abs(design).max(axis=0), 1e-300)
    design = design / size
    solutions: list[Floats] = []
    covariances: list[Floats] = []
    weights = np.array([part[0] for part in weighing.parts])
    for place in range(len(weighing.parts)):
        factor = cho_factor(weighing.total(place), lower=True, check_finite=False)
        across = cho_solve(factor, design, check_finite=False)
        covariance = np.linalg.inv(design.T @ across)
        covariances.append(covariance)
        solutions.append(covariance @ (across.T @ values))
    mean = np.asarray(weights @ np.stack(solutions))
    apart = np.stack(solutions) - mean
    spread = np.einsum("k,ki,kj->ij", weights, apart, apart)
    covariance = np.einsum("k,kij->ij", weights, np.stack(covariances)) + spread
    return mean / size, np.asarray(covariance / np.outer(size, size))


def floor_of(weighing: Weighing, bin_std_m: float, white_std_m: float, sample_rate_hz: float) -> Floor:
    """Return the mixture in SI units; bins had the white noise ``bin_std_m``."""
    parts: Sequence[tuple[float, int, float]] = weighing.parts
    return Floor(
        tuple((w, weighing.shapes[k], strength * bin_std_m**2) for w, k, strength in parts), white_std_m, sample_rate_hz
    )
