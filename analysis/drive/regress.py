"""Least squares on the force: what a motion takes, linear parameters solved for, bent ones searched around them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from analysis.drive.catalogue import BASE, LAWS, Span
from analysis.drive.table import Mask, Table
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisError

Floats = NDArray[np.float64]
BentValues = Mapping[str, tuple[float, ...]]  # of each law that has bent parameters
NOTHING = 1e-150  # a column's length, whose square is still a number: a law that acts nowhere in a motion is shorter
SAME = 1e-7  # of a column: less than this beside the others and it is one of them
_EVALUATIONS = 40
_STEP = 1e-3  # of a search coordinate, for the derivatives of what is bent


@dataclass(frozen=True, slots=True)
class Regression:
    """A solution over the samples of ``mask``; ``residual_n``, shape (m,), is over all of them, foretold ones too.

    ``tangents``, shape (m, free parameters), is how the modelled force moves with every parameter that was fitted.
    ``covariance`` is over ``names``, linear ones in the order of base and laws, then the bent ones; it carries the
    remainder's correlation in time (sums over blocks), so that a remainder of thousands of neighbouring samples is
    not taken for thousands of independent ones.
    """

    names: tuple[str, ...]
    values: Floats
    covariance: Floats
    laws: tuple[str, ...]
    bent: BentValues
    residual_n: Floats
    tangents: Floats
    mask: Mask
    independent_samples: float

    @property
    def rms_n(self) -> float:
        """Get the root mean square of what remains where it was fitted."""
        return rms(self.residual_n[self.mask])

    def foretold_n(self, held: Mask) -> float:
        """Return the root mean square of what remains on other samples."""
        return rms(self.residual_n[held])

    def quantity(self, name: str) -> Quantity:
        """Return a parameter by its name."""
        place = self.names.index(name)
        variance = float(self.covariance[place, place])
        return Quantity(float(self.values[place]), float(np.sqrt(max(0.0, variance))), "least squares on F")

    def parameters(self, law: str) -> dict[str, Quantity]:
        """Return the parameters of one law by their own names."""
        return {name: self.quantity(f"{law}.{name}") for name in LAWS[law].parameters}


def rms(values: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def delay_of(bent: BentValues) -> float:
    """Return how much later than the force the motion answers, in s."""
    return bent["drive_delay"][0] if "drive_delay" in bent else 0.0


def design(table: Table, laws: Sequence[str], bent: BentValues) -> Floats:
    """Return the columns of base and laws, shape (m, 3 + linear parameters)."""
    moving = [LAWS[name] for name in laws if LAWS[name].force is not None]
    return np.concatenate([table.base(), *(table.columns(law, bent.get(law.name, ())) for law in moving)], axis=1)


def coincide(columns: Floats) -> bool:
    """Return whether one of the columns (m, k) is a mixture of the others."""
    scale = np.linalg.norm(columns, axis=0)
    if not np.all(np.isfinite(scale)) or bool((scale == 0.0).any()):
        return True
    return bool(np.linalg.svd(columns / scale, compute_uv=False)[-1] < SAME**0.5)


def regress(
    table: Table,
    laws: Sequence[str] = (),
    mask: Mask | None = None,
    start: BentValues | None = None,
    fixed: Mapping[str, float] | None = None,
) -> Regression:
    """Return the least-squares solution of base and laws over the samples of ``mask`` (all by default).

    ``start`` says where the search of bent parameters begins; ``fixed`` holds parameters, by the names of the result,
    that are known.  Raises AnalysisError where the motion does not tell the columns apart, Cancelled.
    """
    table.check()
    mask = table.everything if mask is None else mask
    fixed = fixed or {}
    begin = {name: _begun(name, start or {}, fixed) for name in laws if LAWS[name].bent}
    bent = _searched(table, laws, mask, begin, fixed)
    linear, columns, target = _linear(table, laws, bent, fixed)
    if linear and coincide(columns[mask]):
        raise AnalysisError(_not_apart(laws))
    values = _solved(columns[mask], target[mask])
    residual = target - columns @ values
    free = [(name, k) for name in bent for k in range(len(bent[name])) if _called(name, k) not in fixed]
    slopes = [_slope(table, laws, bent, fixed, values, name, k) for name, k in free]
    whole = np.column_stack([columns, *slopes])
    names = (*linear, *(_called(name, k) for name, k in free))
    known = tuple(name for name in _all_names(laws) if name in fixed)
    covariance = np.zeros((len(names) + len(known),) * 2)
    covariance[: len(names), : len(names)] = _covariance(whole[mask], residual[mask])
    every = np.array([*values, *(bent[name][k] for name, k in free), *(fixed[name] for name in known)])
    order = [(*names, *known).index(name) for name in _all_names(laws)]
    return Regression(
        _all_names(laws), every[order], covariance[np.ix_(order, order)], tuple(laws), bent, residual, whole, mask,
        independent(residual[mask], table.record[mask]),
    )  # fmt: skip


def _begun(law: str, start: BentValues, fixed: Mapping[str, float]) -> tuple[float, ...]:
    given = start.get(law, (np.nan,) * len(LAWS[law].bent))
    return tuple(fixed.get(_called(law, k), value) for k, value in enumerate(given))


def _all_names(laws: Sequence[str]) -> tuple[str, ...]:
    linear = [f"{name}.{parameter}" for name in laws for parameter in LAWS[name].linear]
    return (*BASE, *linear, *(_called(name, k) for name in laws for k in range(len(LAWS[name].bent))))


def _called(law: str, k: int) -> str:
    return f"{law}.{LAWS[law].bent[k].name}"


def _linear(
    table: Table, laws: Sequence[str], bent: BentValues, fixed: Mapping[str, float]
) -> tuple[tuple[str, ...], Floats, Floats]:
    """Return the free linear parameters, their columns, and the force less what is known of it."""
    names = _all_names(laws)[: 3 + sum(len(LAWS[name].linear) for name in laws)]
    columns = design(table, laws, bent)
    target = table.force(delay_of(bent))
    for place, name in enumerate(names):
        if name in fixed:
            target = target - fixed[name] * columns[:, place]
    free = [place for place, name in enumerate(names) if name not in fixed]
    return tuple(names[place] for place in free), columns[:, free], target


def _solved(columns: Floats, target: Floats) -> Floats:
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    return np.asarray(np.linalg.lstsq(columns / scale, target, rcond=None)[0] / scale)


def _quickly(columns: Floats, target: Floats) -> Floats:
    """Return ``_solved`` by its normal equations: less exact, and a tenth of the work."""
    scale = np.maximum(np.sqrt(np.einsum("ij,ij->j", columns, columns)), NOTHING)
    gram = (columns.T @ columns) / np.outer(scale, scale) + 1e-12 * np.eye(scale.size)
    return np.asarray(np.linalg.solve(gram, columns.T @ target / scale) / scale)


def _searched(
    table: Table, laws: Sequence[str], mask: Mask, begin: BentValues, fixed: Mapping[str, float]
) -> dict[str, tuple[float, ...]]:
    """Return the bent parameters at which the linear ones leave least."""
    free = [(name, k) for name in begin for k in range(len(begin[name])) if _called(name, k) not in fixed]
    held = {name: list(values) for name, values in begin.items()}
    if not free:
        return dict(begin)
    knobs = [LAWS[name].bent[k] for name, k in free]
    scales = [knob.scaled(table.runs) for knob in knobs]

    def at(z: Floats) -> dict[str, tuple[float, ...]]:
        values = {name: list(row) for name, row in held.items()}
        for (name, k), knob, scale, coordinate in zip(free, knobs, scales, z, strict=True):
            share = float(np.exp(coordinate)) if knob.logarithmic else float(coordinate)
            values[name][k] = scale * share
        return {name: tuple(row) for name, row in values.items()}

    def left(z: Floats) -> Floats:
        table.check()
        _, columns, target = _linear(table, laws, at(z), fixed)
        columns, target = columns[mask], target[mask]
        return np.asarray(target - columns @ _quickly(columns, target))

    first, low, high, step = [], [], [], []
    for (name, k), knob, scale in zip(free, knobs, scales, strict=True):
        share = held[name][k] / scale
        ends = (knob.low, knob.high)
        if knob.span is Span.PITCH:  # one wave more or less along the travel is another ripple
            ends = (share / (1.0 + 0.5 * share), share / (1.0 - min(0.9, 0.5 * share)))
        ends = (float(np.log(ends[0])), float(np.log(ends[1]))) if knob.logarithmic else ends
        z = float(np.log(share)) if knob.logarithmic else share
        low.append(ends[0])
        high.append(ends[1])
        first.append(min(max(z, ends[0] + 1e-6 * (ends[1] - ends[0])), ends[1] - 1e-6 * (ends[1] - ends[0])))
        step.append(ends[1] - ends[0])
    found = least_squares(
        left, first, bounds=(low, high), x_scale=np.array(step) / 10.0, jac=_differences(left, step),
        ftol=1e-6, xtol=1e-5, max_nfev=_EVALUATIONS,
    )  # fmt: skip
    return at(found.x)


def _differences(left, width: Sequence[float]):  # type: ignore[no-untyped-def]
    def jacobian(z: Floats) -> Floats:
        out = []
        here = left(z)
        for k, span in enumerate(width):
            moved = np.array(z)
            moved[k] += _STEP * span
            out.append((left(moved) - here) / (_STEP * span))
        return np.stack(out, axis=1)

    return jacobian


def _slope(
    table: Table, laws: Sequence[str], bent: BentValues, fixed: Mapping[str, float], values: Floats, name: str, k: int
) -> Floats:
    """Return how the modelled force moves with a bent parameter, the linear ones as they are."""
    knob = LAWS[name].bent[k]
    size = _STEP * (bent[name][k] if knob.logarithmic else knob.scaled(table.runs) * (knob.high - knob.low))
    sides = []
    for sign in (-1.0, 1.0):
        row = list(bent[name])
        row[k] += sign * size
        _, columns, target = _linear(table, laws, {**bent, name: tuple(row)}, fixed)
        sides.append(columns @ values - target)
    return np.asarray((sides[1] - sides[0]) / (2.0 * size))


def _covariance(columns: Floats, residual: Floats) -> Floats:
    size = np.linalg.norm(columns, axis=0)
    scale = np.where(size > NOTHING, size, 1.0)
    scaled = columns / scale
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-13, hermitian=True)
    out = inverse @ _long_run(scaled * residual[:, None]) @ inverse
    return np.asarray(out / np.outer(scale, scale))


def _long_run(scores: Floats) -> Floats:
    """Return the covariance of the scores' sum, from sums over blocks longer than they remember; shape (k, k)."""
    length = max(1, round(4.0 * scores.shape[0] ** (1.0 / 3.0)))
    blocks = np.add.reduceat(scores, np.arange(0, scores.shape[0], length), axis=0)
    return np.asarray(blocks.T @ blocks)


def independent(residual: Floats, record: NDArray[np.int64]) -> float:
    """Return how many independent samples a remainder is worth: less what neighbours share.

    Where one record is much noisier than the others it alone decides what is left, so that theirs count for little
    (as in Kish's effective size of a weighted sample, 1965).
    """
    variance = float(residual @ residual)
    if variance == 0.0:
        return float(residual.size)
    shares, counts = np.bincount(record, residual**2) / variance, np.bincount(record)
    evenly = 1.0 / float(np.sum(shares**2 / np.maximum(counts, 1)))
    return evenly * variance / max(variance, float(_long_run(residual[:, None])[0, 0]))


def _not_apart(laws: Sequence[str]) -> str:
    if laws:
        named = ", ".join(name.replace("_", " ") for name in laws)
        return f"the motion does not tell {named} from the rest of the model"
    return "the motion does not tell mass, drag and offset apart: it needs more than one speed and acceleration"
