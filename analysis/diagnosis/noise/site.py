"""Where the shots of a set were taken: one spectrum that shook the frame under all of them, and what it did to each.

A frame that sways moves the displacement in flight and in contact along directions that the base model knows
(``model.sway``); so does a plate that it swings before the touch.  Their sizes are nobody's parameters: they are normal
numbers of known variance, integrated over wherever displacements are whitened.  The variance is what the flights'
readings say of the site, band by band times a strength that is learnt anew from what each hypothesis leaves over.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from analysis.diagnosis.fits.samples import Samples
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.disturbance import Shaking
from analysis.model.base import PLATE_START, Base
from analysis.model.effects.row import Acts, Effect
from analysis.model.general import averaged
from analysis.model.response import Model, respond
from analysis.model.sway import BELOW_HZ, plate_swing_std, responses, speed_stds
from analysis.side_by_side import side_by_side

Floats = NDArray[np.float64]
_APART = 0.45  # of one over a shot's length: sines that stand for what shakes at random
_SAME_LINE = 0.3  # of the same
_IN_AN_OCTAVE = 3  # bands
_REMEMBERED = 4  # floors
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
class Sway:
    """What a site may do to one shot, at its valid averaged samples.

    ``basis``, shape (n, r), are orthonormal directions; ``factors``, shape (r, m), what independent unit normal numbers
    do along them, in m; ``band``, shape (m,), says which strength each follows.  The last are of the plate, which
    is displaced and moves at first touch by that number of ``plate_std`` (m, m/s).  ``speeds_m_per_s`` are the stds by
    which speeds against the frame differ from those in space, at the touch and after the release.
    """

    basis: Floats
    factors: Floats
    band: NDArray[np.int64]
    speeds_m_per_s: tuple[float, float] = (0.0, 0.0)
    plate_std: tuple[float, float] = (0.0, 0.0)
    _roots: dict[tuple[float, tuple[float, ...]], Floats] = field(default_factory=dict, repr=False)

    def scaled(self, white_m: float, strengths: Sequence[float] | Floats) -> Floats:
        """Return ``factors`` at these strengths over the white noise, shape (r, m)."""
        return np.asarray(self.factors * (np.exp(0.5 * np.asarray(strengths))[self.band] / white_m))

    def whiten(self, rows: Floats, white_m: float, strengths: tuple[float, ...]) -> Floats:
        """Return ``rows``, shape (n, k), that white noise of ``white_m`` has whitened, with the sway whitened, too.

        Cost: 4 n r multiply-adds a column.
        """
        less = self._less(white_m, strengths)
        return np.asarray(rows + self.basis @ (less @ (self.basis.T @ rows)))

    def likely(self, left_m: Floats, white_m: float, strengths: tuple[float, ...]) -> Floats:
        """Return what of a remainder, shape (n,), the site has most likely done."""
        along = self.basis.T @ left_m
        less = self._less(white_m, strengths)
        white = along + less @ along
        return np.asarray(self.basis @ (along - white - less.T @ white))

    def likely_plate(
        self, left_m: Floats, known: tuple[float, float], white_m: float, strengths: tuple[float, ...]
    ) -> tuple[float, float]:
        """Return the plate's likeliest state at first touch (m, m/s), from what is left beside the one ``known``."""
        of_plate, std = slice(-len(PLATE_START), None), np.asarray(self.plate_std)
        along = self.basis.T @ left_m + self.factors[:, of_plate] @ (known / std)
        less = self._less(white_m, strengths)
        white = along + less @ along
        numbers = self.scaled(white_m, strengths)[:, of_plate].T @ (white + less.T @ white) / white_m
        x, v = numbers * np.exp(0.5 * strengths[self.band[-1]]) * std
        return float(x), float(v)

    def _less(self, white_m: float, strengths: tuple[float, ...]) -> Floats:
        """Return what turns white noise with the sway to white noise along the basis, less one, shape (r, r)."""
        key = (white_m, strengths)
        less = self._roots.get(key)
        if less is None:
            root = root_of(self.scaled(white_m, strengths))
            less = solve_triangular(root, np.eye(root.shape[0]), lower=True, check_finite=False)
            less[np.diag_indices_from(less)] -= 1.0
            while len(self._roots) >= _REMEMBERED:
                self._roots.pop(next(iter(self._roots)), None)
            self._roots[key] = less
        return less


