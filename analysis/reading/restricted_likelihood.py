"""Estimate strengths of white noise and of bands of random motion by restricted likelihood with a normal prior.

A shot's residual is y = X b + motion + white noise.  The columns of X are derivatives by free parameters b, which shots
may share.  The motion has covariance sum_k s_k V_k, with V_k that of band k at strength one.  The restricted likelihood
(Patterson & Thompson, Biometrika 58, 1971) allows for motion absorbed by the parameters.  The vector searched is
(ln white^2, ln s_1, ln s_2 ...); known white noise has a narrow prior.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri

from analysis.compiled import side_by_side, solve_triangle
from analysis.shot import Floats

Result = TypeVar("Result")
_ITERATIONS, _MOST = 20, 3.0  # most steps; largest step of a logarithm
_ENOUGH, _LEAST = 5e-3, 1e-3  # first-order gain and actual gain of ln L by a step, below which the search ends
_TRIES, _SHORTER = 5, 0.3  # trials of one step, and the length of each relative to the one before
_GAIN_TOLERANCE = 0.15  # allowed deviation of actual over first-order gain from 1/2, its value for a correct curvature
_NEAR = 0.5  # largest step of a logarithm over which a curvature is corrected instead of computed anew
_LARGE = 200_000  # numbers in a shot's covariances of bands, from which on two threads speed up curvatures
_MIN_LEVEL = 1e-3  # least eigenvalue of a curvature: priors make it larger unless rounding interferes


@dataclass(frozen=True)
class Bands:
    """The motion of k bands along r directions, by m independent unit normal numbers.

    ``factors``, shape (r, m), map the numbers to the directions; ``shares``, shape (k, m), are their variances by each
    band at strength one.
    """

    factors: Floats
    shares: Floats

    @cached_property
    def covariances(self) -> Floats:
        """Get the covariance along the directions by each band at strength one, as rows of shape (k, r^2)."""
        out = np.empty((len(self.shares), len(self.factors), len(self.factors)))
        for covariance, share in zip(out, self.shares, strict=True):
            some = np.flatnonzero(share)
            moved = self.factors[:, some] * np.sqrt(share[some])
            np.matmul(moved, moved.T, out=covariance)
        return out.reshape(len(out), -1)

    def root(self, at: Floats, rounding: float = 0.0) -> Floats:
        """Return the Cholesky factor of the covariance of white noise and motion along the directions, (r, r), lower.

        It is in units of the white variance; ``at`` is (ln white^2, ln strengths).  The motion's diagonal is first
        increased by its fraction ``rounding``.  LinAlgError if rounding leaves no Cholesky factor.
        """
        motion = (np.exp(at[1:] - at[0]) @ self.covariances).reshape(len(self.factors), -1)
        diagonal = np.einsum("ii->i", motion)  # a view
        diagonal += 1.0 + rounding * diagonal
        upper, failed = dpotrf(motion.T, overwrite_a=True)
        if failed or not np.isfinite(upper[-1, -1]):
            raise np.linalg.LinAlgError("the covariance has no Cholesky factor")
        return np.asarray(upper.T)


@dataclass(frozen=True, slots=True)
class ShotResidual:
    """A shot's residual and its derivatives by q parameters, whitened to unit variance by its noise without the bands.

    ``along``, shape (r, 1 + q), are both along the r orthonormal directions of the bands' motion; ``rest_products``,
    shape (1 + q, 1 + q), are the products of their components orthogonal to these directions.  ``samples`` counts all
    directions; ``logs`` is ln det of the whitening covariance.  ``places``, shape (q,), are the parameters' indices.
    ``rounding`` is the relative increase of the diagonal of the bands' covariance.
    """

    along: Floats
    rest_products: Floats
    samples: int
    logs: float
    places: NDArray[np.intp]
    bands: Bands
    rounding: float = 0.0

    def whitened(self, at: Floats) -> "_Whitened":
        """Return the shot whitened by its whole covariance; LinAlgError if that is singular to rounding."""
        root, half, products = self._factored(at)
        triangle, _ = dpotri(root.T)  # half of the symmetric inverse, zero elsewhere
        inverse = triangle + triangle.T
        np.einsum("ii->i", inverse)[:] *= 0.5
        return _Whitened(root, half, products, inverse)

    def products(self, at: Floats) -> Floats:
        """Return the products of residual and derivatives, fully whitened, shape (1 + q, 1 + q)."""
        return self._factored(at)[2]

    def _factored(self, at: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the Cholesky factor of the covariance, ``along`` divided by it, and ``products``."""
        root = self.bands.root(at, self.rounding)
        half = solve_triangle(root, self.along, lower=True)
        return root, half, np.asarray(self.rest_products + half.T @ half)


