"""Recording shots without a screen: each saved and reported once, and one line that says why it ended."""

import threading
from pathlib import Path

import pytest

from analysis.shot.recording import Setup
from instrument.capture import capture as module
from instrument.capture.capture import RESCUED, AcquireError, acquire
from instrument.devices.digitizer import Block, DigitizerError
from instrument.files.recording_file import read_recording
from tests.instrument.capturing import SETTINGS, assert_true_samples
from tests.instrument.fake_digitizer import CHANNELS, FIRST, FakeDigitizer
from tests.instrument.test_capture_disk import FullDisk


def test_each_shot_is_saved_and_reported_once_in_its_turn(tmp_path: Path) -> None:
    digitizer, told = FakeDigitizer(), []  # type: ignore[var-annotated]
    out = tmp_path / "new" / "folder"
    saved = acquire(digitizer, out, 3, SETTINGS, 20.0, told.append, setup=Setup(0.5))
    assert saved == [out / f"shot-{n:04d}.sigmf-meta" for n in (1, 2, 3)]
    assert told == [f"shot {n} of 3: {path}" for n, path in enumerate(saved, 1)] and digitizer.closed
    shots = [read_recording(path) for path in saved]
    firsts = [assert_true_samples(shot) for shot in shots]
    assert firsts == sorted(set(firsts)) and [shot.setup.moving_mass_kg for shot in shots] == [0.5] * 3
    again = acquire(FakeDigitizer(), out, 1, SETTINGS, 20.0)
    assert again == [out / "shot-0004.sigmf-meta"]  # the folder may be there, and nothing is overwritten


def test_a_trigger_that_does_not_come_in_time_and_a_device_that_fails_are_one_line_with_what_was_saved(
    tmp_path: Path,
) -> None:
    def too_late(fake: FakeDigitizer, at: int) -> Block | None:
        if at > 10_000_000:
            raise DigitizerError("nobody gave up")
        return None

    still = FakeDigitizer(channels=CHANNELS[:2], pace_s=0.002, before_block=too_late)
    with pytest.raises(AcquireError) as late:
        acquire(still, tmp_path, 1, SETTINGS, 0.3)
    assert str(late.value).startswith("the light switch did not fire in time (0.3 s): check its beam")
    assert late.value.saved == [] and still.closed

    told: list[str] = []

    def unplugged(fake: FakeDigitizer, at: int) -> Block | None:
        if told:  # of the first shot
            raise DigitizerError("unplugged", "plug it in")
        return None

    with pytest.raises(AcquireError, match=r"^unplugged: plug it in$") as lost:
        acquire(FakeDigitizer(before_block=unplugged), tmp_path, 2, SETTINGS, 20.0, told.append)
    assert lost.value.saved == [tmp_path / "shot-0001.sigmf-meta"]
    (tmp_path / "file").write_text("")
    closed = FakeDigitizer()
    with pytest.raises(AcquireError, match="file/folder: Not a directory"):
        acquire(closed, tmp_path / "file" / "folder", 1, SETTINGS, 20.0)
    assert closed.closed and closed.armed == 0


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize(("at", "flags"), [(40_000, ("cut_short",)), (50_000, ())])  # within the shot, just after it
def test_the_shot_under_way_when_a_device_fails_is_among_those_saved(
    at: int, flags: tuple[str, ...], full: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    armed, arm = threading.Event(), module.Capture.arm

    def arms(capture: module.Capture, *, automatic: bool = False) -> None:
        arm(capture, automatic=automatic)
        armed.set()

    def unplugged(fake: FakeDigitizer, now: int) -> Block | None:
        if now >= at:
            raise DigitizerError("unplugged", "plug it in")
        # on a busy machine the light switch would fire, and the device fail, before anyone has armed
        return Block(0) if now >= FIRST - 10_000 and not armed.is_set() else None

    monkeypatch.setattr(module.Capture, "arm", arms)
    monkeypatch.setattr(module, "_LOOK_S", 0.1)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    if full:
        monkeypatch.setattr("instrument.capture.recorder.RecordingWriter", FullDisk)
    with pytest.raises(AcquireError, match=r"the shot was saved to" if full else r"^unplugged: plug it in$") as failed:
        acquire(FakeDigitizer(before_block=unplugged), tmp_path / "out", 2, SETTINGS, 20.0)
    there = list((tmp_path / RESCUED if full else tmp_path / "out").glob("*.sigmf-meta"))
    assert len(there) == 1 and failed.value.saved == ([] if full else there)
    assert read_recording(there[0]).flags == flags


def test_a_rescued_shot_lies_in_the_home_folder_closed_to_others_else_with_the_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("instrument.capture.recorder.RecordingWriter", FullDisk)
    places = {name: tmp_path / name for name in ("home", "temporary")}
    monkeypatch.setattr(module.tempfile, "gettempdir", lambda: str(places["temporary"]))
    for place in places.values():
        place.mkdir()
    for home, used in ((places["home"], "home"), (tmp_path / "none", "temporary")):
        monkeypatch.setattr(Path, "home", lambda home=home: home)
        with pytest.raises(AcquireError, match=f"the shot was saved to {places[used]}.* instead; make room, then go"):
            acquire(FakeDigitizer(), tmp_path / "out", 1, SETTINGS, 20.0)
        rescued = places[used] / RESCUED
        assert len(list(rescued.glob("*.sigmf-meta"))) == 1 and rescued.stat().st_mode & 0o777 == 0o700
    with pytest.raises(AcquireError, match=f"the shot was saved to {rescued}"):
        acquire(FakeDigitizer(), tmp_path / "out", 1, SETTINGS, 20.0)
    assert len(list(rescued.glob("*.sigmf-meta"))) == 2  # beside the one before
