"""Reads motion records: shots already demodulated, NAME.csv and NAME.toml in one folder (docs/formats.md)."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from instrument.files.checked import Checked
from instrument.files.motion_columns import MotionColumns, columns_path, read_mapped_columns, write_columns
from instrument.files.recording_error import RecordingError, one_line
from instrument.files.recording_metadata import MASSES_KG
from instrument.files.recording_search import TABLES, motion_table
from instrument.files.text_file import read_text, read_toml

Floats = NDArray[np.float64]
MODELS = ("plate", "contact", "driven")
_COLUMNS = ("time_s", "displacement_m", "velocity_m_per_s", "force_n")
_LARGEST_CSV_BYTES = 512 * 2**20
_LARGEST = 1e12  # SI: larger than any time, length, speed or force of a rig


@dataclass(frozen=True, slots=True)
class MotionRecord:
    """The columns of a motion record, each of shape (n,), float64, read-only; None: not given.

    ``time_s`` rises strictly; its steps need not be equal.  ``extra`` are the other keys of the .toml.
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


def read_motion(path: Path | str) -> MotionRecord:
    """Read a motion record; ``path`` is its table or its .toml.  Raises RecordingError."""
    table = Path(path)
    if table.suffix.lower() == ".toml":
        table = motion_table(table)
    about = table.with_suffix(".toml")
    if table.exists() and not about.exists():
        cause = f"neither {about.name} (of a motion record) nor a mapping (of raw beats) says what it is"
        raise RecordingError(table, f"{cause}; 'levimass --map {table.name}' shows how to give either")
    head = Checked(about, read_toml(about))
    model = head.text("model", 1000)
    if model not in MODELS:
        raise head.refuse("model", "missing" if model is None else f"{model[:20]!r} is none of {', '.join(MODELS)}")
    mass = head.number("moving_mass_kg", *MASSES_KG)
    mass_u = head.number("moving_mass_u_kg", 0.0, 1e6)
    mapped = head.object("columns")
    columns = _columns(table) if mapped is None else _checked(table, read_mapped_columns(table, mapped), 1)
    return MotionRecord(
        table.stem, str(table), model, columns["time_s"], columns.get("displacement_m"),
        columns.get("velocity_m_per_s"), columns.get("force_n"), mass, mass_u, head.unread(),
    )  # fmt: skip


def save_columns(table: Path, columns: MotionColumns) -> Path:
    """Write the .toml that makes a table a motion record and return its path.

    Raises RecordingError, and writes nothing, if the table cannot be read that way.
    """
    about = columns_path(table)
    before = about.read_bytes() if about.exists() else None
    write_columns(columns, about)
    try:
        read_motion(table)
    except RecordingError:
        about.unlink() if before is None else about.write_bytes(before)
        raise
    return about


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
        raise RecordingError(table, _bad_cell(body, parted, wanted) or one_line(str(error), 150)) from None
    if values.shape[0] < 2:
        raise RecordingError(table, f"{values.shape[0]} rows, at least 2 are needed")
    found = {name: np.ascontiguousarray(values[:, position]) for position, name in enumerate(wanted)}
    return _checked(table, found, 2)


def _checked(table: Path, columns: dict[str, Floats], first_row: int) -> dict[str, Floats]:
    """Return the columns read-only.  Raises RecordingError for a bad row; rows are counted from ``first_row``."""
    for name, column in columns.items():
        with np.errstate(invalid="ignore"):
            bad = np.flatnonzero(~(np.abs(column) <= _LARGEST))
        if bad.size:
            raise RecordingError(table, f"row {bad[0] + first_row} is not a finite number a rig could give", name)
        column.flags.writeable = False
    back = np.flatnonzero(np.diff(columns["time_s"]) <= 0)
    if back.size:
        raise RecordingError(table, f"time does not rise at row {back[0] + first_row + 1}", "time_s")
    return columns


def _bad_cell(body: str, parted: str, wanted: Mapping[str, int]) -> str | None:
    """Return the place of the first cell that is not a number; the header is row 1, as in a spreadsheet."""
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
                return f"{name}: row {row}: {one_line(cells[place].strip(), 30)!r} is not a number"
    return None
