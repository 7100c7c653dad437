"""d/dt of block, plate and the effects' hidden states, with its derivatives, at one instant of one phase.

The base model's derivatives are written out; those of the effects come from complex steps through their own
functions, so that an effect is its equation and nothing else.

State ``z``, shape (rows, size): row 0 is (x_b, v_b, x_p, v_p, q_0, w_0, q_1, w_1, q_2, w_2), cut after the last slot
with a hidden state; row j is its derivative by the parameter ``which[j - 1]``.  Parameters ``p``, shape (17,): those of
``parameters.kernel_order``, then three of each of three effect slots.  ``slots``, shape (effects, 7): active, pair
effect, hidden states, moves the contact, on the plate, rides with the block, place of the range.
"""

import numpy as np
from numba import njit

from analysis.model.effects import kernel

LARGEST = 10
PARAMETERS = 17
SLOT_PARAMETERS = 8
ACTIVE, IS_PAIR, HIDDEN, MOVES, ON_PLATE_SIDE, RIDES, RANGE_AT = 0, 1, 2, 3, 4, 5, 6
SLOT_COLUMNS = 7
# What a phase is, as flags: spring and dashpot at work, sign of v, and who takes part.
SPRING, DASH, SIGN, PLATE, INSIDE, NEAR_0 = 0, 1, 2, 3, 4, 5  # NEAR_0 + slot: within that slot's range
PARTED = 8
FLAGS = 9
_H = 1e-40  # the complex step: far below any rounding, far above the smallest number even squared with an exponent

_X, _V, _Y, _U = kernel.X, kernel.V, kernel.Y, kernel.U
_XI, _XI_RATE, _FORCE, _Q, _W = kernel.XI, kernel.XI_RATE, kernel.FORCE, kernel.Q, kernel.W
_SIGN_V, _NEAR, _TOUCHING = kernel.SIGN_V, kernel.NEAR, kernel.TOUCHING
_PLATE_STIFFNESS, _CONTACT_STIFFNESS = kernel.PLATE_STIFFNESS, kernel.CONTACT_STIFFNESS
_BLOCK_MASS = kernel.BLOCK_MASS
_OUT_BLOCK, _OUT_PLATE, _OUT_PAIR = kernel.ON_BLOCK, kernel.ON_PLATE, kernel.PAIR
_OUT_Q, _OUT_W, _OUT_MASS = kernel.Q_RATE, kernel.W_RATE, kernel.MASS


