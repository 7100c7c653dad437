"""How strongly everything shook the shots: white noise, wandering parts and a site's bands, by maximum likelihood.

One covariance holds them all.  White noise and what wanders are whitened by a Kalman filter; along a shot's directions,
as that leaves them, the covariance is one plus each band's share, beside them one.  The bands' strengths have a prior:
neighbouring bands are as the flights' readings say within a factor, their level is free, and a line is about as strong
as it was read.  Given the shape of the wandering parts, strengths and white noise follow by Fisher scoring, all shots
at once; the shape is searched for about that.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dsyrk
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.optimize import minimize

from analysis.compiled.side_by_side import side_by_side
from analysis.inference.fit.arrow import Arrow, Places
from analysis.inference.fit.samples import Samples
from analysis.inference.noise.floor import Floor, white_floor
from analysis.inference.noise.likeliest import LONGEST_TAU_S, SHORTEST_TAU_S
from analysis.inference.noise.site import Seen, Site

Floats = NDArray[np.float64]
_NEIGHBOURS = 1.0  # std of the logarithm of a strength beside its neighbour's
_LEVEL = 6.0  # of each band's by itself
_LINE = 2.0  # of a line's
_ITERATIONS, _ENOUGH, _MOST = 20, 5e-3, 3.0  # steps, in log-likelihood, in the logarithm of a strength
_AS_PROMISED = 0.15  # of what a step promises to first order: half of it is gained where the curvature is right
_ADDS = 2.0, 0.2  # of a search for a shape: what a sample adds over white, of the first part and of the second ...
_TAU_S = (4e-3,), (5e-4, 5e-2)  # ... memories that are tried
_SIDE, _CLOSER, _NEAR, _ALIKE = 0.7, 0.3, 0.1, 0.3  # ... its simplex, one from nearby, where it ends, in ln L there
_TRIALS = 15  # ... for each part
_PAIRS = 16  # of points that stand for all likely strengths
_LEAST_LEVEL = 0.05  # of the curvature: a strength nobody knows is known to a factor of some hundred


@dataclass(frozen=True, slots=True)
class _Shot:
    """What is left of a shot, and its derivatives by q parameters, under noise of a fixed shape.

    ``along``, shape (r, 1 + q), are both along the shot's whitened directions, ``seen``, ``beside``, shape
    (1 + q, 1 + q), the products of what lies beside these; ``places``, shape (q,), says which parameters they are.
    """

    seen: Seen
    along: Floats
    beside: Floats
    samples: int
    places: NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class _Whitened:
    """A shot as a covariance whitens it along its directions, over the white variance.

    ``waves``, shape (r, m), are what the site's numbers do, ``half``, shape (r, 1 + q), what is left with its
    derivatives, both divided by the covariance's ``root``; ``products``, shape (1 + q, 1 + q), are those of what is
    left and its derivatives, whitened whole.
    """

    root: Floats
    waves: Floats
    half: Floats
    products: Floats


@dataclass(slots=True)
class _Curvature:
    """The expected curvature of the log-likelihood by (ln white^2, strengths), as it was where it was last computed."""

    value: Floats | None = None


@dataclass(frozen=True, slots=True)
class _Fitted:
    """What parameters of all shots take of what is left: values (q,), covariance (q, q), half ln det of its inverse."""

    values: Floats
    covariance: Floats
    logs: float


@dataclass(frozen=True, slots=True)
class _Point:
    """The log-likelihood with the prior's at (ln white^2, strengths), its gradient, and what both were made of."""

    at: Floats
    value: float
    slope: Floats
    whitened: tuple[_Whitened, ...] = ()
    fitted: _Fitted | None = None


