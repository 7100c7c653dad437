"""A session survives being closed, spoilt and regretted."""

import os
from dataclasses import replace

import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.result import Verdict
from analysis.shot.shot import AnalysisSettings
from app.session.session import Session
from app.session.session_files import own_session
from app.session.verdict_basis import VerdictBasis
from tests.app import synthetic


def _saved(name: str, path: str):
    return replace(synthetic.bare_shot(name), path=path)


def test_reopens_with_notes_settings_and_verdicts(tmp_path):
    session = Session(tmp_path / "session.json")
    shot = replace(_saved("shot-1", "/data/shot-1.sigmf-meta"), settings=AnalysisSettings(bandwidth_hz=5e3))
    session.add(shot)
    session.set_note(1, "plate cleaned")
    session.set_verdict(1, VerdictBasis((), (), (1,), Verdict.ADEQUATE))
    again = Session.reopen(tmp_path / "session.json")
    (entry,) = again.entries
    assert entry.note == "plate cleaned"
    assert entry.verdict == "adequate"
    assert entry.settings.bandwidth_hz == 5e3
    assert entry.shot is None
    assert again.problem is None


def test_a_spoilt_file_is_kept_aside_and_said(tmp_path):
    path = tmp_path / "session.json"
    for text in ("{", "[]", '{"schema": "other"}', '{"schema": "levimass.session/1", "shots": [{}]}', "\x00"):
        path.write_text(text)
        session = Session.reopen(path)
        assert session.entries == ()
        assert session.problem
        assert path.with_name("session.json.unreadable").read_text() == text
        session.add(_saved("shot-1", "/data/x.sigmf-meta"))
        assert len(Session.reopen(path).entries) == 1


@pytest.mark.parametrize(
    "spoilt",
    [
        '"bandwidth_hz": Infinity', '"bandwidth_hz": 1e999', '"bandwidth_hz": 1e300', '"bandwidth_hz": "wide"',
        '"bandwidth_hz": ' + "9" * 400, '"model": 5', '"model": "none"', '"rest": []', '"effects": 3',
        '"bandwidth_hz": 1e3, "bandwidth_hz": 1e3', '"deep": ' + "[" * 100_000,
    ],
)  # fmt: skip
def test_settings_no_analysis_can_use_never_keep_the_window_shut(tmp_path, spoilt):
    path = tmp_path / "session.json"
    text = '{"schema": "levimass.session/1", "shots": [{"number": 1, "name": "a", "path": "/a", "settings": {%s}}]}'
    path.write_text(text % spoilt)
    session = Session.reopen(path)
    assert session.entries == () and session.problem and "\n" not in session.problem
    assert path.with_name("session.json.unreadable").read_text() == text % spoilt


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names on this system")
def test_a_pipe_in_the_sessions_place_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "session.json")
    session = Session.reopen(tmp_path / "session.json")
    assert session.problem and "not a regular file" in session.problem


