"""What a moving frame may have added to each shot, and displacements whitened of it.

A moving frame adds to the displacement, in flight and in contact, along directions that the base model gives
(``frame_response.py``); so does a plate that the frame made swing before the touch.  The amplitudes are not fitted:
they are normal numbers of known variance, integrated over wherever displacements are whitened.  Their variance is what
the flights show of the frame, band by band (``site.py``), times a strength that is learnt anew from the residual of
each hypothesis.  The optical path wanders in a building as elsewhere: the frame's motion is one term of the covariance,
added to white noise and wandering parts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpstrf

from analysis.collision import named
from analysis.compiled import side_by_side, solve_triangle
from analysis.inference.fit.base import Base
from analysis.inference.fit.effective_parameters import Point, Values
from analysis.inference.fit.response import ShotModel, respond
from analysis.inference.fit.samples import Samples
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.frame_response import plate_swing_std, responses
from analysis.inference.noise.site import Site
from analysis.reading import root_of
from analysis.shot import Floats

_NO_EFFECTS: Values = {}
_REMEMBERED = 4  # results kept, by noise and by shape of the noise
_NEARLY = 0.05  # greatest cosine between columns that pass for orthogonal
_ROUNDING = 2e-15  # of the largest sum of squares: nine units of the last place
_SEEN = 1e-3  # of the variance of white noise: directions with less are left out
_PLATE_START = ("displacement_m", "velocity_m_per_s")  # of the plate at first touch
_OF_PLATE = slice(-len(_PLATE_START), None)  # of the unit normal numbers: the last stand for the plate's start


@dataclass(frozen=True)
class WhitenedDirections:
    """A shot's directions of frame motion, whitened by a noise without the frame and of unit white noise.

    ``columns``, shape (n, r), times the inverse of ``root``, shape (r, r), upper triangular, are orthonormal.
    ``factors``, shape (r, m), give the frame's m unit normal numbers along these (stored in the order of Fortran).
    ``logs`` is ln det of the covariance that whitened.
    """

    columns: Floats
    root: Floats
    factors: Floats
    logs: float

    def along(self, rows: Floats) -> Floats:
        """Return the coordinates of whitened ``rows``, shape (n,) or (n, k), along the orthonormal directions."""
        return solve_triangle(self.root, self.columns.T @ rows, lower=False, transposed=True)


@dataclass(frozen=True)
class Sway:
    """What the frame's motion may add to one shot, at its valid averaged samples.

    ``basis``, shape (n, r), are directions, orthonormal or nearly so; ``factors``, shape (r, m), give the contributions
    in m of m independent unit normal numbers; ``band``, shape (m,), names the strength that scales each.  The last two
    are the plate's displacement and velocity at first touch, in units of ``plate_std`` (m, m/s).  ``valid`` marks the
    n averaged samples; ``weight`` is the shot's white noise over that of the set.  ``speed_powers``, shape (bands, 2),
    are the variances of the difference between velocities relative to the frame and in space, at the touch and after
    the release.
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
        """Return the stds of velocities relative to the frame minus those in space, at touch and release."""
        before, after = np.sqrt(np.exp(noise.site) @ self.speed_powers)
        return float(before), float(after)

    def whitened_directions(self, noise: Floor) -> WhitenedDirections:
        """Return the directions whitened by the shape of ``noise`` without the frame, in units of its white noise.

        Cost: some r^2 n multiply-adds where a part wanders; the last few shapes are kept.
        """
        known: WhitenedDirections = self._cached("directions", shape_of(noise), self._whiten_directions)
        return known

    def scaled(self, noise: Floor) -> Floats:
        """Return the unit normal numbers' contributions along the orthonormal whitened directions, shape (r, m)."""
        size = np.exp(0.5 * np.asarray(noise.site))[self.band] / noise.white_m
        return np.asarray(self.whitened_directions(noise).root @ (self.factors * size))

    def whiten(self, rows: Floats, noise: Floor) -> Floats:
        """Return ``rows``, shape (n, k), already whitened by ``noise`` without the frame, whitened by the whole noise.

        Cost: 2 n r multiply-adds per column.
        """
        columns = self.whitened_directions(noise).columns
        return np.asarray(rows + columns @ (self.whitening_matrix(noise) @ (columns.T @ rows)))

    def whitening_matrix(self, noise: Floor) -> Floats:
        """Return the matrix L, shape (r, r), with which columns @ L @ columns.T @ rows whitens the frame's motion.

        It is added to rows whitened by the other noise; ``columns`` are those of ``whitened_directions``.
        """
        known: Floats = self._cached("whitening", noise, self._whitening_matrix)
        return known

    def likely(self, left_m: Floats, noise: Floor) -> Floats:
        """Return the frame's likeliest part of a residual, shape (all averaged samples,), at the valid samples."""
        scaled = self.scaled(noise)
        numbers = scaled.T @ self._pull(scaled, self._along(left_m, noise))
        size = np.exp(0.5 * np.asarray(noise.site))[self.band]
        return np.asarray(self.basis @ (self.factors @ (size * numbers)))

    def likely_plate(self, left_m: Floats, noise: Floor) -> tuple[float, float]:
        """Return the plate's likeliest state at first touch (m, m/s), from the residual with the plate at rest."""
        scaled = self.scaled(noise)
        numbers = scaled[:, _OF_PLATE].T @ self._pull(scaled, self._along(left_m, noise))
        x, v = numbers * np.exp(0.5 * noise.site[self.band[-1]]) * np.asarray(self.plate_std)
        return float(x), float(v)

    def of_plate_m(self, plate: tuple[float, float]) -> Floats:
        """Return the displacement due to this state of the plate at first touch (m, m/s), at all averaged samples."""
        out = np.zeros(self.valid.size)
        out[self.valid] = self._plate_columns @ np.divide(plate, self.plate_std)
        return out

    def apart_m(self, other: "Sway", noise: Floor) -> float:
        """Return the largest std, of any sample, of what two responses to the same motion of the frame differ by."""
        size = np.exp(0.5 * np.asarray(noise.site))[self.band]
        apart = (self.basis @ self.factors - other.basis @ other.factors) * size
        return float(np.sqrt(np.max(np.sum(apart**2, axis=1))))

    @cached_property
    def shares(self) -> Floats:
        """Get the variances that the bands give the unit normal numbers at strength one, shape (bands, m)."""
        return np.equal.outer(np.arange(int(self.band.max()) + 1), self.band).astype(np.float64)

    @cached_property
    def _plate_columns(self) -> Floats:
        """Get the displacement due to each unit number of the plate's start, shape (n, 2)."""
        return np.asarray(self.basis @ self.factors[:, _OF_PLATE])

    def _along(self, left_m: Floats, noise: Floor) -> Floats:
        white = noise.whiten(left_m[:, None], self.valid, self.weight)
        return self.whitened_directions(noise).along(white)[:, 0]

    def _pull(self, scaled: Floats, along: Floats) -> Floats:
        """Return the inverse covariance along the directions times ``along``."""
        root = root_of(scaled)
        return solve_triangle(root, solve_triangle(root, along, lower=True), lower=True, transposed=True)

    def _whiten_directions(self, shape: Floor) -> WhitenedDirections:
        if shape.rms_m[0] == 0.0:
            columns = self.basis / self.weight
        else:
            raw = np.zeros((self.valid.size, self.basis.shape[1]))
            raw[self.valid] = self.basis
            columns = shape.whiten(raw, self.valid, self.weight)
        root = np.asarray(np.linalg.cholesky(columns.T @ columns).T)
        factors = np.asfortranarray(root @ self.factors)
        return WhitenedDirections(columns, root, factors, shape.log_variances(self.valid, self.weight))

    def _whitening_matrix(self, noise: Floor) -> Floats:
        root = root_of(self.scaled(noise))
        whitening_matrix = solve_triangle(root, np.eye(root.shape[0]), lower=True)
        whitening_matrix[np.diag_indices_from(whitening_matrix)] -= 1.0
        triangle = self.whitened_directions(noise).root
        half = solve_triangle(triangle, whitening_matrix, lower=False)
        return solve_triangle(triangle, half.T, lower=False).T

    def _cached(self, what: str, noise: Floor, make: Callable[[Floor], Any]) -> Any:
        """Return ``make(noise)``; the last few results are kept."""
        lately = self._known.setdefault(what, {})
        known = lately.get(noise)
        if known is None:
            known = make(noise)
            while len(lately) >= _REMEMBERED:
                lately.pop(tuple(lately)[0], None)  # noqa: RUF015 (a copy: other threads may add to it)
            lately[noise] = known
        return known


