"""The stepper for any effect: a Runge-Kutta method of order eight at a step well inside the mode's fastest period.

A step that would pass a guard function is refused and the event approached in ever shorter steps; after it the steps
grow again.  A law that is not smooth where the overlap begins (an exponent) then still comes out to 1e-10, smooth ones
to 1e-12 of the displacement.  The derivatives by the parameters go through the very same steps.  Between steps the
displacement is the quintic through position, velocity and acceleration at both ends.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import overload

from analysis.model import march
from analysis.model.guards import guard, guard_rate
from analysis.model.march import AT_A_GUARD, AWAY, DONE, GONE, LEFT_AT, TIME, is_a, may_touch, take
from analysis.model.modes import FREE, PHASE, PLATE, is_gone, may_be_gone
from analysis.model.rates import derivative_rates, rates, state_rates
from analysis.model.system import HIDDEN, MOVES, RECORD, SYSTEM, VECTOR, Floats, Integers, State, inlined, tight

_SHRINK, _SMALLEST = 0.25, 1e-4
_SLOWLY = 6  # steps taken without growing after one was refused
STEP, LONGEST, HELD = 0, 1, 2  # of the memory: the next step, the longest in this mode, steps to be taken so yet


class RungeKutta(NamedTuple):
    """``limits``: longest step in s in contact, apart, left to itself, and before the touch; the factor by which steps
    grow; and the share of the way to the next touch or release that a step may go (0: all of it).

    The method's terms that are not zero (see ``cooper_verner``), and the stages' states and rates.
    """

    limits: Floats
    table: Integers
    begins: Integers
    weights: Floats
    scaled: Floats
    slopes: Floats
    trial: Floats
    memory: Floats


@inlined
def _combine(z, slopes, stepper, stage, rows, out):  # type: ignore[no-untyped-def]
    """Write a stage's state: ``z`` plus weighted slopes; four numbers at a time, which the processor does at once."""
    stride, n = z.size, rows * z.shape[1]
    flat, ahead, k = z.reshape(stride), out.reshape(stride), slopes.reshape(11 * stride)
    for e in range(0, n, 4):
        t0, t1, t2, t3 = flat[e], flat[e + 1], flat[e + 2], flat[e + 3]
        for j in range(stepper.begins[stage - 1], stepper.begins[stage]):
            weight, at = stepper.scaled[j], stepper.table[j] * stride + e
            t0 += weight * k[at]
            t1 += weight * k[at + 1]
            t2 += weight * k[at + 2]
            t3 += weight * k[at + 3]
        ahead[e], ahead[e + 1], ahead[e + 2], ahead[e + 3] = t0, t1, t2, t3


@tight
def _reach(stepper, system, motion, h, rows):  # type: ignore[no-untyped-def]
    here, there, slopes = motion.here, motion.there, stepper.slopes
    for j in range(stepper.weights.size):
        stepper.scaled[j] = h * stepper.weights[j]
    for stage in range(1, 12):
        z, f = (there.z, there.f) if stage == 11 else (stepper.trial, slopes[stage])
        _combine(here.z, slopes, stepper, stage, rows, z)
        state = State(z, f, there.told)
        mass = state_rates(state, system, motion.mode)
        if rows > 1:
            derivative_rates(state, rows, system.which, system, motion.mode, mass)


@tight
def _arm(stepper, system, motion, forward):  # type: ignore[no-untyped-def]
    here, mode, memory, limits = motion.here, motion.mode, stepper.memory, stepper.limits
    rates(here, system.which.size + 1, system.which, system, mode)
    _keep_slopes(stepper, here)
    longest = limits[3]
    if forward:
        longest = limits[0] if mode[PHASE] != FREE else (limits[1] if mode[PLATE] > 0.5 else limits[2])
    memory[LONGEST], memory[STEP], memory[HELD] = longest, longest * _SMALLEST, 0.0
    return True


