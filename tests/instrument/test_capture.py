"""Taking shots end to end with a digitizer whose every sample is known."""

import builtins
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.recording import Recording, Setup
from analysis.shot import AnalysisError, AnalysisSettings, Cancelled, Shot
from instrument.acquisition import Deadlines, State
from instrument.capture import Capture, CaptureOptions
from instrument.digitizer import Block, CaptureSettings, DigitizerError
from instrument.recording_file import RecordingError, RecordingWriter, read_recording, verify
from instrument.snapshot import Snapshot
from instrument.trigger import Level
from tests.instrument.fake_digitizer import CHANNELS, FIRST, HIGH, PERIOD, RATE_HZ, FakeDigitizer, samples

SETTINGS = CaptureSettings(RATE_HZ, 20_000, 4_000)


def until(capture: Capture, true: Callable[[Snapshot], bool], longest_s: float = 20.0) -> Snapshot:
    """Return the first snapshot of which ``true`` holds."""
    end = time.monotonic() + longest_s
    while not true(now := capture.latest()):
        assert time.monotonic() < end, now
        time.sleep(0.002)
    return now


def analysed(recording: Recording, progress: Callable[[str, float], None], cancelled: Callable[[], bool]) -> Shot:
    progress("looking", 0.5)
    return Shot(
        recording.name, recording.path, AnalysisSettings(), recording.setup, recording.sample_rate_hz,
        recording.samples, recording.trigger_time_s, None, None, None,
    )  # fmt: skip


class Rig:
    """A capture in a folder, with what it said."""

    def __init__(self, folder: Path, digitizer: FakeDigitizer | None = None, **how: object) -> None:
        self.digitizer = digitizer or FakeDigitizer()
        self.said: list[str] = []
        options = how.pop("options", CaptureOptions(folder, SETTINGS))
        self.capture = Capture(self.digitizer, options, say=self.said.append, **how)  # type: ignore[arg-type]

    def __enter__(self) -> "Rig":
        self.capture.start()
        return self

    def __exit__(self, *exception: object) -> None:
        assert self.capture.close()
        assert self.digitizer.closed


def assert_true_samples(recording: Recording) -> int:
    """Check that a recording holds the fake's samples around a step, and return the number of its first one."""
    assert recording.trigger_sample is not None
    trigger = recording.trigger_sample
    first = None
    for k in range(800):  # which of the fake's steps, up or down, it was
        at = FIRST + k // 2 * PERIOD + k % 2 * HIGH - trigger
        if at >= 0 and np.array_equal(recording.counts[: trigger + 1], samples(at, trigger + 1)):
            first = at
            break
    assert first is not None
    np.testing.assert_array_equal(recording.counts, samples(first, recording.samples))
    return first


def test_a_shot_from_arm_to_result(tmp_path: Path) -> None:
    with Rig(tmp_path, analyse=analysed) as rig:
        idle = until(rig.capture, lambda s: s.state is State.IDLE and s.signal.channels != ())
        assert idle.shots == 0 and not list(tmp_path.iterdir())
        rig.capture.arm()
        done = until(rig.capture, lambda s: bool(s.finished))
        until(rig.capture, lambda s: s.state is State.IDLE)
        shot = done.finished[0]
        assert (shot.index, shot.name, shot.problem) == (1, "shot-0001", None) and shot.shot is not None
        assert shot.path is not None and verify(shot.path)
        recording = read_recording(shot.path)
        assert (recording.samples, recording.trigger_sample) == (20_000, 4_000)
        assert_true_samples(recording)
        assert recording.extra["global"]["lmm:capture"] == {
            "source": "fake", "samples": 20_000, "pre_trigger_samples": 4_000,
        }  # fmt: skip
        assert recording.started_at is not None and recording.started_at.endswith("Z")
        assert not rig.said


def test_automatic_goes_on_and_no_sample_is_lost_to_a_slow_analysis(tmp_path: Path) -> None:
    gate = threading.Event()

    def slow(*what: object) -> Shot:
        gate.wait(20)
        return analysed(*what)  # type: ignore[arg-type]

    with Rig(tmp_path, analyse=slow, queue_length=3, live=False) as rig:
        rig.capture.arm(automatic=True)
        piled = until(rig.capture, lambda s: s.shots >= 7)
        assert piled.automatic and piled.analysing == 4  # one under way, three waiting
        assert all("too many" in (s.problem or "") and s.path for s in piled.finished)
        gate.set()
        until(rig.capture, lambda s: s.shots >= 10 and s.analysing == 0)
        rig.capture.abort()
        until(rig.capture, lambda s: s.state is State.IDLE)
        until(rig.capture, lambda s: s.analysing == 0)
        indices = [shot.index for shot in rig.capture.latest().finished]
        assert indices == sorted(set(indices))
    firsts = []
    for path in sorted(tmp_path.glob("*.sigmf-meta")):
        recording = read_recording(path)
        if "cut_short" not in recording.flags:
            firsts.append(assert_true_samples(recording))
            assert recording.gaps == ()
    # the stream went on: each shot begins at a later step of the same stream
    assert len(firsts) >= 9 and firsts == sorted(firsts)


