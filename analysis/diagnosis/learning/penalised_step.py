"""One Gauss-Newton step of a free curve, with smoothing set by restricted maximum likelihood.

Patterson and Thompson, Biometrika 58 (1971) 545; Wood, J. R. Stat. Soc. B 73 (2011) 3.
"""

import math
from collections.abc import Sequence

import numpy as np

from analysis.diagnosis.learning.curve_motion import Term
from analysis.inference import damped_step
from analysis.shot import Floats

_GRID = np.arange(-34.0, 14.0, 1.5)  # ln of a smoothing in units of the curve's own curvature
_NEIGHBOURS = 16  # points of the grid per diagonalisation
_RIDGE = 1e-9  # of each coefficient's own curvature: keeps coefficients that no shot constrains near zero


def penalised_step(
    rows: Floats, base: int, terms: Sequence[Term], *, samples: int | None = None
) -> tuple[Floats, Floats, float]:
    """Return the step of all parameters, the smoothing penalty of the coefficients, and their effective number.

    The smoothing is one number per curve, from restricted maximum likelihood of the linearised problem.  ``samples``
    is the number of samples that ``rows`` represent, if they were reduced to fewer rows.
    """
    left, fixed, free = rows[:, 0], rows[:, 1 : 1 + base], rows[:, 1 + base :]
    now = np.concatenate([term.coefficients for term in terms])
    target = left + free @ now
    scale = np.linalg.norm(fixed, axis=0)
    basis, _ = np.linalg.qr(fixed / np.where(scale > 0, scale, 1.0))
    target_in = target - basis @ (basis.T @ target)
    free_in = free - basis @ (basis.T @ free)
    a, b, s = free_in.T @ free_in, free_in.T @ target_in, float(target_in @ target_in)
    penalty, solution = _smoothing(a, b, s, (samples or rows.shape[0]) - base, terms)
    total = a + penalty
    freedom = float(np.trace(np.linalg.solve(total, a)))
    rest = left - free @ (solution - now)
    own = np.linalg.lstsq(fixed / np.where(scale > 0, scale, 1.0), rest, rcond=1e-12)[0] / np.where(
        scale > 0, scale, 1.0
    )
    return np.concatenate([own, solution - now]), penalty, freedom


def damped(rows: Floats, terms: Sequence[Term], penalty: Floats, damping: float) -> Floats | None:
    """Return the step of all parameters, damped in directions that the shots hardly constrain; or None."""
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
    for _ in range(1 if len(terms) == 1 else 3):
        for k, size in enumerate(sizes):
            alone = np.zeros_like(a)
            alone[edges[k] : edges[k + 1], edges[k] : edges[k + 1]] = shapes[k]
            others = a + ridge + whole([-math.inf if i == k else log for i, log in enumerate(logs)])
            value = (size - 2) * _GRID / 2 + _likelihoods(others, alone, b, s, free_samples)
            logs[k] = float(_GRID[int(np.argmax(value))])
    penalty = whole(logs) + ridge
    return penalty, np.asarray(np.linalg.solve(a + penalty, b), dtype=np.float64)


def _likelihoods(a: Floats, shape: Floats, b: Floats, s: float, free_samples: int) -> Floats:
    """Return ln L of the smoothings exp(_GRID) of one curve; -inf where the matrix is not positive definite.

    The matrix and its smoothing are diagonalised jointly, for a few neighbouring grid points at once: further away,
    rounding would hide a small smoothing.
    """
    out, first = np.full(_GRID.size, -math.inf), 0
    while first < _GRID.size:
        some = slice(first, first + _NEIGHBOURS)
        least = math.exp(_GRID[first])
        try:
            factor = np.linalg.cholesky(a + least * shape)
        except np.linalg.LinAlgError:
            first += 1
            continue
        turned = np.linalg.solve(factor, np.linalg.solve(factor, shape).T)
        values, vectors = np.linalg.eigh(turned)
        half = (vectors.T @ np.linalg.solve(factor, b)) ** 2
        grown = 1.0 + np.outer(np.exp(_GRID[some]) - least, np.maximum(values, 0.0))
        rss = np.maximum(s - (half / grown).sum(axis=1), 1e-300)
        determinant = np.log(np.diag(factor)).sum() + 0.5 * np.log(grown).sum(axis=1)
        out[some] = -0.5 * free_samples * np.log(rss) - determinant
        first += _NEIGHBOURS
    return out
