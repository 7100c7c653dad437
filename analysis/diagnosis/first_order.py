"""What a small effect does to a fitted trajectory, for all starts of its grid at once, by its own function.

The effect's function is asked along the trajectory that is already solved (``base_path``).  What it adds there is
linear in its hidden state for every oscillator and relaxation, with constant coefficients: so its hidden state is
propagated exactly (for drives that are parabolas over a step), and the small change of block and plate by the fit's own
propagators, the drives integrated by Simpson's rule.  An effect of size e is right to order e; where its function does
not have that form, there is no answer and the trajectory has to be solved anew.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.diagnosis.base_path import INPUTS, BasePath, base_path
from analysis.diagnosis.forms import SEEN, ask, coefficients, hidden_steps, state_coefficients
from analysis.diagnosis.quick_shot import Optics, Values, seen, situation
from analysis.model.effects import kernel, named
from analysis.model.effects.kernel import address
from analysis.model.effects.row import Acts, Effect
from analysis.model.parameters import Collision
from analysis.model.slots import function_of

Floats = NDArray[np.float64]
_PROBED = 16  # points along the trajectory at which the form of an effect's function is looked at
_STEP = 1e-40  # the complex step
_SWING = 0.64  # radians a step may take of what is tried
_DRIVES = (kernel.ON_BLOCK, kernel.ON_PLATE, kernel.PAIR, kernel.MASS)  # in the order of the path's inputs


@dataclass(frozen=True, slots=True)
class Shot:
    """One shot of a fit: the times at which it is seen, its parameters as ``quick_shot.respond`` takes them."""

    time_s: Floats
    base: Floats
    own: Floats
    values: Values
    mass_kg: float
    optics: Optics


def path_of(shot: Shot, steps: int) -> BasePath:
    """Return a shot's path in at least ``steps`` a sample; Infeasible where they would be too many."""
    collision, active, ahead = situation(shot.base, shot.own, shot.values, shot.mass_kg)
    return base_path(collision, active, shot.time_s - shot.own[1] + ahead, steps)


def steps_for(shot: Shot, effect: Effect, start: Mapping[str, float]) -> int:
    """Return how many steps a sample a start of an effect asks for: a power of two, so that many share a path."""
    collision, _, _ = situation(shot.base, shot.own, {}, shot.mass_kg)
    fastest = effect.fastest(np.array([start[parameter.name] for parameter in effect.parameters]), collision)
    turns = fastest * float(shot.time_s[1] - shot.time_s[0]) / _SWING
    return 1 if turns <= 1 else 2 ** math.ceil(math.log2(turns))


def laid(effect: Effect, starts: Sequence[Mapping[str, float]]) -> Floats:
    """Return the parameters of ``starts`` as an effect's function takes them, shape (k, 3)."""
    out = np.zeros((len(starts), 3))
    for place, parameter in enumerate(effect.parameters):
        out[:, place] = [start[parameter.name] for start in starts]
    return out


def responses(shot: Shot, path: BasePath, effect: Effect, starts: Sequence[Mapping[str, float]]) -> Floats | None:
    """Return what each of ``starts`` of an effect adds to the displacement shown, shape (n, k); about 50 ns a value.

    None where the effect's function has not the form.
    """
    collision, _, _ = situation(shot.base, shot.own, shot.values, shot.mass_kg)
    change = along(path, effect, collision, laid(effect, starts), shot.time_s.size)
    if change is None:
        return None
    x, v = np.empty(shot.time_s.size), np.empty(shot.time_s.size)
    x[:], v[:] = path.told[0, 0, kernel.X], path.told[0, 0, kernel.V]
    at = path.sample >= 0
    x[path.sample[at]], v[path.sample[at]] = path.told[at, 2, kernel.X], path.told[at, 2, kernel.V]
    rows = [named(name) for name in shot.values]
    if all(row.sensor is None for row in rows):
        return change
    remembers = any(row.remembers for row in rows)
    moved = np.asarray(x[:, None] + 1j * _STEP * (change if remembers else 1.0), dtype=np.complex128)
    shown = np.asarray(seen(moved, v, shot.time_s, shot.values, shot.optics).imag / _STEP)
    return shown if remembers else shown * change


