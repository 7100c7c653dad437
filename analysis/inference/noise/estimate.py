"""Estimate white noise, wandering parts and the strength of each band of frame motion by maximum likelihood.

One covariance contains all three.  A Kalman filter whitens white noise and wandering parts.  Along a shot's
directions of frame motion the whitened covariance is then one plus each band's contribution; elsewhere it is one.  The
log strengths have a normal prior about the values read from the flights: neighbouring bands are strongly correlated,
their common level is nearly free, and each line is near the strength read.  For a given shape of the wandering parts,
strengths and white noise follow by Fisher scoring over all shots.  The shape is found by parabolic line searches.
Without frame motion ``likeliest_floor`` estimates white noise and wandering parts alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from analysis.compiled import side_by_side
from analysis.inference.model.arrow import Arrow
from analysis.inference.model.normal_matrix import Places
from analysis.inference.model.samples import Samples
from analysis.inference.noise.floor import MOST_PARTS, Floor, LikeliestFloor, likeliest_floor, white_floor, with_parts
from analysis.inference.noise.likeliest import LONGEST_TAU_S, SHORTEST_TAU_S
from analysis.inference.noise.site import Site
from analysis.inference.noise.sway import shape_of
from analysis.reading import (
    Curvature,
    Likelihood,
    RestrictedLikelihood,
    ShotResidual,
    chain_precision,
    mixture_covariance,
    points_about,
)
from analysis.shot import Floats

_NEIGHBOURS = 1.0  # prior std of the difference of log strengths of neighbouring bands
_LEVEL = 6.0  # prior std of each band's log strength
_LINE = 2.0  # prior std of a line's log strength
_ADDS = 2.0, 0.2  # initial rms step per sample over white noise in a shape search, of the first and second part
_TAU_S = (4e-3,), (5e-4, 5e-2)  # initial correlation times in s tried for each part
_SIDES, _CLOSER = (0.4, 0.7), (0.15, 0.3)  # half-widths of the parabolas, and the same from a nearby known shape
_FARTHEST, _ALIKE, _TURNS = 3.0, 0.3, 3  # longest move in half-widths; gain of ln L that ends the search; iterations
_PAIRS = 16  # pairs of points that sample the distribution of likely strengths


@dataclass(frozen=True, slots=True)
class _ShotSet:
    """Residuals of shots on a moving frame, in m, shape (n,) each; ``tangents`` are the derivatives by parameters."""

    series: Sequence[Floats]
    tangents: Arrow
    shots: Sequence[Samples]
    site: Site
    curve: Curvature = field(default_factory=Curvature)

    def under(self, shape: Floor) -> RestrictedLikelihood:
        """Return the restricted likelihood of the strengths under noise of this shape."""

        def of_shot(index: int) -> ShotResidual:
            columns = np.column_stack([self.series[index], self.tangents.blocks[index]])
            return _shot_under(shape, columns, self.tangents.places[index], self.shots[index])

        return RestrictedLikelihood(side_by_side(of_shot, range(len(self.shots))), _prior(self.site))

    def found(self, shape: Floor, start: Floats | None) -> LikeliestFloor:
        """Return the likeliest noise of this shape, searched from the logarithms ``start``; 20 ms for three shots."""
        likelihood = self.under(shape)
        if start is None:
            start = np.zeros(1 + self.site.bands)
            freedom = sum(shot.samples - shot.along.shape[0] for shot in likelihood.shots)
            square = sum(float(shot.rest_products[0, 0]) for shot in likelihood.shots)
            start[0] = math.log(max(square / freedom, 1e-40))
        best = likelihood.greatest((start,), self.curve)
        return LikeliestFloor(shape.with_logarithms(best.at), best.value)

    def nearby(self, begin: LikeliestFloor, parts: int, sides: tuple[float, float]) -> LikeliestFloor:
        """Return the likeliest noise with ``parts`` wandering parts, searched from ``begin``.

        Each coordinate moves to the vertex of a parabola through ln L here and ``sides`` away (in ln of the step per
        sample and in ln tau), until the gain is below _ALIKE.  Cost: 4 likelihood maxima per part and iteration.
        """
        best, side, spacing_s = begin, np.tile(sides, parts), begin.floor.spacing_s

        def value(z: Floats, at: Floats) -> float:
            nonlocal best
            trial = self.found(_shape_at(z, spacing_s), at)
            best = trial if trial.value > best.value else best
            return trial.value

        for _ in range(_TURNS):
            z, at, here = _coordinates(best.floor, parts), best.floor.logarithms, best
            ways = np.diag(side)
            vertices = [_vertex(value(z - way, at), here.value, value(z + way, at)) for way in ways]
            if sum(gain for _, gain in vertices) < _ALIKE:
                break
            value(z + np.array([place for place, _ in vertices]) @ ways, best.floor.logarithms)
            if best is here:
                break
        return best


def _vertex(before: float, here: float, after: float) -> tuple[float, float]:
    """Return the maximum of the parabola through values at -1, 0 and 1, within +-_FARTHEST, and the gain there."""
    slope, bend = 0.5 * (after - before), 2.0 * here - after - before
    place = slope / bend if bend > 0.0 else math.copysign(_FARTHEST, slope)
    place = min(max(place, -_FARTHEST), _FARTHEST)
    return place, place * (slope - 0.5 * place * bend)


def learn(
    series: Sequence[Floats], shots: Sequence[Samples], site: Site, *, start: Floor | None = None, anew: bool = False
) -> LikeliestFloor:
    """Return the likeliest noise of residuals ``series`` (m, one for each shot).

    The noise is white noise, wandering parts (see ``with_parts``) and frame motion.  On a moving frame the wandering
    parts keep their shape in ``start``, with none without a start, unless ``anew`` estimates it from the residuals.
    Cost: 1-5 ms for three shots; on a moving frame 10 ms, and half a second for each wandering part.
    """
    if not site.moves:
        valid, weights = [shot.valid for shot in shots], [shot.weight for shot in shots]
        return likeliest_floor(series, valid, shots[0].spacing_s, weights=weights, start=start)
    no_parameters = Arrow.of([np.empty((values.size, 0)) for values in series], 0)
    left = _ShotSet(series, no_parameters, shots, site)
    start = start if start is not None and start.site else None
    at = start.logarithms if start is not None else None
    white = white_floor(1.0, shots[0].spacing_s)
    if not anew:
        return left.found(white if start is None else shape_of(start), at)
    most = MOST_PARTS if start is None else max(1, len(start.wander))
    samples = sum(int(shot.valid.sum()) for shot in shots)
    best = left.found(white, at)
    return with_parts(best, most, samples, lambda here, number: _with_next_part(left, here, start, number))


def _with_next_part(left: _ShotSet, best: LikeliestFloor, start: Floor | None, number: int) -> LikeliestFloor | None:
    """Return the likeliest noise with a ``number``-th wandering part, searched from that of ``start`` if any.

    None if a second part does not help even at its rough start.
    """
    at = best.floor.logarithms
    if start is not None and start.rms_m[number - 1] > 0:
        return left.nearby(left.found(shape_of(start, number), at), number, _CLOSER)
    begins = [left.found(_with_a_part(shape_of(best.floor), number, tau_s), at) for tau_s in _TAU_S[number - 1]]
    begin = max(begins, key=lambda found: found.value)
    return None if number > 1 and begin.value < best.value else left.nearby(begin, number, _SIDES)


@dataclass(frozen=True, slots=True)
class LikelyStrengths:
    """The frame's strengths of greatest restricted likelihood, as ``noise``, and how likely others are.

    ``best`` is the maximum of ``likelihood``; ``size`` is the number q of fitted parameters.
    """

    noise: Floor
    likelihood: RestrictedLikelihood
    best: Likelihood
    size: int

    def covariance(self) -> Floats:
        """Return the parameter covariance averaged over all likely strengths, shape (q, q).

        It is that of their mixture: the mean of the covariances plus the covariance of the values (law of total
        variance).  Cost: about 10 ms per shot.
        """
        points = points_about(self.best.at, self.likelihood.curvature(self.best), _PAIRS)
        values, covariances = self.likelihood.fits(np.vstack([self.best.at, points]))
        weights = np.array([0.0, *np.full(len(points), 1.0 / len(points))])
        return np.pad(mixture_covariance(weights, values, covariances, values[0]), (0, self.size - values.shape[1]))


def likely_strengths(
    series: Sequence[Floats], tangents: Arrow, shots: Sequence[Samples], site: Site, start: Floor
) -> LikelyStrengths:
    """Return the strengths of greatest restricted likelihood, whose wandering parts keep their shape in ``start``.

    ``series`` are a fit's residuals; ``tangents`` are the derivatives of the displacement by its q parameters.  The
    fitted parameters absorb part of every slow band, so the residual contains less of it than the shot did.  The
    restricted likelihood (Patterson & Thompson, Biometrika 58, 1971) corrects for this.  Cost: about 10 ms per shot.
    Raises LinAlgError if the parameters are not determined.
    """
    left, shape = _ShotSet(series, tangents, shots, site), shape_of(start)
    likelihood = left.under(shape)
    best = likelihood.greatest((start.logarithms,), left.curve)
    likelihood.curvature(best)  # cached for the covariance; raises LinAlgError if the parameters are not determined
    return LikelyStrengths(shape.with_logarithms(best.at), likelihood, best, tangents.size)


def _with_a_part(shape: Floor, number: int, tau_s: float) -> Floor:
    """Return the shape with a ``number``-th wandering part added, as the start of a search for that part."""
    rms = _ADDS[number - 1] / math.sqrt(2.0 * shape.spacing_s / tau_s)
    first = (rms, tau_s) if number == 1 else (shape.rms_m[0], shape.tau_s[0])
    second = (0.0, 1e-2) if number == 1 else (rms, tau_s)
    return Floor(1.0, (first[0], second[0]), (first[1], second[1]), shape.spacing_s)


def _coordinates(noise: Floor, parts: int) -> Floats:
    """Return the coordinates of a shape search: for each part ln of its rms step per sample over white, and ln tau.

    Data determine the step per sample well even if rms and correlation time are poorly determined.
    """
    z = []
    for rms, tau_s in zip(noise.rms_m[:parts], noise.tau_s[:parts], strict=True):
        z += [math.log(rms / noise.white_m * math.sqrt(2.0 * noise.spacing_s / tau_s)), math.log(tau_s)]
    return np.array(z)


def _shape_at(z: Floats, spacing_s: float) -> Floor:
    tau = np.clip(np.exp(z[1::2]), SHORTEST_TAU_S, LONGEST_TAU_S)
    rms = np.exp(np.clip(z[::2], -14.0, 14.0)) / np.sqrt(2.0 * spacing_s / tau)
    one, two = [*rms, 0.0][:2]
    first, second = [*tau, 1e-2][:2]
    return Floor(1.0, (float(one), float(two)), (float(first), float(second)), spacing_s)


def _shot_under(shape: Floor, columns: Floats, places: Places, shot: Samples) -> ShotResidual:
    """Return a shot's residual and its derivatives by the parameters at ``places``, whitened by a noise of this shape.

    ``columns``, shape (n, 1 + q), are the residual and the derivatives.
    """
    assert shot.sway is not None
    some = np.flatnonzero(np.abs(columns[:, 1:]).max(axis=0, initial=0.0) > 0.0)
    white = shape.whiten(columns[:, [0, *(1 + some)]], shot.valid, shot.weight)
    directions = shot.sway.whitened_directions(shape)
    along = directions.along(white)
    rest_products = white.T @ white - along.T @ along
    rest_products[0, 0] = max(float(rest_products[0, 0]), 0.0)
    return ShotResidual(along, rest_products, len(white), directions.logs, places[some], directions.bands)


def _prior(site: Site) -> Floats:
    """Return the prior precision of (ln white^2, ln strengths), shape (1 + bands, 1 + bands); white noise is free."""
    index = np.arange(site.bands)
    level_std = np.where(index < site.random_bands, _LEVEL, _LINE)
    step_std = np.where(index[1:] < site.random_bands, _NEIGHBOURS, np.inf)
    return np.pad(chain_precision(level_std, step_std), (1, 0))
