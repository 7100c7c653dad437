"""Find the recordings and motion records among files and folders."""

import re
from collections.abc import Iterable
from pathlib import Path

from instrument.files.foreign_file import FOLDER_MAPPING, MAPPING_SUFFIX, is_foreign

TABLES = {".csv": ",", ".tsv": "\t"}  # extensions of motion records' tables, and their delimiters


def motion_table(about: Path) -> Path:
    """Return the table that belongs to a motion record's .toml."""
    tables = [about.with_suffix(ending) for ending in TABLES]
    return next((table for table in tables if table.exists()), tables[0])


def recording_stem(path: Path | str) -> Path:
    """Return the common stem of a recording's two files; ``path`` is either of them or the stem."""
    text = str(path)
    for ending in (".sigmf-meta", ".sigmf-data"):
        if text.endswith(ending):
            return Path(text.removesuffix(ending))
    return Path(text)


def recording_files(path: Path | str) -> tuple[Path, Path]:
    """Return the metadata and the data file of a recording; ``path`` is either of them or their stem."""
    stem = recording_stem(path)
    return stem.with_name(f"{stem.name}.sigmf-meta"), stem.with_name(f"{stem.name}.sigmf-data")


def find_recordings(paths: Iterable[Path | str]) -> list[Path]:
    """Return one path per shot: a ``.sigmf-meta`` for a recording, a ``.csv`` or ``.tsv`` for a motion record.

    A foreign file is a shot if it has a mapping (``instrument.files.foreign_file``).  Paths keep their order; within a
    folder names are in numerical order (shot-2 before shot-10).  If a folder has no shots, its subfolders are searched
    (links are not followed).  A path without a shot is returned unchanged, so that reading it raises the error.  Each
    shot appears once.
    """
    found: dict[Path, None] = {}
    for path in map(Path, paths):
        try:
            shots = _in_folder(path) if path.is_dir() else [_of_file(path)]
        except OSError:  # a folder without permission, or a name too long
            shots = [path]
        found.update(dict.fromkeys(shots))
    return list(found)


def is_motion_record(path: Path | str) -> bool:
    """Return whether ``path`` is a motion record rather than a raw recording."""
    return Path(path).suffix.lower() in (*TABLES, ".toml") and not is_foreign(path)


def _of_file(path: Path) -> Path:
    if path.name.endswith(MAPPING_SUFFIX):
        return path.with_name(path.name.removesuffix(MAPPING_SUFFIX))
    if path.suffix.lower() == ".toml":
        return motion_table(path)
    stem = recording_stem(path)
    meta, data = recording_files(path)
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
        mapped = bool(names & {entry.name + MAPPING_SUFFIX, FOLDER_MAPPING}) and is_foreign(entry)
        if entry.suffix in (".sigmf-meta", ".sigmf-data"):
            shots[recording_files(entry)[0]] = None
        elif mapped or (entry.suffix.lower() in TABLES and entry.stem + ".toml" in names):
            shots[entry] = None
    return sorted(shots, key=_counting_order)


def _counting_order(path: Path) -> tuple[list[str | int], str]:
    parts: list[str | int] = [*re.split(r"(\d+)", path.name)]  # text and numbers alternate; texts may be empty
    parts[1::2] = [int(number) for number in parts[1::2]]
    return parts, path.name
