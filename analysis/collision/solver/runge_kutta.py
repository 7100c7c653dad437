"""The stepper for any effect: a Runge-Kutta method of order eight with steps well below the mode's fastest period.

A step in which a guard function passes zero is rejected, and the event is approached in ever shorter steps; after it
the steps grow again.  When the oscillation of the contact has decayed, they grow as far as the interpolation of the
displacement allows.  The error is 1e-10 of the displacement for a law that is not smooth at the start of the overlap
(an exponent), 1e-12 for smooth ones.  The derivatives with respect to the parameters use the same steps.  Between steps
the displacement is the quintic through position, velocity and acceleration at both ends.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.collision.parameters import Floats
from analysis.collision.solver.modes import (
    PLATE,
    VELOCITY,
    guard,
    guard_rate,
    has_left_for_good,
    may_have_left_for_good,
    may_touch,
    rate_at,
)
from analysis.collision.solver.rates import derivative_rates, rates, state_rates
from analysis.collision.solver.system import (
    DONE,
    HIDDEN,
    LEFT_AT,
    LEFT_FOR_GOOD,
    MAY_CONTAIN_EVENT,
    MOVES,
    NOT_FINITE,
    STEP_LIMIT,
    STEPS_LEFT,
    TIME,
    State,
    copy_state,
)
from analysis.compiled import add_product, by_address, cut, four_of, inlined, part, put_four

Places = NDArray[np.int64]
_SHRINK = 0.25
_STEPS_WITHOUT_GROWTH = 6  # after a rejected step
# Indices into ``memory``: the next step, the longest safe step in this mode, the longest step of all, the number of
# steps that must not grow, and the motion's sixth derivative over 720 (below zero: unknown).
STEP, LONGEST, EVER, HELD, SIXTH = 0, 1, 2, 3, 4
_MEMORY = 5
# Indices into ``limits``: the first of the safe steps and of the rates, one per mode (``rate_at``), then the others.
SAFE, SWINGS, EFFECTS, GROWTH, NEARING, ALLOWED, SHORTEST = 0, 4, 8, 9, 10, 11, 12
_COST_OF_STEP = 20.0  # computing time of a step, in steps of the closed form
_MAX_PHASE = 2.0  # largest phase step of the fastest oscillation once it has decayed: the method is stable up to three
_MIDWAY = 1.0 / 64.0  # error of a quintic midway between two states, in units of h^6 times sixth derivative over 720
_PLATE_WEIGHT = 0.02  # weight of an error of the plate relative to one of the block
_NEARING = 0.4  # largest share of the distance to the next touch or release for a step longer than safe
_PARAMETER_CHANGE = 1e-3  # relative change of a parameter at which the error of a derivative is judged
_DECAY_PER_RADIAN = 0.5  # decay per radian of the remembered sixth derivative, which passes zero twice per period
_KINK_GROWTH = 4.0  # growth of the sixth derivative that indicates a kink: the step is repeated as a safe one
_REFUSED_ERROR = 30.0  # times the allowed error, above which the step is repeated as a safe one


class RungeKutta(NamedTuple):
    """The arrays of the stepper.

    ``limits``: safe step in s in contact, apart, after the block has left, and before the touch; the fastest rate in
    rad/s in each; the longest step that the effects allow; the growth factor of steps; the largest share of the
    distance to the next touch or release (0: no limit); the allowed error in m of a step longer than safe; the length
    of the last step before an event as a share of a safe step.  ``scaled``: the stages' weights times the step;
    ``slopes``: the stages' rates (the first are those of ``here``); ``trial``: a stage's state.
    """

    limits: Floats
    scaled: Floats
    slopes: Floats
    trial: Floats
    memory: Floats


def _cooper_verner() -> tuple[Places, Places, Floats]:
    """Return the explicit Runge-Kutta method of order 8 in 11 stages as (stage, begins, weights) of its terms.

    Only nonzero terms are listed, stage by stage from the second on, with those of the new state last.  The terms of
    the i-th are ``begins[i - 1]`` to ``begins[i]``.  G. J. Cooper and J. H. Verner, SIAM J. Numer. Anal. 9 (1972) 389;
    closed form in sqrt(21).
    """
    r = math.sqrt(21.0)
    rows: list[dict[int, float]] = [
        {0: 1 / 2},
        {0: 1 / 4, 1: 1 / 4},
        {0: 1 / 7, 1: (-7 - 3 * r) / 98, 2: (21 + 5 * r) / 49},
        {0: (11 + r) / 84, 2: (18 + 4 * r) / 63, 3: (21 - r) / 252},
        {0: (5 + r) / 48, 2: (9 + r) / 36, 3: (-231 + 14 * r) / 360, 4: (63 - 7 * r) / 80},
        {0: (10 - r) / 42, 2: (-432 + 92 * r) / 315, 3: (633 - 145 * r) / 90, 4: (-504 + 115 * r) / 70}
        | {5: (63 - 13 * r) / 35},
        {0: 1 / 14, 4: (14 - 3 * r) / 126, 5: (13 - 3 * r) / 63, 6: 1 / 9},
        {0: 1 / 32, 4: (91 - 21 * r) / 576, 5: 11 / 72, 6: (-385 - 75 * r) / 1152, 7: (63 + 13 * r) / 128},
        {0: 1 / 14, 4: 1 / 9, 5: (-733 - 147 * r) / 2205, 6: (515 + 111 * r) / 504, 7: (-51 - 11 * r) / 56}
        | {8: (132 + 28 * r) / 245},
        {4: (-42 + 7 * r) / 18, 5: (-18 + 28 * r) / 45, 6: (-273 - 53 * r) / 72, 7: (301 + 53 * r) / 72}
        | {8: (28 - 28 * r) / 45, 9: (49 - 7 * r) / 18},
        {0: 1 / 20, 7: 49 / 180, 8: 16 / 45, 9: 49 / 180, 10: 1 / 20},
    ]
    table = np.array([past for row in rows for past in row])
    weights = np.array([weight for row in rows for weight in row.values()])
    return table, np.cumsum([0, *(len(row) for row in rows)]), weights


_TABLE, _BEGINS, _WEIGHTS = _cooper_verner()


@inlined
def _combine(z, slopes, scaled, stage, rows, out):  # type: ignore[no-untyped-def]
    """Write a stage's state: ``z`` plus weighted slopes, four numbers at a time."""
    begin, end = _BEGINS[stage - 1], _BEGINS[stage]
    for row in range(rows):
        for c in range(0, z.shape[1], 4):
            total = four_of(z[row], c)
            for j in range(begin, end):
                total = add_product(total, scaled[j], four_of(slopes[_TABLE[j], row], c))
            put_four(total, out[row], c)


