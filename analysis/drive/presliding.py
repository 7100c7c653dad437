"""Friction that builds up over a distance: bristles that bend before they slide.  Cost: one exponential a sample."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def bristles(displacement_m: Floats, velocity_m_per_s: Floats, level: Floats, reach_m: float) -> Floats:
    """Return how far the bristles are bent, shape (n,): dz/dx = (level - z sgn v)/reach, in shares of sliding friction.

    ``level``, shape (n,), is what they bend to when sliding: 1 for Dahl's law (P. Dahl, 1968), Stribeck's curve for
    LuGre's (C. Canudas de Wit et al., IEEE Trans. Autom. Control 40, 1995).  Exact for a level held over a step.
    They begin bent as by a long way in the first direction.
    """
    out = np.empty(displacement_m.size)
    bent = 0.0
    for i in range(displacement_m.size):
        if velocity_m_per_s[i] != 0.0:
            bent = np.sign(velocity_m_per_s[i]) * level[i]
            break
    for i in range(displacement_m.size):
        way = displacement_m[i] - displacement_m[max(0, i - 1)]
        end = np.sign(way) * level[i]
        bent = end + (bent - end) * np.exp(-abs(way) / (reach_m * level[i]))
        out[i] = bent
    return out