@dataclass(frozen=True, slots=True)
class _Found:
    """The likeliest strengths beside wandering parts of a shape (an rms is over the white one)."""

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
class _Set:
    """What is left of shots at a site, in m, shape (n,) a shot, and its ``tangents`` by parameters."""

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
            return _under(shape, columns, self.tangents.places[index], self.shots[index])

        return side_by_side(of_shot, range(len(self.shots)))

    def found(self, shape: Floor, start: Floats | None) -> _Found:
        """Return the likeliest strengths beside parts of this shape, from ``start``; some 20 ms for three shots."""
        parts = self.under(shape)
        if start is None:
            start = np.zeros(1 + self.site.bands)
            freedom = sum(part.samples - part.along.shape[0] for part in parts)
            start[0] = math.log(max(sum(float(part.beside[0, 0]) for part in parts) / freedom, 1e-40))
        at, value = _likeliest(start, parts, self.precision, self.curve)
        return _Found(shape, at, value)

    def nearby(self, begin: _Found, parts: int, side: float) -> _Found:
        """Return the likeliest strengths and shape of so many wandering parts, begun a ``side`` from another's."""
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
    """Return the likeliest noise of what is left of shots (``series``, in m) at a site, and the log-likelihood.

    White noise, up to ``parts`` wandering parts, each where it pays by the Bayesian information criterion, and the
    site.  Without ``parts`` the wandering ones keep the shape that they have in ``start``.  Cost: some 10 ms for three
    shots, a second for each part.
    """
    left = _Set(series, Arrow.of([values[:, None][:, 1:] for values in series], 0), shots, site, _prior(site))
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
            if number > 1 and begin.value < best.value:  # not even roughly is there a second one
                break
            trial = left.nearby(begin, number, _SIDE)
        samples = sum(int(shot.valid.sum()) for shot in shots)
        if 2 * (trial.value - best.value) < 2 * math.log(samples):
            break
        best = trial
    return best.floor, best.value


@dataclass(frozen=True, slots=True)
class Likely:
    """What all likely strengths make of a fit's parameters: the likeliest ``noise``, their covariance (q, q) under all.

    ``moves``, shape (q,), is where the likeliest would move the parameters to.
    """

    noise: Floor
    covariance: Floats
    moves: Floats


def over_likely(
    series: Sequence[Floats], tangents: Arrow, shots: Sequence[Samples], site: Site, start: Floor
) -> Likely:
    """Return what strengths of greatest restricted likelihood, and all likely ones, make of a fit's parameters.

    ``series`` is what the fit leaves of each shot, ``tangents`` are the displacement's derivatives by its q
    parameters; what wanders keeps the shape it has in ``start``.  What a fit leaves has less of every slow band than
    there was, as its parameters make up for some of it: the restricted likelihood (Patterson & Thompson, Biometrika 58,
    1971) allows for that.  The covariance is that of the mixture of all likely strengths: the mean of the covariances
    and the covariance of where each would put the values (law of total variance).  Cost: some 30 ms a shot.
    LinAlgError where the parameters are not determined.
    """
    left = _Set(series, tangents, shots, site, _prior(site))
    found = left.found(_shape_of(start), np.array([2.0 * math.log(start.white_m), *start.site]))
    parts = left.under(found.shape)
    level, turn = np.linalg.eigh(_curvature(_likelihood(found.at, parts, left.precision), parts, left.precision))
    points = found.at + _normal(found.at.size) @ (turn / np.sqrt(np.maximum(level, _LEAST_LEVEL))).T
    values, covariances, _ = _fits_at(np.vstack([found.at, points]), parts)
    apart = values[1:] - values[0]
    covariance = np.mean(covariances[1:], axis=0) + apart.T @ apart / len(points)
    unseen = tangents.size - values.shape[1]
    return Likely(found.floor, np.pad(covariance, (0, unseen)), np.pad(values[0], (0, unseen)))


@lru_cache(maxsize=8)
def _normal(size: int) -> Floats:
    """Return points that stand for a standard normal distribution, shape (n, size), in pairs about nothing."""
    half = np.random.default_rng(size).standard_normal((_PAIRS, size))
    half /= np.sqrt(np.mean(half**2, axis=0))
    return np.concatenate([half, -half])


def _fits_at(points: Floats, shots: Sequence[_Shot]) -> tuple[Floats, Floats, Floats]:
    """Return what ``_solved_for`` says of the parameters under each (ln white^2, strengths), shape (p, 1 + bands)."""

    def products(shot: _Shot) -> Floats:
        halves = (_solved(_root(_scaled(shot.seen, at)), shot.along) for at in points)
        return np.stack([shot.beside + half.T @ half for half in halves])

    return _solved_for(shots, side_by_side(products, shots), np.exp(points[:, 0]))


