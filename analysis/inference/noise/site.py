"""Where the shots of a set were taken: one spectrum that shook the frame under all of them, and what it did to each.

A frame that sways moves the displacement in flight and in contact along directions that the base model knows
(``model.sway``); so does a plate that it swings before the touch.  Their sizes are nobody's parameters: they are normal
numbers of known variance, integrated over wherever displacements are whitened.  The variance is what the flights'
readings say of the site, band by band times a strength that is learnt anew from what each hypothesis leaves over.
The optical path wanders in a building as it does elsewhere: the frame's motion is a term beside white noise and
wandering parts, in one covariance.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dtrtri

from analysis.collision.effects.row import Acts, Effect
from analysis.compiled.side_by_side import side_by_side
from analysis.inference.fit.base import PLATE_START, Base
from analysis.inference.fit.response import Model, respond
from analysis.inference.fit.samples import Samples
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.sway import BELOW_HZ, plate_swing_std, responses
from analysis.shot.disturbance import Shaking

Floats = NDArray[np.float64]
_APART = 0.45  # of one over a shot's length: sines that stand for what shakes at random
_SAME_LINE = 0.3  # of the same
_IN_AN_OCTAVE = 3  # bands
_REMEMBERED = 4  # noises, and shapes of what they are beside the site
_WANDER = 3.0  # of the least density in the fastest octave, both times f^2: less is the path's own wander
_NEARLY = 0.05  # orthonormal columns: their cosines, of which one Cholesky factor leaves no more than rounding
_SEEN = 1e-3  # of the noise's variance: a direction that shakes less is noise


@dataclass(frozen=True)
class Site:
    """What shakes the frame, pooled over the shots: sines (``shaking``) and the band of each, shape (f,).

    The first ``random_bands`` are third-octaves of what shakes at random, slowest first; each further one is a line.
    """

    shaking: Shaking
    band: NDArray[np.int64]
    random_bands: int

    @property
    def bands(self) -> int:
        """Get how many strengths there are."""
        return int(self.band.max(initial=-1)) + 1


@dataclass(frozen=True)
class Seen:
    """A shot's directions as white noise of 1 a sample, with what wanders beside it, whitens them.

    ``columns``, shape (n, r), times the inverse of ``root``, shape (r, r), upper triangular, are orthonormal.
    ``factors``, shape (r, m), are what the site's numbers do along these at no strength, band after band (stored in the
    order of Fortran); ``band``, shape (m,), is the band of each, and band k begins at ``first[k]``.  ``logs`` is ln det
    of what whitened.
    """

    columns: Floats
    root: Floats
    factors: Floats
    band: NDArray[np.int64]
    first: NDArray[np.intp]
    logs: float

    def along(self, rows: Floats) -> Floats:
        """Return the coordinates of whitened ``rows``, shape (n,) or (n, k), along the orthonormal directions."""
        return np.asarray(solve_triangular(self.root, self.columns.T @ rows, trans="T", check_finite=False))


@dataclass(frozen=True)
class Sway:
    """What a site may do to one shot, at its valid averaged samples.

    ``basis``, shape (n, r), are orthonormal directions; ``factors``, shape (r, m), what independent unit normal
    numbers do along them, in m; ``band``, shape (m,), says which strength each follows.  The last are of the plate: it
    is displaced and moves at first touch by that number of ``plate_std`` (m, m/s).  ``valid`` are the averaged samples
    that ``n`` counts, ``weight`` is the shot's white noise over that of the set.  ``speed_powers``, shape (bands, 2),
    are the variances by which speeds against the frame differ from those in space, at the touch and after the release.
    """

    basis: Floats
    factors: Floats
    band: NDArray[np.int64]
    valid: NDArray[np.bool_]
    weight: float = 1.0
    speed_powers: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    plate_std: tuple[float, float] = (0.0, 0.0)
    _known: dict[Any, Any] = field(default_factory=dict, repr=False)

    def speeds_m_per_s(self, noise: Floor) -> tuple[float, float]:
        """Return the stds by which speeds against the frame differ from those in space, at touch and release."""
        before, after = np.sqrt(np.exp(noise.site) @ self.speed_powers)
        return float(before), float(after)

    def seen(self, noise: Floor) -> Seen:
        """Return the directions as the shape of ``noise`` without its site whitens them: its white noise is one.

        Cost: some r^2 n multiply-adds where a part wanders; of the last few shapes they are remembered.
        """
        known: Seen = self._once("seen", shape_of(noise), self._seen)
        return known

    def scaled(self, noise: Floor) -> Floats:
        """Return what unit normal numbers do along the orthonormal whitened directions, shape (r, m)."""
        size = np.exp(0.5 * np.asarray(noise.site))[self.band] / noise.white_m
        return np.asarray(self.seen(noise).root @ (self.factors * size))

    def whiten(self, rows: Floats, noise: Floor) -> Floats:
        """Return ``rows``, shape (n, k), that ``noise`` without its site has whitened, with the sway whitened, too.

        Cost: 2 n r multiply-adds a column.
        """
        columns = self.seen(noise).columns
        return np.asarray(rows + columns @ (self.less(noise) @ (columns.T @ rows)))

    def less(self, noise: Floor) -> Floats:
        """Return what whitening the sway adds to whitened rows, shape (r, r): columns @ less @ columns.T @ rows.

        The ``columns`` are those of ``seen``.
        """
        known: Floats = self._once("less", noise, self._less)
        return known

    def likely(self, left_m: Floats, noise: Floor) -> Floats:
        """Return what of a remainder, shape (all averaged samples,), the site has most likely done, at valid ones."""
        scaled = self.scaled(noise)
        numbers = scaled.T @ self._pull(scaled, self._along(left_m, noise))
        size = np.exp(0.5 * np.asarray(noise.site))[self.band]
        return np.asarray(self.basis @ (self.factors @ (size * numbers)))

    def likely_plate(self, left_m: Floats, noise: Floor) -> tuple[float, float]:
        """Return the plate's likeliest state at first touch (m, m/s), from what is left beside a plate at rest."""
        scaled = self.scaled(noise)
        of_plate = slice(-len(PLATE_START), None)
        numbers = scaled[:, of_plate].T @ self._pull(scaled, self._along(left_m, noise))
        x, v = numbers * np.exp(0.5 * noise.site[self.band[-1]]) * np.asarray(self.plate_std)
        return float(x), float(v)

    def of_plate_m(self, plate: tuple[float, float]) -> Floats:
        """Return what a plate in this state at first touch (m, m/s) does, shape (all averaged samples,)."""
        out = np.zeros(self.valid.size)
        out[self.valid] = self._plate_columns @ np.divide(plate, self.plate_std)
        return out

    @cached_property
    def _plate_columns(self) -> Floats:
        """Get what each unit number of the plate's start does, shape (n, 2)."""
        return np.asarray(self.basis @ self.factors[:, -len(PLATE_START) :])

    def _along(self, left_m: Floats, noise: Floor) -> Floats:
        white = noise.whiten(left_m[:, None], self.valid, self.weight)
        return self.seen(noise).along(white)[:, 0]

    def _pull(self, scaled: Floats, along: Floats) -> Floats:
        """Return the inverse covariance along the directions times ``along``."""
        root = root_of(scaled)
        inner = solve_triangular(root, along, lower=True, check_finite=False)
        return np.asarray(solve_triangular(root, inner, lower=True, trans="T", check_finite=False))

    def _seen(self, shape: Floor) -> Seen:
        if shape.rms_m[0] == 0.0:
            columns = self.basis / self.weight
        else:
            raw = np.zeros((self.valid.size, self.basis.shape[1]))
            raw[self.valid] = self.basis
            columns = shape.whiten(raw, self.valid, self.weight)
        root = np.asarray(np.linalg.cholesky(columns.T @ columns).T)
        order = np.argsort(self.band, kind="stable")
        band = self.band[order]
        factors = np.asfortranarray(root @ self.factors[:, order])
        first = np.searchsorted(band, np.arange(int(band[-1]) + 1))
        return Seen(columns, root, factors, band, first, shape.log_variances(self.valid, self.weight))

    def _less(self, noise: Floor) -> Floats:
        root = root_of(self.scaled(noise))
        less = solve_triangular(root, np.eye(root.shape[0]), lower=True, check_finite=False)
        less[np.diag_indices_from(less)] -= 1.0
        triangle = self.seen(noise).root
        half = solve_triangular(triangle, less, check_finite=False)
        return np.asarray(solve_triangular(triangle, half.T, check_finite=False).T)

    def _once(self, what: str, noise: Floor, make: Callable[[Floor], Any]) -> Any:
        """Return what ``make`` makes of a noise; of the last few it is remembered."""
        lately = self._known.setdefault(what, {})
        known = lately.get(noise)
        if known is None:
            known = make(noise)
            while len(lately) >= _REMEMBERED:
                lately.pop(tuple(lately)[0], None)  # noqa: RUF015 (a copy: others may add to it)
            lately[noise] = known
        return known


