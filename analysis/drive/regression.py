"""Least squares on the force of a driven slider: linear parameters are solved for, nonlinear ones are searched."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.drive.catalogue import BASE, LAWS, NonlinearParameter, ParameterScale, laws_named
from analysis.drive.stretch import Mask, Table
from analysis.inference import Arrow, NormalMatrix
from analysis.shot import AnalysisError, Floats, Quantity

Values = Mapping[str, float]  # of parameters, by their full names: "stribeck_friction.speed_m_per_s"
Equations = Callable[
    [Values], tuple[Floats, Floats]
]  # nonlinear values -> columns (m, k) of free parameters, force (m,)
DEPENDENT = 1e-7**0.5  # least share of a column orthogonal to the others; with less it depends on them
_STEP = 1e-3  # relative step for derivatives with respect to nonlinear parameters
_RIDGE = (
    1e-12  # relative damping of the normal equations: a tenth of the cost of ``least_squares``, and accurate enough
)


@dataclass(frozen=True, slots=True)
class Regression:
    """A least-squares solution over the samples of ``mask``; ``residual_n``, shape (m,), is over all samples.

    ``tangents``, shape (m, free parameters): derivatives of the modelled force with respect to every fitted parameter.
    ``covariance`` is over ``names``: linear ones in the order of base and laws, then the nonlinear ones.  It includes
    the residual's correlation in time (sums over blocks), because neighbouring samples are not independent.
    """

    names: tuple[str, ...]
    values: Floats
    covariance: Floats
    laws: tuple[str, ...]
    nonlinear: Values
    residual_n: Floats
    tangents: Floats
    mask: Mask
    independent_samples: float

    @property
    def rms_n(self) -> float:
        return self.rms_of(self.mask)

    def rms_of(self, samples: Mask) -> float:
        """Return the rms residual in N over these samples."""
        return rms(self.residual_n[samples])

    def quantity(self, name: str) -> Quantity:
        """Return the parameter called ``name`` with its standard uncertainty."""
        place = self.names.index(name)
        variance = float(self.covariance[place, place])
        return Quantity(float(self.values[place]), float(np.sqrt(max(0.0, variance))), "least squares on F")

    def parameters(self, law: str) -> dict[str, Quantity]:
        """Return the parameters of one law by their own names."""
        return {p.name: self.quantity(f"{law}.{p.name}") for p in LAWS[law].parameters}


def rms(values: Floats) -> float:
    """Return the root mean square; 0 if there are no values."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def delay_of(nonlinear: Values) -> float:
    """Return the delay in s of the motion relative to the force."""
    return nonlinear.get("drive_delay.time_s", 0.0)


def equations(table: Table, laws: Sequence[str], nonlinear: Values) -> tuple[Floats, Floats]:
    """Return the regressors of base and laws, shape (m, 3 + linear parameters), and the force, shape (m,)."""
    moving = [law for law in laws_named(laws) if law.force is not None]
    columns = [table.base(), *(table.columns(law, law.values_in(nonlinear)) for law in moving)]
    return np.concatenate(columns, axis=1), table.force(delay_of(nonlinear))


def linearly_dependent(columns: Floats) -> bool:
    """Return whether one of the columns (m, k) is a linear combination of the others."""
    scale = np.linalg.norm(columns, axis=0)
    if not np.all(np.isfinite(scale)) or bool((scale == 0.0).any()):
        return True
    return bool(np.linalg.svd(columns / scale, compute_uv=False)[-1] < DEPENDENT)


def regress(
    table: Table,
    laws: Sequence[str] = (),
    mask: Mask | None = None,
    start: Values | None = None,
    fixed: Values | None = None,
) -> Regression:
    """Return the least-squares solution of base and laws over the samples of ``mask`` (all by default).

    ``start`` gives starting values of the nonlinear parameters, ``fixed`` known parameters; both may name others, which
    are ignored.  Raises AnalysisError if the columns are linearly dependent in this motion, and Cancelled.
    """
    table.raise_if_cancelled()
    mask = np.ones(table.time_s.size, dtype=np.bool_) if mask is None else mask
    fixed, rows = fixed or {}, laws_named(laws)
    searched = {name: p for law in rows for name, p in zip(law.nonlinear_names, law.nonlinear_parameters, strict=True)}
    solved = (*BASE, *(name for law in rows for name in law.linear_names))
    names = (*solved, *searched)
    known = np.array([fixed.get(name, 0.0) for name in solved])
    is_free = np.array([name not in fixed for name in names])

    def free_equations(nonlinear: Values) -> tuple[Floats, Floats]:
        columns, force = equations(table, laws, nonlinear)
        return columns[:, is_free[: known.size]], force - columns @ known

    free = {name: parameter for name, parameter in searched.items() if name not in fixed}
    given = {**(start or {}), **fixed}
    nonlinear = _search(table, free_equations, mask, {name: given[name] for name in searched}, free)
    columns, target = free_equations(nonlinear)
    if columns.size and linearly_dependent(columns[mask]):
        raise AnalysisError(_why_dependent(laws))
    coefficients = least_squares(columns[mask], target[mask])
    residual = target - columns @ coefficients
    slopes = [_slope(table, free_equations, nonlinear, coefficients, *one) for one in free.items()]
    tangents = np.column_stack([columns, *slopes])
    values = np.array([fixed.get(name, 0.0) for name in names])
    values[is_free] = [*coefficients, *(nonlinear[name] for name in free)]
    covariance = np.zeros((len(names),) * 2)
    covariance[np.ix_(is_free, is_free)] = _covariance(tangents[mask], residual[mask])
    return Regression(
        names=names,
        values=values,
        covariance=covariance,
        laws=tuple(laws),
        nonlinear=nonlinear,
        residual_n=residual,
        tangents=tangents,
        mask=mask,
        independent_samples=independent_count(residual[mask], table.record[mask]),
    )


