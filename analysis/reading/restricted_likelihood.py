"""Estimate strengths of white noise and of bands of random motion by restricted likelihood with a normal prior.

A shot's residual is y = X b + sum_k sqrt(s_k) W_k u_k + white noise.  The columns of X are derivatives by free
parameters b, which shots may share.  The columns of W_k are the responses to band k, and u_k are unit normal numbers.
The restricted likelihood (Patterson & Thompson, Biometrika 58, 1971) allows for motion absorbed by the parameters.  The
vector searched is (ln white^2, ln s_1, ln s_2 ...); known white noise has a narrow prior.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dgemm

from analysis.compiled import side_by_side, solve_triangle
from analysis.shot import Floats

_ITERATIONS, _MOST = 20, 3.0  # most steps; largest step of a logarithm
_ENOUGH, _LEAST = 5e-3, 1e-3  # first-order gain and actual gain of ln L by a step, below which the search ends
_TRIES, _SHORTER = 5, 0.3  # trials of one step, and the length of each relative to the one before
_GAIN_TOLERANCE = 0.15  # allowed deviation of actual over first-order gain from 1/2, its value for a correct curvature
_MIN_LEVEL = 1e-3  # least eigenvalue of a curvature: priors make it larger unless rounding interferes


@dataclass(frozen=True, slots=True)
class ShotResidual:
    """A shot's residual and its derivatives by q parameters, whitened to unit variance by its noise without the bands.

    ``along``, shape (r, 1 + q), are both along the r orthonormal directions of the bands' motion; ``rest_products``,
    shape (1 + q, 1 + q), are the products of their components orthogonal to these directions.  ``samples`` counts all
    directions; ``logs`` is ln det of the whitening covariance.  ``places``, shape (q,), are the parameters' indices.
    ``factors``, shape (r, m), map m unit normal numbers to the directions; ``shares``, shape (k, m), are these numbers'
    variances by each band at strength one.  ``rounding`` is the relative increase of their covariance's diagonal.
    """

    along: Floats
    rest_products: Floats
    samples: int
    logs: float
    places: NDArray[np.intp]
    factors: Floats
    shares: Floats
    rounding: float = 0.0

    def whitened(self, at: Floats) -> "_Whitened":
        """Return the shot whitened by its whole covariance; LinAlgError if that is singular to rounding."""
        strength = np.exp(at[1:] - at[0])
        power = strength @ self.shares
        scaled = self.factors * np.sqrt(power)
        root = root_of(scaled, self.rounding)
        half = solve_triangle(root, self.along, lower=True)
        waves = solve_triangle(root, scaled, lower=True, in_place=True)
        of_band = strength[:, None] * (self.shares / power)
        return _Whitened(root, waves, of_band, half, self.rest_products + half.T @ half)

    def products(self, at: Floats) -> Floats:
        """Return the products of residual and derivatives, fully whitened, shape (1 + q, 1 + q)."""
        scaled = self.factors * np.sqrt(np.exp(at[1:] - at[0]) @ self.shares)
        half = solve_triangle(root_of(scaled, self.rounding), self.along, lower=True)
        return np.asarray(self.rest_products + half.T @ half)


@dataclass(frozen=True, slots=True)
class _Whitened:
    """A shot whitened by the covariance along its directions, in units of the white variance.

    ``waves``, shape (r, m), are the bands' contributions; ``half``, shape (r, 1 + q), are residual and derivatives;
    both are divided by the covariance's Cholesky ``root``.  ``of_band``, shape (k, m), is each band's share of each
    number's variance; ``products``, shape (1 + q, 1 + q), are those of the fully whitened residual and derivatives.
    """

    root: Floats
    waves: Floats
    of_band: Floats
    half: Floats
    products: Floats


@dataclass(slots=True)
class Curvature:
    """The expected curvature of the log-likelihood by the logarithms, as last computed; None before."""

    value: Floats | None = None


@dataclass(slots=True)
class Likelihood:
    """Log-likelihood plus log prior at (ln white^2, ln strengths), its gradient, and intermediate results.

    ``covariance``, shape (q, q), is that of the fitted parameters; ``profile`` is log-likelihood plus log prior with
    these at their best instead of marginalised; ``curvature`` is cached once computed.
    """

    at: Floats
    value: float
    slope: Floats
    profile: float = -math.inf
    whitened: tuple[_Whitened, ...] = ()
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

        Cost: r^2 (3 m + r / 3) multiply-adds per shot, r directions, m numbers.
        """
        pull = self.precision @ at
        value = -0.5 * float(at @ pull)
        slope = -pull
        variance = math.exp(at[0])
        try:
            whitened = tuple(side_by_side(lambda shot: shot.whitened(at), self.shots))
            products = [one.products[None] for one in whitened]
            (values,), (covariance,), (half_logs,) = self._parameters_under(products, np.array([variance]))
        except np.linalg.LinAlgError:  # rounding breaks the factorisation for motion a billion times the white noise
            return Likelihood(at, -math.inf, slope)
        slope[0] += 0.5 * values.size
        for shot, one in zip(self.shots, whitened, strict=True):
            numbers = np.concatenate([[1.0], -values[shot.places]])
            square = float(numbers @ one.products @ numbers) / variance
            across = one.waves.T @ one.half
            free = across[:, 1:]
            known = np.einsum("ij,ij->j", one.waves, one.waves)
            known -= np.einsum("ij,ij->i", free @ covariance[np.ix_(shot.places, shot.places)], free) / variance
            measured = one.of_band @ (across @ numbers) ** 2 / variance
            expected = one.of_band @ known
            logs = 2.0 * float(np.log(np.diag(one.root)).sum()) + shot.logs
            logs += shot.samples * math.log(2 * math.pi * variance)
            value -= 0.5 * (logs + square)
            slope[1:] += 0.5 * (measured - expected)
            slope[0] += 0.5 * (square - float(measured.sum()) - (shot.samples - float(expected.sum())))
        return Likelihood(at, value - float(half_logs), slope, value, whitened, covariance)

    def curvature(self, here: Likelihood) -> Floats:
        """Return the expected curvature by the vector; cost: m^2 r multiply-adds per shot.

        The coupling of shots through shared parameters is neglected.  LinAlgError if the likelihood is undefined.
        """
        if here.curvature is not None:
            return here.curvature
        if not here.whitened:
            raise np.linalg.LinAlgError("the parameters are not determined under this noise")

        def of_shot(index: int) -> Floats:
            shot, one = self.shots[index], here.whitened[index]
            gram = one.waves.T @ one.waves
            if shot.places.size:
                taken = one.waves.T @ one.half[:, 1:]
                told = taken @ here.covariance[np.ix_(shot.places, shot.places)]
                # subtracted in place: writing another matrix of this size takes longer than the product
                dgemm(-math.exp(-here.at[0]), told, taken, beta=1.0, c=gram.T, trans_b=True, overwrite_c=True)
            seen = one.of_band @ np.diag(gram)
            shared = one.of_band @ np.square(gram, out=gram) @ one.of_band.T
            out = np.empty_like(self.precision)
            out[1:, 1:] = 0.5 * shared
            out[0, 1:] = out[1:, 0] = 0.5 * (seen - shared.sum(axis=1))
            out[0, 0] = 0.5 * (shot.samples - 2.0 * float(seen.sum()) + float(shared.sum()))
            return out

        here.curvature = curve = np.asarray(self.precision + sum(side_by_side(of_shot, range(len(self.shots)))))
        curve[0, 0] -= 0.5 * len(here.covariance)
        return curve

    def greatest(self, start: Floats, curve: Curvature) -> Likelihood:
        """Return the maximum of likelihood times prior, searched from a vector by Fisher scoring.

        The curvature ``curve`` of a nearby noise is used until a step's gain differs from its prediction.
        """
        here = self.at(start)
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
            gained, here = there.value - here.value, there
            if gained < _LEAST:
                break
            if abs(gained / promise - 0.5) > _GAIN_TOLERANCE:  # the curvature is no longer valid
                curve.value = self.curvature(here)
        return here

    def fits(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the q parameters fitted under each of p noise vectors, (p, q), and their covariances, (p, q, q)."""
        each = side_by_side(lambda pair: pair[0].products(pair[1]), itertools.product(self.shots, points))
        of_shots = [np.array(each[k : k + len(points)]) for k in range(0, len(each), len(points))]
        values, covariances, _ = self._parameters_under(of_shots, np.exp(points[:, 0]))
        return values, covariances

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


def root_of(scaled: Floats, rounding: float = 0.0) -> Floats:
    """Return the Cholesky factor of 1 + scaled scaled^T, the covariance along whitened directions, shape (r, r).

    ``scaled`` has shape (r, m); the diagonal of scaled scaled^T is first increased by its fraction ``rounding``.
    LinAlgError if rounding leaves no Cholesky factor.
    """
    covariance = scaled @ scaled.T
    diagonal = np.einsum("ii->i", covariance)  # a view
    diagonal += 1.0 + rounding * diagonal
    root = np.asarray(np.linalg.cholesky(covariance))
    if not np.isfinite(root[-1, -1]):
        raise np.linalg.LinAlgError("the covariance has no Cholesky factor")
    return root


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
