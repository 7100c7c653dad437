"""What was called saved is there after a crash at any call, and what it replaces until then (tests/only_synced.py)."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Channel, Recording, Role, Setup
from app.command_line.doctor import write_bundle
from app.report.exports import export_hdf5, write_motion
from app.session.model_in_use import save_model
from app.session.session import Session
from app.session.settings import Settings
from app.session.settings_store import load, save
from app.session.verdict_basis import ModelEffects
from app.window.plots.save import save_columns
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import data_hash, read_recording
from instrument.files.recording_writer import rewrite_note, write_recording
from tests.app import synthetic
from tests.only_synced import Image, only_synced

pytestmark = pytest.mark.skipif(os.name == "nt", reason="a folder is not synced there")

META, DATA = "shot-1.sigmf-meta", "shot-1.sigmf-data"
SHOT = replace(synthetic.shot("shot-1", 0.2, 1), path="/data/shot-1.sigmf-meta")
Save = Callable[[Path], object]


def _recording() -> Recording:
    counts = np.arange(6_000, dtype=np.int16).reshape(-1, 2)
    channels = (Channel(Role.REFERENCE, 1e-3), Channel(Role.MEASUREMENT, 1e-3))
    return Recording("shot-1", counts, 1e6, channels, Setup(0.02), note="first")


def _session(path: Path) -> None:
    Session(path).add(SHOT)


def _settings(path: Path) -> None:
    assert save(path, Settings(moving_mass_kg=0.02)) is None


SAVES: dict[str, tuple[str, Save]] = {
    "a session": ("session.json", _session),
    "a model file": (
        "model.toml",
        lambda path: save_model(path, [SHOT], ModelEffects(), None, progress=lambda *_: None, cancelled=lambda: False),
    ),
    "an export": ("shot.csv", lambda path: write_motion(SHOT, path)),
    "an export to HDF5": ("shot-1.h5", lambda path: export_hdf5([SHOT], path.parent)),
    "what a doctor found": ("bundle.zip", lambda path: write_bundle(path, [])),
    "what a plot shows": ("plot.csv", lambda path: save_columns([("a", np.arange(3.0))], path)),
}


@pytest.mark.parametrize(("name", "action"), SAVES.values(), ids=SAVES)
def test_a_file_is_synced_before_it_takes_its_place_and_its_folder_after(
    name: str, action: Save, tmp_path: Path
) -> None:
    with only_synced(tmp_path) as disk:
        action(tmp_path / name)
    assert disk.calls == ["fsync new", f"replace new -> {name}", "fsync folder"]


@pytest.mark.parametrize(("name", "action"), SAVES.values(), ids=SAVES)
def test_a_crash_at_any_call_leaves_the_old_file_or_the_new_one(name: str, action: Save, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(b"old")
    left: list[Image] = []
    with only_synced(tmp_path, left.append) as disk:
        action(path)
        after = disk.images()
    new = path.read_bytes()
    assert new != b"old" and len(left) > 6
    assert {image.get(name) for image in left} == {b"old", new}
    assert [image.get(name) for image in after] == [new], "it was called saved"


def test_samples_are_synced_before_the_metadata_that_vouch_for_them(tmp_path: Path) -> None:
    with only_synced(tmp_path) as disk:
        write_recording(_recording(), tmp_path / "shot-1")
    first = f"replace new -> {META}"  # of a recording that runs: nothing is said to be safe
    assert disk.calls == [first, f"fsync {DATA}", "fsync new", f"replace new -> {META}", "fsync folder"]


def test_a_crash_at_any_call_leaves_no_recording_that_vouches_for_lost_samples(tmp_path: Path) -> None:
    folder, again = tmp_path / "taken", tmp_path / "again"
    folder.mkdir()
    again.mkdir()
    whole = 0

    def readable(image: Image) -> bool:
        """Return whether the recording is all there; where its metadata have a hash it must be."""
        for name in (META, DATA):
            (again / name).unlink(missing_ok=True)
            if name in image:
                (again / name).write_bytes(image[name])
        if b"core:sha512" not in image.get(META, b""):
            return False
        back = read_recording(again / META)
        assert data_hash(again / META).agrees and back.note == "first"
        np.testing.assert_array_equal(back.counts, _recording().counts)
        return True

    left: list[Image] = []
    with only_synced(folder, left.append) as disk:
        write_recording(_recording(), folder / "shot-1")
        after = disk.images()
    whole = sum(readable(image) for image in left)
    assert 0 < whole < len(left)
    assert len(after) == 1 and readable(after[0]), "it was called saved"


def test_a_crash_while_a_note_is_rewritten_leaves_the_old_note_or_the_new_one(tmp_path: Path) -> None:
    meta = write_recording(_recording(), tmp_path / "shot-1")
    old, data = meta.read_bytes(), (tmp_path / DATA).read_bytes()
    left: list[Image] = []
    with only_synced(tmp_path, left.append) as disk:
        rewrite_note(meta, "second")
        after = disk.images()
    assert disk.calls == ["fsync new", f"replace new -> {META}", "fsync folder"]
    assert {image.get(META) for image in left} == {old, meta.read_bytes()} and b"second" not in old
    assert [image[META] for image in after] == [meta.read_bytes()]
    assert all(image[DATA] == data for image in left)


def test_a_crash_while_settings_are_saved_leaves_the_old_ones_or_the_new_ones(tmp_path: Path) -> None:
    folder, again = tmp_path / "kept", tmp_path / "again"
    folder.mkdir()
    again.mkdir()
    path = folder / "settings.json"
    assert save(path, Settings(moving_mass_kg=0.01)) is None

    def found(image: Image) -> float | None:
        for file in again.iterdir():
            file.unlink()
        for name, content in image.items():
            (again / name).write_bytes(content)
        settings, words = load(again / "settings.json")
        assert words == []
        return settings.moving_mass_kg

    left: list[Image] = []
    with only_synced(folder, left.append) as disk:
        _settings(path)
        after = disk.images()
    assert {found(image) for image in left} == {0.01, 0.02}
    assert [found(image) for image in after] == [0.02], "it was called saved"


def test_what_could_not_be_synced_is_not_called_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RecordingError, match="No space left"):
        write_recording(_recording(), tmp_path / "shot-1")
    with pytest.raises(RecordingError, match="No space left"):
        write_motion(SHOT, tmp_path / "shot.csv")
    assert list(tmp_path.iterdir()) == []
    assert "No space left" in (save(tmp_path / "settings.json", Settings()) or "")
    assert list(tmp_path.iterdir()) == []
    session = Session(tmp_path / "session.json")
    session.add(SHOT)
    assert "No space left" in (session.problem or "")
