"""What a frame that sways does to a shot, and the noise of a displacement that has it in it.

Optics and plate stand on the frame, the block floats free of it.  In flight the whole motion of the frame stands in the
displacement, backwards; in contact the plate's clamp carries plate and block along.  Seen from the frame every mass
feels minus the frame's acceleration, so a small sway adds to the shot what the equations of the two bodies, linear in
every phase, make of that force: phase by phase in closed form, with the jump of the derivatives wherever the contact
begins or ends (saltation; Leine & Nijmeijer, "Dynamics and Bifurcations of Non-Smooth Mechanical Systems", ch. 7).
Position and velocity of the frame at the touch are left out of it: with these a shot is the same shot, begun elsewhere
and at another speed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.sparse import csc_matrix, csr_matrix

from analysis.collision.exact import Event, solve
from analysis.collision.general import RunsAway, TooManyEvents
from analysis.collision.parameters import Collision, Floats, Infeasible
from analysis.inference.noise.noise import Noise
from analysis.shot.disturbance import Shaking

BELOW_HZ = 1000.0  # what shakes faster is part of the beat's noise
PLATE_QUALITY = 300.0  # at most, of a metal plate's swing in air
STILL = (1e-15, 1e-12)  # m, m/s: std of a plate that nothing swings
_ROUNDING = 1e-13
_NOTHING = 1e-6
_LEAST = 1e-8  # of the largest value: less counts as nothing

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Grid:
    """Splines that a frame's motion is written in: their ``knots_s``, and as the beat's noise leaves them white.

    ``columns``, shape (n, m), one of each; ``products``, shape (m, m), are those of any two.
    """

    knots_s: Floats
    columns: csr_matrix
    products: Floats

    @classmethod
    def of(cls, beat: Noise, knots_s: Floats, time_s: Floats, valid: NDArray[np.bool_]) -> "Grid":
        """Lay it; cost about 5 ms, 40 ms where the beat's noise is not white."""
        splines = _splines_at(knots_s, time_s)
        if beat.only_white:
            return cls.holding(knots_s, splines[np.flatnonzero(valid)] / beat.white_std_m)
        return cls.holding(knots_s, _local(beat.whiten(splines.toarray(), valid)))

    @property
    def root(self) -> Floats:
        """Get R, shape (m, m), upper triangular, of the products R^T R: columns R^-1 are orthonormal."""
        least = _ROUNDING * float(np.trace(self.products)) / self.products.shape[0]
        return np.asarray(np.linalg.cholesky(self.products + least * np.eye(self.products.shape[0])).T)

    @classmethod
    def holding(cls, knots_s: Floats, columns: csr_matrix) -> "Grid":
        """Return the grid of these columns."""
        return cls(knots_s, columns, (columns.T @ columns).toarray())


@dataclass(frozen=True)
class Swayed:
    """The noise of a displacement on a frame that sways: the beat's own, and smooth motion of known covariance.

    ``sines``, shape (m, 2 f), are the splines of all sines of the sway at their stds; ``across``, shape (m, r), and
    ``share``, shape (r,), make of what the grid's splines hold the part to be taken off, so that the rest is white.
    ``speeds_m_per_s`` are the stds by which speeds against the frame differ from those in space, at the touch and after
    the release.
    """

    beat: Noise
    grid: Grid
    sines: Floats
    across: Floats
    share: Floats
    speeds_m_per_s: tuple[float, float]

    @classmethod
    def of(cls, beat: Noise, grid: Grid, shaking: Shaking, collision: Collision, touch_time_s: float) -> "Swayed":
        """Return the noise of a shot that went as ``collision`` from ``touch_time_s`` on; cost about 10 ms."""
        sines, left = unit_sines(grid, shaking.frequency_hz, collision, touch_time_s)
        sines = sines * np.sqrt(np.tile(shaking.power_m2, 2))
        return cls(beat, grid, sines, *_taken(grid, sines), speed_stds(shaking, left))

    def of_first(self, samples: int) -> "Swayed":
        """Return the noise where only the first valid samples are looked at."""
        grid = Grid.holding(self.grid.knots_s, self.grid.columns[:samples])
        return Swayed(self.beat, grid, self.sines, *_taken(grid, self.sines), self.speeds_m_per_s)

    def sines_at(self, time_s: Floats) -> Floats:
        """Return what each sine of the sway does to the displacement at its std, shape (n, 2 f)."""
        return np.asarray(_splines_at(self.grid.knots_s, time_s) @ self.sines)

    @property
    def std_m(self) -> float:
        """Get the standard deviation of one sample beside the sway."""
        return self.beat.std_m

    @property
    def trusted(self) -> bool:
        """Get whether the beat's noise could be learnt."""
        return self.beat.trusted

    def whiten(self, columns: Floats, valid: NDArray[np.bool_]) -> Floats:
        """Filter ``columns``, shape (n,) or (n, k), to unit white noise where their noise is this one."""
        white = self.beat.whiten(columns, valid)
        seen = (self.across.T @ (self.grid.columns.T @ white)).T * self.share
        return np.asarray(white - self.grid.columns @ (self.across @ seen.T))


