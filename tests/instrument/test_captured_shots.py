"""Shots after their capture: numbered, the newest shown, those only in memory kept until they are saved."""

from dataclasses import replace
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.shot.recording import Channel, Recording, Role, Setup
from instrument.capture import captured_shots, recorder, snapshot
from instrument.capture.captured_shots import CapturedShots
from instrument.capture.recorder import GrowingShot, Recorded, Recorder, _highest_number, save_elsewhere
from instrument.capture.snapshot import CapturedShot
from instrument.devices.digitizer import CaptureSettings
from instrument.files.recording_error import RecordingError, SomeShotsNotSaved
from instrument.files.recording_file import read_recording

SETTINGS = CaptureSettings(1e6, 100, 20)
CHANNELS = (Channel(Role.MEASUREMENT, 1e-3),)


def _recorded(
    name: str, problem: str | None = None, early: str | None = None, filled: int = 100, aborted: bool = False
) -> Recorded:
    counts = np.arange(100, dtype=np.int16)[:, None]
    shot = GrowingShot(SETTINGS, CHANNELS, Setup(17.85e-3), "bench", "2026-01-01T00:00:00Z", 20, counts)
    shot.filled, shot.ended_early, shot.aborted = filled, early, aborted
    recording = shot.recording(name)
    if problem is None:
        recording = replace(recording, path=f"/data/{name}.sigmf-meta")
    return Recorded(shot, recording, problem, SimpleNamespace(abandon=lambda: GONE.append(name)))  # type: ignore[arg-type]


GONE: list[str] = []


class Analysis:
    """Stands for the thread that analyses: notes what it is given, and takes so many."""

    def __init__(self, room: int) -> None:
        self.room, self.given = room, []

    def submit(self, key: int, recording: Recording) -> bool:
        self.given.append((key, recording.name))
        return len(self.given) <= self.room


def _waiting(shots: CapturedShots) -> list[int]:
    return [shot.number for shot in shots.shown if shot.waits]


def test_without_an_analysis_a_shot_is_finished_when_it_is_recorded_and_the_newest_sixteen_are_shown() -> None:
    shots = CapturedShots(None, print, count(1))
    for number in range(1, 19):
        early = "the stream ended" if number == 18 else None
        assert shots.recorded(_recorded(f"s{number}", early=early)) is None
    assert shots.taken == 18 and _waiting(shots) == [] and shots.unsaved == ()
    assert [(shot.number, shot.name) for shot in shots.shown] == [(n, f"s{n}") for n in range(3, 19)]
    path = Path("/data/s18.sigmf-meta")
    assert shots.shown[-1] == CapturedShot(18, "s18", path, SETTINGS, None, "the stream ended")
    assert shots.shown[0].problem is None


def test_an_analysed_shot_comes_with_its_readings_then_under_the_same_number_with_its_fit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(snapshot, "fit_pending", lambda shot: shot.endswith("?"))
    shots = CapturedShots(None, print, count(1))
    shots.analysis = analysis = Analysis(3)  # type: ignore[assignment]
    numbers = [
        shots.recorded(_recorded("a")),
        shots.recorded(_recorded("b", problem="the disk is full")),
        shots.recorded(_recorded("c", early="given up", aborted=True)),  # given up: nobody waits for its readings
        shots.recorded(_recorded("d", early="aborted")),
        shots.recorded(_recorded("e", filled=0)),
        shots.recorded(_recorded("f")),
    ]
    assert numbers == [1, 2, None, 4, None, None]
    assert analysis.given == [(1, "a"), (2, "b"), (4, "d"), (6, "f")]
    assert [shot for shot in shots.shown if shot.waits] == [
        CapturedShot(1, "a", Path("/data/a.sigmf-meta"), SETTINGS, waits=True),
        CapturedShot(2, "b", None, SETTINGS, problem="the disk is full", waits=True),
        CapturedShot(4, "d", Path("/data/d.sigmf-meta"), SETTINGS, waits=True),
    ]
    results: list[tuple[int, Any, str | None]] = [(4, "d?", None), (1, "a!", None), (2, None, "dim"), (4, "d!", None)]
    for number, shot, problem in results:
        shots.analysed(number, shot, problem)
    shots.analysed(4, "never", None)  # type: ignore[arg-type] - known already
    shots.analysed(7, "never", None)  # type: ignore[arg-type] - unknown
    assert [(shot.number, shot.name, shot.shot, shot.problem) for shot in shots.shown] == [
        (3, "c", None, "given up"),
        (5, "e", None, None),
        (6, "f", None, "not analysed: too many shots are waiting"),
        (1, "a", "a!", None),
        (2, "b", None, "the disk is full; dim"),
        (4, "d", "d!", None),
    ]
    assert _waiting(shots) == [] and shots.unsaved == ("b",)