@part
def _step(stepper, system, here, there, mode, h, rows):  # type: ignore[no-untyped-def]
    """Write the state at ``h`` after ``here``, with its rates and contact, to ``there``."""
    slopes, scaled = stepper.slopes, stepper.scaled
    for j in range(scaled.size):
        scaled[j] = h * _WEIGHTS[j]
    for stage in range(1, 12):
        z, f = (there.z, there.f) if stage == 11 else (stepper.trial, slopes[stage])
        _combine(here.z, slopes, scaled, stage, rows, z)
        state = by_address(State(z, f, there.contact))
        mass = state_rates(state, system, mode)
        if rows > 1:
            derivative_rates(state, rows, system.which, system, mode, mass)


@part
def step_to(stepper, system, motion, h, rows):  # type: ignore[no-untyped-def]
    _step(stepper, system, motion.here, motion.there, motion.mode, h, rows)


@part
def begin_mode(stepper, system, motion, record, forward):  # type: ignore[no-untyped-def]
    here, mode, memory, limits = motion.here, motion.mode, stepper.memory, stepper.limits
    rates(here, system.which.size + 1, system.which, system, mode)
    at = rate_at(mode, forward)
    longest, swing = limits[SAFE + at], limits[SWINGS + at]
    memory[EVER] = max(longest, min(_MAX_PHASE / swing, limits[EFFECTS]) if swing > 0.0 else longest)
    memory[LONGEST], memory[STEP], memory[HELD], memory[SIXTH] = longest, longest * limits[SHORTEST], 0.0, -1.0
    return True


