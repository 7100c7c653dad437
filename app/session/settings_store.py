"""Load and save the settings: atomic writes, a last good copy, and a start even with a damaged file."""

import contextlib
import os
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import cast

from analysis.shot import AIR, AnalysisSettings
from app.session.settings import MAX_ADDRESSES, Settings, WrongSettings
from instrument.devices import source_of
from instrument.files import (
    RecordingError,
    copy_permissions,
    one_line,
    read_json,
    shown,
    write_atomic,
    write_json_atomic,
)
from levimass import Value

VERSION = 1


def load(path: Path) -> tuple[Settings, list[str]]:
    """Return the settings, and warnings about damaged files and unknown settings."""
    words: list[str] = []
    for candidate, meaning in ((path, ""), (_last_good(path), "the last good copy is used")):
        if not candidate.exists():
            continue
        try:
            settings, unknown = _read(candidate)
        except (RecordingError, WrongSettings) as error:
            words.append(f"The settings in {candidate.name} could not be read ({one_line(str(error), 400)})")
            with contextlib.suppress(OSError):  # the next start reports the file again
                os.replace(candidate, candidate.with_name(candidate.name + ".unreadable"))
            continue
        if unknown:
            words.append(f"Settings unknown to this version are ignored: {', '.join(unknown)}")
        if words and meaning:
            words[-1] += f"; {meaning}"
        return settings, words
    if words:
        words[-1] += "; default settings are used"
    return Settings(), words


def save(path: Path, settings: Settings) -> str | None:
    """Save the settings; the former file becomes the last good copy.  Returns an error message, or None."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists():
            _last_good(path).touch(mode=0o600)  # a private file stays private in its copy
            write_atomic(_last_good(path), [path.read_bytes()], sync=True)
            copy_permissions(_last_good(path), path)
        write_json_atomic(path, {"levimass_settings": VERSION, **settings.values()}, sync=True)
    except (OSError, RecordingError) as error:
        return f"The settings could not be saved: {error}"
    return None


def _read(path: Path) -> tuple[Settings, list[str]]:
    document = read_json(path)
    version = document.pop("levimass_settings", None)
    if not isinstance(version, int) or version > VERSION:
        raise WrongSettings(f"version {shown(version)} is unknown to this program")
    known = {field.name for field in fields(Settings)}
    unknown = sorted(set(document) - known)
    try:
        return Settings(**{key: value for key, value in document.items() if key in known}), unknown
    except TypeError as error:
        raise WrongSettings(str(error)) from None


def _last_good(path: Path) -> Path:
    return path.with_name(path.name + ".last-good")


MAX_RECENT = 12
RIG = (  # groups of settings that are corrected together
    ("moving_mass_kg", "moving_mass_u_kg"),
    ("wavelength_vacuum_m", "wavelength_air_m", *AIR),
    ("rest_frequency_hz",),
)


class SettingsStore:
    """Holds the settings in use; each change replaces the immutable Settings and saves it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.settings, self.warnings = load(path)
        self._changed: set[str] = set()  # names of the settings changed since the start

    def change(self, values: dict[str, Value]) -> str | None:
        """Change and save settings; return an error message, or None."""
        before = self.settings.values()
        try:
            self.settings = replace(self.settings, **values)  # type: ignore[arg-type]
        except WrongSettings as error:
            return str(error)
        self._changed |= {name for name, value in values.items() if value != before[name]}
        return save(self._path, self.settings)

    def remember_source(self, source: str) -> None:
        """Store this source, so that the next start opens it, unless it is a replay."""
        if source_of(source).remembered:
            self.change({"source": source})

    def remember_network(self, source: str) -> None:
        """Add a network oscilloscope to the known sources."""
        known = (source, *(other for other in self.settings.network_sources if other != source))
        self.change({"network": " ".join(known[:MAX_ADDRESSES])})

    @property
    def recent(self) -> list[Path]:
        """Get the recently opened files, newest first."""
        return [Path(line) for line in self.settings.recent.splitlines() if line]

    @property
    def sessions(self) -> list[Path]:
        """Get the known session files: the unnamed ones and recently opened ones."""
        without_name = sorted(self._path.parent.glob("session*.json"))
        return [*without_name, *(path for path in self.recent if path.suffix == ".json")]

    def remember_recent(self, paths: Sequence[Path]) -> None:
        """Add these to the recently opened files."""
        newest = [str(path.absolute()) for path in paths[:MAX_RECENT]]
        older = [str(path) for path in self.recent if str(path) not in newest]
        kept = [line for line in (*newest, *older) if "\n" not in line]
        self.change({"recent": "\n".join(kept[:MAX_RECENT])})

    @property
    def start_folder(self) -> Path:
        """Get the folder that file dialogs show first: the data folder if it exists, else the home folder."""
        folder = self.settings.data_folder
        return folder if folder.is_dir() else Path.home()

    def analysis(self) -> AnalysisSettings:
        return self.settings.analysis

    def analysis_again(self) -> AnalysisSettings:
        """Return the settings for a repeated analysis, with rig values changed since the start as corrections.

        All other rig values come from the recording, which may have been taken with another rig.
        """
        values = self.settings.values()
        names = [name for group in RIG for name in group if self._changed.intersection(group)]
        corrections = tuple((name, cast(float | None, values[name])) for name in names)  # all are numbers or None
        return replace(self.settings.analysis, corrections=corrections)