def test_a_rearming_given_up_while_armed_ends_with_the_shot_under_way(tmp_path: Path) -> None:
    with Rig(tmp_path, live=False) as rig:
        rig.capture.arm(automatic=True)
        until(rig.capture, lambda s: s.shots >= 2)
        rig.capture.set_automatic(False)
        ended = until(rig.capture, lambda s: s.state is State.IDLE)
        assert ended.shots >= 2 and not ended.automatic and not ended.message
        seen = rig.digitizer.at
        until(rig.capture, lambda s: rig.digitizer.at > seen + 3 * PERIOD)  # steps pass by, and nobody waits for one
        assert rig.capture.latest().shots == ended.shots


def test_lost_samples_become_gaps_and_never_zeros(tmp_path: Path) -> None:
    gaps: dict[int, int | None] = {FIRST - 1_000: 777, FIRST + 5_000: 3_000}
    with Rig(tmp_path, FakeDigitizer(gaps=dict(gaps)), live=False) as rig:
        rig.capture.arm()
        done = until(rig.capture, lambda s: bool(s.finished))
        path = done.finished[0].path
        assert path is not None and done.signal.samples_lost == 3_777 and done.signal.losses == 2
        recording = read_recording(path)
        assert "gap" in recording.flags
        assert [g.samples_lost for g in recording.gaps] == [777, 3_000]
        trigger = recording.trigger_sample
        assert trigger == 4_000
        starts = [g.sample_start for g in recording.gaps]
        number = FIRST - (4_000 + 777)
        for a, b, lost in zip([0, *starts], [*starts, 20_000], [777, 3_000, 0], strict=True):
            np.testing.assert_array_equal(recording.counts[a:b], samples(number, b - a))
            number += b - a + lost


def test_losses_of_unknown_number_are_gaps_too(tmp_path: Path) -> None:
    with Rig(tmp_path, FakeDigitizer(gaps={FIRST + 4_000: None}), live=False) as rig:
        rig.capture.arm()
        path = until(rig.capture, lambda s: bool(s.finished)).finished[0].path
        assert path is not None and [g.samples_lost for g in read_recording(path).gaps] == [None]


@pytest.mark.parametrize("fires", [False, True])
def test_abort_while_armed_or_triggered(tmp_path: Path, fires: bool) -> None:
    hold = threading.Event()

    def slow(fake: FakeDigitizer, at: int) -> Block | None:
        if at > (FIRST + 5_000 if fires else 10_000) and not hold.is_set():
            time.sleep(0.01)
            return Block(0)
        return None

    with Rig(tmp_path, FakeDigitizer(before_block=slow), analyse=analysed, live=False) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is (State.TRIGGERED if fires else State.ARMED))
        rig.capture.abort()
        until(rig.capture, lambda s: s.state is State.IDLE)
        if fires:
            kept = until(rig.capture, lambda s: bool(s.finished)).finished[0]
            assert kept.path is not None and kept.shot is None and kept.problem == "aborted"
            recording = read_recording(kept.path)
            assert "cut_short" in recording.flags and 5_000 < recording.samples < 20_000 and verify(kept.path)
            assert_true_samples(recording)
        else:
            assert not list(tmp_path.glob("*.sigmf-*"))
        hold.set()
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == (2 if fires else 1))


def test_unplugging_keeps_what_came_and_plugging_in_recovers(tmp_path: Path) -> None:
    plugged = threading.Event()

    def unplugged(fake: FakeDigitizer, at: int) -> Block | None:
        if at > FIRST + 5_000 and not plugged.is_set():
            raise DigitizerError("the device was unplugged", "plug it in and arm again")
        return None

    with Rig(tmp_path, FakeDigitizer(before_block=unplugged), live=False) as rig:
        rig.capture.arm(automatic=True)
        fault = until(rig.capture, lambda s: s.state is State.FAULT)
        assert fault.message == "the device was unplugged" and fault.remedy == "plug it in and arm again"
        kept = until(rig.capture, lambda s: bool(s.finished)).finished[0]
        assert kept.path is not None and "cut_short" in read_recording(kept.path).flags
        assert rig.said == ["the device was unplugged: plug it in and arm again"]
        plugged.set()
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == 2)
        assert until(rig.capture, lambda s: s.state is State.IDLE).message == ""


