"""Opens a raw recording: two SigMF files, or a foreign file that has a mapping."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from analysis.shot import Recording, Shot
from instrument.files.foreign.mapping import find_mapping, format_of, read_mapping
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import ALTERED, hash_matches, read_recording, read_without_hash


def open_recording(path: Path | str) -> Recording:
    """Open a recording.  Raises RecordingError, which says how to give a missing mapping."""
    path = Path(path)
    return _foreign(path) or read_recording(path)


def open_without_hash(path: Path | str) -> Recording:
    """Open a recording as ``open_recording`` does, without checking the hash of its data."""
    path = Path(path)
    return _foreign(path) or read_without_hash(path)[0]


def analyse_and_check_hash(path: Path | str, analyse: Callable[[Recording], Shot]) -> Shot:
    """Analyse a recording while a second thread checks the hash of its data; flag "data_altered" if it differs.

    The hash takes a third of the time of the rest.  Raises as ``open_recording`` and ``analyse`` do.
    """
    path = Path(path)
    recording = _foreign(path)
    if recording is not None:
        return analyse(recording)
    recording, sha512 = read_without_hash(path)
    if sha512 is None:
        return analyse(recording)
    cancelled = threading.Event()
    with ThreadPoolExecutor(1, "levimass hash") as executor:
        unaltered = executor.submit(hash_matches, recording, sha512, cancelled.is_set)
        try:
            shot = analyse(recording)
        except BaseException:
            cancelled.set()
            raise
        return shot if unaltered.result() else replace(shot, flags=(*shot.flags, ALTERED))


def _foreign(path: Path) -> Recording | None:
    """Return the recording in a foreign file, None if the path is that of SigMF files.  Raises RecordingError."""
    if path.is_dir():
        raise RecordingError(path, _why_no_recording(path))
    if format_of(path) is None:
        return None
    mapping = find_mapping(path)
    if mapping is None:
        if not path.exists():
            raise RecordingError(path, "no such file")
        raise RecordingError(path, f"nothing says which of its channels is which; {_advice(path)}")
    from instrument.files.foreign.reading import read_foreign

    return read_foreign(path, read_mapping(mapping))


def _why_no_recording(folder: Path) -> str:
    try:
        foreign = next((p for p in sorted(folder.iterdir()) if format_of(p) is not None and p.is_file()), None)
    except OSError as error:
        return error.strerror or str(error)
    if foreign is None:
        return "this folder holds no recording"
    return f"this folder holds no recording, but {foreign.name}; {_advice(foreign)}"


def _advice(path: Path) -> str:
    return f"'levimass --map {path.name}' lists them and shows how to say it"
