"""A fitted trajectory cut into steps, each with its propagator: what a small force or shift on the way leads to.

About a trajectory that is solved, a small change d of the state obeys d' = A(t) d + E(t) u, u being what an effect
adds: forces on block and plate, a force between them, inertia, a moved contact point and its rate.  A and E are
differences of the model's own equations (``rates.state_rates``): E of two probes laid out beside the effects that the
fit has, so that no equation is written a second time.  Where a switch is met, d jumps by (f_before - f_after) dt,
dt = -dg / g', g being what is watched (saltation; Leine and Nijmeijer, "Dynamics and Bifurcations of Non-Smooth
Mechanical Systems", ch. 7).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.diagnosis.quick import (
    MOST_SWITCHES,
    OVERLAP,
    VELOCITY,
    entry,
    first_switch,
    meet,
    set_flags,
    step,
)
from analysis.model.effects import kernel
from analysis.model.effects.row import Acts, Effect, Parameter
from analysis.model.least_squares import Infeasible
from analysis.model.parameters import Collision
from analysis.model.rates import MOVES, NEAR_0, SLOT_PARAMETERS, state_rates, tight
from analysis.model.slots import Active, lay_out, swings

Floats = NDArray[np.float64]
Places = NDArray[np.int64]
# What a small effect can do: forces in N on block, on plate and between them, kg on the block, m and m/s of the contact
# point.
INPUTS = 6
_INERTIA = 3
_FORCE_N, _SHARE, _LENGTH, _SPEED = 1e-3, 1e-6, 1e-9, 1e-6  # steps of the differences
_STILL, _HELD = 1e-5, 16  # share by which A may change over a step and still be held for so many more
_ROUNDING = 1e-9  # of a row's largest number: what differences cannot show
_SWING = 0.25  # radians a step may take
MOST_PIECES = 24
_NONE, _FRESH = -1, -2  # where a step begins: as the one before ended, or anew; otherwise the switch that was met


def _push(s: Any, p: Any, out: Any) -> None:
    """Push block and plate and add inertia; p = (force in N, force in N, mass in kg); its hidden state moves none."""
    out[kernel.ON_BLOCK] += p[0]
    out[kernel.ON_PLATE] += p[1]
    out[kernel.MASS] += p[2]


def _press(s: Any, p: Any, out: Any) -> None:
    """Push the two bodies apart; p = (force in N)."""
    out[kernel.PAIR] += p[0]


_THREE = tuple(Parameter(name, "", 0.0) for name in ("block", "plate", "mass"))
_PUSH = Effect("push", "", Acts.ON_BLOCK, _THREE, "block", _push, hidden=2, shift=1.0)
_PRESS = Effect("press", "", Acts.IN_CONTACT, _THREE[:1], "block", _press)


@dataclass(frozen=True, slots=True)
class BasePath:
    """Steps of one shot, the m_0 before time zero going backwards, then forwards; n numbers in a state, x first.

    ``length_s`` and ``sample`` (index of the sample at the end, or -1), shape (m,); ``early``: before time zero;
    ``linked``: begins as the step before it ended; ``propagator``, shape (m, n, n); ``weights`` of the inputs at
    begin, middle and end, shape (m, 3, n, 6); ``told``, shape (m, 3, 15), what an effect's function is given there;
    ``kick``, shape (m, n), and ``watch``, shape (m, n + 1): at the beginning the state jumps by kick times (watch of
    state and moved contact point).
    """

    length_s: Floats
    sample: Places
    early: NDArray[np.bool_]
    linked: NDArray[np.bool_]
    propagator: Floats
    weights: Floats
    told: Floats
    kick: Floats
    watch: Floats

    @property
    def size(self) -> int:
        """Get the number of steps."""
        return int(self.length_s.size)


def base_path(collision: Collision, active: list[Active], time_s: Floats, steps: int = 1) -> BasePath:
    """Follow a collision with ``active`` effects (those with hidden states first) over ``time_s`` from time zero.

    At least ``steps`` of them a sample.  About 1 to 2 us a step.  Raises Infeasible where
    the steps would be too many or the motion has no end.
    """
    hidden = sum(one.effect.hidden > 0 for one in active)
    nothing = (0.0, 0.0, 0.0)
    laid = lay_out(collision, [*active[:hidden], Active(_PUSH, nothing), *active[hidden:], Active(_PRESS, nothing[:1])])
    rates = swings(collision, active)
    spacing = float(time_s[1] - time_s[0])
    pieces = max(steps, math.ceil(max(rates.contact, rates.every) * spacing / _SWING))
    apart = max(steps, math.ceil(max(rates.plate, rates.every) * spacing / _SWING))
    if max(pieces, apart) > MOST_PIECES:
        raise Infeasible("something would swing faster than any record can show")
    n = 4 + 2 * hidden
    most = time_s.size * max(pieces, apart) + 2 * (MOST_SWITCHES + 2)
    states, phases = np.empty((most, 3, 1, 4 + laid.hidden)), np.empty((most, NEAR_0 + laid.slots.shape[0]))
    length, sample = np.empty(most), np.empty(most, dtype=np.int64)
    early, switch = np.empty(most, dtype=np.bool_), np.empty(most, dtype=np.int64)
    count = _follow(
        time_s, laid.p, laid.slots, laid.functions, pieces, apart, states, phases, length, sample, early, switch
    )
    if count < 0 or not np.all(np.isfinite(states[:count])):
        raise Infeasible("no trajectory")
    length, switch = length[:count].copy(), switch[:count].copy()
    propagator, weights = np.empty((count, n, n)), np.empty((count, 3, n, INPUTS))
    told, kick, watch = np.empty((count, 3, kernel.STATES)), np.zeros((count, n)), np.zeros((count, n + 1))
    _propagators(
        laid.p, laid.slots, laid.functions, hidden, states[:count], phases[:count], length, switch,
        propagator, weights, told, kick, watch,
    )  # fmt: skip
    linked = switch == _NONE
    return BasePath(length, sample[:count].copy(), early[:count].copy(), linked, propagator, weights, told, kick, watch)


@tight
def _rates(z, out, p, slots, flags, functions, s, values, effect, told):  # type: ignore[no-untyped-def]
    """Call ``state_rates`` instead of inlining it once more."""
    return state_rates(z, out, p, slots, flags, functions, s, values, effect, told)


@tight
def _tell(z, p, slots, flags, functions, s, values, effect, told, up, e, seen):  # type: ignore[no-untyped-def]
    """Write what an effect is given at a state, and what more inertia does there: -v'/m to v'."""
    mass = _rates(z, up, p, slots, flags, functions, s, values, effect, told)
    for i in range(kernel.STATES):
        seen[i] = s[i]
    seen[kernel.Q] = seen[kernel.W] = seen[kernel.NEAR] = 0.0
    for i in range(e.shape[0]):
        e[i, _INERTIA] = 0.0
    e[1, _INERTIA] = -up[0, 1] / mass


@tight
def _probe(at, column, by, z, p, slots, flags, functions, s, values, effect, told, up, down, e):  # type: ignore[no-untyped-def]
    """Write d(rates)/d(p[at]) to a column of E, p[at] being zero."""
    p[at] = by
    _rates(z, up, p, slots, flags, functions, s, values, effect, told)
    p[at] = -by
    _rates(z, down, p, slots, flags, functions, s, values, effect, told)
    p[at] = 0.0
    for i in range(e.shape[0]):
        e[i, column] = (up[0, i] - down[0, i]) / (2.0 * by)


@tight
def _linearise(z, push, p, slots, flags, functions, s, values, effect, told, up, down, a, e):  # type: ignore[no-untyped-def]
    """Write A (n, n) and E (n, 6) but for the inertia at a state; about 20 evaluations of the rates."""
    n = a.shape[0]
    for j in range(n + 2):
        keep = z[0, j]
        by = _SPEED if j in (1, 3) else max(_LENGTH, _SHARE * abs(keep))
        z[0, j] = keep + by
        _rates(z, up, p, slots, flags, functions, s, values, effect, told)
        z[0, j] = keep - by
        _rates(z, down, p, slots, flags, functions, s, values, effect, told)
        z[0, j] = keep
        for i in range(n):
            slope = (up[0, i] - down[0, i]) / (2.0 * by)
            if j < n:
                a[i, j] = slope
            else:
                e[i, 4 + j - n] = slope
    first = SLOT_PARAMETERS + 3 * push
    for j in range(3):
        at = SLOT_PARAMETERS + 3 * (slots.shape[0] - 1) if j == 2 else first + j
        _probe(at, j, _FORCE_N, z, p, slots, flags, functions, s, values, effect, told, up, down, e)


@tight
def _alike(one, two):  # type: ignore[no-untyped-def]
    """Return whether two matrices are the same but for what a step may change."""
    for i in range(one.shape[0]):
        size = 0.0
        for j in range(one.shape[1]):
            size = max(size, abs(one[i, j]))
        for j in range(one.shape[1]):
            inertia = one.shape[1] == INPUTS and j == _INERTIA  # known at every point
            if not inertia and abs(one[i, j] - two[i, j]) > _STILL * abs(one[i, j]) + _ROUNDING * size:
                return False
    return True


@tight
def _propagate(a0, a1, a2, h, out, work, term):  # type: ignore[no-untyped-def]
    """Write the propagator over ``h`` by the classical Runge-Kutta method, A given at begin, middle and end."""
    n = a0.shape[0]
    for i in range(n):
        for j in range(n):
            term[i, j] = a0[i, j]
            out[i, j] = (1.0 if i == j else 0.0) + h / 6.0 * term[i, j]
    for stage in range(3):
        a = a2 if stage == 2 else a1
        by = h if stage == 2 else 0.5 * h
        for i in range(n):
            for j in range(n):
                total = a[i, j]
                for m in range(n):
                    total += by * a[i, m] * term[m, j]
                work[i, j] = total
        for i in range(n):
            for j in range(n):
                term[i, j] = work[i, j]
                out[i, j] += (h / 6.0 if stage == 2 else h / 3.0) * term[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _follow(  # type: ignore[no-untyped-def]
    time_s, p, slots, functions, pieces, apart, states, phases, length, sample, early, switch
):
    """Write the steps' states, shape (m, 3, 1, size), flags and so on; return their number, -1: too many switches."""
    size, count = states.shape[3], slots.shape[0]
    k, work, new, z = np.zeros((4, 1, size)), np.zeros((1, size)), np.zeros((1, size)), np.zeros((1, size))
    middle = np.zeros((1, size))
    s, values, effect, told = np.zeros(kernel.STATES), np.zeros(3), np.zeros(kernel.OUTPUTS), np.zeros((1, 3))
    flags = np.zeros(NEAR_0 + count)
    on, used = np.zeros(2 + count, dtype=np.bool_), np.zeros(2 + count, dtype=np.bool_)
    start, attracts, first = entry(time_s, z, p, slots, flags, on, used)
    t, i, switches, r, remaining, h = 0.0, first - 1, 0, 0, 0, 0.0
    forward, met = False, _FRESH
    while True:
        if not forward and i < 0:
            meet(z, start, attracts, p, slots, flags, on, used)
            forward, met, t, i = True, _FRESH, 0.0, first
        if forward and i >= time_s.size:
            return r
        if r >= length.size:
            return -1
        end = time_s[i]
        if forward and end - t < 1e-13:  # a sample at time zero, or at a switch
            if r > 0 and sample[r - 1] < 0:
                sample[r - 1] = i
            i += 1
            remaining = 0
            continue
        if not forward:
            remaining, h = 1, end - t
        elif remaining == 0:
            whole = (time_s[1] - time_s[0]) / (pieces if on[OVERLAP] else apart)
            remaining = max(1, math.ceil((end - t) / whole - 1e-6))
            h = (end - t) / remaining
        step(z, h, p, slots, flags, functions, k, work, new, s, values, effect, told)
        at, which = h, -1
        if forward:
            at, which = first_switch(z, new, h, p, slots, flags, functions, on, used, k, work, s, values, effect, told)
            if which >= 0:
                step(z, at, p, slots, flags, functions, k, work, new, s, values, effect, told)
        step(z, 0.5 * at, p, slots, flags, functions, k, work, middle, s, values, effect, told)
        part = size if forward else 2  # before time zero only the block moves
        for j in range(size):
            states[r, 0, 0, j] = z[0, j]
            states[r, 1, 0, j] = middle[0, j] if j < part else z[0, j]
            states[r, 2, 0, j] = new[0, j] if j < part else z[0, j]
        for j in range(flags.size):
            phases[r, j] = flags[j]
        length[r], early[r], switch[r], sample[r] = at, not forward, met, -1
        for j in range(size):
            z[0, j] = states[r, 2, 0, j]
        t += at
        remaining -= 1
        met = _NONE
        if which >= 0:
            switches += 1
            if switches > MOST_SWITCHES:
                return -1
            on[which] = not on[which]
            set_flags(on, slots, flags)
            met, remaining = which, 0
        elif remaining == 0:
            t = end
            sample[r] = i
            i += 1 if forward else -1
        r += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _propagators(  # type: ignore[no-untyped-def]
    p, slots, functions, push, states, phases, length, switch, propagator, weights, given, kick, watch
):
    """Write what a ``BasePath`` holds of every step; 0.5 to 3 us each, by how often A and E have to be computed.

    Where they stood still over a step (most effects are linear within a phase) they are looked at again _HELD later.
    """
    size, n = states.shape[3], propagator.shape[1]
    up, down = np.zeros((1, size)), np.zeros((1, size))
    s, values, effect, told = np.zeros(kernel.STATES), np.zeros(3), np.zeros(kernel.OUTPUTS), np.zeros((1, 3))
    a, e = np.zeros((4, n, n)), np.zeros((3, n, INPUTS))  # at begin, middle, end; A at three quarters
    half, square, term = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    hold, resting = 0, False
    for r in range(length.size):
        linked, at, flags = switch[r] == _NONE, length[r], phases[r]
        if switch[r] >= 0:
            z = states[r, 0]
            _rates(z, up, p, slots, phases[r - 1], functions, s, values, effect, told)
            pace = up[0, 1] if switch[r] == VELOCITY else told[0, 1]
            _rates(z, down, p, slots, flags, functions, s, values, effect, told)
            for j in range(n):
                kick[r, j] = -(up[0, j] - down[0, j]) / pace
            if switch[r] == VELOCITY:
                watch[r, 1] = 1.0
            else:
                watch[r, 0], watch[r, 2], watch[r, n] = -1.0, 1.0, 1.0
                for slot in range(push):
                    watch[r, 4 + 2 * slot] = slots[slot, MOVES]
        if linked:
            for j in range(n):
                for m in range(n):
                    a[0, j, m] = a[2, j, m]
                for m in range(INPUTS):
                    e[0, j, m] = e[2, j, m]
            for j in range(kernel.STATES):
                given[r, 0, j] = given[r - 1, 2, j]
        else:
            z = states[r, 0]
            _linearise(z, push, p, slots, flags, functions, s, values, effect, told, up, down, a[0], e[0])
            _tell(z, p, slots, flags, functions, s, values, effect, told, up, e[0], given[r, 0])
            hold, resting = 0, False
        rested, resting = resting, hold > 0
        if resting:
            hold -= 1
            for j in range(n):
                for m in range(n):
                    a[2, j, m] = a[0, j, m]
                for m in range(INPUTS):
                    e[2, j, m] = e[0, j, m]
        else:
            _linearise(
                states[r, 2], push, p, slots, flags, functions, s, values, effect, told, up, down, a[2], e[2]
            )  # fmt: skip
            if _alike(a[0], a[2]) and _alike(e[0], e[2]):
                hold = _HELD
        for j in range(n):
            for m in range(n):
                a[1, j, m] = 0.5 * (a[0, j, m] + a[2, j, m])
                a[3, j, m] = 0.5 * (a[1, j, m] + a[2, j, m])
            for m in range(INPUTS):
                e[1, j, m] = 0.5 * (e[0, j, m] + e[2, j, m])
        _tell(states[r, 1], p, slots, flags, functions, s, values, effect, told, up, e[1], given[r, 1])
        _tell(states[r, 2], p, slots, flags, functions, s, values, effect, told, up, e[2], given[r, 2])
        if resting and rested and abs(at - length[r - 1]) < 1e-9 * abs(at):
            for j in range(n):
                for m in range(n):
                    propagator[r, j, m] = propagator[r - 1, j, m]
        else:
            _propagate(a[0], a[1], a[2], at, propagator[r], square, term)
            _propagate(a[1], a[3], a[2], 0.5 * at, half, square, term)
        for j in range(n):
            for m in range(INPUTS):
                begin, mid = 0.0, 0.0
                for q in range(n):
                    begin += propagator[r, j, q] * e[0, q, m]
                    mid += half[j, q] * e[1, q, m]
                weights[r, 0, j, m] = at / 6.0 * begin
                weights[r, 1, j, m] = at / 1.5 * mid
                weights[r, 2, j, m] = at / 6.0 * e[2, j, m]
