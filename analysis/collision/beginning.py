"""The state at which the two bodies begin to act on each other, from which the motion is solved both ways (kernels)."""

from analysis.collision.guards import range_at
from analysis.collision.modes import CONTACT, FREE, INSIDE, NEAR_0, PLATE, SIGN, set_phase
from analysis.collision.rates import rates
from analysis.collision.system import LEFT_AT, RANGE_AT, RATE_AT, RIDES, TIME
from analysis.compiled import part


@part
def start(system, motion, record, forward):  # type: ignore[no-untyped-def]
    """Write state and mode at which the two bodies begin to act on each other; return the block's inertia in kg.

    That is the first touch, at time zero, or the edge of the longest range of an effect, earlier by the time in which
    the block would reach the plate with its velocity there ("velocity in").
    """
    p, slots, which = system.p, system.slots, system.which
    here, aside, mode = motion.here, motion.aside, motion.mode
    rows, size = which.size + 1, here.z.shape[1]
    edge, attracts = 0.0, -1
    for slot in range(slots.shape[0]):
        if slots[slot, RANGE_AT] >= 0.0 and p[range_at(slot, slots)] > edge:
            edge, attracts = p[range_at(slot, slots)], slot
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
        mode[PLATE] = mode[INSIDE] = 1.0
        if attracts < 0:
            set_phase(CONTACT, mode)
        for slot in range(slots.shape[0]):
            if slots[slot, RANGE_AT] >= 0.0 and p[range_at(slot, slots)] >= edge:
                mode[NEAR_0 + slot] = 1.0
    for c in range(size):
        aside.z[0, c] = here.z[0, c]
    inertia = rates(aside, rows - rows + 1, which, system, mode)
    for j in range(1, rows if attracts >= 0 else 1):  # the time at the edge depends on range and velocity
        by = which[j - 1]
        moved = -edge / p[4] ** 2 if by == 4 else (1.0 / p[4] if by == range_at(attracts, slots) else 0.0)
        for c in range(size):
            here.z[j, c] -= aside.f[0, c] * moved
    return inertia


@part
def after_start(record, system):  # type: ignore[no-untyped-def]
    """Return the first sample after the time at which the solution begins."""
    edge = 0.0
    for slot in range(system.slots.shape[0]):
        if system.slots[slot, RANGE_AT] >= 0.0:
            edge = max(edge, system.p[range_at(slot, system.slots)])
    begins, split = edge / system.p[4], 0
    while split < record.times.size and record.times[split] <= begins:
        split += 1
    return split