def unit_sines(grid: Grid, frequency_hz: Floats, collision: Collision, touch_time_s: float) -> tuple[Floats, Complex]:
    """Return what unit sways do to a shot, cosines and then sines in the grid's splines, shape (m, 2 f).

    The second is what ``responses`` says of them after the last release, shape (f,).
    """
    moved, left = responses(collision, grid.knots_s - touch_time_s, 2 * np.pi * frequency_hz)
    return np.asarray(_spline(grid.knots_s, np.hstack([moved.real, moved.imag])).c), left


def speed_stds(shaking: Shaking, left: Complex) -> tuple[float, float]:
    """Return the stds by which speeds against the frame differ from those in space: at the touch, after the release.

    ``left`` is what ``responses`` says of unit sways, shape (f,).
    """
    sides = (2 * np.pi * shaking.frequency_hz, np.abs(left))
    before, after = (float(np.sqrt(np.sum(shaking.power_m2 * side**2))) for side in sides)
    return before, after


def plate_swing_std(shaking: Shaking, collision: Collision) -> tuple[float, float]:
    """Return the std of the plate's displacement (m) and velocity (m/s) against the frame before it is touched."""
    own = float(np.sqrt(collision.plate_stiffness_n_per_m / collision.plate_mass_kg))
    omega = 2 * np.pi * shaking.frequency_hz
    answer = omega**2 / np.hypot(own**2 - omega**2, own * omega / PLATE_QUALITY)
    width = np.zeros(omega.size)
    if np.count_nonzero(shaking.random) > 1:
        width[shaking.random] = np.gradient(omega[shaking.random])
    beside = np.abs(omega - own) > 2 * width
    driven = float(np.sum((shaking.power_m2 * answer**2)[beside]))
    resonant = 0.25 * own * PLATE_QUALITY * shaking.density_m2_per_hz(own / (2 * np.pi))
    std = float(np.sqrt(driven + resonant))
    # a trial plate that nothing swings is still weighed by how far it may be from rest
    return max(std, STILL[0]), max(own * std, STILL[1])


def responses(collision: Collision, at_s: Floats, omega: Floats) -> tuple[Complex, Complex]:
    """Return what a frame that sways as exp(i omega t) adds to the displacement, shape (n, f), for unit sways.

    ``at_s``, shape (n,), counts from the first touch.  The second, shape (f,), is what the frame's and the added
    velocity make together after the last release, where it stays.  Infeasible where there is no such collision.
    """
    out: Complex = np.zeros((at_s.size, omega.size), dtype=np.complex128)
    try:
        events = solve(collision, np.array([0.0, max(float(at_s[-1]), 1e-9)])).events
    except (TooManyEvents, RunsAway) as why:
        raise Infeasible(str(why)) from why
    before = np.flatnonzero(at_s <= 0)
    out[before] = 1.0 + 1j * at_s[before, None] * omega - np.exp(1j * at_s[before, None] * omega)
    state = np.zeros((4, omega.size), dtype=np.complex128)
    for event, following in zip(events, [*events[1:], None], strict=True):
        state = _jump(collision, event) @ state
        rates = _rates(collision, event.kind == "touch")
        forced = _forced(rates, omega) * np.exp(1j * omega * event.time_s)
        ends_s = following.time_s if following is not None else np.inf
        here = np.flatnonzero((at_s > event.time_s) & (at_s <= ends_s))
        later = at_s[here] - event.time_s
        moved = _propagators(rates, later)[:, 0] @ (state - forced)
        out[here] = moved + forced[0] * np.exp(1j * later[:, None] * omega)
        if following is not None:
            lasted = following.time_s - event.time_s
            state = _propagators(rates, np.array([lasted]))[0] @ (state - forced) + forced * np.exp(1j * lasted * omega)
    return out, np.asarray(state[1] + 1j * omega * np.exp(1j * omega * events[-1].time_s))