def least_squares(columns: Floats, target: Floats) -> Floats:
    """Return the least-squares coefficients of columns (m, k) for the target (m,); 0 for a column of zeros."""
    return Arrow.of([columns], columns.shape[1]).solve(target)


def _search(
    table: Table, of: Equations, mask: Mask, begin: Values, free: Mapping[str, NonlinearParameter]
) -> dict[str, float]:
    """Return the nonlinear parameters that minimise the residual after the linear parameters are solved for."""
    if not free:
        return dict(begin)
    scales = {name: parameter.scale_in(table.stretches) for name, parameter in free.items()}

    def at(z: Floats) -> dict[str, float]:
        moved = zip(free.items(), z.tolist(), strict=True)
        return {**begin, **{name: scales[name] * parameter.to_value(one) for (name, parameter), one in moved}}

    def left(z: Floats) -> Floats:
        table.raise_if_cancelled()
        columns, target = (one[mask] for one in of(at(z)))
        solution = NormalMatrix.of(columns.T @ columns).solve(columns.T @ target, damping=_RIDGE)
        if solution is None:
            raise AnalysisError("the force of a law is not finite in this motion")
        return np.asarray(target - columns @ solution)

    first, bounds = [], []
    for name, parameter in free.items():
        share = begin[name] / scales[name]
        ends = parameter.bounds
        if parameter.share_of is ParameterScale.PITCH:  # half a wave more or fewer along the travel
            ends = (parameter.to_search(share / (1.0 + 0.5 * share)), parameter.to_search(share / (1.0 - 0.5 * share)))
        bounds.append(ends)
        first.append(np.clip(parameter.to_search(share), *ends))
    from scipy import optimize  # 17 MB and 0.17 s, which a window does not need

    low, high = np.transpose(bounds)
    found = optimize.least_squares(
        left, first, bounds=(low, high), x_scale=high - low, ftol=1e-6, xtol=1e-5,
        jac=lambda z: _differences(left, z, _STEP * (high - low)),
    )  # fmt: skip
    return at(found.x)


def _differences(left: Callable[[Floats], Floats], z: Floats, steps: Floats) -> Floats:
    """Return the derivatives of a residual at ``z`` by one step in each coordinate, shape (samples, k)."""
    here = left(z)
    return np.stack([(left(z + move) - here) / move.sum() for move in np.diag(steps)], axis=1)


def _slope(
    table: Table, of: Equations, nonlinear: Values, coefficients: Floats, name: str, parameter: NonlinearParameter
) -> Floats:
    """Return the partial derivative of the modelled force with respect to a nonlinear parameter, shape (m,)."""
    width = parameter.scale_in(table.stretches) * (parameter.upper - parameter.lower)
    size = _STEP * (nonlinear[name] if parameter.logarithmic else width)
    sides = [of({**nonlinear, name: nonlinear[name] + by}) for by in (-size, size)]
    low, high = (columns @ coefficients - target for columns, target in sides)
    return np.asarray((high - low) / (2.0 * size))


def _covariance(columns: Floats, residual: Floats) -> Floats:
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0.0] = 1.0
    scale_in = columns / scale
    inverse = np.linalg.pinv(scale_in.T @ scale_in, rcond=1e-13)
    out = inverse @ _block_covariance(scale_in * residual[:, None]) @ inverse
    return np.asarray(out / np.outer(scale, scale))


def _block_covariance(scores: Floats) -> Floats:
    """Return the covariance of the scores' sum, (k, k), from sums over blocks longer than the correlation time."""
    length = round(4.0 * scores.shape[0] ** (1.0 / 3.0))
    blocks = np.add.reduceat(scores, np.arange(0, scores.shape[0], length), axis=0)
    return np.asarray(blocks.T @ blocks)


def independent_count(residual: Floats, record: NDArray[np.int64]) -> float:
    """Return the number of independent samples in a residual, smaller than its size if neighbours correlate.

    A record that is much noisier than the others dominates the sum of squares, so that the others count for little
    (as in Kish's effective size of a weighted sample, 1965).
    """
    variance = float(residual @ residual)
    if variance == 0.0:
        return float(residual.size)
    _, of, counts = np.unique(record, return_inverse=True, return_counts=True)
    shares = np.bincount(of, residual**2) / variance
    evenly = 1.0 / float(np.sum(shares**2 / counts))
    return evenly * variance / max(variance, float(_block_covariance(residual[:, None])[0, 0]))


def _why_dependent(laws: Sequence[str]) -> str:
    if laws:
        named = ", ".join(name.replace("_", " ") for name in laws)
        return f"{named}: cannot be distinguished from the rest of the model in this motion"
    return "mass, drag and offset cannot be separated: the motion needs more than one speed and acceleration"