@njit(cache=True, nogil=True, error_model="numpy")
def _call(slot, f0, f1, f2, s, values, out):  # type: ignore[no-untyped-def]
    for i in range(kernel.OUTPUTS):
        out[i] = 0.0
    if slot == 0:
        f0(s, values, out)
    elif slot == 1:
        f1(s, values, out)
    else:
        f2(s, values, out)


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(s, values, z, row, which, p, slot, slots, flags, xi, xi_rate, force, d_xi, d_xi_rate, d_force):  # type: ignore[no-untyped-def]
    """Lay out what an effect is given: the state in the real parts, its derivative of this row in the imaginary."""
    h = _H if row > 0 else 0.0
    at = 4 + 2 * slot if slots[slot, HIDDEN] > 0.0 else 0
    s[_X] = complex(z[0, 0], h * z[row, 0])
    s[_V] = complex(z[0, 1], h * z[row, 1])
    s[_Y] = complex(z[0, 2], h * z[row, 2])
    s[_U] = complex(z[0, 3], h * z[row, 3])
    s[_XI] = complex(xi, h * d_xi)
    s[_XI_RATE] = complex(xi_rate, h * d_xi_rate)
    s[_FORCE] = complex(force, h * d_force)
    s[_Q] = complex(z[0, at], h * z[row, at])
    s[_W] = complex(z[0, at + 1], h * z[row, at + 1])
    s[_SIGN_V] = flags[SIGN]
    s[_NEAR] = flags[NEAR_0 + slot]
    s[_TOUCHING] = max(flags[SPRING], flags[PARTED])
    s[_PLATE_STIFFNESS] = complex(p[0], h if which == 0 else 0.0)
    s[_CONTACT_STIFFNESS] = complex(p[2], h if which == 2 else 0.0)
    s[_BLOCK_MASS] = p[7]
    first = SLOT_PARAMETERS + 3 * slot
    for i in range(3):
        values[i] = complex(p[first + i], h if which == first + i else 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def rates(z, out, rows, which, p, slots, flags, f0, f1, f2, s, values, effect, told):  # type: ignore[no-untyped-def]
    """Write d/dt of ``z`` to ``out``; tell (xi, xi', force by the contact's law) of every row in ``told``.

    About 40 ns for the state, 30 ns a derivative, and 15 ns for each effect in each of them.
    """
    k_p, m_p, k_n, g_n, m_b = p[0], p[1], p[2], p[3], p[7]
    # Overlapping yet parted (a contact that never pulls): the law is followed, but no force acts.
    parted = flags[PARTED] > 0.5
    touching = 1.0 if parted else flags[SPRING]
    dash = 1.0 if parted else flags[DASH]
    plate = flags[PLATE] > 0.5
    inside = flags[INSIDE] > 0.5
    xi = xi_rate = force = 0.0
    mass = m_b
    per_plate = 1.0 / m_p
    for row in range(rows):
        by = which[row - 1] if row > 0 else -1
        # The overlap, of the contact point that some effects move.
        d_xi = z[row, 2] - z[row, 0]
        d_rate = z[row, 3] - z[row, 1]
        for slot in range(slots.shape[0]):
            if slots[slot, MOVES] != 0.0:
                d_xi += slots[slot, MOVES] * z[row, 4 + 2 * slot]
                d_rate += slots[slot, MOVES] * z[row, 5 + 2 * slot]
        law = touching * (k_n * d_xi + g_n * dash * d_rate)
        if row == 0:
            xi, xi_rate = d_xi, d_rate
        elif by == 2:
            law += touching * xi
        elif by == 3:
            law += touching * dash * xi_rate
        for slot in range(slots.shape[0]):
            if slots[slot, IS_PAIR] > 0.5 and (plate or flags[NEAR_0 + slot] > 0.5):
                _fill(s, values, z, row, by, p, slot, slots, flags, xi, xi_rate, 0.0, d_xi, d_rate, 0.0)
                _call(slot, f0, f1, f2, s, values, effect)
                law += effect[_OUT_PAIR].imag / _H if row > 0 else effect[_OUT_PAIR].real
        d_force = 0.0 if parted else law
        if row == 0:
            force = d_force
        told[row, 0], told[row, 1], told[row, 2] = d_xi, d_rate, law
        d_block, d_plate, d_mass = d_force, -d_force - k_p * z[row, 2], 0.0
        if by == 0:
            d_plate -= z[0, 2]
        for slot in range(slots.shape[0]):
            hidden = slots[slot, HIDDEN] > 0.0
            at = 4 + 2 * slot
            if hidden:
                out[row, at] = 0.0
                out[row, at + 1] = 0.0
            if slots[slot, IS_PAIR] > 0.5:
                continue
            if slots[slot, ON_PLATE_SIDE] > 0.5 and not plate:
                continue
            if slots[slot, RIDES] > 0.5 and not inside:
                continue
            _fill(s, values, z, row, by, p, slot, slots, flags, xi, xi_rate, force, d_xi, d_rate, d_force)
            _call(slot, f0, f1, f2, s, values, effect)
            if row > 0:
                for i in range(kernel.OUTPUTS):
                    effect[i] = effect[i].imag / _H
            d_block += effect[_OUT_BLOCK].real
            d_plate += effect[_OUT_PLATE].real
            d_mass += effect[_OUT_MASS].real
            if hidden:
                out[row, at] = effect[_OUT_Q].real
                out[row, at + 1] = effect[_OUT_W].real
        out[row, 0] = z[row, 1]
        out[row, 2] = z[row, 3]
        if row == 0:
            mass = m_b + d_mass
            out[0, 1] = d_block / mass
            out[0, 3] = d_plate * per_plate
        else:
            out[row, 1] = (d_block - out[0, 1] * d_mass) / mass
            out[row, 3] = (d_plate - (out[0, 3] if by == 1 else 0.0)) * per_plate
        if not plate:
            out[row, 2] = 0.0
            out[row, 3] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def cooper_verner():  # type: ignore[no-untyped-def]
    """Return (a, b) of the explicit Runge-Kutta method of order 8 in 11 stages, shapes (11, 11) and (11,).

    G. J. Cooper and J. H. Verner, SIAM J. Numer. Anal. 9 (1972) 389.  Closed form in sqrt(21).
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
    b = np.zeros(11)
    b[0], b[7], b[8], b[9], b[10] = 1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20
    return a, b
