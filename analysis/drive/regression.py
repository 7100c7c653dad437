"""Least squares on the force of a driven slider: linear parameters are solved for, nonlinear ones are searched."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.drive.catalogue import BASE, LAWS, ParameterScale
from analysis.drive.stretch import Mask, Table
from analysis.shot import AnalysisError, Floats, Quantity

NonlinearValues = Mapping[str, tuple[float, ...]]  # by the name of each law that has nonlinear parameters
ZERO_LENGTH = 1e-150  # least norm of a column, whose square is not yet 0; a law that never acts has less
DEPENDENT = 1e-7  # least squared share of a column orthogonal to the others; with less it depends on them
_STEP = 1e-3  # relative step for derivatives with respect to nonlinear parameters


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
    nonlinear: NonlinearValues
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


def delay_of(nonlinear: NonlinearValues) -> float:
    """Return the delay in s of the motion relative to the force."""
    return nonlinear["drive_delay"][0] if "drive_delay" in nonlinear else 0.0


def design(table: Table, laws: Sequence[str], nonlinear: NonlinearValues) -> Floats:
    """Return the regressors of base and laws, shape (m, 3 + linear parameters)."""
    moving = [LAWS[name] for name in laws if LAWS[name].force is not None]
    return np.concatenate([table.base(), *(table.columns(law, nonlinear.get(law.name, ())) for law in moving)], axis=1)


def linearly_dependent(columns: Floats) -> bool:
    """Return whether one of the columns (m, k) is a linear combination of the others."""
    scale = np.linalg.norm(columns, axis=0)
    if not np.all(np.isfinite(scale)) or bool((scale == 0.0).any()):
        return True
    return bool(np.linalg.svd(columns / scale, compute_uv=False)[-1] < DEPENDENT**0.5)


def regress(
    table: Table,
    laws: Sequence[str] = (),
    mask: Mask | None = None,
    start: NonlinearValues | None = None,
    fixed: Mapping[str, float] | None = None,
) -> Regression:
    """Return the least-squares solution of base and laws over the samples of ``mask`` (all by default).

    ``start`` gives starting values of nonlinear parameters by law; ``fixed`` gives known parameters by their names in
    the result.  Raises AnalysisError if the columns are linearly dependent in this motion, and Cancelled.
    """
    table.raise_if_cancelled()
    mask = np.ones(table.time_s.size, dtype=np.bool_) if mask is None else mask
    fixed = fixed or {}
    begin = {name: _start_values(name, start or {}, fixed) for name in laws if LAWS[name].nonlinear_parameters}
    nonlinear = _search_nonlinear(table, laws, mask, begin, fixed)
    linear, columns, target = _linear_part(table, laws, nonlinear, fixed)
    if linear and linearly_dependent(columns[mask]):
        raise AnalysisError(_why_dependent(laws))
    values = least_squares(columns[mask], target[mask])
    residual = target - columns @ values
    free = _free_nonlinear(nonlinear, fixed)
    slopes = [_derivative(table, laws, nonlinear, fixed, values, at) for at in free]
    tangents = np.column_stack([columns, *slopes])
    names = (*linear, *(_parameter_name(*at) for at in free))
    known = tuple(name for name in _parameter_names(laws) if name in fixed)
    covariance = np.zeros((len(names) + len(known),) * 2)
    covariance[: len(names), : len(names)] = _covariance(tangents[mask], residual[mask])
    every = np.array([*values, *(nonlinear[name][k] for name, k in free), *(fixed[name] for name in known)])
    order = [(*names, *known).index(name) for name in _parameter_names(laws)]
    return Regression(
        names=_parameter_names(laws),
        values=every[order],
        covariance=covariance[np.ix_(order, order)],
        laws=tuple(laws),
        nonlinear=nonlinear,
        residual_n=residual,
        tangents=tangents,
        mask=mask,
        independent_samples=independent_count(residual[mask], table.record[mask]),
    )


def _free_nonlinear(nonlinear: NonlinearValues, fixed: Mapping[str, float]) -> list[tuple[str, int]]:
    """Return (law, index) of the nonlinear parameters that are not fixed."""
    return [
        (name, k) for name in nonlinear for k in range(len(nonlinear[name])) if _parameter_name(name, k) not in fixed
    ]


def _start_values(law: str, start: NonlinearValues, fixed: Mapping[str, float]) -> tuple[float, ...]:
    given = start.get(law, (np.nan,) * len(LAWS[law].nonlinear_parameters))
    return tuple(fixed.get(_parameter_name(law, k), value) for k, value in enumerate(given))


def _parameter_names(laws: Sequence[str]) -> tuple[str, ...]:
    linear = [f"{name}.{parameter}" for name in laws for parameter in LAWS[name].linear]
    nonlinear = [f"{name}.{parameter.name}" for name in laws for parameter in LAWS[name].nonlinear_parameters]
    return (*BASE, *linear, *nonlinear)


def _parameter_name(law: str, k: int) -> str:
    return f"{law}.{LAWS[law].nonlinear_parameters[k].name}"


def _linear_part(
    table: Table, laws: Sequence[str], nonlinear: NonlinearValues, fixed: Mapping[str, float]
) -> tuple[tuple[str, ...], Floats, Floats]:
    """Return the names of the free linear parameters, their columns, and the force minus the known parts."""
    names = _parameter_names(laws)[: 3 + sum(len(LAWS[name].linear) for name in laws)]
    columns = design(table, laws, nonlinear)
    target = table.force(delay_of(nonlinear))
    for place, name in enumerate(names):
        if name in fixed:
            target = target - fixed[name] * columns[:, place]
    free = [place for place, name in enumerate(names) if name not in fixed]
    return tuple(names[place] for place in free), columns[:, free], target


def least_squares(columns: Floats, target: Floats) -> Floats:
    """Return the least-squares coefficients of columns (m, k) for the target (m,); 0 for a column of zeros."""
    scale = np.maximum(np.linalg.norm(columns, axis=0), ZERO_LENGTH)
    return np.asarray(np.linalg.lstsq(columns / scale, target)[0] / scale)


def _normal_equations(columns: Floats, target: Floats) -> Floats:
    """Return ``least_squares`` by normal equations: less accurate, at a tenth of the cost."""
    scale = np.maximum(np.sqrt(np.einsum("ij,ij->j", columns, columns)), ZERO_LENGTH)
    gram = (columns.T @ columns) / np.outer(scale, scale) + 1e-12 * np.eye(scale.size)
    return np.asarray(np.linalg.solve(gram, columns.T @ target / scale) / scale)


def _search_nonlinear(
    table: Table, laws: Sequence[str], mask: Mask, begin: NonlinearValues, fixed: Mapping[str, float]
) -> dict[str, tuple[float, ...]]:
    """Return the nonlinear parameters that minimise the residual after the linear parameters are solved for."""
    free = _free_nonlinear(begin, fixed)
    held = {name: list(values) for name, values in begin.items()}
    if not free:
        return dict(begin)
    parameters = [LAWS[name].nonlinear_parameters[k] for name, k in free]
    scales = [parameter.scale_in(table.stretches) for parameter in parameters]

    def at(z: Floats) -> dict[str, tuple[float, ...]]:
        values = {name: list(row) for name, row in held.items()}
        for (name, k), parameter, scale, coordinate in zip(free, parameters, scales, z, strict=True):
            share = float(np.exp(coordinate)) if parameter.logarithmic else float(coordinate)
            values[name][k] = scale * share
        return {name: tuple(row) for name, row in values.items()}

    def left(z: Floats) -> Floats:
        table.raise_if_cancelled()
        _, columns, target = _linear_part(table, laws, at(z), fixed)
        columns, target = columns[mask], target[mask]
        return np.asarray(target - columns @ _normal_equations(columns, target))

    first, low, high = [], [], []
    for (name, k), parameter, scale in zip(free, parameters, scales, strict=True):
        share = held[name][k] / scale
        ends = (parameter.low, parameter.high)
        if parameter.scale is ParameterScale.PITCH:  # half a wave more or fewer along the travel
            ends = (share / (1.0 + 0.5 * share), share / (1.0 - 0.5 * share))
        z, *bounds = np.log([share, *ends]) if parameter.logarithmic else (share, *ends)
        low.append(bounds[0])
        high.append(bounds[1])
        first.append(np.clip(z, *bounds))
    from scipy import optimize  # 17 MB and 0.17 s, which a window does not need

    width = np.subtract(high, low)
    found = optimize.least_squares(
        left, first, bounds=(low, high), x_scale=width, jac=_differences(left, width), ftol=1e-6, xtol=1e-5
    )
    return at(found.x)


def _differences(left, width: Floats):  # type: ignore[no-untyped-def]
    def jacobian(z: Floats) -> Floats:
        out = []
        here = left(z)
        for k, scale in enumerate(width):
            moved = np.array(z)
            moved[k] += _STEP * scale
            out.append((left(moved) - here) / (_STEP * scale))
        return np.stack(out, axis=1)

    return jacobian


def _derivative(
    table: Table,
    laws: Sequence[str],
    nonlinear: NonlinearValues,
    fixed: Mapping[str, float],
    values: Floats,
    at: tuple[str, int],
) -> Floats:
    """Return the partial derivative of the modelled force with respect to nonlinear parameter ``at`` (law, index)."""
    name, k = at
    parameter = LAWS[name].nonlinear_parameters[k]
    width = parameter.scale_in(table.stretches) * (parameter.high - parameter.low)
    size = _STEP * (nonlinear[name][k] if parameter.logarithmic else width)
    sides = []
    for sign in (-1.0, 1.0):
        row = list(nonlinear[name])
        row[k] += sign * size
        _, columns, target = _linear_part(table, laws, {**nonlinear, name: tuple(row)}, fixed)
        sides.append(columns @ values - target)
    return np.asarray((sides[1] - sides[0]) / (2.0 * size))


def _covariance(columns: Floats, residual: Floats) -> Floats:
    scale = np.maximum(np.linalg.norm(columns, axis=0), ZERO_LENGTH)
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
