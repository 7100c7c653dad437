"""Motion of the shots under laws of free curves, on the exact solver, and its derivatives.

The derivatives by a curve's coefficients are the responses of the linearised path to forces along it; those by base
and starts are the solver's own.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.collision import (
    TOUCHING,
    Argument,
    Basis,
    Collision,
    Curve,
    Effect,
    Infeasible,
    LinearPath,
    first_order_change,
    visited_range,
)
from analysis.compiled import side_by_side
from analysis.inference import Arrow, Fitted, Point, Problem
from analysis.shot import Floats

Path = tuple[LinearPath, Collision]


@dataclass(frozen=True)
class Term:
    """One law of a fit: its argument, its spline basis, and its coefficients, shape (count,)."""

    argument: Argument
    basis: Basis
    coefficients: Floats

    @property
    def curve(self) -> Curve:
        """Get the law's curve."""
        return self.basis.curve(self.coefficients)


def places_of(terms: Sequence[Term], first: int = 0) -> list[slice]:
    """Return where each law's coefficients lie in a vector that holds them all in order, from index ``first`` on."""
    edges = np.cumsum([first, *(term.basis.count for term in terms)])
    return [slice(begin, end) for begin, end in itertools.pairwise(edges)]


@dataclass(frozen=True)
class Motions:
    """Averaged displacement of every shot, shape (n,), and its derivatives by base, starts and coefficients."""

    displacement_m: tuple[Floats, ...]
    derivatives: Arrow


@dataclass(frozen=True)
class FitWithMotions:
    """A fit to which laws are added, with its motions and paths: they are the same for every law that is still zero."""

    fitted: Fitted
    motions: Motions
    paths: tuple[Path, ...]

    def visited(self, argument: Argument) -> tuple[float, float]:
        """Return the range of the argument that the shots visit where a law of it acts."""
        values = []
        for path, _ in self.paths:
            told = path.effect_inputs[:, 1] if argument.where == "block" else path.effect_inputs[~path.early, 1]
            if argument.touching:
                told = told[told[:, TOUCHING] > 0.5]
            values.append(argument.value(told))
        return visited_range(values)

    def columns(self, term: Term) -> list[Floats]:
        """Return the derivatives of every shot by the coefficients of a law that is still zero, shape (n, count).

        Raises Infeasible where it has no first-order response.
        """
        row = term.argument.row(term.curve)
        shown = zip(self.paths, self.motions.displacement_m, strict=True)
        return side_by_side(lambda one: _columns(term, row, one[0], one[1].size), shown)

    def beside(self, term: Term) -> Motions:
        """Return the motions with a law that is still zero.  Raises Infeasible as ``columns``."""
        return Motions(self.motions.displacement_m, self.motions.derivatives.with_shared(self.columns(term)))


def fit_with_motions(fitted: Fitted) -> FitWithMotions:
    """Return a fit, with its motions and paths, as the ground to which laws are added.

    On a moving frame the fit is repeated under the noise of the flights: strengths learned from the residual have
    absorbed much of the missing law, and base and starts have drifted far from their values given the law.
    """
    if fitted.problem.data.site.moves:
        fitted = fitted.problem.with_noise(fitted.unlearned_noise).fit_once(fitted.z)
    problem = fitted.problem
    lines = problem.derivatives(fitted.z)
    paths = [_path(problem, fitted.point, (), index) for index in range(len(problem.data.shots))]
    tangents = problem.arrow([j for _, j in lines])
    return FitWithMotions(fitted, Motions(tuple(x for x, _ in lines), tangents), tuple(paths))


def displacements(problem: Problem, z: Floats, terms: Sequence[Term]) -> tuple[Floats, ...]:
    """Return every shot's averaged displacement, shape (n,); a tenth of the cost of ``motions``."""
    return tuple(problem.displacement(z, _rows(terms)))


def motions(problem: Problem, z: Floats, terms: Sequence[Term]) -> Motions:
    """Return the shots' motions with curves, and their derivatives; about 30 ms per shot."""
    rows = _rows(terms)
    lines, point = problem.derivatives(z, rows), problem.unpack(z)

    def by_coefficients(index: int) -> Floats:
        path, samples = _path(problem, point, rows, index), lines[index][0].size
        return np.hstack([_columns(term, row, path, samples) for term, row in zip(terms, rows, strict=True)])

    columns = side_by_side(by_coefficients, range(len(problem.data.shots)))
    derivatives = problem.arrow([of_base for _, of_base in lines]).with_shared(columns)
    return Motions(tuple(x for x, _ in lines), derivatives)


def _rows(terms: Sequence[Term]) -> list[Effect]:
    return [term.argument.row(term.curve) for term in terms]


def _columns(term: Term, row: Effect, path: Path, samples: int) -> Floats:
    """Return the derivatives of a shot by a law's coefficients, shape (samples, count)."""
    parameters = np.zeros((term.basis.count, 3))
    parameters[:, 0] = 1.0
    parameters[:, 1] = [member.address for member in term.basis.members]
    added = first_order_change(path[0], row, path[1], parameters, samples)
    if added is None:
        raise Infeasible("a law that cannot be followed to first order")
    return added


def _path(problem: Problem, point: Point, laws: Sequence[Effect], index: int) -> Path:
    shot = problem.shot_at(index, point).with_laws(laws)
    return shot.path(1), shot.collision
