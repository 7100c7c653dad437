"""Cache of analysed shots and diagnoses for the next start, each with the program version that made it.

A result is not used if it is missing, damaged, of an altered recording, or written by a program with other source
code, even of the same version.  The recording is then analysed again.
"""

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from analysis.diagnosis import Diagnosis
from analysis.shot import AnalysisSettings, Progress, Shot, Stop, program_version, version_and_digest
from app.session.result_archive import NotStorable, head_of, packed, unpacked
from app.session.verdict_basis import Diagnosed
from instrument.files import RecordingError, is_foreign, read_metadata, recording_stem, write_atomic

SCHEMA = "levimass.kept/2"
MAX_BYTES = 2_000_000_000  # size of the whole cache; the oldest files are deleted first
MAX_A_FILE = 200_000_000
CachedShot = tuple[Shot, str]  # and the version of the program that analysed it
MOTION_RECORD_SUFFIXES = (".csv", ".tsv", ".toml")  # endings of the files of a motion record


@dataclass(frozen=True, slots=True)
class Key:
    """Cache key: a recording and the settings of its analysis."""

    path: str
    settings: AnalysisSettings

    @property
    def text(self) -> str:
        """Get the text by which keys are compared."""
        return f"{os.path.abspath(self.path)} {self.settings!r}"

    @property
    def bare(self) -> str:
        """Get the text without the effects in the model, for diagnoses."""
        return replace(self, settings=replace(self.settings, effects=())).text


class ResultCache:
    """Cache files in one folder; every method may be called from any thread and raises nothing."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def store_shot(self, shot: Shot) -> None:
        """Store an analysed shot; shots without a saved recording and foreign files are not cached."""
        if shot.path is None or shot.motion is None or shot.problem is not None or is_foreign(shot.path):
            return
        key = Key(shot.path, shot.settings)
        head = {"key": key.text, "stamp": _stamp(Path(shot.path))}
        self._write(f"shot-{_short(key.text)}.npz", head, shot)

    def shots(self, keys: Mapping[int, Key], _: Progress, cancelled: Stop) -> dict[int, CachedShot | None]:
        """Return the cached shots of these entries, None where there is none; the work of a job."""
        return {number: None if cancelled() else self.shot(key) for number, key in keys.items()}

    def shot(self, key: Key) -> CachedShot | None:
        """Return the cached shot of an unchanged recording, or None."""
        file = self._folder / f"shot-{_short(key.text)}.npz"
        try:
            head = head_of(file)
            if not _own(head) or head.get("key") != key.text or head.get("stamp") != _stamp(Path(key.path)):
                return None
            shot = unpacked(file)
        except NotStorable:
            return None
        return (shot, str(head.get("version"))) if isinstance(shot, Shot) else None

    def store_diagnosis(self, diagnosis: Diagnosis, of: Sequence[Key]) -> None:
        keys = [key.bare for key in of]
        head = {"of": keys, "stamps": [_stamp(Path(key.path)) for key in of]}
        self._write(f"diagnosis-{_short(' '.join(keys))}.npz", head, diagnosis)

    def diagnoses(self, of: Mapping[int, Key]) -> list[Diagnosed]:
        """Return the cached diagnoses whose shots are all among these entries, oldest first."""
        number_of = {key.bare: number for number, key in of.items()}
        stamps = {key.bare: _stamp(Path(key.path)) for key in of.values()}
        found = []
        for file in self._files("diagnosis-*.npz"):
            try:
                head = head_of(file)
                keys = head.get("of")
                if not _own(head) or not isinstance(keys, list) or not set(keys) <= set(stamps):
                    continue
                if head.get("stamps") != [stamps[key] for key in keys]:
                    continue
                diagnosis = unpacked(file)
            except NotStorable:
                continue
            if isinstance(diagnosis, Diagnosis):
                numbers = tuple(number_of[key] for key in keys)
                found.append(Diagnosed(diagnosis, numbers, str(head.get("version"))))
        return found

    def _files(self, pattern: str) -> list[Path]:
        try:
            return [path for _, path in sorted((path.stat().st_mtime_ns, path) for path in self._folder.glob(pattern))]
        except OSError:
            return []

    def _write(self, name: str, head: Mapping[str, object], value: object) -> None:
        try:
            whole = packed(
                {"schema": SCHEMA, "version": program_version(), "program": version_and_digest(), **head}, value
            )
            if len(whole) > MAX_A_FILE:
                return
            self._folder.mkdir(parents=True, exist_ok=True)
            write_atomic(self._folder / name, [whole], sync=False)
            self._make_room()
        except (NotStorable, OSError, RecordingError):
            return  # the next start analyses the recording again

    def _make_room(self) -> None:
        files = self._files("*.npz")
        sizes = {file: file.stat().st_size for file in files if file.exists()}
        too_much = sum(sizes.values()) - MAX_BYTES
        for file in files:
            if too_much <= 0:
                return
            file.unlink(missing_ok=True)
            too_much -= sizes.get(file, 0)


def _own(head: Mapping[str, object]) -> bool:
    """Return whether a program with the same source code wrote the file; the version alone does not ensure this."""
    return head.get("schema") == SCHEMA and head.get("program") == version_and_digest()


def _short(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:24]


def _stamp(path: Path) -> list[object]:
    """Return the state of a recording: size and time of its files, and its metadata without the note."""
    stem = recording_stem(path)
    stamp: list[object] = []
    try:
        if stem != path:
            stamp.append(_short(repr(replace(read_metadata(Path(f"{stem}.sigmf-meta")), note=""))))
            files = [Path(f"{stem}.sigmf-data")]
        else:
            files = [path, *(other for ending in MOTION_RECORD_SUFFIXES if (other := path.with_suffix(ending)) != path)]
        for file in files:
            if file.exists():
                about = file.stat()
                stamp += [file.name, about.st_size, about.st_mtime_ns]
    except (OSError, RecordingError) as error:
        return [str(error)]
    return stamp
