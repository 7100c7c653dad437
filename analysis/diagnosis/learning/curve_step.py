"""One step towards the curve that explains the shots best, its smoothing set by restricted maximum likelihood.

Patterson and Thompson, Biometrika 58 (1971) 545; Wood, J. R. Stat. Soc. B 73 (2011) 3.
"""

import math
from collections.abc import Sequence

import numpy as np

from analysis.diagnosis.learning.curve_motion import Term
from analysis.inference import damped_step
from analysis.shot import Floats

_RIDGE = 1e-9  # of each coefficient's own curvature: keeps what no shot visits at rest


def penalised_step(
    rows: Floats, base: int, terms: Sequence[Term], *, samples: int | None = None
) -> tuple[Floats, Floats, float]:
    """Return the step of all numbers, the smoothing of the coefficients and their effective freedom.

    Smoothing by restricted maximum likelihood of the linearised problem, one number for each curve.  ``samples`` is
    how many samples ``rows`` stand for, where they were turned onto fewer.
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
