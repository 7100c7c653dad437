"""The first-order change of a solved trajectory by a frame that moves, for sines of many frequencies at once.

In the frame's coordinates every mass feels minus the frame's acceleration.  The change of block and plate is propagated
along a ``LinearPath``, with all effects that act there and with the jumps at its events, the drive integrated by
Simpson's rule.  Position and velocity of the frame at the first touch are left out: they only shift the shot and change
its speed.
"""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.collision.linearisation import LinearPath
from analysis.collision.parameters import Collision, Floats
from analysis.compiled import kernel

_SAME = 1e-9  # relative: steps of one length

Complex = NDArray[np.complex128]


def moved_by_frame(path: LinearPath, collision: Collision, omega: Floats, samples: int) -> tuple[Complex, Complex]:
    """Return what a frame that moves as exp(i omega t) adds to the block's displacement seen from it, (samples, f).

    ``omega``, shape (f,), in rad/s; t counts from the first touch.  The second value, shape (f,), is the velocity that
    it adds to the block in space, after the last event.
    """
    pull = collision.block_mass_kg * path.weights[..., 0] + collision.plate_mass_kg * path.weights[..., 1]
    count = omega.size
    shown, state = np.zeros((samples, 2, count)), np.zeros((pull.shape[2], 2, count))
    after = np.zeros((2, count))
    _follow(path.length_s, path.sample, path.early, path.linked, path.propagator, pull, path.kick, path.watch,
            omega, state, np.zeros((4, 2, count)), np.zeros_like(state), shown, after)  # fmt: skip
    return shown[:, 0] + 1j * shown[:, 1], after[0] + 1j * after[1]


@kernel
def _follow(length_s, sample, early, linked, propagator, pull, kick, watch, omega, state, room, new, shown, after):  # type: ignore[no-untyped-def]
    """Write the change at the samples, its real and imaginary part, and the velocity ``after`` the last event.

    ``room``, shape (4, 2, f), and ``new``, shape (n, 2, f), are work space.  About 4 n ns per step and frequency for
    states of n numbers.
    """
    n, count = state.shape[0], omega.size
    begin, middle, end, turn = room[0], room[1], room[2], room[3]
    last, begun = 0.0, False
    for c in range(count):
        begin[0, c], begin[1, c] = 1.0, 0.0
    for r in range(length_s.size):
        if not early[r] and not begun:
            begun = True
            for c in range(count):
                begin[0, c], begin[1, c] = 1.0, 0.0
                for i in range(n):
                    state[i, 0, c] = state[i, 1, c] = 0.0
        if abs(length_s[r] - last) > _SAME * abs(last):
            last = length_s[r]
            for c in range(count):
                turn[0, c], turn[1, c] = math.cos(0.5 * omega[c] * last), math.sin(0.5 * omega[c] * last)
        if not linked[r]:
            for part in range(2):
                for c in range(count):
                    moved = 0.0
                    for i in range(n):
                        moved += watch[r, i] * state[i, part, c]
                    for i in range(n):
                        state[i, part, c] += kick[r, i] * moved
            for c in range(count):
                after[0, c] = state[1, 0, c] - omega[c] * begin[1, c]
                after[1, c] = state[1, 1, c] + omega[c] * begin[0, c]
        for c in range(count):
            middle[0, c] = begin[0, c] * turn[0, c] - begin[1, c] * turn[1, c]
            middle[1, c] = begin[0, c] * turn[1, c] + begin[1, c] * turn[0, c]
            end[0, c] = middle[0, c] * turn[0, c] - middle[1, c] * turn[1, c]
            end[1, c] = middle[0, c] * turn[1, c] + middle[1, c] * turn[0, c]
        for part in range(2):
            for i in range(n):
                for c in range(count):
                    driven = pull[r, 0, i] * begin[part, c] + pull[r, 1, i] * middle[part, c]
                    new[i, part, c] = omega[c] ** 2 * (driven + pull[r, 2, i] * end[part, c])
                for k in range(n):
                    factor = propagator[r, i, k]
                    if factor != 0.0:
                        for c in range(count):
                            new[i, part, c] += factor * state[k, part, c]
        for i in range(n):
            for part in range(2):
                for c in range(count):
                    state[i, part, c] = new[i, part, c]
        for part in range(2):
            for c in range(count):
                begin[part, c] = end[part, c]
                if sample[r] >= 0:
                    shown[sample[r], part, c] = state[0, part, c]