@inlined
def _keep_slopes(stepper, state):  # type: ignore[no-untyped-def]
    for row in range(state.f.shape[0]):
        for c in range(state.f.shape[1]):
            stepper.slopes[0, row, c] = state.f[row, c]


@tight
def _crossed(motion, system, h):  # type: ignore[no-untyped-def]
    """Return whether a guard function has passed zero in a step, or may have gone there and come back."""
    signs = motion.signs
    for item in range(signs.size):
        if signs[item] != 0.0 and guard(item, motion.there, system) * signs[item] < 0.0:
            return True
    for item in range(3):
        sign = signs[item]
        if sign != 0.0:
            value, rate = guard(item, motion.here, system) * sign, guard_rate(item, motion.here, system) * sign
            if may_touch(value, rate, guard_rate(item, motion.there, system) * sign, h):
                return True
    return False


@tight
def _run(stepper, system, motion, record, ahead):  # type: ignore[no-untyped-def]
    here, there, signs, memory = motion.here, motion.there, motion.signs, stepper.memory
    rows, i, times, cleared = system.which.size + 1, ahead.i, record.times, ahead.cleared
    growth, nearing, longest = stepper.limits[4], stepper.limits[5], memory[LONGEST]
    omega = math.sqrt(system.p[0] / system.p[1])
    while (i <= ahead.last) if ahead.forward else (i >= ahead.last):
        far = ahead.forward and may_be_gone(here.z[0, 0], here.z[0, 2], motion.mode)
        if far and is_gone(here.z[0], motion.mode, system, omega):
            return i, 0.0, GONE
        t = motion.clock[TIME]
        remaining = abs(times[ahead.last] - t)
        if remaining <= 0.0:
            remaining = longest
        h = min(memory[STEP], longest)
        if nearing > 0.0 and signs[0] != 0.0 and here.told[0, 1] * signs[0] < 0.0 < here.told[0, 0] * signs[0]:
            h = min(h, max(nearing * abs(here.told[0, 0] / here.told[0, 1]), longest * _SMALLEST))
        h = min(h, remaining)
        signed = h if ahead.forward else -h
        _reach(stepper, system, motion, signed, rows)
        if not cleared and _crossed(motion, system, signed):
            if h <= longest * _SMALLEST * 1.000001:
                return i, signed, AT_A_GUARD
            memory[STEP], memory[HELD] = max(h * _SHRINK, longest * _SMALLEST), _SLOWLY
            continue
        cleared = False
        if not math.isfinite(there.z[0, 0] + there.z[0, 1] + there.z[0, 3]):
            return i, signed, AWAY
        i = _show(stepper, system, motion, record, i, signed)
        take(here, there, rows)
        _keep_slopes(stepper, here)
        motion.clock[TIME] = t + signed
        if memory[HELD] > 0.0:
            memory[HELD] -= 1.0
            memory[STEP] = h
        else:
            memory[STEP] = h * growth
    return i, 0.0, DONE


@tight
def _quintic(one, other, place, row, h, at):  # type: ignore[no-untyped-def]
    """Return (x, v) at ``at`` in [0, h] of the quintic through two states' position, velocity and acceleration."""
    x0, v0, a0 = one.z[row, place], one.z[row, place + 1], one.f[row, place + 1]
    x1, v1, a1 = other.z[row, place], other.z[row, place + 1], other.f[row, place + 1]
    u = at / h
    d = x1 - x0 - h * (v0 + 0.5 * h * a0)
    e = h * (v1 - v0 - h * a0)
    g = h * h * (a1 - a0)
    c3 = 10.0 * d - 4.0 * e + 0.5 * g
    c4 = -15.0 * d + 7.0 * e - g
    c5 = 6.0 * d - 3.0 * e + 0.5 * g
    x = x0 + at * (v0 + 0.5 * at * a0) + u * u * u * (c3 + u * (c4 + u * c5))
    v = v0 + at * a0 + u * u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)) / h
    return x, v


