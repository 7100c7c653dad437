"""A solved trajectory cut into steps, each with its propagator: what a small force or shift on the way leads to.

About a trajectory that is solved, a small change d of the state obeys d' = A(t) d + E(t) u, u being what an effect
adds: forces on block and plate, a force between them, inertia, a moved contact point and its rate.  A and E are the
exact derivatives of the model's own equations (``rates``), E by two probes laid out beside the effects that the fit
has, so that no equation is written a second time.  Where a mode ends, d jumps as every derivative does (``march``).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.kernel_bundle import held
from analysis.kernel_parts import inlined, kernel, part
from analysis.kernel_room import cut
from analysis.model import general
from analysis.model.effects.kernel import NEAR, ON_BLOCK, ON_PLATE, PAIR, STATES, Q, W
from analysis.model.effects.row import Acts, Effect, Parameter
from analysis.model.general import RunsAway, TooManyEvents
from analysis.model.guards import FORCE, OVERLAP, OVERLAP_RATE, RANGE_0, VELOCITY, guard_derivative
from analysis.model.least_squares import Infeasible
from analysis.model.march import RANGE, TURN
from analysis.model.modes import FREE, NEAR_0, PARTING, PHASE, PLATE, SIGN
from analysis.model.parameters import Collision, Floats
from analysis.model.rates import rates
from analysis.model.slots import Active, direction, lay_out, swings
from analysis.model.system import state_of

Places = NDArray[np.int64]
# What a small effect can do: forces in N on block, on plate and between them, kg on the block, m and m/s of the contact
# point.
INPUTS = 6
_INERTIA = 3
_STILL, _HELD = 1e-5, 16  # share by which A may change over a step and still be held for so many more
_ROUNDING = 1e-12  # of a row's largest number
_SWING = 0.25  # radians a step may take
MOST_PIECES = 24
_NONE, _FRESH = -1, -2  # where a step begins: as the one before ended, or anew; otherwise the guard function passed


def _push(s: Any, p: Any, out: Any) -> None:
    """Push block and plate; p = (force in N, force in N).  Its hidden state moves the contact point alone."""
    out[ON_BLOCK] += p[0]
    out[ON_PLATE] += p[1]


def _press(s: Any, p: Any, out: Any) -> None:
    """Push the two bodies apart; p = (force in N)."""
    out[PAIR] += p[0]


_TWO = tuple(Parameter(name, "N", 0.0) for name in ("block", "plate"))
_PUSH = Effect("push", "", Acts.ON_BLOCK, _TWO, "block", _push, hidden=2, shift=1.0)
_PRESS = Effect("press", "", Acts.IN_CONTACT, _TWO[:1], "block", _press)


@dataclass(frozen=True, slots=True)
class LinearPath:
    """Steps of one shot, the m_0 before the bodies act on each other going backwards, then forwards; n numbers a state.

    ``length_s`` and ``sample`` (index of the sample at the end, or -1), shape (m,); ``early``: before the bodies act;
    ``linked``: begins as the step before it ended; ``propagator``, shape (m, n, n); ``weights`` of the inputs at
    begin, middle and end, shape (m, 3, n, 6); ``told``, shape (m, 3, 15), what an effect's function is given there;
    ``kick``, shape (m, n), and ``watch``, shape (m, n + 1): at the beginning the state jumps by kick times (watch of
    state and moved contact point).
    """

    length_s: Floats
    sample: Places
    early: NDArray[np.bool_]
    linked: NDArray[np.bool_]
    propagator: Floats
    weights: Floats
    told: Floats
    kick: Floats
    watch: Floats

    @property
    def size(self) -> int:
        """Get the number of steps."""
        return int(self.length_s.size)


class _Steps(NamedTuple):
    """Steps: states at begin, middle and end, shape (m, 3, n), lengths, and the guard function they begin at.

    The mode of a step is ``modes[event]``, the last before the first event (-1).
    """

    states: Floats
    modes: Floats
    event: Places
    length_s: Floats
    item: Places


class _Matrices(NamedTuple):
    """What the kernel writes of every step (see ``LinearPath``)."""

    propagator: Floats
    weights: Floats
    told: Floats
    kick: Floats
    watch: Floats


def linear_path(collision: Collision, active: Sequence[Active], time_s: Floats, steps: int = 1) -> LinearPath:
    """Follow a collision with ``active`` effects (those with hidden states first) over ``time_s`` from first touch.

    ``time_s`` is an even grid; at least ``steps`` of them a sample.  About 1 us a step.  Raises Infeasible where the
    steps would be too many or the motion has no end.
    """
    fastest = swings(collision, active)
    spacing = float(time_s[1] - time_s[0])
    apart = max(steps, math.ceil(max(fastest.plate, fastest.every) * spacing / _SWING))
    pieces = apart * math.ceil(max(steps, max(fastest.contact, fastest.every) * spacing / _SWING) / apart)
    if pieces > MOST_PIECES:
        raise Infeasible("something would swing faster than any record can show")
    # Two bodies alone do not care where the block turns; what is tried on them may.
    acting = active or [Active(_PRESS, (0.0,))]
    try:
        events = general.recorded(collision, acting, time_s)
        begin, end, sample, event = _cut(events, time_s, (pieces, apart))
        early = event < 0
        apart_now = events.modes[event, PHASE] == FREE
        halves = np.where(early, pieces, np.where(apart_now, pieces // apart, 1))
        instants, place = np.empty(2 * int(halves.sum()) + 1), np.empty(begin.size, dtype=np.int64)
        _lay_instants(begin, end, halves, int(early.sum()), instants, place)
        run = general.recorded(collision, acting, instants, spacing / (2 * pieces))
    except (TooManyEvents, RunsAway) as why:
        raise Infeasible(str(why)) from why
    way = np.where(early, -halves, halves)
    states = run.states[place[:, None] + way[:, None] * np.arange(3)]
    return _with_matrices(collision, active, events, states, (begin, end, sample, event))


def _cut(events: general.Recorded, time_s: Floats, each: tuple[int, int]) -> tuple[Floats, Floats, Places, Places]:
    """Return (begin, end, sample at the end or -1, event that the mode began with or -1) of steps, mode by mode.

    ``each``: steps a sample in contact and apart.
    """
    most = (time_s.size + events.time_s.size) * (max(each) + 1)
    begin, end = np.empty(most), np.empty(most)
    sample, event = np.full(most, -1), np.empty(most, dtype=np.int64)
    spacing = float(time_s[1] - time_s[0])
    whole = np.where(events.modes[:, PHASE] == FREE, spacing / each[1], spacing / each[0])
    count = _lay_steps(np.ascontiguousarray(time_s), events.time_s, whole, begin, end, sample, event)
    return begin[:count], end[:count], sample[:count], event[:count]


@kernel
def _lay_steps(time_s, starts, whole, begin, end, sample, event):  # type: ignore[no-untyped-def]
    """Write the steps of ``_cut``, no longer than ``whole`` of their mode, and return their number."""
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
def _lay_instants(begin, end, halves, early, instants, place):  # type: ignore[no-untyped-def]
    """Write the instants, twice ``halves`` a step, in order, and where among them each step begins.

    All lie on the grid of the shortest steps, on which the solver is quickest; the ``early`` ones from the last on.
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