def _taken(grid: Grid, sines: Floats) -> tuple[Floats, Floats]:
    """Return X (m, r) and w (r,): 1 - C X w X^T C^T is the inverse root of 1 + C S S^T C^T, C the columns, S the sines.

    What stays below a millionth of the noise's power is left where it is.
    """
    level, turn = np.linalg.eigh(sines.T @ grid.products @ sines)
    kept = level > _NOTHING
    root = np.sqrt(1.0 + level[kept])
    return np.asarray(sines @ turn[:, kept]), np.asarray(1.0 / (root * (1.0 + root)))


def _spline(knots_s: Floats, values: Floats) -> BSpline:
    return make_interp_spline(knots_s, values, k=3)


def _splines_at(knots_s: Floats, time_s: Floats) -> csr_matrix:
    """Return each of the knots' splines at times, shape (n, m); beyond the knots what they are at the nearest."""
    inside = np.clip(time_s, knots_s[0], knots_s[-1])
    return BSpline.design_matrix(inside, _spline(knots_s, np.zeros(knots_s.size)).t, 3).tocsr()


def _local(columns: Floats) -> csr_matrix:
    """Return columns, shape (n, m), each of which is about nothing but for some of its rows."""
    there = np.abs(columns) > _LEAST * np.abs(columns).max()
    first, last = there.argmax(axis=0), columns.shape[0] - there[::-1].argmax(axis=0)
    width = int(np.max(last - first))
    rows = np.minimum(first, columns.shape[0] - width)[:, None] + np.arange(width)
    ends = width * np.arange(columns.shape[1] + 1)
    values = np.take_along_axis(columns, rows.T, axis=0).T
    return csc_matrix((values.ravel(), rows.ravel(), ends), shape=columns.shape).tocsr()


def _rates(c: Collision, touching: bool) -> Floats:
    """Return the matrix of s' = A s, s = (x_b, v_b, x_p, v_p), shape (4, 4)."""
    k, g = (c.contact_stiffness_n_per_m, c.contact_damping_n_s_per_m) if touching else (0.0, 0.0)
    m_b, m_p = c.block_mass_kg, c.plate_mass_kg
    force = np.array([-k, -g, k, g])
    on_plate = -force - np.array([0.0, 0.0, c.plate_stiffness_n_per_m, 0.0])
    return np.array([[0, 1, 0, 0], force / m_b, [0, 0, 0, 1], on_plate / m_p])


def _jump(c: Collision, event: Event) -> Floats:
    """Return how a small motion jumps where the dashpot begins to act (or ends) at a speed: shape (4, 4)."""
    kick = c.contact_damping_n_s_per_m * (1.0 if event.kind == "touch" else -1.0)
    jump = np.eye(4)
    jump[1, [0, 2]] = -kick / c.block_mass_kg, kick / c.block_mass_kg
    jump[3, [0, 2]] = kick / c.plate_mass_kg, -kick / c.plate_mass_kg
    return jump


def _forced(rates: Floats, omega: Floats) -> Complex:
    """Return the steady answer to the frame's acceleration, shape (4, f), at time zero."""
    pull = np.array([0.0, 1.0, 0.0, 1.0])
    matrices = 1j * omega[:, None, None] * np.eye(4) - rates
    answer = np.linalg.solve(matrices, np.broadcast_to(pull[:, None], (omega.size, 4, 1)))
    return np.asarray(answer[..., 0].T * omega**2)


def _propagators(rates: Floats, after_s: Floats) -> Floats:
    """Return exp(A t) at several times, shape (k, 4, 4)."""
    if rates[1].any():
        level, turn = np.linalg.eig(rates)
        both = (turn * np.exp(after_s[:, None, None] * level)) @ np.linalg.inv(turn)
        return np.asarray(both.real)
    own = float(np.sqrt(-rates[3, 2]))  # apart, the block's motion has no eigenvectors to speak of
    out = np.zeros((after_s.size, 4, 4))
    out[:, 0, 0] = out[:, 1, 1] = 1.0
    out[:, 0, 1] = after_s
    out[:, 2, 2] = out[:, 3, 3] = np.cos(own * after_s)
    out[:, 2, 3], out[:, 3, 2] = np.sin(own * after_s) / own, -own * np.sin(own * after_s)
    return out
