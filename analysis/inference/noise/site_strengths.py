"""Maximum-likelihood strengths of white noise, wandering parts and each band of the frame's motion.

One covariance holds them all.  A Kalman filter whitens white noise and wandering parts; along a shot's directions the
whitened covariance is then one plus each band's share, and one elsewhere.  The logarithms of the bands' strengths have
a normal prior: neighbouring bands differ little from what the flights show, their common level is free, and a line
is about as strong as it was read.  For a given shape of the wandering parts, strengths and white noise follow by
Fisher scoring over all shots; the shape is found by a simplex search around that.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from analysis.compiled import side_by_side, solve_triangle
from analysis.inference.fit.arrow import Arrow, Places
from analysis.inference.fit.samples import Samples
from analysis.inference.noise.floor import Floor, white_floor
from analysis.inference.noise.likeliest import LONGEST_TAU_S, SHORTEST_TAU_S
from analysis.inference.noise.site import Site, WhitenedDirections, root_of

Floats = NDArray[np.float64]
_NEIGHBOURS = 1.0  # prior std of the difference of log strengths of neighbouring bands
_LEVEL = 6.0  # prior std of each band's log strength
_LINE = 2.0  # prior std of a line's log strength
_ITERATIONS, _ENOUGH, _MOST = 20, 5e-3, 3.0  # steps; least gain of ln L; greatest step of a log strength
_AS_PROMISED = 0.15  # of a step's first-order gain: allowed deviation from the half that the right curvature gives
_ADDS = 2.0, 0.2  # start of a shape search: what a sample adds over white, of the first part and of the second;
_TAU_S = (4e-3,), (5e-4, 5e-2)  # correlation times tried for each;
_SIDE, _CLOSER, _NEAR, _ALIKE = 0.7, 0.3, 0.1, 0.3  # simplex side, side from a neighbour, end size, end ln L spread;
_TRIALS = 15  # evaluations for each part
_PAIRS = 16  # of points that sample the distribution of likely strengths
_LEAST_LEVEL = 0.05  # of the curvature: even an undetermined strength is known to a factor of some hundred


@dataclass(frozen=True, slots=True)
class _Shot:
    """A shot's residual and its derivatives by q parameters, under noise of a fixed shape.

    ``along``, shape (r, 1 + q), are both projected on ``directions``; ``rest_products``, shape (1 + q, 1 + q), are the
    products of the rest; ``places``, shape (q,), are the indices of the parameters.
    """

    directions: WhitenedDirections
    along: Floats
    rest_products: Floats
    samples: int
    places: NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class _Whitened:
    """A shot whitened by the covariance along its directions, in units of the white variance.

    ``waves``, shape (r, m), are the frame's contributions, ``half``, shape (r, 1 + q), residual and derivatives, both
    divided by the covariance's Cholesky ``root``; ``products``, shape (1 + q, 1 + q), are those of the fully whitened
    residual and derivatives.
    """

    root: Floats
    waves: Floats
    half: Floats
    products: Floats


@dataclass(slots=True)
class _Curvature:
    """The expected curvature of the log-likelihood by (ln white^2, strengths), where it was last computed."""

    value: Floats | None = None


@dataclass(frozen=True, slots=True)
class _Fitted:
    """Parameters fitted to the residual: values (q,), covariance (q, q), half ln det of its inverse."""

    values: Floats
    covariance: Floats
    logs: float


@dataclass(frozen=True, slots=True)
class _Point:
    """Log-likelihood plus log prior at (ln white^2, strengths), its gradient, and intermediate results."""

    at: Floats
    value: float
    slope: Floats
    whitened: tuple[_Whitened, ...] = ()
    fitted: _Fitted | None = None


@dataclass(frozen=True, slots=True)
class _LikeliestStrengths:
    """The likeliest strengths for a shape of the wandering parts (in units of the white noise)."""

    shape: Floor
    at: Floats  # ln white^2, then the strengths
    value: float

    @property
    def floor(self) -> Floor:
        """Get the noise."""
        white_m = math.exp(0.5 * self.at[0])
        one, two = self.shape.rms_m
        strengths = tuple(float(a) for a in self.at[1:])
        return replace(self.shape, white_m=white_m, rms_m=(one * white_m, two * white_m), site=strengths)


@dataclass(frozen=True, slots=True)
class _ShotSet:
    """Residuals of shots on a moving frame in m, shape (n,) for each, and ``tangents``: derivatives by parameters."""

    series: Sequence[Floats]
    tangents: Arrow
    shots: Sequence[Samples]
    site: Site
    precision: Floats
    curve: _Curvature = field(default_factory=_Curvature)

    def under(self, shape: Floor) -> list[_Shot]:
        """Return the shots under noise of this shape."""

        def of_shot(index: int) -> _Shot:
            columns = np.column_stack([self.series[index], self.tangents.blocks[index]])
            return _shot_under(shape, columns, self.tangents.places[index], self.shots[index])

        return side_by_side(of_shot, range(len(self.shots)))

    def found(self, shape: Floor, start: Floats | None) -> _LikeliestStrengths:
        """Return the likeliest strengths for this shape, searched from ``start``; some 20 ms for three shots."""
        parts = self.under(shape)
        if start is None:
            start = np.zeros(1 + self.site.bands)
            freedom = sum(part.samples - part.along.shape[0] for part in parts)
            start[0] = math.log(max(sum(float(part.rest_products[0, 0]) for part in parts) / freedom, 1e-40))
        at, value = _likeliest(start, parts, self.precision, self.curve)
        return _LikeliestStrengths(shape, at, value)

    def nearby(self, begin: _LikeliestStrengths, parts: int, side: float) -> _LikeliestStrengths:
        """Return the likeliest shape with so many wandering parts and its strengths, from a simplex about ``begin``."""
        best = begin

        def worth(z: Floats) -> float:
            nonlocal best
            trial = self.found(_shape_at(z, begin.shape.spacing_s), best.at)
            best = trial if trial.value > best.value else best
            return -trial.value

        z = _coordinates(begin.shape, parts)
        corners = np.vstack([z, z + side * np.eye(z.size)])
        options = {"initial_simplex": corners, "xatol": _NEAR, "fatol": _ALIKE, "maxfev": _TRIALS * parts}
        minimize(worth, z, method="Nelder-Mead", options=options)
        return best


def learn(
    series: Sequence[Floats], shots: Sequence[Samples], site: Site, *, start: Floor | None = None, parts: int = 0
) -> tuple[Floor, float]:
    """Return the likeliest noise of residuals ``series`` (m, one for each shot) on a moving frame, and ln L.

    White noise, up to ``parts`` wandering parts, each where it lowers the Bayesian information criterion, and the
    frame. With ``parts`` zero the wandering ones keep the shape they have in ``start``.  Cost: some 10 ms for three
    shots, a second for each part.
    """
    left = _ShotSet(series, Arrow.of([values[:, None][:, 1:] for values in series], 0), shots, site, _prior(site))
    spacing_s = shots[0].spacing_s
    start = start if start is not None and start.site else None
    at = np.array([2.0 * math.log(start.white_m), *start.site]) if start is not None else None
    if start is not None and not parts:
        found = left.found(_shape_of(start), at)
        return found.floor, found.value
    best = left.found(white_floor(1.0, spacing_s), at)
    most = parts if start is None else max(1, sum(rms > 0 for rms in start.rms_m))
    for number in range(1, most + 1):
        if start is not None and start.rms_m[number - 1] > 0:
            trial = left.nearby(left.found(_shape_of(start, number), best.at), number, _CLOSER)
        else:
            begins = [left.found(_with_a_part(best.shape, number, tau_s), best.at) for tau_s in _TAU_S[number - 1]]
            begin = max(begins, key=lambda found: found.value)
            if number > 1 and begin.value < best.value:  # a second part does not help even roughly
                break
            trial = left.nearby(begin, number, _SIDE)
        samples = sum(int(shot.valid.sum()) for shot in shots)
        if 2 * (trial.value - best.value) < 2 * math.log(samples):
            break
        best = trial
    return best.floor, best.value


@dataclass(frozen=True, slots=True)
class Likely:
    """Parameters averaged over all likely strengths: the likeliest ``noise``, and covariance (q, q).

    ``moves``, shape (q,), is the step of the parameters to their values under the likeliest noise.
    """

    noise: Floor
    covariance: Floats
    moves: Floats


def over_likely(
    series: Sequence[Floats], tangents: Arrow, shots: Sequence[Samples], site: Site, start: Floor
) -> Likely:
    """Return the strengths of greatest restricted likelihood, and the parameters' covariance over all likely ones.

    ``series`` are a fit's residuals, ``tangents`` the derivatives of the displacement by its q parameters; wandering
    parts keep the shape they have in ``start``.  A residual holds less of every slow band than there was, since the
    parameters absorb some: the restricted likelihood (Patterson & Thompson, Biometrika 58, 1971) allows for that.  The
    covariance is that of the mixture over likely strengths: the mean of the covariances plus the covariance of the
    values (law of total variance).  Cost: some 30 ms per shot.  Raises LinAlgError where the parameters are not
    determined.
    """
    left = _ShotSet(series, tangents, shots, site, _prior(site))
    found = left.found(_shape_of(start), np.array([2.0 * math.log(start.white_m), *start.site]))
    parts = left.under(found.shape)
    level, turn = np.linalg.eigh(_curvature(_likelihood(found.at, parts, left.precision), parts, left.precision))
    # the symmetric root of the covariance: eigenvectors of nearly equal eigenvalues turn with every rounding
    spread = turn / np.sqrt(np.maximum(level, _LEAST_LEVEL)) @ turn.T
    points = found.at + _normal_points(found.at.size) @ spread
    values, covariances, _ = _fits_at(np.vstack([found.at, points]), parts)
    apart = values[1:] - values[0]
    covariance = np.mean(covariances[1:], axis=0) + apart.T @ apart / len(points)
    unseen = tangents.size - values.shape[1]
    return Likely(found.floor, np.pad(covariance, (0, unseen)), np.pad(values[0], (0, unseen)))


@lru_cache(maxsize=8)
def _normal_points(size: int) -> Floats:
    """Return points that sample a standard normal distribution, shape (n, size), in pairs of opposite sign."""
    half = np.random.default_rng(size).standard_normal((_PAIRS, size))
    half /= np.sqrt(np.mean(half**2, axis=0))
    return np.concatenate([half, -half])


def _fits_at(points: Floats, shots: Sequence[_Shot]) -> tuple[Floats, Floats, Floats]:
    """Return ``_parameters_under`` at each of ``points``, (ln white^2, strengths), shape (p, 1 + bands)."""

    def products(shot: _Shot) -> Floats:
        halves = (solve_triangle(root_of(_scaled(shot.directions, at)), shot.along, lower=True) for at in points)
        return np.stack([shot.rest_products + half.T @ half for half in halves])

    return _parameters_under(shots, side_by_side(products, shots), np.exp(points[:, 0]))


def _with_a_part(shape: Floor, number: int, tau_s: float) -> Floor:
    """Return the shape with one more wandering part (the ``number``-th), as the start of a search for it."""
    rms = _ADDS[number - 1] / math.sqrt(2.0 * shape.spacing_s / tau_s)
    first = (rms, tau_s) if number == 1 else (shape.rms_m[0], shape.tau_s[0])
    second = (0.0, 1e-2) if number == 1 else (rms, tau_s)
    return Floor(1.0, (first[0], second[0]), (first[1], second[1]), shape.spacing_s)


def _shape_of(floor: Floor, parts: int = 2) -> Floor:
    """Return white and wandering parts in units of the white noise; only the first of them if ``parts`` is one."""
    one, two = (rms / floor.white_m for rms in floor.rms_m)
    return Floor(1.0, (one, two if parts > 1 else 0.0), floor.tau_s, floor.spacing_s)


def _coordinates(shape: Floor, parts: int) -> Floats:
    """Return the start of a shape search: for each part ln of what a sample adds to it over white, and ln tau.

    Data determine what a sample adds well, even where rms and correlation time are not.
    """
    z = []
    for rms, tau_s in zip(shape.rms_m[:parts], shape.tau_s[:parts], strict=True):
        z += [math.log(rms * math.sqrt(2.0 * shape.spacing_s / tau_s)), math.log(tau_s)]
    return np.array(z)


def _shape_at(z: Floats, spacing_s: float) -> Floor:
    tau = np.clip(np.exp(z[1::2]), SHORTEST_TAU_S, LONGEST_TAU_S)
    rms = np.exp(np.clip(z[::2], -14.0, 14.0)) / np.sqrt(2.0 * spacing_s / tau)
    one, two = [*rms, 0.0][:2]
    first, second = [*tau, 1e-2][:2]
    return Floor(1.0, (float(one), float(two)), (float(first), float(second)), spacing_s)


def _shot_under(shape: Floor, columns: Floats, places: Places, shot: Samples) -> _Shot:
    """Return a shot's residual and derivatives by the parameters at ``places``, whitened by this noise.

    ``columns``, shape (n, 1 + q), are residual and derivatives.
    """
    assert shot.sway is not None
    some = np.flatnonzero(np.abs(columns[:, 1:]).max(axis=0, initial=0.0) > 0.0)
    white = shape.whiten(columns[:, [0, *(1 + some)]], shot.valid, shot.weight)
    directions = shot.sway.whitened_directions(shape)
    along = directions.along(white)
    rest_products = white.T @ white - along.T @ along
    rest_products[0, 0] = max(float(rest_products[0, 0]), 0.0)
    return _Shot(directions, along, rest_products, white.shape[0], places[some])


def _likeliest(at: Floats, shots: Sequence[_Shot], precision: Floats, curve: _Curvature) -> tuple[Floats, float]:
    """Return the likeliest (ln white^2, strengths), searched from ``at``, and log-likelihood plus log prior.

    The ``curve`` of a nearby noise is used until a step gains less or more than it predicts.
    """
    here = _likelihood(at, shots, precision)
    if not math.isfinite(here.value):
        return at, here.value
    fresh = curve.value is None
    if curve.value is None:
        curve.value = _curvature(here, shots, precision)
    for _ in range(_ITERATIONS):
        step = np.linalg.solve(curve.value, here.slope)
        promise = float(step @ here.slope)
        if promise < _ENOUGH:
            break
        step *= min(1.0, _MOST / float(np.abs(step).max()))
        for _ in range(5):
            there = _likelihood(here.at + step, shots, precision)
            if there.value > here.value:
                break
            step = 0.3 * step
        else:
            if fresh:
                break
            curve.value, fresh = _curvature(here, shots, precision), True
            continue
        gained, here, fresh = there.value - here.value, there, False
        if abs(gained / promise - 0.5) > _AS_PROMISED:  # the curvature has changed
            curve.value, fresh = _curvature(here, shots, precision), True
    return here.at, here.value


def _likelihood(at: Floats, shots: Sequence[_Shot], precision: Floats) -> _Point:
    """Return log-likelihood plus log prior and gradient by (ln white^2, strengths); minus infinity if undefined.

    Restricted likelihood where there are derivatives by parameters.
    Cost: r^2 (3 m + r / 3) multiply-adds per shot, r directions, m numbers of the frame.
    """
    pull = precision @ at[1:]
    value = -0.5 * float(at[1:] @ pull)
    slope = np.concatenate([[0.0], -pull])
    variance = math.exp(at[0])
    try:
        whitened = tuple(side_by_side(lambda shot: _whitened(shot, at), shots))
        fitted = _fitted(shots, [one.products for one in whitened], variance)
    except np.linalg.LinAlgError:  # with motion a billion times the white noise rounding breaks the factorisation
        return _Point(at, -math.inf, slope)
    value -= fitted.logs
    slope[0] += 0.5 * fitted.values.size
    for shot, one in zip(shots, whitened, strict=True):
        numbers = np.concatenate([[1.0], -fitted.values[shot.places]])
        square = float(numbers @ one.products @ numbers) / variance
        across = one.waves.T @ one.half
        free = across[:, 1:]
        known = np.einsum("ij,ij->j", one.waves, one.waves)
        known -= np.einsum("ij,ij->i", free @ _shot_covariance(fitted, shot), free) / variance
        measured = np.add.reduceat((across @ numbers) ** 2, shot.directions.first) / variance
        expected = np.add.reduceat(known, shot.directions.first)
        logs = 2.0 * float(np.log(np.diag(one.root)).sum()) + shot.directions.logs
        logs += shot.samples * math.log(2 * math.pi * variance)
        value -= 0.5 * (logs + square)
        slope[1:] += 0.5 * (measured - expected)
        slope[0] += 0.5 * (square - float(measured.sum()) - (shot.samples - float(expected.sum())))
    return _Point(at, value, slope, whitened, fitted)


def _whitened(shot: _Shot, at: Floats) -> _Whitened:
    """Return a shot whitened by its covariance under (ln white^2, strengths); LinAlgError if not positive."""
    scaled = _scaled(shot.directions, at)
    root = root_of(scaled)
    half = solve_triangle(root, shot.along, lower=True)
    return _Whitened(root, solve_triangle(root, scaled, lower=True), half, shot.rest_products + half.T @ half)


def _shot_covariance(fitted: _Fitted, shot: _Shot) -> Floats:
    """Return the covariance of the parameters on which a shot depends, shape (q, q)."""
    return fitted.covariance[np.ix_(shot.places, shot.places)]


def _fitted(shots: Sequence[_Shot], products: Sequence[Floats], variance: float) -> _Fitted:
    """Return the parameters fitted to all shots' ``products`` of residual and derivatives."""
    values, covariance, logs = _parameters_under(shots, [one[None] for one in products], np.array([variance]))
    return _Fitted(values[0], covariance[0], float(logs[0]))


