"""Which recordings and motion records lie under the files and folders a person named."""

import re
from collections.abc import Iterable
from pathlib import Path

from instrument.files.foreign.mapping import ENDING, OF_FOLDER, is_foreign

TABLES = {".csv": ",", ".tsv": "\t"}  # of motion records, and what parts their cells


def motion_table(about: Path) -> Path:
    """Return the table that a motion record's .toml stands beside."""
    tables = [about.with_suffix(ending) for ending in TABLES]
    return next((table for table in tables if table.exists()), tables[0])


def recording_stem(path: Path | str) -> Path:
    """Return the common stem of a recording's two files; ``path`` may name either of them or the stem."""
    text = str(path)
    for ending in (".sigmf-meta", ".sigmf-data"):
        if text.endswith(ending):
            return Path(text.removesuffix(ending))
    return Path(text)


def find_recordings(paths: Iterable[Path | str]) -> list[Path]:
    """Return one path a shot: a ``.sigmf-meta`` for a recording, a ``.csv`` or ``.tsv`` for a motion record.

    A foreign file counts as a shot where its mapping is remembered (``instrument.files.foreign.mapping``).
    Paths keep their order; within a folder names are in counting order (shot-2 before shot-10).  A folder that holds
    no shot itself is searched downwards (links are not followed).  A path that names nothing is returned as it is:
    reading it says why.  No shot appears twice.
    """
    found: dict[Path, None] = {}
    for path in map(Path, paths):
        try:
            shots = _in_folder(path) if path.is_dir() else [_of_file(path)]
        except OSError:  # a folder that may not be entered, a name too long
            shots = [path]
        found.update(dict.fromkeys(shots))
    return list(found)


def is_motion_record(path: Path | str) -> bool:
    """Return whether ``path`` names a motion record rather than a raw recording."""
    return Path(path).suffix.lower() in (*TABLES, ".toml") and not is_foreign(path)


def _of_file(path: Path) -> Path:
    if path.name.endswith(ENDING):
        return path.with_name(path.name.removesuffix(ENDING))
    if path.suffix.lower() == ".toml":
        return motion_table(path)
    stem = recording_stem(path)
    meta, data = (stem.with_name(stem.name + ending) for ending in (".sigmf-meta", ".sigmf-data"))
    if stem != path or (not path.exists() and (meta.exists() or data.exists())):
        return meta
    return path


def _in_folder(folder: Path) -> list[Path]:
    try:
        entries = sorted(folder.iterdir(), key=_counting_order)
    except OSError:
        return [folder]
    here = _shots_among(entries)
    if here:
        return here
    below: list[Path] = []
    for entry in entries:
        if entry.is_dir() and not entry.is_symlink() and not entry.name.startswith("."):
            inside = _in_folder(entry)
            below.extend(shot for shot in inside if shot != entry)
    return below or [folder]


def _shots_among(entries: list[Path]) -> list[Path]:
    names = {entry.name for entry in entries}
    shots: dict[Path, None] = {}
    for entry in entries:
        if entry.name.startswith("."):
            continue
        if entry.suffix in (".sigmf-meta", ".sigmf-data"):
            stem = recording_stem(entry)
            shots[stem.with_name(stem.name + ".sigmf-meta")] = None
        elif _is_motion_table(entry, names) or (names & {entry.name + ENDING, OF_FOLDER} and is_foreign(entry)):
            shots[entry] = None
    return sorted(shots, key=_counting_order)


def _is_motion_table(entry: Path, names: set[str]) -> bool:
    return entry.suffix.lower() in TABLES and entry.stem + ".toml" in names


def _counting_order(path: Path) -> tuple[list[tuple[int, int, str]], str]:
    parts = re.split(r"(\d+)", path.name)
    return [(int(p), 0, "") if p.isdecimal() and len(p) < 20 else (-1, 0, p) for p in parts], path.name
