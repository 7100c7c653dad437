"""One raw recording from wherever it lies: two SigMF files, or a foreign file whose mapping is remembered."""

from pathlib import Path

from analysis.recording import Recording
from instrument.foreign.mapping import read_mapping
from instrument.foreign.remembered import format_of, remembered_mapping
from instrument.recording_error import RecordingError
from instrument.recording_file import read_recording


def open_recording(path: Path | str) -> Recording:
    """Return the recording; RecordingError, one line, names file and cause, and how to give a mapping."""
    path = Path(path)
    if path.is_dir():
        raise RecordingError(path, _in_vain(path))
    if format_of(path) is None:
        return read_recording(path)
    mapping = remembered_mapping(path)
    if mapping is None:
        if not path.exists():
            raise RecordingError(path, "no such file")
        raise RecordingError(path, f"nothing says which of its channels is which; {_advice(path)}")
    from instrument.foreign.reading import read_foreign

    return read_foreign(path, read_mapping(mapping))


def _in_vain(folder: Path) -> str:
    try:
        foreign = next((p for p in sorted(folder.iterdir()) if format_of(p) is not None and p.is_file()), None)
    except OSError as error:
        return error.strerror or str(error)
    if foreign is None:
        return "no recording lies in this folder"
    return f"no recording lies in this folder, but {foreign.name} does; {_advice(foreign)}"


def _advice(path: Path) -> str:
    return f"'levimass --map {path.name}' lists them and shows how to say it"
