"""Export shots, motions, budgets, laws and predictions as CSV in SI units; motions also as HDF5."""

import csv
import io
import itertools
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analysis.diagnosis import Diagnosis, Errors, LearnedLaw, prediction_words
from analysis.fitted import vibration_of
from analysis.shot import Floats, Motion, Quantity, Reading, Shot, program_version, split_unit
from analysis.uncertainty import COLUMNS as BUDGET_COLUMNS
from analysis.uncertainty import (
    Origin,
    ResultNumber,
    budget,
    budget_rows,
    collision_numbers,
    combined_uncertainties,
    noise_band_of_motion,
    path_wander,
    series,
    series_rows,
)
from app.words import cell
from instrument.files import RecordingError, write_atomic, write_text_atomic

if TYPE_CHECKING:  # would import the fitting code, which the window's process does not need
    from analysis.diagnosis import PredictionTest

MOTION_COLUMNS = (
    "time_s",
    "displacement_m",
    "velocity_m_per_s",
    "acceleration_m_per_s2",
    "force_n",
    "displacement_std_m",
    "velocity_std_m_per_s",
    "acceleration_std_m_per_s2",
    "force_std_n",
)
_LONGEST_STEM = 200  # in bytes; a file name with number and ending may have 255
MODEL_COLUMNS = ("model_displacement_m", "model_velocity_m_per_s", "model_force_n", "model_gap_m")


def columns_of(number: ResultNumber) -> list[str]:
    """Return three columns of ``shots.csv``: a number, its standard uncertainty, and that from noise alone."""
    if number.origin is Origin.FITTED:
        return [number.key, f"{number.key}_std", f"{number.key}_std_noise"]
    ending = "_" + number.unit.lower().replace("/", "_per_").replace(" ", "_")
    name = number.key.replace(".", "_")
    name, suffix = (name.removesuffix(ending), ending) if name.endswith(ending) else (name, "")
    return [f"{name}{suffix}", f"{name}_std{suffix}", f"{name}_std_noise{suffix}"]


def shot_numbers() -> list[ResultNumber]:
    """Return the numbers in the order of ``shots.csv``: read ones, read ones with a dotted key, fitted ones."""
    return sorted(
        collision_numbers(Origin.READ, Origin.FITTED), key=lambda n: (n.origin is Origin.FITTED, "." in n.key)
    )


def shot_columns() -> list[str]:
    """Return all column names of ``shots.csv``."""
    first = ["name", "path", "started_at", "status", "problem", "flags", "note", "motion_file", "model"]
    return [*first, *itertools.chain.from_iterable(map(columns_of, shot_numbers())), "reduced_chi2"]


def export(shots: Sequence[Shot], folder: Path) -> list[Path]:
    """Write one motion file per shot, ``shots.csv``, ``budget.csv`` and, for several shots, ``series.csv``.

    Returns the paths.  Raises OSError or RecordingError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written, shot_rows = [], []
    for shot, name in zip(shots, motion_file_names([shot.name for shot in shots]), strict=True):
        if shot.motion is not None:
            write_motion(shot, folder / name)
            written.append(name)
        shot_rows.append(shot_row(shot, name if shot.motion is not None else ""))
    write_table(shot_columns(), shot_rows, folder / "shots.csv")
    budgets = [budget_rows(budget(shot, others=shots)) for shot in shots if shot.impact is not None]
    write_table(BUDGET_COLUMNS, itertools.chain.from_iterable(budgets), folder / "budget.csv")
    written += ["shots.csv", "budget.csv"]
    if len(shots) > 1:
        header, *rows = series_rows(series(shots))
        write_table(header, rows, folder / "series.csv")
        written.append("series.csv")
    return [folder / name for name in written]


def motion_file_names(shot_names: Sequence[str]) -> list[str]:
    """Return a distinct file name for each shot, because shots from different folders may have the same name."""
    taken = {"shots.csv", "budget.csv", "series.csv", "foretold.csv"}
    names = []
    for shot_name in shot_names:
        stem = re.sub(r"[^\w.-]+", "_", shot_name).strip("._") or "shot"
        stem = stem.encode("utf-8", "replace")[:_LONGEST_STEM].decode("utf-8", "ignore")
        name, number = f"{stem}.csv", 2
        while name.lower() in taken:
            name, number = f"{stem}-{number}.csv", number + 1
        taken.add(name.lower())
        names.append(name)
    return names


def motion_columns(shot: Shot) -> dict[str, Floats]:
    """Return the columns of a shot's motion and, if the fit converged, of the model; each of shape (n,)."""
    assert shot.motion is not None
    columns = {name: np.asarray(getattr(shot.motion, name)) for name in MOTION_COLUMNS}
    columns |= _stds(shot, shot.motion)
    if shot.fit is not None and shot.fit.converged and len(shot.fit.shots) == 1:
        overlay = shot.fit.shots[0].overlay
        modelled = (overlay.displacement_m, overlay.velocity_m_per_s, overlay.force_n, overlay.gap_m)
        columns |= dict(zip(MODEL_COLUMNS, modelled, strict=True))
    return columns