@pytest.mark.parametrize(
    "nonsense",
    [Block(10**9), Block(-1), Block(5, lost_before=-3), Block(5, trigger_sample=77), ZeroDivisionError("bug"), None],
)
def test_a_digitizer_that_sends_nonsense_is_a_fault(tmp_path: Path, nonsense: object) -> None:
    def wrong(fake: FakeDigitizer, at: int) -> Block | None:
        if at < 10_000:
            return None
        if isinstance(nonsense, Exception):
            raise nonsense
        return nonsense if isinstance(nonsense, Block) else Block("x")  # type: ignore[arg-type]

    with Rig(tmp_path, FakeDigitizer(before_block=wrong), live=False) as rig:
        rig.capture.arm()
        fault = until(rig.capture, lambda s: s.state is State.FAULT)
        assert fault.message and fault.remedy and "\n" not in fault.message


def test_a_stalled_stream_and_a_driver_that_hangs_are_said(tmp_path: Path) -> None:
    now = [0.0]
    release = threading.Event()
    mode = ["stall"]

    def silent(fake: FakeDigitizer, at: int) -> Block | None:
        if at < 10_000:
            return None
        if mode[0] == "hang":
            release.wait(20)
            return None
        now[0] += 0.5
        return Block(0)

    with Rig(tmp_path, FakeDigitizer(before_block=silent), live=False, clock=lambda: now[0]) as rig:
        rig.capture.arm()
        assert "no samples" in until(rig.capture, lambda s: s.state is State.FAULT).message
        mode[0] = "hang"
        rig.capture.abort()
        rig.capture.arm()
        time.sleep(0.1)
        now[0] += 100
        assert until(rig.capture, lambda s: s.state is State.FAULT).message == "the digitizer does not answer"
        release.set()


def test_nothing_fires_is_said_after_the_deadline(tmp_path: Path) -> None:
    def flat(fake: FakeDigitizer, at: int) -> Block | None:
        fake.at = at % 20_000
        return None

    with Rig(tmp_path, FakeDigitizer(before_block=flat), live=False, deadlines=Deadlines(armed_s=0.2)) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.ARMED)
        idle = until(rig.capture, lambda s: s.state is State.IDLE)
        assert "light switch" in idle.message and idle.remedy
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.ARMED)
        rig.capture.trigger_now()
        until(rig.capture, lambda s: s.shots == 1)


def test_two_channels_without_a_switch_wait_for_the_operator(tmp_path: Path) -> None:
    with Rig(tmp_path, FakeDigitizer(channels=CHANNELS[:2], pace_s=0.002), live=False) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.ARMED)
        time.sleep(0.1)
        assert rig.capture.latest().state is State.ARMED
        rig.capture.trigger_now()
        path = until(rig.capture, lambda s: bool(s.finished)).finished[0].path
        assert path is not None and read_recording(path).counts.shape == (20_000, 2)


def test_a_scope_s_stream_is_the_shot(tmp_path: Path) -> None:
    fake = FakeDigitizer(max_samples=20_000, hardware_trigger=True, channels=CHANNELS[:2])
    with Rig(tmp_path, fake, live=False) as rig:
        rig.capture.arm()
        first = until(rig.capture, lambda s: bool(s.finished)).finished[0]
        until(rig.capture, lambda s: s.state is State.IDLE)
        assert first.path is not None
        recording = read_recording(first.path)
        assert (recording.samples, recording.trigger_sample, fake.armed) == (20_000, 4_000, 1)
        np.testing.assert_array_equal(recording.counts, samples(0, 20_000)[:, :2])
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == 2)
        assert fake.armed == 2


