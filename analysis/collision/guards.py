"""Guard functions, whose change of sign ends a mode (kernels).

They are the overlap xi, its rate xi', the force of the contact law, the block's velocity, and for each effect with a
range the distance by which the bodies are within it.
"""

from analysis.collision.modes import CONTACT, FREE, NEAR_0, OVERLAPPED, PARTING, PHASE, PLATE, SIGN
from analysis.collision.system import MOVES, RANGE_AT
from analysis.compiled import inlined, part

OVERLAP, OVERLAP_RATE, FORCE, VELOCITY, RANGE_0 = 0, 1, 2, 3, 4  # RANGE_0 + slot
CLAMPED, NO_TENSION = 1, 2  # of ``parameters.Variant``


@part
def expected_signs(mode, variant, slots, forward, signs):  # type: ignore[no-untyped-def]
    """Write the sign of each guard function in a mode; 0: not watched, as all are before the touch."""
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
    """Return d/dt of a guard function; of the force only the part of spring and dashpot."""
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
    """Return a guard function's derivative by parameter ``by``, whose derivatives of the state are in ``row``."""
    if item < 3:
        return state.contact[row, item]
    if item == VELOCITY:
        return state.z[row, 1]
    return state.contact[row, 0] + (1.0 if by == range_at(item - RANGE_0, system.slots) else 0.0)


@inlined
def may_touch(value, rate, rate_there, h):  # type: ignore[no-untyped-def]
    """Return whether a guard function, positive at both ends of a step, may have been negative within it.

    The criterion is twice the depth of a parabola.
    """
    down, up = rate * h, rate_there * h
    return down < 0.0 < up and value < down * down / (up - down)
