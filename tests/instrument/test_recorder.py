"""A shot while it comes in: who brings it to disk is woken by every block and by the end."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Channel, Gap, Role, Setup
from instrument.capture.recorder import GrowingShot, Recorder
from instrument.devices.digitizer import CaptureSettings
from instrument.files import recording_writer
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import read_recording
from instrument.files.recording_writer import RecordingWriter


@pytest.fixture
def shot() -> GrowingShot:
    settings = CaptureSettings(1e6, 100, 20)
    channels = (Channel(Role.SWITCH, 1e-3), Channel(Role.MEASUREMENT, 1e-3))
    counts = np.zeros((100, 2), np.int16)
    return GrowingShot(settings, channels, Setup(17.85e-3), "bench", "2026-01-01T00:00:00Z", 20, counts)


def _woken(shot: GrowingShot) -> bool:
    seen = shot.grown.is_set()
    shot.grown.clear()
    return seen


def test_every_block_and_the_end_wake_the_writer_and_a_loss_does_not(shot: GrowingShot) -> None:
    assert not _woken(shot)
    shot.append(np.ones((30, 2), np.int16))
    assert _woken(shot)
    shot.lost(5)
    assert not _woken(shot)
    shot.append(np.ones((30, 2), np.int16))
    assert _woken(shot) and not shot.complete
    shot.finish("the cable was pulled")
    assert _woken(shot) and shot.complete
    (gap,) = shot.gaps
    assert (gap.sample_start, gap.samples_lost) == (30, 5)


def test_no_more_is_taken_than_was_asked_for(shot: GrowingShot) -> None:
    shot.append(np.full((70, 2), 7, np.int16))
    shot.append(np.full((70, 2), 9, np.int16))
    assert (shot.filled, shot.room) == (100, 0)
    assert shot.counts[[0, 69, 70, 99], 0].tolist() == [7, 7, 9, 9]


@pytest.mark.parametrize(("filled", "short"), [(91, True), (92, False)])
def test_a_shot_that_lacks_more_than_a_tenth_after_its_trigger_is_cut_short(
    shot: GrowingShot, filled: int, short: bool
) -> None:
    """Of the 80 samples after the trigger, 72 are enough."""
    shot.append(np.zeros((filled, 2), np.int16))
    shot.finish("the operator had enough", aborted=True)
    assert shot.ended_early == ("the operator had enough" if short else None) and shot.aborted is short
    assert ("cut_short" in shot.recording("a").flags) == short


def test_a_recorder_saves_what_is_queued_before_it_ends_and_counts_what_it_saved(tmp_path: Path) -> None:
    channels, counts = (Channel(Role.MEASUREMENT, 1e-3),), np.zeros((100, 1), np.int16)
    shots = [GrowingShot(CaptureSettings(1e6, 100, 20), channels, Setup(0.01), "", "", 20, counts) for _ in range(2)]
    done: list[str] = []
    recorder = Recorder(lambda recorded: time.sleep(0.05) or done.append(recorded.recording.name))
    assert recorder.close(0.0)  # it was not started
    recorder = Recorder(lambda recorded: time.sleep(0.05) or done.append(recorded.recording.name))
    for shot in shots:
        shot.append(counts[:1])
        shot.lost(3)
        shot.append(counts[1:])
        shot.finish()
        assert [(gap.sample_start, gap.samples_lost) for gap in shot.gaps] == [(1, 3)]
        recorder.begin(shot, tmp_path)
    assert recorder._name_without_file(tmp_path / "none") == "shot-unsaved-1"
    recorder.start()
    assert recorder.close(20.0) and done == ["shot-0001", "shot-0002"]
    assert recorder._name_without_file(tmp_path / "none") == "shot-unsaved-3"


def test_a_loss_before_the_first_sample_is_no_gap_of_the_shot(shot: GrowingShot) -> None:
    shot.lost(3)
    shot.append(np.zeros((100, 2), np.int16))
    shot.finish()
    assert shot.gaps == [] and shot.ended_early is None and shot.recording("a").flags == ()


def test_the_levels_about_a_step_are_measured_over_50_us_at_least_32_samples() -> None:
    """The middle of a slow step; an earlier pulse, beyond twice that reach, does not count."""
    for rate, reach in ((1e6, 50), (1e5, 32)):
        settings = CaptureSettings(rate, 1000, 200)
        counts = np.zeros((1000, 1), np.int16)
        counts[500:, 0] = 1000
        counts[480:520, 0] = np.linspace(0, 1000, 40)
        counts[200 : 484 - 2 * reach, 0] = 2000
        shot = GrowingShot(settings, (Channel(Role.SWITCH, 1e-3),), Setup(0.01), "bench", "", 485, counts, filled=1000)
        shot.finish()
        assert shot.trigger_sample == pytest.approx(500, abs=1), rate


def test_a_shot_tells_of_its_capture_only_what_there_is_to_tell(shot: GrowingShot) -> None:
    capture = {"source": "bench", "samples": 100, "pre_trigger_samples": 20}
    assert shot.extra == {"global": {"lmm:capture": capture}} and shot.recording("a").flags == ()
    shot.unseen_loss_s, shot.doubtful_rate_hz = 2e-3, 9e5
    shot.append(np.zeros((10, 2), np.int16))
    shot.lost(None)
    shot.append(np.zeros((5, 2), np.int16))
    shot.finish("pulled")
    own = {
        "lmm:capture": capture | {"unseen_loss_s": 2e-3},
        "lmm:delivered_rate_hz": 9e5,
        "lmm:ended_early": "pulled",
    }
    assert shot.extra == {"global": own}
    recording = shot.recording("b")
    assert recording.flags == ("gap", "cut_short", "rate_contradicted") and recording.trigger_sample is None
    assert (recording.samples, recording.name, recording.extra) == (15, "b", shot.extra)
    assert not recording.counts.flags.writeable


class Growing:
    """Stands for the event that wakes the writer: at each wait the next of ``steps`` happens to the shot."""

    def __init__(self, *steps: Callable[[], object]) -> None:
        self.steps, self.waits, self.clears = list(steps), [], 0

    def wait(self, longest_s: float) -> None:
        self.waits.append(longest_s)
        assert self.clears == len(self.waits) - 1  # else it would not wait at all
        self.steps.pop(0)()

    def clear(self) -> None:
        self.clears += 1

    def set(self) -> None:
        pass


def test_what_came_is_on_disk_before_the_shot_is_whole_and_its_gaps_trigger_and_end_with_it(
    shot: GrowingShot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_writer, "_REFRESH_S", -1.0)  # with every block, not four times a second
    on_disk: list[tuple[int, int | None]] = []

    def look() -> None:
        found = read_recording(tmp_path / "shot-0001")
        assert shot.written == shot.filled == found.samples and np.array_equal(found.counts, shot.counts[: shot.filled])
        on_disk.append((found.samples, found.trigger_sample))
        assert found.extra["global"]["lmm:capture"]["samples"] == 100 and found.started_at == shot.started_at

    def more() -> None:
        look()
        shot.lost(5)
        shot.append(np.full((20, 2), 7, np.int16))

    def end() -> None:
        look()
        shot.append(np.full((3, 2), 8, np.int16))
        shot.trigger_sample = 21
        shot.finish("the cable was pulled")

    shot.append(np.full((40, 2), 6, np.int16))
    shot.grown = growing = Growing(more, look, end)  # type: ignore[assignment]
    saved = Recorder(print)._save(shot, tmp_path)
    assert growing.waits == [0.02] * 3 and growing.steps == []
    assert on_disk == [(40, 20), (60, 20), (60, 20)]
    assert saved.problem is None and saved.partial is None and saved.shot is shot
    assert saved.recording.path == str(tmp_path / "shot-0001.sigmf-meta") and saved.recording.samples == 63
    assert saved.recording.trigger_sample == 21 and saved.recording.gaps == (Gap(40, 5),)
    assert saved.recording.flags == ("gap", "cut_short") and saved.recording.extra["global"] == shot.extra["global"]


def test_a_shot_that_cannot_be_saved_is_waited_for_and_kept_with_why(
    shot: GrowingShot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(error: Exception) -> Callable[[RecordingWriter, np.ndarray], None]:
        def append(writer: RecordingWriter, counts: np.ndarray) -> None:
            raise error

        return append

    shot.append(np.full((40, 2), 6, np.int16))
    for number, (error, why) in enumerate(
        ((RecordingError("a", "full"), "a: full"), (ValueError("odd"), "unexpected: ValueError('odd')")), 1
    ):
        monkeypatch.setattr(RecordingWriter, "append", failing(error))
        shot.complete = False
        shot.grown = growing = Growing(lambda: None, shot.finish)  # type: ignore[assignment]
        kept = Recorder(print)._save(shot, tmp_path)
        assert kept.problem == why and growing.waits == [0.02] * 2 and growing.clears == 2
        assert kept.recording.name == f"shot-{number:04d}" and kept.recording.samples == 40
        assert kept.partial is not None and kept.partial._file.closed  # what was begun stays until it is saved
        assert kept.partial.data_path.exists()
