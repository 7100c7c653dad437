"""What the solver's kernels (njit) hand to each other: one bundle for what moves, for where it is, for what it leaves.

Bundles of arrays cost a kernel nothing: compiled, they are the arrays.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects.kernel import OUTPUTS, STATES
from analysis.compiled.kernel_parts import part
from analysis.compiled.kernel_room import cut

Floats = NDArray[np.float64]
Integers = Any  # int64 arrays, which kernels take as Python passes them

SLOT_PARAMETERS = 8
# Columns of ``slots``: pair effect, hidden states, moves the contact, on the plate, rides inside, where its
# range stands in ``p`` (-1: none), where its parameters begin there, and where the rate stands at which its hidden
# state already changes when the bodies meet (-1: none).
IS_PAIR, HIDDEN, MOVES, ON_PLATE_SIDE, RIDES, RANGE_AT, FIRST, RATE_AT = 0, 1, 2, 3, 4, 5, 6, 7
SLOT_COLUMNS = 8
MAX_EVENTS = 400
STEPS_IN_ALL, STEPS_A_SAMPLE = 1e6, 10.0  # a march may take: a fifth of a second, where a usual one takes 1 ms
DONE, AT_A_GUARD, GONE, AWAY, ENDLESS = 0, 1, 2, 3, 4  # why a stepper stopped
TIME, LEFT_AT, STEPS_LEFT = 0, 1, 2  # of the clock


class System(NamedTuple):
    """A collision and its effects; ``p`` holds ``parameters.kernel_order``, then the parameters of each effect slot.

    ``slots``, shape (effects, 8), says how each acts; ``functions``, shape (2, effects), are the effects' addresses,
    compiled for real and for complex numbers; ``which`` are the places in ``p`` by which derivatives are taken.
    ``carried_p`` is ``p`` in complex numbers, ``told`` and ``carried`` what an effect is told, then what it answers.
    """

    p: Floats
    slots: Floats
    functions: Integers
    which: Integers
    variant: int
    numbers: int  # in a state: four of block and plate, two of each slot up to the last with a hidden state
    told: Floats
    carried_p: Any
    carried: Any


class State(NamedTuple):
    """A state with its rates: ``z`` and ``f``, shape (rows, size), and what is told there, shape (rows, 3).

    Row 0 of ``z`` is (x_b, v_b, x_p, v_p, q_0, w_0, q_1, w_1, ...), row j its derivative by ``which[j - 1]``; told are
    (xi, xi', force by the contact's law) and their derivatives.
    """

    z: Floats
    f: Floats
    told: Floats


class Motion(NamedTuple):
    """Where a march is: the state at the beginning of a step, the one tried for its end, and one to look aside.

    ``mode`` holds the flags of the mode, ``signs`` which sign each guard function has in it, ``ends`` what the guard
    functions and their rates are after a step, ``clock`` the time (that at which the plate was left to itself, and how
    many steps the march may still take); ``nothing`` is [-1]: derivatives by no parameter.
    """

    here: State
    there: State
    aside: State
    mode: Floats
    signs: Floats
    ends: Floats
    clock: Floats
    nothing: Integers


class Ahead(NamedTuple):
    """The next sample and the last, which way the march goes, and whether the next step is to be taken anyway."""

    i: int
    last: int
    forward: bool
    cleared: bool


class Record(NamedTuple):
    """What is asked and what comes of it: states, shape (m, 5 or more), at means over ``block`` of ``times``.

    (x_b, v_b, x_p, v_p, contact point, hidden states as far as there is room); derivatives of x_b, shape (m, k); every
    event's time, kind, state and mode, dt/dtheta and d(state at that event)/dtheta.
    """

    times: Floats
    block: int
    states: Floats
    d_x: Floats
    event_time: Floats
    event_kind: Integers
    event_state: Floats
    event_mode: Floats
    event_d_time: Floats
    event_d_state: Floats


def system_of(p: Floats, slots: Floats, functions: Integers, which: Integers, variant: int, numbers: int) -> System:
    """Return a system with room to ask its effects in."""
    room = np.zeros(STATES + OUTPUTS)
    return System(p, slots, functions, which, variant, numbers, room, p.astype(complex), room.astype(complex))


@part
def state_of(rows, size, room, at):  # type: ignore[no-untyped-def]
    """Return a state with its rates, cut from ``room``, and where that goes on."""
    z, at = cut(room, at, (rows, size))
    f, at = cut(room, at, (rows, size))
    told, at = cut(room, at, (rows, 3))
    return State(z, f, told), at


@part
def take(here, there, rows):  # type: ignore[no-untyped-def]
    """Make ``there`` the beginning of the next step."""
    for j in range(rows):
        for c in range(here.z.shape[1]):
            here.z[j, c], here.f[j, c] = there.z[j, c], there.f[j, c]
        for c in range(3):
            here.told[j, c] = there.told[j, c]
