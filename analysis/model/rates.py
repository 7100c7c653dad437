"""d/dt of block, plate and the effects' hidden states, with its derivatives, at one instant of one phase.

This is the one place where the base model's equations and the catalogue's functions meet: ``state_rates`` in real
numbers, for the motion, and ``rates``, which adds the derivatives by the parameters.  The base model's derivatives are
written out; those of the effects come from complex steps through their own functions, so that an effect is its
equation and nothing else.

State ``z``, shape (rows, size): row 0 is (x_b, v_b, x_p, v_p, q_0, w_0, q_1, w_1, ...), cut after the last slot
with a hidden state; row j is its derivative by the parameter ``which[j - 1]``.  Parameters ``p``: those of
``parameters.kernel_order``, then three of each effect slot.  ``slots``, shape (effects, 7): active, pair effect,
hidden states, moves the contact, on the plate, rides with the block, place of the range.  ``functions``: the
addresses of the compiled effects, one a slot.
"""

from typing import Any

import numpy as np
from numba import njit

from analysis.model.effects import kernel

SLOT_PARAMETERS = 8
ACTIVE, IS_PAIR, HIDDEN, MOVES, ON_PLATE_SIDE, RIDES, RANGE_AT = 0, 1, 2, 3, 4, 5, 6
SLOT_COLUMNS = 7
# What a phase is, as flags: spring and dashpot at work, sign of v, who takes part, overlapping yet parted.
SPRING, DASH, SIGN, PLATE, INSIDE, PARTED, NEAR_0 = 0, 1, 2, 3, 4, 5, 6  # NEAR_0 + slot: within that slot's range
_H = 1e-40  # the complex step: far below any rounding, far above the smallest number even squared with an exponent

_X, _V, _Y, _U = kernel.X, kernel.V, kernel.Y, kernel.U
_XI, _XI_RATE, _FORCE, _Q, _W = kernel.XI, kernel.XI_RATE, kernel.FORCE, kernel.Q, kernel.W
_SIGN_V, _NEAR, _TOUCHING = kernel.SIGN_V, kernel.NEAR, kernel.TOUCHING
_PLATE_STIFFNESS, _CONTACT_STIFFNESS = kernel.PLATE_STIFFNESS, kernel.CONTACT_STIFFNESS
_BLOCK_MASS = kernel.BLOCK_MASS
_OUT_BLOCK, _OUT_PLATE, _OUT_PAIR = kernel.ON_BLOCK, kernel.ON_PLATE, kernel.PAIR
_OUT_Q, _OUT_W, _OUT_MASS = kernel.Q_RATE, kernel.W_RATE, kernel.MASS


def tight(function: Any) -> Any:
    """Compile an inner kernel without reference counts, which cost more than its sums (it makes no arrays)."""
    options: Any = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}
    return njit(**options)(function)


def inlined(function: Any) -> Any:
    """Compile as ``tight`` does, into its callers: an array as an argument is seven, a call of eight arrays 20 ns."""
    options: Any = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False, "forceinline": True}
    return njit(**options)(function)


@inlined
def _call(slot, functions, s, values, out):  # type: ignore[no-untyped-def]
    for i in range(kernel.OUTPUTS):
        out[i] = 0.0
    kernel.call(functions[slot], s, values, out)


@inlined
def _takes_part(slot, slots, flags):  # type: ignore[no-untyped-def]
    """Return whether an effect acts in this phase: before the touch the plate's and what rides inside do not."""
    if slots[slot, IS_PAIR] > 0.5:
        return flags[PLATE] > 0.5 or flags[NEAR_0 + slot] > 0.5
    if slots[slot, ON_PLATE_SIDE] > 0.5:
        return flags[PLATE] > 0.5
    return slots[slot, RIDES] < 0.5 or flags[INSIDE] > 0.5


@inlined
def state_rates(z, out, p, slots, flags, functions, s, values, effect, told):  # type: ignore[no-untyped-def]
    """Write d/dt of the state to ``out[0]`` and (xi, xi', force by the contact's law) to ``told[0]``.

    Returns the block's inertia in kg.  About 10 ns, and 15 ns an effect.
    """
    x, v, y, u = z[0, 0], z[0, 1], z[0, 2], z[0, 3]
    xi, xi_rate = y - x, u - v
    for slot in range(slots.shape[0]):
        if slots[slot, MOVES] != 0.0:
            xi += slots[slot, MOVES] * z[0, 4 + 2 * slot]
            xi_rate += slots[slot, MOVES] * z[0, 5 + 2 * slot]
    # Overlapping yet parted (a contact that never pulls): the law is followed, but no force acts.
    parted = flags[PARTED] > 0.5
    touching = 1.0 if parted else flags[SPRING]
    dash = 1.0 if parted else flags[DASH]
    law = touching * (p[2] * xi + p[3] * dash * xi_rate)
    if slots.shape[0] > 0:
        s[_X], s[_V], s[_Y], s[_U] = x, v, y, u
        s[_XI], s[_XI_RATE] = xi, xi_rate
        s[_SIGN_V] = flags[SIGN]
        s[_TOUCHING] = touching
        s[_PLATE_STIFFNESS], s[_CONTACT_STIFFNESS], s[_BLOCK_MASS] = p[0], p[2], p[7]
    for side in range(2):  # those between the bodies first: the others are told the contact's whole force
        force = 0.0 if parted else law
        block, plate, mass = force, -force - p[0] * y, p[7]
        for slot in range(slots.shape[0]):
            pair = slots[slot, IS_PAIR] > 0.5
            hidden = slots[slot, HIDDEN] > 0.0
            at = 4 + 2 * slot if hidden else 0
            if side == 1 and hidden:
                out[0, at] = 0.0
                out[0, at + 1] = 0.0
            if pair != (side == 0) or not _takes_part(slot, slots, flags):
                continue
            s[_FORCE] = 0.0 if pair else force
            s[_Q], s[_W] = z[0, at], z[0, at + 1]
            s[_NEAR] = flags[NEAR_0 + slot]
            first = SLOT_PARAMETERS + 3 * slot
            values[0], values[1], values[2] = p[first], p[first + 1], p[first + 2]
            _call(slot, functions, s, values, effect)
            if pair:
                law += effect[_OUT_PAIR]
                continue
            block += effect[_OUT_BLOCK]
            plate += effect[_OUT_PLATE]
            mass += effect[_OUT_MASS]
            if hidden:
                out[0, at] = effect[_OUT_Q]
                out[0, at + 1] = effect[_OUT_W]
    told[0, 0], told[0, 1], told[0, 2] = xi, xi_rate, law
    out[0, 0], out[0, 1] = v, block / mass
    if flags[PLATE] > 0.5:
        out[0, 2], out[0, 3] = u, plate / p[1]
    else:
        out[0, 2], out[0, 3] = 0.0, 0.0
    return mass


