"""Recordings that a kill or a power cut ended while they were written: found at the next start, never lost."""

from collections.abc import Collection
from pathlib import Path

from instrument.recording_error import RecordingError
from instrument.recording_metadata import read_metadata

MOST = 1000  # newest recordings of the folder that are looked at


def cut_off(folder: Path, listed: Collection[str], before_s: float) -> list[Path]:
    """Return the recordings in ``folder`` that were never closed, none of ``listed``, newest first.

    ``before_s``: what was written to at this time (s since the epoch) or later may be under way.  One small file a
    recording is read.
    """
    try:
        found = [(path.stat().st_mtime, path) for path in folder.glob("*.sigmf-meta") if str(path) not in listed]
    except OSError:
        return []
    newest = sorted(found, reverse=True)[:MOST]
    return [path for written_s, path in newest if written_s < before_s and _open(path)]


def _open(path: Path) -> bool:
    try:
        return read_metadata(path).sha512 is None
    except RecordingError:
        return False  # opening it says why
