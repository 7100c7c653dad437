"""The settings file: written atomically, with the last good copy; a damaged file does not stop the start."""

import contextlib
import json
import os
from dataclasses import fields
from pathlib import Path

from app.session.settings import Settings, WrongSettings
from instrument.files import RecordingError, copy_permissions, one_line, read_json, replace_file, shown, sync_folder

VERSION = 1


def load(path: Path) -> tuple[Settings, list[str]]:
    """Return the settings, and warnings where files were damaged or unknown settings left out."""
    words: list[str] = []
    for candidate, meaning in ((path, ""), (_last_good(path), "the last good copy is used")):
        if not candidate.exists():
            continue
        try:
            settings, unknown = _read(candidate)
        except (RecordingError, WrongSettings) as error:
            words.append(f"The settings in {candidate.name} could not be used ({one_line(str(error), 400)})")
            _set_aside(candidate)
            continue
        if unknown:
            words.append(f"Settings unknown to this version were left out: {', '.join(unknown)}")
        if words and meaning:
            words[-1] += f"; {meaning}"
        return settings, words
    if words:
        words[-1] += "; the program's own are used"
    return Settings(), words


def save(path: Path, settings: Settings) -> str | None:
    """Save the settings; the former file becomes the last good copy.  Returns why that failed, or None."""
    document = {"levimass_settings": VERSION, **settings.values()}
    temporary = path.with_name(f"{path.name}.{os.getpid()}.new")  # another window may be saving too
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("w", encoding="utf-8") as file:
            copy_permissions(temporary, path)
            json.dump(document, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        with contextlib.suppress(FileNotFoundError):  # the first time, or just moved by another window
            replace_file(path, _last_good(path))
        replace_file(temporary, path)
        sync_folder(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        return f"The settings could not be saved: {error}"
    return None


def _read(path: Path) -> tuple[Settings, list[str]]:
    document = read_json(path)
    version = document.pop("levimass_settings", None)
    if not isinstance(version, int) or version > VERSION:
        raise WrongSettings(f"version {shown(version)} is not known to this program")
    known = {field.name for field in fields(Settings)}
    unknown = sorted(set(document) - known)
    try:
        return Settings(**{key: value for key, value in document.items() if key in known}), unknown
    except TypeError as error:
        raise WrongSettings(str(error)) from None


def _last_good(path: Path) -> Path:
    return path.with_name(path.name + ".last-good")


def _set_aside(path: Path) -> None:
    try:
        os.replace(path, path.with_name(path.name + ".unreadable"))
    except OSError:
        return  # the next start reports it again