@dataclass(frozen=True, slots=True)
class _Whitened:
    """A shot whitened by the covariance along its directions, in units of the white variance.

    ``root``, shape (r, r), is the covariance's Cholesky factor; ``half``, shape (r, 1 + q), are residual and
    derivatives divided by it; ``products``, shape (1 + q, 1 + q), are those of the fully whitened residual and
    derivatives; ``inverse``, shape (r, r), is the inverse covariance.
    """

    root: Floats
    half: Floats
    products: Floats
    inverse: Floats


@dataclass(slots=True)
class Curvature:
    """The curvature of the log-likelihood by the logarithms, as last computed or corrected; None before."""

    value: Floats | None = None


@dataclass(slots=True)
class Likelihood:
    """Log-likelihood plus log prior at (ln white^2, ln strengths), its gradient, and intermediate results.

    ``covariance``, shape (q, q), is that of the fitted parameters; ``profile`` is log-likelihood plus log prior with
    these at their best instead of marginalised.  ``inverses``, shape (r, r) each, are each shot's inverse covariance
    along its directions with the parameters marginalised, in units of the white variance; ``curvature`` is cached.
    """

    at: Floats
    value: float
    slope: Floats
    profile: float = -math.inf
    whitened: Sequence[_Whitened] = ()
    inverses: Sequence[Floats] = ()
    covariance: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    curvature: Floats | None = None


