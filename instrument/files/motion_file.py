"""Read motion records: shots demodulated elsewhere, as NAME.csv and NAME.toml in one folder (docs/formats.md).

For a table of another program, ``[columns]`` of the .toml names the displacement column and its unit.
"""

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Floats
from instrument.files import csv_table
from instrument.files.atomic_file import write_toml_atomic
from instrument.files.foreign_file import ForeignChannel
from instrument.files.recording_error import RecordingError, shown
from instrument.files.recording_metadata import MASSES_KG, RATES_HZ
from instrument.files.recording_search import TABLES, motion_table
from instrument.files.text_file import CheckedTable, read_text, read_toml
from levimass import BASE_MODELS, ONE_BODY

_BASES = {base.in_record: base for base in BASE_MODELS.values() if base.in_record}
_COLUMNS = ("time_s", "displacement_m", "velocity_m_per_s", "force_n")
_LARGEST_CSV_BYTES = 512 * 2**20
_LARGEST = 1e12  # SI units: above any time, length, speed or force of a rig
LENGTHS_M = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}
TABLE = ".csv"  # the only extension of another program's table
WITHOUT_FORCE = tuple(base for base in _BASES.values() if base.bodies)  # base models for positions alone
_MICRO = str.maketrans("\u00b5\u03bc\ufffd", "uuu")  # the last one replaces a micro sign in another encoding
_HEAD = "How Levimass reads the table of this name. Numbers are SI; unit is that of the column."
_LENGTH_SUFFIX = re.compile(r"_(m|mm|.m)$")


@dataclass(frozen=True, slots=True)
class MotionColumns:
    """The displacement column of a table, with its unit; ``sample_rate_hz`` is used if no column is the time."""

    displacement: str
    unit: str
    model: str = BASE_MODELS[ONE_BODY].in_record
    moving_mass_kg: float | None = None
    sample_rate_hz: float | None = None


@dataclass(frozen=True, slots=True)
class MotionRecord:
    """The columns of a motion record, each of shape (n,), float64, read-only; None if absent.

    ``time_s`` increases strictly; its steps need not be equal.  ``extra`` holds the other keys of the .toml.
    """

    name: str
    path: str
    model: str
    time_s: Floats
    displacement_m: Floats | None
    velocity_m_per_s: Floats | None
    force_n: Floats | None
    moving_mass_kg: float | None = None
    moving_mass_u_kg: float | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    @property
    def base(self) -> str:
        """Get the name of its base model, which is "plate" in records and "paper" elsewhere."""
        return _BASES[self.model].name


def read_motion(path: Path | str) -> MotionRecord:
    """Read a motion record; ``path`` is its table or its .toml.  Raises RecordingError."""
    table = Path(path)
    if table.suffix.lower() == ".toml":
        table = motion_table(table)
    about = table.with_suffix(".toml")
    if table.exists() and not about.exists():
        cause = f"neither {about.name} (of a motion record) nor a mapping (of raw beats) says what it is"
        raise RecordingError(table, f"{cause}; 'levimass map {table.name}' shows how to give either")
    head = CheckedTable(about, read_toml(about))
    model = head.text("model")
    if model not in _BASES:
        raise head.error_for("model", "missing" if model is None else f"{shown(model)} is none of {', '.join(_BASES)}")
    mass = head.number("moving_mass_kg", *MASSES_KG)
    mass_u = head.number("moving_mass_u_kg", 0.0, 1e6)
    mapped = head.object("columns")
    columns = _columns(table) if mapped is None else _checked(table, _mapped_columns(table, mapped), 1)
    return MotionRecord(
        table.stem, str(table), model, columns["time_s"], columns.get("displacement_m"),
        columns.get("velocity_m_per_s"), columns.get("force_n"), mass, mass_u, head.unread(),
    )  # fmt: skip


def save_columns(table: Path, columns: MotionColumns) -> Path:
    """Write the .toml that makes a table a motion record; return the path of the .toml.

    Raises RecordingError, and leaves no change, if the table cannot be read with it.
    """
    if table.suffix.lower() != TABLE:
        raise RecordingError(table, f"only a {TABLE} can be read as a displacement")
    about = table.with_suffix(".toml")
    if about.exists() and "columns" not in read_toml(about):
        raise RecordingError(about, "is there already and describes this table; it is not overwritten")
    before = about.read_bytes() if about.exists() else None
    written = {
        "model": columns.model,
        "moving_mass_kg": columns.moving_mass_kg,
        "columns": {
            "sample_rate_hz": columns.sample_rate_hz,
            "displacement": {"name": columns.displacement, "unit": columns.unit},
        },
    }
    write_toml_atomic(about, written, _HEAD)
    try:
        read_motion(table)
    except RecordingError:
        about.unlink() if before is None else about.write_bytes(before)
        raise
    return about


