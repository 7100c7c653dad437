"""Statistics over several shots: each number's mean, its repeatability, and its trend with impact speed."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.shot import Floats, NotSeen, Quantity, Reading, Shot, to_json
from analysis.uncertainty.numbers import ResultNumber, series_numbers

MIN_SPEED_RANGE = 0.02  # least range of speeds, relative to their mean, that can show a trend
COLUMNS = (
    "quantity",
    "unit",
    "shots",
    "mean",
    "mean_std",
    "scatter",
    "repeatability",
    "slope_per_m_per_s",
    "slope_std",
    "value_at_mean_speed",
    "value_at_mean_speed_std",
    "mean_speed_m_per_s",
    "repeatability_about_trend",
)


@dataclass(frozen=True, slots=True)
class Trend:
    """A straight line over impact speed; its uncertainties include the scatter about it."""

    slope: Quantity  # unit of the number per m/s
    at_mean_speed: Quantity
    mean_speed_m_per_s: float
    repeatability: float  # scatter of the shots about the line, beyond their own uncertainties

    @property
    def significance(self) -> float:
        """Get the ratio of the slope's magnitude to its standard uncertainty."""
        return abs(self.slope.value) / self.slope.std if self.slope.std > 0.0 else math.inf

    def at(self, speed_m_per_s: float) -> float:
        return self.at_mean_speed.value + self.slope.value * (speed_m_per_s - self.mean_speed_m_per_s)


@dataclass(frozen=True, slots=True)
class Summary:
    """One number over a series of shots; arrays have shape (n,), without shots from which the number was not read.

    ``scatter`` is the standard deviation between the shots, ``repeatability`` the part beyond the shots' own
    uncertainties; both are NaN for a single shot.
    """

    key: str
    words: str
    unit: str
    shots: tuple[str, ...]
    speeds_m_per_s: Floats
    values: Floats
    stds: Floats
    mean: Reading
    scatter: float
    repeatability: float
    trend: Trend | NotSeen


@dataclass(frozen=True, slots=True)
class Series:
    shots: tuple[str, ...]
    speeds: tuple[Reading, ...]
    readings: tuple[Mapping[str, Reading], ...]
    summaries: tuple[Summary, ...]

    def of(self, key: str) -> Summary | None:
        return next((summary for summary in self.summaries if summary.key == key), None)


def speed(shot: Shot) -> Reading:
    """Return a shot's impact speed |v_i| in m/s."""
    if shot.impact is None:
        return NotSeen(shot.problem or "no impact")
    into = shot.impact.velocity_in_m_per_s
    return into if isinstance(into, NotSeen) else Quantity(abs(into.value), into.std, into.how)


def series(shots: Sequence[Shot]) -> Series:
    """Return the statistics over the shots that have an impact speed, in order of speed."""
    numbers = series_numbers()
    seen = [(shot, v) for shot in shots if isinstance(v := speed(shot), Quantity)]
    seen.sort(key=lambda pair: pair[1].value)
    readings = tuple({number.key: number.find(shot) for number in numbers} for shot, _ in seen)
    names = tuple(shot.name for shot, _ in seen)
    speeds = [v for _, v in seen]
    summaries = [_summary(number, names, speeds, [r[number.key] for r in readings]) for number in numbers]
    return Series(names, tuple(speeds), readings, tuple(s for s in summaries if s is not None))


def excess_spread(values: Floats, stds: Floats, degree: int = 0, at: Floats | None = None) -> float:
    """Return the standard deviation between shots beyond their own uncertainties (R. C. Paule and J. Mandel, 1982).

    ``values`` and ``stds`` have shape (n,).  The result is the s that, added to ``stds`` in quadrature, makes the sum
    of weighted squares about the mean (or about a polynomial of ``degree`` over ``at``) equal its degrees of freedom;
    0 if the uncertainties explain the scatter.
    """
    freedom = values.size - degree - 1
    if freedom < 1:
        return math.nan
    design = np.vander(np.zeros(values.size) if at is None else at, degree + 1, increasing=True)

    def too_large(excess: float) -> bool:
        return _weighted(design, values, np.hypot(stds, excess))[2] > freedom

    if (stds > 0.0).all() and not too_large(0.0):
        return 0.0
    low, high = 0.0, float(np.ptp(values)) + float(stds.max())
    if high == 0.0:
        return 0.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if too_large(middle) else (low, middle)
    return high


