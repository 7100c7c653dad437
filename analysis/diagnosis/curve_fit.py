"""A law whose form is not known: for every argument the curve that explains the shots best, fitted with the base.

A curve of B-splines is fitted together with base and starts on the exact solver, by Gauss-Newton steps whose
smoothing is set anew at every step by restricted maximum likelihood (Patterson and Thompson, Biometrika 58 (1971)
545; Wood, J. R. Stat. Soc. B 73 (2011) 3).  The derivatives by the curve's coefficients are the responses of the
linearised path to forces along it, those by base and starts the solver's own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.derivatives import linearised_shot
from analysis.diagnosis.effective_parameters import Point
from analysis.diagnosis.floor import Floor, white_floor
from analysis.diagnosis.hypothesis import Hypothesis
from analysis.diagnosis.hypothesis_fit import Fitted, learn_floor
from analysis.laws.arguments import Argument
from analysis.laws.curve import Basis, Curve, graded, spread
from analysis.model import general
from analysis.model.effects import named
from analysis.model.effects.kernel import TOUCHING
from analysis.model.effects.row import Effect
from analysis.model.first_order import along
from analysis.model.least_squares import Infeasible, damped_step
from analysis.model.linear_path import LinearPath, linear_path
from analysis.model.parameters import Collision
from analysis.shot import Cancelled, Stop
from analysis.side_by_side import side_by_side

Floats = NDArray[np.float64]
_RIDGE = 1e-9  # of each coefficient's own curvature: keeps what no shot visits at rest
_DAMPINGS = (0.0, 1e-8, 1e-6, 1e-4, 1e-2, 0.3)  # of a step, tried one after another until one leads down
_EASING = 1e-2  # of the damping, from step to step
_SETTLED = 0.5  # of chi^2: a step that brings no more is the last
_BEYOND = 1e100  # noise norms: no motion of this rig


@dataclass(frozen=True)
class Term:
    """One law of a fit: what it depends on, in which splines, with which coefficients, shape (count,)."""

    argument: Argument
    basis: Basis
    coefficients: Floats

    @property
    def curve(self) -> Curve:
        """Get the law's curve."""
        return self.basis.curve(self.coefficients)


@dataclass(frozen=True)
class Learned:
    """A fit of base, starts and one or two curves.

    ``z`` is the search vector of base and starts; ``residual_m`` averaged, shot by shot; ``curvature`` of all numbers
    (z, then coefficients) in units of ``floor`` without any smoothing, ``penalty`` the smoothing that was added;
    ``freedom`` the effective number of coefficients; ``log_likelihood`` with ``floor``.
    """

    hypothesis: Hypothesis
    terms: tuple[Term, ...]
    z: Floats
    floor: Floor
    residual_m: tuple[Floats, ...]
    log_likelihood: float
    curvature: Floats
    penalty: Floats
    freedom: float

    @property
    def samples(self) -> int:
        """Get the number of valid averaged samples."""
        return sum(int(shot.valid.sum()) for shot in self.hypothesis.data.shots)

    def penalty_of(self, which: int) -> Floats:
        """Return the smoothing of one curve's coefficients, shape (count, count)."""
        edges = np.cumsum([0, *(term.basis.count for term in self.terms)])
        part = slice(edges[:-1][which], edges[1:][which])
        return self.penalty[part, part]

    @property
    def bic(self) -> float:
        """Get the Bayesian information criterion, the curves' effective freedom among the parameters."""
        return (self.z.size + self.freedom) * math.log(self.samples) - 2 * self.log_likelihood


def visited(fitted: Fitted, argument: Argument) -> tuple[float, float]:
    """Return the range of the argument that the shots visit where a law of it acts."""
    values = []
    for index in range(len(fitted.hypothesis.data.shots)):
        path, _ = _path(fitted.hypothesis, fitted.point, (), index)
        told = path.told[:, 1] if argument.where == "block" else path.told[~path.early, 1]
        if argument.touching:
            told = told[told[:, TOUCHING] > 0.5]
        values.append(argument.value(told))
    return spread(values)


def screen(start: Fitted, argument: Argument, pieces: int, stop: Stop, *, steps: int = 7) -> Learned:
    """Fit a curve of ``argument`` in about ``pieces`` pieces to what ``start`` leaves; Infeasible, Cancelled."""
    low, high = visited(start, argument)
    basis = graded(low, high, pieces)
    term = Term(argument, basis, np.zeros(basis.count))
    left = np.concatenate([r[s.valid] for r, s in zip(start.residual_m, start.hypothesis.data.shots, strict=True)])
    rms = float(np.sqrt(np.mean(left**2)))
    rough = white_floor(rms, start.floor.spacing_s)
    return fit_terms(start.hypothesis, start.z, (term,), rough, stop, steps=steps)


