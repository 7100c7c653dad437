"""Test whether a fit is wrong although its residual looks like noise: add parameters that a correct one does not need.

A wrong effect leaves a small, smooth residual, which wandering noise absorbs.  The fit is therefore offered one more
freedom at a time: separate parameters for every shot, an effect that is stronger after the turnaround than before,
steps and kinks at touch, turnaround and release, any force law of speed, position or plate deflection.  A correct
hypothesis needs none of them.  The noise is re-estimated with each, since the misfit may have inflated it.

The true law may be outside the catalogue.  Only the argument of a force is specified here: the block's speed (with the
sign of the motion or without), its position, or the plate's deflection (with loading and unloading alike, or not).
Each free law is a sum of hat functions of its argument, shared by all shots.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import chdtri

from analysis.compiled import side_by_side
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import Freedom
from analysis.inference import Arrow, Fitted, Floor, Linearised, Point, Problem, Samples
from analysis.shot import Floats

_WIDTHS = (0.01, 0.03, 0.1)  # in contact times


@dataclass(frozen=True, slots=True)
class LackOfFit:
    """The freedom that a fit misses most: twice its gain in log-likelihood, and the limit of that gain by chance.

    ``width`` is the number of parameters of its shape.
    """

    shape: Freedom | None
    gain: float
    limit: float
    width: int = 0

    @property
    def size(self) -> float:
        """Get the size of what is missed in units of the noise."""
        return float(np.sqrt(max(0.0, self.gain - self.width)))

    @property
    def significant(self) -> bool:
        """Return whether the gain exceeds its limit by chance."""
        return self.gain > self.limit


NO_MISFIT = LackOfFit(None, 0.0, np.inf)


def low_frequency_excess(white: Sequence[Floats]) -> float:
    """Return the whitened noise's power at low frequencies over its mean, from its first three correlations; >= 1.

    An optics filter correlates neighbouring samples: slow shapes then gain more by chance than under white noise.
    """
    power = sum(float(w @ w) for w in white)
    near = sum(float(w[lag:] @ w[:-lag]) for w in white for lag in (1, 2, 3))
    return max(1.0, 1.0 + 2.0 * near / power)


def gain(fitted: Fitted, at: Linearised, shapes: Arrow) -> tuple[float, int, Floor]:
    """Return twice the log-likelihood gain of ``shapes`` (averaged, in m), their effective number, and the noise.

    The noise is re-estimated given the shapes, or is that of ``at`` where it differs from the fit's.
    """
    whitened = shapes.whitened(fitted.problem.data.shots, at.noise)
    projected = at.basis.projected_columns(whitened)
    new = int(projected.new.sum())
    if not new:
        return 0.0, 0, fitted.noise
    numbers = projected.solve(at.left)
    if at.noise != fitted.noise:
        return float(numbers @ whitened.pull(at.left)), new, at.noise
    moves = at.tangents.solve(at.whole - whitened.along(numbers))
    both = zip(at.lines, at.tangents.places, shapes.blocks, shapes.places, strict=True)
    taken = [tangent @ moves[of_fit] + shape @ numbers[of_shape] for (_, tangent), of_fit, shape, of_shape in both]
    left = [residual - one for residual, one in zip(fitted.residual_m, taken, strict=True)]
    floor, value = fitted.problem.learn_noise(left, fitted.noise)
    return 2 * (value - fitted.log_likelihood), new, floor


def largest_misfit(fitted: Fitted, at: Linearised, unlearned: Linearised, slow: float = 1.0) -> LackOfFit:
    """Return the freedom whose gain is largest relative to its limit; ``slow`` is the noise's ``low_frequency_excess``.

    ``unlearned`` is the fit linearised under noise that has not absorbed a law of speed, position or deflection.
    """
    shots = fitted.problem.data.shots
    problem = fitted.problem
    fastest = max(abs(shot.course.velocity_in_m_per_s) for shot in shots)
    kinks = [_kinks(shot) for shot in shots]
    shapes = {Freedom.KINKS: shared(kinks)}
    tangents = problem.arrow([tangent for _, tangent in at.lines])
    if len(shots) > 1:
        base, effects = slice(problem.data.count), slice(problem.data.count, len(problem.shared))
        shapes[Freedom.BASE_PER_SHOT] = _apart(tangents, base)
        speeds = [abs(shot.course.velocity_in_m_per_s) / fastest for shot in shots]
        shapes[Freedom.KINKS_WITH_SPEED] = shared([c * v for c, v in zip(kinks, speeds, strict=True)])
        if len(problem.shared) > problem.data.count:
            shapes[Freedom.EFFECT_PER_SHOT] = _apart(tangents, effects)
    if problem.free_parameters:
        of_effects = tangents.without(range(problem.offset))
        turned = of_effects.mapped(lambda k, block: block * _after_turn(shots[k])[:, None])
        shapes[Freedom.EFFECT_AFTER_TURN] = Arrow.of(turned.blocks, turned.shared)
    laws = free_laws(problem, fitted.point)
    shapes |= {name: shared(columns) for name, columns in laws.items()}
    found = []
    gains = side_by_side(lambda one: gain(fitted, unlearned if one[0] in laws else at, one[1]), shapes.items())
    for name, (value, width, floor) in zip(shapes, gains, strict=True):
        # Wandering noise is learned from the same data, anew given every shape.  If the noise no longer wanders given a
        # shape, it was that shape, and the white-noise limit applies; likewise if the flights show no wander.
        wanders = floor.coloured and not fitted.wanders_only_in_contact
        factor = slow * (CRITERIA.wandering_gain if wanders else 1.0)
        if width:
            found.append(
                LackOfFit(name, value, factor * float(chdtri(width, CRITERIA.freedom_chance / len(shapes))), width)
            )
    return max(found, key=lambda misfit: misfit.gain / misfit.limit, default=NO_MISFIT)


def shared(columns: Sequence[Floats]) -> Arrow:
    """Return shapes that all shots share, from columns of shape (n, k) per shot."""
    return Arrow.of(columns, columns[0].shape[1])


def _apart(tangents: Arrow, some: slice) -> Arrow:
    """Return derivatives by ``some`` shared parameters, made separate for all shots but the last."""
    *free, last = (block[:, some] for block in tangents.blocks)
    return Arrow.of([*free, np.zeros_like(last)], 0)


def _after_turn(shot: Samples) -> Floats:
    width = 0.1 * shot.course.contact_time_s
    return np.asarray(0.5 + 0.5 * np.tanh((shot.centre_s - shot.course.turnaround_time_s) / width))


def _kinks(shot: Samples) -> Floats:
    """Return rounded steps and kinks at touch, turnaround and release, shape (n, 18)."""
    c = shot.course
    columns = []
    for place in (c.touch_time_s, c.turnaround_time_s, c.release_time_s):
        for width in _WIDTHS:
            u = (shot.centre_s - place) / (width * c.contact_time_s)
            columns += [0.5 * np.tanh(u), np.logaddexp(u, -u)]
    return np.stack(columns, axis=1)


_SPEED = np.array([0.0, 0.15, 0.35, 0.65, 1.0])  # knots, in units of the highest speed of all shots
_PLACE = np.array([0.0, 0.08, 0.2, 0.45, 1.0])  # in units of the longest flight
_BEND = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # in units of the deepest deflection


@njit(cache=True, nogil=True, error_model="numpy")
def _pushed(force_n, mass_kg, stiffness_n_per_m, touching, spacing_s, out):  # type: ignore[no-untyped-def]
    """Write the displacements that small forces cause, shape (n, k); about 2 ns per value."""
    n, width = force_n.shape
    for k in range(width):
        x, v = 0.0, 0.0
        for i in range(n):
            out[i, k] = x
            hold = stiffness_n_per_m * touching[i]
            v += spacing_s * (force_n[i, k] - hold * x) / mass_kg
            x += spacing_s * v


def free_laws(problem: Problem, point: Point) -> dict[Freedom, list[Floats]]:
    """Return the displacements caused by forces of free laws, by their argument; per shot, shape (n, k).

    The force acts on the block alone; in contact the plate follows it as a massless spring, and short bounces are
    ignored.  That is accurate enough to test whether a law of this kind is missing.
    """
    shots = problem.data.shots
    runs = [problem.run(i, point, coarse=True) for i in range(len(shots))]
    stiffness = float(point.base[0])  # of the plate, or of the contact where the plate does not move
    away = [run.displacement_m - own[2] for run, own in zip(runs, point.own, strict=True)]
    fastest = max(float(np.abs(run.velocity_m_per_s).max()) for run in runs)
    farthest = max(float(x.max()) for x in away)
    deepest = max(float((-x).max()) for x in away)
    laws: dict[Freedom, list[Floats]] = {}
    for run, x, shot in zip(runs, away, shots, strict=True):
        speed, way = np.abs(run.velocity_m_per_s) / fastest, np.sign(run.velocity_m_per_s)[:, None]
        inside = _inside(run.gap_m)
        bent = hats(-x / deepest, _BEND)[:, 1:] * inside[:, None]
        forces = {
            Freedom.SPEED_AGAINST_MOTION: way * hats(speed, _SPEED),
            Freedom.SPEED_ONE_WAY: hats(speed, _SPEED),
            Freedom.PLACE: hats(x / farthest, _PLACE),
            Freedom.BEND: bent,
            Freedom.BEND_AGAINST_MOTION: way * bent,
        }
        for name, force in forces.items():
            out = np.empty_like(force)
            _pushed(np.ascontiguousarray(force), shot.moving_mass_kg, stiffness, inside, shot.spacing_s, out)
            laws.setdefault(name, []).append(out)
    return laws


def _inside(gap_m: Floats) -> Floats:
    """Return 1 from the first touch to the last release, else 0."""
    touching = np.flatnonzero(gap_m < 0)
    out = np.zeros(gap_m.size)
    if touching.size:
        out[touching[0] : touching[-1] + 1] = 1.0
    return out


def hats(u: Floats, knots: Sequence[float] | Floats) -> Floats:
    """Return hat functions of ``u`` that sum to one, shape (n, knots)."""
    return np.stack([np.interp(u, knots, unit) for unit in np.eye(len(knots))], axis=1)
