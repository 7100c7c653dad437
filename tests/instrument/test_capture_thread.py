"""The capture thread turn by turn, without threads: what each block and each order makes of stream and shot."""

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.shot.recording import Setup
from instrument.capture import capture_thread
from instrument.capture.acquisition import Acquisition, Deadlines, State
from instrument.capture.analysis_thread import ShotAnalysis
from instrument.capture.capture import Capture
from instrument.capture.capture_thread import CaptureThread
from instrument.capture.recorder import GrowingShot, Recorded
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import Block, Capabilities, DigitizerError
from instrument.trigger.light_switch import Level
from tests.instrument.capturing import SETTINGS
from tests.instrument.fake_digitizer import CHANNELS, FIRST, RATE_HZ, FakeDigitizer, samples


class Stepped:
    """A capture thread whose turns are taken by hand, and whose recorder only notes what it is given."""

    def __init__(self, folder: Path, digitizer: FakeDigitizer | None = None, **how: Any) -> None:
        self.now, self.said = 0.0, []
        self.digitizer = digitizer or FakeDigitizer()
        options = how.pop("options", CaptureOptions(folder, SETTINGS))
        self.machine = Acquisition(lambda: self.now, Deadlines())
        self.thread = CaptureThread(self.digitizer, options, self.machine, None, lambda _: None, self.said.append)
        self.shots: list[tuple[GrowingShot, Path]] = []
        self.thread.recorder.begin = lambda shot, folder: self.shots.append((shot, folder))  # type: ignore[method-assign]

    @property
    def state(self) -> State:
        return self.machine.status.state

    def take(self, kind: str, what: object = None) -> None:
        self.thread._take((kind, what))

    def turn(self, until: Callable[[], bool] = lambda: True) -> None:
        for _ in range(400):
            self.thread._guarded(self.thread._turn)
            if until():
                return
        raise AssertionError(self.machine.status)

    def saved(self, problem: str | None = None) -> None:
        shot = self.shots[-1][0]
        name = f"shot-{len(self.shots):04d}"
        self.take("recorded", Recorded(shot, shot.recording(name), problem))


@pytest.fixture
def stepped(tmp_path: Path) -> Stepped:
    return Stepped(tmp_path)


def test_a_shot_holds_what_was_asked_for_around_the_step_and_the_stream_goes_on(stepped: Stepped) -> None:
    stepped.take("arm", False)
    assert stepped.state is State.ARMED and stepped.digitizer.running.is_set()
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    ((shot, folder),) = stepped.shots
    assert folder == stepped.thread.options.folder and shot.complete and shot.ended_early is None
    assert (shot.trigger_sample, shot.room, shot.gaps) == (4_000, 0, [])
    np.testing.assert_array_equal(shot.counts, samples(FIRST - 4_000, 20_000))
    assert stepped.digitizer.running.is_set()  # its signals are watched
    stepped.saved()
    assert stepped.state is State.IDLE and stepped.thread.shot is None
    assert stepped.digitizer.armed == 1
    stepped.take("arm", False)
    assert stepped.digitizer.armed == 1  # the same stream serves the next shot
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    second = stepped.shots[-1][0]
    assert (second.counts[:, 1] == samples(FIRST + 20_000 - 4_000, 20_000)[:, 1]).all()  # the step down, after the shot


def test_every_sample_of_the_switch_is_read_while_a_shot_may_begin_or_its_steps_are_counted(stepped: Stepped) -> None:
    how, read = [], stepped.thread.run.read
    stepped.thread.run.read = lambda closely: (how.append(closely), read(closely=closely))[1]  # type: ignore[method-assign, func-returns-value]
    stepped.thread._watch()
    stepped.turn()
    stepped.thread.counts_steps = False
    stepped.turn()
    stepped.take("arm", False)
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    stepped.turn()
    assert how[:3] == [True, False, True] and how[-1] is False
    assert stepped.shots[-1][0].trigger_sample == 4_000


def test_a_shot_that_holds_a_second_step_keeps_the_first_as_its_trigger(tmp_path: Path) -> None:
    stepped = Stepped(tmp_path, options=CaptureOptions(tmp_path, replace(SETTINGS, samples=40_000)))
    stepped.take("arm", False)
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    shot = stepped.shots[0][0]
    assert shot.trigger_sample == 4_000 and np.ptp(shot.counts[10_000:, 2]) == 1_500


