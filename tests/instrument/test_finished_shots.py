"""Shots after their capture: numbered, the newest shown, those only in memory kept until they are saved."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.shot.recording import Channel, Recording, Role, Setup
from instrument.capture import finished_shots, recorder
from instrument.capture.finished_shots import ABORTED, FinishedShots
from instrument.capture.recorder import GrowingShot, Recorded, Recorder, _highest_number, save_elsewhere
from instrument.capture.snapshot import FinishedShot, WaitingShot
from instrument.devices.digitizer import CaptureSettings
from instrument.files.recording_error import RecordingError, SomeShotsNotSaved
from instrument.files.recording_file import read_recording

SETTINGS = CaptureSettings(1e6, 100, 20)
CHANNELS = (Channel(Role.MEASUREMENT, 1e-3),)


def _recorded(name: str, problem: str | None = None, early: str | None = None, filled: int = 100) -> Recorded:
    counts = np.arange(100, dtype=np.int16)[:, None]
    shot = GrowingShot(SETTINGS, CHANNELS, Setup(17.85e-3), "bench", "2026-01-01T00:00:00Z", 20, counts)
    shot.filled, shot.ended_early = filled, early
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


def test_without_an_analysis_a_shot_is_finished_when_it_is_recorded_and_the_newest_sixteen_are_shown() -> None:
    finished = FinishedShots(None, print)
    for number in range(1, 19):
        early = "the stream ended" if number == 18 else None
        assert finished.recorded(_recorded(f"s{number}", early=early)) is None
    assert finished.taken == 18 and finished.waiting == finished.unsaved == ()
    assert [(shot.index, shot.name) for shot in finished.newest] == [(n, f"s{n}") for n in range(3, 19)]
    path = Path("/data/s18.sigmf-meta")
    assert finished.newest[-1] == FinishedShot(18, "s18", path, SETTINGS, None, "the stream ended")
    assert finished.newest[0].problem is None and not finished.newest[0].fitted_later


def test_an_analysed_shot_comes_with_its_readings_then_under_the_same_index_with_its_fit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(finished_shots, "fit_pending", lambda shot: shot.endswith("?"))
    finished = FinishedShots(None, print)
    finished.analysis = analysis = Analysis(3)  # type: ignore[assignment]
    numbers = [
        finished.recorded(_recorded("a")),
        finished.recorded(_recorded("b", problem="the disk is full")),
        finished.recorded(_recorded("c", early=ABORTED)),  # given up: nobody waits for its readings
        finished.recorded(_recorded("d", early="the stream ended")),
        finished.recorded(_recorded("e", filled=0)),
        finished.recorded(_recorded("f")),
    ]
    assert numbers == [1, 2, None, 4, None, None]
    assert analysis.given == [(1, "a"), (2, "b"), (4, "d"), (6, "f")]
    assert finished.waiting == (
        WaitingShot(1, "a", Path("/data/a.sigmf-meta")),
        WaitingShot(2, "b", None),
        WaitingShot(4, "d", Path("/data/d.sigmf-meta")),
    )
    results: list[tuple[int, Any, str | None]] = [(4, "d?", None), (1, "a!", None), (2, None, "dim"), (4, "d!", None)]
    for number, shot, problem in results:
        finished.analysed(number, shot, problem)
    finished.analysed(4, "never", None)  # known already
    assert [(shot.index, shot.name, shot.shot, shot.problem) for shot in finished.newest] == [
        (1, "c", None, ABORTED),
        (2, "e", None, None),
        (3, "f", None, "not analysed: too many shots are waiting"),
        (4, "d", "d!", None),
        (5, "a", "a!", None),
        (6, "b", None, "the disk is full; dim"),
    ]
    assert finished.waiting == () and finished.unsaved == ("b",)


def test_shots_in_memory_are_saved_in_their_order_and_the_first_that_fails_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finished = FinishedShots(None, print)
    for name in ("a", "b", "c"):
        finished.recorded(_recorded(name, problem="full"))
    real = finished_shots.save_elsewhere

    def full(recording: Recording, folder: Path) -> Path:
        if recording.name == "b":
            raise RecordingError(folder, "still full")
        return real(recording, folder)

    GONE.clear()
    monkeypatch.setattr(finished_shots, "save_elsewhere", full)
    with pytest.raises(SomeShotsNotSaved, match="still full") as partly:
        finished.save_pending(tmp_path)
    assert partly.value.saved == {"a": tmp_path / "a.sigmf-meta"} and finished.unsaved == ("b", "c")
    assert GONE == ["a"]  # of what was begun on the full disk
    monkeypatch.setattr(finished_shots, "save_elsewhere", real)
    assert finished.save_pending(tmp_path) == [tmp_path / "b.sigmf-meta", tmp_path / "c.sigmf-meta"]
    assert finished.unsaved == () and finished.save_pending(tmp_path) == []
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
