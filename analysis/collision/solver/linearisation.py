"""Linearise a solved trajectory: steps with propagators, for the response to small forces and displacements.

A small change d of the state obeys d' = A(t) d + E(t) u, where u is the input of an effect: forces on block and plate,
a force between them, inertia, a displacement of the contact point and its rate.  A and E are exact derivatives of the
model's equations (``rates``).  E comes from two probe effects added to those of the fit, so that no equation is written
twice.  At an event d jumps as every derivative does (``march``).
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects.kernel import ON_BLOCK, ON_PLATE, PAIR, STATES
from analysis.collision.effects.row import Acts, Effect, Parameter
from analysis.collision.parameters import Collision, Floats, Infeasible
from analysis.collision.solver import general
from analysis.collision.solver.march import RANGE, TURN
from analysis.collision.solver.mechanical_effects import ActiveEffect, build_system, direction, fastest_rates
from analysis.collision.solver.modes import (
    FORCE,
    FREE,
    NEAR_0,
    OVERLAP,
    OVERLAP_RATE,
    PARTING,
    PHASE,
    PLATE,
    RANGE_0,
    SIGN,
    VELOCITY,
)
from analysis.collision.solver.path_matrices import INPUTS, NONE, Steps, write_matrices
from analysis.collision.solver.system import Integers, Record, State
from analysis.compiled import kernel

_SWING = 0.25  # largest phase step in rad
MAX_PIECES = 24


def _push(s: Any, p: Any, out: Any) -> None:
    """Push block and plate; p = (force in N, force in N).  The hidden state only displaces the contact point."""
    out[ON_BLOCK] += p[0]
    out[ON_PLATE] += p[1]


def _press(s: Any, p: Any, out: Any) -> None:
    """Push the two bodies apart; p = (force in N)."""
    out[PAIR] += p[0]


_TWO_FORCES = tuple(Parameter(name, "N", 0.0) for name in ("block", "plate"))
_PUSH = Effect("push", "", Acts.ON_BLOCK, _TWO_FORCES, "block", _push, hidden=2, shift=1.0)
_PRESS = Effect("press", "", Acts.IN_CONTACT, _TWO_FORCES[:1], "block", _press)


class LinearPath(NamedTuple):
    """The m steps of one shot, with states of n numbers: first those before the interaction, backwards, then the rest.

    ``length_s`` and ``sample`` (index of the sample at the end, or -1), shape (m,); ``early``: before the interaction;
    ``linked``: starts at the end of the previous step; ``propagator``, shape (m, n, n); ``weights`` of the inputs at
    start, middle and end, shape (m, 3, n, 6); ``effect_inputs``, shape (m, 3, 15), the arguments of an effect's
    function there.  ``event_jump``, shape (m, n), and ``event_gradient``, shape (m, n + 1): at its start the state
    jumps by ``event_jump`` times the product of ``event_gradient`` with the state and the displacement of the contact
    point.  A path for forces alone has no ``effect_inputs``, shape (0, 3, 15), and NaN as weights of the inertia.
    """

    length_s: Floats
    sample: Integers
    early: NDArray[np.bool_]
    linked: NDArray[np.bool_]
    propagator: Floats
    weights: Floats
    effect_inputs: Floats
    event_jump: Floats
    event_gradient: Floats

    @property
    def size(self) -> int:
        """Get the number of steps."""
        return int(self.length_s.size)


def linear_path(
    collision: Collision,
    active: Sequence[ActiveEffect],
    time_s: Floats,
    steps: int = 1,
    *,
    for_forces: bool = False,
) -> LinearPath:
    """Linearise a collision with ``active`` effects (those with hidden states first) at ``time_s`` from first touch.

    ``time_s`` is an even grid, with at least ``steps`` steps per sample.  ``for_forces``: the path carries
    given forces only, no effects under test.  If there are no ``active`` effects either, the matrices are constant
    within a mode, and states are needed at events only.  Takes about 2 us per step, then 0.5 us.  Raises Infeasible if
    too many steps are needed or the motion cannot be solved.
    """
    fastest = fastest_rates(collision, active)
    spacing = float(time_s[1] - time_s[0])
    apart = max(steps, math.ceil(max(fastest.plate, fastest.effects) * spacing / _SWING))
    pieces = apart * math.ceil(max(steps, max(fastest.contact, fastest.effects) * spacing / _SWING) / apart)
    if pieces > MAX_PIECES:
        raise Infeasible("an oscillation is too fast for the sampling of the record")
    # Without effects the block's turn is not an event.  For the effects under test it may be: a zero force adds it.
    acting = active or [ActiveEffect(_PRESS, (0.0,))]
    events = general.solve_with_modes(collision, acting, time_s)
    cut = _cut_at_events(events, time_s, (pieces, apart))
    if for_forces and not active:
        states = np.zeros((cut.event.size, 3, events.event_state.shape[1]))
        states[:, 0] = events.event_state[np.maximum(cut.event, 0)]
        return _with_matrices(collision, active, events, states, cut, for_forces=True)
    early = cut.event < 0
    apart_now = events.event_mode[cut.event, PHASE] == FREE
    halves = np.where(early, pieces, np.where(apart_now, pieces // apart, 1))
    instants, place = np.empty(2 * int(halves.sum()) + 1), np.empty(early.size, dtype=np.int64)
    _write_instants(cut.begin_s, cut.end_s, halves, int(early.sum()), instants, place)
    run = general.solve_with_modes(collision, acting, instants, spacing / (2 * pieces))
    way = np.where(early, -halves, halves)
    without_contact_point = np.delete(run.states, 4, axis=1)
    states = without_contact_point[place[:, None] + way[:, None] * np.arange(3)]
    return _with_matrices(collision, active, events, states, cut)


class _Cut(NamedTuple):
    """The steps of a path, mode by mode: start and end, the sample at the end or -1, the event that began the mode.

    Before the first event the index is -1.
    """

    begin_s: Floats
    end_s: Floats
    sample: Integers
    event: Integers


def _with_matrices(
    collision: Collision,
    active: Sequence[ActiveEffect],
    events: Record,
    states: Floats,
    cut: _Cut,
    *,
    for_forces: bool = False,
) -> LinearPath:
    """Return the path of these steps with ``states``, shape (m, 3, n); for forces alone, those at events suffice."""
    event, length_s = cut.event, cut.end_s - cut.begin_s
    early = event < 0
    hidden = sum(one.effect.hidden > 0 for one in active)
    probed = [*active[:hidden], ActiveEffect(_PUSH, (0.0, 0.0)), *active[hidden:], ActiveEffect(_PRESS, (0.0,))]
    n = 4 + 2 * hidden
    probes = [direction(hidden, 0), direction(hidden, 1), direction(len(probed) - 1, 0)]
    system = build_system(collision, probed, [*[-1] * (n + 2), *probes])
    slots = [slot + (slot >= hidden) for slot in range(len(active))]
    count, mode_of = event.size, np.zeros((events.event_time.size + 1, NEAR_0 + len(probed)))
    mode_of[:-1, :NEAR_0] = events.event_mode[:, :NEAR_0]
    mode_of[:-1, [NEAR_0 + slot for slot in slots]] = events.event_mode[:, NEAR_0 : NEAR_0 + len(active)]
    mode_of[:-1, PLATE] = 1.0  # here the plate is always integrated with the block
    mode_of[-1, SIGN] = -1.0  # the mode of the steps before the first event
    states[early, :, 2:] = states[np.argmin(early), 0, 2:] if not early.all() else 0.0  # as when the bodies meet
    fresh = np.diff(event, prepend=-2) != 0
    item = np.full(count, NONE)
    item[fresh] = [_guard_of(int(events.event_kind[e]), slots) if e > 0 else NONE for e in event[fresh]]
    path = LinearPath(
        length_s, cut.sample, early, ~fresh, np.empty((count, n, n)), np.empty((count, 3, n, INPUTS)),
        np.empty((0 if for_forces else count, 3, STATES)), np.zeros((count, n)), np.zeros((count, n + 1)),
    )  # fmt: skip
    size = 4 * ((n + 5) // 4)
    state, aside = (State(np.zeros((k, size)), np.zeros((k, size)), np.zeros((k, 3))) for k in (n + 6, 2))
    work = np.zeros((4, n, n)), np.zeros((3, n, INPUTS)), np.zeros((3, n, n))
    write_matrices(system, Steps(states, mode_of, event, item), path, state, aside, *work)
    return path


def _guard_of(kind: int, slots: Sequence[int]) -> int:
    """Return the guard function of a kind of event; ``slots`` are the effects' slots in the probed system."""
    if kind >= RANGE:
        return RANGE_0 + slots[kind - RANGE]
    if kind == TURN:
        return VELOCITY
    before, after = divmod(kind, 10)
    if FREE in (before, after):
        return OVERLAP
    return OVERLAP_RATE if PARTING in (before, after) else FORCE