def test_a_stream_that_ends_unfired_is_said(tmp_path: Path) -> None:
    with Rig(tmp_path, FakeDigitizer(max_samples=20_000), live=False) as rig:
        rig.capture.arm()
        assert "ended before" in until(rig.capture, lambda s: s.state is State.FAULT).message


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
    monkeypatch.setattr("instrument.recorder.RecordingWriter", FullDisk)
    there, elsewhere = tmp_path / "a", tmp_path / "b"
    there.mkdir()
    elsewhere.mkdir()
    with Rig(there, analyse=analysed, live=False) as rig:
        rig.capture.arm(automatic=True)
        fault = until(rig.capture, lambda s: s.state is State.FAULT and bool(s.finished))
        assert "No space left" in fault.message and "memory" in fault.remedy and fault.unsaved == ("shot-0001",)
        assert fault.finished[0].shot is not None and fault.finished[0].path is None
        assert "interrupted" in read_recording(there / "shot-0001").flags
        with pytest.raises(RecordingError, match="does not exist"):
            rig.capture.save_pending(tmp_path / "none")
        assert rig.capture.latest().unsaved == ("shot-0001",)
        (saved,) = rig.capture.save_pending(elsewhere)
        assert verify(saved) and rig.capture.latest().unsaved == ()
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
    monkeypatch.setattr("instrument.recorder.RecordingWriter", FullDisk)
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
    monkeypatch.setattr("instrument.recorder.RecordingWriter", NoFolder)
    there, elsewhere = tmp_path / "a", tmp_path / "b"
    for folder in (there, elsewhere):
        folder.mkdir()
    with Rig(there, analyse=analysed, live=False) as rig:
        for wanted in (1, 2):
            rig.capture.arm()
            until(rig.capture, lambda s, n=wanted: len(s.unsaved) == n)  # type: ignore[misc]
        assert len(rig.capture.save_pending(elsewhere)) == 2
        assert len(list(elsewhere.glob("*.sigmf-meta"))) == 2


def test_a_folder_removed_or_missing_is_said(tmp_path: Path) -> None:
    folder = tmp_path / "shots"
    with Rig(folder, live=False) as rig:
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

    with Rig(tmp_path, live=False) as rig:
        monkeypatch.setattr(builtins, "open", read_only)
        rig.capture.arm()
        fault = until(rig.capture, lambda s: s.state is State.FAULT)
        assert "cannot be written to (Read-only file system)" in fault.message and "another folder" in fault.remedy
        monkeypatch.undo()
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == 1)
    assert verify(tmp_path / "shot-0001")


def test_a_second_instance_is_refused_politely(tmp_path: Path) -> None:
    with Rig(tmp_path, live=False) as first, Rig(tmp_path, live=False) as second:
        first.capture.arm()
        until(first.capture, lambda s: s.shots == 1)
        second.capture.arm()
        assert "another Levimass" in until(second.capture, lambda s: s.state is State.FAULT).message
    with Rig(tmp_path, live=False) as third:
        third.capture.arm()
        until(third.capture, lambda s: s.shots == 1)
        assert (tmp_path / "shot-0002.sigmf-meta").exists()  # the first one's is not overwritten


def test_too_little_room_is_said_before_the_shot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("instrument.capture_thread.disk_free_bytes", lambda folder: 70_000_000 - 3_000_000)
    with Rig(tmp_path, live=False) as rig:
        rig.capture.arm()
        assert "67 MB free" in until(rig.capture, lambda s: s.state is State.FAULT).message


@pytest.mark.parametrize("error", [AnalysisError("flat"), Cancelled(), RuntimeError("bug")])
def test_a_failing_analysis_costs_only_itself(tmp_path: Path, error: Exception) -> None:
    def broken(*what: object) -> Shot:
        raise error

    with Rig(tmp_path, analyse=broken, live=False) as rig:
        rig.capture.arm()
        shot = until(rig.capture, lambda s: bool(s.finished)).finished[0]
        assert shot.shot is None and shot.problem and shot.path is not None and "\n" not in shot.problem
        until(rig.capture, lambda s: s.state is State.IDLE)


def test_abort_stops_an_analysis(tmp_path: Path) -> None:
    def endless(recording: Recording, progress: object, cancelled: Callable[[], bool]) -> Shot:
        while not cancelled():
            time.sleep(0.001)
        raise Cancelled

    with Rig(tmp_path, analyse=endless, live=False) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.ANALYSING and s.doing == "analysing")
        rig.capture.abort()
        assert until(rig.capture, lambda s: bool(s.finished)).finished[0].problem == "the analysis was stopped"


def test_settings_that_no_shot_can_be_taken_with_are_refused(tmp_path: Path) -> None:
    with Rig(tmp_path, live=False) as rig:
        for wrong in (
            CaptureSettings(float("nan"), 100, 0),
            CaptureSettings(RATE_HZ, 0, 0),
            CaptureSettings(RATE_HZ, 100, 200),
            CaptureSettings(RATE_HZ, 10**12, 0),
            CaptureSettings(2e6, 100, 0),
        ):
            rig.capture.set_options(CaptureOptions(tmp_path, wrong))
            rig.capture.arm()
            assert until(rig.capture, lambda s: s.state is State.FAULT).remedy
            rig.capture.set_options(CaptureOptions(tmp_path, SETTINGS))
            rig.capture.abort()
            until(rig.capture, lambda s: s.state is State.IDLE)
        rig.capture.set_options(CaptureOptions(tmp_path, SETTINGS, switch_low_v=1.0, switch_high_v=0.5))
        rig.capture.arm()
        assert "threshold" in until(rig.capture, lambda s: s.state is State.FAULT).message


