"""Results come back at the next start as they were, with their evidence and their version; nothing else does."""

import io
import json
import os
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis.findings.result import (
    BlindSpot,
    Freedom,
    Phase,
    Remainder,
    Standing,
    Verdict,
)
from analysis.shot.shot import PlotNote
from analysis.shot.version import program_version
from app.session import result_archive, result_cache
from app.session.result_archive import NotStorable, head_of, packed, unpacked
from app.session.result_cache import Key, ResultCache
from app.session.session import Session
from app.session.verdict_basis import Diagnosed
from app.session.workbench import Workbench
from tests.app import synthetic


@pytest.fixture(scope="module")
def shot():
    return synthetic.shot(count=9000)


@pytest.fixture
def saved(tmp_path, shot):
    """Return the shot as that of a motion record on disk."""
    path = tmp_path / "shot-1.csv"
    path.write_text("time_s,displacement_m\n")
    return replace(shot, path=str(path))


def _wait(workbench: Workbench) -> None:
    """Wait for all work, what taking its results asks for included."""
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        if not _open_jobs(workbench):
            workbench.poll()
            if not _open_jobs(workbench):
                return
        time.sleep(0.005)


def _open_jobs(workbench: Workbench) -> int:
    return workbench.short_jobs.open_jobs + workbench.jobs.open_jobs


def test_a_shot_and_a_diagnosis_come_back_whole(shot):
    again = unpacked(io.BytesIO(packed({"n": 1}, shot)))
    assert repr(again.impact) == repr(shot.impact) and again.settings == shot.settings and again.setup == shot.setup
    assert np.array_equal(again.motion.force_n, shot.motion.force_n) and not again.motion.force_n.flags.writeable
    assert again.fit.shots[0].overlay.time_s is again.motion.time_s  # one array in memory as before
    found = unpacked(io.BytesIO(packed({}, synthetic.diagnosis(shot))))
    assert found.verdict is Verdict.EFFECT_FOUND and found.candidates == synthetic.diagnosis(shot).candidates
    assert isinstance(found.effects[0].indistinguishable_from, tuple)
    curve = np.arange(5, dtype=np.float32)
    with_curve = replace(synthetic.diagnosis(shot), candidates=(replace(found.candidates[0], explains_m=(curve,)),))
    kept = unpacked(io.BytesIO(packed({}, with_curve))).candidates[0].explains_m
    assert np.array_equal(kept[0], curve) and kept[0].dtype == np.float32


def test_what_remains_comes_back_as_it_was(shot):
    left = Remainder(2e-9, 1e-10, ((Phase.LOADING, 3e-9),), None, 1100.0, Freedom.BEND, 13.0, (effect_named("tilt"),))
    found = synthetic.diagnosis(shot)
    candidates = (replace(found.candidates[0], standing=Standing.VALIDATED, number=0.5),)
    found = replace(found, remainder=left, drive=synthetic.DRIVE, candidates=candidates)
    again = unpacked(io.BytesIO(packed({}, found)))
    assert (again.remainder, again.drive, again.candidates) == (left, synthetic.DRIVE, candidates)
    assert again.blind_spots == found.blind_spots == (BlindSpot(effect_named("tilt"), "angle_rad", 2e-5),)


def test_only_the_analysis_own_classes_are_made():
    body = np.frombuffer(json.dumps({"kind": "Popen", "fields": {"args": "true"}}).encode(), np.uint8)
    file = io.BytesIO()
    np.savez(file, head=body, body=body)
    with pytest.raises(NotStorable):
        unpacked(io.BytesIO(file.getvalue()))
    with pytest.raises(NotStorable, match="Path cannot be stored"):
        packed({}, (Path("a"),))
    for spoilt in (b"", b"PK", file.getvalue()[:-40]):
        with pytest.raises(NotStorable):
            head_of(io.BytesIO(spoilt))


def test_what_was_altered_is_not_taken_for_the_same(tmp_path, saved, monkeypatch):
    kept = ResultCache(tmp_path / "kept")
    key = Key(saved.path, saved.settings)
    assert kept.shot(key) is None
    kept.store_shot(saved)
    found = kept.shot(key)
    assert found is not None and (found[0].name, found[1]) == (saved.name, program_version())
    assert kept.shot(Key(saved.path, replace(saved.settings, bandwidth_hz=5e3))) is None
    (file,) = (tmp_path / "kept").iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    assert kept.shot(key) is None
    file.write_bytes(whole)
    Path(saved.path).write_text("time_s,displacement_m\n0,0\n")
    assert kept.shot(key) is None
    monkeypatch.setattr(result_cache, "MAX_BYTES", 1)
    kept.store_shot(saved)
    assert list((tmp_path / "kept").iterdir()) == []


