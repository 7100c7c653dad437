"""The modes of a collision, and the guard functions whose change of sign ends a mode (kernels).

A mode is a row of flags, within which the equations are smooth: the phase of the contact, whether the plate takes part,
the direction of the block.
"""

import math

from analysis.collision.solver.system import MOVES, RANGE_AT
from analysis.compiled import inlined, part

# PARTING: contact without its dashpot; OVERLAPPED: released, though the bodies still overlap
FREE, CONTACT, PARTING, OVERLAPPED = 0, 1, 2, 3
# Flags: spring and dashpot act, sign of the block's velocity, the plate takes part (not before the touch, nor after the
# block has left), the mass inside the block moves, the contact law is evaluated without its force, the phase of the
# contact; then a flag for each effect: the bodies are within its range.
SPRING, DASHPOT, SIGN, PLATE, INNER_MASS, PARTED, PHASE, NEAR_0 = 0, 1, 2, 3, 4, 5, 6, 7
# Guard functions: the overlap xi, its rate xi', the force of the contact law, the block's velocity, and for each effect
# with a range the distance by which the bodies are within it (RANGE_0 + slot).
OVERLAP, OVERLAP_RATE, FORCE, VELOCITY, RANGE_0 = 0, 1, 2, 3, 4
CLAMPED, NO_TENSION = 1, 2  # of ``parameters.Variant``


@part
def set_phase(phase, mode):  # type: ignore[no-untyped-def]
    """Write the flags of a phase of the contact."""
    mode[PHASE] = phase
    mode[SPRING] = 1.0 if phase in (CONTACT, PARTING) else 0.0
    mode[DASHPOT] = 1.0 if phase == CONTACT else 0.0
    mode[PARTED] = 1.0 if phase == OVERLAPPED else 0.0


@inlined
def rate_at(mode, forward):  # type: ignore[no-untyped-def]
    """Return the index of a mode's fastest rate: in contact, apart, after the block has left, before the touch."""
    if not forward:
        return 3
    return 0 if mode[PHASE] != FREE else (1 if mode[PLATE] > 0.5 else 2)


@inlined
def may_have_left_for_good(x, y, mode):  # type: ignore[no-untyped-def]
    """Return whether ``has_left_for_good`` needs to be evaluated."""
    return mode[PHASE] == FREE and mode[PLATE] > 0.5 and x > 2e-5 + 1.5 * abs(y)


@part
def has_left_for_good(z, mode, system, omega):  # type: ignore[no-untyped-def]
    """Return whether block and plate can no longer meet, for a state ``z`` and the plate's ``omega`` in rad/s."""
    x, v, y, u = z[0], z[1], z[2], z[3]
    if not v > 0.0:
        return False
    reach = 2e-5 + 1.5 * (math.sqrt(y**2 + (u / omega) ** 2) if omega > 0.0 else abs(y))
    near, slots = 0.0, system.slots
    for slot in range(slots.shape[0]):
        if slots[slot, MOVES] != 0.0:
            reach += 3.0 * abs(z[4 + 2 * slot]) + abs(z[5 + 2 * slot]) / 60.0
        near += mode[NEAR_0 + slot]
        if slots[slot, RANGE_AT] >= 0.0:
            reach += system.p[int(slots[slot, RANGE_AT])]
    return x > reach and near == 0.0 and (omega > 0.0 or u <= 0.0)


@part
def expected_signs(mode, variant, slots, forward, signs):  # type: ignore[no-untyped-def]
    """Write the sign of each guard function in a mode; 0: not monitored, which holds for all before the touch."""
    phase = int(mode[PHASE])
    for i in range(signs.size):
        signs[i] = 0.0
    if not forward:
        return
    if slots.shape[0] > 0:  # without effects the direction of the block does not matter
        signs[VELOCITY] = mode[SIGN]
    if mode[PLATE] > 0.5:
        signs[OVERLAP] = -1.0 if phase == FREE else 1.0
        if variant == CLAMPED and phase == CONTACT:
            signs[OVERLAP_RATE] = 1.0
        if phase == PARTING:
            signs[OVERLAP_RATE] = -1.0
        if variant == NO_TENSION and phase == CONTACT:
            signs[OVERLAP] = 0.0
            signs[FORCE] = 1.0
        if phase == OVERLAPPED:
            signs[FORCE] = -1.0
    for slot in range(slots.shape[0]):
        if slots[slot, RANGE_AT] >= 0.0 and phase == FREE:
            signs[RANGE_0 + slot] = 1.0 if mode[NEAR_0 + slot] > 0.5 else -1.0


@inlined
def range_at(slot, slots):  # type: ignore[no-untyped-def]
    """Return the index in ``p`` of an effect's range."""
    return int(slots[slot, RANGE_AT])


@inlined
def guard(item, state, system):  # type: ignore[no-untyped-def]
    """Return the value of a guard function at a state whose rates are known."""
    if item < 3:
        return state.contact[0, item]
    if item == VELOCITY:
        return state.z[0, 1]
    return state.contact[0, 0] + system.p[range_at(item - RANGE_0, system.slots)]


@inlined
def guard_rate(item, state, system):  # type: ignore[no-untyped-def]
    """Return d/dt of a guard function; for the force, only the part of spring and dashpot."""
    if item == VELOCITY:
        return state.f[0, 1]
    if item == OVERLAP or item > VELOCITY:
        return state.contact[0, 1]
    second = state.f[0, 3] - state.f[0, 1]
    for slot in range(system.slots.shape[0]):
        if system.slots[slot, MOVES] != 0.0:
            second += system.slots[slot, MOVES] * state.f[0, 5 + 2 * slot]
    return second if item == OVERLAP_RATE else system.p[2] * state.contact[0, 1] + system.p[3] * second


@part
def guard_derivative(item, row, by, state, system):  # type: ignore[no-untyped-def]
    """Return a guard function's derivative with respect to parameter ``by``; ``row`` holds those of the state."""
    if item < 3:
        return state.contact[row, item]
    if item == VELOCITY:
        return state.z[row, 1]
    return state.contact[row, 0] + (1.0 if by == range_at(item - RANGE_0, system.slots) else 0.0)


@inlined
def may_touch(value, rate, rate_there, h):  # type: ignore[no-untyped-def]
    """Return whether a guard function, positive at both ends of a step, may have been negative within it.

    The criterion: ``value`` is below twice the depth of a parabola with these rates.
    """
    down, up = rate * h, rate_there * h
    return down < 0.0 < up and value < down * down / (up - down)
