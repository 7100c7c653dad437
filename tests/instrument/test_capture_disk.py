"""Disks that are full, folders that are gone or locked: reported, and no shot is lost."""

import builtins
from pathlib import Path

import numpy as np
import pytest

from instrument.capture.acquisition import State
from instrument.capture.analysis_thread import ShotAnalysis
from instrument.capture.capture import Capture
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import CaptureSettings
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import data_hash, read_recording
from instrument.files.recording_writer import RecordingWriter
from tests.instrument.capturing import SETTINGS, Capturing, analysed, assert_true_samples, until
from tests.instrument.fake_digitizer import RATE_HZ, FakeDigitizer


class FullDisk(RecordingWriter):
    """A writer whose disk is full after 5,000 samples."""

    def append(self, counts: np.ndarray) -> None:
        if self.samples > 5_000:
            raise RecordingError(self.data_path, "No space left on device")
        super().append(counts[: 5_001 - self.samples])
        if self.samples > 5_000:
            raise RecordingError(self.data_path, "No space left on device")


def test_a_full_disk_keeps_the_shot_in_memory_savable_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("instrument.capture.recorder.RecordingWriter", FullDisk)
    there, elsewhere = tmp_path / "a", tmp_path / "b"
    there.mkdir()
    elsewhere.mkdir()
    with Capturing(there, analysis=ShotAnalysis(analysed), live=False) as rig:
        rig.capture.arm(automatic=True)
        fault = until(rig.capture, lambda s: s.state is State.FAULT and bool(s.finished))
        assert "No space left" in fault.message and "memory" in fault.remedy and fault.unsaved == ("shot-0001",)
        assert fault.save_failed
        assert fault.finished[0].shot is not None and fault.finished[0].path is None
        assert "interrupted" in read_recording(there / "shot-0001").flags
        with pytest.raises(RecordingError, match="does not exist"):
            rig.capture.save_pending(tmp_path / "none")
        assert rig.capture.latest().unsaved == ("shot-0001",)
        (saved,) = rig.capture.save_pending(elsewhere)
        assert data_hash(saved).agrees and rig.capture.latest().unsaved == ()
        assert_true_samples(read_recording(saved))
        assert not list(there.glob("*.sigmf-*"))  # the part that the full disk took is no longer needed
        for _ in range(4):
            shots = rig.capture.latest().shots
            rig.capture.arm()
            until(rig.capture, lambda s, n=shots: s.shots > n)  # type: ignore[misc]
        rig.capture.arm()
        assert "only in memory" in until(rig.capture, lambda s: "only" in s.message).message
        assert len(rig.capture.save_pending(elsewhere)) == 4
        assert len(list(elsewhere.glob("*.sigmf-meta"))) == 5


def test_a_full_disk_is_said_on_standard_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("instrument.capture.recorder.RecordingWriter", FullDisk)
    with Capture(FakeDigitizer(), CaptureOptions(tmp_path, SETTINGS), live=False) as capture:
        capture.arm()
        until(capture, lambda s: s.state is State.FAULT)
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("levimass: ") and "No space left on device" in line and "save it to another folder" in line


class NoFolder(RecordingWriter):
    """A folder that is gone by the time the shot is to be written."""

    def __init__(self, stem: Path, *_: object, **__: object) -> None:
        raise RecordingError(stem, "the folder does not exist")


def test_shots_that_no_file_could_be_opened_for_are_all_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("instrument.capture.recorder.RecordingWriter", NoFolder)
    there, elsewhere = tmp_path / "a", tmp_path / "b"
    for folder in (there, elsewhere):
        folder.mkdir()
    with Capturing(there, analysis=ShotAnalysis(analysed), live=False) as rig:
        for wanted in (1, 2):
            rig.capture.arm()
            until(rig.capture, lambda s, n=wanted: len(s.unsaved) == n)  # type: ignore[misc]
        assert len(rig.capture.save_pending(elsewhere)) == 2
        assert len(list(elsewhere.glob("*.sigmf-meta"))) == 2


def test_a_folder_removed_or_missing_is_said(tmp_path: Path) -> None:
    folder = tmp_path / "shots"
    with Capturing(folder, live=False) as rig:
        rig.capture.arm()
        fault = until(rig.capture, lambda s: s.state is State.FAULT)
        assert "does not exist" in fault.message and fault.signal.folder_problem
        folder.mkdir()
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == 1 and s.state is State.IDLE)
        for entry in folder.iterdir():
            entry.unlink()
        folder.rmdir()
        rig.capture.arm()
        assert "does not exist" in until(rig.capture, lambda s: s.state is State.FAULT).message
        rig.capture.set_options(CaptureOptions(tmp_path, SETTINGS))
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == 2)
    assert any("does not exist" in line for line in rig.said)


def test_a_folder_that_cannot_be_written_to_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.open

    def read_only(name: object, mode: str = "r", *more: object, **how: object) -> object:
        if str(name).startswith(str(tmp_path)) and mode[0] in "awx":
            raise OSError(30, "Read-only file system")
        return real(name, mode, *more, **how)  # type: ignore[call-overload]

    with Capturing(tmp_path, live=False) as rig:
        monkeypatch.setattr(builtins, "open", read_only)
        rig.capture.arm()
        fault = until(rig.capture, lambda s: s.state is State.FAULT)
        assert "cannot be written to (Read-only file system)" in fault.message and "another folder" in fault.remedy
        monkeypatch.undo()
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == 1)
    assert data_hash(tmp_path / "shot-0001").agrees


def test_a_second_instance_is_refused_politely(tmp_path: Path) -> None:
    with Capturing(tmp_path, live=False) as first, Capturing(tmp_path, live=False) as second:
        first.capture.arm()
        until(first.capture, lambda s: s.shots == 1)
        second.capture.arm()
        assert "another Levimass" in until(second.capture, lambda s: s.state is State.FAULT).message
    with Capturing(tmp_path, live=False) as third:
        third.capture.arm()
        until(third.capture, lambda s: s.shots == 1)
        assert (tmp_path / "shot-0002.sigmf-meta").exists()  # the first one's is not overwritten


@pytest.mark.parametrize("short", [0, 1])
def test_room_for_the_shot_and_64_mib_more_is_asked_for_before_it(
    short: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = 6_000_000 + 64 * 2**20 - short
    monkeypatch.setattr("instrument.capture.capture_thread.disk_free_bytes", lambda folder: free)
    options = CaptureOptions(tmp_path, CaptureSettings(RATE_HZ, 1_000_000, 1_000))
    with Capturing(tmp_path, live=False, options=options) as rig:
        rig.capture.arm()
        now = until(rig.capture, lambda s: s.state is (State.FAULT if short else State.TRIGGERED))
        if short:
            reserve = "a shot takes 6 MB, and a disk reserve is required"
            assert now.message == now.signal.folder_problem == f"{tmp_path}: only 73 MB free, {reserve}"