def test_steps_that_passed_before_the_arming_start_no_shot(stepped: Stepped) -> None:
    stepped.thread._watch()
    stepped.turn(lambda: stepped.digitizer.at >= FIRST + 5_000)
    stepped.take("arm", False)
    stepped.turn(lambda: bool(stepped.shots))
    assert stepped.digitizer.at >= FIRST + 20_000


def test_a_shot_started_by_hand_triggers_at_the_newest_sample(tmp_path: Path) -> None:
    stepped = Stepped(tmp_path, options=CaptureOptions(tmp_path, replace(SETTINGS, samples=10_000)))
    stepped.take("fire")
    assert not stepped.thread._fire  # nobody is armed
    stepped.take("arm", False)
    stepped.turn()
    stepped.take("fire")
    stepped.turn()
    shot = stepped.shots[0][0]
    at = stepped.digitizer.at
    assert (shot.trigger_sample, shot.filled) == (4_000, 4_001)
    np.testing.assert_array_equal(shot.counts[: shot.filled], samples(at - shot.filled, shot.filled))
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    stepped.saved()
    stepped.take("arm", False)
    stepped.turn()
    assert stepped.state is State.ARMED and len(stepped.shots) == 1  # it was for one shot
    stepped.take("abort")
    stepped.take("arm", False)
    stepped.take("fire")
    stepped.take("arm", False)
    stepped.take("abort")
    stepped.take("arm", False)
    assert not stepped.thread._fire  # an abort forgets it


def test_losses_inside_a_shot_are_its_gaps_and_those_at_its_ends_are_not(tmp_path: Path) -> None:
    gaps: dict[int, int | None] = {FIRST - 4_000 - 100: 70, FIRST - 1_000: 30, FIRST + 5_000: None}
    stepped = Stepped(tmp_path, FakeDigitizer(gaps=gaps))
    stepped.take("arm", False)
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    shot = stepped.shots[0][0]
    assert [(gap.sample_start, gap.samples_lost) for gap in shot.gaps] == [(3_030, 30), (9_000, None)]


def test_a_shot_says_what_its_stream_is_and_what_of_its_rate_and_its_losses_is_in_doubt(tmp_path: Path) -> None:
    class Doubtful(FakeDigitizer):
        @property
        def capabilities(self) -> Capabilities:
            return replace(super().capabilities, unseen_loss_s=2e-3)

    setup = Setup(0.5, rest_frequency_hz=91e3)
    stepped = Stepped(tmp_path, Doubtful(), options=CaptureOptions(tmp_path, SETTINGS, setup))
    stepped.take("arm", False)
    stream = stepped.thread.run.stream
    assert stream is not None
    stream.doubtful_rate_hz = 9e5
    stepped.turn(lambda: bool(stepped.shots))
    shot = stepped.shots[0][0]
    assert (shot.unseen_loss_s, shot.doubtful_rate_hz, shot.source) == (2e-3, 9e5, "fake")
    assert (shot.settings, shot.channels, shot.setup) == (SETTINGS, CHANNELS, replace(setup, digitizer_bits=12))


@pytest.mark.parametrize("told_late", [False, True])
def test_a_device_that_triggers_itself_sends_the_shot_and_may_say_later_where_it_triggered(
    tmp_path: Path, told_late: bool
) -> None:
    sent: list[int] = []

    class Scope(FakeDigitizer):
        def read_into(self, buffer: np.ndarray, timeout_s: float) -> Block:
            block = super().read_into(buffer, timeout_s)
            sent.append(block.samples)
            at = 17 if told_late and len(sent) == 2 else None
            return Block(block.samples, 0, block.ended, at)

    stepped = Stepped(tmp_path, Scope(max_samples=20_000, hardware_trigger=True))
    stepped.take("arm", False)
    stepped.turn()
    (shot, _), first = stepped.shots[0], sent[0]
    assert shot.trigger_sample == 4_000 and shot.filled == first
    stepped.turn()
    assert shot.trigger_sample == (first + 17 if told_late else 4_000)
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    np.testing.assert_array_equal(shot.counts, samples(0, 20_000))
    assert not stepped.digitizer.running.is_set() and not stepped.thread.run.running  # its stream was the shot


