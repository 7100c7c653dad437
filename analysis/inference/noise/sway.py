"""Frame motion as a covariance term of each shot, and whitening of displacements.

A moving frame changes the displacement in flight and in contact, along directions computed from the base model
(``frame_response.py``).  A plate that the frame set swinging before the touch adds further directions.  The amplitudes
along these directions are not fitted.  They are normal numbers of known variance, and whitening marginalises them.
Their variance is the one read from the flights, band by band (``site.py``), times a strength that is re-estimated from
the residual of each hypothesis.  The covariance is the sum of frame motion, white noise and optical-path wander.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpstrf

from analysis.collision import effect_named
from analysis.compiled import side_by_side, solve_triangle
from analysis.inference.model.base import Base, Plates
from analysis.inference.model.effective_parameters import Point, Values
from analysis.inference.model.response import ShotModel, respond
from analysis.inference.model.samples import Samples
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.frame_response import plate_swing_std, responses
from analysis.inference.noise.site import Site
from analysis.reading import Bands
from analysis.shot import Floats

Result = TypeVar("Result")
_REMEMBERED = 4  # cached results, by noise and by shape of the noise
_NEARLY = 0.05  # largest cosine between columns that are treated as orthogonal
_ROUNDING = 2e-15  # fraction of the largest sum of squares: nine units in the last place
_SEEN = 1e-3  # fraction of the white-noise variance below which a direction is dropped
_PLATE_START = ("displacement_m", "velocity_m_per_s")  # of the plate at first touch
_OF_PLATE = slice(-len(_PLATE_START), None)  # the last unit normal numbers, which set the plate's initial state


@dataclass(frozen=True)
class WhitenedDirections:
    """A shot's directions of frame motion, whitened by a noise without frame motion and with unit white variance.

    ``columns``, shape (n, r), times the inverse of ``root``, shape (r, r), upper triangular, are orthonormal.
    ``bands`` are the motion of the frame's bands along them, by the frame's m unit normal numbers, in units of the
    white noise.  ``logs`` is ln det of the whitening covariance.
    """

    columns: Floats
    root: Floats
    bands: Bands
    logs: float

    def along(self, rows: Floats) -> Floats:
        """Return the coordinates of whitened ``rows``, shape (n,) or (n, k), along the orthonormal directions."""
        return solve_triangle(self.root, self.columns.T @ rows, lower=False, transposed=True)


@dataclass(frozen=True)
class Sway:
    """Frame motion as a covariance term of one shot, at its n valid averaged samples.

    ``basis``, shape (n, r), holds orthonormal or nearly orthonormal directions.  ``factors``, shape (r, m), maps m
    independent unit normal numbers to displacements in m along them.  ``band``, shape (m,), is the index of the
    strength that scales each number.  The last two numbers are the plate's displacement and velocity at first touch, in
    units of ``plate_std`` (m, m/s).  ``valid`` marks the n averaged samples.  ``weight`` is the shot's white noise over
    that of the set.  ``speed_powers``, shape (bands, 2), are variances of the block's velocity relative to the frame
    minus that in space, at the touch and after the release.
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
        """Return the stds (m/s) of velocities relative to the frame minus those in space, at touch and release."""
        before, after = np.sqrt(np.exp(noise.site) @ self.speed_powers)
        return float(before), float(after)

    def whitened_directions(self, noise: Floor) -> WhitenedDirections:
        """Return the directions whitened by the shape of ``noise`` without frame motion, in units of its white noise.

        Cost: about r^2 n multiply-adds if the noise has a wandering part.  Results for the last few shapes are cached.
        """
        return self._cached("directions", shape_of(noise), self._whiten_directions)

    def scaled(self, noise: Floor) -> Floats:
        """Return the factors of the unit normal numbers along the orthonormal whitened directions, shape (r, m)."""
        size = np.exp(0.5 * np.asarray(noise.site))[self.band] / noise.white_m
        return self.whitened_directions(noise).bands.factors * size

    def whiten(self, rows: Floats, noise: Floor) -> Floats:
        """Return ``rows``, shape (n, k), whitened by the whole noise, given rows whitened without frame motion.

        Cost: 2 n r multiply-adds per column.
        """
        columns = self.whitened_directions(noise).columns
        return np.asarray(rows + columns @ (self.whitening_matrix(noise) @ (columns.T @ rows)))

    def whitening_matrix(self, noise: Floor) -> Floats:
        """Return the matrix L, shape (r, r), such that rows + columns @ L @ columns.T @ rows is fully whitened.

        ``rows`` are already whitened without frame motion; ``columns`` are those of ``whitened_directions``.
        """
        return self._cached("whitening", noise, self._whitening_matrix)

    def likely(self, left_m: Floats, noise: Floor) -> Floats:
        """Return the likeliest frame motion in m at the valid samples, given a residual at all averaged samples."""
        numbers = self.scaled(noise).T @ self._pull(left_m, noise)
        size = np.exp(0.5 * np.asarray(noise.site))[self.band]
        return np.asarray(self.basis @ (self.factors @ (size * numbers)))

    def likeliest_plate(self, left_m: Floats, noise: Floor) -> tuple[float, float]:
        """Return the plate's likeliest state at first touch (m, m/s), given the residual with the plate at rest."""
        numbers = self.scaled(noise)[:, _OF_PLATE].T @ self._pull(left_m, noise)
        x, v = numbers * np.exp(0.5 * noise.site[self.band[-1]]) * np.asarray(self.plate_std)
        return float(x), float(v)

    def plate_displacement_m(self, plate: tuple[float, float]) -> Floats:
        """Return the displacement in m caused by this plate state (m, m/s) at first touch, at all averaged samples."""
        out = np.zeros(self.valid.size)
        out[self.valid] = self._plate_columns @ np.divide(plate, self.plate_std)
        return out

    def variances_read_m2(self) -> Floats:
        """Return the variance in m^2, read from the flights, of the frame's contribution at the valid samples, (n,)."""
        return np.asarray(np.sum((self.basis @ self.factors) ** 2, axis=1))

    def largest_difference_m(self, other: "Sway", noise: Floor) -> float:
        """Return the largest std in m over the samples of the difference to another response to the same motion."""
        size = np.exp(0.5 * np.asarray(noise.site))[self.band]
        apart = (self.basis @ self.factors - other.basis @ other.factors) * size
        return float(np.sqrt(np.max(np.sum(apart**2, axis=1))))

    @cached_property
    def _plate_columns(self) -> Floats:
        """Get the displacement in m per unit number of the plate's initial state, shape (n, 2)."""
        return np.asarray(self.basis @ self.factors[:, _OF_PLATE])

    def _root(self, noise: Floor) -> Floats:
        """Return the Cholesky factor of the covariance along the orthonormal whitened directions, shape (r, r)."""
        bands = self.whitened_directions(noise).bands
        return self._cached("root", noise, lambda noise: bands.root(noise.logarithms))

    def _pull(self, left_m: Floats, noise: Floor) -> Floats:
        """Return the inverse covariance along the directions times the residual along them, shape (r,)."""
        white = noise.whiten(left_m[:, None], self.valid, self.weight)
        along, root = self.whitened_directions(noise).along(white)[:, 0], self._root(noise)
        return solve_triangle(root, solve_triangle(root, along, lower=True), lower=True, transposed=True)

    def _whiten_directions(self, shape: Floor) -> WhitenedDirections:
        if shape.rms_m[0] == 0.0:
            columns = self.basis / self.weight
        else:
            raw = np.zeros((self.valid.size, self.basis.shape[1]))
            raw[self.valid] = self.basis
            columns = shape.whiten(raw, self.valid, self.weight)
        root = np.asarray(np.linalg.cholesky(columns.T @ columns).T)
        shares = np.equal.outer(np.arange(int(self.band.max()) + 1), self.band).astype(np.float64)
        logs = shape.log_variances(self.valid, self.weight)
        return WhitenedDirections(columns, root, Bands(root @ self.factors, shares), logs)

    def _whitening_matrix(self, noise: Floor) -> Floats:
        root = self._root(noise)
        whitening_matrix = solve_triangle(root, np.eye(root.shape[0]), lower=True)
        whitening_matrix[np.diag_indices_from(whitening_matrix)] -= 1.0
        triangle = self.whitened_directions(noise).root
        half = solve_triangle(triangle, whitening_matrix, lower=False)
        return solve_triangle(triangle, half.T, lower=False).T

    def _cached(self, what: str, noise: Floor, make: Callable[[Floor], Result]) -> Result:
        """Return ``make(noise)``; the last few results are cached."""
        lately = self._known.setdefault(what, {})
        known: Result | None = lately.get(noise)
        if known is None:
            known = make(noise)
            while len(lately) >= _REMEMBERED:
                lately.pop(tuple(lately)[0], None)  # noqa: RUF015 (a copy: other threads may add to it)
            lately[noise] = known
        return known