def test_thresholds_in_volts_and_the_operator_s_setup_are_used(tmp_path: Path) -> None:
    setup = Setup(0.5, rest_frequency_hz=91e3, extra={"bench": 3})
    options = CaptureOptions(tmp_path, SETTINGS, setup, switch_low_v=0.5, switch_high_v=1.5)
    with Rig(tmp_path, options=options) as rig:
        watched = until(rig.capture, lambda s: s.signal.switch_level is not Level.UNKNOWN and len(s.live.time_s) > 0)
        assert watched.live.velocity_m_per_s.shape == watched.live.time_s.shape
        rig.capture.arm()
        path = until(rig.capture, lambda s: bool(s.finished)).finished[0].path
        assert path is not None and read_recording(path).setup == replace(setup, digitizer_bits=12)


def test_the_signal_line_tells_what_the_fake_sends(tmp_path: Path) -> None:
    with Rig(tmp_path, FakeDigitizer(pace_s=0.005)) as rig:
        now = until(rig.capture, lambda s: len(s.signal.channels) == 3 and s.signal.switch_toggles >= 2)
        reference, measurement, switch = now.signal.channels
        assert reference.frequency_hz == pytest.approx(91e3, abs=5)
        assert reference.amplitude_v == pytest.approx(1.5, 0.01)
        assert measurement.snr_db is not None and measurement.snr_db > 30 and measurement.clipped_fraction == 0
        assert switch.amplitude_v in (pytest.approx(0.1), pytest.approx(1.6)) and switch.frequency_hz is None
        assert now.signal.disk_free_bytes and now.live.raw_v.shape[1] == 3 and not now.live.raw_v.flags.writeable


def test_all_threads_end_and_nothing_stays_open(tmp_path: Path) -> None:
    before = set(threading.enumerate())
    for _ in range(2):
        with Rig(tmp_path, analyse=analysed) as rig:
            rig.capture.arm(automatic=True)
            until(rig.capture, lambda s: s.shots >= 1)
    assert set(threading.enumerate()) == before
    for path in tmp_path.glob("*.sigmf-meta"):
        assert verify(path)


def test_closing_in_the_middle_of_a_shot_keeps_it(tmp_path: Path) -> None:
    def slow(fake: FakeDigitizer, at: int) -> Block | None:
        return Block(0) if at > FIRST + 3_000 else None

    with Rig(tmp_path, FakeDigitizer(before_block=slow), live=False) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.TRIGGERED)
    recording = read_recording(tmp_path / "shot-0001")
    assert "cut_short" in recording.flags and recording.extra["global"]["lmm:ended_early"] == "the program was closed"


def test_kernels_still_being_compiled_are_not_the_digitizer_s_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled = threading.Event()
    monkeypatch.setattr("instrument.capture.warm", lambda: compiled.wait(20))
    digitizer = FakeDigitizer()
    capture = Capture(digitizer, CaptureOptions(tmp_path, SETTINGS), live=False)
    capture.start()
    assert not capture.close(timeout_s=0.1)
    assert not capture.digitizer_held and digitizer.closed
    compiled.set()
    capture._capture.thread.join(10)
    assert not capture._capture.thread.is_alive()
    assert digitizer.armed == 0  # nobody touches it after its closing


def test_a_digitizer_that_does_not_return_is_held(tmp_path: Path) -> None:
    returns = threading.Event()

    def hang(fake: FakeDigitizer, at: int) -> Block | None:
        returns.wait(20)
        return None

    capture = Capture(FakeDigitizer(before_block=hang), CaptureOptions(tmp_path, SETTINGS), live=False)
    capture.start()
    until(capture, lambda s: s.source != "")
    assert not capture.close(timeout_s=0.1) and capture.digitizer_held
    returns.set()
    assert capture.close() and not capture.digitizer_held


def test_a_simulated_device_that_is_late_is_no_fault(tmp_path: Path) -> None:
    now = [0.0]

    def late(fake: FakeDigitizer, at: int) -> Block | None:
        if at >= 10_000 and now[0] < 30.0:
            now[0] += 0.5
            return Block(0)
        return None

    digitizer = FakeDigitizer(before_block=late, simulated=True)
    with Rig(tmp_path, digitizer, live=False, clock=lambda: now[0]) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == 1)
        assert now[0] == 30.0 and not rig.said
