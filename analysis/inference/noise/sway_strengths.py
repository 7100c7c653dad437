"""How strongly a frame swayed, by all of a shot: the strengths of octaves that flights and contact show together.

Flights alone tell the slow octaves badly, as each has a place and a speed of its own, and what struck the frame during
the contact they do not tell at all.  What a fit leaves of a shot is the beat's noise, the sway, and what its parameters
can make up for; so the strengths are those of greatest restricted likelihood (Patterson & Thompson, Biometrika 58,
1971) beside the fit's derivatives, with what is known of floors before.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from analysis.reading.octaves import Octaves
from analysis.reading.strengths import points_about, powers_of, prior_of
from analysis.shot.disturbance import Shaking

Floats = NDArray[np.float64]

_ITERATIONS, _ENOUGH, _MOST = 20, 1e-2, 3.0  # steps, in log-likelihood, in the logarithm of a strength
_ROUNDING = 1e-13
_LEAST = 1e-30  # m^2/Hz: less is nothing


@dataclass(frozen=True, slots=True)
class Waves:
    """What a frame's sway is made of: octaves of a floor, and lines of known frequency (l,) and power (l,)."""

    octaves: Octaves
    line_hz: Floats
    line_m2: Floats

    @classmethod
    def of(cls, shaking: Shaking, span_s: float, highest_hz: float) -> "Waves":
        """Lay octaves over a stretch of ``span_s`` beside the lines of what shakes."""
        lines = ~shaking.random
        octaves = Octaves.over(span_s, highest_hz)
        return cls(octaves, shaking.frequency_hz[lines], shaking.power_m2[lines])

    @property
    def frequency_hz(self) -> Floats:
        """Get the frequencies, (f,): the octaves' and then the lines'."""
        return np.concatenate([self.octaves.frequency_hz, self.line_hz])

    def power_m2(self, at: Floats) -> Floats:
        """Return what stands at each, (f,), where the octaves' powers have these logarithms, (k,)."""
        return np.concatenate([powers_of(at) @ self.octaves.power_m2, self.line_m2])

    def shaking(self, power_m2: Floats) -> Shaking:
        """Return them as what moves a frame."""
        frequency = self.frequency_hz
        order = np.argsort(frequency, kind="stable")
        random = np.arange(frequency.size) < self.octaves.frequency_hz.size
        return Shaking(frequency[order], power_m2[order], random[order])

    def start(self, shaking: Shaking) -> Floats:
        """Return the logarithms (k,) of the octaves that are as strong as what is known to shake."""
        known = shaking.frequency_hz[shaking.random]
        if known.size < 2:
            return np.zeros(self.octaves.centre_hz.size)
        density = np.interp(self.octaves.centre_hz, known, shaking.power_m2[shaking.random] / np.gradient(known))
        alone = self.octaves.density(powers_of(np.zeros(self.octaves.centre_hz.size)), self.octaves.centre_hz)
        return np.asarray(np.log(np.maximum(density, _LEAST) / alone))


@dataclass(frozen=True, slots=True)
class SeenThrough:
    """A fit's residual r and derivatives J as the beat's noise leaves them white, seen along a basis of all sways.

    ``waves``, shape (m, w), are unit sways in an orthonormal basis, cosines and then sines; ``along``, shape
    (m, 1 + q), is what (r, J) have in it; ``beside``, shape (1 + q, 1 + q), are the products of what lies beside it,
    with what is known of the parameters before.
    """

    waves: Floats
    along: Floats
    beside: Floats

    def normal(self, power_m2: Floats) -> Floats:
        """Return (r, J)^T V^-1 (r, J), shape (1 + q, 1 + q), where sways have these powers, shape (w / 2,)."""
        white = solve_triangular(self._root(power_m2), self.along, lower=True, check_finite=False)
        return np.asarray(self.beside + white.T @ white)

    def _root(self, power_m2: Floats) -> Floats:
        """Return the Cholesky factor, shape (m, m), of V in the basis."""
        half = self.waves * np.sqrt(np.tile(power_m2, 2))
        inside = half @ half.T
        inside[np.diag_indices_from(inside)] += 1.0 + _ROUNDING * float(np.trace(inside))
        return np.asarray(cholesky(inside, lower=True, overwrite_a=True, check_finite=False))

    def likelihood(self, waves: Waves, at: Floats) -> tuple[float, Floats, Floats]:
        """Return the restricted log-likelihood with the prior's, its gradient (k,) and expected curvature (k, k)."""
        power = waves.power_m2(at)
        low = self._root(power)
        white = solve_triangular(low, np.hstack([self.along, self.waves]), lower=True, check_finite=False)
        seen, unit = white[:, : self.along.shape[1]], white[:, self.along.shape[1] :]
        normal = self.beside + seen.T @ seen
        size = np.sqrt(np.diag(normal)[1:])
        inner = np.linalg.cholesky(normal[1:, 1:] / np.outer(size, size))
        taken = solve_triangular(inner, normal[1:, 0] / size, lower=True)
        design = solve_triangular(inner, (seen[:, 1:] / size).T, lower=True)
        mean, precision = prior_of(at.size)
        pull = precision @ (at - mean)
        logs = float(np.log(np.diag(low)).sum() + np.log(np.diag(inner)).sum() + np.log(size).sum())
        value = -logs - 0.5 * (normal[0, 0] - float(taken @ taken)) - 0.5 * float((at - mean) @ pull)
        shown = design @ unit
        told = unit.T @ seen[:, 0] - shown.T @ taken
        spread = unit.T @ unit - shown.T @ shown
        each = powers_of(at)[:, None] * waves.octaves.power_m2
        each = np.tile(np.pad(each, ((0, 0), (0, waves.line_m2.size))), 2)
        slope = 0.5 * each @ (told**2 - np.diag(spread)) - pull
        return value, slope, 0.5 * each @ spread**2 @ each.T + precision


def learn(seen: SeenThrough, waves: Waves, start: Floats) -> tuple[Floats, tuple[Floats, ...]]:
    """Return the likeliest logarithms of the octaves' powers, (k,), and points that stand for all likely ones.

    Fisher scoring.  Cost: some 10 ms an iteration at 160 waves and 300 splines, some six.
    """
    at = start
    value, slope, curve = seen.likelihood(waves, at)
    for _ in range(_ITERATIONS):
        step = np.linalg.solve(curve, slope)
        if float(step @ slope) < _ENOUGH:
            break
        step *= min(1.0, _MOST / float(np.abs(step).max()))
        for _ in range(5):
            found = seen.likelihood(waves, at + step)
            if found[0] > value - 1e-6:
                break
            step = 0.35 * step
        else:
            break
        at = at + step
        value, slope, curve = found
    return at, points_about(at, curve)