def shape_of(noise: Floor, parts: int = 2) -> Floor:
    """Return a noise in units of its white part, without frame motion, with the first ``parts`` wandering parts.

    It is rounded to twelve digits for use as a key.
    """
    one, two = (float(f"{rms / noise.white_m:.12g}") for rms in noise.rms_m)
    return Floor(1.0, (one, two if parts > 1 else 0.0), noise.tau_s, noise.spacing_s)


def frame_response_of(shot: Samples, site: Site, base: Base, shared: Floats, own: Floats, values: Values) -> Sway:
    """Return the frame's covariance term of a shot, linearised about the motion at these parameters.

    ``values`` are the parameters of effects that act on the shot.  The plate starts in its known state, if there is
    one.  Cost: 5 ms.
    """
    starting = effect_named("plate_motion")
    model = ShotModel(shot, base, shared, own, {starting: dict.fromkeys(_PLATE_START, 0.0), **values})
    collision = model.collision
    omega = 2 * np.pi * site.vibration.frequency_hz
    moved, after = responses(model, omega)
    each = np.sqrt(site.vibration.power_m2)
    by_start = [model.names.index(f"{starting.key}.{name}") for name in _PLATE_START]
    swings = respond(model, shot.time_s, block=shot.factor, derivatives=True).derivatives[:, by_start]
    plate_std = plate_swing_std(site.vibration, collision)
    columns = np.empty((int(shot.valid.sum()), 2 * each.size + len(_PLATE_START)))
    np.multiply(moved[shot.valid], np.tile(each, 2), out=columns[:, : 2 * each.size])
    columns[:, 2 * each.size :] = swings[shot.valid] * plate_std
    own_hz = np.sqrt(collision.plate_stiffness_n_per_m / collision.plate_mass_kg) / (2 * np.pi)
    nearest = int(np.argmin(np.abs(site.vibration.frequency_hz[site.vibration.random] - own_hz)))
    band = np.concatenate([site.band, site.band, np.repeat(site.band[nearest], len(_PLATE_START))])
    basis, factors = _orthonormal(columns, _SEEN * shot.white_m**2)
    speeds = np.zeros((site.bands, 2))
    squares = np.stack([omega**2, np.sum(after.reshape(2, -1) ** 2, axis=0)], axis=1)
    np.add.at(speeds, site.band, site.vibration.power_m2[:, None] * squares)
    return Sway(basis, factors, band, shot.valid, shot.weight, speeds, plate_std)