def shape_of(noise: Floor) -> Floor:
    """Return a noise in units of its white part, without the frame, to twelve digits against rounding."""
    one, two = (float(f"{rms / noise.white_m:.12g}") for rms in noise.rms_m)
    return Floor(1.0, (one, two), noise.tau_s, noise.spacing_s)


def swayed(shot: Samples, site: Site, base: Base, shared: Floats, own: Floats, values: Values = _NO_EFFECTS) -> Sway:
    """Return what the frame may have added to a shot, computed for the motion that these parameters give.

    ``values`` are those of effects that act on it.  The plate begins at its known state, if it has one.  Cost: 0.02 s.
    """
    starting = named("plate_motion")
    model = ShotModel(shot, base, shared, own, {starting: dict.fromkeys(_PLATE_START, 0.0), **values})
    collision = model.collision
    omega = 2 * np.pi * site.shaking.frequency_hz
    moved, after = responses(model, omega)
    each = np.sqrt(site.shaking.power_m2)
    by_start = [model.names.index(f"{starting.key}.{name}") for name in _PLATE_START]
    swings = respond(model, shot.time_s, block=shot.factor, derivatives=True).derivatives[:, by_start]
    plate_std = plate_swing_std(site.shaking, collision)
    columns = np.empty((int(shot.valid.sum()), 2 * each.size + len(_PLATE_START)))
    np.multiply(moved[shot.valid], np.tile(each, 2), out=columns[:, : 2 * each.size])
    columns[:, 2 * each.size :] = swings[shot.valid] * plate_std
    own_hz = np.sqrt(collision.plate_stiffness_n_per_m / collision.plate_mass_kg) / (2 * np.pi)
    nearest = int(np.argmin(np.abs(site.shaking.frequency_hz[site.shaking.random] - own_hz)))
    band = np.concatenate([site.band, site.band, np.repeat(site.band[nearest], len(_PLATE_START))])
    basis, factors = _orthonormal(columns, _SEEN * shot.white_m**2)
    speeds = np.zeros((site.bands, 2))
    squares = np.stack([omega**2, np.sum(after.reshape(2, -1) ** 2, axis=0)], axis=1)
    np.add.at(speeds, site.band, site.shaking.power_m2[:, None] * squares)
    return Sway(basis, factors, band, shot.valid, shot.weight, speeds, plate_std)


