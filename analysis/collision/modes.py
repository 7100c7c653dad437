"""The modes of a collision: phase of the contact, whether the plate takes part, direction of the block (kernels).

A mode is a row of flags, within which the equations are smooth; the guard functions in ``guards`` end it.
"""

import math

from analysis.collision.system import MOVES, RANGE_AT
from analysis.compiled import inlined, part

# PARTING: contact without its dashpot; OVERLAPPED: released, though the bodies still overlap
FREE, CONTACT, PARTING, OVERLAPPED = 0, 1, 2, 3
# Flags: spring and dashpot act, sign of the block's velocity, the plate takes part (not before the touch, nor after the
# block has gone), the mass inside the block moves, the contact law is evaluated without its force, the phase of the
# contact; then a flag for each effect: the bodies are within its range.
SPRING, DASH, SIGN, PLATE, INSIDE, PARTED, PHASE, NEAR_0 = 0, 1, 2, 3, 4, 5, 6, 7


@part
def set_phase(phase, mode):  # type: ignore[no-untyped-def]
    """Write the flags of a phase of the contact."""
    mode[PHASE] = phase
    mode[SPRING] = 1.0 if phase in (CONTACT, PARTING) else 0.0
    mode[DASH] = 1.0 if phase == CONTACT else 0.0
    mode[PARTED] = 1.0 if phase == OVERLAPPED else 0.0


@inlined
def may_be_gone(x, y, mode):  # type: ignore[no-untyped-def]
    """Return whether ``is_gone`` needs to be evaluated."""
    return mode[PHASE] == FREE and mode[PLATE] > 0.5 and x > 2e-5 + 1.5 * abs(y)


@part
def is_gone(z, mode, system, omega):  # type: ignore[no-untyped-def]
    """Return whether block and plate cannot meet again, for a state ``z`` and the plate's ``omega`` in rad/s."""
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
