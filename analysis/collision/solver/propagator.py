"""The stepper in closed form, for equations that are linear in the state: the two bodies and most effects.

Within a mode s' = A s, with the state augmented by a constant 1.  A and dA/dtheta come from the equations (``rates``)
at unit states.  Every step is exp(A h) as a Taylor series; the derivatives S with respect to the parameters follow in
the same way from S' = A S + (dA/dtheta) s.  The solution is exact to rounding for any step, whereas a Runge-Kutta
method needs a dozen evaluations every quarter of a radian.  Linearity is checked at other states in every mode.  Modes
that are not linear are left to ``runge_kutta``.
"""

import math
from typing import NamedTuple

from analysis.collision.parameters import Floats
from analysis.collision.solver.exponentials import (
    add_block_mean,
    block_matrices,
    exponential,
    row_times_state,
    series,
    step,
    step_without_derivatives,
)
from analysis.collision.solver.matrices import (
    SLOW,
    STEP_S,
    STEPS_PER_SAMPLE,
    TERMS,
    ModeMatrices,
    Room,
    columns,
    form_at,
    forms_of,
    linearise,
    room_of,
)
from analysis.collision.solver.modes import (
    NEAR_0,
    OVERLAP,
    PLATE,
    RANGE_0,
    VELOCITY,
    has_left_for_good,
    may_have_left_for_good,
    may_touch,
    rate_at,
)
from analysis.collision.solver.rates import rates
from analysis.collision.solver.system import (
    DONE,
    LEFT_FOR_GOOD,
    MAY_CONTAIN_EVENT,
    NOT_FINITE,
    STEP_LIMIT,
    STEPS_LEFT,
    TIME,
    Ahead,
    Integers,
    State,
    state_of,
)
from analysis.collision.solver.two_bodies import step_two_bodies
from analysis.compiled import by_address, cut, cut_integers, inlined, part

_STEP = 0.7  # longest step times the fastest rate: nine steps per period, so that no touch is missed
_LONGEST_S = 1e-3
_MIN_STEP = 2e-6  # shortest step as a share of the time from touch to furthest sample: at most half a million steps
_MODES = 16  # number of modes whose matrices are stored
# Indices into ``at``: the present mode, the number of modes met, steps left to the next sample, first sample of a block
# that must be checked step by step.
PRESENT, MODES_MET, STEPS_TO_SAMPLE, CHECKED_BLOCK = 0, 1, 2, 3


class Propagator(NamedTuple):
    """``swings``: the fastest rates in rad/s (``rate_at``).

    ``kept``: the matrices of the ``modes`` met so far, shape (16, flags); ``z``: the state and its derivatives as
    columns, now and a step ahead, shape (2, n + 1, rows up to a multiple of four); ``active``: the number of monitored
    guard functions, then their indices.
    """

    swings: Floats
    spacing_s: float
    kept: ModeMatrices
    modes: Floats
    at: Integers
    active: Integers
    z: Floats
    room: Room
    plain: State
    every: Integers


@part
def begin_mode(stepper, system, motion, record, forward):  # type: ignore[no-untyped-def]
    here, mode, at, z = motion.here, motion.mode, stepper.at, stepper.z[0]
    rows, n = system.which.size + 1, system.numbers
    for c in range(n):
        for k in range(rows):
            z[c, k] = here.z[k, c]
    z[n, 0] = 1.0
    at[STEPS_TO_SAMPLE] = 0
    used = 0
    for item in range(motion.signs.size):
        if motion.signs[item] != 0.0:
            used += 1
            stepper.active[used] = item
    stepper.active[0] = used
    for k in range(min(at[MODES_MET], _MODES)):
        same = True
        for c in range(mode.size):
            same = same and stepper.modes[k, c] == mode[c]
        if same:
            at[PRESENT] = k
            return True
    at[PRESENT] = at[MODES_MET] % _MODES
    at[MODES_MET] += 1
    for c in range(mode.size):
        stepper.modes[at[PRESENT], c] = mode[c]
    return _linearise_mode(stepper, by_address(form_at(stepper.kept, at[PRESENT])), system, mode, record.block, forward)


@part
def _linearise_mode(stepper, form, system, mode, block, forward):  # type: ignore[no-untyped-def]
    """Write the matrices of a mode at its first occurrence; return False if it is not linear."""
    if not linearise(form, stepper.plain, stepper.every, system, mode):
        return False
    rows, swing, there = system.which.size + 1, stepper.swings[rate_at(mode, forward)], mode[PLATE] > 0.5
    pieces = max(1, math.ceil(stepper.spacing_s / min(_STEP / max(swing, 1e-9), _LONGEST_S) - 1e-9))
    form.steps[STEPS_PER_SAMPLE] = pieces
    form.steps[STEP_S] = (stepper.spacing_s if forward else -stepper.spacing_s) / pieces
    form.steps[TERMS] = exponential(form, stepper.room, rows, form.steps[STEP_S])
    form.steps[SLOW] = 0.0 if there and swing * stepper.spacing_s * block > _STEP else 1.0
    for c in range(form.shown.shape[1]):
        for j in range(form.shown.shape[0]):
            form.shown[j, c] = 1.0 if c == (j if j < 4 else j - 1) else 0.0
        # the contact point is the block's position plus the overlap; after the block has left, the plate
        form.shown[4, c] = (form.guard[OVERLAP, c] if there else 0.0) if c != 0 and c != 2 else 0.0
    form.shown[4, 2] = 1.0
    if block > 1 and pieces == 1:
        block_matrices(form, stepper.room, rows, block)
    return True