def _orthonormal(columns: Floats, least: float) -> tuple[Floats, Floats]:
    """Return a nearly orthonormal basis, shape (n, r), of columns, shape (n, m), and their factors along it, (r, m).

    Each column equals basis times factors up to a sum of squares of about ``least``, or of the rounding error of the
    largest column.  The method is a pivoted Cholesky factorisation of the Gram matrix (Yamamoto et al., ETNA 44, 2015),
    whose pivots select r columns.  If rounding leaves the basis far from orthonormal, a Householder QR follows.  Cost:
    (m^2 + 2 r^2) n / 2 multiply-adds.
    """
    products = columns.T @ columns
    hidden = _ROUNDING * float(np.max(np.diag(products)))
    triangle, order, rank, _ = dpstrf(products, tol=max(least, hidden))
    rank = max(1, rank)  # at least the strongest direction: the solvers do not accept matrices without columns
    factors = np.empty((rank, order.size))
    factors[:, order - 1] = np.triu(triangle)[:rank]
    basis = solve_triangle(triangle[:rank, :rank], columns.T[order[:rank] - 1], lower=False, transposed=True).T
    products = basis.T @ basis
    if np.abs(products - np.eye(rank)).max() > _NEARLY:
        basis, triangle = np.linalg.qr(basis)
        factors = triangle @ factors
    return np.ascontiguousarray(basis), factors


def on_site(shots: Sequence[Samples], site: Site, base: Base, at: Point, plates: Plates = ()) -> tuple[Samples, ...]:
    """Return the shots with the frame's contribution, linearised about the motion at these parameters.

    ``plates``, if any, are the plates' states (m, m/s) at first touch about which it is linearised.
    """
    if not site.moves:
        return tuple(shots)
    swung = with_plates(shots, plates)

    def of_shot(index: int) -> Sway:
        return frame_response_of(swung[index], site, base, at.base, at.own[index], at.values[index])

    every = side_by_side(of_shot, range(len(swung)))
    return tuple(replace(shot, sway=sway) for shot, sway in zip(swung, every, strict=True))


def with_plates(shots: Sequence[Samples], plates: Plates) -> tuple[Samples, ...]:
    """Return the shots with each plate's state at first touch (m, m/s), if ``plates`` is not empty."""
    return tuple(replace(s, plate=plate) for s, plate in zip(shots, plates, strict=True)) if plates else tuple(shots)
