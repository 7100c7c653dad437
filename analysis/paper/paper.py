"""Compare each printed number of the paper with this program's, and state the cause of each difference."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import StrEnum
from importlib import resources
from typing import TYPE_CHECKING, Any

from analysis.collision import Collision, Variant
from analysis.shot import NotSeen, Plate, Reading, Shot, to_json
from analysis.uncertainty import combined_uncertainties, read_number, with_combined_uncertainty

if TYPE_CHECKING:
    from analysis.paper.paper_audit import AuditValues, PaperRig


class Status(StrEnum):
    AGREES = "agrees"  # agrees as printed, within its digits
    TRACED = "traced"  # differs as printed, but agrees when the cause is taken into account
    OPEN = "open"  # the published numbers do not explain the remaining difference
    ADDED = "added"  # not in the paper; needed to understand it
    INPUT = "input"  # an input of the simulation


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperRow:
    """One number of the paper, with this program's values; differences are relative.

    ``printed`` is computed from the paper's numbers as printed, ``simulated`` by solving its model, and ``recomputed``
    from geometry or a closed form; ``recorded`` is the reading of a shot, if one was given.
    """

    key: str
    section: str
    what: str
    where: str
    unit: str
    paper: float | None = None
    paper_words: str = ""
    printed: float | None = None
    simulated: float | None = None
    recomputed: float | None = None
    recorded: Reading
    error_before: float | None = None
    error_after: float | None = None
    traced_to: str = ""
    status: Status


@dataclass(frozen=True, slots=True)
class Reproduction:
    title: str
    authors: str
    rows: tuple[PaperRow, ...]
    recording: str | None

    @property
    def open_rows(self) -> tuple[PaperRow, ...]:
        return tuple(row for row in self.rows if row.status is Status.OPEN)


_RECORDED = {  # row key: the shot's number of the same meaning
    "velocity_out": "velocity_out_m_per_s",
    "cor_quasi_static": "cor_quasi_static",
    "cor_force_peaks": "cor_kinetic.force_peaks",
    "cor_onsets": "cor_kinetic.onsets",
    "cor_flights": "cor_kinetic.flights",
    "cor_contact": "cor_kinetic.contact",
    "force_peak": "force_peak_n",
    "deflection": "deflection_max_m",
    "contact_time": "contact_time_s",
    "fwhm_measured": "force_fwhm_s",
    "slope": "stiffness_slope_n_per_m",
    "input.velocity_in_m_per_s": "velocity_in_m_per_s",
    "input.plate_mass_kg": "plate_mass_kg",
    "input.plate_stiffness_n_per_m": "plate_stiffness_n_per_m",
    "input.contact_stiffness_n_per_m": "contact_stiffness_n_per_m",
    "input.contact_damping_n_s_per_m": "contact_damping_n_s_per_m",
}
COLLISION = (
    "block_mass_kg",
    "velocity_in_m_per_s",
    "plate_stiffness_n_per_m",
    "plate_mass_kg",
    "contact_stiffness_n_per_m",
    "contact_damping_n_s_per_m",
)
_INPUTS = {
    "arm_length_m": ("arm, length", "m"),
    "arm_width_m": ("arm, width", "m"),
    "disc_diameter_m": ("disc, diameter", "m"),
    "density_kg_m3": ("density", "kg/m3"),
    "block_mass_kg": ("m_b", "kg"),
    "velocity_in_m_per_s": ("v_i", "m/s"),
    "plate_mass_kg": ("m_p*", "kg"),
    "plate_stiffness_n_per_m": ("k_p", "N/m"),
    "contact_stiffness_n_per_m": ("k_N", "N/m"),
    "contact_damping_n_s_per_m": ("γ_N", "N s/m"),
    "step_s": ("integrator step", "s"),
}


def load() -> Mapping[str, Any]:
    """Return the paper's numbers (resources/paper.toml)."""
    with resources.files("resources").joinpath("paper.toml").open("rb") as file:
        return tomllib.load(file)


def printed_value(key: str) -> float:
    """Return what the paper prints for a shot's number.  Raises KeyError if it prints nothing."""
    printed = {_RECORDED.get(row["key"]): row["paper"] for row in load()["row"] if "paper" in row}
    return float(printed[key])