def shape_of(noise: Floor) -> Floor:
    """Return a noise over its white part, without a site, to twelve digits: rounding makes no other shape."""
    one, two = (float(f"{rms / noise.white_m:.12g}") for rms in noise.rms_m)
    return Floor(1.0, (one, two), noise.tau_s, noise.spacing_s)


def root_of(scaled: Floats) -> Floats:
    """Return the Cholesky factor of the covariance along whitened directions, shape (r, r)."""
    covariance = scaled @ scaled.T
    covariance[np.diag_indices_from(covariance)] += 1.0
    return np.asarray(np.linalg.cholesky(covariance))


def may_be_of_a_site(row: Effect) -> bool:
    """Return whether an effect is what a swaying frame does, too: a sine everywhere, a plate that swings first."""
    return row.wave is not None or row.acts is Acts.AT_START


def site_of(
    shakings: Sequence[Shaking | None], length_s: float, least_nm: float, *, whole: bool = False
) -> Site | None:
    """Return the one site that shots of ``length_s`` tell of, None where less than ``least_nm`` rms shakes at random.

    A floor is the mean of what the shots show; a line is one where shots show it at the same frequency.  The ``whole``
    of what shakes is the frame's, or what is no quicker than a path may wander.
    """
    known = [shaking.below(BELOW_HZ) for shaking in shakings if shaking is not None]
    if not known:
        return None
    share = 1.0 / len(shakings)
    apart_hz = _APART / length_s
    frequency = np.arange(0.25 * apart_hz, max(float(one.frequency_hz[-1]) for one in known), apart_hz)
    density = sum(share * one.densities_m2_per_hz(frequency) for one in known)
    power = np.asarray(density * apart_hz)
    quick = frequency.size if whole else _of_the_frame(frequency, power)
    frequency, power = frequency[:quick], power[:quick]
    if quick < 2 or 1e9 * float(np.sqrt(power.sum())) < least_nm:  # all that moves is the path itself
        return None
    third = np.floor(_IN_AN_OCTAVE * np.log2(np.maximum(frequency / frequency[1], 1.0)))
    band = np.unique(third, return_inverse=True)[1]
    at = np.concatenate([one.frequency_hz[~one.random] for one in known])
    size = share * np.concatenate([one.power_m2[~one.random] for one in known])
    order = np.argsort(at)
    at, size = at[order], size[order]
    apart = np.diff(at, prepend=-np.inf) > _SAME_LINE / length_s
    random_bands = int(band.max()) + 1
    band = np.concatenate([band, random_bands - 1 + np.cumsum(apart)]).astype(np.int64)
    random = np.arange(band.size) < frequency.size
    return Site(Shaking(np.concatenate([frequency, at]), np.concatenate([power, size]), random), band, random_bands)