def refine(learned: Learned, pieces: int, stop: Stop, *, steps: int) -> Learned:
    """Fit on with the last curve in about ``pieces`` pieces, from where it stands; Infeasible, Cancelled."""
    *others, term = learned.terms
    knots = np.array(term.basis.knots)
    basis = graded(float(knots[0]), float(knots[-1]), pieces)
    fine = np.unique(np.concatenate([knots, np.linspace(knots[0], knots[-1], 8 * basis.count), basis.knots]))
    coefficients = np.linalg.lstsq(basis.design(fine), term.curve(fine), rcond=None)[0]
    finer = (*others, Term(term.argument, basis, np.asarray(coefficients, dtype=np.float64)))
    return fit_terms(learned.hypothesis, learned.z, finer, learned.floor, stop, steps=steps)


def fit_terms(
    hypothesis: Hypothesis, z: Floats, terms: tuple[Term, ...], floor: Floor, stop: Stop, *, steps: int
) -> Learned:
    """Fit base, starts and curves by penalised Gauss-Newton steps; the noise begins as ``floor`` and is learned."""
    here, damping = _linearised(hypothesis, z, terms), 0.0
    for step in range(steps):
        if stop():
            raise Cancelled
        rows = _whitened(hypothesis, here[0], here[1], floor)
        moves, penalty, _ = _penalised_step(rows, z.size, terms)
        better, fell = None, 0.0
        chi2 = _penalised(rows[:, 0], terms, penalty)
        for trial_damping in (d for d in _DAMPINGS if d >= damping):
            by = moves if trial_damping == 0.0 else _damped_step(rows, terms, penalty, trial_damping)
            if by is None:
                continue
            new_z, new_terms = z + by[: z.size], _moved(terms, by[z.size :])
            try:
                trial = _linearised(hypothesis, new_z, new_terms)
                there = _whitened(hypothesis, trial[0], trial[1], floor)
            except Infeasible:
                continue
            fell = chi2 - _penalised(there[:, 0], new_terms, penalty)
            if fell > 0.0:
                better, damping = (new_z, new_terms, trial), trial_damping
                break
        if better is None:
            break
        z, terms, here = better
        left = [shot.displacement_m - x for shot, x in zip(hypothesis.data.shots, here[0], strict=True)]
        if step >= 1:
            floor, _ = learn_floor(hypothesis.data, left, floor)
        if step >= 2 and damping == 0.0 and fell < _SETTLED:
            break
        damping *= _EASING if damping > _DAMPINGS[1] else 0.0
    left = [shot.displacement_m - x for shot, x in zip(hypothesis.data.shots, here[0], strict=True)]
    floor, value = learn_floor(hypothesis.data, left, floor)
    rows = _whitened(hypothesis, here[0], here[1], floor)
    _, penalty, freedom = _penalised_step(rows, z.size, terms)
    jacobian = rows[:, 1:]
    return Learned(hypothesis, terms, z, floor, tuple(left), value, jacobian.T @ jacobian, penalty, freedom)


def _moved(terms: tuple[Term, ...], by: Floats) -> tuple[Term, ...]:
    out, at = [], 0
    for term in terms:
        count = term.basis.count
        out.append(replace(term, coefficients=term.coefficients + by[at : at + count]))
        at += count
    return tuple(out)


def _whitened(hypothesis: Hypothesis, shown: Sequence[Floats], columns: Sequence[Floats], floor: Floor) -> Floats:
    """Return (measured - model, derivatives) whitened, all shots one after another."""
    rows = [
        shot.whitened(floor, np.column_stack([shot.displacement_m - x, j]))
        for shot, x, j in zip(hypothesis.data.shots, shown, columns, strict=True)
    ]
    joined = np.concatenate(rows)
    if not np.all(np.abs(joined) < _BEYOND):
        raise Infeasible("the trajectory leads nowhere")
    return joined


def _penalised(left: Floats, terms: Sequence[Term], penalty: Floats) -> float:
    c = np.concatenate([term.coefficients for term in terms])
    return float(left @ left + c @ penalty @ c)


def _penalised_step(rows: Floats, base: int, terms: Sequence[Term]) -> tuple[Floats, Floats, float]:
    """Return the step of all numbers, the smoothing of the coefficients and their effective freedom.

    Smoothing by restricted maximum likelihood of the linearised problem, one number for each curve.
    """
    left, fixed, free = rows[:, 0], rows[:, 1 : 1 + base], rows[:, 1 + base :]
    now = np.concatenate([term.coefficients for term in terms])
    target = left + free @ now
    scale = np.linalg.norm(fixed, axis=0)
    basis, _ = np.linalg.qr(fixed / np.where(scale > 0, scale, 1.0))
    target_in = target - basis @ (basis.T @ target)
    free_in = free - basis @ (basis.T @ free)
    a, b, s = free_in.T @ free_in, free_in.T @ target_in, float(target_in @ target_in)
    penalty, solution = _smoothing(a, b, s, rows.shape[0] - base, terms)
    total = a + penalty
    freedom = float(np.trace(np.linalg.solve(total, a)))
    rest = left - free @ (solution - now)
    own = np.linalg.lstsq(fixed / np.where(scale > 0, scale, 1.0), rest, rcond=1e-12)[0] / np.where(
        scale > 0, scale, 1.0
    )
    return np.concatenate([own, solution - now]), penalty, freedom


