"""Which column of another program's table is the displacement of a motion record, and in which unit.

Saved in the motion record's .toml as the table ``[columns]``; without it the columns have the names of docs/formats.md.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from instrument.files.atomic_file import write_text_atomic
from instrument.files.checked import Checked
from instrument.files.foreign import csv_table
from instrument.files.foreign.contents import ForeignChannel
from instrument.files.foreign.mapping import toml_value
from instrument.files.recording_error import RecordingError
from instrument.files.recording_metadata import RATES_HZ
from instrument.files.text_file import read_toml

LENGTHS_M = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}
TABLE = ".csv"  # the only ending of such a table
MODELS = ("contact", "plate")  # of a motion record whose force was not measured
_MICRO = str.maketrans("\u00b5\u03bc\ufffd", "uuu")  # the last: a micro sign of another encoding
_SUFFIX = re.compile(r"_(m|mm|.m)$")
_LONGEST_NAME = 1000


@dataclass(frozen=True, slots=True)
class MotionColumns:
    """The displacement column of a table; ``sample_rate_hz`` if no column is the time."""

    displacement: str
    unit: str
    model: str = MODELS[0]
    moving_mass_kg: float | None = None
    sample_rate_hz: float | None = None


def length_unit(channel: ForeignChannel) -> str | None:
    """Return the unit of length ("mm") that a column's header states, as in "x (mm)" or "x_mm", or None."""
    suffix = _SUFFIX.search(channel.name)
    unit = (channel.unit or (suffix[1] if suffix else "")).translate(_MICRO)
    return unit if unit in LENGTHS_M else None


def read_mapped_columns(table: Path, columns: Checked) -> dict[str, NDArray[np.float64]]:
    """Return time_s and displacement_m, each of shape (n,), as ``[columns]`` says.  Raises RecordingError."""
    named = columns.object("displacement")
    name = named.text("name", _LONGEST_NAME) if named is not None else None
    if named is None or name is None:
        raise columns.refuse("displacement.name", "missing")
    unit = named.text("unit", 10)
    if unit is None or (unit := unit.translate(_MICRO)) not in LENGTHS_M:
        raise named.refuse("unit", f"is none of {', '.join(LENGTHS_M)}")
    csv_table.contents(table).channel(name)
    time_s, values = csv_table.timed_column(table, name, columns.number("sample_rate_hz", *RATES_HZ))
    return {"time_s": time_s, "displacement_m": values * LENGTHS_M[unit]}


def columns_path(table: Path) -> Path:
    """Return the .toml in which a table's columns are saved.  Raises RecordingError if it must not be written."""
    if table.suffix.lower() != TABLE:
        raise RecordingError(table, f"only a {TABLE} can be read as a displacement")
    about = table.with_suffix(".toml")
    if about.exists() and "columns" not in read_toml(about):
        raise RecordingError(about, "is there already and describes this table; it is not overwritten")
    return about


def write_columns(columns: MotionColumns, about: Path) -> None:
    """Write the .toml of a motion record with its ``[columns]``.  Raises RecordingError."""
    mass, rate = columns.moving_mass_kg, columns.sample_rate_hz
    lines = ["# How Levimass reads the table of this name. Numbers are SI; unit is that of the column."]
    lines.append(f"model = {toml_value(columns.model)}")
    if mass is not None:
        lines.append(f"moving_mass_kg = {toml_value(mass)}")
    if rate is not None:
        lines += ["", "[columns]", f"sample_rate_hz = {toml_value(rate)}"]
    lines += ["", "[columns.displacement]", f"name = {toml_value(columns.displacement)}"]
    lines.append(f"unit = {toml_value(columns.unit)}")
    write_text_atomic(about, "\n".join(lines) + "\n", sync=True)