def test_a_shot_that_waits_longer_than_sixteen_others_is_still_shown() -> None:
    shots = CapturedShots(None, print, count(100))
    shots.analysis = Analysis(1)  # type: ignore[assignment]
    for number in range(20):
        shots.recorded(_recorded(f"s{number}"))
    assert _waiting(shots) == [100] and len(shots.shown) == 17
    shots.analysed(100, None, "dim")
    assert [shot.number for shot in shots.shown] == [*range(105, 120), 100]


def test_shots_in_memory_are_saved_in_their_order_and_the_first_that_fails_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shots = CapturedShots(None, print, count(1))
    for name in ("a", "b", "c"):
        shots.recorded(_recorded(name, problem="full"))
    real = captured_shots.save_elsewhere

    def full(recording: Recording, folder: Path) -> Path:
        if recording.name == "b":
            raise RecordingError(folder, "still full")
        return real(recording, folder)

    GONE.clear()
    monkeypatch.setattr(captured_shots, "save_elsewhere", full)
    with pytest.raises(SomeShotsNotSaved, match="still full") as partly:
        shots.save_pending(tmp_path)
    assert partly.value.saved == {"a": tmp_path / "a.sigmf-meta"} and shots.unsaved == ("b", "c")
    assert GONE == ["a"]  # of what was begun on the full disk
    monkeypatch.setattr(captured_shots, "save_elsewhere", real)
    assert shots.save_pending(tmp_path) == [tmp_path / "b.sigmf-meta", tmp_path / "c.sigmf-meta"]
    assert shots.unsaved == () and shots.save_pending(tmp_path) == []
    assert read_recording(tmp_path / "c").counts[:, 0].tolist() == list(range(100))


def test_a_shot_is_saved_under_the_next_free_name(tmp_path: Path) -> None:
    for name in ("shot-0007.sigmf-meta", "shot-12.csv", "ashot-99.x", "shot-1234567890.x", "shot-x.y", "shot-40"):
        (tmp_path / name).touch()
    assert _highest_number(tmp_path) == 12 and _highest_number(tmp_path / "none") == 0
    saver, shot = Recorder(print), _recorded("a").shot
    first = saver._open(shot, tmp_path)
    (tmp_path / "shot-0014.sigmf-meta").touch()  # somebody else's, meanwhile
    second = saver._open(shot, tmp_path)
    assert [writer.stem.name for writer in (first, second)] == ["shot-0013", "shot-0015"]
    assert saver._name_without_file(tmp_path) == "shot-0015"
    assert saver._name_without_file(tmp_path / "other") == "shot-unsaved-1"
    for writer in (first, second):
        writer.abandon()
    recording = shot.recording("shot-0013")
    names = [save_elsewhere(recording, tmp_path).name for _ in range(3)]
    assert names == [f"shot-0013{more}.sigmf-meta" for more in ("", "-2", "-3")]


def test_without_a_free_name_it_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder, "_MAX_NAMES", 2)
    shot = _recorded("a").shot
    save_elsewhere(shot.recording("a"), tmp_path)
    with pytest.raises(RecordingError, match="no free name a-N"):
        save_elsewhere(shot.recording("a"), tmp_path)
    for number in (1, 2):
        (tmp_path / f"shot-{number:04d}.sigmf-meta").touch()
    monkeypatch.setattr(recorder, "_highest_number", lambda folder: 0)
    with pytest.raises(RecordingError, match="no free name shot-N"):
        Recorder(print)._open(shot, tmp_path)