@tight
def _cubic(one, other, place, h, at):  # type: ignore[no-untyped-def]
    """Return x at ``at`` in [0, h] of the cubic through two states' x and its rate."""
    u = at / h
    x0, x1, v0, v1 = one.z[0, place], other.z[0, place], one.f[0, place], other.f[0, place]
    d = x1 - x0
    return x0 + at * v0 + u * u * (3.0 * d - h * (2.0 * v0 + v1) + u * (h * (v0 + v1) - 2.0 * d))


@tight
def _show(stepper, system, motion, record, i, h):  # type: ignore[no-untyped-def]
    here, there, slots, states = motion.here, motion.there, system.slots, record.states
    t, way = motion.clock[TIME], 1 if h >= 0.0 else -1
    while 0 <= i < record.times.size and (record.times[i] - t) * way <= h * way:
        at = record.times[i] - t
        for pair in range(2 + slots.shape[0]):  # block, plate, then each effect's hidden state
            slot = pair - 2
            room = pair < 2 or 6 + 2 * slot < states.shape[1]
            moves = slots[slot, MOVES] if pair >= 2 else 0.0
            if not room and moves == 0.0:
                continue
            q, w = here.z[0, 2 * pair], here.z[0, 2 * pair + 1]
            if h != 0.0 and pair >= 2 and slots[slot, HIDDEN] == 1.0:
                q = _cubic(here, there, 2 * pair, h, at)
            elif h != 0.0:
                q, w = _quintic(here, there, 2 * pair, 0, h, at)
            if room:
                first = 2 * pair if pair < 2 else 2 * pair + 1
                states[i, first], states[i, first + 1] = q, w
            if pair == 1:
                states[i, 4] = q
            states[i, 4] += moves * q
        for j in range(1, system.which.size + 1):
            record.d_x[i, j - 1] = here.z[j, 0] if h == 0.0 else _quintic(here, there, 0, j, h, at)[0]
        if motion.mode[PLATE] < 0.5:  # left to itself, or still at its start: the plate rings freely
            omega = math.sqrt(system.p[0] / system.p[1])
            since = record.times[i] - motion.clock[LEFT_AT]
            cosine, sine = math.cos(omega * since), math.sin(omega * since)
            swing = sine / omega if omega > 0.0 else since
            states[i, 3] = here.z[0, 3] * cosine - here.z[0, 2] * omega * sine
            states[i, 2] = here.z[0, 2] * cosine + here.z[0, 3] * swing
            states[i, 4] = states[i, 2]
        i += way
    return i


@overload(march.arm, inline="always")
def _arm_of(stepper, system, motion, record, forward):  # type: ignore[no-untyped-def]
    if is_a(stepper, RungeKutta):
        return lambda stepper, system, motion, record, forward: _arm(stepper, system, motion, forward)
    return None


@overload(march.run, inline="always")
def _run_of(stepper, system, motion, record, ahead):  # type: ignore[no-untyped-def]
    if is_a(stepper, RungeKutta):
        return lambda stepper, system, motion, record, ahead: _run(stepper, system, motion, record, ahead)
    return None


@overload(march.reach, inline="always")
def _reach_of(stepper, system, motion, h, rows):  # type: ignore[no-untyped-def]
    if is_a(stepper, RungeKutta):
        return lambda stepper, system, motion, h, rows: _reach(stepper, system, motion, h, rows)
    return None


@overload(march.show, inline="always")
def _show_of(stepper, system, motion, record, i, h):  # type: ignore[no-untyped-def]
    if is_a(stepper, RungeKutta):
        return lambda stepper, system, motion, record, i, h: _show(stepper, system, motion, record, i, h)
    return None


