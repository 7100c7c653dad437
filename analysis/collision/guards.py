"""Guard functions: what ends a mode when it changes its sign (njit).

The overlap xi, its rate xi', the force of the contact's law, the block's velocity, and for each effect with a range how
far inside it the bodies are.
"""

from analysis.collision.modes import CONTACT, FREE, NEAR_0, OVERLAPPED, PARTING, PHASE, PLATE, SIGN
from analysis.collision.system import MOVES, RANGE_AT
from analysis.compiled.kernel_parts import inlined, part

OVERLAP, OVERLAP_RATE, FORCE, VELOCITY, RANGE_0 = 0, 1, 2, 3, 4  # RANGE_0 + slot
CLAMPED, NO_TENSION = 1, 2  # of ``parameters.Variant``


@part
def expected_signs(mode, variant, slots, forward, signs):  # type: ignore[no-untyped-def]
    """Write which sign each guard function has in a mode; 0: not watched.  Before the touch nothing is."""
    phase = int(mode[PHASE])
    for i in range(signs.size):
        signs[i] = 0.0
    if not forward:
        return
    if slots.shape[0] > 0:  # two bodies alone do not care which way the block goes
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
    """Return where in ``p`` an effect's range stands."""
    return int(slots[slot, RANGE_AT])


@inlined
def guard(item, state, system):  # type: ignore[no-untyped-def]
    """Return a guard function at a state whose rates are known."""
    if item < 3:
        return state.told[0, item]
    if item == VELOCITY:
        return state.z[0, 1]
    return state.told[0, 0] + system.p[range_at(item - RANGE_0, system.slots)]


@inlined
def guard_rate(item, state, system):  # type: ignore[no-untyped-def]
    """Return d/dt of a guard function; of the force only as far as spring and dashpot make it."""
    if item == VELOCITY:
        return state.f[0, 1]
    if item == OVERLAP or item > VELOCITY:
        return state.told[0, 1]
    second = state.f[0, 3] - state.f[0, 1]
    for slot in range(system.slots.shape[0]):
        if system.slots[slot, MOVES] != 0.0:
            second += system.slots[slot, MOVES] * state.f[0, 5 + 2 * slot]
    return second if item == OVERLAP_RATE else system.p[2] * state.told[0, 1] + system.p[3] * second


@part
def guard_derivative(item, row, by, state, system):  # type: ignore[no-untyped-def]
    """Return a guard function's derivative in a row of a state's derivatives, taken by parameter ``by``."""
    if item < 3:
        return state.told[row, item]
    if item == VELOCITY:
        return state.z[row, 1]
    return state.told[row, 0] + (1.0 if by == range_at(item - RANGE_0, system.slots) else 0.0)


@inlined
def may_touch(value, rate, rate_there, h):  # type: ignore[no-untyped-def]
    """Return whether a guard function, positive at both ends of a step, may have passed zero in it.

    Twice as far as a parabola goes.
    """
    down, up = rate * h, rate_there * h
    return down < 0.0 < up and value < down * down / (up - down)
