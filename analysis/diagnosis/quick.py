"""A quick integrator for searches: base model and any effects at once, right to some picometres, 0.2 to 1 ms a shot.

The classical Runge-Kutta method from sample to sample; a switch (touch, release, turn, reach of an attraction) is met
by bisection, so that the answer is smooth in the parameters.  Positions count from the plate's rest; what hides inside
the block, the plate or its clamp is held relative to its carrier.  The catalogue's own functions and the exact solver
(analysis.model) are the reference this is tested against.
"""

import math

import numpy as np
from numba import njit

STANDARD_GRAVITY_M_PER_S2 = 9.80665
REFERENCE_OVERLAP_M = 50e-6
STATES = 11
X, V, Y, U, INSIDE, INSIDE_V, ARM, MODE, MODE_V, CLAMP, CLAMP_V = range(STATES)
(
    BLOCK_MASS,
    PLATE_STIFFNESS,
    PLATE_MASS,
    CONTACT_STIFFNESS,
    CONTACT_DAMPING,
    COULOMB,
    VISCOUS,
    QUADRATIC,
    ANGLE,
    GRADIENT,
    INSIDE_MASS,
    INSIDE_OMEGA,
    INSIDE_ZETA,
    CUBIC,
    PLATE_DAMPING,
    ARM_STIFFNESS,
    ARM_TIME,
    MODE_INVERSE_MASS,
    MODE_OMEGA,
    MODE_ZETA,
    COMPLIANCE,
    CLAMP_OMEGA,
    DELTA,
    OVERLAP_DAMPING,
    ATTRACTION,
    REACH,
    START_Y,
    START_U,
) = range(28)
PARAMETERS = 28
_MOST_SWITCHES = 400
_BISECTIONS = 46


@njit(cache=True, nogil=True, error_model="numpy")
def _rates(s, p, touching, right, near, out):  # type: ignore[no-untyped-def]
    """Write d/dt of the state; about 30 ns."""
    v = s[V]
    force = 0.0
    if touching:
        overlap = s[Y] + s[MODE] - s[X]
        rate = s[U] + s[MODE_V] - v
        spring = p[CONTACT_STIFFNESS] * overlap
        if p[DELTA] != 0.0:
            spring = spring * (overlap / REFERENCE_OVERLAP_M) ** p[DELTA] if overlap > 0.0 else 0.0
        if math.isinf(p[PLATE_MASS]):
            spring += p[CUBIC] * overlap * overlap * overlap
        force = spring + (p[CONTACT_DAMPING] + p[OVERLAP_DAMPING] * max(overlap, 0.0)) * rate
    if near:
        force -= p[ATTRACTION]
    drag = p[VISCOUS] * v + p[QUADRATIC] * v * abs(v) + p[GRADIENT] * s[X]
    drag += p[COULOMB] if right else -p[COULOMB]
    slope = STANDARD_GRAVITY_M_PER_S2 * math.sin(p[ANGLE])
    mass = p[BLOCK_MASS] - p[INSIDE_MASS]
    pull = 0.0
    if p[INSIDE_MASS] != 0.0:
        omega = p[INSIDE_OMEGA]
        pull = omega * omega * s[INSIDE] + 2.0 * p[INSIDE_ZETA] * omega * s[INSIDE_V]
    acceleration = slope + (force - drag + p[INSIDE_MASS] * pull) / mass
    out[X], out[V] = v, acceleration
    out[INSIDE], out[INSIDE_V] = 0.0, 0.0
    if p[INSIDE_MASS] != 0.0:
        out[INSIDE], out[INSIDE_V] = s[INSIDE_V], slope - pull - acceleration
    bend, bend_rate = s[Y] - s[CLAMP], s[U] - s[CLAMP_V]
    hold = p[PLATE_STIFFNESS] * bend + p[CUBIC] * bend * bend * bend + p[PLATE_DAMPING] * bend_rate + s[ARM]
    out[Y], out[U] = s[U], -(hold + force) / p[PLATE_MASS]
    out[ARM] = p[ARM_STIFFNESS] * bend_rate - s[ARM] / p[ARM_TIME] if p[ARM_STIFFNESS] != 0.0 else 0.0
    out[MODE], out[MODE_V] = 0.0, 0.0
    if p[MODE_INVERSE_MASS] != 0.0:
        omega = p[MODE_OMEGA]
        out[MODE] = s[MODE_V]
        out[MODE_V] = -force * p[MODE_INVERSE_MASS] - 2.0 * p[MODE_ZETA] * omega * s[MODE_V] - omega * omega * s[MODE]
    out[CLAMP], out[CLAMP_V] = 0.0, 0.0
    if p[COMPLIANCE] != 0.0:
        omega = p[CLAMP_OMEGA]
        out[CLAMP], out[CLAMP_V] = s[CLAMP_V], omega * omega * (hold * p[COMPLIANCE] - s[CLAMP])