@njit(cache=True, nogil=True, error_model="numpy")
def cooper_verner():  # type: ignore[no-untyped-def]
    """Return the explicit Runge-Kutta method of order 8 in 11 stages as (stage of, begins, weights) of its terms.

    The terms that are not zero, stage after stage (the second first) and the new state's last: those of the i-th lie
    from ``begins[i]`` to ``begins[i + 1]``.  G. J. Cooper and J. H. Verner, SIAM J. Numer. Anal. 9 (1972) 389.  Closed
    form in sqrt(21).
    """
    r = np.sqrt(21.0)
    a = np.zeros((11, 11))
    a[1, 0] = 1 / 2
    a[2, 0], a[2, 1] = 1 / 4, 1 / 4
    a[3, 0], a[3, 1], a[3, 2] = 1 / 7, (-7 - 3 * r) / 98, (21 + 5 * r) / 49
    a[4, 0], a[4, 2], a[4, 3] = (11 + r) / 84, (18 + 4 * r) / 63, (21 - r) / 252
    a[5, 0], a[5, 2], a[5, 3], a[5, 4] = (5 + r) / 48, (9 + r) / 36, (-231 + 14 * r) / 360, (63 - 7 * r) / 80
    a[6, 0], a[6, 2], a[6, 3] = (10 - r) / 42, (-432 + 92 * r) / 315, (633 - 145 * r) / 90
    a[6, 4], a[6, 5] = (-504 + 115 * r) / 70, (63 - 13 * r) / 35
    a[7, 0], a[7, 4], a[7, 5], a[7, 6] = 1 / 14, (14 - 3 * r) / 126, (13 - 3 * r) / 63, 1 / 9
    a[8, 0], a[8, 4], a[8, 5] = 1 / 32, (91 - 21 * r) / 576, 11 / 72
    a[8, 6], a[8, 7] = (-385 - 75 * r) / 1152, (63 + 13 * r) / 128
    a[9, 0], a[9, 4], a[9, 5], a[9, 6] = 1 / 14, 1 / 9, (-733 - 147 * r) / 2205, (515 + 111 * r) / 504
    a[9, 7], a[9, 8] = (-51 - 11 * r) / 56, (132 + 28 * r) / 245
    a[10, 4], a[10, 5], a[10, 6] = (-42 + 7 * r) / 18, (-18 + 28 * r) / 45, (-273 - 53 * r) / 72
    a[10, 7], a[10, 8], a[10, 9] = (301 + 53 * r) / 72, (28 - 28 * r) / 45, (49 - 7 * r) / 18
    table, begins, weights = np.zeros(60, dtype=np.int64), np.zeros(12, dtype=np.int64), np.zeros(60)
    used = 0
    b = np.zeros(11)
    b[0], b[7], b[8], b[9], b[10] = 1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20
    for stage in range(1, 12):
        for past in range(min(stage, 11)):
            weight = a[stage, past] if stage < 11 else b[past]
            if weight != 0.0:
                table[used], weights[used] = past, weight
                used += 1
        begins[stage] = used
    return table[:used], begins, weights[:used]


@njit(types.int64(SYSTEM, RECORD, VECTOR), cache=True, nogil=True, error_model="numpy")
def integrate(system, record, limits):  # type: ignore[no-untyped-def]
    """Solve at ``record.times`` (ascending, 0: first touch); ``limits`` are those of ``RungeKutta``.

    Returns the number of events, TOO_MANY or RUNS_AWAY.  About 1.3 ms for 60 ms, and 1 ms for each derivative.
    """
    rows, size, count = system.which.size + 1, record.event_state.shape[1], system.slots.shape[0]
    table, begins, weights = cooper_verner()
    stepper = RungeKutta(
        limits, table, begins, weights, np.empty(weights.size),
        np.zeros((11, rows, size)), np.zeros((rows, size)), np.zeros(3),
    )  # fmt: skip
    return march.march(stepper, system, march.motion_of(rows, size, count), record, np.full(1, -1, dtype=np.int64))