def series_rows(result: Series) -> list[list[str]]:
    """Return the summaries as CSV rows, ``COLUMNS`` first; unknown values are empty fields."""
    rows = [list(COLUMNS)]
    for s in result.summaries:
        cells: list[float | None] = [s.mean.value, s.mean.std] if isinstance(s.mean, Quantity) else [None, None]
        cells += [s.scatter, s.repeatability]
        if isinstance(s.trend, Trend):
            t = s.trend
            cells += [t.slope.value, t.slope.std, t.at_mean_speed.value, t.at_mean_speed.std, t.mean_speed_m_per_s]
            cells.append(t.repeatability)
        else:
            cells += [None] * 6
        rows.append([s.key, s.unit, str(len(s.shots)), *(_cell(value) for value in cells)])
    return rows


def series_result(result: Series) -> dict[str, Any]:
    """Return the summaries for a result file; NaN and missing values become null."""
    return {
        "shots": list(result.shots),
        "speed_m_per_s": [to_json(v) for v in result.speeds],
        "quantities": {
            s.key: {
                "unit": s.unit,
                "mean": to_json(s.mean),
                "scatter": _finite(s.scatter),
                "repeatability": _finite(s.repeatability),
                "trend": {
                    "slope_per_m_per_s": to_json(s.trend.slope),
                    "at_mean_speed": to_json(s.trend.at_mean_speed),
                    "mean_speed_m_per_s": s.trend.mean_speed_m_per_s,
                    "repeatability": _finite(s.trend.repeatability),
                }
                if isinstance(s.trend, Trend)
                else None,
            }
            for s in result.summaries
        },
    }


def _summary(
    number: ResultNumber, names: Sequence[str], speeds: Sequence[Quantity], readings: Sequence[Reading]
) -> Summary | None:
    seen = [
        (name, v.value, r.value, r.std)
        for name, v, r in zip(names, speeds, readings, strict=True)
        if isinstance(r, Quantity) and math.isfinite(r.value) and math.isfinite(r.std)
    ]
    if not seen:
        return None
    at, values, stds = (np.array([row[i] for row in seen]) for i in (1, 2, 3))
    spread = excess_spread(values, stds)
    mean = _mean(values, stds, 0.0 if math.isnan(spread) else spread)
    scatter = float(np.std(values, ddof=1)) if values.size > 1 else math.nan
    shots = tuple(row[0] for row in seen)
    trend = _trend(at, values, stds)
    return Summary(number.key, number.words, number.unit, shots, at, values, stds, mean, scatter, spread, trend)


def _mean(values: Floats, stds: Floats, spread: float) -> Reading:
    total = np.hypot(stds, spread)
    if not (total > 0.0).all():
        return Quantity(float(values.mean()), 0.0, "plain mean: no uncertainty is known")
    (value,), inverse, _ = _weighted(np.ones((values.size, 1)), values, total)
    return Quantity(float(value), float(np.sqrt(inverse[0, 0])), f"mean of {values.size}, weighted, with repeatability")


def _trend(at: Floats, values: Floats, stds: Floats) -> Trend | NotSeen:
    if values.size < 2 or np.ptp(at) < MIN_SPEED_RANGE * at.mean():
        return NotSeen("one shot" if values.size < 2 else "all shots at one speed")
    mean = float(at.mean())
    spread = excess_spread(values, stds, 1, at - mean)  # NaN with two shots: the line goes through both
    total = np.hypot(stds, 0.0 if math.isnan(spread) else spread)
    if not (total > 0.0).all():
        return NotSeen("no uncertainty is known")
    solution, inverse, _ = _weighted(np.vander(at - mean, 2, increasing=True), values, total)
    how = f"line through {values.size} shots, weighted"
    return Trend(
        slope=Quantity(float(solution[1]), float(np.sqrt(inverse[1, 1])), how),
        at_mean_speed=Quantity(float(solution[0]), float(np.sqrt(inverse[0, 0])), how),
        mean_speed_m_per_s=mean,
        repeatability=spread,
    )


def _weighted(design: Floats, values: Floats, stds: Floats) -> tuple[Floats, Floats, float]:
    """Return (solution, covariance, sum of weighted squares) of a weighted least-squares fit."""
    if not (stds > 0.0).all():
        return np.zeros(design.shape[1]), np.zeros((design.shape[1],) * 2), math.inf
    scaled = design / stds[:, None]
    inverse = np.linalg.pinv(scaled)
    solution = inverse @ (values / stds)
    residual = values / stds - scaled @ solution
    return solution, inverse @ inverse.T, float(residual @ residual)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _cell(value: float | None) -> str:
    return "" if value is None or not math.isfinite(value) else repr(float(value))