@inlined
def _crosses(z, z_end, h, form, active, signs):  # type: ignore[no-untyped-def]
    """Return whether a guard function has passed zero in a step, or may have passed it twice."""
    for k in range(1, active[0] + 1):
        item = active[k]
        sign = signs[item]
        if row_times_state(form.guard, item, z_end) * sign < 0.0:
            return True
        if item != VELOCITY:
            rate_end = row_times_state(form.guard_rate, item, z_end) * sign
            if rate_end * h > 0.0:
                rate = row_times_state(form.guard_rate, item, z) * sign
                if may_touch(row_times_state(form.guard, item, z) * sign, rate, rate_end, h):
                    return True
    return False


@part
def _may_cross(z, form, block, motion, stepper):  # type: ignore[no-untyped-def]
    """Return whether a guard function may pass zero within a block, from the state at each of its samples."""
    near, further = stepper.room.single[0], stepper.room.single[1]
    for c in range(z.shape[0]):
        near[c, 0] = further[c, 0] = z[c, 0]
    for _ in range(block):
        step_without_derivatives(near, form.e, further)
        if _crosses(near, further, form.steps[STEP_S], form, stepper.active, motion.signs):
            return True
        for c in range(z.shape[0] - 1):
            near[c, 0] = further[c, 0]
    return False


