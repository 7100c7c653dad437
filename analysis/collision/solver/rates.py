"""The equations of motion: d/dt of block, plate and the effects' hidden states, with derivatives (kernels).

``state_rates`` evaluates them in real numbers; ``rates`` adds the derivatives with respect to the parameters.  Those of
the base model are written out.  Those of the effects come from complex steps through their functions, so that an effect
needs only its equation.
"""

from analysis.collision.effects.kernel import (
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
    STATES,
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
    call_within,
)
from analysis.collision.solver.modes import DASHPOT, INNER_MASS, NEAR_0, PARTED, PLATE, SIGN, SPRING
from analysis.collision.solver.system import FIRST, HIDDEN, IS_PAIR, MOVES, ON_PLATE_SIDE, RIDES
from analysis.compiled import inlined, part

# The complex step: far below rounding, and far above the smallest float even when raised to a power.  A power of two is
# exact, and its inverse, too: a division takes four times as long as a product.
_H, _PER_H = 2.0**-133, 2.0**133


@part
def rates(state, rows, which, system, mode):  # type: ignore[no-untyped-def]
    """Write d/dt of a state and of ``rows - 1`` derivatives, and their contact; return the block's inertia in kg.

    Takes about 10 ns plus 15 ns per effect, and for each derivative 15 ns plus 20 ns per effect.
    """
    mass = state_rates(state, system, mode)
    if rows > 1:
        derivative_rates(state, rows, which, system, mode, mass)
    return mass


@inlined
def call_effect(where, s, p, first):  # type: ignore[no-untyped-def]
    """Call the effect at an address, whose parameters begin at ``p[first]``; its outputs follow its inputs in ``s``."""
    for i in range(STATES, STATES + OUTPUTS):
        s[i] = 0.0
    call_within(where, s, p, first)


@inlined
def _takes_part(slot, slots, flags):  # type: ignore[no-untyped-def]
    """Return whether an effect acts in this mode; before the touch, effects on the plate or inside the block do not."""
    if slots[slot, IS_PAIR] > 0.5:
        return flags[PLATE] > 0.5 or flags[NEAR_0 + slot] > 0.5
    if slots[slot, ON_PLATE_SIDE] > 0.5:
        return flags[PLATE] > 0.5
    return slots[slot, RIDES] == 0.0 or flags[INNER_MASS] > 0.5


@inlined
def state_rates(state, system, flags):  # type: ignore[no-untyped-def]
    """Write d/dt of the state alone, and its contact; return the block's inertia in kg."""
    z, out, contact = state.z, state.f, state.contact
    p, slots, s, functions = system.p, system.slots, system.effect_input, system.functions[0]
    x, v, y, u = z[0, 0], z[0, 1], z[0, 2], z[0, 3]
    xi, xi_rate = y - x, u - v
    for slot in range(slots.shape[0]):
        if slots[slot, MOVES] != 0.0:
            xi += slots[slot, MOVES] * z[0, 4 + 2 * slot]
            xi_rate += slots[slot, MOVES] * z[0, 5 + 2 * slot]
    # released while the bodies overlap (a contact that never pulls): the law is evaluated, but no force acts
    parted = flags[PARTED] > 0.5
    touching = 1.0 if parted else flags[SPRING]
    dash = 1.0 if parted else flags[DASHPOT]
    law = touching * (p[2] * xi + p[3] * dash * xi_rate)
    if slots.shape[0] > 0:
        s[X], s[V], s[Y], s[U] = x, v, y, u
        s[XI], s[XI_RATE] = xi, xi_rate
        s[SIGN_V] = flags[SIGN]
        s[TOUCHING] = touching
        s[PLATE_STIFFNESS], s[CONTACT_STIFFNESS], s[BLOCK_MASS] = p[0], p[2], p[7]
    for side in range(2):  # effects between the bodies first: the contact force is an input of the others
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
            call_effect(functions[slot], s, p, int(slots[slot, FIRST]))
            if pair:
                law += s[STATES + PAIR]
                continue
            block += s[STATES + ON_BLOCK]
            plate += s[STATES + ON_PLATE]
            mass += s[STATES + MASS]
            if hidden:
                out[0, at] = s[STATES + Q_RATE]
                out[0, at + 1] = s[STATES + W_RATE]
    contact[0, 0], contact[0, 1], contact[0, 2] = xi, xi_rate, law
    out[0, 0], out[0, 1] = v, block / mass
    if flags[PLATE] > 0.5:
        out[0, 2], out[0, 3] = u, plate / p[1]
    else:
        out[0, 2], out[0, 3] = 0.0, 0.0
    return mass