def _with_matrices(
    collision: Collision,
    active: Sequence[Active],
    events: general.Recorded,
    states: Floats,
    steps: tuple[Floats, Floats, Places, Places],
) -> LinearPath:
    """Return the path of steps (begin, end, sample, event); ``states``, shape (m, 3, n), are those of each."""
    begin, end, sample, event = steps
    early = event < 0
    hidden = sum(one.effect.hidden > 0 for one in active)
    beside = [*active[:hidden], Active(_PUSH, (0.0, 0.0)), *active[hidden:], Active(_PRESS, (0.0,))]
    n = 4 + 2 * hidden
    probes = [direction(hidden, 0), direction(hidden, 1), direction(len(beside) - 1, 0)]
    system = lay_out(collision, beside, [*[-1] * (n + 2), *probes])
    slots = [slot + (slot >= hidden) for slot in range(len(active))]
    count, mode_of = begin.size, np.zeros((events.time_s.size + 1, NEAR_0 + len(beside)))
    mode_of[:-1, :NEAR_0] = events.modes[:, :NEAR_0]
    mode_of[:-1, [NEAR_0 + slot for slot in slots]] = events.modes[:, NEAR_0 : NEAR_0 + len(active)]
    mode_of[:-1, PLATE] = 1.0  # never left to itself: nothing is saved by it here
    mode_of[-1, SIGN] = -1.0  # of those before the first event
    states[early, :, 2:] = states[np.argmin(early), 0, 2:] if not early.all() else 0.0  # not met yet
    fresh = np.diff(event, prepend=-2) != 0
    item = np.full(count, _NONE)
    item[fresh] = [_guard_of(int(events.kinds[e]), slots) if e > 0 else _FRESH for e in event[fresh]]
    out = _Matrices(
        np.empty((count, n, n)), np.empty((count, 3, n, INPUTS)), np.empty((count, 3, STATES)),
        np.zeros((count, n)), np.zeros((count, n + 1)),
    )  # fmt: skip
    room = np.zeros(_room_for(n))
    written = _write(system, _Steps(states, mode_of, event, end - begin, item), out, room)
    assert written
    return LinearPath(end - begin, sample, early, ~fresh, *out)


