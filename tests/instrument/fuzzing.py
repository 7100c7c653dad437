"""Recordings, motion records and settings, damaged at random: each opens or is refused in one line."""

import json
import random
from collections import Counter
from pathlib import Path

from analysis.shot.recording import Recording
from app.session.settings import Settings
from app.session.settings_store import load, save
from instrument.files.motion_file import read_motion
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import data_hash, read_recording
from instrument.files.recording_writer import write_recording
from tests.instrument.mutating import spoilt_bytes, spoilt_json


def fuzz(folder: Path, shot: Recording, times: int, seed: int) -> Counter[str]:
    """Spoil and read ``times`` files in ``folder``; return what happened.  Any other exception is let through."""
    random_ = random.Random(seed)
    happened: Counter[str] = Counter()
    meta = write_recording(shot, folder / "s")
    data = folder / "s.sigmf-data"
    raw, head = data.read_bytes(), json.loads(meta.read_bytes())
    save(folder / "good.json", Settings())
    settings = json.loads((folder / "good.json").read_text())
    table = "time_s,displacement_m,force_n\n" + "".join(f"{i * 1e-3:.4f},{i * i * 1e-6},{i}\n" for i in range(60))
    about = 'model = "contact"\nmoving_mass_kg = 0.0912\n[more]\nx = [1, 2]\n'
    for _ in range(times):
        kind = random_.choice(("metadata", "metadata", "metadata", "data", "motion", "settings"))
        if kind == "metadata":
            meta.write_bytes(spoilt_json(head, random_))
            happened[f"{kind} {_read(folder / 's')}"] += 1
        elif kind == "data":
            meta.write_text(json.dumps(head))
            data.write_bytes(spoilt_bytes(raw, random_))
            happened[f"{kind} {_read(folder / 's')}"] += 1
            data.write_bytes(raw)
        elif kind == "motion":
            spoil_table = random_.random() < 0.5
            text, toml = table.encode(), about.encode()
            (folder / "m.csv").write_bytes(spoilt_bytes(text, random_) if spoil_table else text)
            (folder / "m.toml").write_bytes(toml if spoil_table else spoilt_bytes(toml, random_))
            happened[f"{kind} {_motion(folder / 'm.csv')}"] += 1
        else:
            (folder / "settings.json").write_bytes(spoilt_json(settings, random_))
            found, words = load(folder / "settings.json")
            assert isinstance(found, Settings) and all("\n" not in line for line in words)
            happened[f"{kind} {'with a word' if words else 'opened'}"] += 1
            for left in folder.glob("settings.json*"):
                left.unlink()
    return happened


def _read(stem: Path) -> str:
    try:
        recording = read_recording(stem)
    except RecordingError as error:
        return _one_line(str(error), stem)
    assert 0 < recording.samples < 10_000_000 and recording.sample_rate_hz > 0
    int(recording.counts[-1].sum())
    try:
        data_hash(stem)
    except RecordingError as error:
        _one_line(str(error), stem)
    return "opened"


def _motion(path: Path) -> str:
    try:
        read_motion(path)
    except RecordingError as error:
        return _one_line(str(error), path)
    return "opened"


def _one_line(words: str, path: Path) -> str:
    assert "\n" not in words and len(words) < 700 and str(path.with_suffix("")) in words, words
    return "refused in one line"