def _with_a_part(shape: Floor, number: int, tau_s: float) -> Floor:
    """Return the shape with one wandering part more, its ``number``-th, as a search for it begins."""
    rms = _ADDS[number - 1] / math.sqrt(2.0 * shape.spacing_s / tau_s)
    first = (rms, tau_s) if number == 1 else (shape.rms_m[0], shape.tau_s[0])
    second = (0.0, 1e-2) if number == 1 else (rms, tau_s)
    return Floor(1.0, (first[0], second[0]), (first[1], second[1]), shape.spacing_s)


def _shape_of(floor: Floor, parts: int = 2) -> Floor:
    """Return a noise's white and wandering parts over its white noise; the first of them where ``parts`` is one."""
    one, two = (rms / floor.white_m for rms in floor.rms_m)
    return Floor(1.0, (one, two if parts > 1 else 0.0), floor.tau_s, floor.spacing_s)


def _coordinates(shape: Floor, parts: int) -> Floats:
    """Return where a search for a shape begins: of each part ln of what a sample adds to it over white, and ln tau.

    What a sample adds is known well where a part's rms and its memory are not.
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


def _under(shape: Floor, columns: Floats, places: Places, shot: Samples) -> _Shot:
    """Return what is left of a shot, and its derivatives by the parameters at ``places``, as this noise whitens them.

    ``columns``, shape (n, 1 + q), are both.
    """
    assert shot.sway is not None
    some = np.flatnonzero(np.abs(columns[:, 1:]).max(axis=0, initial=0.0) > 0.0)
    white = shape.whiten(columns[:, [0, *(1 + some)]], shot.valid, shot.weight)
    seen = shot.sway.seen(shape)
    along = seen.along(white)
    beside = white.T @ white - along.T @ along
    beside[0, 0] = max(float(beside[0, 0]), 0.0)
    return _Shot(seen, along, beside, white.shape[0], places[some])


def _likeliest(at: Floats, shots: Sequence[_Shot], precision: Floats, curve: _Curvature) -> tuple[Floats, float]:
    """Return the likeliest (ln white^2, strengths) from ``at``, and the log-likelihood with the prior's.

    The ``curve`` of a noise of nearly this shape serves until it does not.
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
        if abs(gained / promise - 0.5) > _AS_PROMISED:  # the curvature is another one here
            curve.value, fresh = _curvature(here, shots, precision), True
    return here.at, here.value


def _likelihood(at: Floats, shots: Sequence[_Shot], precision: Floats) -> _Point:
    """Return log-likelihood with the prior's and its gradient by (ln white^2, strengths); below all where it has none.

    Restricted to what the parameters cannot make up for, where there are derivatives by any.
    Cost: r^2 (3 m + r / 3) multiply-adds a shot, r directions, m numbers of the site.
    """
    pull = precision @ at[1:]
    value = -0.5 * float(at[1:] @ pull)
    slope = np.concatenate([[0.0], -pull])
    variance = math.exp(at[0])
    try:
        whitened = tuple(side_by_side(lambda shot: _whitened(shot, at), shots))
        fitted = _fitted(shots, [one.products for one in whitened], variance)
    except np.linalg.LinAlgError:  # a motion a billion times the white noise: rounding decides
        return _Point(at, -math.inf, slope)
    value -= fitted.logs
    slope[0] += 0.5 * fitted.values.size
    for shot, one in zip(shots, whitened, strict=True):
        numbers = np.concatenate([[1.0], -fitted.values[shot.places]])
        square = float(numbers @ one.products @ numbers) / variance
        across = one.waves.T @ one.half
        free = across[:, 1:]
        known = np.einsum("ij,ij->j", one.waves, one.waves)
        known -= np.einsum("ij,ij->i", free @ _of_shot(fitted, shot), free) / variance
        seen = np.add.reduceat((across @ numbers) ** 2, shot.seen.first) / variance
        told = np.add.reduceat(known, shot.seen.first)
        logs = 2.0 * float(np.log(np.diag(one.root)).sum()) + shot.seen.logs
        logs += shot.samples * math.log(2 * math.pi * variance)
        value -= 0.5 * (logs + square)
        slope[1:] += 0.5 * (seen - told)
        slope[0] += 0.5 * (square - float(seen.sum()) - (shot.samples - float(told.sum())))
    return _Point(at, value, slope, whitened, fitted)