def length_unit(channel: ForeignChannel) -> str | None:
    """Return the unit of length ("mm") in a column's header, such as "x (mm)" or "x_mm", or None."""
    suffix = _LENGTH_SUFFIX.search(channel.name)
    unit = (channel.unit or (suffix[1] if suffix else "")).translate(_MICRO)
    return unit if unit in LENGTHS_M else None


def _mapped_columns(table: Path, columns: CheckedTable) -> dict[str, NDArray[np.float64]]:
    """Return time_s and displacement_m, each of shape (n,), read as ``[columns]`` states.  Raises RecordingError."""
    named = columns.object("displacement")
    name = named.text("name") if named is not None else None
    if named is None or name is None:
        raise columns.error_for("displacement.name", "missing")
    unit = named.text("unit")
    if unit is None or (unit := unit.translate(_MICRO)) not in LENGTHS_M:
        raise named.error_for("unit", f"is none of {', '.join(LENGTHS_M)}")
    csv_table.contents(table).channel(name)
    time_s, values = csv_table.timed_column(table, name, columns.number("sample_rate_hz", *RATES_HZ))
    return {"time_s": time_s, "displacement_m": values * LENGTHS_M[unit]}


def _columns(table: Path) -> dict[str, Floats]:
    text = read_text(table, _LARGEST_CSV_BYTES)
    parted = TABLES[table.suffix.lower()]
    first, _, body = text.partition("\n")
    try:
        names = [name.strip() for name in next(csv.reader([first], delimiter=parted), [])]
    except csv.Error as error:
        raise RecordingError(table, f"header cannot be read ({error})") from None
    wanted = {name: names.index(name) for name in _COLUMNS if name in names}
    if "time_s" not in wanted:
        raise RecordingError(table, "header has no such column", "time_s")
    if "displacement_m" not in wanted and "velocity_m_per_s" not in wanted:
        raise RecordingError(table, "header has neither displacement_m nor velocity_m_per_s")
    for name in wanted:
        if names.count(name) > 1:
            raise RecordingError(table, "two columns of this name", name)
    if not body.strip():
        raise RecordingError(table, "0 rows, at least 2 are needed")
    try:
        values = np.loadtxt(
            StringIO(body), delimiter=parted, usecols=list(wanted.values()), ndmin=2, dtype=np.float64, comments=None
        )
    except (ValueError, IndexError, OverflowError) as error:
        raise RecordingError(table, _bad_cell(body, parted, wanted) or str(error)) from None
    if values.shape[0] < 2:
        raise RecordingError(table, f"{values.shape[0]} rows, at least 2 are needed")
    found = {name: np.ascontiguousarray(values[:, position]) for position, name in enumerate(wanted)}
    return _checked(table, found, 2)


def _checked(table: Path, columns: dict[str, Floats], first_row: int) -> dict[str, Floats]:
    """Check the columns and make them read-only.  Raises RecordingError for a bad row, counted from ``first_row``."""
    for name, column in columns.items():
        bad = np.flatnonzero(~(np.abs(column) <= _LARGEST))
        if bad.size:
            raise RecordingError(table, f"row {bad[0] + first_row} is not a finite number a rig could give", name)
        column.flags.writeable = False
    back = np.flatnonzero(np.diff(columns["time_s"]) <= 0)
    if back.size:
        raise RecordingError(table, f"time does not rise at row {back[0] + first_row + 1}", "time_s")
    return columns


def _bad_cell(body: str, parted: str, wanted: Mapping[str, int]) -> str | None:
    """Return in words which cell is the first that is no number, or None; the header is row 1."""
    for row, line in enumerate(body.splitlines(), 2):
        if not line.strip():
            continue
        cells = line.split(parted)
        for name, place in wanted.items():
            if place >= len(cells):
                return f"row {row} has {len(cells)} cells, {name} would be number {place + 1}"
            try:
                float(cells[place])
            except ValueError:
                return f"{name}: row {row}: {shown(cells[place].strip())} is not a number"
    return None
