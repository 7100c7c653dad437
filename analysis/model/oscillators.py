"""First-order response of the displacement to a hidden oscillator, for many frequencies and dampings at once.

Along a solved base trajectory the base model is linear within a phase, so what a small hidden oscillator adds obeys
s' = A s + b f(t) with f from the oscillator's own motion.  Both are propagated exactly for drives that are straight
between two grid points; at a touch or release s jumps by (f_before - f_after) dt, dt = -d(overlap) / (overlap)'.
One march serves a whole grid of frequencies: about 30 ns a grid point and candidate.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit

from analysis.model.exact import Trajectory, solve
from analysis.model.parameters import Collision, Floats

_FINEST = 0.15  # radians of the fastest swing a grid step
BLOCK_MODE, SECOND_PLATE_MODE, SUPPORT_COMPLIANCE = 0, 1, 2
KINDS = {
    "block_mode": BLOCK_MODE,
    "second_plate_mode": SECOND_PLATE_MODE,
    "support_compliance": SUPPORT_COMPLIANCE,
}


@dataclass(frozen=True, slots=True)
class Path:
    """A base trajectory on a grid that holds every sample and every event twice (before and after); shape (m,).

    ``sample`` is the index of the sample at a grid point, or -1; ``phase`` 0 before the touch, 1 in contact, 2 apart.
    """

    collision: Collision
    time_s: Floats
    state: Floats
    phase: np.ndarray
    sample: np.ndarray


def path(collision: Collision, time_s: Floats, fastest_hz: float) -> Path:
    """Solve the base model on a grid fine enough for oscillators up to ``fastest_hz``; ``time_s`` from first touch."""
    coarse = solve(collision, np.array([max(float(time_s[-1]), 0.0)]))
    events = [e.time_s for e in coarse.events if e.kind in ("touch", "release")]
    finest = _FINEST / max(collision.fastest_rate_rad_per_s, 2 * math.pi * fastest_hz / 2.5)
    times: list[Floats] = []
    phases: list[np.ndarray] = []
    samples: list[np.ndarray] = []
    edges = [min(float(time_s[0]), 0.0), *events, float(time_s[-1])]
    for part, (begin, end) in enumerate(pairwise(edges)):
        if end < begin:
            continue
        first, last = np.searchsorted(time_s, [begin, end], side="left" if part == 0 else "right")
        if part > 0:
            first = np.searchsorted(time_s, begin, side="right")
        inside = time_s[first:last]
        knots = np.concatenate([[begin], inside, [end]])
        pieces = (
            np.maximum(1, np.ceil(np.diff(knots) / finest - 1e-9)).astype(np.int64)
            if part
            else np.ones(knots.size - 1, dtype=np.int64)
        )
        index = np.concatenate([[0], np.cumsum(pieces)])
        grid = np.interp(np.arange(index[-1] + 1), index, knots)
        mark = np.full(grid.size, -1, dtype=np.int64)
        mark[index[1:-1]] = np.arange(first, last)
        times.append(grid)
        samples.append(mark)
        phases.append(np.full(grid.size, 0 if part == 0 else 1 + (part + 1) % 2, dtype=np.int64))
    everything = np.concatenate(times)
    run: Trajectory = solve(collision, np.maximum.accumulate(everything))
    state = np.stack(
        [run.displacement_m, run.velocity_m_per_s, run.plate_displacement_m, run.plate_velocity_m_per_s], axis=1
    )
    return Path(collision, everything, state, np.concatenate(phases), np.concatenate(samples))


def responses(along: Path, name: str, frequency_hz: Floats, damping_ratio: Floats, samples: int) -> Floats:
    """Return d(displacement)/d(amplitude), shape (samples, k), of k oscillators; the amplitude is the catalogue's.

    For ``second_plate_mode`` it is 1 / mass.  Zero before the touch.  The damping of ``support_compliance`` is none.
    """
    c = along.collision
    out = np.zeros((samples, frequency_hz.size))
    p = np.array([c.plate_stiffness_n_per_m, c.plate_mass_kg, c.contact_stiffness_n_per_m, c.contact_damping_n_s_per_m])
    omega = 2 * np.pi * np.asarray(frequency_hz, dtype=np.float64)
    damping = np.asarray(damping_ratio, dtype=np.float64)
    march_oscillators(
        KINDS[name], along.time_s, along.state, along.phase, along.sample, p, c.block_mass_kg, omega, damping, out
    )
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _base_step(p, m_b, contact, h, e, w0, w1):  # type: ignore[no-untyped-def]
    """Write exp(A h) and the weights of forces on block and plate, straight over the step, at its two ends."""
    k_p, m_p = p[0], p[1]
    k, g = p[2] * contact, p[3] * contact
    a = np.zeros((4, 4))
    a[0, 1] = a[2, 3] = 1.0
    a[1, 0], a[1, 1], a[1, 2], a[1, 3] = -k / m_b, -g / m_b, k / m_b, g / m_b
    a[3, 0], a[3, 1], a[3, 2], a[3, 3] = k / m_p, g / m_p, -(k + k_p) / m_p, -g / m_p
    term, phi1, phi2 = np.eye(4), np.zeros((4, 4)), np.zeros((4, 4))
    e[:] = 0.0
    for n in range(1, 30):
        # term = (A h)^(n-1) / (n-1)!
        for i in range(4):
            for j in range(4):
                e[i, j] += term[i, j]
                phi1[i, j] += term[i, j] / n
                phi2[i, j] += term[i, j] / (n * (n + 1.0))
        new = np.zeros((4, 4))
        for i in range(4):
            for j in range(4):
                for m in range(4):
                    new[i, j] += a[i, m] * term[m, j]
                new[i, j] *= h / n
        term = new
    for i in range(4):
        w0[i, 0] = h * (phi1[i, 1] - phi2[i, 1]) / m_b
        w1[i, 0] = h * phi2[i, 1] / m_b
        w0[i, 1] = h * (phi1[i, 3] - phi2[i, 3]) / m_p
        w1[i, 1] = h * phi2[i, 3] / m_p


@njit(cache=True, nogil=True, error_model="numpy")
def _oscillator_step(omega, damping, h, e, w):  # type: ignore[no-untyped-def]
    """Write the exact step of q'' + 2 zeta omega q' + omega^2 q = d, d straight over the step, for every oscillator."""
    for c in range(omega.size):
        a10, a11 = -(omega[c] ** 2), -2.0 * damping[c] * omega[c]
        t00, t01, t10, t11 = 1.0, 0.0, 0.0, 1.0
        e[c] = 0.0
        w[c] = 0.0
        for n in range(1, 40):
            e[c, 0] += t00
            e[c, 1] += t01
            e[c, 2] += t10
            e[c, 3] += t11
            first, second = h / n, h / (n * (n + 1.0))
            w[c, 0] += t01 * (first - second)
            w[c, 1] += t01 * second
            w[c, 2] += t11 * (first - second)
            w[c, 3] += t11 * second
            s = h / n
            t00, t01, t10, t11 = s * t10, s * t11, s * (a10 * t00 + a11 * t10), s * (a10 * t01 + a11 * t11)