def root_of(scaled: Floats) -> Floats:
    """Return the Cholesky factor of the covariance along a basis over the white variance, shape (r, r)."""
    covariance = scaled @ scaled.T
    covariance[np.diag_indices_from(covariance)] += 1.0
    return np.asarray(np.linalg.cholesky(covariance))


def may_be_of_a_site(row: Effect) -> bool:
    """Return whether an effect is what a swaying frame does, too: a sine everywhere, a plate that swings first."""
    return row.wave is not None or row.acts is Acts.AT_START


def site_of(shakings: Sequence[Shaking | None], length_s: float) -> Site | None:
    """Return the one site that shots of ``length_s`` tell of, None where hardly anything shakes.

    A floor is the mean of what the shots show; a line is one where shots show it at the same frequency.
    """
    known = [shaking.below(BELOW_HZ) for shaking in shakings if shaking is not None]
    if not known:
        return None
    share = 1.0 / len(shakings)
    apart_hz = _APART / length_s
    frequency = np.arange(0.25 * apart_hz, max(float(one.frequency_hz[-1]) for one in known), apart_hz)
    density = sum(share * np.array([one.density_m2_per_hz(float(f)) for f in frequency]) for one in known)
    power = np.asarray(density * apart_hz)
    if 1e9 * float(np.sqrt(power.sum())) < CRITERIA.site_nm:
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


def swayed(shot: Samples, site: Site, base: Base, shared: Floats, own: Floats) -> Sway:
    """Return what a site may do to a shot that went as these parameters of the base model say, its plate as is known.

    Cost: about 0.1 s.
    """
    collision = base.collision(shared, float(own[0]), shot.moving_mass_kg, shot.plate, shot.plate_number)
    omega = 2 * np.pi * site.shaking.frequency_hz
    moved, after = responses(collision, shot.time_s - own[1], omega)
    size = np.sqrt(site.shaking.power_m2)
    model = Model(replace(base, swings=True))
    start = np.concatenate([own[:3], np.zeros(len(PLATE_START))])
    swings = respond(model, shot.for_model, shared, start, block=shot.factor).derivatives[:, -len(PLATE_START) :]
    plate_std = plate_swing_std(site.shaking, collision)
    columns = np.hstack(
        [
            averaged(moved.real * size, shot.factor),
            averaged(moved.imag * size, shot.factor),
            swings * plate_std,
        ]
    )[shot.valid]
    own_hz = np.sqrt(collision.plate_stiffness_n_per_m / collision.plate_mass_kg) / (2 * np.pi)
    nearest = int(np.argmin(np.abs(site.shaking.frequency_hz[site.shaking.random] - own_hz)))
    band = np.concatenate([site.band, site.band, np.repeat(site.band[nearest], len(PLATE_START))])
    level, turn = np.linalg.eigh(columns.T @ columns)
    basis, _ = np.linalg.qr(columns @ turn[:, level > _SEEN * shot.white_m**2])
    return Sway(basis, basis.T @ columns, band, speed_stds(site.shaking, after), plate_std)


def on_site(
    shots: Sequence[Samples], site: Site | None, base: Base, shared: Floats, own: Floats
) -> tuple[Samples, ...]:
    """Return the shots with what a site may do to each, if they went as these parameters say; ``own`` a row a shot."""
    if site is None:
        return tuple(shots)
    every = side_by_side(lambda index: swayed(shots[index], site, base, shared, own[index]), range(len(shots)))
    return tuple(replace(shot, sway=sway) for shot, sway in zip(shots, every, strict=True))
