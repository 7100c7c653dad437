"""What a small effect does to a trajectory that is solved, for all starts of its grid at once, by its own function.

The effect's function is asked along the path (``linear_path``).  What it adds there is linear in its hidden state for
every oscillator and relaxation, with constant coefficients: so its hidden state is propagated exactly (for drives that
are parabolas over a step), and the small change of block and plate by the path's propagators, the drives integrated by
Simpson's rule.  An effect of size e is right to order e; where its function does not have that form, there is no answer
and the trajectory has to be solved anew.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from analysis.collision.effects.kernel import FORCE, MASS, ON_BLOCK, ON_PLATE, OUTPUTS, PAIR, STATES, V, X, address
from analysis.collision.effects.row import Acts, Effect
from analysis.collision.forms import ROOM, SEEN, ask, coefficients, hidden_steps, state_coefficients
from analysis.collision.linear_path import LinearPath
from analysis.collision.parameters import Collision, Floats
from analysis.collision.path_matrices import INPUTS
from analysis.collision.slots import function_of
from analysis.compiled.kernel_parts import kernel, part
from analysis.compiled.kernel_room import cut, cut_integers

_PROBED = 16  # points along the trajectory at which the form of an effect's function is looked at
_SWING = 0.5  # radians a step may take of what is tried
_DRIVES = (ON_BLOCK, ON_PLATE, PAIR, MASS)  # in the order of the path's inputs


def steps_for(effect: Effect, values: Sequence[float], collision: Collision, spacing_s: float) -> int:
    """Return how many steps a sample an effect asks for: a power of two, so that many starts share a path."""
    turns = effect.fastest(np.asarray(values, dtype=np.float64), collision) * spacing_s / _SWING
    return 1 if turns <= 1 else 2 ** math.ceil(math.log2(turns))


class _Asked(NamedTuple):
    """An effect at k starts: its address, what kind it is, its parameters, shape (k, 3), and what its form is."""

    where: int
    pair: bool
    before: bool
    hidden: bool
    rides: bool
    shift: float
    known: bool
    parameters: Floats
    linear: Floats
    seen_by: Floats


class _Path(NamedTuple):
    """The arrays of a ``LinearPath``."""

    length: Floats
    sample: Any
    early: Any
    linked: Any
    propagator: Floats
    weights: Floats
    told: Floats
    kick: Floats
    watch: Floats


def along(path: LinearPath, effect: Effect, collision: Collision, parameters: Floats, samples: int) -> Floats | None:
    """Return the change of the block's position, shape (samples, k), for k rows of ``parameters``, shape (k, 3)."""
    if effect.kernel is None or effect.range_at >= 0:
        return None
    function, acts = function_of(effect, collision)
    pair, hidden = acts is Acts.IN_CONTACT, effect.hidden > 0
    if pair and hidden:
        return None
    count = parameters.shape[0]
    places = np.unique(np.linspace(0, path.size - 1, _PROBED).astype(np.int64))
    linear, seen_by = np.zeros((OUTPUTS, 2, count)), np.zeros((OUTPUTS, SEEN + 1, count))
    where = address(function)
    told = np.ascontiguousarray(path.told[places, 1])
    if hidden and not coefficients(where, told, parameters, linear, np.zeros(ROOM)):
        return None
    known = hidden and state_coefficients(where, told, parameters, seen_by, np.zeros(ROOM))
    out = np.zeros((samples, count))
    before = acts is Acts.ON_BLOCK and not effect.rides
    asked = _Asked(
        where, pair, before, hidden, effect.rides, float(effect.shift), bool(known), parameters, linear, seen_by
    )
    arrays = _Path(
        path.length_s,
        path.sample,
        path.early,
        path.linked,
        path.propagator,
        path.weights,
        path.told,
        path.kick,
        path.watch,
    )
    marched = _march(asked, np.array(_DRIVES), arrays, out, np.zeros(_room_for(arrays.propagator.shape[1], count)))
    assert marched
    return out


