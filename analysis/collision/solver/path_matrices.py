"""The propagators of a path's steps, and the weights of the inputs (kernels)."""

import math
from typing import NamedTuple

from analysis.collision.effects.kernel import NEAR, STATES, Q, W
from analysis.collision.parameters import Floats
from analysis.collision.solver.modes import guard_derivative
from analysis.collision.solver.rates import rates
from analysis.collision.solver.system import Integers
from analysis.compiled import by_address, inlined, kernel, part

# Inputs of a small effect: forces in N on block, on plate and between them, inertia in kg added to the block,
# displacement (m) and velocity (m/s) of the contact point.
INPUTS = 6
_INERTIA = 3
_CONSTANT_SHARE, _REUSED_STEPS = 1e-9, 16  # if A changes by less than this share over a step, the next 16 reuse it
_ROUNDING = 1e-12  # of the largest element of a row
NONE = -1  # a step does not start at a guard function's zero


class Steps(NamedTuple):
    """Steps: states at start, middle and end, shape (m, 3, n), and the guard functions at whose zero they start.

    The mode of a step is ``modes[event]``; the last row is the mode before the first event (-1).
    """

    states: Floats
    modes: Floats
    event: Integers
    item: Integers


@inlined
def _write_matrices_at(state, z, rows, system, mode, a, e):  # type: ignore[no-untyped-def]
    """Write A (n, n) and E (n, 6) at a state; without derivatives (one row), only the column of the inertia."""
    n = a.shape[0]
    for i in range(n):
        state.z[0, i] = z[i]
    mass = rates(state, rows, system.which, system, mode)
    for i in range(n if rows > 1 else 0):
        for j in range(n):
            a[i, j] = state.f[1 + j, i]
        for j in range(2):
            e[i, 4 + j] = state.f[1 + n + j, i]
        for j in range(3):
            e[i, j] = state.f[3 + n + j, i]
        e[i, _INERTIA] = 0.0
    e[1, _INERTIA] = -state.f[0, 1] / mass


@inlined
def _write_effect_inputs(system, given):  # type: ignore[no-untyped-def]
    """Write the arguments of an effect's function at the last evaluated state."""
    for i in range(STATES):
        given[i] = system.effect_input[i]
    given[Q] = given[W] = given[NEAR] = 0.0


@part
def _nearly_equal(one, two):  # type: ignore[no-untyped-def]
    """Return whether two matrices are equal within the change allowed for their reuse."""
    for i in range(one.shape[0]):
        size = 0.0
        for j in range(one.shape[1]):
            size = max(size, abs(one[i, j]))
        for j in range(one.shape[1]):
            inertia = one.shape[1] == INPUTS and j == _INERTIA  # evaluated at every point anyway
            if not inertia and abs(one[i, j] - two[i, j]) > _CONSTANT_SHARE * abs(one[i, j]) + _ROUNDING * size:
                return False
    return True


@part
def _propagate(a0, a1, a2, h, out, work, term):  # type: ignore[no-untyped-def]
    """Write the propagator over ``h`` by the classical Runge-Kutta method from A at start, middle and end."""
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


@part
def _jump(r, one, state, aside, system, steps, event_jump, event_gradient):  # type: ignore[no-untyped-def]
    """Write the jump of the state at the event at which a step starts."""
    item, n, size = steps.item[r], event_jump.size, state.z.shape[1]
    for i in range(n):
        state.z[0, i] = steps.states[r, 0, i]
    rates(state, n + 2, system.which, system, steps.modes[steps.event[r - 1]])
    for j in range(n + 1):
        event_gradient[j] = guard_derivative(item, 1 + j, -1, state, system)
    for c in range(size):
        aside.z[0, c], aside.z[1, c] = state.z[0, c], state.f[0, c]
    rates(aside, aside.z.shape[0], system.which, system, steps.modes[steps.event[r - 1]])
    pace = guard_derivative(item, one, -1, aside, system)
    rates(aside, one, system.which, system, steps.modes[steps.event[r]])
    for j in range(n):
        event_jump[j] = -(state.f[0, j] - aside.f[0, j]) / pace


