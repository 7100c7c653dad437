"""How strongly a site shook the shots: white noise and the strengths of its bands, by maximum likelihood.

Along a shot's basis the covariance is white noise plus each band's share; beside it there is white noise alone.  The
strengths have a prior: neighbouring bands are as the flights' readings say within a factor, their level is free, and
a line is about as strong as it was read.  Fisher scoring, all shots at once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from analysis.diagnosis.fits.samples import Samples
from analysis.diagnosis.noise.floor import Floor, white_floor
from analysis.diagnosis.noise.site import Site, Sway, root_of

Floats = NDArray[np.float64]
_NEIGHBOURS = 1.0  # std of the logarithm of a strength beside its neighbour's
_LEVEL = 6.0  # of each band's by itself
_LINE = 2.0  # of a line's
_ITERATIONS, _ENOUGH, _MOST = 20, 5e-3, 3.0  # steps, in log-likelihood, in the logarithm of a strength
_AS_PROMISED = 0.15  # of what a step promises to first order: half of it is gained where the curvature is right


@dataclass(frozen=True, slots=True)
class _Shot:
    """What is left of a shot: ``along`` the basis, shape (r,), and the square of what lies ``beside`` it, in m."""

    sway: Sway
    along: Floats
    beside: float
    samples: int
    weight: float


def learn(
    series: Sequence[Floats], shots: Sequence[Samples], site: Site, spacing_s: float, start: Floor | None = None
) -> tuple[Floor, float]:
    """Return the likeliest floor of what is left of shots (``series``, in m) at a site, and the log-likelihood.

    Cost: some 10 ms for three shots.
    """
    parts = []
    for values, shot in zip(series, shots, strict=True):
        assert shot.sway is not None
        left = values[shot.valid]
        along = shot.sway.basis.T @ left
        parts.append(_Shot(shot.sway, along, max(float(left @ left - along @ along), 0.0), left.size, shot.weight))
    at = np.zeros(1 + site.bands)
    if start is not None and start.site:
        at[:] = 2.0 * math.log(start.white_m), *start.site
    else:
        freedom = sum(part.samples - part.along.size for part in parts)
        at[0] = math.log(max(sum(part.beside / part.weight**2 for part in parts) / freedom, 1e-40))
    precision = _prior(site)
    value, slope, waves = _likelihood(at, parts, precision)
    curve = _curvature(waves, parts, precision)
    for _ in range(_ITERATIONS):
        step = np.linalg.solve(curve, slope)
        promise = float(step @ slope)
        if promise < _ENOUGH:
            break
        step *= min(1.0, _MOST / float(np.abs(step).max()))
        for _ in range(5):
            found = _likelihood(at + step, parts, precision)
            if found[0] > value:
                break
            step = 0.3 * step
        else:
            break
        gained, at = found[0] - value, at + step
        value, slope, waves = found
        if abs(gained / promise - 0.5) > _AS_PROMISED:  # the curvature is another one here
            curve = _curvature(waves, parts, precision)
    white_m = math.exp(0.5 * at[0])
    return replace(white_floor(white_m, spacing_s), site=tuple(float(a) for a in at[1:])), value


def _likelihood(at: Floats, shots: Sequence[_Shot], precision: Floats) -> tuple[float, Floats, list[Floats]]:
    """Return log-likelihood with the prior's, its gradient by (ln white^2, strengths), and each shot's white waves."""
    pull = precision @ at[1:]
    value = -0.5 * float(at[1:] @ pull)
    slope = np.concatenate([[0.0], -pull])
    every = []
    for shot in shots:
        variance = math.exp(at[0]) * shot.weight**2
        white_m, band = math.sqrt(variance), shot.sway.band
        scaled = shot.sway.scaled(white_m, at[1:])
        root = root_of(scaled)
        both = np.column_stack([shot.along / white_m, scaled])
        both = solve_triangular(root, both, lower=True, check_finite=False)
        white, waves = both[:, 0], both[:, 1:]
        square = float(white @ white) + shot.beside / variance
        logs = 2.0 * float(np.log(np.diag(root)).sum()) + shot.samples * math.log(2 * math.pi * variance)
        value -= 0.5 * (logs + square)
        seen = np.bincount(band, (waves.T @ white) ** 2, pull.size)
        told = np.bincount(band, np.einsum("ij,ij->j", waves, waves), pull.size)
        slope[1:] += 0.5 * (seen - told)
        slope[0] += 0.5 * (square - float(seen.sum()) - (shot.samples - float(told.sum())))
        every.append(waves)
    return value, slope, every


def _curvature(every: Sequence[Floats], shots: Sequence[_Shot], precision: Floats) -> Floats:
    """Return the expected curvature by (ln white^2, strengths)."""
    curve = np.zeros((1 + precision.shape[0],) * 2)
    curve[1:, 1:] = precision
    for waves, shot in zip(every, shots, strict=True):
        of = (shot.sway.band[:, None] == np.arange(precision.shape[0])).astype(np.float64)
        shared = of.T @ (waves.T @ waves) ** 2 @ of
        told = of.T @ np.einsum("ij,ij->j", waves, waves)
        across = 0.5 * (told - shared.sum(axis=1))
        curve[1:, 1:] += 0.5 * shared
        curve[0, 1:] += across
        curve[1:, 0] += across
        curve[0, 0] += 0.5 * (shot.samples - 2.0 * float(told.sum()) + float(shared.sum()))
    return curve


def _prior(site: Site) -> Floats:
    """Return the precision of the strengths' logarithms before anything is seen, shape (bands, bands)."""
    precision = np.diag(np.where(np.arange(site.bands) < site.random_bands, _LEVEL, _LINE) ** -2.0)
    for k in range(site.random_bands - 1):
        precision[k : k + 2, k : k + 2] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / _NEIGHBOURS**2
    return precision
