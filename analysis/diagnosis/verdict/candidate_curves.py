"""What each candidate of a diagnosis would explain of the shots: small curves that a screen can draw at once."""

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Infeasible
from analysis.inference import Fitted, Projector, Score, moved_to, shown_with

Floats = NDArray[np.float64]
POINTS = 800  # of a curve: two to a pixel of a plot that is as wide as a third of a screen
MOST_SHOTS = 12  # have curves: as many as a page draws


def curve_of_fit(fitted: Fitted, before: Fitted) -> tuple[Floats, ...]:
    """Return by how much a joint fit with a candidate moves the model's displacement in m, as ``averaged_to`` does."""
    pairs = zip(before.residual_m[:MOST_SHOTS], fitted.residual_m, strict=False)
    return tuple(averaged_to(POINTS, left_before - left_after) for left_before, left_after in pairs)


def curve_to_first_order(at: Projector, score: Score) -> tuple[Floats, ...] | None:
    """Return what a candidate that was only scored would explain, in m, as ``averaged_to`` does; None without a path.

    ``at`` is the fit before, made linear.  The candidate has the strength that a linear step gives it; the parameters
    of that fit move, also to first order, to where they fit best beside it.
    """
    shots = at.fitted.hypothesis.data.shots
    point = moved_to(at, score.kind, score.start)
    if point is None:
        return None
    try:
        columns = [shown_with(at, score.kind, point, index) for index in range(len(shots))]
    except Infeasible:
        return None
    if not all(np.all(np.isfinite(column)) for column in columns):
        return None
    left = at.whole - at.whitened([column[:, None] for column in columns])[:, 0]
    moved = at.tangents.solve(left)
    own = zip(columns, at.lines, at.tangents.places, strict=True)
    curves = [column + derivatives @ moved[places] for column, (_, derivatives), places in own]
    return tuple(averaged_to(POINTS, curve) for curve in curves[:MOST_SHOTS])


def averaged_to(points: int, values: Floats) -> Floats:
    """Return means over ``points`` equal parts of a record, or the values themselves where they are fewer: float32."""
    if values.size <= points:
        return values.astype(np.float32)
    edges = np.linspace(0, values.size, points + 1).astype(np.intp)
    return np.asarray(np.add.reduceat(values, edges[:-1]) / np.diff(edges), dtype=np.float32)