@dataclass(frozen=True, slots=True)
class RestrictedLikelihood:
    """The restricted likelihood of shots, and the normal prior of (ln white^2, ln strengths), with mean zero.

    ``precision``, shape (1 + k, 1 + k), is the prior's inverse covariance.
    """

    shots: Sequence[ShotResidual]
    precision: Floats

    def at(self, at: Floats) -> Likelihood:
        """Return log-likelihood plus log prior and its gradient at a vector; minus infinity if undefined.

        Cost: r^2 (r + 2 k) multiply-adds per shot, r directions, k bands: 0.4 ms for r = 128, too little for a second
        thread.
        """
        pull = self.precision @ at
        value = -0.5 * float(at @ pull)
        slope = -pull
        variance = math.exp(at[0])
        try:
            whitened = [shot.whitened(at) for shot in self.shots]
            products = [one.products[None] for one in whitened]
            (values,), (covariance,), (half_logs,) = self._parameters_under(products, np.array([variance]))
        except np.linalg.LinAlgError:  # rounding breaks the factorisation for motion a billion times the white noise
            return Likelihood(at, -math.inf, slope)
        slope[0] += 0.5 * values.size
        inverses = []
        for shot, one in zip(self.shots, whitened, strict=True):
            numbers = np.concatenate([[1.0], -values[shot.places]])
            square = float(numbers @ one.products @ numbers) / variance
            across = one.inverse @ shot.along
            free = across[:, 1:]
            inverses.append(one.inverse - free @ (covariance[np.ix_(shot.places, shot.places)] / variance) @ free.T)
            rest = across @ numbers
            excess = np.outer(rest / variance, rest) - inverses[-1]  # measured less expected, zero on average
            of_band = np.exp(at[1:] - at[0]) * (shot.bands.covariances @ excess.ravel())
            logs = 2.0 * float(np.log(np.diag(one.root)).sum()) + shot.logs
            logs += shot.samples * math.log(2 * math.pi * variance)
            value -= 0.5 * (logs + square)
            slope[1:] += 0.5 * of_band
            slope[0] += 0.5 * (square - shot.samples - float(of_band.sum()))
        return Likelihood(at, value - float(half_logs), slope, value, whitened, inverses, covariance)

    def curvature(self, here: Likelihood) -> Floats:
        """Return the expected curvature by the vector; cost: m r (m + r) multiply-adds per shot, m numbers.

        The coupling of shots through shared parameters is neglected.  LinAlgError if the likelihood is undefined.
        """
        if here.curvature is not None:
            return here.curvature
        if not here.whitened:
            raise np.linalg.LinAlgError("the parameters are not determined under this noise")
        strength = np.exp(here.at[1:] - here.at[0])

        def of_shot(index: int) -> Floats:
            shot = self.shots[index]
            factors, of_band = shot.bands.factors, strength[:, None] * shot.bands.shares
            gram = factors.T @ here.inverses[index] @ factors
            seen = of_band @ np.diag(gram)
            shared = of_band @ np.square(gram, out=gram) @ of_band.T
            out = np.empty_like(self.precision)
            out[1:, 1:] = 0.5 * shared
            out[0, 1:] = out[1:, 0] = 0.5 * (seen - shared.sum(axis=1))
            out[0, 0] = 0.5 * (shot.samples - 2.0 * float(seen.sum()) + float(shared.sum()))
            return out

        here.curvature = curve = np.asarray(self.precision + sum(self._of_each(of_shot)))
        curve[0, 0] -= 0.5 * len(here.covariance)
        return curve

    def greatest(self, starts: Sequence[Floats], curve: Curvature) -> Likelihood:
        """Return the maximum of likelihood times prior, searched from the likeliest of some vectors by Fisher scoring.

        The curvature ``curve`` of a nearby noise is used until a step's gain differs from its prediction.  After a
        short step it is then corrected by the change of the gradient (BFGS), else computed anew.
        """
        here = max((self.at(start) for start in starts), key=lambda one: one.value)
        if not math.isfinite(here.value):
            return here
        if curve.value is None:
            curve.value = self.curvature(here)
        for _ in range(_ITERATIONS):
            step = np.linalg.solve(curve.value, here.slope)
            promise = float(step @ here.slope)
            if promise < _ENOUGH:
                break
            step *= min(1.0, _MOST / float(np.abs(step).max()))
            for _ in range(_TRIES):
                there = self.at(here.at + step)
                if there.value > here.value:
                    break
                step = _SHORTER * step
            else:
                if here.curvature is not None:
                    break
                curve.value = self.curvature(here)
                continue
            gained, fallen, here = there.value - here.value, here.slope - there.slope, there
            if gained < _LEAST:
                break
            if abs(gained / promise - 0.5) > _GAIN_TOLERANCE:  # the curvature is no longer valid
                near = float(np.abs(step).max()) < _NEAR
                curve.value = _corrected(curve.value, np.asarray(step), fallen) if near else self.curvature(here)
        return here

    def fits(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the q parameters fitted under each of p noise vectors, (p, q), and their covariances, (p, q, q)."""
        of_shots = self._of_each(lambda index: np.array([self.shots[index].products(at) for at in points]))
        values, covariances, _ = self._parameters_under(of_shots, np.exp(points[:, 0]))
        return values, covariances

    def _of_each(self, function: Callable[[int], Result]) -> tuple[Result, ...]:
        """Return ``function`` of every shot's index, in two threads if the shots' matrices are large."""
        indices = range(len(self.shots))
        if self.shots[0].bands.covariances.size < _LARGE:
            return tuple(map(function, indices))
        return tuple(side_by_side(function, indices))

    def _parameters_under(self, products: Sequence[Floats], variance: Floats) -> tuple[Floats, Floats, Floats]:
        """Return q parameters fitted under p noises, (p, q), covariances, (p, q, q), and half ln det of their inverses.

        ``products``, shape (p, 1 + q, 1 + q) per shot, are those of residual and derivatives, in units of ``variance``,
        shape (p,).  LinAlgError if they do not determine the parameters.
        """
        size = max((int(shot.places.max(initial=-1)) + 1 for shot in self.shots), default=0)
        normal, pull = np.zeros((variance.size, size, size)), np.zeros((variance.size, size))
        if not size:
            return pull, normal, np.zeros(variance.size)
        for shot, both in zip(self.shots, products, strict=True):
            both = both / variance[:, None, None]
            normal[:, shot.places[:, None], shot.places] += both[:, 1:, 1:]
            pull[:, shot.places] += both[:, 1:, 0]
        level = np.diagonal(normal, axis1=1, axis2=2)
        scale = np.where(level == 0.0, 1.0, np.sqrt(level))
        outer = scale[:, :, None] * scale[:, None, :]
        unit = normal / outer
        unit[:, range(size), range(size)] += level == 0.0  # a parameter of no shot gets unit variance
        root = np.linalg.cholesky(unit)
        half = np.linalg.inv(root)
        inverse = half.transpose(0, 2, 1) @ half / outer
        logs = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1) + np.log(scale).sum(axis=1)
        return (inverse @ pull[:, :, None])[:, :, 0], inverse, logs


def _corrected(curve: Floats, step: Floats, fallen: Floats) -> Floats:
    """Return a curvature that agrees with the fall of the gradient over a step (BFGS; Nocedal & Wright, ch. 6)."""
    seen = float(step @ fallen)
    if seen <= 0.0:
        return curve
    along = curve @ step
    return np.asarray(curve + np.outer(fallen / seen, fallen) - np.outer(along / float(step @ along), along))


def chain_precision(level_std: Floats, step_std: Floats) -> Floats:
    """Return the precision of k normal numbers of std ``level_std``, (k,), with steps of std ``step_std``, (k - 1,)."""
    steps = np.diff(np.eye(level_std.size), axis=0) / step_std[:, None]
    return np.asarray(np.diag(level_std**-2.0) + steps.T @ steps)


def points_about(mean: Floats, precision: Floats, pairs: int) -> Floats:
    """Return points that sample a normal distribution, shape (2 pairs, k), in pairs symmetric about the mean."""
    level, turn = np.linalg.eigh(precision)
    # the symmetric root of the covariance: eigenvectors of nearly equal eigenvalues turn with every rounding
    spread = turn / np.sqrt(np.maximum(level, _MIN_LEVEL)) @ turn.T
    return np.asarray(mean + _normal_points(mean.size, pairs) @ spread)


@lru_cache(maxsize=8)
def _normal_points(size: int, pairs: int) -> Floats:
    """Return points that sample a standard normal distribution, shape (2 pairs, size).

    Their covariance is exactly the identity; with fewer pairs than dimensions only the variances are exactly one.
    """
    half = np.random.default_rng(size).standard_normal((pairs, size))
    covariance = half.T @ half / pairs
    if pairs < size:
        covariance = np.diag(np.diag(covariance))
    half = half @ np.linalg.inv(np.linalg.cholesky(covariance)).T
    return np.concatenate([half, -half])


def mixture_covariance(weights: Floats, values: Floats, covariances: Floats, about: Floats) -> Floats:
    """Return the mean square deviation from ``about`` in a mixture of p normal distributions, shape (q, q).

    ``values`` (p, q), ``covariances`` (p, q, q): the mean covariance plus that of the values (law of total variance).
    """
    apart = values - about
    return np.asarray(np.einsum("p,pij->ij", weights, covariances) + np.einsum("p,pi,pj->ij", weights, apart, apart))
