"""A solved trajectory cut into steps, each with its propagator: what a small force or shift on the way leads to.

About a trajectory that is solved, a small change d of the state obeys d' = A(t) d + E(t) u, u being what an effect
adds: forces on block and plate, a force between them, inertia, a moved contact point and its rate.  A and E are the
exact derivatives of the model's own equations (``rates``), E by two probes laid out beside the effects that the fit
has, so that no equation is written a second time.  Where a mode ends, d jumps as every derivative does (``march``).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.model import general
from analysis.model.effects import kernel
from analysis.model.effects.row import Acts, Effect, Parameter
from analysis.model.general import RunsAway, TooManyEvents
from analysis.model.guards import FORCE, OVERLAP, OVERLAP_RATE, RANGE_0, VELOCITY, guard_derivative
from analysis.model.least_squares import Infeasible
from analysis.model.march import RANGE, TURN
from analysis.model.modes import FREE, NEAR_0, PARTING, PHASE, PLATE, SIGN
from analysis.model.parameters import Collision, Floats
from analysis.model.rates import rates
from analysis.model.slots import Active, direction, lay_out, swings
from analysis.model.system import state_of, tight

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
    out[kernel.ON_BLOCK] += p[0]
    out[kernel.ON_PLATE] += p[1]


def _press(s: Any, p: Any, out: Any) -> None:
    """Push the two bodies apart; p = (force in N)."""
    out[kernel.PAIR] += p[0]


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
    """Steps: states at begin, middle and end, shape (m, 3, n), modes, lengths, and the guard function they begin at."""

    states: Floats
    modes: Floats
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
        events = general.recorded(collision, acting, np.array([max(float(time_s[-1]), 0.0)]))
        cut = list(_cut(events, time_s, (pieces, apart)))
        begin, end, sample, event, early = (np.concatenate(parts) for parts in zip(*cut, strict=True))
        middle = 0.5 * (begin + end)
        # Between the steps of the modes in which they are longer lie instants of an even grid: so they are quickest.
        grid = (time_s[:-1, None] + spacing / (2 * pieces) * np.arange(2 * pieces)).ravel()
        instants, place = np.unique(np.concatenate([begin, middle, end, grid]), return_inverse=True)
        run = general.recorded(collision, acting, instants)
    except (TooManyEvents, RunsAway) as why:
        raise Infeasible(str(why)) from why
    states = run.states[place[: 3 * begin.size].reshape(3, -1).T]
    return _with_matrices(collision, active, events, states, (begin, end, sample, event, early))


def _cut(events: general.Recorded, time_s: Floats, each: tuple[int, int]) -> Iterator[tuple[np.ndarray, ...]]:
    """Yield (begin, end, sample at the end or -1, event that the mode began with or -1, early) of steps, mode by mode.

    ``each``: steps a sample in contact and apart.
    """
    starts = events.time_s
    before = np.flatnonzero(time_s < starts[0] - 1e-13)[::-1]
    knots = np.concatenate([starts[:1], time_s[before]])
    yield knots[:-1], knots[1:], before, np.full(before.size, -1), np.full(before.size, True)
    spacing = float(time_s[1] - time_s[0])
    for event, (begin, end) in enumerate(pairwise([*starts, max(float(time_s[-1]), float(starts[-1]))])):
        last = event == starts.size - 1
        inside = np.flatnonzero((time_s > begin + 1e-13) & (time_s < end + (1e-13 if last else -1e-13)))
        knots, at = np.concatenate([[begin], time_s[inside]]), inside
        if not last:
            met = np.flatnonzero(np.abs(time_s - end) <= 1e-13)
            knots, at = np.append(knots, end), np.append(inside, met[0] if met.size else -1)
        whole = spacing / each[int(events.modes[event, PHASE] == FREE)]
        pieces = np.maximum(1, np.ceil(np.diff(knots) / whole - 1e-6)).astype(np.int64)
        index = np.concatenate([[0], np.cumsum(pieces)])
        nodes = np.interp(np.arange(index[-1] + 1), index, knots)
        sample = np.full(nodes.size, -1)
        sample[index[1:]] = at
        count = nodes.size - 1
        yield nodes[:-1], nodes[1:], sample[1:], np.full(count, event), np.full(count, False)


def _with_matrices(
    collision: Collision,
    active: Sequence[Active],
    events: general.Recorded,
    states: Floats,
    steps: tuple[np.ndarray, ...],
) -> LinearPath:
    """Return the path of steps (begin, end, sample, event, early); ``states``, shape (m, 3, n), are those of each."""
    begin, end, sample, event, early = steps
    hidden = sum(one.effect.hidden > 0 for one in active)
    beside = [*active[:hidden], Active(_PUSH, (0.0, 0.0)), *active[hidden:], Active(_PRESS, (0.0,))]
    n = 4 + 2 * hidden
    probes = [direction(hidden, 0), direction(hidden, 1), direction(len(beside) - 1, 0)]
    system = lay_out(collision, beside, [*[-1] * (n + 2), *probes])
    modes = np.zeros((begin.size, NEAR_0 + len(beside)))
    slots = [slot + (slot >= hidden) for slot in range(len(active))]
    modes[:, :NEAR_0] = events.modes[event, :NEAR_0]
    modes[:, [NEAR_0 + slot for slot in slots]] = events.modes[event, NEAR_0 : NEAR_0 + len(active)]
    modes[:, PLATE] = 1.0  # never left to itself: nothing is saved by it here
    modes[early] = 0.0
    modes[early, SIGN] = -1.0
    states[early, :, 2:] = states[np.argmin(early), 0, 2:] if not early.all() else 0.0  # not met yet
    fresh = np.diff(event, prepend=-2) != 0
    item = np.full(begin.size, _NONE)
    item[fresh] = [_guard_of(int(events.kinds[e]), slots) if e > 0 else _FRESH for e in event[fresh]]
    count = begin.size
    out = _Matrices(
        np.empty((count, n, n)), np.empty((count, 3, n, INPUTS)), np.empty((count, 3, kernel.STATES)),
        np.zeros((count, n)), np.zeros((count, n + 1)),
    )  # fmt: skip
    _write(system, _Steps(np.ascontiguousarray(states), modes, end - begin, item), out)
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


@tight
def _look(state, z, rows, system, mode, a, e):  # type: ignore[no-untyped-def]
    """Write A (n, n) and E (n, 6) at a state (with one row only what inertia does, -v'/m to v'); return nothing."""
    n = a.shape[0]
    for i in range(n):
        state.z[0, i] = z[i]
    mass = rates(state, rows, system.which, system, mode)
    for i in range(n):
        for j in range(n if rows > 1 else 0):
            a[i, j] = state.f[1 + j, i]
        for j in range(2 if rows > 1 else 0):
            e[i, 4 + j] = state.f[1 + n + j, i]
        for j in range(3 if rows > 1 else 0):
            e[i, j] = state.f[3 + n + j, i]
        e[i, _INERTIA] = 0.0
    e[1, _INERTIA] = -state.f[0, 1] / mass


@tight
def _tell(system, given):  # type: ignore[no-untyped-def]
    """Write what an effect is given at the state that was looked at last."""
    for i in range(kernel.STATES):
        given[i] = system.s[i]
    given[kernel.Q] = given[kernel.W] = given[kernel.NEAR] = 0.0


@tight
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


@tight
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


@tight
def _jump(r, state, aside, system, steps, kick, watch):  # type: ignore[no-untyped-def]
    """Write how the state jumps where a step begins with a guard function passed."""
    item, n, size = steps.item[r], kick.size, state.z.shape[1]
    for i in range(n):
        state.z[0, i] = steps.states[r, 0, i]
    rates(state, n + 2, system.which, system, steps.modes[r - 1])
    for j in range(n + 1):
        watch[j] = guard_derivative(item, 1 + j, -1, state, system)
    for c in range(size):
        aside.z[0, c], aside.z[1, c] = state.z[0, c], state.f[0, c]
    rates(aside, n - n + 2, system.which, system, steps.modes[r - 1])
    pace = guard_derivative(item, n - n + 1, -1, aside, system)
    rates(aside, n - n + 1, system.which, system, steps.modes[r])
    for j in range(n):
        kick[j] = -(state.f[0, j] - aside.f[0, j]) / pace


@njit(cache=True, nogil=True, error_model="numpy")
def _write(system, steps, out):  # type: ignore[no-untyped-def]
    """Write the matrices of every step; about 1 us each, less where they stand still.

    Where A and E stood still over a step (most effects are linear within a mode) they are looked at again _HELD later.
    """
    n, size = out.propagator.shape[1], 4 * ((out.propagator.shape[1] + 5) // 4)
    rows = n + 6
    one = rows - rows + 1
    state, aside = state_of(rows, size), state_of(2, size)
    for j in range(n + 2):
        state.z[1 + j, j] = 1.0
    a, e = np.zeros((4, n, n)), np.zeros((3, n, INPUTS))  # at begin, middle, end; A at three quarters
    half, square, term = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    hold, resting = 0, False
    for r in range(steps.length_s.size):
        linked, at, mode = steps.item[r] == _NONE, steps.length_s[r], steps.modes[r]
        if steps.item[r] >= 0:
            _jump(r, state, aside, system, steps, out.kick[r], out.watch[r])
        if linked:
            a[0], e[0] = a[2], e[2]
            out.told[r, 0] = out.told[r - 1, 2]
        else:
            _look(state, steps.states[r, 0], rows, system, mode, a[0], e[0])
            _tell(system, out.told[r, 0])
            hold, resting = 0, False
        rested, resting = resting, hold > 0
        if resting:
            hold -= 1
            a[2], e[2] = a[0], e[0]
        _look(state, steps.states[r, 2], one if resting else rows, system, mode, a[2], e[2])
        _tell(system, out.told[r, 2])
        if not resting and _alike(a[0], a[2]) and _alike(e[0], e[2]):
            hold = _HELD
        still = resting or hold == _HELD
        if still:
            a[1], e[1] = a[0], e[0]
        _look(state, steps.states[r, 1], one if still else rows, system, mode, a[1], e[1])
        a[3] = 0.375 * a[2] + 0.75 * a[1] - 0.125 * a[0]  # on a parabola
        _tell(system, out.told[r, 1])
        if resting and rested and abs(at - steps.length_s[r - 1]) < 1e-9 * abs(at):
            out.propagator[r] = out.propagator[r - 1]
        else:
            _propagate(a[0], a[1], a[2], at, out.propagator[r], square, term)
            _propagate(a[1], a[3], a[2], 0.5 * at, half, square, term)
        for j in range(n):
            for m in range(INPUTS):
                begin, mid = 0.0, 0.0
                for q in range(n):
                    begin += out.propagator[r, j, q] * e[0, q, m]
                    mid += half[j, q] * e[1, q, m]
                out.weights[r, 0, j, m] = at / 6.0 * begin
                out.weights[r, 1, j, m] = at / 1.5 * mid
                out.weights[r, 2, j, m] = at / 6.0 * e[2, j, m]