def test_a_device_that_fires_before_it_sends_is_waited_for_and_one_that_sends_nothing_is_said(tmp_path: Path) -> None:
    answers = [Block(0, fired=True), None, Block(0, fired=True), Block(0, ended=True)]
    digitizer = FakeDigitizer(
        before_block=lambda *_: answers.pop(0) if answers else None, max_samples=20_000, hardware_trigger=True
    )
    stepped = Stepped(tmp_path, digitizer)
    stepped.take("arm", False)
    stepped.turn()
    assert stepped.state is State.TRIGGERED and stepped.thread.shot is None
    stepped.turn()
    assert stepped.thread.shot is not None
    stepped.take("abort")
    stepped.saved()
    stepped.take("arm", False)
    stepped.turn()
    stepped.turn()
    assert stepped.state is State.FAULT and "no sample of the shot came" in stepped.machine.status.message


def test_the_start_of_a_shot_is_told_in_utc_at_its_first_sample(
    stepped: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    noon = datetime(2026, 5, 1, 12, 0, 0, tzinfo=UTC)
    monkeypatch.setattr(capture_thread, "datetime", SimpleNamespace(now=lambda zone: noon.astimezone(zone)))
    stepped.take("arm", False)
    stepped.turn(lambda: bool(stepped.shots))
    shot = stepped.shots[0][0]
    milliseconds = round(1000 - 1e3 * shot.filled / RATE_HZ)
    assert shot.started_at == f"2026-05-01T11:59:59.{milliseconds:03d}Z"


def test_an_endless_stream_is_watched_before_the_arming_and_a_device_that_triggers_itself_is_not(
    tmp_path: Path,
) -> None:
    for digitizer in (
        FakeDigitizer(), FakeDigitizer(max_samples=20_000), FakeDigitizer(hardware_trigger=True)
    ):  # fmt: skip
        stepped = Stepped(tmp_path, digitizer)
        stepped.thread._watch()
        assert digitizer.armed == int(digitizer.capabilities.max_samples is None and not digitizer._hardware)
        stepped.thread._watch()
        assert digitizer.armed <= 1


def test_options_take_effect_at_once_when_idle_and_from_the_next_arming_on_otherwise(stepped: Stepped) -> None:
    other = CaptureOptions(stepped.thread.options.folder, SETTINGS, switch_low_v=0.5, switch_high_v=1.0)
    stepped.take("options", stepped.thread.options)
    assert stepped.digitizer.armed == 1 and stepped.thread.run.thresholds_v == (None, None)
    stepped.take("options", other)
    assert stepped.digitizer.armed == 2 and stepped.thread.run.thresholds_v == pytest.approx((0.5, 1.0))
    stepped.take("arm", False)
    stepped.take("options", CaptureOptions(other.folder, SETTINGS))
    assert stepped.digitizer.armed == 2 and stepped.thread.run.thresholds_v == pytest.approx((0.5, 1.0))
    stepped.take("abort")
    stepped.take("arm", False)
    assert stepped.digitizer.armed == 3 and stepped.thread.run.thresholds_v != pytest.approx((0.5, 1.0))


def test_once_it_closes_no_order_starts_anything_and_an_abort_is_still_carried_out(stepped: Stepped) -> None:
    stepped.take("arm", True)
    stepped.thread.closing = True
    stepped.take("fire")
    stepped.take("options", CaptureOptions(Path("elsewhere")))
    assert not stepped.thread._fire and stepped.thread.options.folder != Path("elsewhere")
    stepped.take("abort")
    stepped.take("arm", False)
    assert stepped.state is State.IDLE and stepped.digitizer.armed == 1
    stepped.digitizer.stop()
    stepped.thread.run.running = False
    stepped.take("options", stepped.thread.options)
    assert stepped.digitizer.armed == 1


@pytest.mark.parametrize("ordered", [False, True])
def test_the_thread_prepares_warms_and_watches_then_turns_until_it_closes(stepped: Stepped, ordered: bool) -> None:
    thread, seen = stepped.thread, []  # type: ignore[var-annotated]
    stepped.now = 7.0

    def note(what: str) -> None:
        seen.append((what, thread.touched, thread.prepared))

    def turn() -> None:
        note("turn")
        assert thread.alive_s == stepped.now
        stepped.now += 1.0
        thread.closing = seen.count(("turn", True, True)) == 3
        raise DigitizerError("one fault", "and its remedy")  # ends no turning

    stepped.digitizer.prepare = lambda: note("prepare")  # type: ignore[method-assign]
    thread._warm = lambda given_up: seen.append(("warm", thread.touched, thread.prepared, given_up()))
    thread._watch = lambda: note("watch")  # type: ignore[method-assign]
    thread._turn = turn  # type: ignore[method-assign]
    if ordered:  # an order begins the stream itself
        thread.orders.put(("abort", None))
    thread._main()
    begun = [("prepare", True, False), ("warm", False, False, False)] + [("watch", True, True)] * (not ordered)
    assert seen == [*begun, *[("turn", True, True)] * 3] and stepped.said == ["one fault: and its remedy"] * 3
    seen.clear()
    thread._main()  # it closes before it has begun
    assert seen == []


def test_a_shot_under_way_when_the_program_is_closed_is_kept_and_the_device_stopped(stepped: Stepped) -> None:
    stepped.take("arm", False)
    stepped.turn(lambda: bool(stepped.shots))
    shot, real = stepped.shots[0][0], stepped.thread._turn
    assert not shot.complete

    def last() -> None:
        real()
        stepped.thread.closing = True

    stepped.thread._turn = last  # type: ignore[method-assign]
    before = shot.filled
    stepped.thread._main()
    assert shot.complete and shot.ended_early == "the program was closed" and shot.filled > before
    assert not stepped.digitizer.running.is_set() and not stepped.thread.run.running


def test_re_arming_is_an_order_of_its_own(stepped: Stepped) -> None:
    stepped.take("arm", True)
    assert stepped.machine.status.automatic
    stepped.take("automatic", False)
    assert not stepped.machine.status.automatic
    stepped.take("automatic", True)
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    stepped.saved()
    assert stepped.state is State.ARMED


def test_the_folder_is_locked_from_the_arming_on_and_another_one_in_its_place(stepped: Stepped, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    stepped.take("arm", False)
    first = stepped.thread._lock
    stepped.take("abort")
    stepped.take("arm", False)
    assert first is not None and stepped.thread._lock is first and first.valid()
    stepped.take("abort")
    stepped.take("options", CaptureOptions(other, SETTINGS))
    stepped.take("arm", False)
    second = stepped.thread._lock
    assert second is not None and second.folder == other and not first.valid()
    stepped.thread.release_folder()
    stepped.thread.release_folder()
    assert stepped.thread._lock is None and not second.valid()


@pytest.mark.parametrize(("lacks", "refused"), [(0, False), (1, True)])
def test_a_shot_and_a_reserve_must_fit_the_disk(
    stepped: Stepped, monkeypatch: pytest.MonkeyPatch, lacks: int, refused: bool
) -> None:
    needed = 2 * 3 * 20_000 + 64 * 2**20
    monkeypatch.setattr(capture_thread, "disk_free_bytes", lambda folder: needed - lacks)
    stepped.take("arm", False)
    assert (stepped.state is State.FAULT) == refused == (stepped.thread.folder_problem is not None)
    if refused:
        assert "only 67 MB free, a shot takes 0 MB" in stepped.machine.status.message
        assert stepped.machine.status.remedy == "choose another folder, then arm again"
    monkeypatch.setattr(capture_thread, "disk_free_bytes", lambda folder: None)  # where the system does not say
    stepped.take("abort")
    stepped.take("arm", False)
    assert stepped.state is State.ARMED and stepped.thread.folder_problem is None


@pytest.mark.parametrize(("unsaved", "refused"), [(3, False), (4, True)])
def test_no_shot_is_taken_while_four_are_only_in_memory(stepped: Stepped, unsaved: int, refused: bool) -> None:
    stepped.thread.captured._unsaved.update({str(n): None for n in range(unsaved)})  # type: ignore[misc]
    stepped.take("arm", False)
    assert (stepped.state is State.FAULT) == refused
    if refused:
        assert (stepped.machine.status.message, stepped.machine.status.remedy) == (
            "4 shots are only in memory", "save them first",
        )  # fmt: skip
        assert stepped.said == ["4 shots are only in memory: save them first"]


def test_a_shot_that_could_not_be_saved_is_a_fault_and_is_kept(stepped: Stepped) -> None:
    stepped.take("arm", True)
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    stepped.saved("the disk is full")
    assert stepped.state is State.FAULT and stepped.machine.status.message == "the disk is full"
    assert stepped.thread.captured.unsaved == ("shot-0001",) and stepped.thread.shot is None
    assert not stepped.digitizer.running.is_set()  # a fault stops the stream


def test_a_device_that_cannot_even_be_stopped_is_a_fault_once(stepped: Stepped, tmp_path: Path) -> None:
    def unplugged() -> None:
        raise DigitizerError("gone", "plug it in")

    digitizer = FakeDigitizer(max_samples=20_000)
    stepped = Stepped(tmp_path, digitizer)
    stepped.take("arm", False)
    digitizer.stop = unplugged  # type: ignore[method-assign]
    stepped.take("abort")
    assert stepped.state is State.FAULT and not stepped.thread.run.running
    status = stepped.machine.status
    assert (status.message, status.remedy) == ("gone: plug it in", "re-plug the digitizer")


def test_only_what_progresses_is_waited_for_longer(stepped: Stepped) -> None:
    stepped.take("arm", False)
    stepped.turn()
    armed_until = stepped.machine.status.deadline_s
    stepped.now = 10.0
    stepped.turn()
    assert stepped.state is State.ARMED and stepped.machine.status.deadline_s == armed_until == 3600.0
    stepped.turn(lambda: stepped.state is State.TRIGGERED)
    begun_until = stepped.machine.status.deadline_s
    stepped.now = 20.0
    stepped.turn()
    assert begun_until == 70.0 and stepped.machine.status.deadline_s == 80.0
    stepped.turn(lambda: stepped.state is State.TRANSFERRING)
    stepped.thread._look_for_progress()
    stepped.now = 50.0
    stepped.thread._look_for_progress()
    assert stepped.machine.status.deadline_s == 80.0  # nothing was written
    stepped.shots[0][0].written = 100
    stepped.thread._look_for_progress()
    assert stepped.machine.status.deadline_s == 110.0


def test_a_snapshot_counts_the_samples_and_losses_of_this_stream_and_says_how_far_the_shot_is(tmp_path: Path) -> None:
    now = [5.0]
    digitizer = FakeDigitizer(max_samples=20_000, hardware_trigger=True, gaps={30_000: 12})
    capture = Capture(
        digitizer, CaptureOptions(tmp_path, SETTINGS), live=False, machine=Acquisition(lambda: now[0]), say=print
    )
    thread = capture._capture
    thread.recorder.begin = lambda *_: None  # type: ignore[method-assign]
    for lost in (0, 12):
        thread._take(("arm", False))
        thread._turn()
        filled = thread.run.stream.ring.total - thread.run.stream.start  # type: ignore[union-attr]
        shown = capture.latest()
        assert (shown.signal.samples_read, shown.doing, shown.progress) == (filled, "recording", filled / 20_000)
        for _ in range(400):
            if thread.machine.status.state is State.TRIGGERED:
                thread._turn()
        thread.shot.written = 5_000  # type: ignore[union-attr]
        shown = capture.latest()
        assert (shown.doing, shown.progress, shown.since_s) == ("saving", 0.25, 5.0)
        assert (shown.signal.samples_read, shown.signal.samples_lost, shown.signal.losses) == (20_000, lost, lost > 0)
        shot = thread.shot
        assert shot is not None
        thread._take(("recorded", Recorded(shot, shot.recording("s"), None)))
    assert capture.latest().shots == 2 and capture.latest().doing is None


@pytest.mark.parametrize(("complete", "why"), [(False, "the digitizer did not answer"), (True, None)])
def test_a_capture_whose_digitizer_hangs_ends_the_shot_under_way_and_none_that_is_whole(
    tmp_path: Path, complete: bool, why: str | None
) -> None:
    capture = Capture(FakeDigitizer(), CaptureOptions(tmp_path, SETTINGS), live=False, say=print)
    thread = capture._capture
    thread._take(("arm", False))
    for _ in range(400):
        if thread.shot is None:
            thread._turn()
    assert thread.shot is not None
    shot, thread.prepared = thread.shot, True
    shot.complete = complete
    thread.thread = SimpleNamespace(alive=True, close=lambda _: False)  # type: ignore[assignment]
    capture._capture.recorder.close = lambda _: True  # type: ignore[method-assign]
    assert not capture.close(0.0) and capture.digitizer_held
    assert shot.complete and shot.ended_early == why
    thread.release_folder()


def _parted(tmp_path: Path, hangs: str = "") -> tuple[Capture, list[Any]]:
    """Return a capture whose parts only note that they are started and closed; one of them does not end."""
    did: list[Any] = []
    digitizer = FakeDigitizer()
    capture = Capture(digitizer, CaptureOptions(tmp_path, SETTINGS), analysis=ShotAnalysis(print))  # type: ignore[arg-type]
    thread = capture._capture

    def close(longest_s: float) -> bool:
        did.append(("thread", longest_s))
        return hangs != "thread"

    thread.thread = SimpleNamespace(  # type: ignore[assignment]
        start=lambda: did.append("thread"), add=lambda _: None, alive=hangs == "thread", close=close
    )
    parts = {"recorder": thread.recorder, "analysis": capture._shots.analysis, "live": capture._live}
    for name, part in parts.items():
        part.start = lambda name=name: did.append(name)  # type: ignore[union-attr, misc, method-assign]
        part.close = lambda s, name=name: did.append((name, s)) or name != hangs  # type: ignore[union-attr, misc, method-assign]
    digitizer.stop = lambda: did.append(("stop", thread.closing))  # type: ignore[method-assign]
    digitizer.close = lambda: did.append("close")  # type: ignore[method-assign]
    thread.take_orders = lambda: did.append("orders")  # type: ignore[method-assign]
    thread.release_folder = lambda: did.append("folder")  # type: ignore[method-assign]
    return capture, did


def test_a_capture_is_closed_part_by_part_the_device_stopped_first_and_closed_last(tmp_path: Path) -> None:
    capture, did = _parted(tmp_path)
    with capture as entered:
        assert entered is capture and did == ["recorder", "analysis", "live", "thread"]
        did.clear()
    parts = [(name, 30.0) for name in ("thread", "recorder", "analysis", "live")]
    assert did == [("stop", True), *parts, "orders", "folder", "close"] and not capture.digitizer_held
    for hangs in ("recorder", "analysis", "live"):
        capture, did = _parted(tmp_path, hangs)
        assert not capture.close(2.0) and did[-4:] == [("live", 2.0), "orders", "folder", "close"]
    for touched in (False, True):  # while it calls the digitizer nobody else may
        capture, did = _parted(tmp_path, "thread")
        capture._capture.touched = capture._capture.prepared = touched
        assert not capture.close(2.0) and capture.digitizer_held == touched
        assert did[-2:] == [("live", 2.0), "close"] if not touched else did[-1] == ("live", 2.0)


def test_what_is_asked_of_a_capture_is_an_order_to_its_thread(tmp_path: Path) -> None:
    capture, options = _parted(tmp_path)[0], CaptureOptions(tmp_path / "other")
    for ask in (
        capture.arm, lambda: capture.arm(automatic=True), lambda: capture.set_automatic(False), capture.abort,
        capture.trigger_now, lambda: capture.set_options(options),
    ):  # fmt: skip
        ask()
    asked = [capture._orders.get_nowait() for _ in range(6)]
    assert asked == [
        *(("arm", False), ("arm", True), ("automatic", False), ("abort", None), ("fire", None), ("options", options))
    ]
    assert capture._live is not None and capture._live.watched
    capture.watch(False, switch=True)
    assert not capture._live.watched and capture._capture.counts_steps
    capture.watch(True, switch=False)
    assert capture._live.watched and not capture._capture.counts_steps and capture._orders.empty()


def test_arming_is_shown_from_the_press_until_the_digitizer_has_started(tmp_path: Path) -> None:
    now, digitizer = [100.0], FakeDigitizer()
    capture = Capture(digitizer, CaptureOptions(tmp_path, SETTINGS), live=False, machine=Acquisition(lambda: now[0]))
    thread = capture._capture

    def shown() -> tuple[State, float]:
        return capture.latest().state, capture.latest().since_s

    during: list[tuple[State, float]] = []
    starts = digitizer.arm

    def arm(settings: object) -> None:
        now[0] = 103.0
        during.append(shown())
        starts(settings)

    digitizer.arm = arm  # type: ignore[method-assign]
    assert shown() == (State.IDLE, 100.0)
    now[0] = 101.0
    capture.arm()
    now[0] = 102.0
    assert shown() == (State.ARMING, 101.0)  # the thread has not come to it yet
    thread.take_orders()
    assert during == [(State.ARMING, 102.0)] and shown() == (State.ARMED, 103.0)
    capture.arm()
    assert shown() == (State.ARMED, 103.0)  # pressed once more
    thread.take_orders()
    assert shown() == (State.ARMED, 103.0) and digitizer.armed == 1


@pytest.mark.parametrize("closing", [False, True])
def test_arming_ends_with_a_fault_or_with_the_capture(tmp_path: Path, closing: bool) -> None:
    capture = Capture(FakeDigitizer(), CaptureOptions(tmp_path, replace(SETTINGS, sample_rate_hz=2e6)), live=False)
    capture.arm()
    assert capture.latest().state is State.ARMING
    capture._capture.closing = closing
    capture._capture.take_orders()
    assert capture.latest().state is (State.IDLE if closing else State.FAULT)


@pytest.mark.parametrize(
    ("how", "samples_came", "starting", "limit_s"),
    [
        ({}, True, False, 5.0),
        ({}, True, True, 60.0),  # while it is armed anew
        ({}, False, False, 60.0),  # before its first sample firmware may load
        ({"simulated": True}, True, False, 60.0),
    ],
)
def test_a_driver_that_blocks_the_thread_for_longer_than_its_time_does_not_answer(
    tmp_path: Path, how: dict[str, bool], samples_came: bool, starting: bool, limit_s: float
) -> None:
    now = [100.0]
    capture = Capture(
        FakeDigitizer(**how), CaptureOptions(tmp_path, SETTINGS), live=False, machine=Acquisition(lambda: now[0])
    )
    thread = capture._capture
    thread._watch()
    if samples_came:
        thread._read()
    thread.run.starting = starting
    for alive in (True, False):
        thread.thread = SimpleNamespace(alive=alive)  # type: ignore[assignment]
        for alive_s, late_s, silent in ((None, 1e4, False), (100.0, limit_s, False), (100.0, limit_s + 0.01, alive)):
            thread.alive_s, now[0] = alive_s, 100.0 + late_s
            shown = capture.latest()
            assert (shown.state is State.FAULT) == silent, (alive, alive_s, late_s)
            assert shown.message == ("the digitizer does not answer" if silent else "")
            assert shown.remedy == ("re-plug it, then choose it again" if silent else "")


def test_a_snapshot_has_the_options_folder_its_room_and_what_the_switch_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("instrument.capture.capture.disk_free_bytes", lambda folder: 12 if folder == tmp_path else 0)
    options = CaptureOptions(tmp_path, SETTINGS, switch_low_v=0.5, switch_high_v=1.0)
    capture = Capture(FakeDigitizer(), options, live=False)
    nothing = capture.latest().signal
    assert (nothing.samples_read, nothing.samples_lost, nothing.losses, nothing.switch_toggles) == (0, 0, 0, 0)
    thread = capture._capture
    thread._watch()
    for _ in range(400):
        if thread.run.toggles < 2:
            thread._read()
    thread.folder_problem = "full"
    line = capture.latest().signal
    assert (line.folder, line.folder_problem, line.disk_free_bytes, line.channels) == (tmp_path, "full", 12, ())
    assert (line.switch_level, line.switch_toggles) == (Level.LOW, 2)
    assert line.switch_thresholds_v == pytest.approx((0.5, 1.0)) and line.samples_read >= FIRST + 20_000
