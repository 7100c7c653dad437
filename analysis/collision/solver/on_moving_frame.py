"""First-order change of a solved trajectory by frame motion, for sines of many frequencies at once.

In the frame's coordinates every mass has minus the frame's acceleration in addition.  The change of block and plate is
propagated along a ``LinearPath``, with all its effects and with the jumps at its events (saltation; Leine & Nijmeijer,
"Dynamics and Bifurcations of Non-Smooth Mechanical Systems", ch. 7).  The drive is integrated by Simpson's rule.
Position and velocity of the frame at the first touch are left out: they only shift the shot and change its speed.
"""

import math

import numpy as np

from analysis.collision.parameters import Collision, Floats
from analysis.collision.solver.first_order import jump_at_event, weighted_sum
from analysis.collision.solver.linearisation import LinearPath
from analysis.compiled import by_address, kernel, part

_SAME = 1e-9  # relative difference within which two steps have the same length


def moved_by_frame(path: LinearPath, collision: Collision, omega: Floats, samples: int) -> tuple[Floats, Floats]:
    """Return the contribution of frame motion to the block's displacement in the frame, shape (samples, 2 f).

    The frame moves as cos(omega t) in the first f columns and as sin(omega t) in the others; ``omega``, shape (f,), in
    rad/s; t counts from the first touch.  The second value, shape (2 f,), is the contribution to the block's velocity
    in space after the last event.
    """
    masses = collision.block_mass_kg, collision.plate_mass_kg
    pull = masses[0] * path.weights[..., 0] + masses[1] * path.weights[..., 1]
    n, columns = pull.shape[2], 2 * omega.size
    shown, after = np.zeros((samples, columns)), np.zeros(columns)
    rows, room = np.zeros((n + 3, columns)), np.zeros((n + 2, columns))
    rows[-1, : omega.size] = omega**2
    _follow(path, pull, np.tile(omega, 2), rows, room, np.arange(n + 3), np.empty(n + 3), shown, after)
    return shown, after


@kernel
def _follow(path, pull, omega, rows, room, which, weights, shown, after):  # type: ignore[no-untyped-def]  # noqa: PLR0913
    """Write the change at the samples and the velocity ``after`` the last event.

    ``rows``, shape (n + 3, 2 f), are the states and minus the frame's acceleration at start, middle and end of a step;
    ``which``, shape (n + 3,), counts the rows; ``room``, shape (n + 2, 2 f), and ``weights``, shape (n + 3,), are
    workspace.  Takes about 2 n ns per step and column for states of n numbers.
    """
    path = by_address(path)
    n, count = path.propagator.shape[1], omega.size // 2
    state, begin, middle, end = rows[:n], rows[n], rows[n + 1], rows[n + 2]
    new, moved, turn = room[:n], room[n], room[n + 1]
    last, begun = math.nan, False
    for r in range(path.length_s.size):
        if not begun and not path.early[r]:  # earlier steps ran back from the touch; later ones start there
            begun = True
            for c in range(count):
                end[c], end[count + c] = omega[c] ** 2, 0.0
            for i in range(n):
                for c in range(2 * count):
                    state[i, c] = 0.0
        for c in range(2 * count):
            begin[c] = end[c]
        if not abs(path.length_s[r] - last) <= _SAME * abs(last):
            last = path.length_s[r]
            for c in range(count):
                turn[c], turn[count + c] = math.cos(0.5 * omega[c] * last), math.sin(0.5 * omega[c] * last)
        _turn(begin, turn, middle)
        _turn(middle, turn, end)
        if not path.linked[r]:
            for c in range(2 * count):
                moved[c] = 0.0
            jump_at_event(path, r, state, moved)
            for c in range(count):  # the frame's own velocity: the derivative of cosine and sine
                after[c] = state[1, c] - begin[count + c] / omega[c]
                after[count + c] = state[1, count + c] + begin[c] / omega[c]
        for i in range(n):
            for k in range(n):
                weights[k] = path.propagator[r, i, k]
            for point in range(3):
                weights[n + point] = pull[r, point, i]
            weighted_sum(rows, weights, which, n + 3, new[i])
        for i in range(n):
            for c in range(2 * count):
                state[i, c] = new[i, c]
        if path.sample[r] >= 0:
            for c in range(2 * count):
                shown[path.sample[r], c] = state[0, c]


@part
def _turn(one, turn, out):  # type: ignore[no-untyped-def]
    """Write cosines and sines, shape (2 f,), with phases advanced by the angles in ``turn`` (cosines and sines)."""
    count = one.size // 2
    for c in range(count):
        out[c] = one[c] * turn[c] - one[count + c] * turn[count + c]
        out[count + c] = one[c] * turn[count + c] + one[count + c] * turn[c]