def along(path: BasePath, effect: Effect, collision: Collision, parameters: Floats, samples: int) -> Floats | None:
    """Return the change of the block's position, shape (samples, k), for k rows of ``parameters``, shape (k, 3)."""
    if effect.kernel is None or effect.range_at >= 0:
        return None
    function, acts = function_of(effect, collision)
    pair, hidden = acts is Acts.IN_CONTACT, effect.hidden > 0
    if pair and hidden:
        return None
    count = parameters.shape[0]
    places = np.unique(np.linspace(0, path.size - 1, _PROBED).astype(np.int64))
    linear, seen_by = np.zeros((kernel.OUTPUTS, 2, count)), np.zeros((kernel.OUTPUTS, SEEN + 1, count))
    where = address(function)
    told = np.ascontiguousarray(path.told[places, 1])
    if hidden and not coefficients(where, told, parameters, linear):
        return None
    known = hidden and state_coefficients(where, told, parameters, seen_by)
    out = np.zeros((samples, count))
    _march(
        where, pair, acts is Acts.ON_BLOCK and not effect.rides, hidden, effect.rides, effect.shift,
        parameters, linear, known, seen_by, np.array(_DRIVES), path.length_s, path.sample, path.early, path.linked,
        path.propagator, path.weights, path.told, path.kick, path.watch, out,
    )  # fmt: skip
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _march(  # type: ignore[no-untyped-def]
    where, pair, before, hidden, rides, shift, parameters, linear, known, seen_by, drives,
    length, sample, early, linked, propagator, weights, told, kick, watch, out,
):  # fmt: skip
    """Write the change of the block's position at the samples, shape (samples, k).

    About 15 ns a step and start where what the effect makes of a state is ``known`` (``seen_by``), else 40.
    """
    count, n = parameters.shape[0], propagator.shape[1]
    s, values, effect = np.zeros(kernel.STATES), np.zeros(3), np.zeros(kernel.OUTPUTS)
    bare = np.zeros((3, kernel.OUTPUTS, count))  # at begin, middle and end, with the hidden state at zero
    u = np.zeros((3, INPUTS, count))
    at_work, driven = np.zeros(INPUTS, dtype=np.bool_), np.zeros(kernel.OUTPUTS, dtype=np.bool_)
    used = np.zeros((kernel.OUTPUTS, SEEN + 1), dtype=np.bool_)
    for i in range(kernel.OUTPUTS):
        driven[i] = not known
        for j in range(SEEN + 1):
            for c in range(count):
                used[i, j] = used[i, j] or seen_by[i, j, c] != 0.0
            driven[i] = driven[i] or used[i, j]
    for i in range(INPUTS):
        if i >= 4:
            at_work[i] = shift != 0.0
        elif (i == 2) == pair:
            from_ = drives[i]
            at_work[i] = driven[from_]
            for c in range(count):
                at_work[i] = at_work[i] or linear[from_, 0, c] != 0.0 or linear[from_, 1, c] != 0.0
    state, new = np.zeros((n, count)), np.zeros((n, count))
    h, moved = np.zeros((3, 2, count)), np.zeros(count)
    steps, power, series = np.zeros((2, 4, 2, 2, count)), np.zeros((2, 2, count)), np.zeros((4, 2, 2, count))
    last, begun = 0.0, False
    for r in range(length.size):
        if not early[r] and not begun:
            begun = True
            for c in range(count):
                for i in range(n):
                    state[i, c] = 0.0
                if rides and hidden:
                    h[0, 0, c], h[0, 1, c] = told[r, 0, kernel.X], told[r, 0, kernel.V]
        if early[r] and not before:
            continue
        if hidden and not early[r] and abs(length[r] - last) > 1e-9 * abs(last):
            hidden_steps(linear, length[r], steps, power, series)
            last = length[r]
        for point in range(3):
            if point == 0 and r > 0 and linked[r]:
                for i in range(kernel.OUTPUTS):
                    if driven[i]:
                        for c in range(count):
                            bare[0, i, c] = bare[2, i, c]
                continue
            for i in range(kernel.STATES):
                s[i] = told[r, point, i]
            if pair:
                s[kernel.FORCE] = 0.0
            if known:
                for i in range(kernel.OUTPUTS):
                    if driven[i]:
                        for c in range(count):
                            bare[point, i, c] = seen_by[i, SEEN, c]
                        for j in range(SEEN):
                            if used[i, j]:
                                for c in range(count):
                                    bare[point, i, c] += s[j] * seen_by[i, j, c]
                continue
            for c in range(count):
                ask(where, s, parameters, c, values, effect)
                for i in range(kernel.OUTPUTS):
                    bare[point, i, c] = effect[i]
        if hidden and not early[r]:
            for part in range(2):
                for i in range(2):
                    for c in range(count):
                        total = steps[part, 0, i, 0, c] * h[0, 0, c] + steps[part, 0, i, 1, c] * h[0, 1, c]
                        for point in range(3):
                            total += steps[part, 1 + point, i, 0, c] * bare[point, 3, c]
                            total += steps[part, 1 + point, i, 1, c] * bare[point, 4, c]
                        h[1 + part, i, c] = total
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
            for c in range(count):
                new[i, c] = 0.0
            for j in range(n):
                weight = propagator[r, i, j]
                if weight != 0.0:
                    for c in range(count):
                        new[i, c] += weight * state[j, c]
            for point in range(3):
                for j in range(INPUTS):
                    weight = weights[r, point, i, j]
                    if at_work[j] and weight != 0.0:
                        for c in range(count):
                            new[i, c] += weight * u[point, j, c]
        for i in range(n):
            for c in range(count):
                state[i, c] = new[i, c]
        for i in range(2):
            for c in range(count):
                h[0, i, c] = h[2, i, c]
        if sample[r] >= 0:
            for c in range(count):
                out[sample[r], c] = state[0, c]
