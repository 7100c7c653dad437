"""The contribution of a moving frame to the displacement of a shot.

Optics and plate stand on the frame; the block floats free of it.  In flight the displacement contains the whole motion
of the frame with opposite sign; in contact the plate's clamp carries plate and block along.  In the frame's
coordinates every mass feels minus the frame's acceleration.  The two-body equations, linear in every phase, give the
response to that force in closed form; where the contact begins or ends, derivatives jump (saltation; Leine & Nijmeijer,
"Dynamics and Bifurcations of Non-Smooth Mechanical Systems", ch. 7).  Position and velocity of the frame at the touch
are left out: they only shift the shot and change its speed.
"""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Collision, Event, Floats, Infeasible, TooManyEvents, UnboundedMotion, solve
from analysis.shot import Shaking

PLATE_QUALITY = 300.0  # at most, of a metal plate oscillating in air
STILL = (1e-15, 1e-12)  # m, m/s: std of a plate that nothing moves
_REGULAR = 8  # times in a block, for which blocks save time

Complex = NDArray[np.complex128]


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
    # not zero, so that a plate's start can be weighed against that of a plate at rest
    return max(std, STILL[0]), max(own * std, STILL[1])


def responses(collision: Collision, at_s: Floats, omega: Floats) -> tuple[Complex, Complex]:
    """Return the displacement added by a frame that moves as exp(i omega t) with unit amplitude, shape (n, f).

    ``at_s``, shape (n,), counts from the first touch.  The second value, shape (f,), is the velocity of frame plus
    response after the last release, where it stays constant.  Infeasible where there is no such collision.
    """
    out: Complex = np.zeros((at_s.size, omega.size), dtype=np.complex128)
    try:
        events = solve(collision, (), np.array([0.0, max(float(at_s[-1]), 1e-9)])).events
    except (TooManyEvents, UnboundedMotion) as why:
        raise Infeasible(str(why)) from why
    before = np.flatnonzero(at_s <= 0)
    out[before] = 1.0 + 1j * at_s[before, None] * omega - _turned(at_s[before], omega)
    state = np.zeros((4, omega.size), dtype=np.complex128)
    for event, following in zip(events, [*events[1:], None], strict=True):
        state = _jump(collision, event) @ state
        rates = _rates(collision, event.kind == "touch")
        forced = _forced(rates, omega) * np.exp(1j * omega * event.time_s)
        ends_s = following.time_s if following is not None else np.inf
        here = np.flatnonzero((at_s > event.time_s) & (at_s <= ends_s))
        later = at_s[here] - event.time_s
        moved = _propagators(rates, later)[:, 0] @ (state - forced)
        out[here] = moved + forced[0] * _turned(later, omega)
        if following is not None:
            lasted = following.time_s - event.time_s
            state = _propagators(rates, np.array([lasted]))[0] @ (state - forced) + forced * np.exp(1j * lasted * omega)
    return out, np.asarray(state[1] + 1j * omega * np.exp(1j * omega * events[-1].time_s))


def _turned(at_s: Floats, omega: Floats) -> Complex:
    """Return exp(i omega t), shape (n, f); for evenly spaced times by products of a few of them."""
    count = at_s.size
    block = math.isqrt(count)
    if block < _REGULAR or np.ptp(np.diff(at_s)) > 1e-9 * (at_s[-1] - at_s[0]):
        return np.asarray(np.exp(1j * at_s[:, None] * omega))
    step_s = (at_s[-1] - at_s[0]) / (count - 1)
    within = np.exp(1j * step_s * np.arange(block)[:, None] * omega)
    first = np.exp(1j * (at_s[0] + step_s * block * np.arange(-(-count // block))[:, None]) * omega)
    return np.asarray((first[:, None] * within).reshape(len(first) * block, omega.size)[:count])


def _rates(c: Collision, touching: bool) -> Floats:
    """Return the matrix of s' = A s, s = (x_b, v_b, x_p, v_p), shape (4, 4)."""
    k, g = (c.contact_stiffness_n_per_m, c.contact_damping_n_s_per_m) if touching else (0.0, 0.0)
    m_b, m_p = c.block_mass_kg, c.plate_mass_kg
    force = np.array([-k, -g, k, g])
    on_plate = -force - np.array([0.0, 0.0, c.plate_stiffness_n_per_m, 0.0])
    return np.array([[0, 1, 0, 0], force / m_b, [0, 0, 0, 1], on_plate / m_p])


def _jump(c: Collision, event: Event) -> Floats:
    """Return the jump of a small deviation where the contact force starts or ends at a speed: shape (4, 4)."""
    kick = c.contact_damping_n_s_per_m * (1.0 if event.kind == "touch" else -1.0)
    jump = np.eye(4)
    jump[1, [0, 2]] = -kick / c.block_mass_kg, kick / c.block_mass_kg
    jump[3, [0, 2]] = kick / c.plate_mass_kg, -kick / c.plate_mass_kg
    return jump


def _forced(rates: Floats, omega: Floats) -> Complex:
    """Return the steady response to the frame's acceleration, shape (4, f), at time zero."""
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
    own = float(np.sqrt(-rates[3, 2]))  # out of contact the block's matrix is defective: no eigenvectors
    out = np.zeros((after_s.size, 4, 4))
    out[:, 0, 0] = out[:, 1, 1] = 1.0
    out[:, 0, 1] = after_s
    out[:, 2, 2] = out[:, 3, 3] = np.cos(own * after_s)
    out[:, 2, 3], out[:, 3, 2] = np.sin(own * after_s) / own, -own * np.sin(own * after_s)
    return out
