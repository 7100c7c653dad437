"""d/dt of block, plate and the effects' hidden states, with its derivatives, at one instant of one mode (njit).

This is the one place where the base model's equations and the catalogue's functions meet: ``state_rates`` in real
numbers, for the motion, and ``rates``, which adds the derivatives by the parameters.  The base model's derivatives are
written out; those of the effects come from complex steps through their own functions, so that an effect is its
equation and nothing else.
"""

from analysis.model.effects.kernel import (
    BLOCK_MASS,
    CONTACT_STIFFNESS,
    FORCE,
    MASS,
    NEAR,
    ON_BLOCK,
    ON_PLATE,
    OUTPUTS,
    PAIR,
    PLATE_STIFFNESS,
    Q_RATE,
    SIGN_V,
    TOUCHING,
    W_RATE,
    XI,
    XI_RATE,
    Q,
    U,
    V,
    W,
    X,
    Y,
    call,
)
from analysis.model.modes import DASH, INSIDE, NEAR_0, PARTED, PLATE, SIGN, SPRING
from analysis.model.system import COUNT, FIRST, HIDDEN, IS_PAIR, MOVES, ON_PLATE_SIDE, RIDES, inlined, tight

_H = 1e-40  # the complex step: far below any rounding, far above the smallest number even squared with an exponent


@tight
def rates(state, rows, which, system, mode):  # type: ignore[no-untyped-def]
    """Write d/dt of a state and of ``rows - 1`` derivatives, and what is told there; return the block's inertia in kg.

    About 10 ns, and 15 ns an effect; a derivative 15 ns, and 20 ns for each effect in it.
    """
    mass = state_rates(state, system, mode)
    if rows > 1:
        derivative_rates(state, rows, which, system, mode, mass)
    return mass


@inlined
def _call(where, s, values, out):  # type: ignore[no-untyped-def]
    for i in range(OUTPUTS):
        out[i] = 0.0
    call(where, s, values, out)


@inlined
def _takes_part(slot, slots, flags):  # type: ignore[no-untyped-def]
    """Return whether an effect acts in this phase: before the touch the plate's and what rides inside do not."""
    if slots[slot, IS_PAIR] > 0.5:
        return flags[PLATE] > 0.5 or flags[NEAR_0 + slot] > 0.5
    if slots[slot, ON_PLATE_SIDE] > 0.5:
        return flags[PLATE] > 0.5
    return slots[slot, RIDES] < 0.5 or flags[INSIDE] > 0.5


@inlined
def state_rates(state, system, flags):  # type: ignore[no-untyped-def]
    """Write d/dt of the state alone and what is told there; return the block's inertia in kg."""
    z, out, told = state.z, state.f, state.told
    p, slots, s, values, effect = system.p, system.slots, system.s, system.values, system.effect
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
        s[X], s[V], s[Y], s[U] = x, v, y, u
        s[XI], s[XI_RATE] = xi, xi_rate
        s[SIGN_V] = flags[SIGN]
        s[TOUCHING] = touching
        s[PLATE_STIFFNESS], s[CONTACT_STIFFNESS], s[BLOCK_MASS] = p[0], p[2], p[7]
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
            s[FORCE] = 0.0 if pair else force
            s[Q], s[W] = z[0, at], z[0, at + 1]
            s[NEAR] = flags[NEAR_0 + slot]
            first = int(slots[slot, FIRST])
            for i in range(int(slots[slot, COUNT])):
                values[i] = p[first + i]
            _call(system.real[slot], s, values, effect)
            if pair:
                law += effect[PAIR]
                continue
            block += effect[ON_BLOCK]
            plate += effect[ON_PLATE]
            mass += effect[MASS]
            if hidden:
                out[0, at] = effect[Q_RATE]
                out[0, at + 1] = effect[W_RATE]
    told[0, 0], told[0, 1], told[0, 2] = xi, xi_rate, law
    out[0, 0], out[0, 1] = v, block / mass
    if flags[PLATE] > 0.5:
        out[0, 2], out[0, 3] = u, plate / p[1]
    else:
        out[0, 2], out[0, 3] = 0.0, 0.0
    return mass


@inlined
def _fill(slot, row, by, state, system, flags, force, d_force):  # type: ignore[no-untyped-def]
    """Lay out what an effect is given: the state in the real parts, its derivative of this row in the imaginary."""
    z, told, p, slots, s, values = state.z, state.told, system.p, system.slots, system.c_s, system.c_values
    at = 4 + 2 * slot if slots[slot, HIDDEN] > 0.0 else 0
    s[X] = complex(z[0, 0], _H * z[row, 0])
    s[V] = complex(z[0, 1], _H * z[row, 1])
    s[Y] = complex(z[0, 2], _H * z[row, 2])
    s[U] = complex(z[0, 3], _H * z[row, 3])
    s[XI] = complex(told[0, 0], _H * told[row, 0])
    s[XI_RATE] = complex(told[0, 1], _H * told[row, 1])
    s[FORCE] = complex(force, _H * d_force)
    s[Q] = complex(z[0, at], _H * z[row, at])
    s[W] = complex(z[0, at + 1], _H * z[row, at + 1])
    s[SIGN_V] = flags[SIGN]
    s[NEAR] = flags[NEAR_0 + slot]
    s[TOUCHING] = max(flags[SPRING], flags[PARTED])
    s[PLATE_STIFFNESS] = complex(p[0], _H if by == 0 else 0.0)
    s[CONTACT_STIFFNESS] = complex(p[2], _H if by == 2 else 0.0)
    s[BLOCK_MASS] = p[7]
    first = int(slots[slot, FIRST])
    for i in range(int(slots[slot, COUNT])):
        values[i] = complex(p[first + i], _H if by == first + i else 0.0)


@tight
def derivative_rates(state, rows, which, system, flags, mass):  # type: ignore[no-untyped-def]
    """Write d/dt of the derivatives and tell theirs, ``state_rates`` having gone before."""
    z, out, told = state.z, state.f, state.told
    p, slots, functions = system.p, system.slots, system.carrying
    s, values, effect = system.c_s, system.c_values, system.c_effect
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
                _fill(slot, row, by, state, system, flags, 0.0, 0.0)
                _call(functions[slot], s, values, effect)
                law += effect[PAIR].imag / _H
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
            _fill(slot, row, by, state, system, flags, force, d_force)
            _call(functions[slot], s, values, effect)
            d_block += effect[ON_BLOCK].imag / _H
            d_plate += effect[ON_PLATE].imag / _H
            d_mass += effect[MASS].imag / _H
            if hidden:
                out[row, at] = effect[Q_RATE].imag / _H
                out[row, at + 1] = effect[W_RATE].imag / _H
        out[row, 0] = z[row, 1]
        out[row, 1] = (d_block - out[0, 1] * d_mass) / mass
        if flags[PLATE] > 0.5:
            out[row, 2], out[row, 3] = z[row, 3], d_plate / p[1]
        else:
            out[row, 2], out[row, 3] = 0.0, 0.0
