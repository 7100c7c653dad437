"""Small text files: session, settings, model, mapping and the TOML beside a table, spoilt in every way known."""

import os
import random
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from analysis.shot.shot import AnalysisSettings
from app.command_line.cli import main
from app.session.model_in_use import load_model
from app.session.session import SCHEMA, Session
from app.session.settings import Settings
from app.session.settings_store import load, save
from instrument.files.foreign_file import read_mapping
from instrument.files.motion_file import read_motion
from instrument.files.recording_error import RecordingError
from tests.attack.travelling import sent
from tests.attack.trial import REFUSED, SURVIVED, Attempt, refused_in_a_line
from tests.instrument.mutating import spoilt_bytes, spoilt_json
from tests.instrument.test_text_file import SPOILT_JSON, SPOILT_TOML

MODEL = """schema = "levimass.model/1"
base = "paper"
effects = ["quadratic_drag"]
shots = ["a", "b"]
[parameters]
"plate_stiffness_n_per_m" = { value = 221.4, std = 0.1 }
"plate_mass_kg" = { value = 1.98e-4, std = 1e-6 }
[covariance]
rows = [[0.01, 0.0], [0.0, 1e-12]]
"""
MAPPING = """format = "csv"
sample_rate_hz = 1e6
[channels.measurement]
name = "PD1"
[setup]
moving_mass_kg = 0.018
"""
ABOUT = 'model = "contact"\nmoving_mass_kg = 0.0912\n[more]\nx = [1, 2]\n'
SESSION = {
    "schema": SCHEMA, "effects": ["quadratic_drag"],
    "shots": [{"number": n, "name": f"shot-{n}", "path": f"/data/{n}", "note": "", "verdict": "", "copy_of": None,
               "settings": asdict(AnalysisSettings())} for n in (1, 2)],
}  # fmt: skip


def texts(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Each kind of file with each known spoiling, then at random."""
    for json_kind, what in (("session", _session), ("settings", _settings)):
        for words, content in SPOILT_JSON.items():
            yield f"{json_kind}: {words}", _tried(folder, f"{json_kind}.json", content, what)
    for name, what in (("model.toml", _model), ("m.toml", _motion), ("x.levimass.toml", _mapping)):
        for words, content in SPOILT_TOML.items():
            yield f"{name}: {words}", _tried(folder, name, content, what)
    for name, what in _READERS.items():
        yield f"{name}: a pipe", _tried(folder, name, None, what)
        yield f"{name}: endless", _tried(folder, name, "/dev/zero", what)
    good: dict[str, Any] = {"model.toml": MODEL, "m.toml": ABOUT, "x.levimass.toml": MAPPING, "session.json": SESSION}
    good["settings.json"] = {"levimass_settings": 1, **Settings().values()}
    while True:
        name = random_.choice(tuple(good))
        whole = good[name]
        content = spoilt_bytes(whole.encode(), random_) if isinstance(whole, str) else spoilt_json(whole, random_)
        yield f"{name}: at random", _tried(folder, name, content, _READERS[name])


def _tried(folder: Path, name: str, content: bytes | str | None, what: Callable[[Path], str]) -> Callable[[], str]:
    def attempt() -> str:
        for left in folder.glob(f"{name}*"):
            left.unlink()
        path = folder / name
        if content is None:
            os.mkfifo(path)
        elif isinstance(content, str):
            path.symlink_to(content)
        else:
            path.write_bytes(content)
        return what(path)

    return attempt


def _session(path: Path) -> str:
    session = Session.reopen(path)
    assert all(entry.path for entry in session.entries)
    if session.problem is None:
        return SURVIVED
    if session.problem.startswith("unknown to this version"):  # the rest of it was read
        assert path.is_file()
        return refused_in_a_line(session.problem)
    assert not path.exists() and not path.is_symlink()
    assert path.with_name(path.name + ".unreadable").exists() or path.with_name(path.name + ".unreadable").is_symlink()
    return refused_in_a_line(session.problem)


def _settings(path: Path) -> str:
    found, words = load(path)
    assert isinstance(found, Settings)
    assert save(path, found) is None
    for line in words:
        refused_in_a_line(line)
    return REFUSED if words else SURVIVED


def _read_by(read: Callable[[Path], object]) -> Callable[[Path], str]:
    def attempt(path: Path) -> str:
        try:
            read(path)
        except RecordingError as error:
            return refused_in_a_line(str(error), path.name)
        return SURVIVED

    return attempt


_model, _mapping = _read_by(load_model), _read_by(read_mapping)


def _motion(path: Path) -> str:
    path.with_suffix(".csv").write_text("time_s,displacement_m\n0,1\n1,2\n")
    return _read_by(read_motion)(path)


_READERS = {
    "session.json": _session, "settings.json": _settings, "model.toml": _model, "m.toml": _motion,
    "x.levimass.toml": _mapping,
}  # fmt: skip
WORDS = (
    "\x1b]0;owned\x07", "\x1b[2J", "\r", "\x00", "\x9b31m", "\u202e", "\u2028", "\udcff", "\ufeff", "'", ",",
    "=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", "%s%n", "{0.__class__}", "a" * 200,
    "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>',
)  # fmt: skip


def travelling(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Names and notes that a terminal, a spreadsheet or a browser would obey."""
    while True:
        words = random_.sample(WORDS, 3)
        yield repr(words)[:60], lambda words=words: sent(folder, words, main)