@inlined
def _fifth(one, other, place, row, h):  # type: ignore[no-untyped-def]
    """Return the size of the fifth derivative over 120 of the quintic through two states."""
    x0, v0, a0 = one.z[row, place], one.z[row, place + 1], one.f[row, place + 1]
    x1, v1, a1 = other.z[row, place], other.z[row, place + 1], other.f[row, place + 1]
    d = x1 - x0 - h * (v0 + 0.5 * h * a0)
    return abs((6.0 * d - 3.0 * h * (v1 - v0 - h * a0) + 0.5 * h * h * (a1 - a0)) / h**5)


@inlined
def _error_allowed(stepper, system, here, there, swing, h):  # type: ignore[no-untyped-def]
    """Return whether the error of a step is allowed, and store the sixth derivative for the next step.

    For an oscillation of rate ``swing``, the quintic's error scales with the sixth derivative and the method's error
    with the ninth.  A safe step is always accepted.  Derivatives count as a parameter change of a thousandth.
    """
    memory, allowed = stepper.memory, stepper.limits[ALLOWED]
    longest, ever = memory[LONGEST], memory[EVER]
    if h < 0.5 * longest or ever <= longest:  # too short for an error estimate, or no longer step is possible
        return True
    fifth = max(_fifth(here, there, 0, 0, h), _PLATE_WEIGHT * _fifth(here, there, 2, 0, h))
    for row in range(1, system.which.size + 1):
        by = system.which[row - 1]
        if by >= 0:
            fifth = max(fifth, _PARAMETER_CHANGE * abs(system.p[by]) * _fifth(here, there, 0, row, h))
    sixth, known = fifth * swing / 6.0, memory[SIXTH]
    memory[SIXTH] = max(sixth, known / (1.0 + _DECAY_PER_RADIAN * swing * h))
    error = _MIDWAY * sixth * h**6 * max(1.0, (swing * h) ** 3)
    return h <= longest or (error <= _REFUSED_ERROR * allowed and sixth <= _KINK_GROWTH * known)


@inlined
def _longest_step(stepper, swing):  # type: ignore[no-untyped-def]
    """Return the longest step that the motion allows at present."""
    memory = stepper.memory
    longest, sixth = memory[LONGEST], memory[SIXTH]
    if sixth < 0.0:
        return longest
    long = memory[EVER]
    if sixth > 0.0:
        long = (stepper.limits[ALLOWED] / (_MIDWAY * sixth)) ** (1.0 / 6.0)
        if long * swing > 1.0:  # there the ninth power of the step dominates
            long = (swing * long) ** (2.0 / 3.0) / swing
    return max(longest, min(long, memory[EVER]))


@inlined
def _crossed(motion, system, h):  # type: ignore[no-untyped-def]
    """Return whether a guard function has passed zero in a step, or may have passed it twice."""
    signs = motion.signs
    for item in range(signs.size):
        if signs[item] != 0.0 and guard(item, motion.there, system) * signs[item] < 0.0:
            return True
    for item in range(signs.size):
        sign = signs[item]
        if sign != 0.0 and item != VELOCITY:
            value, rate = guard(item, motion.here, system) * sign, guard_rate(item, motion.here, system) * sign
            if may_touch(value, rate, guard_rate(item, motion.there, system) * sign, h):
                return True
    return False


