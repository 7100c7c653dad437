"""Solve the hybrid system of a collision from event to event, with all derivatives (kernels).

A mode ends when a guard function g passes zero.  There the derivatives of the state jump by
(f_before - f_after) dt/dtheta, dt/dtheta = -(dg/dtheta) / (dg/dt) (the saltation of a hybrid system; Leine and
Nijmeijer, "Dynamics and Bifurcations of Non-Smooth Mechanical Systems", ch. 7).

Within a mode a stepper solves the motion: ``propagator`` (closed form, if the equations are linear in the state) or
``runge_kutta``.  A stepper consists of a bundle of arrays, and of four functions in its file:

``begin_mode``  prepares for a mode that begins at the state ``here``; returns False if the stepper cannot solve it
``run``  steps from sample to sample; returns (next sample, length of a step that may contain an event, stop reason)
``step_to``  writes the state, its rates and its contact at a given time after the start of that step to ``there``
``write_samples``  writes the samples within that step up to a given time, and returns the next sample
"""

import math

from analysis.collision.solver import propagator, runge_kutta
from analysis.collision.solver.crossings import first_crossing
from analysis.collision.solver.modes import (
    CONTACT,
    FORCE,
    FREE,
    INNER_MASS,
    NEAR_0,
    OVERLAP,
    OVERLAP_RATE,
    OVERLAPPED,
    PARTING,
    PHASE,
    PLATE,
    RANGE_0,
    SIGN,
    VELOCITY,
    expected_signs,
    guard_derivative,
    range_at,
    set_phase,
)
from analysis.collision.solver.rates import rates
from analysis.collision.solver.system import (
    DONE,
    LEFT_AT,
    LEFT_FOR_GOOD,
    MAX_EVENTS,
    MAX_STEPS,
    MAX_STEPS_PER_SAMPLE,
    NOT_FINITE,
    RANGE_AT,
    RATE_AT,
    RIDES,
    STEP_LIMIT,
    STEPS_LEFT,
    TIME,
    Ahead,
    MotionState,
    Record,
    State,
    System,
    copy_state,
    state_of,
)
from analysis.compiled import by_address, cut, cut_integers, kernel, part

TOO_MANY_EVENTS, UNBOUNDED, NOT_LINEAR, NO_ROOM, TOO_MANY_STEPS = -1, -2, -3, -4, -5
# Kinds of event: ten times the phase of the contact before it, plus the one after; the block turns; the bodies leave or
# enter an effect's range (plus its slot).
TURN, RANGE = 90, 95


@part
def _change_mode(item, mode, slots):  # type: ignore[no-untyped-def]
    """Write the mode after a guard function has passed zero, and return the kind of the event."""
    phase = int(mode[PHASE])
    if item == VELOCITY:
        mode[SIGN] = -mode[SIGN]
        return TURN
    if item >= RANGE_0:
        mode[NEAR_0 + item - RANGE_0] = 1.0 - mode[NEAR_0 + item - RANGE_0]
        return RANGE + item - RANGE_0
    after = phase
    if item == OVERLAP:
        after = CONTACT if phase == FREE else FREE
    elif item == OVERLAP_RATE:
        after = PARTING if phase == CONTACT else CONTACT
    elif item == FORCE:
        after = OVERLAPPED if phase == CONTACT else CONTACT
    set_phase(after, mode)
    for slot in range(slots.shape[0]):  # an attraction acts while the bodies are apart
        if slots[slot, RANGE_AT] >= 0.0:
            mode[NEAR_0 + slot] = 1.0 if after == FREE else 0.0
    return 10 * phase + after


@part
def _process_event(item, rows, system, motion, record, event):  # type: ignore[no-untyped-def]
    """Process an event at ``here``, whose rates are known: change the mode and apply the jump of the derivatives."""
    here, aside, mode, which = motion.here, motion.aside, motion.mode, system.which
    size = here.z.shape[1]
    rate = 1.0
    if rows > 1:  # d/dt of the guard function: its derivative along the motion
        for c in range(size):
            aside.z[0, c], aside.z[1, c] = here.z[0, c], here.f[0, c]
        rates(aside, 1 + motion.nothing.size, motion.nothing, system, mode)
        rate = guard_derivative(item, 1, -1, aside, system)
    kind = _change_mode(item, mode, system.slots)
    for c in range(size):
        aside.z[0, c] = here.z[0, c]
    rates(aside, motion.nothing.size, which, system, mode)
    for j in range(1, rows):
        moved = -guard_derivative(item, j, which[j - 1], here, system) / rate
        for c in range(size):
            here.z[j, c] += (here.f[0, c] - aside.f[0, c]) * moved
            record.event_d_state[event, j - 1, c] = here.z[j, c] + aside.f[0, c] * moved
    _record_event(event, kind, motion, record)


@part
def _record_event(event, kind, motion, record):  # type: ignore[no-untyped-def]
    """Write an event at ``here`` to the record."""
    record.event_time[event] = motion.clock[TIME]
    record.event_kind[event] = kind
    for c in range(motion.here.z.shape[1]):
        record.event_state[event, c] = motion.here.z[0, c]
    for c in range(motion.mode.size):
        record.event_mode[event, c] = motion.mode[c]


