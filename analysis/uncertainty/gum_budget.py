"""The uncertainty budget of a shot by the GUM (JCGM 100:2008), with every source listed and types A and B separate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from uncertainties.core import AffineScalarFunc

from analysis.shot import Quantity, Reading, Shot
from analysis.uncertainty.budget_sources import BudgetRow, InstrumentUncertainty, ShotSources
from analysis.uncertainty.numbers import NUMBERS, ResultNumber
from analysis.uncertainty.series_statistics import MIN_SPEED_RANGE, excess_spread, speed

COVERAGE_FACTOR = 2.0
SIMILAR_SPEED = 0.1  # largest relative difference of impact speed of shots compared for repeatability
MIN_SHOTS_FOR_LINE = 4
COLUMNS = (
    "shot",
    "quantity",
    "unit",
    "value",
    "source",
    "type",
    "u_x",
    "u_x_unit",
    "sensitivity",
    "contribution",
    "how",
)


@dataclass(frozen=True, slots=True)
class QuantityBudget:
    """One result with all its sources of uncertainty, the largest contribution first."""

    key: str  # the result file's name; "cor_kinetic.onsets" for a nested one
    words: str
    unit: str
    value: float
    rows: tuple[BudgetRow, ...]

    @property
    def std_a(self) -> float:
        return math.hypot(*(row.contribution for row in self.rows if row.kind == "A"))

    @property
    def std_b(self) -> float:
        return math.hypot(*(row.contribution for row in self.rows if row.kind == "B"))

    @property
    def std(self) -> float:
        return math.hypot(self.std_a, self.std_b)

    @property
    def expanded(self) -> float:
        """Get the expanded uncertainty, k = 2 (about 95 %)."""
        return COVERAGE_FACTOR * self.std

    @property
    def quantity(self) -> Quantity:
        return Quantity(self.value, self.std, "uncertainty budget")


@dataclass(frozen=True, slots=True)
class Budget:
    shot: str
    quantities: tuple[QuantityBudget, ...]

    def of(self, key: str) -> QuantityBudget | None:
        return next((q for q in self.quantities if q.key == key), None)


def budget(shot: Shot, instrument: InstrumentUncertainty | None = None, others: Sequence[Shot] = ()) -> Budget:
    """Return the uncertainty budget of a shot's velocities, force, stiffness and restitution.

    ``others`` are shots of the same rig; those of similar speed determine the repeatability beyond the noise.
    Sensitivities are derivatives of the measurement equations by the ``uncertainties`` package, so a source common to
    two readings (wavelength, timebase, mass) cancels from their ratio.
    """
    sources = ShotSources(shot, instrument or InstrumentUncertainty())
    tables = []
    for result in NUMBERS:
        number = None if result.equation is None else result.equation(sources, result.find(shot), result.unit)
        if number is None:
            continue
        sources.results[result.key] = number
        if not isinstance(number, AffineScalarFunc) or not math.isfinite(number.nominal_value):
            continue
        size = abs(number.nominal_value)
        rows = [sources.row(variable, float(slope), size) for variable, slope in number.derivatives.items()]
        if result.repeats:
            rows.append(_repeatability(result, shot, others))
        rows.sort(key=lambda row: -row.contribution)
        tables.append(QuantityBudget(result.key, result.words, result.unit, float(number.nominal_value), tuple(rows)))
    return Budget(shot.name, tuple(tables))


def budget_result(result: Budget) -> dict[str, Any]:
    """Return the budget for a shot's entry in the result file (key "budget")."""
    return {
        "coverage_factor": COVERAGE_FACTOR,
        "quantities": {
            q.key: {
                "value": q.value,
                "unit": q.unit,
                "std_a": q.std_a,
                "std_b": q.std_b,
                "std": q.std,
                "expanded": q.expanded,
                "sources": [
                    {
                        "source": row.source,
                        "type": row.kind,
                        "std": row.std,
                        "unit": row.unit,
                        "sensitivity": row.sensitivity,
                        "contribution": row.contribution,
                        "how": row.how,
                    }
                    for row in q.rows
                ],
            }
            for q in result.quantities
        },
    }


def budget_rows(result: Budget) -> list[list[str]]:
    """Return the budget as CSV rows in the order of ``COLUMNS``; each result ends with its combined uncertainties."""
    rows: list[list[str]] = []
    for q in result.quantities:
        head = [result.shot, q.key, q.unit, repr(q.value)]
        for row in q.rows:
            std = "" if row.std is None else repr(row.std)
            rows.append(
                [*head, row.source, row.kind, std, row.unit, repr(row.sensitivity), repr(row.contribution), row.how]
            )
        for words, kind, value in (
            ("combined, type A", "A", q.std_a),
            ("combined, type B", "B", q.std_b),
            ("combined", "", q.std),
            (f"expanded, k = {COVERAGE_FACTOR:g}", "", q.expanded),
        ):
            rows.append([*head, words, kind, "", "", "", repr(value), ""])
    return rows


def _repeatability(of: ResultNumber, shot: Shot, others: Sequence[Shot]) -> BudgetRow:
    """Return the repeatability: the scatter of shots at similar speed beyond their own type A uncertainties."""
    unit, own = of.unit, speed(shot)
    readings = []
    if isinstance(own, Quantity):
        for other in (shot, *(o for o in others if o is not shot)):
            v, reading = speed(other), of.find(other)
            if (
                isinstance(v, Quantity)
                and isinstance(reading, Quantity)
                and abs(v.value - own.value) <= SIMILAR_SPEED * own.value
                and math.isfinite(reading.value)
                and math.isfinite(reading.std)
            ):
                readings.append((v.value, reading.value, reading.std))
    if len(readings) < 2:
        return BudgetRow("repeatability", "A", None, unit, 1.0, "not measured: no other shot at similar speed")
    speeds, values, stds = (np.array(column) for column in zip(*readings, strict=True))
    # a trend with speed is not scatter: with enough shots a line is subtracted
    sloped = len(readings) >= MIN_SHOTS_FOR_LINE and np.ptp(speeds) > MIN_SPEED_RANGE * speeds.mean()
    spread = excess_spread(values, stds, 1 if sloped else 0, speeds - speeds.mean())
    about = " about their line over speed" if sloped else ""
    how = f"scatter of {len(readings)} shots at similar speed{about}, beyond their own noise"
    return BudgetRow("repeatability", "A", spread, unit, 1.0, how)


def combined_uncertainties(shot: Shot) -> dict[str, float]:
    """Return the combined standard uncertainty of each number that has a budget, by key.  Cost: some ms."""
    return {q.key: q.std for q in budget(shot).quantities} if shot.impact is not None else {}


def with_combined_uncertainty(reading: Reading, key: str, combined: Mapping[str, float]) -> Reading:
    """Return a reading with the combined uncertainty of its key, or unchanged if the key has none."""
    std = combined.get(key)
    return replace(reading, std=std) if isinstance(reading, Quantity) and std is not None else reading