@kernel
def write_matrices(system, steps, out, state, aside, a, e, square):  # type: ignore[no-untyped-def]
    """Write the matrices of every step to a ``LinearPath``.

    About 1 us per step, less if the matrices are constant.  If A and E are constant over a step, as for most effects
    within a mode, they are reused for _REUSED_STEPS steps.  If ``out.effect_inputs`` is empty, states are known at
    events only: the inertia's weights, which depend on them, are NaN.  The last five are workspace, zeros: states with
    n + 5 derivatives and with one, A at start, middle, end and at three quarters, E at start, middle and end, shape
    (3, n, 6), and three matrices (n, n).
    """
    system, steps, out = by_address(system), by_address(steps), by_address(out)
    state, aside = by_address(state), by_address(aside)
    n = out.propagator.shape[1]
    rows, one = n + 6, out.length_s.ndim  # a 1 of the type of ``rows``, so that the kernel is compiled once
    for j in range(n + 2):
        state.z[1 + j, j] = 1.0
    half, work, term = square[0], square[1], square[2]
    hold, resting, inputs = 0, False, out.effect_inputs.shape[0] > 0
    reused = _REUSED_STEPS if inputs else out.length_s.size  # for forces alone all steps of a mode are alike
    for r in range(out.length_s.size):
        linked, length, mode = out.linked[r], out.length_s[r], steps.modes[steps.event[r]]
        if steps.item[r] >= 0:
            _jump(r, one, state, aside, system, steps, out.event_jump[r], out.event_gradient[r])
        if not linked:
            _write_matrices_at(state, steps.states[r, 0], rows, system, mode, a[0], e[0])
            if inputs:
                _write_effect_inputs(system, out.effect_inputs[r, 0])
            hold, resting = 0, False
        rested, resting = resting, hold > 0
        same = rested and resting  # as in the previous step, except the inertia column
        if linked:
            if same:
                e[0, 1, _INERTIA] = e[2, 1, _INERTIA]
            else:
                _copy(a[2], a[0])
                _copy(e[2], e[0])
            for j in range(STATES if inputs else 0):
                out.effect_inputs[r, 0, j] = out.effect_inputs[r - 1, 2, j]
        if resting:
            hold -= 1
            if not same:
                _copy(a[0], a[2])
                _copy(e[0], e[2])
        if inputs or not resting:
            _write_matrices_at(state, steps.states[r, 2], one if resting else rows, system, mode, a[2], e[2])
        if inputs:
            _write_effect_inputs(system, out.effect_inputs[r, 2])
        if not resting and _nearly_equal(a[0], a[2]) and _nearly_equal(e[0], e[2]):
            hold = reused
        still = resting or hold == reused
        if still and not same:
            _copy(a[0], a[1])
            _copy(e[0], e[1])
        if inputs or not still:
            _write_matrices_at(state, steps.states[r, 1], one if still else rows, system, mode, a[1], e[1])
        if inputs:
            _write_effect_inputs(system, out.effect_inputs[r, 1])
        else:
            e[0, 1, _INERTIA] = e[1, 1, _INERTIA] = e[2, 1, _INERTIA] = math.nan
        if same and abs(length - out.length_s[r - 1]) < 1e-9 * abs(length):
            _copy_step(r, out)
            if inputs:
                _update_inertia_weights(r, length, e, half, out)
            continue
        for j in range(n):
            for m in range(n):
                a[3, j, m] = 0.375 * a[2, j, m] + 0.75 * a[1, j, m] - 0.125 * a[0, j, m]  # by a parabola
        _propagate(a[0], a[1], a[2], length, out.propagator[r], work, term)
        _propagate(a[1], a[3], a[2], 0.5 * length, half, work, term)
        for j in range(n):
            for m in range(INPUTS):
                begin, mid = 0.0, 0.0
                for q in range(n):
                    begin += out.propagator[r, j, q] * e[0, q, m]
                    mid += half[j, q] * e[1, q, m]
                out.weights[r, 0, j, m] = length / 6.0 * begin
                out.weights[r, 1, j, m] = length / 1.5 * mid
                out.weights[r, 2, j, m] = length / 6.0 * e[2, j, m]


@part
def _copy(one, to):  # type: ignore[no-untyped-def]
    for i in range(one.shape[0]):
        for j in range(one.shape[1]):
            to[i, j] = one[i, j]


@part
def _copy_step(r, out):  # type: ignore[no-untyped-def]
    _copy(out.propagator[r - 1], out.propagator[r])
    for point in range(3):
        _copy(out.weights[r - 1, point], out.weights[r, point])


@part
def _update_inertia_weights(r, at, e, half, out):  # type: ignore[no-untyped-def]
    """Write the weights of the inertia, in which a step differs from the one before."""
    for j in range(half.shape[0]):
        out.weights[r, 0, j, _INERTIA] = at / 6.0 * out.propagator[r, j, 1] * e[0, 1, _INERTIA]
        out.weights[r, 1, j, _INERTIA] = at / 1.5 * half[j, 1] * e[1, 1, _INERTIA]
        out.weights[r, 2, j, _INERTIA] = at / 6.0 * e[2, j, _INERTIA]