def _whitened(shot: _Shot, at: Floats) -> _Whitened:
    """Return a shot as its covariance under (ln white^2, strengths) whitens it; LinAlgError where it has no root."""
    scaled = _scaled(shot.seen, at)
    root = _root(scaled)
    half = _solved(root, shot.along)
    return _Whitened(root, _solved(root, scaled), half, shot.beside + half.T @ half)


def _of_shot(fitted: _Fitted, shot: _Shot) -> Floats:
    """Return the covariance of the parameters that a shot depends on, shape (q, q)."""
    return fitted.covariance[np.ix_(shot.places, shot.places)]


def _fitted(shots: Sequence[_Shot], products: Sequence[Floats], variance: float) -> _Fitted:
    """Return what the parameters take, of shots with all ``products`` of what is left and its derivatives."""
    values, covariance, logs = _solved_for(shots, [one[None] for one in products], np.array([variance]))
    return _Fitted(values[0], covariance[0], float(logs[0]))


def _solved_for(shots: Sequence[_Shot], products: Sequence[Floats], variance: Floats) -> tuple[Floats, Floats, Floats]:
    """Return what q parameters take under p noises, (p, q), their covariances, (p, q, q), and half ln det of inverses.

    ``products``, shape (p, 1 + q, 1 + q) a shot, are those of what is left and its derivatives, over ``variance``,
    shape (p,).  LinAlgError where they do not determine the parameters.
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
    unit[:, range(size), range(size)] += level == 0.0  # what no shot depends on is known to a unit
    root = np.linalg.cholesky(unit)
    half = np.linalg.inv(root)
    inverse = half.transpose(0, 2, 1) @ half / outer
    logs = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1) + np.log(scale).sum(axis=1)
    return (inverse @ pull[:, :, None])[:, :, 0], inverse, logs


def _scaled(seen: Seen, at: Floats) -> Floats:
    """Return what the site's numbers do along a shot's directions under (ln white^2, strengths), over the white std."""
    return np.asarray(seen.factors * np.exp(0.5 * (at[1:] - at[0]))[seen.band])


def _root(scaled: Floats) -> Floats:
    """Return the Cholesky factor of one and what ``scaled``, shape (r, m), makes of covariance, shape (r, r)."""
    covariance = dsyrk(1.0, scaled, lower=1)
    covariance[np.diag_indices_from(covariance)] += 1.0
    root, failed = dpotrf(covariance, lower=1, overwrite_a=1)
    if failed or not np.isfinite(root[-1, -1]):
        raise np.linalg.LinAlgError("the covariance has no Cholesky factor")
    return np.asarray(root)


def _solved(root: Floats, rows: Floats) -> Floats:
    """Return the inverse of a Cholesky factor times ``rows``, shape (r, k)."""
    return np.asarray(dtrtrs(root, rows, lower=1)[0])


def _curvature(point: _Point, shots: Sequence[_Shot], precision: Floats) -> Floats:
    """Return the expected curvature by (ln white^2, strengths) at a point; cost: m^2 r multiply-adds a shot.

    What shots tell of each other's parameters is left out.  LinAlgError where the point has no likelihood.
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
            gram -= taken @ _of_shot(fitted, shot) @ taken.T / variance
        first = shot.seen.first
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
    """Return the precision of the strengths' logarithms before anything is seen, shape (bands, bands)."""
    precision = np.diag(np.where(np.arange(site.bands) < site.random_bands, _LEVEL, _LINE) ** -2.0)
    for k in range(site.random_bands - 1):
        precision[k : k + 2, k : k + 2] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / _NEIGHBOURS**2
    return precision
