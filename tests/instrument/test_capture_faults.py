"""Devices and analyses that fail, and closing a capture in every state."""

import threading
import time
from pathlib import Path

import pytest

from analysis.shot.shot import AnalysisError, Cancelled, Shot
from instrument.capture.acquisition import Acquisition, Deadlines, State
from instrument.capture.analysis_thread import ShotAnalysis
from instrument.capture.capture import Capture
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import Block, CaptureSettings, DigitizerError
from instrument.files.recording_file import data_hash, read_recording
from tests.instrument.capturing import SETTINGS, Capturing, analysed, until
from tests.instrument.fake_digitizer import FIRST, RATE_HZ, FakeDigitizer


def test_unplugging_keeps_what_came_and_plugging_in_recovers(tmp_path: Path) -> None:
    plugged = threading.Event()

    def unplugged(fake: FakeDigitizer, at: int) -> Block | None:
        if at > FIRST + 5_000 and not plugged.is_set():
            raise DigitizerError("the device was unplugged", "plug it in and arm again")
        return None

    with Capturing(tmp_path, FakeDigitizer(before_block=unplugged), live=False) as rig:
        rig.capture.arm(automatic=True)
        fault = until(rig.capture, lambda s: s.state is State.FAULT)
        assert fault.message == "the device was unplugged" and fault.remedy == "plug it in and arm again"
        assert not fault.save_failed
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

    with Capturing(tmp_path, FakeDigitizer(before_block=wrong), live=False) as rig:
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

    armed = Capturing(tmp_path, FakeDigitizer(before_block=silent), live=False, machine=Acquisition(lambda: now[0]))
    armed.capture.arm()  # before the thread starts: a stream that is only watched would stall first on a busy machine
    with armed as rig:
        assert "10000 samples came, then none for 3 s" in until(rig.capture, lambda s: s.state is State.FAULT).message
        mode[0] = "hang"
        rig.capture.abort()
        rig.capture.arm()
        time.sleep(0.1)
        now[0] += 100
        assert until(rig.capture, lambda s: s.state is State.FAULT).message == "the digitizer does not answer"
        release.set()


def test_a_shot_longer_than_every_deadline_is_taken_whole(tmp_path: Path) -> None:
    now = [0.0]  # 2 s pass at each block of the stream: the shot lasts minutes, and no wait of a minute is in it
    options = CaptureOptions(tmp_path, CaptureSettings(RATE_HZ, 600_000, 4_000))

    def slow(fake: FakeDigitizer, at: int) -> Block | None:
        if at < 600_000:  # then the disk has the time that it takes
            now[0] += 2.0
        return None

    with Capturing(
        tmp_path, FakeDigitizer(before_block=slow), live=False, machine=Acquisition(lambda: now[0]), options=options
    ) as rig:
        rig.capture.arm()
        shot = until(rig.capture, lambda s: s.shots == 1 or s.state is State.FAULT)
        assert shot.state is not State.FAULT, shot.message
        assert now[0] > 100.0 > Deadlines().triggered_s
        (done,) = until(rig.capture, lambda s: bool(s.finished)).finished
        assert done.path is not None
        recording = read_recording(done.path)
        assert recording.samples == 600_000 and "cut_short" not in recording.flags


def test_nothing_fires_is_said_after_the_deadline(tmp_path: Path) -> None:
    def flat(fake: FakeDigitizer, at: int) -> Block | None:
        fake.at = at % 20_000
        return None

    with Capturing(
        tmp_path,
        FakeDigitizer(before_block=flat),
        live=False,
        machine=Acquisition(time.monotonic, Deadlines(armed_s=0.2)),
    ) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.ARMED)
        idle = until(rig.capture, lambda s: s.state is State.IDLE)
        assert "light switch" in idle.message and idle.remedy
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.ARMED)
        rig.capture.trigger_now()
        until(rig.capture, lambda s: s.shots == 1)


def test_a_stream_that_ends_unfired_is_said(tmp_path: Path) -> None:
    with Capturing(tmp_path, FakeDigitizer(max_samples=20_000), live=False) as rig:
        rig.capture.arm()
        assert "ended before" in until(rig.capture, lambda s: s.state is State.FAULT).message


@pytest.mark.parametrize("error", [AnalysisError("flat"), Cancelled(), RuntimeError("bug")])
def test_a_failing_analysis_costs_only_itself(tmp_path: Path, error: Exception) -> None:
    def broken(*what: object) -> Shot:
        raise error

    with Capturing(tmp_path, analysis=ShotAnalysis(broken), live=False) as rig:
        rig.capture.arm()
        shot = until(rig.capture, lambda s: bool(s.finished)).finished[0]
        assert shot.shot is None and shot.problem and shot.path is not None and "\n" not in shot.problem
        until(rig.capture, lambda s: s.state is State.IDLE)


def test_all_threads_end_and_nothing_stays_open(tmp_path: Path) -> None:
    before = set(threading.enumerate())
    for _ in range(2):
        with Capturing(tmp_path, analysis=ShotAnalysis(analysed)) as rig:
            rig.capture.arm(automatic=True)
            until(rig.capture, lambda s: s.shots >= 1)
    assert set(threading.enumerate()) == before
    for path in tmp_path.glob("*.sigmf-meta"):
        assert data_hash(path).agrees


def test_closing_in_the_middle_of_a_shot_keeps_it(tmp_path: Path) -> None:
    def slow(fake: FakeDigitizer, at: int) -> Block | None:
        return Block(0) if at > FIRST + 3_000 else None

    with Capturing(tmp_path, FakeDigitizer(before_block=slow), live=False) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.TRIGGERED)
    recording = read_recording(tmp_path / "shot-0001")
    assert "cut_short" in recording.flags and recording.extra["global"]["lmm:ended_early"] == "the program was closed"


def test_kernels_still_being_compiled_are_not_the_digitizer_s_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled = threading.Event()
    monkeypatch.setattr("instrument.capture.capture.warm", lambda: compiled.wait(20))
    digitizer = FakeDigitizer()
    capture = Capture(digitizer, CaptureOptions(tmp_path, SETTINGS), live=False)
    capture.start()
    assert not capture.close(timeout_s=0.1)
    assert not capture.digitizer_held and digitizer.closed
    compiled.set()
    assert capture._capture.thread.close(10)
    assert digitizer.armed == 0  # nobody touches it after its closing


def test_a_digitizer_that_does_not_return_is_held(tmp_path: Path) -> None:
    reads, returns = threading.Event(), threading.Event()

    def hang(fake: FakeDigitizer, at: int) -> Block | None:
        reads.set()
        returns.wait(20)
        return None

    capture = Capture(FakeDigitizer(before_block=hang), CaptureOptions(tmp_path, SETTINGS), live=False)
    capture.start()
    assert reads.wait(20)
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
    with Capturing(tmp_path, digitizer, live=False, machine=Acquisition(lambda: now[0])) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == 1)
        assert now[0] == 30.0 and not rig.said
