"""Raw beats in a file of another program: the file's channels, and the mapping (TOML) that gives their roles.

Each format has a reader module: ``csv_table``, ``foreign_hdf5``, ``foreign_tdms``; WAV is in ``foreign_reading``.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Role, Setup
from instrument.files.atomic_file import write_toml_atomic
from instrument.files.recording_error import RecordingError, shown
from instrument.files.recording_metadata import RATES_HZ, setup_json, setup_of
from instrument.files.text_file import CheckedTable, read_toml

Column: TypeAlias = NDArray[np.integer[Any]] | NDArray[np.floating[Any]]
MAX_SAMPLES = 2**26  # per channel: two seconds at 30 MS/s; a longer file is not a shot
MAX_CHANNELS = 256
LARGEST_FILE_BYTES = 4 * 2**30


@dataclass(frozen=True, slots=True)
class ForeignChannel:
    """One channel as named in the file; ``unit`` and ``sample_rate_hz`` are given if the file states them."""

    name: str
    samples: int
    kind: str  # numpy's name of the stored number type: "int16", "float64"
    unit: str = ""
    sample_rate_hz: float | None = None


@dataclass(frozen=True, slots=True)
class ForeignContents:
    """The channels of a file in file order; ``flags`` as in a recording ("truncated")."""

    path: Path
    format: str
    channels: tuple[ForeignChannel, ...]
    started_at: str | None = None
    flags: tuple[str, ...] = ()

    def channel(self, name: str) -> ForeignChannel:
        """Return the channel of this name.  Raises a RecordingError that lists the channels."""
        for channel in self.channels:
            if channel.name == name:
                return channel
        held = ", ".join(repr(c.name) for c in self.channels[:8])
        raise RecordingError(self.path, f"no channel {shown(name)}; it holds {held or 'none'}")


@dataclass(frozen=True, slots=True)
class ForeignColumn:
    """One channel's stored numbers, shape (n,), with their scale in volts if the file states it."""

    values: Column
    volts_per_unit: float | None = None
    offset_v: float = 0.0
    sample_rate_hz: float | None = None


def checked_channels(path: Path, channels: Sequence[ForeignChannel]) -> tuple[ForeignChannel, ...]:
    """Return at most ``MAX_CHANNELS`` of the channels.  Raises RecordingError if there is none or one is too long."""
    if not channels:
        raise RecordingError(path, "holds no channel of numbers")
    for channel in channels:
        if channel.samples > MAX_SAMPLES:
            cause = f"{channel.samples} samples, more than {MAX_SAMPLES}"
            raise RecordingError(path, cause, channel.name)
    return tuple(channels[:MAX_CHANNELS])


def missing_package(path: Path, package: str, extra: str) -> RecordingError:
    """Return the error for a format whose reader is not installed."""
    return RecordingError(path, f"reading it needs {package}: pip install 'levimass[{extra}]'")


_HEAD = "How Levimass reads this file, or every file of this format in this folder. Numbers are SI."


@dataclass(frozen=True, slots=True)
class MappedChannel:
    """A channel by its name in the file; volts = stored number * volts_per_unit + offset_v.

    ``volts_per_unit`` None: as stated in the file; if not stated, floats are volts and integers have 1 V full scale.
    """

    role: Role
    name: str
    volts_per_unit: float | None = None
    offset_v: float | None = None


@dataclass(frozen=True, slots=True)
class ForeignMapping:
    """How a foreign file is read as a recording.  ``sample_rate_hz`` None: as stated in the file."""

    format: str
    channels: tuple[MappedChannel, ...]
    setup: Setup
    sample_rate_hz: float | None = None
    trigger_sample: int | None = None


def read_mapping(path: Path) -> ForeignMapping:
    """Read a mapping.  Raises RecordingError."""
    whole = CheckedTable(path, read_toml(path))
    kind = whole.text("format", 100)
    if kind is None:
        raise whole.error_for("format", "missing")
    listed = whole.required_object("channels")
    channels = []
    for role in Role:
        item = listed.object(role)
        if item is None:
            continue
        name = item.text("name")
        if name is None:
            raise item.error_for("name", "missing")
        scale = item.number("volts_per_unit", -1e9, 1e9)
        if scale is not None and abs(scale) < 1e-30:
            raise item.error_for("volts_per_unit", "zero")
        channels.append(MappedChannel(role, name, scale, item.number("offset_v", -1e9, 1e9)))
    if unknown := sorted(set(listed.unread())):
        raise listed.error_for(unknown[0], f"is none of {', '.join(Role)}")
    if all(channel.role is not Role.MEASUREMENT for channel in channels):
        raise listed.error_for("measurement", "missing: the beat that the moving corner cube shifts is needed")
    return ForeignMapping(
        kind,
        tuple(channels),
        setup_of(whole.required_object("setup")),
        whole.number("sample_rate_hz", *RATES_HZ),
        whole.whole("trigger_sample", 0, 2**53),
    )


def write_mapping(mapping: ForeignMapping, path: Path) -> None:
    """Write a mapping that ``read_mapping`` can read.  Raises RecordingError."""
    table = {
        "format": mapping.format,
        "sample_rate_hz": mapping.sample_rate_hz,
        "trigger_sample": mapping.trigger_sample,
        "channels": {
            str(channel.role): {key: value for key, value in asdict(channel).items() if key != "role"}
            for channel in mapping.channels
        },
        "setup": setup_json(mapping.setup),
    }
    write_toml_atomic(path, table, _HEAD)


FORMATS = {
    ".tdms": "tdms",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".hdf": "hdf5",
    ".mat": "hdf5",
    ".wav": "wav",
    ".csv": "csv",
    ".txt": "csv",
}
MAPPING_SUFFIX = ".levimass.toml"
FOLDER_MAPPING = "levimass-mapping.toml"


def format_of(path: Path | str) -> str | None:
    """Return "tdms", "hdf5", "wav" or "csv" from the file name's extension, or None."""
    return FORMATS.get(Path(path).suffix.lower())


def mapping_path(path: Path | str) -> Path:
    """Return the path of the mapping of this file alone."""
    path = Path(path)
    return path.with_name(path.name + MAPPING_SUFFIX)


def find_mapping(path: Path | str) -> Path | None:
    """Return the path of the mapping for ``path``: the file's own, else the folder's if for this format, or None."""
    kind = format_of(path)
    if kind is None:
        return None
    if (own := mapping_path(path)).is_file():
        return own
    shared = Path(path).with_name(FOLDER_MAPPING)
    try:
        wanted = read_toml(shared).get("format")
    except RecordingError:
        return None
    return shared if wanted == kind else None


def is_foreign(path: Path | str) -> bool:
    """Return whether ``path`` is a raw recording with a mapping; a .csv with a .toml is a motion record instead."""
    path = Path(path)
    if path.suffix.lower() == ".csv" and path.with_suffix(".toml").exists():
        return False
    return find_mapping(path) is not None
