"""The bundles of arrays that the solver's kernels pass to each other: system, state, motion and record."""

from typing import Any, NamedTuple

from analysis.collision.parameters import Floats
from analysis.compiled import cut, part

Integers = Any  # int64 arrays, which kernels take as Python passes them

SLOT_PARAMETERS = 8
# Columns of ``slots``: between the bodies, number of hidden states, factor by which the first of them moves the contact
# point, on the plate, rides with the block; then indices into ``p``: of its range (-1: none), of its first parameter,
# and of the rate of its hidden state when the bodies meet (-1: none).
IS_PAIR, HIDDEN, MOVES, ON_PLATE_SIDE, RIDES, RANGE_AT, FIRST, RATE_AT = 0, 1, 2, 3, 4, 5, 6, 7
SLOT_COLUMNS = 8
MAX_EVENTS = 400
MAX_STEPS, MAX_STEPS_PER_SAMPLE = 1e6, 10.0  # step limits: a fifth of a second, where a usual solution takes 1 ms
DONE, MAY_CONTAIN_EVENT, LEFT_FOR_GOOD, NOT_FINITE, STEP_LIMIT = 0, 1, 2, 3, 4  # why a stepper stopped
TIME, LEFT_AT, STEPS_LEFT = 0, 1, 2  # indices into ``clock``


class System(NamedTuple):
    """A collision and its effects; ``p`` holds ``parameters.KERNEL_ORDER``, then the parameters of each effect slot.

    ``slots``, shape (effects, 8), describe how each acts; ``functions``, shape (2, effects), are the addresses of the
    effects compiled for real and for complex numbers.  Derivatives are taken with respect to the parameters
    ``p[which]``.  ``p_complex`` is ``p`` in complex numbers; ``effect_input`` and ``effect_input_complex`` hold the
    inputs of an effect, followed by its outputs.
    """

    p: Floats
    slots: Floats
    functions: Integers
    which: Integers
    variant: int
    numbers: int  # length of a state: four for block and plate, two per slot up to the last with a hidden state
    effect_input: Floats
    p_complex: Any
    effect_input_complex: Any


class State(NamedTuple):
    """A state with its rates: ``z`` and ``f``, shape (rows, size), and its ``contact``, shape (rows, 3).

    Row 0 of ``z`` is (x_b, v_b, x_p, v_p, q_0, w_0, q_1, w_1, ...), row j d(row 0)/d(p[which[j - 1]]);
    ``contact`` is (xi, xi', force of the contact law) and their derivatives.
    """

    z: Floats
    f: Floats
    contact: Floats


class MotionState(NamedTuple):
    """The progress of a solution: the state at the start of a step, the one at its end, and one for other uses.

    ``mode`` are the flags of the mode, ``signs`` the signs of the guard functions in it, ``ends`` the guard functions
    and their rates after a step.  ``clock`` holds the time, the start time of the plate's free oscillation, and the
    number of steps left.  ``nothing`` is [-1]: no derivatives.  Its size is a 1 of the same type as other
    numbers of rows, so that a kernel is compiled once for all of them.
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
    """The next and the last sample, the direction in time, and whether guards are ignored in the next step."""

    i: int
    last: int
    forward: bool
    cleared: bool


class Record(NamedTuple):
    """The requested times and the solution: ``states``, shape (m, 5 or more), as means over ``block`` of ``times``.

    States are (x_b, v_b, x_p, v_p, contact point, hidden states if there are columns for them); ``d_x``, shape (m, k),
    are the derivatives of x_b.  Then every event's time, kind, state, mode and d(state at the event)/dtheta.
    """

    times: Floats
    block: int
    states: Floats
    d_x: Floats
    event_time: Floats
    event_kind: Integers
    event_state: Floats
    event_mode: Floats
    event_d_state: Floats


@part
def state_of(rows, size, room, at):  # type: ignore[no-untyped-def]
    """Return a state with its rates, cut from ``room``, and the position after it."""
    z, at = cut(room, at, (rows, size))
    f, at = cut(room, at, (rows, size))
    contact, at = cut(room, at, (rows, 3))
    return State(z, f, contact), at


@part
def copy_state(here, there, rows):  # type: ignore[no-untyped-def]
    """Copy ``there`` to ``here``, the start of the next step."""
    for j in range(rows):
        for c in range(here.z.shape[1]):
            here.z[j, c], here.f[j, c] = there.z[j, c], there.f[j, c]
        for c in range(3):
            here.contact[j, c] = there.contact[j, c]
