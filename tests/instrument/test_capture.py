"""Taking shots end to end with a digitizer whose samples are all known."""

import gc
import threading
import time
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Recording, Setup
from analysis.shot.shot import Cancelled, Shot
from instrument.capture.acquisition import Acquisition, Deadlines, State
from instrument.capture.analysis_thread import ShotAnalysis
from instrument.capture.snapshot import SignalLine, Snapshot
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import Block, CaptureSettings
from instrument.files.recording_file import data_hash, read_recording
from instrument.live.live_view import empty_view
from instrument.trigger.light_switch import Level
from tests.instrument.capturing import SETTINGS, Capturing, analysed, assert_true_samples, until
from tests.instrument.fake_digitizer import CHANNELS, FIRST, PERIOD, RATE_HZ, FakeDigitizer, samples


def test_a_line_of_signals_that_nobody_measured_shows_none() -> None:
    """The window shows it before a digitizer is opened: a switch that has toggled would be called good."""
    line = SignalLine()
    assert not line.channels and line.switch_level is Level.UNKNOWN and line.disk_free_bytes is None
    assert (line.switch_toggles, line.samples_lost, line.losses, line.samples_read) == (0, 0, 0, 0)
    now = Snapshot(State.IDLE, 0.0, False, "", "", line, empty_view())
    assert (now.shots, now.doing, now.progress) == (0, None, None)
    assert now.waiting == now.finished == now.unsaved == ()


def test_a_shot_from_arm_to_result(tmp_path: Path) -> None:
    with Capturing(tmp_path, analysis=ShotAnalysis(analysed)) as rig:
        idle = until(rig.capture, lambda s: s.state is State.IDLE and s.signal.channels != ())
        assert idle.shots == 0 and not list(tmp_path.iterdir())
        rig.capture.arm()
        done = until(rig.capture, lambda s: bool(s.finished))
        until(rig.capture, lambda s: s.state is State.IDLE)
        shot = done.finished[0]
        assert (shot.number, shot.name, shot.problem) == (1, "shot-0001", None) and shot.shot is not None
        assert shot.path is not None and data_hash(shot.path).agrees
        recording = read_recording(shot.path)
        assert (recording.samples, recording.trigger_sample) == (20_000, 4_000)
        assert_true_samples(recording)
        assert recording.extra["global"]["lmm:capture"] == {
            "source": "fake", "samples": 20_000, "pre_trigger_samples": 4_000,
        }  # fmt: skip
        assert recording.started_at is not None and recording.started_at.endswith("Z")
        assert not rig.said


def test_the_threads_of_a_capture_are_known_by_name_and_keep_no_process_alive(tmp_path: Path) -> None:
    with Capturing(tmp_path, analysis=ShotAnalysis(analysed)):
        running = {thread.name: thread.daemon for thread in threading.enumerate() if "levimass" in thread.name}
    assert running == {f"levimass {part}": True for part in ("capture", "recorder", "analysis", "live")}


def test_automatic_goes_on_and_no_sample_is_lost_to_a_slow_analysis(tmp_path: Path) -> None:
    gate = threading.Event()

    def slow(*what: object) -> Shot:
        gate.wait(20)
        return analysed(*what)  # type: ignore[arg-type]

    with Capturing(tmp_path, analysis=ShotAnalysis(slow, queue_length=3), live=False) as rig:
        rig.capture.arm(automatic=True)
        piled = until(rig.capture, lambda s: s.shots >= 7)
        assert piled.automatic and len(piled.waiting) == 4  # one under way, three waiting
        assert all("too many" in (s.problem or "") and s.path for s in piled.finished)
        gate.set()
        until(rig.capture, lambda s: s.shots >= 10 and not s.waiting)
        rig.capture.abort()
        until(rig.capture, lambda s: s.state is State.IDLE)
        until(rig.capture, lambda s: not s.waiting)
        numbers = [shot.number for shot in rig.capture.latest().finished]
        assert len(numbers) == len(set(numbers))
    firsts = []
    for path in sorted(tmp_path.glob("*.sigmf-meta")):
        recording = read_recording(path)
        if "cut_short" not in recording.flags:
            firsts.append(assert_true_samples(recording))
            assert recording.gaps == ()
    # the stream went on: each shot begins at a later step of the same stream
    assert len(firsts) >= 9 and firsts == sorted(firsts)


def test_a_rearming_given_up_while_armed_ends_with_the_shot_under_way(tmp_path: Path) -> None:
    with Capturing(tmp_path, live=False) as rig:
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
    with Capturing(tmp_path, FakeDigitizer(gaps=dict(gaps)), live=False) as rig:
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
    with Capturing(tmp_path, FakeDigitizer(gaps={FIRST + 4_000: None}), live=False) as rig:
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

    with Capturing(tmp_path, FakeDigitizer(before_block=slow), analysis=ShotAnalysis(analysed), live=False) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is (State.TRIGGERED if fires else State.ARMED))
        rig.capture.abort()
        until(rig.capture, lambda s: s.state is State.IDLE)
        if fires:
            kept = until(rig.capture, lambda s: bool(s.finished)).finished[0]
            assert kept.path is not None and kept.shot is None and kept.problem == "aborted"
            recording = read_recording(kept.path)
            assert "cut_short" in recording.flags and 5_000 < recording.samples < 20_000 and data_hash(kept.path).agrees
            assert_true_samples(recording)
        else:
            assert not list(tmp_path.glob("*.sigmf-*"))
        hold.set()
        rig.capture.arm()
        until(rig.capture, lambda s: s.shots == (2 if fires else 1))