def _room_for(n: int, count: int) -> int:
    """Return how many numbers the arrays of ``_march`` take, n being those of a state, for ``count`` starts."""
    fixed = STATES + 3 + INPUTS + OUTPUTS * (2 * SEEN + 5) + 2 * (n + 3 * INPUTS)
    return fixed + count * (3 * OUTPUTS + 3 * INPUTS + 2 * n + 6 + 1 + 32 + 4 + 16)


@part
def _add_up(rows, weights, which, number, out):  # type: ignore[no-untyped-def]
    """Write the weighted sum of some rows, two at a time: each pass writes ``out`` once."""
    count = out.size
    first, last = rows[which[0]], rows[which[number - 1]]
    one, two = weights[0], weights[number - 1]
    if number % 2 == 1:
        for c in range(count):
            out[c] = one * first[c]
    else:
        for c in range(count):
            out[c] = one * first[c] + two * last[c]
    for k in range(1, number - 1, 2):
        one, two, near, far = weights[k], weights[k + 1], rows[which[k]], rows[which[k + 1]]
        if one != 0.0 or two != 0.0:
            for c in range(count):
                out[c] += one * near[c] + two * far[c]


@kernel
def _march(effect_at, drives, path, out, room):  # type: ignore[no-untyped-def]
    """Write the change of the block's position at the samples, shape (samples, k), and return whether there was room.

    About 15 ns a step and start where what the effect makes of a state is ``known`` (``seen_by``), else 40.
    ``room`` is ``_room_for`` zeros.
    """
    where, parameters, linear, seen_by = effect_at.where, effect_at.parameters, effect_at.linear, effect_at.seen_by
    pair, before, hidden, rides = effect_at.pair, effect_at.before, effect_at.hidden, effect_at.rides
    shift, known = effect_at.shift, effect_at.known
    length, sample, early, linked, propagator = path.length, path.sample, path.early, path.linked, path.propagator
    weights, told, kick, watch = path.weights, path.told, path.kick, path.watch
    count, n = parameters.shape[0], propagator.shape[1]
    s, at = cut(room, 0, (STATES,))
    values, at = cut(room, at, (3,))
    effect, at = cut(room, at, (OUTPUTS,))
    bare, at = cut(room, at, (3, OUTPUTS, count))  # at begin, middle and end, with the hidden state at zero
    rows, _ = cut(room, at, (n + 3 * INPUTS, count))  # the state, and what acts on it at begin, middle and end
    state, at = cut(room, at, (n, count))
    u, at = cut(room, at, (3, INPUTS, count))
    at_work, at = cut_integers(room, at, (INPUTS,))
    driven, at = cut_integers(room, at, (OUTPUTS,))
    used, at = cut_integers(room, at, (OUTPUTS, SEEN + 1))
    for i in range(OUTPUTS):
        driven[i] = 0 if known else 1
        for j in range(SEEN + 1):
            for c in range(count):
                used[i, j] = 1 if used[i, j] or seen_by[i, j, c] != 0.0 else 0
            driven[i] = 1 if driven[i] or used[i, j] else 0
    for i in range(INPUTS):
        if i >= 4:
            at_work[i] = 1 if shift != 0.0 else 0
        elif (i == 2) == pair:
            from_ = drives[i]
            at_work[i] = driven[from_]
            for c in range(count):
                if linear[from_, 0, c] != 0.0 or linear[from_, 1, c] != 0.0:
                    at_work[i] = 1
    new, at = cut(room, at, (n, count))
    h, at = cut(room, at, (3, 2, count))
    moved, at = cut(room, at, (count,))
    steps, at = cut(room, at, (2, 4, 2, 2, count))
    power, at = cut(room, at, (2, 2, count))
    series, at = cut(room, at, (4, 2, 2, count))
    scaled, at = cut(room, at, (n + 3 * INPUTS,))
    live, at = cut_integers(room, at, (n + 3 * INPUTS,))
    given, at = cut_integers(room, at, (OUTPUTS, SEEN + 1))  # what an output is made of, and of how many
    told_of, at = cut_integers(room, at, (OUTPUTS,))
    if at > room.size:
        return False
    acting = n
    for k in range(n):
        live[k] = k
    for k in range(3 * INPUTS):
        if at_work[k % INPUTS]:
            live[acting] = n + k
            acting += 1
    for i in range(OUTPUTS):
        for j in range(SEEN + 1):
            if used[i, j]:
                given[i, told_of[i]] = j
                told_of[i] += 1
    last, begun = 0.0, False
    for r in range(length.size):
        if not early[r] and not begun:
            begun = True
            for c in range(count):
                for i in range(n):
                    state[i, c] = 0.0
                if rides and hidden:
                    h[0, 0, c], h[0, 1, c] = told[r, 0, X], told[r, 0, V]
        if early[r] and not before:
            continue
        if hidden and not early[r] and abs(length[r] - last) > 1e-9 * abs(last):
            hidden_steps(linear, length[r], steps, power, series)
            last = length[r]
        for point in range(3):
            if point == 0 and r > 0 and linked[r]:
                for i in range(OUTPUTS):
                    if driven[i]:
                        for c in range(count):
                            bare[0, i, c] = bare[2, i, c]
                continue
            for i in range(STATES):
                s[i] = told[r, point, i]
            if pair:
                s[FORCE] = 0.0
            if known:
                for i in range(OUTPUTS):
                    if driven[i]:
                        for k in range(told_of[i]):
                            scaled[k] = s[given[i, k]] if given[i, k] < SEEN else 1.0
                        _add_up(seen_by[i], scaled, given[i], told_of[i], bare[point, i])
                continue
            for c in range(count):
                ask(where, s, parameters, c, values, effect)
                for i in range(OUTPUTS):
                    bare[point, i, c] = effect[i]
        if hidden and not early[r]:
            for part in range(2):
                for i in range(2):
                    for c in range(count):
                        total = steps[part, 0, i, 0, c] * h[0, 0, c] + steps[part, 0, i, 1, c] * h[0, 1, c]
                        for point in range(3):
                            total += steps[part, 1 + point, i, 1, c] * bare[point, 4, c]
                        h[1 + part, i, c] = total
                    if driven[3]:  # nothing pushes the place of what swings
                        for c in range(count):
                            for point in range(3):
                                h[1 + part, i, c] += steps[part, 1 + point, i, 0, c] * bare[point, 3, c]
        for point in range(3):
            for i in range(INPUTS):
                if not at_work[i]:
                    continue
                if i >= 4:
                    for c in range(count):
                        u[point, i, c] = shift * h[point, i - 4, c]
                    continue
                from_ = drives[i]
                for c in range(count):
                    by_hidden = linear[from_, 0, c] * h[point, 0, c] + linear[from_, 1, c] * h[point, 1, c]
                    u[point, i, c] = bare[point, from_, c] + by_hidden
        if not linked[r]:
            # A switch: it comes earlier or later by what has changed, and the old forces act so much longer.
            for c in range(count):
                total = watch[r, n] * shift * h[0, 0, c]
                for i in range(n):
                    total += watch[r, i] * state[i, c]
                moved[c] = total
            for i in range(n):
                if kick[r, i] != 0.0:
                    for c in range(count):
                        state[i, c] += kick[r, i] * moved[c]
        for i in range(n):
            for k in range(n):
                scaled[k] = propagator[r, i, k]
            for k in range(n, acting):
                row = live[k] - n
                scaled[k] = weights[r, row // INPUTS, i, row % INPUTS]
            _add_up(rows, scaled, live, acting, new[i])
        for i in range(n):
            for c in range(count):
                state[i, c] = new[i, c]
        for i in range(2):
            for c in range(count):
                h[0, i, c] = h[2, i, c]
        if sample[r] >= 0:
            for c in range(count):
                out[sample[r], c] = state[0, c]
    return True