@part
def run(stepper, system, motion, record, ahead):  # type: ignore[no-untyped-def]
    form, times, block = by_address(form_at(stepper.kept, stepper.at[PRESENT])), record.times, record.block
    rows, forward, last, cleared = system.which.size + 1, ahead.forward, ahead.last, ahead.cleared
    alone = rows == 1 and system.numbers == 4 and stepper.active[0] <= 2 and (block == 1 or form.steps[SLOW] > 0.5)
    bit, pieces, spacing, share = form.steps[STEP_S], int(form.steps[STEPS_PER_SAMPLE]), stepper.spacing_s, 1.0 / block
    z, z_end, odd = stepper.z[0], stepper.z[1], False
    i, t, left, h, why = ahead.i, motion.clock[TIME], stepper.at[STEPS_TO_SAMPLE], 0.0, DONE
    omega, steps_left = math.sqrt(system.p[0] / system.p[1]), motion.clock[STEPS_LEFT]
    way, edge = (1, 0) if forward else (-1, block - 1)  # direction, and the first sample of a block in it
    while (i <= last) if forward else (i >= last):
        if forward and may_have_left_for_good(z[0, 0], z[2, 0], motion.mode):
            _copy_to_state(z, motion.here, 1)
            if has_left_for_good(motion.here.z[0], motion.mode, system, omega):
                why = LEFT_FOR_GOOD
                break
        if alone and pieces == 1 and not cleared and i != stepper.at[CHECKED_BLOCK]:
            before = i
            i, t = step_two_bodies(z, form, motion, stepper.active, record, Ahead(i, last, forward, cleared), t)
            if i != before:
                continue
        steps_left -= 1.0
        if steps_left < 0.0:
            why = STEP_LIMIT
            break
        remaining = times[i] - t
        if left == 0 and abs(remaining) < 1e-14:
            _write_sample(z, form, i // block, share, rows, record)
            i += way
            continue
        even = left > 0 or abs(remaining - way * spacing) < 2e-15
        if i % block == edge and even and block > 1 and pieces == 1 and i != stepper.at[CHECKED_BLOCK]:
            slow = form.steps[SLOW] > 0.5
            if not slow and _may_cross(z, form, block, motion, stepper):
                stepper.at[CHECKED_BLOCK] = i
                continue
            if rows > 1:
                step(z, form.whole, form.d_whole, z_end)
            else:
                step_without_derivatives(z, form.whole, z_end)
            if slow and _crosses(z, z_end, block * bit, form, stepper.active, motion.signs):
                stepper.at[CHECKED_BLOCK] = i
                continue
            add_block_mean(z, rows, form, record.states[i // block], record.d_x[i // block], stepper.room.columns[0, 0])
            t += block * bit
            i += way * block
        else:
            h, left_then = bit, 0
            if even:
                left_then = (pieces if left == 0 else left) - 1
            elif abs(remaining) <= abs(bit):
                h = remaining
            if h != bit:
                series(z, rows, form, h, z_end, stepper.room)
            elif rows > 1:
                step(z, form.e, form.d, z_end)
            else:
                step_without_derivatives(z, form.e, z_end)
            if not cleared and _crosses(z, z_end, h, form, stepper.active, motion.signs):
                why = MAY_CONTAIN_EVENT
                break
            cleared = False
            t += h
            left = left_then
        if not math.isfinite(z_end[0, 0] + z_end[1, 0] + z_end[3, 0]):
            why = NOT_FINITE
            break
        z, z_end = z_end, z
        odd = not odd
    if odd:
        for c in range(system.numbers):
            for k in range(z.shape[1]):
                stepper.z[0, c, k] = z[c, k]
    _copy_to_state(stepper.z[0], motion.here, 1)
    motion.clock[TIME], motion.clock[STEPS_LEFT], stepper.at[STEPS_TO_SAMPLE] = t, steps_left, left
    if why == LEFT_FOR_GOOD:  # another mode begins here, with all derivatives
        _copy_to_state(stepper.z[0], motion.here, rows)
    return i, h, why


@inlined
def _copy_to_state(z, state, rows):  # type: ignore[no-untyped-def]
    """Copy the first ``rows`` columns to the rows of a state."""
    for k in range(rows):
        for c in range(z.shape[0] - 1):
            state.z[k, c] = z[c, k]


@inlined
def _write_sample(z, form, row, share, rows, record):  # type: ignore[no-untyped-def]
    """Write a sample, or add it to the mean of its block."""
    states, d_x = record.states, record.d_x
    sums = share < 1.0
    for j in range(4):
        states[row, j] = share * z[j, 0] + (states[row, j] if sums else 0.0)
    for j in range(4, states.shape[1]):
        states[row, j] = share * row_times_state(form.shown, j, z) + (states[row, j] if sums else 0.0)
    for k in range(1, rows):
        d_x[row, k - 1] = share * z[0, k] + (d_x[row, k - 1] if sums else 0.0)


@part
def step_to(stepper, system, motion, h, rows):  # type: ignore[no-untyped-def]
    probe = stepper.room.columns[2]
    series(stepper.z[0], rows, by_address(form_at(stepper.kept, stepper.at[PRESENT])), h, probe, stepper.room)
    _copy_to_state(probe, motion.there, rows)
    rates(motion.there, rows, system.which, system, motion.mode)


@part
def write_samples(stepper, system, motion, record, i, h):  # type: ignore[no-untyped-def]
    """Return ``i``: steps end at samples, so no sample lies within a step."""
    return i


@part
def _spacing(times):  # type: ignore[no-untyped-def]
    """Return the spacing of the times, or of the first two if it is uneven; longer if the steps would be too many."""
    samples = times.size
    if samples < 2:
        return _LONGEST_S
    first, mean = times[1] - times[0], (times[samples - 1] - times[0]) / (samples - 1)
    least = _MIN_STEP * max(abs(times[0]), abs(times[samples - 1]), 1e-3)
    return max(mean if abs(mean - first) < 1e-9 * first else first, least)


@part
def stepper_of(system, record, swings, room, at):  # type: ignore[no-untyped-def]
    """Return a stepper cut from ``room``, and the position after it; ``swings`` as for ``march.in_closed_form``."""
    n, count, slots = system.numbers, system.which.size, system.slots.shape[0]
    rows, shown = count + 1, record.states.shape[1]
    every, at = cut_integers(room, at, (n + count,))
    for k in range(n):
        every[k] = -1
    for k in range(count):
        every[n + k] = system.which[k]
    z, at = cut(room, at, (2, n + 1, columns(rows)))
    z[0, n, 0] = z[1, n, 0] = 1.0
    now, at = cut_integers(room, at, (4,))
    now[CHECKED_BLOCK] = -1
    active, at = cut_integers(room, at, (1 + RANGE_0 + slots,))
    modes, at = cut(room, at, (_MODES, NEAR_0 + slots))
    plain, at = state_of(n + rows, n, room, at)
    work, at = room_of(n, count, room, at)
    kept, at = forms_of(_MODES, n, count, RANGE_0 + slots, shown, room, at)
    spacing = swings[4] if swings[4] > 0.0 else _spacing(record.times)
    return Propagator(swings, spacing, kept, modes, now, active, z, work, plain, every), at


def room_for(n: int, count: int, effects: int, shown: int) -> int:
    """Return the upper limit of the size of a stepper's arrays; ``shown`` is the number of outputs."""
    m, guards = n + 1, RANGE_0 + effects
    wide: int = columns.py_func(count + 1)
    form = m * m * (3 + 3 * wide) + 2 * m * (guards + shown) + m * wide + 4
    work = m * (5 * wide + 2) + m * m * (3 + 2 * wide)
    return _MODES * (form + NEAR_0 + effects) + work + (n + count + 1) * (2 * n + 4) + guards + 5