def _stds(shot: Shot, motion: Motion) -> dict[str, Floats]:
    """Return the columns of standard uncertainties from noise and path vibration, each (n,); none without vibration.

    The motion's own columns treat a wandering path as a random walk: six times too large for the force at VC-D.
    """
    vibration = vibration_of(shot)
    if vibration is None:
        return {}
    band = noise_band_of_motion(motion, vibration, wander=path_wander(shot))
    stds = (band.displacement_m, band.velocity_m_per_s, band.force_n / motion.moving_mass_kg, band.force_n)
    seen = motion.valid
    return {
        name: np.where(seen, std, np.nan)
        for name, std in zip((name for name in MOTION_COLUMNS if "_std" in name), stds, strict=True)
    }


def write_motion(shot: Shot, path: Path) -> None:
    """Write the motion record as CSV, one row per sample; values that were not measured are empty cells."""
    columns = motion_columns(shot)
    table = np.stack(list(columns.values()), axis=1)
    lines = [",".join(columns)]
    lines += [",".join("" if value != value else repr(value) for value in row) for row in table.tolist()]
    write_text_atomic(path, "\n".join(lines) + "\n", sync=True)


def write_table(header: Sequence[str], rows: Iterable[Sequence[str]], path: Path) -> None:
    """Write a table as CSV atomically, with one row in memory at a time; cells that look like formulas are escaped."""
    write_text_atomic(path, map(_csv_line, itertools.chain([header], rows)), sync=True)


def _csv_line(cells: Sequence[str]) -> str:
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(map(cell, cells))
    return line.getvalue()


def shot_row(shot: Shot, motion_file: str) -> list[str]:
    """Return the row of one shot for ``shots.csv``; numbers that were not seen are empty cells."""
    status = "failed" if shot.problem else "ok"
    row = [shot.name, shot.path or "", shot.started_at or "", status, shot.problem or "", " ".join(shot.flags)]
    row += [shot.note, motion_file, shot.fit.model if shot.fit else ""]
    combined = combined_uncertainties(shot)
    for number in shot_numbers():
        row += _cells(number.find(shot), combined.get(number.key))
    fit = shot.fit if shot.fit is not None and shot.fit.converged else None
    return [*row, repr(float(fit.reduced_chi2)) if fit else ""]


def _cells(reading: Reading, combined: float | None) -> list[str]:
    """Return value, combined standard uncertainty (without a budget: that from noise), and that from noise alone."""
    if not isinstance(reading, Quantity):
        return ["", "", ""]
    std = reading.std if combined is None else combined
    return [repr(float(reading.value)), repr(float(std)), repr(float(reading.std))]


def export_laws(diagnosis: Diagnosis, folder: Path) -> list[Path]:
    """Write learned laws as ``law_1.csv``, ..., one row per point of the curve; return the paths.  Raises OSError."""
    paths = []
    for number, law in enumerate(diagnosis.laws, 1):
        columns = law_columns(law)
        rows = [[repr(float(value)) for value in row] for row in zip(*columns.values(), strict=True)]
        path = folder / f"law_{number}.csv"
        write_table(list(columns), rows, path)
        paths.append(path)
    return paths