def _of_the_frame(frequency_hz: Floats, power: Floats) -> int:
    """Return how many of the sines are a frame's, slowest first.

    A building's motion falls steeply with the frequency, an optical path wanders with a density that falls with f^2:
    where the flights show no more than that, it is none of the frame's.
    """
    level = power * frequency_hz**2
    above = np.flatnonzero(level > _WANDER * level[frequency_hz >= 0.5 * frequency_hz[-1]].min())
    return int(above[-1]) + 1 if above.size else 1


def swayed(shot: Samples, site: Site, base: Base, shared: Floats, own: Floats) -> Sway:
    """Return what a site may do to a shot that went as these parameters of the base model say, its plate as is known.

    Cost: about 0.06 s.
    """
    collision = base.collision(shared, float(own[0]), shot.moving_mass_kg, shot.plate, shot.plate_number)
    omega = 2 * np.pi * site.shaking.frequency_hz
    # what a frame does is slow: the mean over an averaged sample is what it does at its middle, to a millionth
    moved, after = responses(collision, shot.centre_s - own[1], omega)
    each = np.sqrt(site.shaking.power_m2)
    model = Model(replace(base, swings=True))
    start = np.concatenate([own[:3], np.zeros(len(PLATE_START))])
    swings = respond(model, shot.for_model, shared, start, block=shot.factor).derivatives[:, -len(PLATE_START) :]
    plate_std = plate_swing_std(site.shaking, collision)
    columns = np.empty((int(shot.valid.sum()), 2 * each.size + len(PLATE_START)))
    seen = moved[shot.valid]
    np.multiply(seen.real, each, out=columns[:, : each.size])
    np.multiply(seen.imag, each, out=columns[:, each.size : 2 * each.size])
    columns[:, 2 * each.size :] = swings[shot.valid] * plate_std
    own_hz = np.sqrt(collision.plate_stiffness_n_per_m / collision.plate_mass_kg) / (2 * np.pi)
    nearest = int(np.argmin(np.abs(site.shaking.frequency_hz[site.shaking.random] - own_hz)))
    band = np.concatenate([site.band, site.band, np.repeat(site.band[nearest], len(PLATE_START))])
    level, turn = np.linalg.eigh(columns.T @ columns)
    felt = level > _SEEN * shot.white_m**2
    felt[-1] = True  # the strongest even where nothing is felt: matrices without columns are not solved with
    turn, size = turn[:, felt], np.sqrt(np.maximum(level[felt], np.finfo(np.float64).tiny))
    basis, triangle = _orthonormal((columns @ turn) / size)
    speeds = np.zeros((site.bands, 2))
    np.add.at(speeds, site.band, site.shaking.power_m2[:, None] * np.stack([omega, np.abs(after)], axis=1) ** 2)
    # What is felt of the columns is basis times factors to rounding, however far off the eigenvectors came out.
    return Sway(basis, triangle @ (size[:, None] * turn.T), band, shot.valid, shot.weight, speeds, plate_std)