@part
def _longest_range(system):  # type: ignore[no-untyped-def]
    """Return the longest range of an effect in m, and its slot; (0, -1) if no effect has a range."""
    p, slots = system.p, system.slots
    edge, attracts = 0.0, -1
    for slot in range(slots.shape[0]):
        if slots[slot, RANGE_AT] >= 0.0 and p[range_at(slot, slots)] > edge:
            edge, attracts = p[range_at(slot, slots)], slot
    return edge, attracts


@part
def _start(system, motion, forward):  # type: ignore[no-untyped-def]
    """Write the state and mode at which the interaction of the bodies begins; return the block's inertia in kg.

    It begins at the first touch, at time zero, or at the edge of the longest range of an effect.  The edge is passed
    earlier, by the time in which the block would reach the plate at its velocity there ("velocity in").
    """
    p, slots, which = system.p, system.slots, system.which
    here, aside, mode = motion.here, motion.aside, motion.mode
    rows, size = which.size + 1, here.z.shape[1]
    edge, attracts = _longest_range(system)
    for j in range(rows):
        for c in range(size):
            here.z[j, c] = 0.0
    here.z[0, 0], here.z[0, 1], here.z[0, 2], here.z[0, 3] = p[5] + edge, p[4], p[5], p[6]
    motion.clock[TIME] = motion.clock[LEFT_AT] = edge / p[4]
    for j in range(1, rows):
        by = which[j - 1]
        here.z[j, 0] = 1.0 if by == 5 or (attracts >= 0 and by == range_at(attracts, slots)) else 0.0
        here.z[j, 1] = 1.0 if by == 4 else 0.0
        here.z[j, 2] = 1.0 if by == 5 else 0.0
        here.z[j, 3] = 1.0 if by == 6 else 0.0
    for slot in range(slots.shape[0]):
        if slots[slot, RIDES] > 0.5:
            for j in range(rows):
                here.z[j, 4 + 2 * slot], here.z[j, 5 + 2 * slot] = here.z[j, 0], here.z[j, 1]
        if forward and slots[slot, RATE_AT] >= 0.0:
            here.z[0, 5 + 2 * slot] = p[int(slots[slot, RATE_AT])]
            for j in range(1, rows):
                here.z[j, 5 + 2 * slot] = 1.0 if which[j - 1] == int(slots[slot, RATE_AT]) else 0.0
    for c in range(mode.size):
        mode[c] = 0.0
    mode[SIGN] = -1.0
    set_phase(FREE, mode)
    if forward:
        mode[PLATE] = mode[INNER_MASS] = 1.0
        if attracts < 0:
            set_phase(CONTACT, mode)
        for slot in range(slots.shape[0]):
            if slots[slot, RANGE_AT] >= 0.0 and p[range_at(slot, slots)] >= edge:
                mode[NEAR_0 + slot] = 1.0
    for c in range(size):
        aside.z[0, c] = here.z[0, c]
    inertia = rates(aside, motion.nothing.size, which, system, mode)
    for j in range(1, rows if attracts >= 0 else 1):  # the time at the edge depends on range and velocity
        by = which[j - 1]
        moved = -edge / p[4] ** 2 if by == 4 else (1.0 / p[4] if by == range_at(attracts, slots) else 0.0)
        for c in range(size):
            here.z[j, c] -= aside.f[0, c] * moved
    return inertia