def _guard_of(kind: int, slots: Sequence[int]) -> int:
    """Return the guard function that an event of a kind passed, ``slots`` being where the effects stand now."""
    if kind >= RANGE:
        return RANGE_0 + slots[kind - RANGE]
    if kind == TURN:
        return VELOCITY
    before, after = divmod(kind, 10)
    if FREE in (before, after):
        return OVERLAP
    return OVERLAP_RATE if PARTING in (before, after) else FORCE


@inlined
def _inertia(state, z, one, system, mode, e):  # type: ignore[no-untyped-def]
    """Write what inertia does at a state, -v'/m to v', and let ``system.told`` tell that state."""
    for i in range(z.size):
        state.z[0, i] = z[i]
    mass = rates(state, one, system.which, system, mode)
    e[1, _INERTIA] = -state.f[0, 1] / mass


@part
def _look(state, z, rows, system, mode, a, e):  # type: ignore[no-untyped-def]
    """Write A (n, n) and E (n, 6) at a state."""
    n = a.shape[0]
    for i in range(n):
        state.z[0, i] = z[i]
    mass = rates(state, rows, system.which, system, mode)
    for i in range(n):
        for j in range(n):
            a[i, j] = state.f[1 + j, i]
        for j in range(2):
            e[i, 4 + j] = state.f[1 + n + j, i]
        for j in range(3):
            e[i, j] = state.f[3 + n + j, i]
        e[i, _INERTIA] = 0.0
    e[1, _INERTIA] = -state.f[0, 1] / mass


@inlined
def _tell(system, given):  # type: ignore[no-untyped-def]
    """Write what an effect is given at the state that was looked at last."""
    for i in range(STATES):
        given[i] = system.told[i]
    given[Q] = given[W] = given[NEAR] = 0.0


@part
def _alike(one, two):  # type: ignore[no-untyped-def]
    """Return whether two matrices are the same but for what a step may change."""
    for i in range(one.shape[0]):
        size = 0.0
        for j in range(one.shape[1]):
            size = max(size, abs(one[i, j]))
        for j in range(one.shape[1]):
            inertia = one.shape[1] == INPUTS and j == _INERTIA  # known at every point
            if not inertia and abs(one[i, j] - two[i, j]) > _STILL * abs(one[i, j]) + _ROUNDING * size:
                return False
    return True


@part
def _propagate(a0, a1, a2, h, out, work, term):  # type: ignore[no-untyped-def]
    """Write the propagator over ``h`` by the classical Runge-Kutta method, A given at begin, middle and end."""
    n = a0.shape[0]
    for i in range(n):
        for j in range(n):
            term[i, j] = a0[i, j]
            out[i, j] = (1.0 if i == j else 0.0) + h / 6.0 * term[i, j]
    for stage in range(3):
        a = a2 if stage == 2 else a1
        by = h if stage == 2 else 0.5 * h
        for i in range(n):
            for j in range(n):
                total = a[i, j]
                for m in range(n):
                    total += by * a[i, m] * term[m, j]
                work[i, j] = total
        for i in range(n):
            for j in range(n):
                term[i, j] = work[i, j]
                out[i, j] += (h / 6.0 if stage == 2 else h / 3.0) * term[i, j]


@part
def _jump(r, state, aside, system, steps, kick, watch):  # type: ignore[no-untyped-def]
    """Write how the state jumps where a step begins with a guard function passed."""
    item, n, size = steps.item[r], kick.size, state.z.shape[1]
    for i in range(n):
        state.z[0, i] = steps.states[r, 0, i]
    rates(state, n + 2, system.which, system, steps.modes[steps.event[r - 1]])
    for j in range(n + 1):
        watch[j] = guard_derivative(item, 1 + j, -1, state, system)
    for c in range(size):
        aside.z[0, c], aside.z[1, c] = state.z[0, c], state.f[0, c]
    rates(aside, n - n + 2, system.which, system, steps.modes[steps.event[r - 1]])
    pace = guard_derivative(item, n - n + 1, -1, aside, system)
    rates(aside, n - n + 1, system.which, system, steps.modes[steps.event[r]])
    for j in range(n):
        kick[j] = -(state.f[0, j] - aside.f[0, j]) / pace


def _room_for(n: int) -> int:
    """Return how many numbers the arrays of ``_write`` take at most, n being those of a state."""
    return (n + 8) * (2 * (n + 6) + 3) + 7 * n * n + 3 * n * INPUTS


