"""Where the knots of a sway's splines must lie: wherever the contact bends what a frame does to a shot.

The sway's own motion is slow, but each touch and release kinks what it does to the displacement, and the plate goes on
to ring at its contact's note.  What the splines miss there is a fraction of 1e-4 of the sway; yet a fit weighs it as if
it could not sway at all, and finds its stiffness in it.  So knots are laid by halving until nothing is missed.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from analysis.collision.parameters import Collision, Floats
from analysis.inference.noise.sway import responses
from analysis.shot.disturbance import Shaking

_FIRST_S = 1e-3
_PROBES = 10
_ROUNDS = 9
_MOST = 900


def knots_of(time_s: Floats, collision: Collision, touch_time_s: float, shaking: Shaking, missed_m: float) -> Floats:
    """Return the knots' times, among ``time_s``, shape (n,), of the samples: splines miss less than that at any.

    Probes stand for the sway: each for a part of its frequencies, as strong as these and as quick as the quickest.
    Cost: about 30 ms.
    """
    probes = np.array_split(np.arange(shaking.frequency_hz.size), min(_PROBES, shaking.frequency_hz.size))
    frequency = np.array([shaking.frequency_hz[part[-1]] for part in probes])
    size = np.sqrt([shaking.power_m2[part].sum() for part in probes])
    moved, _ = responses(collision, time_s - touch_time_s, 2 * np.pi * frequency)
    shown = np.hstack([moved.real * size, moved.imag * size])
    knots = _regular(time_s)
    for _ in range(_ROUNDS):
        missed = make_interp_spline(time_s[knots], shown[knots], k=3)(time_s) - shown
        worst = np.maximum.reduceat(np.sum(missed**2, axis=1), knots[:-1])
        wide = np.diff(knots)
        halved = np.flatnonzero((worst > missed_m**2) & (wide > 1))
        if halved.size == 0 or knots.size + halved.size > _MOST:
            break
        knots = np.sort(np.concatenate([knots, knots[halved] + wide[halved] // 2]))
    return np.asarray(time_s[knots])


def _regular(time_s: Floats) -> NDArray[np.intp]:
    """Return samples about a millisecond apart, first and last among them."""
    count = max(8, int(np.ceil((time_s[-1] - time_s[0]) / _FIRST_S)) + 1)
    at = np.searchsorted(time_s, np.linspace(time_s[0], time_s[-1], count))
    return np.unique(np.clip(at, 0, time_s.size - 1))