def _damped_step(rows: Floats, terms: Sequence[Term], penalty: Floats, damping: float) -> Floats | None:
    """Return the step of all numbers with the directions held back that the shots hardly see, or None."""
    left, jacobian = rows[:, 0], rows[:, 1:]
    coefficients = np.concatenate([term.coefficients for term in terms])
    curvature, pull = jacobian.T @ jacobian, jacobian.T @ left
    base = pull.size - coefficients.size
    curvature[base:, base:] += penalty
    pull[base:] -= penalty @ coefficients
    return damped_step(curvature, pull, damping)


def _smoothing(a: Floats, b: Floats, s: float, free_samples: int, terms: Sequence[Term]) -> tuple[Floats, Floats]:
    sizes = [term.basis.count for term in terms]
    edges = np.concatenate([[0], np.cumsum(sizes)])
    logs = [0.0] * len(terms)
    shapes = []
    for k, term in enumerate(terms):
        part = slice(edges[k], edges[k + 1])
        rough = term.basis.roughness
        shapes.append(rough * (np.trace(a[part, part]) / max(np.trace(rough), 1e-300)))

    def whole(powers: Sequence[float]) -> Floats:
        out = np.zeros_like(a)
        for k, power in enumerate(powers):
            part = slice(edges[k], edges[k + 1])
            out[part, part] = math.exp(power) * shapes[k]
        return out

    ridge = _RIDGE * np.diag(np.diag(a)) + 1e-300 * np.eye(a.shape[0])

    def value(powers: Sequence[float]) -> float:
        total = a + whole(powers) + ridge
        try:
            factor = np.linalg.cholesky(total)
        except np.linalg.LinAlgError:
            return -math.inf
        half = np.linalg.solve(factor, b)
        rss = max(s - float(half @ half), 1e-300)
        ranks = [size - 2 for size in sizes]
        prior = 0.5 * sum(r * p for r, p in zip(ranks, powers, strict=True))
        return -0.5 * free_samples * math.log(rss) - float(np.sum(np.log(np.diag(factor)))) + prior

    for _ in range(1 if len(terms) == 1 else 3):
        for k in range(len(terms)):
            grid = np.arange(-34.0, 14.0, 1.5)
            tried = [value([*logs[:k], float(g), *logs[k + 1 :]]) for g in grid]
            logs[k] = float(grid[int(np.argmax(tried))])
    penalty = whole(logs) + ridge
    return penalty, np.asarray(np.linalg.solve(a + penalty, b), dtype=np.float64)


def _linearised(hypothesis: Hypothesis, z: Floats, terms: Sequence[Term]) -> tuple[list[Floats], list[Floats]]:
    """Return every shot's averaged displacement, shape (n,), and its derivatives by all numbers, shape (n, p)."""
    curves = [term.curve for term in terms]  # held until the end: kernels know them by address
    rows = [term.argument.row(curve) for term, curve in zip(terms, curves, strict=True)]
    point = hypothesis.unpack(z)

    def one(index: int) -> tuple[Floats, Floats]:
        shown, columns_of_base = linearised_shot(hypothesis, index, z, rows)
        columns = [columns_of_base]
        path, collision = _path(hypothesis, point, rows, index)
        for term, row in zip(terms, rows, strict=True):
            parameters = np.zeros((term.basis.count, 3))
            parameters[:, 0] = 1.0
            parameters[:, 1] = [member.address for member in term.basis.members]
            added = along(path, row, collision, parameters, shown.size)
            if added is None:
                raise Infeasible("a law that cannot be followed to first order")
            columns.append(added)
        return shown, np.hstack(columns)

    both = side_by_side(one, range(len(hypothesis.data.shots)))
    return [x for x, _ in both], [j for _, j in both]


def _path(hypothesis: Hypothesis, point: Point, laws: Sequence[Effect], index: int) -> tuple[LinearPath, Collision]:
    shot, own = hypothesis.data.shots[index], point.own[index]
    collision = hypothesis.data.base.collision(point.base, own[0], shot.moving_mass_kg)
    acting = [row for row in (named(kind.name) for kind in hypothesis.effects) if row.kernel is not None]
    active = [general.Active(r, tuple(point.values[index][r.name][p.name] for p in r.parameters)) for r in acting]
    active += [general.Active(row, tuple(p.scale for p in row.parameters)) for row in laws]
    active.sort(key=lambda one: one.effect.hidden == 0)
    return linear_path(collision, active, shot.centre_s - own[1]), collision
