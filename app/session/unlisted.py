"""Recordings of the data folder that no session lists: found at the next start, so that a kill costs no shot."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from instrument.files.checked import Checked
from instrument.files.recording_error import RecordingError
from instrument.files.recording_metadata import read_metadata
from instrument.files.text_file import read_json

MOST = 1000  # newest recordings of the folder that are looked at


@dataclass(frozen=True, slots=True)
class Unlisted:
    """Recordings that no session lists, newest first; ``cut_off`` are those that were never closed."""

    complete: tuple[Path, ...] = ()
    cut_off: tuple[Path, ...] = ()


def unlisted(folder: Path, listed: Collection[str], before_s: float) -> Unlisted:
    """Return the recordings in ``folder`` that are none of ``listed``.

    ``before_s``: what was written to at this time (s since the epoch) or later may be under way.  One small file a
    recording is read; what cannot be read is left to whoever opens it.
    """
    try:
        found = [(path.stat().st_mtime, path) for path in folder.glob("*.sigmf-meta") if str(path) not in listed]
    except OSError:
        return Unlisted()
    newest = [path for written_s, path in sorted(found, reverse=True)[:MOST] if written_s < before_s]
    closed: list[Path] = []
    cut_off: list[Path] = []
    for path in newest:
        try:
            (cut_off if read_metadata(path).sha512 is None else closed).append(path)
        except RecordingError:
            continue
    return Unlisted(tuple(closed), tuple(cut_off))


def listed_by(sessions: Iterable[Path]) -> set[str]:
    """Return the recordings that these session files list or leave out; a file that is none lists nothing."""
    paths: set[str] = set()
    for file in sessions:
        try:
            document = Checked(file, read_json(file))
            shots = document.objects("shots") or ()
            paths.update(path for shot in shots if (path := shot.text("path", 10_000)) is not None)
            left_out = document.get("left_out")
        except RecordingError:
            continue
        if isinstance(left_out, list):
            paths.update(path for path in left_out if isinstance(path, str))
    return paths