@pytest.mark.parametrize(("spare_bytes", "go"), [(0, 1), (-1, 2)])
def test_the_oldest_results_make_room_and_no_more_of_them_than_must(tmp_path, saved, monkeypatch, spare_bytes, go):
    folder = tmp_path / "kept"
    kept = ResultCache(folder)
    for index in range(4):
        recording = tmp_path / f"shot-{index}.csv"
        recording.write_text("time_s,displacement_m\n")
        last = replace(saved, path=str(recording))
        before = set(folder.glob("*"))
        kept.store_shot(last)
        (made,) = set(folder.glob("*")) - before
        os.utime(made, (1e9 + index, 1e9 + index))
    by_age = sorted(folder.iterdir(), key=lambda file: file.stat().st_mtime)
    sizes = [file.stat().st_size for file in by_age]
    monkeypatch.setattr(result_cache, "MAX_BYTES", sum(sizes[1:]) + spare_bytes)
    kept.store_shot(last)  # again: in the place of the newest
    assert sorted(folder.iterdir()) == sorted(by_age[go:])


def test_a_shot_with_a_note_on_a_plot_is_kept_whole(tmp_path, saved):
    kept = ResultCache(tmp_path / "kept")
    noted = replace(saved, plot_notes=(PlotNote("force", 0.01, 0.2, "a knock"),))
    kept.store_shot(noted)
    found = kept.shot(Key(saved.path, saved.settings))
    assert found is not None and found[0].plot_notes == noted.plot_notes


def test_a_changed_program_of_the_same_version_analyses_again(tmp_path, saved, monkeypatch):
    kept = ResultCache(tmp_path / "kept")
    key = Key(saved.path, saved.settings)
    kept.store_shot(saved)
    kept.store_diagnosis(synthetic.diagnosis(saved), [key])
    assert kept.shot(key) is not None and len(kept.diagnoses({1: key})) == 1
    monkeypatch.setattr(result_cache, "version_and_digest", lambda: f"{program_version()} (another)")
    assert kept.shot(key) is None and kept.diagnoses({1: key}) == []


def test_a_result_whose_class_has_changed_is_analysed_again(tmp_path, saved, monkeypatch):
    kept = ResultCache(tmp_path / "kept")
    kept.store_shot(saved)

    def other(**_: object) -> None:
        raise TypeError("unexpected keyword argument 'flags'")

    monkeypatch.setitem(result_archive.kinds(), "Impact", other)
    assert kept.shot(Key(saved.path, saved.settings)) is None


def test_a_session_reopens_at_once_with_its_evidence_and_its_version(tmp_path, saved, monkeypatch):
    kept = ResultCache(tmp_path / "kept")
    first = Workbench(Session(tmp_path / "session.json"), lambda: saved.settings, results=kept)
    entry = first.add_shot(saved)
    found, take = synthetic.diagnosis(saved), partial(first._take_diagnosis, (entry.number,))
    first.jobs.submit("diagnosis", lambda _, __: found, "diagnosis", take).done.wait(10)
    first.poll()
    _wait(first)
    assert first.close()

    again = Workbench(Session.reopen(tmp_path / "session.json"), lambda: saved.settings, results=kept)
    try:
        monkeypatch.setattr("app.session.workbench.load_and_analyse", None)  # nothing is read or analysed again
        assert again.session.entries[0].shot is None
        again.read_unread()
        _wait(again)
        (filled,) = again.session.entries
        assert filled.shot is not None and filled.version == program_version()
        assert np.array_equal(filled.shot.fit.shots[0].residual_m, saved.fit.shots[0].residual_m)
        diagnosed = again.diagnoses.of([filled.number])
        assert diagnosed is not None and diagnosed.version == program_version()
        assert diagnosed.diagnosis.sentence == found.sentence
        assert again.jobs.open_jobs == 0
    finally:
        again.close()


def test_a_recording_that_was_opened_is_there_at_once_at_the_next_start(tmp_path, saved, monkeypatch):
    kept = ResultCache(tmp_path / "kept")
    Path(saved.path).with_suffix(".toml").write_text('model = "paper"\n')
    monkeypatch.setattr("app.session.workbench.load_and_analyse", lambda *_, **__: saved)
    first = Workbench(Session(tmp_path / "session.json"), lambda: saved.settings, results=kept)
    assert first.open_paths([Path(saved.path)]) == 1
    _wait(first)
    assert first.close()
    again = Workbench(Session.reopen(tmp_path / "session.json"), lambda: saved.settings, results=kept)
    try:
        monkeypatch.setattr("app.session.workbench.load_and_analyse", None)
        again.read_unread()
        _wait(again)
        assert [entry.version for entry in again.session.entries] == [program_version()]
    finally:
        again.close()


def test_the_page_shows_the_diagnosis_of_what_is_selected():
    workbench = Workbench(Session(), lambda: synthetic.shot(count=9000).settings)
    try:
        one, both = Diagnosed(None, (1,)), Diagnosed(None, (1, 2))
        workbench.diagnoses += [both, one]
        assert workbench.diagnoses.of([1, 2]) is both and workbench.diagnoses.of([1]) is one
        assert workbench.diagnoses.of([2]) is both and workbench.diagnoses.of([3]) is None
        assert workbench.diagnoses.newest is one
    finally:
        workbench.close()