def _orthonormal(columns: Floats, least: float) -> tuple[Floats, Floats]:
    """Return a nearly orthonormal basis, shape (n, r), of columns, shape (n, m), and their factors along it, (r, m).

    Columns are basis times factors but for a sum of squares of some ``least`` each, or what rounding hides of the
    largest.  By the Cholesky factor of their products (Yamamoto et al., ETNA 44, 2015), with pivots, which choose the r
    columns that tell most; where rounding leaves its basis far from orthonormal, by Householder's as well.  Cost:
    (m^2 + 2 r^2) n / 2 multiply-adds.
    """
    products = columns.T @ columns
    hidden = _ROUNDING * float(np.max(np.diag(products)))
    triangle, order, rank, _ = dpstrf(products, tol=max(least, hidden))
    rank = max(1, rank)  # the strongest even where nothing is felt: matrices without columns are not solved with
    factors = np.empty((rank, order.size))
    factors[:, order - 1] = np.triu(triangle)[:rank]
    basis = solve_triangle(triangle[:rank, :rank], columns.T[order[:rank] - 1], lower=False, transposed=True).T
    products = basis.T @ basis
    if np.abs(products - np.eye(rank)).max() > _NEARLY:
        basis, triangle = np.linalg.qr(basis)
        factors = triangle @ factors
    return np.ascontiguousarray(basis), factors


def on_site(shots: Sequence[Samples], site: Site | None, base: Base, at: Point) -> tuple[Samples, ...]:
    """Return the shots with what the frame may have added, computed for the motion at these parameters."""
    if site is None:
        return tuple(shots)

    def of_shot(index: int) -> Sway:
        return swayed(shots[index], site, base, at.base, at.own[index], at.values[index])

    every = side_by_side(of_shot, range(len(shots)))
    return tuple(replace(shot, sway=sway) for shot, sway in zip(shots, every, strict=True))