@part
def march(begin_mode, run, step_to, write_samples, stepper, system, motion, record):  # type: ignore[no-untyped-def]
    """Solve from the start of the interaction back to the first sample, then forward to the last.

    Returns the number of events, or TOO_MANY_EVENTS, UNBOUNDED, NOT_LINEAR, TOO_MANY_STEPS.
    """
    here, there, rows = motion.here, motion.there, system.which.size + 1
    samples = record.block * (record.times.size // record.block)
    begins, split = _longest_range(system)[0] / system.p[4], 0
    while split < samples and record.times[split] <= begins:
        split += 1
    events = 0
    motion.clock[STEPS_LEFT] = MAX_STEPS + MAX_STEPS_PER_SAMPLE * samples
    for way in range(0 if split > 0 else 1, 2):
        forward = way == 1
        if not _start(system, motion, forward) > 0.0:  # the hidden mass exceeds that of the block
            return UNBOUNDED
        if forward and motion.mode[PHASE] == CONTACT:
            for j in range(1, rows):
                for c in range(here.z.shape[1]):
                    record.event_d_state[0, j - 1, c] = here.z[j, c]
            _record_event(0, 10 * FREE + CONTACT, motion, record)
            events = 1
        i, last = (split, samples - 1) if forward else (split - 1, 0)
        fresh, cleared = True, False
        while True:
            if fresh:
                expected_signs(motion.mode, system.variant, system.slots, forward, motion.signs)
                if not begin_mode(stepper, system, motion, record, forward):
                    return NOT_LINEAR
            i, h, why = run(stepper, system, motion, record, Ahead(i, last, forward, cleared))
            fresh = cleared = False
            if why == DONE:
                break
            if why == NOT_FINITE:
                return UNBOUNDED
            if why == STEP_LIMIT:
                return TOO_MANY_STEPS
            if why == LEFT_FOR_GOOD:
                motion.mode[PLATE], motion.clock[LEFT_AT], fresh = 0.0, motion.clock[TIME], True
                continue
            item, when = first_crossing(step_to, stepper, system, motion, h)
            if item < 0:
                cleared = True
                continue
            if events >= MAX_EVENTS:
                return TOO_MANY_EVENTS
            step_to(stepper, system, motion, when, rows)
            if not math.isfinite(there.z[0, 0] + there.z[0, 1] + there.z[0, 3]):
                return UNBOUNDED
            i = write_samples(stepper, system, motion, record, i, when)
            copy_state(here, there, rows)
            motion.clock[TIME] += when
            _process_event(item, rows, system, motion, record, events)
            events += 1
            fresh = True
    return events


@part
def motion_of(here, effects, room, at):  # type: ignore[no-untyped-def]
    """Return the arrays of a solution with the state ``here``, cut from ``room``, and the position after them."""
    rows, size = here.z.shape
    there, at = state_of(rows, size, room, at)
    aside, at = state_of(max(rows, 2), size, room, at)
    mode, at = cut(room, at, (NEAR_0 + effects,))
    signs, at = cut(room, at, (RANGE_0 + effects,))
    ends, at = cut(room, at, (RANGE_0 + effects, 2))
    clock, at = cut(room, at, (3,))
    nothing, at = cut_integers(room, at, (1,))
    nothing[0] = -1
    return MotionState(here, there, aside, mode, signs, ends, clock, nothing), at


def room_for(system: System, record: Record) -> int:
    """Return the size of the workspace of a solution, for either stepper."""
    rows, size, effects = system.which.size + 1, record.event_state.shape[1], system.slots.shape[0]
    states: int = (3 * rows + 1) * (2 * size + 3) + NEAR_0 + 3 * (RANGE_0 + effects) + effects + 4
    closed = propagator.room_for(system.numbers, system.which.size, effects, record.states.shape[1])
    return states + max(closed, runge_kutta.room_for(rows, size))


@kernel
def in_closed_form(system, record, swings, room):  # type: ignore[no-untyped-def]
    """Solve in closed form at ``record.times`` (ascending, 0: first touch), in steps of any length.

    An incomplete last block is left out.  ``swings`` are those of ``Propagator``, then the spacing in s of most times
    (0.0: from the times); ``room`` holds ``room_for`` zeros.  Returns the number of events, TOO_MANY_EVENTS, UNBOUNDED,
    TOO_MANY_STEPS, or NOT_LINEAR if an effect is not linear.  60 ms at 100 kS/s take 0.1 ms for the two bodies alone,
    0.3 to 0.5 ms with effects, 1 to 2.5 ms with derivatives; in blocks of five the latter two take 0.2 ms and 0.4 to
    0.8 ms.
    """
    system, record = by_address(system), by_address(record)
    for row in range(record.states.shape[0] if record.block > 1 else 0):  # the sums start at zero
        for c in range(record.states.shape[1]):
            record.states[row, c] = 0.0
        for c in range(record.d_x.shape[1]):
            record.d_x[row, c] = 0.0
    here, at = state_of(system.which.size + 1, record.event_state.shape[1], room, 0)
    motion, at = motion_of(here, system.slots.shape[0], room, at)
    stepper, at = propagator.stepper_of(system, record, swings, room, at)
    if at > room.size:
        return NO_ROOM
    return march(
        propagator.begin_mode, propagator.run, propagator.step_to, propagator.write_samples,
        by_address(stepper), system, by_address(motion), record,
    )  # fmt: skip


@kernel
def step_by_step(system, record, limits, room):  # type: ignore[no-untyped-def]
    """Solve by Runge-Kutta steps at ``record.times`` (ascending, 0: first touch); ``limits`` as in ``RungeKutta``.

    ``room`` holds ``room_for`` zeros.  Returns the number of events, TOO_MANY_EVENTS, UNBOUNDED or TOO_MANY_STEPS.  60
    ms of motion take about 1.3 ms, and each derivative 1 ms more.
    """
    system, record = by_address(system), by_address(record)
    rows, size = system.which.size + 1, record.event_state.shape[1]
    stepper, at = runge_kutta.stepper_of(limits, rows, size, room, 0)
    here, at = state_of(rows, size, room, at)
    here = State(here.z, stepper.slopes[0], here.contact)
    motion, at = motion_of(here, system.slots.shape[0], room, at)
    if at > room.size:
        return NO_ROOM
    return march(
        runge_kutta.begin_mode, runge_kutta.run, runge_kutta.step_to, runge_kutta.write_samples,
        by_address(stepper), system, by_address(motion), record,
    )  # fmt: skip
