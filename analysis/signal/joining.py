"""Putting together the stretches of a motion that lie on either side of a long gap."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
REACH = 48
_LEAST = 12
_DOUBT = 0.2  # of a fringe


def joined(
    displacement_m: Floats, breaks: tuple[int, ...], fringe_m: float, degree: int = 2, reach: int = REACH
) -> tuple[Floats, bool]:
    """Return the displacement (n,) with every stretch after a break moved by whole fringes, and whether that is unsure.

    The motion on either side is continued by a parabola (or a polynomial of another degree) through ``reach`` samples
    to the middle of the gap; they are let meet as nearly as whole fringes allow.  It is unsure where the same from
    half as many samples differs by more than a fifth of a fringe, as it does when the force changed meanwhile: then
    the velocity is right on both sides and the position is not known.
    """
    out = displacement_m.copy()
    sure = True
    for at in breaks:
        known = np.flatnonzero(np.isfinite(out))
        before, after = known[known < at][-reach:], known[known >= at][:reach]
        if before.size < _LEAST or after.size < _LEAST:
            continue
        middle = 0.5 * (before[-1] + after[0])
        apart = [_apart(out, before[-n:], after[:n], middle, degree) / fringe_m for n in (reach // 2, reach)]
        whole = np.rint(apart[-1])
        out[after[0] :] -= whole * fringe_m
        sure = sure and abs(apart[0] - apart[1]) < _DOUBT and abs(apart[1] - whole) < 2 * _DOUBT
    return out, not sure


def _apart(
    displacement: Floats, before: NDArray[np.intp], after: NDArray[np.intp], middle: float, degree: int
) -> float:
    base = displacement[before[-1]]
    left = np.polynomial.Polynomial.fit(before - middle, displacement[before] - base, degree)
    right = np.polynomial.Polynomial.fit(after - middle, displacement[after] - base, degree)
    return float(right(0.0) - left(0.0))