def test_a_folder_that_cannot_be_written_is_said_and_nothing_is_lost(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    session = Session(blocked / "session.json")
    session.add(_saved("shot-1", "/data/x.sigmf-meta"))
    assert len(session.entries) == 1
    assert "could not be saved" in (session.problem or "") and session.unsaved


def test_why_a_session_could_not_be_read_is_said_until_it_is_saved(tmp_path):
    path = tmp_path / "session.json"
    path.write_text("{")
    session = Session.reopen(path)
    assert "could not be read" in (session.problem or "") and not session.unsaved
    session.add(_saved("shot-1", "/data/x.sigmf-meta"))
    assert session.problem is None and not session.unsaved


def test_undo_brings_back_notes_and_removed_shots_and_keeps_later_ones():
    session = Session()
    for number in range(3):
        session.add(_saved(f"shot-{number}", f"/data/{number}.sigmf-meta"))
    session.set_note(1, "first")
    session.set_note(1, "second")
    session.remove([2, 3])
    session.add(_saved("late", "/data/late.sigmf-meta"))
    assert [entry.number for entry in session.entries] == [1, 4]
    assert session.undo() is not None
    assert {entry.name for entry in session.entries} == {"shot-0", "shot-1", "shot-2", "late"}
    assert len({entry.number for entry in session.entries}) == 4
    session.undo()
    assert session.entry(1).note == "first"
    session.undo()
    assert session.entry(1).note == ""
    assert session.undo() is None


def test_a_second_window_keeps_a_session_of_its_own(tmp_path):
    """Both wrote one file, and the last to save dropped the other's shots and notes."""
    first, second = own_session(tmp_path / "new"), own_session(tmp_path / "new")
    assert first.problem is None and second.problem and "session-2.json" in second.problem
    first.add(_saved("shot-1", "/data/1.sigmf-meta"))
    second.add(_saved("shot-2", "/data/2.sigmf-meta"))
    second.set_note(1, "seen")
    first.unlock()
    again = own_session(tmp_path / "new")
    assert [entry.name for entry in again.entries] == ["shot-1"] and again.problem is None
    second.unlock()
    third = own_session(tmp_path / "new")
    assert [(entry.name, entry.note) for entry in third.entries] == [("shot-2", "seen")]
    again.unlock()
    third.unlock()


def test_an_effect_that_was_tried_stays_marked_until_it_is_taken_out(tmp_path):
    session = Session(tmp_path / "session.json")
    tilt, adhesion = effects_named(("tilt", "adhesion"))
    effects = session.effects.with_effects("paper", (tilt, adhesion), [adhesion])
    session.set_effects(effects)
    again = Session.reopen(tmp_path / "session.json")
    assert again.effects.tried == (adhesion,) and again.effects.of("paper") == (tilt, adhesion)
    assert again.effects.with_effects("paper", (tilt,)).tried == ()


def test_what_was_not_saved_yet_is_on_disk_before_another_session_takes_its_place(tmp_path):
    session = Session(tmp_path / "one.json")
    session.add(_saved("a", str(tmp_path / "a.csv")))
    session.save_by = lambda save: None  # a disk that is slow
    session.set_note(1, "the last word")
    session.switch_to(Session(tmp_path / "two.json"))
    assert [entry.note for entry in Session.reopen(tmp_path / "one.json").entries] == ["the last word"]
    assert session.entries == () and session.path == tmp_path / "two.json"


def test_a_note_written_before_the_analysis_came_is_kept_and_else_that_of_the_recording_is_taken():
    session = Session()
    for name in ("a", "b"):
        session.add_captured(name, None, synthetic.bare_shot(name).settings)
    session.set_note(1, "wobbled")
    notes = [session.fill(n, synthetic.bare_shot("x"), note="of the recording").note for n in (1, 2)]
    assert notes == ["wobbled", "of the recording"]


def test_of_two_shots_of_one_name_the_newest_is_meant(tmp_path):
    session = Session()
    for _ in range(2):
        session.add(synthetic.shot("a"))
    assert session.set_path("a", str(tmp_path / "a.csv"))
    assert [entry.path for entry in session.entries] == [None, str(tmp_path / "a.csv")]
    assert session.entries[1].shot.path == str(tmp_path / "a.csv")
    assert session.set_path("a", str(tmp_path / "b.csv")) and not session.set_path("a", str(tmp_path / "c.csv"))


def test_shots_that_were_not_read_again_yet_are_saved_with_the_others(tmp_path):
    path = tmp_path / "session.json"
    session = Session(path)
    for name in ("a", "b"):
        session.add(_saved(name, str(tmp_path / f"{name}.csv")))
    again = Session.reopen(path)
    again.fill(2, _saved("b", str(tmp_path / "b.csv")))
    again.set_note(2, "read")
    assert [(entry.name, entry.note) for entry in Session.reopen(path).entries] == [("a", ""), ("b", "read")]
