"""One raw recording from wherever it lies: two SigMF files, or a foreign file whose mapping is remembered."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from analysis.shot.recording import Recording
from analysis.shot.shot import Shot
from instrument.files.foreign.mapping import format_of, read_mapping, remembered_mapping
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import ALTERED, has_hash, read_recording, read_unhashed


def open_recording(path: Path | str) -> Recording:
    """Return the recording; RecordingError, one line, names file and cause, and how to give a mapping."""
    path = Path(path)
    return _foreign(path) or read_recording(path)


def open_unchecked(path: Path | str) -> Recording:
    """Do as ``open_recording`` does, but for the hash of the data."""
    path = Path(path)
    return _foreign(path) or read_unhashed(path)[0]


def analysed_while_hashed(path: Path | str, analyse: Callable[[Recording], Shot]) -> Shot:
    """Let ``analyse`` make a shot of the recording, and say "data_altered" where its data have another hash.

    The hash takes a third as long as the rest and runs in a thread beside it: free where a core is free.  Raises as
    ``open_recording`` and ``analyse`` do.
    """
    path = Path(path)
    recording = _foreign(path)
    if recording is not None:
        return analyse(recording)
    recording, sha512 = read_unhashed(path)
    if sha512 is None:
        return analyse(recording)
    given_up = threading.Event()
    with ThreadPoolExecutor(1, "levimass hash") as beside:
        true = beside.submit(has_hash, recording, sha512, given_up.is_set)
        try:
            shot = analyse(recording)
        except BaseException:
            given_up.set()
            raise
        return shot if true.result() else replace(shot, flags=(*shot.flags, ALTERED))


def _foreign(path: Path) -> Recording | None:
    """Return what a foreign file holds, None where the path is that of a recording; raises as ``open_recording``."""
    if path.is_dir():
        raise RecordingError(path, _in_vain(path))
    if format_of(path) is None:
        return None
    mapping = remembered_mapping(path)
    if mapping is None:
        if not path.exists():
            raise RecordingError(path, "no such file")
        raise RecordingError(path, f"nothing says which of its channels is which; {_advice(path)}")
    from instrument.files.foreign.reading import read_foreign

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