@kernel
def _write(system, steps, out, room):  # type: ignore[no-untyped-def]
    """Write the matrices of every step and return whether there was room; about 1 us each, less where they stand still.

    Where A and E stood still over a step (most effects are linear within a mode) they are looked at again _HELD later.
    ``room`` is ``_room_for`` zeros.
    """
    system, steps, out = held(system), held(steps), held(out)
    n, size = out.propagator.shape[1], 4 * ((out.propagator.shape[1] + 5) // 4)
    rows = n + 6
    one = rows - rows + 1
    state, at = state_of(rows, size, room, 0)
    aside, at = state_of(2, size, room, at)
    state, aside = held(state), held(aside)
    for j in range(n + 2):
        state.z[1 + j, j] = 1.0
    a, at = cut(room, at, (4, n, n))  # at begin, middle, end; at three quarters
    e, at = cut(room, at, (3, n, INPUTS))
    half, at = cut(room, at, (n, n))
    square, at = cut(room, at, (n, n))
    term, at = cut(room, at, (n, n))
    if at > room.size:
        return False
    hold, resting = 0, False
    for r in range(steps.length_s.size):
        linked, length, mode = steps.item[r] == _NONE, steps.length_s[r], steps.modes[steps.event[r]]
        if steps.item[r] >= 0:
            _jump(r, state, aside, system, steps, out.kick[r], out.watch[r])
        if not linked:
            _look(state, steps.states[r, 0], rows, system, mode, a[0], e[0])
            _tell(system, out.told[r, 0])
            hold, resting = 0, False
        rested, resting = resting, hold > 0
        same = rested and resting  # A and E are those of the step before, but for the inertia's column
        if linked:
            if same:
                e[0, 1, _INERTIA] = e[2, 1, _INERTIA]
            else:
                _put(a[2], a[0])
                _put(e[2], e[0])
            for j in range(STATES):
                out.told[r, 0, j] = out.told[r - 1, 2, j]
        if resting:
            hold -= 1
            if not same:
                _put(a[0], a[2])
                _put(e[0], e[2])
        if resting:
            _inertia(state, steps.states[r, 2], one, system, mode, e[2])
        else:
            _look(state, steps.states[r, 2], rows, system, mode, a[2], e[2])
        _tell(system, out.told[r, 2])
        if not resting and _alike(a[0], a[2]) and _alike(e[0], e[2]):
            hold = _HELD
        still = resting or hold == _HELD
        if still and not same:
            _put(a[0], a[1])
            _put(e[0], e[1])
        if still:
            _inertia(state, steps.states[r, 1], one, system, mode, e[1])
        else:
            _look(state, steps.states[r, 1], rows, system, mode, a[1], e[1])
        _tell(system, out.told[r, 1])
        if same and abs(length - steps.length_s[r - 1]) < 1e-9 * abs(length):
            _weigh_again(r, length, e, half, out)
            continue
        for j in range(n):
            for m in range(n):
                a[3, j, m] = 0.375 * a[2, j, m] + 0.75 * a[1, j, m] - 0.125 * a[0, j, m]  # on a parabola
        _propagate(a[0], a[1], a[2], length, out.propagator[r], square, term)
        _propagate(a[1], a[3], a[2], 0.5 * length, half, square, term)
        for j in range(n):
            for m in range(INPUTS):
                begin, mid = 0.0, 0.0
                for q in range(n):
                    begin += out.propagator[r, j, q] * e[0, q, m]
                    mid += half[j, q] * e[1, q, m]
                out.weights[r, 0, j, m] = length / 6.0 * begin
                out.weights[r, 1, j, m] = length / 1.5 * mid
                out.weights[r, 2, j, m] = length / 6.0 * e[2, j, m]
    return True


@part
def _put(one, to):  # type: ignore[no-untyped-def]
    for i in range(one.shape[0]):
        for j in range(one.shape[1]):
            to[i, j] = one[i, j]


@part
def _weigh_again(r, at, e, half, out):  # type: ignore[no-untyped-def]
    """Write a step's matrices where only what inertia does differs from the step before."""
    n = half.shape[0]
    _put(out.propagator[r - 1], out.propagator[r])
    for point in range(3):
        _put(out.weights[r - 1, point], out.weights[r, point])
    for j in range(n):
        out.weights[r, 0, j, _INERTIA] = at / 6.0 * out.propagator[r, j, 1] * e[0, 1, _INERTIA]
        out.weights[r, 1, j, _INERTIA] = at / 1.5 * half[j, 1] * e[1, 1, _INERTIA]
        out.weights[r, 2, j, _INERTIA] = at / 6.0 * e[2, j, _INERTIA]
