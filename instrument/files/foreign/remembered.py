"""Where the mapping of a foreign file is remembered: beside the file, or once for all files of its folder."""

from pathlib import Path

from instrument.files.recording_error import RecordingError
from instrument.files.text_file import read_toml

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
ENDING = ".levimass.toml"
OF_FOLDER = "levimass-mapping.toml"


def format_of(path: Path | str) -> str | None:
    """Return "tdms", "hdf5", "wav" or "csv" by the file's ending, or None."""
    return FORMATS.get(Path(path).suffix.lower())


def own_mapping(path: Path | str) -> Path:
    """Return where a file's own mapping is kept."""
    path = Path(path)
    return path.with_name(path.name + ENDING)


def remembered_mapping(path: Path | str) -> Path | None:
    """Return the mapping that says how to read ``path``: its own, else its folder's where that is of its format."""
    kind = format_of(path)
    if kind is None:
        return None
    if (own := own_mapping(path)).is_file():
        return own
    shared = Path(path).with_name(OF_FOLDER)
    try:
        wanted = read_toml(shared).get("format")
    except RecordingError:
        return None
    return shared if wanted == kind else None


def is_foreign(path: Path | str) -> bool:
    """Return whether a mapping makes ``path`` a raw recording; a motion record (its .toml beside it) is none."""
    path = Path(path)
    if path.suffix.lower() == ".csv" and path.with_suffix(".toml").exists():
        return False
    return remembered_mapping(path) is not None