@njit(cache=True, nogil=True, error_model="numpy")
def _step(s, h, p, touching, right, near, k, work, out):  # type: ignore[no-untyped-def]
    """Write the state one step of ``h`` ahead; four evaluations of the rates."""
    _rates(s, p, touching, right, near, k[0])
    for i in range(STATES):
        work[i] = s[i] + 0.5 * h * k[0, i]
    _rates(work, p, touching, right, near, k[1])
    for i in range(STATES):
        work[i] = s[i] + 0.5 * h * k[1, i]
    _rates(work, p, touching, right, near, k[2])
    for i in range(STATES):
        work[i] = s[i] + h * k[2, i]
    _rates(work, p, touching, right, near, k[3])
    for i in range(STATES):
        out[i] = s[i] + h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])


@njit(cache=True, nogil=True, error_model="numpy")
def _watched(s, p, which):  # type: ignore[no-untyped-def]
    """Return what is positive while a switch is on: overlap, velocity, how far inside an attraction's reach."""
    overlap = s[Y] + s[MODE] - s[X]
    if which == 0:
        return overlap
    return s[V] if which == 1 else overlap + p[REACH]


@njit(cache=True, nogil=True, error_model="numpy")
def _first_switch(s, new, h, p, on, k, work, used):  # type: ignore[no-untyped-def]
    """Return (time, which) of the first switch within a step that ended in ``new``, or (h, -1)."""
    best, found = h, -1
    for which in range(3):
        if not used[which] or (_watched(new, p, which) > 0.0) == on[which]:
            continue
        low, high = 0.0, h
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            _step(s, middle, p, on[0], on[1], on[2], k, work, new)
            if (_watched(new, p, which) > 0.0) == on[which]:
                low = middle
            else:
                high = middle
        if found < 0 or high < best:
            best, found = high, which
        _step(s, h, p, on[0], on[1], on[2], k, work, new)
    return best, found


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(time_s, p, velocity, pieces, apart, x, v, plate, changes):  # type: ignore[no-untyped-def]
    """Write position and velocity of the block and position of the contact point at ``time_s`` (ascending).

    Time zero is the first touch (or the entry into an attraction's reach), where the block has ``velocity``; before
    it only what acts on the block takes part.  ``pieces`` steps a sample in contact, ``apart`` out of it.
    Writes the times of touch and release to ``changes`` and returns their number, -1 when there are too many switches.
    """
    k, work, new, s = np.empty((4, STATES)), np.empty(STATES), np.empty(STATES), np.zeros(STATES)
    attracts = p[ATTRACTION] != 0.0
    start = p[REACH] if attracts else p[START_Y]
    first = 0
    while first < time_s.size and time_s[first] < 0.0:
        first += 1
    s[X], s[V] = start, velocity
    inside = p[INSIDE_MASS]
    p[INSIDE_MASS] = 0.0  # what rides inside has come to rest
    t = 0.0
    for i in range(first - 1, -1, -1):
        _step(s, time_s[i] - t, p, False, False, False, k, work, new)
        s[X], s[V] = new[X], new[V]
        t = time_s[i]
        x[i], v[i], plate[i] = s[X], s[V], 0.0
    p[INSIDE_MASS] = inside
    s[X], s[V], s[Y], s[U] = start, velocity, p[START_Y], p[START_U]
    on = np.array([not attracts, False, attracts])
    used = np.array([True, p[COULOMB] != 0.0, attracts])
    t = 0.0
    switches, changed = 0, 0
    for i in range(first, time_s.size):
        end = time_s[i]
        piece = (end - t) / (pieces if on[0] else apart)
        while t < end - 1e-15:
            h = min(piece, end - t)
            _step(s, h, p, on[0], on[1], on[2], k, work, new)
            at, which = _first_switch(s, new, h, p, on, k, work, used)
            if which >= 0:
                _step(s, at, p, on[0], on[1], on[2], k, work, new)
                on[which] = not on[which]
                switches += 1
                if which == 0 and changed < changes.size:
                    changes[changed] = t + at
                    changed += 1
                if switches > _MOST_SWITCHES:
                    return -1
            for j in range(STATES):
                s[j] = new[j]
            t += at
        t = end
        x[i], v[i], plate[i] = s[X], s[V], s[Y] + s[MODE]
    return changed


@njit(cache=True, nogil=True, error_model="numpy")
def lagged(x, v, spacing, tau):  # type: ignore[no-untyped-def]
    """Return what a first-order lag tau x_m' = x - x_m makes of a path, quadratic between samples; 5 ns a sample."""
    out = np.empty(x.size)
    fade = math.exp(-spacing / tau)
    behind = x[0] - tau * v[0]
    out[0] = behind
    for i in range(x.size - 1):
        a = (v[i + 1] - v[i]) / spacing
        begin = x[i] - tau * v[i] + tau * tau * a
        end = x[i + 1] - tau * v[i + 1] + tau * tau * a
        behind = end + (behind - begin) * fade
        out[i + 1] = behind
    return out