def _parameters_under(
    shots: Sequence[_Shot], products: Sequence[Floats], variance: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return q parameters fitted under p noises, (p, q), their covariances, (p, q, q), and half ln det of inverses.

    ``products``, shape (p, 1 + q, 1 + q) for each shot, are those of residual and derivatives, in units of
    ``variance``, shape (p,).  LinAlgError where they do not determine the parameters.
    """
    size = max((int(shot.places.max(initial=-1)) + 1 for shot in shots), default=0)
    normal, pull = np.zeros((variance.size, size, size)), np.zeros((variance.size, size))
    if not size:
        return pull, normal, np.zeros(variance.size)
    for shot, both in zip(shots, products, strict=True):
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


def _scaled(directions: WhitenedDirections, at: Floats) -> Floats:
    """Return the frame's contributions along a shot's directions at (ln white^2, strengths), over the white std."""
    return np.asarray(directions.factors * np.exp(0.5 * (at[1:] - at[0]))[directions.band])


def _curvature(point: _Point, shots: Sequence[_Shot], precision: Floats) -> Floats:
    """Return the expected curvature by (ln white^2, strengths) at a point; cost: m^2 r multiply-adds per shot.

    The coupling of shots through shared parameters is neglected.  LinAlgError where the point has no likelihood.
    """
    curve = np.zeros((1 + precision.shape[0],) * 2)
    curve[1:, 1:] = precision
    variance, fitted = math.exp(point.at[0]), point.fitted
    if fitted is None:
        raise np.linalg.LinAlgError("the parameters are not determined under this noise")
    curve[0, 0] -= 0.5 * fitted.values.size

    def of_shot(index: int) -> Floats:
        shot, one = shots[index], point.whitened[index]
        gram = one.waves.T @ one.waves
        if shot.places.size:
            taken = one.waves.T @ one.half[:, 1:]
            gram -= taken @ _shot_covariance(fitted, shot) @ taken.T / variance
        first = shot.directions.first
        told = np.add.reduceat(np.diag(gram), first)
        shared = np.add.reduceat(np.add.reduceat(np.square(gram, out=gram), first, axis=0), first, axis=1)
        across = 0.5 * (told - shared.sum(axis=1))
        out = np.empty_like(curve)
        out[1:, 1:] = 0.5 * shared
        out[0, 1:] = out[1:, 0] = across
        out[0, 0] = 0.5 * (shot.samples - 2.0 * float(told.sum()) + float(shared.sum()))
        return out

    return np.asarray(curve + sum(side_by_side(of_shot, range(len(shots)))))


def _prior(site: Site) -> Floats:
    """Return the prior precision of the logarithms of the strengths, shape (bands, bands)."""
    precision = np.diag(np.where(np.arange(site.bands) < site.random_bands, _LEVEL, _LINE) ** -2.0)
    for k in range(site.random_bands - 1):
        precision[k : k + 2, k : k + 2] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / _NEIGHBOURS**2
    return precision