def test_two_channels_without_a_switch_wait_for_the_operator(tmp_path: Path) -> None:
    with Capturing(tmp_path, FakeDigitizer(channels=CHANNELS[:2], pace_s=0.002), live=False) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.ARMED)
        time.sleep(0.1)
        assert rig.capture.latest().state is State.ARMED
        rig.capture.trigger_now()
        path = until(rig.capture, lambda s: bool(s.finished)).finished[0].path
        assert path is not None and read_recording(path).counts.shape == (20_000, 2)


def test_a_scope_s_stream_is_the_shot(tmp_path: Path) -> None:
    fake = FakeDigitizer(max_samples=20_000, hardware_trigger=True, channels=CHANNELS[:2])
    with Capturing(tmp_path, fake, live=False) as rig:
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


def test_abort_stops_an_analysis(tmp_path: Path) -> None:
    def endless(recording: Recording, progress: object, cancelled: Callable[[], bool]) -> Shot:
        while not cancelled():
            time.sleep(0.001)
        raise Cancelled

    with Capturing(tmp_path, analysis=ShotAnalysis(endless), live=False) as rig:
        rig.capture.arm()
        until(rig.capture, lambda s: s.state is State.ANALYSING and s.doing == "analysing")
        rig.capture.abort()
        assert until(rig.capture, lambda s: bool(s.finished)).finished[0].problem == "the analysis was stopped"


def test_settings_that_no_shot_can_be_taken_with_are_refused(tmp_path: Path) -> None:
    with Capturing(tmp_path, live=False) as rig:
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
    with Capturing(tmp_path, options=options) as rig:
        watched = until(rig.capture, lambda s: s.signal.switch_level is not Level.UNKNOWN and len(s.live.time_s) > 0)
        assert watched.live.velocity_m_per_s.shape == watched.live.time_s.shape
        rig.capture.arm()
        path = until(rig.capture, lambda s: bool(s.finished)).finished[0].path
        assert path is not None and read_recording(path).setup == replace(setup, digitizer_bits=12)


def test_the_signal_line_tells_what_the_fake_sends(tmp_path: Path) -> None:
    with Capturing(tmp_path, FakeDigitizer(pace_s=0.005)) as rig:
        now = until(rig.capture, lambda s: len(s.signal.channels) == 3 and s.signal.switch_toggles >= 2)
        reference, measurement, switch = now.signal.channels
        assert reference.frequency_hz == pytest.approx(91e3, abs=5)
        assert reference.amplitude_v == pytest.approx(1.5, 0.01)
        assert measurement.snr_db is not None and measurement.snr_db > 30 and measurement.clipped_fraction == 0
        assert switch.amplitude_v in (pytest.approx(0.1), pytest.approx(1.6)) and switch.frequency_hz is None
        assert now.signal.disk_free_bytes and now.live.raw_v.shape[1] == 3 and not now.live.raw_v.flags.writeable


def test_an_analysis_that_goes_on_is_waited_for_and_one_that_hangs_is_not(tmp_path: Path) -> None:
    hang = threading.Event()

    def slow(recording: Recording, progress: Callable[[str, float], None], cancelled: Callable[[], bool]) -> Shot:
        for _ in range(20):
            progress("first start: compiling", 0.0)
            if hang.wait(0.05):
                break
        while hang.is_set() and not cancelled():
            time.sleep(0.01)
        if cancelled():
            raise Cancelled
        return analysed(recording, progress, cancelled)

    with Capturing(
        tmp_path,
        analysis=ShotAnalysis(slow),
        live=False,
        machine=Acquisition(time.monotonic, Deadlines(analysing_s=0.3)),
    ) as rig:
        rig.capture.arm()
        done = until(rig.capture, lambda s: bool(s.finished))
        assert done.finished[0].shot is not None and done.state is not State.FAULT
        hang.set()
        rig.capture.arm()
        fault = until(rig.capture, lambda s: s.state is State.FAULT)
        assert "took too long" in fault.message
        until(rig.capture, lambda s: len(s.finished) == 2)


def test_a_capture_that_is_over_keeps_no_memory(tmp_path: Path) -> None:
    """A circle through it held the ring, 20 to 500 MB, until the garbage collector came by."""
    rig = Capturing(tmp_path)
    with rig:
        rig.capture.arm()
        until(rig.capture, lambda now: bool(now.finished))
    ring = weakref.ref(rig.capture._capture.run.stream.ring)
    gc.disable()
    try:
        del rig
        assert ring() is None
    finally:
        gc.enable()