@part
def run(stepper, system, motion, record, ahead):  # type: ignore[no-untyped-def]
    here, there, signs, memory = motion.here, motion.there, motion.signs, stepper.memory
    rows, i, times, cleared = system.which.size + 1, ahead.i, record.times, ahead.cleared
    growth, nearing, longest = stepper.limits[GROWTH], stepper.limits[NEARING], memory[LONGEST]
    shortest = longest * stepper.limits[SHORTEST]
    swing = stepper.limits[SWINGS + rate_at(motion.mode, ahead.forward)]
    omega, way = math.sqrt(system.p[0] / system.p[1]), 1.0 if ahead.forward else -1.0
    while (i <= ahead.last) if ahead.forward else (i >= ahead.last):
        far = ahead.forward and may_have_left_for_good(here.z[0, 0], here.z[0, 2], motion.mode)
        if far and has_left_for_good(here.z[0], motion.mode, system, omega):
            return i, 0.0, LEFT_FOR_GOOD
        motion.clock[STEPS_LEFT] -= _COST_OF_STEP
        if motion.clock[STEPS_LEFT] < 0.0:
            return i, 0.0, STEP_LIMIT
        t = motion.clock[TIME]
        remaining = abs(times[ahead.last] - t)
        if remaining <= 0.0:
            remaining = longest
        h = min(memory[STEP], _longest_step(stepper, swing))
        if (nearing > 0.0 or h > longest) and here.contact[0, 1] * signs[0] < 0.0 < here.contact[0, 0] * signs[0]:
            least = shortest if nearing > 0.0 else longest  # a touch or release is approached in safe steps
            h = min(h, max((nearing or _NEARING) * abs(here.contact[0, 0] / here.contact[0, 1]), least))
        h = min(h, remaining)
        signed = way * h
        _step(stepper, system, here, there, motion.mode, signed, rows)
        if not cleared and _crossed(motion, system, signed):
            if h <= shortest:
                return i, signed, MAY_CONTAIN_EVENT
            memory[STEP], memory[HELD] = max(h * _SHRINK, shortest), _STEPS_WITHOUT_GROWTH
            continue
        cleared = False
        if not math.isfinite(there.z[0, 0] + there.z[0, 1] + there.z[0, 3]):
            return i, signed, NOT_FINITE
        if not _error_allowed(stepper, system, here, there, swing, h):  # repeat as a safe step
            memory[STEP] = longest
            continue
        if (times[i] - t) * way <= h:
            i = write_samples(stepper, system, motion, record, i, signed)
        copy_state(here, there, rows)
        motion.clock[TIME] = t + signed
        if memory[HELD] > 0.0:
            memory[HELD] -= 1.0
            memory[STEP] = h
        else:
            memory[STEP] = h * growth
    return i, 0.0, DONE


@inlined
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


@inlined
def _cubic(one, other, place, h, at):  # type: ignore[no-untyped-def]
    """Return x at ``at`` in [0, h] of the cubic through two states' x and its rate."""
    u = at / h
    x0, x1, v0, v1 = one.z[0, place], other.z[0, place], one.f[0, place], other.f[0, place]
    d = x1 - x0
    return x0 + at * v0 + u * u * (3.0 * d - h * (2.0 * v0 + v1) + u * (h * (v0 + v1) - 2.0 * d))


@part
def write_samples(stepper, system, motion, record, i, h):  # type: ignore[no-untyped-def]
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
        if motion.mode[PLATE] == 0.0:  # the plate oscillates freely
            omega = math.sqrt(system.p[0] / system.p[1])
            since = record.times[i] - motion.clock[LEFT_AT]
            cosine, sine = math.cos(omega * since), math.sin(omega * since)
            swing = sine / omega if omega > 0.0 else since
            states[i, 3] = here.z[0, 3] * cosine - here.z[0, 2] * omega * sine
            states[i, 2] = here.z[0, 2] * cosine + here.z[0, 3] * swing
            states[i, 4] = states[i, 2]
        i += way
    return i


@part
def stepper_of(limits, rows, size, room, at):  # type: ignore[no-untyped-def]
    """Return a stepper cut from ``room``, and the position after it; ``limits`` are those of ``RungeKutta``."""
    slopes, at = cut(room, at, (11, rows, size))
    scaled, at = cut(room, at, (_WEIGHTS.size,))
    trial, at = cut(room, at, (rows, size))
    memory, at = cut(room, at, (_MEMORY,))
    return RungeKutta(limits, scaled, slopes, trial, memory), at


def room_for(rows: int, size: int) -> int:
    """Return the size of a stepper's arrays."""
    return 12 * rows * size + _WEIGHTS.size + _MEMORY
