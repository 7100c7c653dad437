"""Forces of any law: what a force on the block would do to the displacement, its law left free.

A catalogue names laws; what is off the catalogue follows another.  Of such a force only its argument is known here:
how fast the block goes (with the sign of the motion or without), where it is, how far the plate is bent (going in and
coming out alike, or not).  Each law is a sum of hats over its argument, shared by all shots.
"""

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.diagnosis.hypothesis import Hypothesis
from analysis.diagnosis.quick_shot import Run
from analysis.diagnosis.seen import Point

Floats = NDArray[np.float64]
_SPEED = np.array([0.0, 0.15, 0.35, 0.65, 1.0])  # knots, in the highest speed of all shots
_PLACE = np.array([0.0, 0.08, 0.2, 0.45, 1.0])  # in the longest flight
_BEND = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # in the deepest bend


@njit(cache=True, nogil=True, error_model="numpy")
def _pushed(force_n, mass_kg, stiffness_n_per_m, touching, spacing_s, out):  # type: ignore[no-untyped-def]
    """Write the displacements that small forces cause, shape (n, k); about 2 ns a value."""
    n, width = force_n.shape
    for k in range(width):
        x, v = 0.0, 0.0
        for i in range(n):
            out[i, k] = x
            hold = stiffness_n_per_m * touching[i]
            v += spacing_s * (force_n[i, k] - hold * x) / mass_kg
            x += spacing_s * v


def free_laws(hypothesis: Hypothesis, point: Point) -> dict[str, list[Floats]]:
    """Return what forces of free laws would do, named by their argument; shot by shot, shape (n, k).

    The block carries the force alone; in contact the plate follows it as a spring without mass, and the short bounces
    are passed over.  That is near enough to ask whether something of this kind is missing.
    """
    shots = hypothesis.rig.shots
    runs = [hypothesis.run(i, point, coarse=True) for i in range(len(shots))]
    stiffness = float(point.base[0])  # of the plate, or of the contact where the plate does not move
    away = [run.displacement_m - own[2] for run, own in zip(runs, point.own, strict=True)]
    fastest = max(float(np.abs(run.velocity_m_per_s).max()) for run in runs)
    farthest = max(float(x.max()) for x in away)
    deepest = max(float((-x).max()) for x in away)
    laws: dict[str, list[Floats]] = {}
    for run, x, shot in zip(runs, away, shots, strict=True):
        speed, way = np.abs(run.velocity_m_per_s) / fastest, np.sign(run.velocity_m_per_s)[:, None]
        inside = _inside(run)
        bent = _hats(-x / deepest, _BEND)[:, 1:] * inside[:, None]
        forces = {
            "a force of the speed, against the motion": way * _hats(speed, _SPEED),
            "a force of the speed, one way": _hats(speed, _SPEED),
            "a force of the place": _hats(x / farthest, _PLACE),
            "a force of the plate's bend": bent,
            "a force of the plate's bend, against the motion": way * bent,
        }
        for name, force in forces.items():
            out = np.empty_like(force)
            _pushed(np.ascontiguousarray(force), shot.moving_mass_kg, stiffness, inside, shot.spacing_s, out)
            laws.setdefault(name, []).append(out)
    return laws


def _inside(run: Run) -> Floats:
    """Return 1 from the first touch to the last release, else 0."""
    touching = np.flatnonzero(run.gap_m < 0)
    out = np.zeros(run.gap_m.size)
    if touching.size:
        out[touching[0] : touching[-1] + 1] = 1.0
    return out


def _hats(u: Floats, knots: Sequence[float] | Floats) -> Floats:
    """Return hats over ``u`` that sum to one, shape (n, knots)."""
    return np.stack([np.interp(u, knots, unit) for unit in np.eye(len(knots))], axis=1)