def paper_rig(numbers: Mapping[str, Any]) -> PaperRig:
    """Return the paper's rig and simulation as types of this program."""
    from analysis.paper.paper_audit import PaperRig  # imports the model, which the window does not need for the numbers

    rig, simulation = numbers["rig"], numbers["simulation"]
    return PaperRig(
        plate_printed=Plate(*(float(rig[entry.name]) for entry in fields(Plate))),
        plate_mass_kg=float(rig["plate_mass_kg"]),
        wavelength_m=float(rig["wavelength_m"]),
        sample_rate_hz=float(rig["sample_rate_hz"]),
        samples=float(rig["samples"]),
        duration_s=float(rig["duration_s"]),
        collision=Collision(**{name: float(simulation[name]) for name in COLLISION}, variant=Variant.PAPER),
        claims={row["key"]: float(row["paper"]) for row in numbers["row"] if "paper" in row},
    )


def reproduce(shot: Shot | None = None) -> Reproduction:
    """Compute every number of the paper, with a shot's readings if one is given.  Takes about 1 s once compiled."""
    from analysis.paper.paper_audit import audit_values

    numbers = load()
    results = audit_values(paper_rig(numbers))
    given = numbers["rig"] | numbers["simulation"]
    rows = [_input_row(name, given[name], shot) for name in _INPUTS]
    rows += [_row(entry, results[entry["key"]], shot) for entry in numbers["row"]]
    return Reproduction(numbers["title"], numbers["authors"], tuple(rows), None if shot is None else shot.name)


def to_result(result: Reproduction) -> dict[str, Any]:
    """Return the reproduction for a result file (schema levimass.paper/1)."""
    rows = []
    for row in result.rows:
        entry: dict[str, Any] = {entry.name: getattr(row, entry.name) for entry in fields(row)}
        rows.append(entry | {"status": row.status.value, "recorded": to_json(row.recorded)})
    return {
        "schema": "levimass.paper/1",
        "title": result.title,
        "authors": result.authors,
        "recording": result.recording,
        "open": [row.key for row in result.open_rows],
        "rows": rows,
    }


def _row(entry: Mapping[str, Any], value: AuditValues, shot: Shot | None) -> PaperRow:
    paper = float(entry["paper"]) if "paper" in entry else None
    program = value.recomputed if value.recomputed is not None else value.simulated
    before, after = value.error_before, value.error_after
    if paper is not None and after is None and value.settles and program is not None:
        after = program / paper - 1.0
    if before is None:
        before = value.printed / paper - 1.0 if paper is not None and value.printed is not None else after
    return PaperRow(
        key=entry["key"],
        section=entry["section"],
        what=entry["what"],
        where=entry["where"],
        unit=entry["unit"],
        paper=paper,
        paper_words=entry.get("paper_words", ""),
        printed=value.printed,
        simulated=value.simulated,
        recomputed=value.recomputed,
        recorded=_recorded(entry["key"], shot),
        error_before=before,
        error_after=after,
        traced_to=entry["traced_to"].format_map(value.words),
        status=_status(paper, before, after, float(entry.get("within", math.inf))),
    )


def _status(paper: float | None, before: float | None, after: float | None, within: float) -> Status:
    if paper is None:
        return Status.ADDED
    if after is None or not abs(after) <= within:
        return Status.OPEN
    return Status.AGREES if before is not None and abs(before) <= within else Status.TRACED


def _input_row(name: str, value: float, shot: Shot | None) -> PaperRow:
    what, unit = _INPUTS[name]
    key = f"input.{name}"
    return PaperRow(
        key=key,
        section="input",
        what=what,
        where="simulation" if name in COLLISION or name == "step_s" else "rig",
        unit=unit,
        paper=float(value),
        simulated=float(value),
        recorded=_recorded(key, shot),
        status=Status.INPUT,
    )


def _recorded(key: str, shot: Shot | None) -> Reading:
    name = _RECORDED.get(key)
    if shot is None or name is None:
        return NotSeen("no recording" if shot is None else "a recording does not show it")
    reading = read_number(shot, name)
    return with_combined_uncertainty(reading, name, combined_uncertainties(shot)) or reading