def law_columns(law: LearnedLaw) -> dict[str, list[float]]:
    """Return a law's columns by name: argument, free curve, its standard uncertainty, closed forms."""
    unit = law.curve_unit.replace("/", "_per_")
    columns = {f"{law.argument.replace(' ', '_')}_{unit}": law.curve_argument.tolist()}
    columns |= {"force_n": law.curve_force_n.tolist(), "force_std_n": law.curve_std_n.tolist()}
    forms = [(law.nearest_form, law.form_force_n)]
    forms += [(other.form, other.curve_force_n) for other in law.other_forms if other.curve_force_n is not None]
    for form, curve in forms:
        assert curve is not None
        columns[f"{form.replace(', ', '_').replace(' ', '_')}_n"] = curve.tolist()
    return columns


KEYS = tuple(field.name for field in fields(Errors))


def export_prediction(prediction: "PredictionTest", folder: Path) -> Path:
    """Write ``foretold.csv`` with the errors of a prediction: one row per shot, one for all.  Raises OSError."""
    header = ["name", "took_part", "problem"]
    header += [f"{which}_{key}" for which in ("base", "model") for key in KEYS]
    rows = []
    for shot in prediction.shots:
        first = [shot.name, str(shot.took_part).lower(), shot.problem or ""]
        rows.append([*first, *_error_cells(shot.error_base), *_error_cells(shot.error_model)])
    errors = [*_error_cells(prediction.error_base), *_error_cells(prediction.error_model)]
    rows.append(["all", "", prediction_words(prediction), *errors])
    write_table(header, rows, folder / "foretold.csv")
    return folder / "foretold.csv"


def _error_cells(errors: Errors | None) -> list[str]:
    if errors is None:
        return [""] * len(KEYS)
    return ["" if value != value else repr(float(value)) for value in astuple(errors)]


def export_hdf5(shots: Sequence[Shot], folder: Path) -> list[Path]:
    """Write ``NAME.h5`` for every shot with a motion and return the paths.

    Group ``motion`` has a data set per column (``time_s`` ...; NaN where not ``valid``) with the attribute ``unit``.
    File attributes as JSON: ``result`` is the shot's entry in the result file, ``settings`` the analysis settings.
    Raises OSError or RecordingError.
    """
    written = []
    for shot, name in zip(shots, motion_file_names([shot.name for shot in shots]), strict=True):
        if shot.motion is None:
            continue
        path = folder / Path(name).with_suffix(".h5").name
        write_atomic(path, (_bytes(shot, shots, path),), sync=True)
        written.append(path)
    return written


def _bytes(shot: Shot, others: Sequence[Shot], path: Path) -> memoryview:
    from analysis.report import shot_result  # imports the fitting code, so not at the top

    try:
        import h5py
    except ImportError:
        raise RecordingError(path, "writing it needs h5py: pip install 'levimass[hdf5]'") from None
    assert shot.motion is not None
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        group = file.create_group("motion")
        for name, values in motion_columns(shot).items():
            item = group.create_dataset(name, data=values, compression="gzip", compression_opts=4, shuffle=True)
            item.attrs["unit"] = split_unit(name)[1]
        group.create_dataset("valid", data=shot.motion.valid.astype(np.uint8), compression="gzip", shuffle=True)
        group.attrs["sample_rate_hz"] = shot.motion.sample_rate_hz
        group.attrs["bandwidth_hz"] = shot.motion.bandwidth_hz
        group.attrs["moving_mass_kg"] = shot.motion.moving_mass_kg
        file.attrs["program"] = f"levimass {program_version()}"
        file.attrs["name"] = _attribute(shot.name)
        file.attrs["note"] = _attribute(shot.note)
        file.attrs["started_at"] = _attribute(shot.started_at or "")
        file.attrs["flags"] = _attribute(" ".join(shot.flags))
        file.attrs["settings"] = json.dumps(shot.settings.written())
        # an attribute is limited to 64 kB, so the budget is left out; it is in the report and in --json
        result = {key: value for key, value in shot_result(shot, others).items() if key != "budget"}
        file.attrs["result"] = json.dumps(result, allow_nan=False)
    return memory.getbuffer()


def _attribute(text: str) -> str:
    return text.replace("\x00", " ").encode("utf-8", "replace").decode("utf-8")[:16000]