def _orthonormal(columns: Floats) -> tuple[Floats, Floats]:
    """Return orthonormal columns, shape (n, r), that span what nearly orthogonal ones do, and their triangle, (r, r).

    The triangle turns the first into the second.  By Cholesky factors, twice where once leaves more than rounding
    (Yamamoto et al., ETNA 44, 2015): a sixth of the time of Householder's way or less.
    """
    out, triangle = columns, np.eye(columns.shape[1])
    try:
        for _ in range(2):
            products = out.T @ out
            root = np.linalg.cholesky(products)
            out = np.asarray(out @ np.asarray(dtrtri(root, lower=1)[0]).T)
            triangle = root.T @ triangle
            if np.abs(products - np.eye(len(products))).max() < _NEARLY:
                break
    except np.linalg.LinAlgError:
        basis, triangle = np.linalg.qr(columns)
        return np.asarray(basis), np.asarray(triangle)
    return np.ascontiguousarray(out), triangle


def on_site(
    shots: Sequence[Samples], site: Site | None, base: Base, shared: Floats, own: Floats
) -> tuple[Samples, ...]:
    """Return the shots with what a site may do to each, if they went as these parameters say; ``own`` a row a shot."""
    if site is None:
        return tuple(shots)
    every = side_by_side(lambda index: swayed(shots[index], site, base, shared, own[index]), range(len(shots)))
    return tuple(replace(shot, sway=sway) for shot, sway in zip(shots, every, strict=True))