@njit(cache=True, nogil=True, error_model="numpy")
def march_oscillators(kind, time_s, state, phase, sample, p, m_b, omega, damping, out):  # type: ignore[no-untyped-def]
    """March base perturbation and oscillators together; see ``responses``."""
    count = omega.size
    k_p, m_p, k_n, g_n = p[0], p[1], p[2], p[3]
    q, r = np.zeros(count), np.zeros(count)
    s = np.zeros((4, count))
    e, w0, w1 = np.zeros((4, 4)), np.zeros((4, 2)), np.zeros((4, 2))
    oe, ow = np.zeros((count, 4)), np.zeros((count, 4))
    step, step_phase = -1.0, -1
    for i in range(1, time_s.size):
        if phase[i] == 0:
            continue
        contact = 1.0 if phase[i] == 1 else 0.0
        if phase[i] != phase[i - 1]:
            # A switch: the overlap's perturbation moves it in time; block and plate then feel the old force longer.
            x, v, y, u = state[i, 0], state[i, 1], state[i, 2], state[i, 3]
            rate = u - v
            jump = (1.0 if contact > 0.5 else -1.0) * (g_n * rate + k_n * (y - x))
            for c in range(count):
                overlap = s[2, c] - s[0, c]
                if kind == 1:
                    overlap += q[c]
                moved = -overlap / rate
                if phase[i - 1] != 0:
                    s[1, c] -= jump / m_b * moved
                    s[3, c] += jump / m_p * moved
            continue
        h = time_s[i] - time_s[i - 1]
        if h <= 0.0:
            if sample[i] >= 0:
                for c in range(count):
                    out[sample[i], c] = s[0, c]
            continue
        if abs(h - step) > 1e-9 * h:
            _base_step(p, m_b, contact, h, e, w0, w1)
            _oscillator_step(omega, damping, h, oe, ow)
            step, step_phase = h, phase[i]
        elif step_phase != phase[i]:
            _base_step(p, m_b, contact, h, e, w0, w1)
            step_phase = phase[i]
        force0 = contact * (k_n * (state[i - 1, 2] - state[i - 1, 0]) + g_n * (state[i - 1, 3] - state[i - 1, 1]))
        force1 = contact * (k_n * (state[i, 2] - state[i, 0]) + g_n * (state[i, 3] - state[i, 1]))
        y0, y1 = state[i - 1, 2], state[i, 2]
        for c in range(count):
            square, loss = omega[c] ** 2, 2.0 * damping[c] * omega[c]
            if kind == 0:
                d0, d1 = -force0 / m_b, -force1 / m_b
            elif kind == 1:
                d0, d1 = -force0, -force1
            else:
                d0, d1 = square * k_p * y0, square * k_p * y1
            q0, r0 = q[c], r[c]
            q1 = oe[c, 0] * q0 + oe[c, 1] * r0 + ow[c, 0] * d0 + ow[c, 1] * d1
            r1 = oe[c, 2] * q0 + oe[c, 3] * r0 + ow[c, 2] * d0 + ow[c, 3] * d1
            q[c], r[c] = q1, r1
            block0 = block1 = plate0 = plate1 = 0.0
            if kind == 0:
                block0 = square * q0 + loss * r0 - d0
                block1 = square * q1 + loss * r1 - d1
            elif kind == 1:
                block0 = contact * (k_n * q0 + g_n * r0)
                block1 = contact * (k_n * q1 + g_n * r1)
                plate0, plate1 = -block0, -block1
            else:
                plate0, plate1 = k_p * q0, k_p * q1
            s0, s1, s2, s3 = s[0, c], s[1, c], s[2, c], s[3, c]
            for n in range(4):
                s[n, c] = (
                    e[n, 0] * s0
                    + e[n, 1] * s1
                    + e[n, 2] * s2
                    + e[n, 3] * s3
                    + w0[n, 0] * block0
                    + w1[n, 0] * block1
                    + w0[n, 1] * plate0
                    + w1[n, 1] * plate1
                )
        if sample[i] >= 0:
            for c in range(count):
                out[sample[i], c] = s[0, c]
