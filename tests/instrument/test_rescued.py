"""A disk that fills during a capture without a screen: shots in memory are saved where there is room."""

from pathlib import Path

import pytest

from instrument.capture import capture as module
from instrument.capture.capture import RESCUED, AcquireError, acquire
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import data_hash, read_recording
from instrument.files.recording_writer import RecordingWriter
from tests.instrument.capturing import SETTINGS, assert_true_samples
from tests.instrument.fake_digitizer import FakeDigitizer
from tests.instrument.test_capture_disk import FullDisk


def test_a_shot_that_the_disk_does_not_take_is_saved_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("instrument.capture.recorder.RecordingWriter", FullDisk)
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setattr(Path, "home", lambda: home)
    with pytest.raises(AcquireError) as caught:
        acquire(FakeDigitizer(), tmp_path / "out", 3, SETTINGS, timeout_s=20.0)
    (saved,) = (home / RESCUED).glob("*.sigmf-meta")
    assert str(saved) in str(caught.value) and "No space left" in str(caught.value) and "\n" not in str(caught.value)
    assert data_hash(saved).agrees
    assert_true_samples(read_recording(saved))
    assert not list((tmp_path / "out").glob("*.sigmf-*"))


def test_a_second_shot_is_saved_beside_the_first_that_was_rescued(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder in the home exists by then; the shot is neither lost, nor put elsewhere, nor over the other."""
    monkeypatch.setattr("instrument.capture.recorder.RecordingWriter", FullDisk)
    home, temporary = tmp_path / "home", tmp_path / "temporary"
    for place in (home, temporary):
        place.mkdir()
    monkeypatch.setattr(Path, "home", lambda: home)
    monkeypatch.setattr(module.tempfile, "gettempdir", lambda: str(temporary))
    for shots in (1, 2):
        with pytest.raises(AcquireError, match="was saved to"):
            acquire(FakeDigitizer(), tmp_path / "out", 1, SETTINGS, timeout_s=20.0)
        saved = list((home / RESCUED).glob("*.sigmf-meta"))
        assert len(saved) == shots and all(data_hash(path).agrees for path in saved)
    assert not list(temporary.iterdir())


def test_where_no_place_has_room_it_is_said_to_be_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(RecordingWriter):
        def append(self, counts: object) -> None:
            raise RecordingError(self.data_path, "No space left on device")

    for place in ("instrument.capture.recorder.RecordingWriter", "instrument.files.recording_writer.RecordingWriter"):
        monkeypatch.setattr(place, Full)
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "none")
    monkeypatch.setattr(module.tempfile, "gettempdir", lambda: str(tmp_path))
    with pytest.raises(AcquireError, match="shot-0001 is lost: there is no room"):
        acquire(FakeDigitizer(), tmp_path / "out", 1, SETTINGS, timeout_s=20.0)