def _cut_at_events(events: Record, time_s: Floats, each: tuple[int, int]) -> _Cut:
    """Return the steps to the samples and events; ``each``: steps per sample in contact and apart."""
    most = (time_s.size + events.event_time.size) * (max(each) + 1)
    begin, end = np.empty(most), np.empty(most)
    sample, event = np.full(most, -1), np.empty(most, dtype=np.int64)
    spacing = float(time_s[1] - time_s[0])
    whole = np.where(events.event_mode[:, PHASE] == FREE, spacing / each[1], spacing / each[0])
    count = _write_steps(np.ascontiguousarray(time_s), events.event_time, whole, begin, end, sample, event)
    return _Cut(begin[:count], end[:count], sample[:count], event[:count])


@kernel
def _write_steps(time_s, starts, whole, begin, end, sample, event):  # type: ignore[no-untyped-def]
    """Write the steps of ``_cut_at_events``, none longer than its mode's ``whole``, and return their number."""
    first, r, at = 0, 0, starts[0]
    while first < time_s.size and time_s[first] < starts[0] - 1e-13:
        first += 1
    for i in range(first - 1, -1, -1):
        begin[r], end[r], sample[r], event[r] = at, time_s[i], i, -1
        at = time_s[i]
        r += 1
    i = first
    while i < time_s.size and time_s[i] <= starts[0] + 1e-13:
        i += 1
    for mode in range(starts.size):
        at, last = starts[mode], mode == starts.size - 1
        done = last and i >= time_s.size
        while not done:
            if last or (i < time_s.size and time_s[i] < starts[mode + 1] - 1e-13):
                knot, met = time_s[i], i
            else:
                knot = starts[mode + 1]
                met = i if i < time_s.size and time_s[i] <= knot + 1e-13 else -1
            pieces = max(1, math.ceil((knot - at) / whole[mode] - 1e-6))
            for piece in range(pieces):
                begin[r] = at + (knot - at) * piece / pieces
                end[r] = at + (knot - at) * (piece + 1) / pieces if piece < pieces - 1 else knot
                event[r] = mode
                r += 1
            if met >= 0:
                sample[r - 1] = met
                i += 1
            at = knot
            done = i >= time_s.size if last else knot == starts[mode + 1]
    return r


@kernel
def _write_instants(begin, end, halves, early, instants, place):  # type: ignore[no-untyped-def]
    """Write the times in order, two for each of a step's ``halves``, and the index of each step's start.

    All lie on the grid of the shortest steps, on which the solver is fastest; the first ``early`` steps are reversed.
    """
    at = 0
    for k in range(begin.size):
        step = early - 1 - k if k < early else k
        low, high = begin[step], end[step]
        if k < early:
            low, high = high, low
        count = 2 * halves[step]
        for j in range(count):
            instants[at + j] = low + (high - low) * j / count
        place[step] = at + count if k < early else at
        at += count
        instants[at] = high
