"""The rest beat: its phase as a smooth curve, and its tones on either side of a stretch that may lack samples.

The smooth phase, with its frequency and drift, is subtracted from the moving beat's phase.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.shot import AnalysisError, Floats, Quantity

_HIGHEST_DEGREE = 4
_NUMBER_OF_MEANS = 1024  # number of means to which the phases are averaged before curves are fitted
_MIN_CHI2_DECREASE = 25.0  # least decrease of chi^2 for a further term of the polynomial (5 sigma)
MAX_RESIDUAL_RATIO = 2.0  # times the noise variance on both sides: a larger residual is a gradual change, not a loss
MAX_FIRST_LOSS = 16  # most samples lost in the first of two losses within a few periods of the beat


@dataclass(frozen=True, slots=True)
class RestPhase:
    """The rest beat's smooth phase relative to the oscillator: a polynomial over ``middle_s`` +- ``half_s``."""

    coefficients: Floats  # Legendre
    middle_s: float
    half_s: float
    frequency_hz: Quantity  # mean over the record
    unsteady_cycles: float  # rms residual of the curve beyond noise, or that scaled from its means if this is larger
    degree: int

    def phase_at(self, time_s: Floats) -> Floats:
        """Return the phase in cycles relative to the oscillator, at times of shape (n,)."""
        return np.asarray(np.polynomial.Legendre(self.coefficients)((time_s - self.middle_s) / self.half_s))


def fit_rest_phase(time_s: Floats, phase_cycles: Floats, std_cycles: float, oscillator_hz: float) -> RestPhase:
    """Fit PD0's phase (NaN where not measured) with the polynomial of lowest degree that describes it.

    A straight line is a constant frequency; further terms are added only if each improves the fit by 5 sigma.  The
    uncertainty of the frequency is that of the slope, from the actual residual.
    """
    middle = 0.5 * (time_s[0] + time_s[-1])
    half = max(0.5 * (time_s[-1] - time_s[0]), 1e-12)
    u = (time_s - middle) / half
    known = np.isfinite(phase_cycles)
    each = max(1, int(known.sum()) // _NUMBER_OF_MEANS)
    count = int(known.sum()) // each
    mean_u = u[known][: count * each].reshape(count, each).mean(axis=1)
    mean_phase = phase_cycles[known][: count * each].reshape(count, each).mean(axis=1)
    best: tuple[int, Floats, float] | None = None
    for degree in range(1, _HIGHEST_DEGREE + 1):
        if count <= 4 * degree:
            break
        series = np.polynomial.Legendre.fit(mean_u, mean_phase, degree, domain=[-1, 1])
        left = float(np.sum((mean_phase - series(mean_u)) ** 2)) * each
        if best is None or best[2] - left > _MIN_CHI2_DECREASE * max(std_cycles, 1e-9) ** 2:
            best = (degree, np.asarray(series.coef, dtype=np.float64), left)
    if best is None:
        raise AnalysisError("reference channel: too short for a rest frequency")
    degree, coefficients, left = best
    series = np.polynomial.Legendre(coefficients)
    slow = np.sqrt(left / max(1, count - degree - 1))  # noise of a single phase if the means' residual were white
    remainder = max(slow, float(np.sqrt(np.mean((phase_cycles[known] - series(u[known])) ** 2))))
    std = np.sqrt(3.0 / known.sum()) * max(slow, std_cycles) / half
    mean = oscillator_hz + float(series(1.0) - series(-1.0)) / (2 * half)
    return RestPhase(
        coefficients,
        middle,
        half,
        Quantity(mean, float(std), f"PD0's phase over the record, polynomial of degree {degree}"),
        float(np.sqrt(max(0.0, remainder**2 - std_cycles**2))),
        degree,
    )


@dataclass(frozen=True, slots=True)
class LossResiduals:
    """The residuals of a stretch of the rest beat that may lack samples, from the tones fitted before and after it.

    ``before`` and ``after``, shape (n + 1,), are cumulative squared residuals of the samples ``x``, shape (n,), from
    each tone.  ``tone``, shape (n, 3), holds the beat's cosine, sine and level; ``solution``, shape (3,), the tone
    before.  ``limit`` is the sum of squares expected at most, ``jump`` the cycles between the tones, ``sigma`` its std.
    """

    x: Floats
    tone: Floats
    solution: Floats
    before: Floats
    after: Floats
    limit: float
    jump: float
    sigma: float

    @classmethod
    def of(cls, x: Floats, near: int, guard: int, turns: float) -> "LossResiduals":
        """Fit tones of ``turns`` cycles per sample to all but ``guard`` samples on each side of sample ``near``."""
        tone = np.column_stack([tone_columns(turns * np.arange(x.size, dtype=np.float64)), np.ones(x.size)])
        sides = (slice(0, near - guard), slice(near + guard, x.size))
        solutions: list[Floats] = [np.asarray(np.linalg.lstsq(tone[side], x[side], rcond=None)[0]) for side in sides]
        errors = [(x - tone @ solution) ** 2 for solution in solutions]
        noise = float(np.mean([error[side].mean() for error, side in zip(errors, sides, strict=True)]))
        within = slice(near - guard, near + guard)
        amplitude = float(np.hypot(*solutions[0][:2]))
        return cls(
            x[within],
            tone[within],
            solutions[0],
            cumulative(errors[0][within]),
            cumulative(errors[1][within]),
            2 * guard * (MAX_RESIDUAL_RATIO * noise + 1.0),
            phase_jump(solutions),
            np.sqrt(noise) / max(amplitude, 1e-9) / (2 * np.pi) * np.sqrt(4.0 / max(near - guard, 8)),
        )

    def two_losses(self, turns: float) -> tuple[float, int, int, int]:
        """Return (squared residual with two losses, place of the first, distance to the second, size of the first)."""
        best = (float(np.inf), 0, 0, 0)
        cosine, sine, level = self.solution
        for count in range(1, MAX_FIRST_LOSS + 1):
            turn = 2 * np.pi * turns * count
            moved = (cosine * np.cos(turn) + sine * np.sin(turn), sine * np.cos(turn) - cosine * np.sin(turn), level)
            between = cumulative((self.x - self.tone @ np.array(moved)) ** 2)
            entered = self.before - between
            left = np.minimum.accumulate(entered) + between - self.after
            last = int(left.argmin())
            first = int(entered[: last + 1].argmin())
            best = min(best, (float(left[last] + self.after[-1]), first, last - first, count), key=lambda one: one[0])
        return best


def phase_jump(solutions: Sequence[Floats]) -> float:
    """Return the phase difference in cycles of two tones, each given by the coefficients of its cosine and sine."""
    before, after = (float(np.arctan2(-s[1], s[0])) / (2 * np.pi) for s in solutions)
    return after - before


def tone_columns(cycles: Floats) -> Floats:
    """Return cosine and sine of phases in cycles, shape (n, 2)."""
    turn = 2 * np.pi * cycles
    return np.stack([np.cos(turn), np.sin(turn)], axis=1)


def cumulative(values: Floats) -> Floats:
    """Return the cumulative sums, beginning with 0, shape (n + 1,)."""
    return np.asarray(np.concatenate([[0.0], np.cumsum(values)]))
