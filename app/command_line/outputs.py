"""Where a headless call writes: looked at before the work begins, and what fails said in one line."""

from dataclasses import dataclass
from pathlib import Path

from instrument.files.atomic_file import check_writable
from instrument.files.recording_error import RecordingError


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where a replay writes, each None where it is not asked for; ``json`` may be "-", standard output."""

    json: str | None = None
    export: Path | None = None
    hdf5: bool = False
    report: Path | None = None
    model: Path | None = None


def check_outputs(json_to: str | None, folder: Path | None, *files: Path | None) -> None:
    """Raise RecordingError or OSError where a result could not be written; ``folder`` is made where it is missing."""
    named = [Path(json_to)] if json_to and json_to != "-" else []
    for path in (*named, *(file for file in files if file is not None)):
        check_writable(path)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)


def in_a_line(error: Exception, otherwise: object) -> str:
    """Return file and cause of an error; ``otherwise`` is named where the error names no file itself."""
    if isinstance(error, OSError):
        return f"{error.filename or otherwise}: {error.strerror or error}"
    text = str(error)
    return text if isinstance(error, RecordingError) else f"{otherwise}: {text}"
