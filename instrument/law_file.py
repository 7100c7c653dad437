"""A person's own law as a TOML file (docs/own-laws.md)."""

from pathlib import Path

from analysis.laws.own import LawError, OwnLaw, from_mapping
from instrument.recording_error import RecordingError
from instrument.text_file import read_toml

LARGEST_BYTES = 64 * 1024


def read_law(path: Path) -> OwnLaw:
    """Return the law in ``path``; RecordingError, one line, names the file, the key and what is wrong with it."""
    try:
        return from_mapping(read_toml(path, LARGEST_BYTES))
    except LawError as error:
        raise RecordingError(path, str(error)) from None
