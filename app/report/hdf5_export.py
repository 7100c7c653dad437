"""A shot's motion as HDF5: the CSV's columns as data sets with units, numbers and settings as attributes."""

import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.report import shot_result
from analysis.shot import Shot, program_version
from app.report.csv_export import motion_columns, motion_file_names
from app.words import parameter_parts
from instrument.files import RecordingError, write_atomic


def export_hdf5(shots: Sequence[Shot], folder: Path) -> list[Path]:
    """Write ``NAME.h5`` for every shot that has a motion and return the paths.

    Group ``motion`` holds a data set per column (``time_s`` ...; NaN where not ``valid``) with the attribute ``unit``.
    The file's attribute ``result`` is the shot's entry of the result file as JSON, ``settings`` is the analysis's.
    Raises OSError or RecordingError.
    """
    written = []
    for shot, name in zip(shots, motion_file_names([shot.name for shot in shots]), strict=True):
        if shot.motion is None:
            continue
        path = folder / Path(name).with_suffix(".h5").name
        write_atomic(path, (_bytes(shot, [other for other in shots if other is not shot], path),), sync=True)
        written.append(path)
    return written


def _bytes(shot: Shot, others: Sequence[Shot], path: Path) -> memoryview:
    try:
        import h5py
    except ImportError:
        raise RecordingError(path, "writing it needs h5py: pip install 'levimass[hdf5]'") from None
    assert shot.motion is not None
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        group = file.create_group("motion")
        for name, values in motion_columns(shot).items():
            _column(group, name, values)
        group.create_dataset("valid", data=shot.motion.valid.astype(np.uint8), compression="gzip", shuffle=True)
        group.attrs["sample_rate_hz"] = shot.motion.sample_rate_hz
        group.attrs["bandwidth_hz"] = shot.motion.bandwidth_hz
        group.attrs["moving_mass_kg"] = shot.motion.moving_mass_kg
        file.attrs["program"] = f"levimass {program_version()}"
        file.attrs["name"] = _plain(shot.name)
        file.attrs["note"] = _plain(shot.note)
        file.attrs["started_at"] = _plain(shot.started_at or "")
        file.attrs["flags"] = _plain(" ".join(shot.flags))
        file.attrs["settings"] = json.dumps(shot.settings.written())
        # an attribute holds 64 kB: the budget, which is in the report and in --json, is left out
        result = {key: value for key, value in shot_result(shot, others).items() if key != "budget"}
        file.attrs["result"] = json.dumps(result, allow_nan=False)
    return memory.getbuffer()


def _column(group: Any, name: str, values: np.ndarray) -> None:
    item = group.create_dataset(name, data=values, compression="gzip", compression_opts=4, shuffle=True)
    item.attrs["unit"] = parameter_parts(name)[1]


def _plain(text: str) -> str:
    return text.replace("\x00", " ").encode("utf-8", "replace").decode("utf-8")[:16000]