@inlined
def _fill(row, state, system, flags):  # type: ignore[no-untyped-def]
    """Write the inputs of all effects: the state as real parts, its derivative of this row as imaginary parts."""
    z, contact, p, s = state.z, state.contact, system.p_complex, system.effect_input_complex
    s[X] = complex(z[0, 0], _H * z[row, 0])
    s[V] = complex(z[0, 1], _H * z[row, 1])
    s[Y] = complex(z[0, 2], _H * z[row, 2])
    s[U] = complex(z[0, 3], _H * z[row, 3])
    s[XI] = complex(contact[0, 0], _H * contact[row, 0])
    s[XI_RATE] = complex(contact[0, 1], _H * contact[row, 1])
    s[SIGN_V] = flags[SIGN]
    s[TOUCHING] = max(flags[SPRING], flags[PARTED])
    s[PLATE_STIFFNESS], s[CONTACT_STIFFNESS], s[BLOCK_MASS] = p[0], p[2], p[7]


@inlined
def _call_effect_derivative(slot, row, state, system, flags, force):  # type: ignore[no-untyped-def]
    """Call an effect for its derivative of this row."""
    z, slots, s = state.z, system.slots, system.effect_input_complex
    at = 4 + 2 * slot if slots[slot, HIDDEN] > 0.0 else 0
    s[FORCE] = force
    s[Q] = complex(z[0, at], _H * z[row, at])
    s[W] = complex(z[0, at + 1], _H * z[row, at + 1])
    s[NEAR] = flags[NEAR_0 + slot]
    call_effect(system.functions[1, slot], s, system.p_complex, int(slots[slot, FIRST]))


@part
def derivative_rates(state, rows, which, system, flags, mass):  # type: ignore[no-untyped-def]
    """Write d/dt of the derivatives and those of the contact, after ``state_rates``."""
    z, out, contact = state.z, state.f, state.contact
    p, slots, p_complex, answer = system.p, system.slots, system.p_complex, system.effect_input_complex
    k_n, g_n = p[2], p[3]
    parted = flags[PARTED] > 0.5
    touching = 1.0 if parted else flags[SPRING]
    dash = 1.0 if parted else flags[DASHPOT]
    force = 0.0 if parted else contact[0, 2]
    for row in range(1, rows):
        by = which[row - 1]
        d_xi = z[row, 2] - z[row, 0]
        d_rate = z[row, 3] - z[row, 1]
        for slot in range(slots.shape[0]):
            if slots[slot, MOVES] != 0.0:
                d_xi += slots[slot, MOVES] * z[row, 4 + 2 * slot]
                d_rate += slots[slot, MOVES] * z[row, 5 + 2 * slot]
        contact[row, 0], contact[row, 1] = d_xi, d_rate
        if slots.shape[0] > 0:
            if by >= 0:
                p_complex[by] = complex(p[by], _H)
            _fill(row, state, system, flags)
        law = touching * (k_n * d_xi + g_n * dash * d_rate)
        if by == 2:
            law += touching * contact[0, 0]
        elif by == 3:
            law += touching * dash * contact[0, 1]
        for slot in range(slots.shape[0]):
            if slots[slot, IS_PAIR] > 0.5 and _takes_part(slot, slots, flags):
                _call_effect_derivative(slot, row, state, system, flags, complex(0.0, 0.0))
                law += answer[STATES + PAIR].imag * _PER_H
        contact[row, 2] = law
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
            _call_effect_derivative(slot, row, state, system, flags, complex(force, _H * d_force))
            d_block += answer[STATES + ON_BLOCK].imag * _PER_H
            d_plate += answer[STATES + ON_PLATE].imag * _PER_H
            d_mass += answer[STATES + MASS].imag * _PER_H
            if hidden:
                out[row, at] = answer[STATES + Q_RATE].imag * _PER_H
                out[row, at + 1] = answer[STATES + W_RATE].imag * _PER_H
        if by >= 0:
            p_complex[by] = p[by]
        out[row, 0] = z[row, 1]
        out[row, 1] = (d_block - out[0, 1] * d_mass) / mass
        if flags[PLATE] > 0.5:
            out[row, 2], out[row, 3] = z[row, 3], d_plate / p[1]
        else:
            out[row, 2], out[row, 3] = 0.0, 0.0
