"""What is watched along a motion, and what happens where it switches: shared by the two integrators with effects."""

import math

from numba import types

from analysis.model.phases import CONTACT, FREE, OVERLAPPED, PARTING
from analysis.model.rates import (
    DASH,
    MOVES,
    NEAR_0,
    PARTED,
    PLATE,
    RANGE_AT,
    SIGN,
    SLOT_PARAMETERS,
    SPRING,
    derivative_rates,
    state_rates,
    tight,
)

TURN = 90  # event kind: the block's velocity changes its sign
RANGE = 95  # plus slot: the bodies leave or enter the range of a force
WATCHED = 4  # xi, xi', F, v; then a range a slot
# The types of the integrators' arguments: each is compiled once, when it is imported.
_F = types.float64
VECTOR, MATRIX, CUBE = types.Array(_F, 1, "C"), types.Array(_F, 2, "C"), types.Array(_F, 3, "C")
INTEGERS = types.Array(types.int64, 1, "C")


@tight
def after_touch(times, samples):  # type: ignore[no-untyped-def]
    """Return the first of so many ascending times that is past the first touch, which is time zero."""
    split = 0
    while split < samples and times[split] <= 0.0:
        split += 1
    return split


@tight
def rates(z, out, rows, which, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect, told):  # type: ignore[no-untyped-def]
    """Write d/dt of the state and of its derivatives, and tell what is watched; return the block's inertia in kg."""
    mass = state_rates(z, out, p, slots, flags, real, s, values, effect, told)
    if rows > 1:
        derivative_rates(z, out, rows, which, p, slots, flags, carrying, cs, c_values, c_effect, told, mass)
    return mass


@tight
def expect(phase, variant, flags, slots, before_touch, expected):  # type: ignore[no-untyped-def]
    """Write which sign each watched quantity has in this phase; 0: not watched."""
    for i in range(expected.size):
        expected[i] = 0.0
    if not before_touch:
        expected[3] = flags[SIGN]
        if flags[PLATE] > 0.5:
            expected[0] = -1.0 if phase == FREE else 1.0
            if variant == 1 and phase == CONTACT:
                expected[1] = 1.0
            if phase == PARTING:
                expected[1] = -1.0
            if variant == 2 and phase == CONTACT:
                expected[0] = 0.0
                expected[2] = 1.0
            if phase == OVERLAPPED:
                expected[2] = -1.0
    for slot in range(slots.shape[0]):
        if slots[slot, RANGE_AT] >= 0.0 and phase == FREE:
            expected[4 + slot] = -1.0 if flags[NEAR_0 + slot] > 0.5 else 1.0


@tight
def set_phase(phase, flags):  # type: ignore[no-untyped-def]
    """Write the flags that go with a phase of the contact."""
    flags[SPRING] = 1.0 if phase in (CONTACT, PARTING) else 0.0
    flags[DASH] = 1.0 if phase == CONTACT else 0.0
    flags[PARTED] = 1.0 if phase == OVERLAPPED else 0.0


@tight
def switch(  # type: ignore[no-untyped-def]
    item, phase, t, forward, z, f, f_after, told, pair, pair_rate, pair_told, nothing, couple,
    rows, which, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect,
    events, event_time, event_kind, event_state, event_d_time, event_d_state,
):  # fmt: skip
    """Cross watched ``item`` at the state ``z``, whose rates ``f`` and ``told`` are: return the phase after it.

    Lets the derivatives jump by (f_before - f_after) dt/dtheta, and writes the event where the march is ``forward``.
    ``couple`` is two, of the type of ``rows``, so that one compiled kernel serves.
    """
    size = z.shape[1]
    slope = 1.0
    if rows > 1:  # how fast what is watched crosses: its derivative along the motion
        for c in range(size):
            pair[0, c] = z[0, c]
            pair[1, c] = f[0, c]
        rates(
            pair, pair_rate, couple, nothing, p, slots, flags, real, carrying,
            s, values, effect, cs, c_values, c_effect, pair_told,
        )  # fmt: skip
        slope = pair_told[1, item] if item < 3 else (f[0, 1] if item == 3 else -pair_told[1, 0])
    code = TURN if item == 3 else RANGE + item - 4
    before = phase
    if item == 0:
        phase = CONTACT if phase == FREE else FREE
    elif item == 1:
        phase = PARTING if phase == CONTACT else CONTACT
    elif item == 2:
        phase = OVERLAPPED if phase == CONTACT else CONTACT
    elif item == 3:
        flags[SIGN] = -flags[SIGN]
    else:
        flags[NEAR_0 + item - 4] = 1.0 - flags[NEAR_0 + item - 4]
    if item < 3:
        code = 10 * before + phase
        for slot in range(slots.shape[0]):
            if slots[slot, RANGE_AT] >= 0.0:
                flags[NEAR_0 + slot] = 1.0 if phase == FREE else 0.0
    set_phase(phase, flags)
    if rows > 1:
        rates(
            z, f_after, rows, which, p, slots, flags, real, carrying,
            s, values, effect, cs, c_values, c_effect, pair_told,
        )  # fmt: skip
    for j in range(1, rows):
        if item < 3:
            change = told[j, item]
        elif item == 3:
            change = z[j, 1]
        else:
            change = -told[j, 0]
            if which[j - 1] == SLOT_PARAMETERS + 3 * (item - 4) + int(slots[item - 4, RANGE_AT]):
                change -= 1.0
        moved = -change / slope
        if forward:
            event_d_time[events, j - 1] = moved
        for c in range(size):
            z[j, c] += (f[0, c] - f_after[0, c]) * moved
            if forward:
                event_d_state[events, j - 1, c] = z[j, c] + f_after[0, c] * moved
    if forward:
        event_time[events] = t
        event_kind[events] = code
        for c in range(size):
            event_state[events, c] = z[0, c]
    return phase


@tight
def gone(x, v, y, u, q, slots, flags, omega):  # type: ignore[no-untyped-def]
    """Return whether block and plate, apart, cannot meet again; ``q`` holds the hidden states (position, velocity)."""
    if not v > 0.0:
        return False
    reach = 2e-5 + 1.5 * (math.sqrt(y**2 + (u / omega) ** 2) if omega > 0.0 else abs(y))
    near = 0.0
    for slot in range(slots.shape[0]):
        if slots[slot, MOVES] != 0.0:
            reach += 3.0 * abs(q[2 * slot]) + abs(q[2 * slot + 1]) / 60.0
        near += flags[NEAR_0 + slot]
    return x > reach and near == 0.0 and (omega > 0.0 or u <= 0.0)