@inlined
def _fill(s, values, z, row, by, p, slot, slots, flags, told, force, d_force):  # type: ignore[no-untyped-def]
    """Lay out what an effect is given: the state in the real parts, its derivative of this row in the imaginary."""
    at = 4 + 2 * slot if slots[slot, HIDDEN] > 0.0 else 0
    s[_X] = complex(z[0, 0], _H * z[row, 0])
    s[_V] = complex(z[0, 1], _H * z[row, 1])
    s[_Y] = complex(z[0, 2], _H * z[row, 2])
    s[_U] = complex(z[0, 3], _H * z[row, 3])
    s[_XI] = complex(told[0, 0], _H * told[row, 0])
    s[_XI_RATE] = complex(told[0, 1], _H * told[row, 1])
    s[_FORCE] = complex(force, _H * d_force)
    s[_Q] = complex(z[0, at], _H * z[row, at])
    s[_W] = complex(z[0, at + 1], _H * z[row, at + 1])
    s[_SIGN_V] = flags[SIGN]
    s[_NEAR] = flags[NEAR_0 + slot]
    s[_TOUCHING] = max(flags[SPRING], flags[PARTED])
    s[_PLATE_STIFFNESS] = complex(p[0], _H if by == 0 else 0.0)
    s[_CONTACT_STIFFNESS] = complex(p[2], _H if by == 2 else 0.0)
    s[_BLOCK_MASS] = p[7]
    first = SLOT_PARAMETERS + 3 * slot
    for i in range(3):
        values[i] = complex(p[first + i], _H if by == first + i else 0.0)


@tight
def derivative_rates(  # type: ignore[no-untyped-def]
    z, out, rows, which, p, slots, flags, functions, s, values, effect, told, mass
):
    """Write d/dt of the derivatives to ``out[1:]`` and tell theirs, ``state_rates`` having gone before.

    About 15 ns a derivative, and 20 ns for each effect in each of them.
    """
    k_n, g_n = p[2], p[3]
    parted = flags[PARTED] > 0.5
    touching = 1.0 if parted else flags[SPRING]
    dash = 1.0 if parted else flags[DASH]
    force = 0.0 if parted else told[0, 2]
    for row in range(1, rows):
        by = which[row - 1]
        d_xi = z[row, 2] - z[row, 0]
        d_rate = z[row, 3] - z[row, 1]
        for slot in range(slots.shape[0]):
            if slots[slot, MOVES] != 0.0:
                d_xi += slots[slot, MOVES] * z[row, 4 + 2 * slot]
                d_rate += slots[slot, MOVES] * z[row, 5 + 2 * slot]
        told[row, 0], told[row, 1] = d_xi, d_rate
        law = touching * (k_n * d_xi + g_n * dash * d_rate)
        if by == 2:
            law += touching * told[0, 0]
        elif by == 3:
            law += touching * dash * told[0, 1]
        for slot in range(slots.shape[0]):
            if slots[slot, IS_PAIR] > 0.5 and _takes_part(slot, slots, flags):
                _fill(s, values, z, row, by, p, slot, slots, flags, told, 0.0, 0.0)
                _call(slot, functions, s, values, effect)
                law += effect[_OUT_PAIR].imag / _H
        told[row, 2] = law
        d_force = 0.0 if parted else law
        d_block, d_plate, d_mass = d_force, -d_force - p[0] * z[row, 2], 0.0
        if by == 0:
            d_plate -= z[0, 2]
        elif by == 1:
            d_plate -= out[0, 3]
        for slot in range(slots.shape[0]):
            at = 4 + 2 * slot
            hidden = slots[slot, HIDDEN] > 0.0
            if hidden:
                out[row, at] = 0.0
                out[row, at + 1] = 0.0
            if slots[slot, IS_PAIR] > 0.5 or not _takes_part(slot, slots, flags):
                continue
            _fill(s, values, z, row, by, p, slot, slots, flags, told, force, d_force)
            _call(slot, functions, s, values, effect)
            d_block += effect[_OUT_BLOCK].imag / _H
            d_plate += effect[_OUT_PLATE].imag / _H
            d_mass += effect[_OUT_MASS].imag / _H
            if hidden:
                out[row, at] = effect[_OUT_Q].imag / _H
                out[row, at + 1] = effect[_OUT_W].imag / _H
        out[row, 0] = z[row, 1]
        out[row, 1] = (d_block - out[0, 1] * d_mass) / mass
        if flags[PLATE] > 0.5:
            out[row, 2], out[row, 3] = z[row, 3], d_plate / p[1]
        else:
            out[row, 2], out[row, 3] = 0.0, 0.0


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
