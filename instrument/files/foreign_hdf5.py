"""Read HDF5 files (and MATLAB's since v7.3): every data set of numbers is a channel, or one per column of a table."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from instrument.files.foreign_file import (
    MAX_CHANNELS,
    ForeignChannel,
    ForeignColumn,
    ForeignContents,
    checked_channels,
    missing_package,
)
from instrument.files.recording_error import RecordingError, one_line

_RATES = ("sample_rate_hz", "sample_rate", "samplerate", "sampling_rate", "sampling_frequency", "fs", "rate_hz", "rate")
_STEPS = ("dt", "wf_increment", "time_step", "sample_interval", "increment", "delta_t")
_LARGEST_CHUNK_BYTES = 256 * 2**20  # largest chunk that the library may decompress at once
_MAX_COMPRESSED = 4000  # largest accepted compression ratio; zlib reaches 1032 on zeros
_WIDEST = 64  # most columns of a table


def contents(path: Path) -> ForeignContents:
    """Return every data set of integers or floats; a table's columns are named "name[0]", "name[1]", ..."""
    with _opened(path) as file:
        found: list[ForeignChannel] = []

        def look(name: str, item: Any) -> bool | None:
            if len(found) >= MAX_CHANNELS:
                return True
            shape = getattr(item, "shape", None)
            if not shape or len(shape) > 2 or item.dtype.kind not in "iuf" or item.dtype.itemsize > 8:
                return None
            rate, unit = _rate(item), _text(item, ("unit", "units", "unit_string"))
            samples, width = max(shape), (1 if len(shape) == 1 else min(shape))
            if 0 < width <= _WIDEST and samples > 1:
                names = [name] if len(shape) == 1 else [f"{name}[{n}]" for n in range(width)]
                found.extend(ForeignChannel(one, samples, str(item.dtype), unit, rate) for one in names)
            return None

        file.visititems(look)
    return ForeignContents(path, "hdf5", checked_channels(path, found))


def columns(path: Path, names: Sequence[str]) -> list[ForeignColumn]:
    """Return the channels of these names."""
    with _opened(path) as file:
        return [_column(path, file, name) for name in names]


def _column(path: Path, file: Any, name: str) -> ForeignColumn:
    stem, index = name, None
    if name.endswith("]") and name not in file:
        stem, _, number = name[:-1].rpartition("[")
        index = int(number)
    item = file[stem]
    if item.external or item.is_virtual:
        raise RecordingError(path, "its samples lie in other files; only what is inside is read", name)
    claimed = math.prod(item.shape) * item.dtype.itemsize
    if claimed > _MAX_COMPRESSED * item.id.get_storage_size():
        raise RecordingError(path, "claims more samples than the file holds", name)
    if item.chunks is not None and math.prod(item.chunks) * item.dtype.itemsize > _LARGEST_CHUNK_BYTES:
        raise RecordingError(path, "stored in pieces too large to unpack", name)
    upright = index is None or item.shape[0] >= item.shape[1]
    where = slice(None) if index is None else (slice(None), index) if upright else (index, slice(None))
    return ForeignColumn(np.ascontiguousarray(item[where]), sample_rate_hz=_rate(item))


def _rate(item: Any) -> float | None:
    """Return the sample rate from an attribute of a data set, its groups or the file; None if none states it."""
    while True:
        for names, inverse in ((_RATES, False), (_STEPS, True)):
            for key in item.attrs:
                if key.lower() in names and (value := _number(item, key)):
                    return 1.0 / value if inverse else value
        if item.name in ("/", None):
            return None
        item = item.parent


def _number(item: Any, key: str) -> float | None:
    about = item.attrs.get_id(key)
    if math.prod(about.shape or ()) != 1 or about.dtype.kind not in "iuf":
        return None
    try:
        value = float(np.asarray(item.attrs[key]).reshape(()))
    except (TypeError, ValueError, OverflowError):
        return None
    return value if math.isfinite(value) and 1e-12 < value < 1e12 else None


def _text(item: Any, names: Sequence[str]) -> str:
    """Return a text attribute of fixed length; those of variable length are ignored, as they may claim gigabytes."""
    for key in item.attrs:
        about = item.attrs.get_id(key)
        if key.lower() in names and not about.shape and about.dtype.kind == "S" and about.dtype.itemsize <= 1000:
            value = item.attrs[key]
            return one_line(value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value), 20)
    return ""


def _opened(path: Path) -> Any:
    try:
        import h5py
    except ImportError:
        raise missing_package(path, "h5py", "hdf5") from None
    with path.open("rb") as file:
        if file.read(10) == b"MATLAB 5.0":
            why = "a MATLAB file of version 5 to 7; save it with -v7.3, or write its columns as CSV"
            raise RecordingError(path, why)
    return h5py.File(path, "r")
