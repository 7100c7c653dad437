"""The two ends of a subprocess, without the process: blocks cut into a reader's pieces, memory for a lag, reports."""

import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.shot.shot import AnalysisError, Cancelled
from instrument.background import worker_process
from instrument.background.worker_process import ProcessEnded, WorkerProcess
from instrument.devices.digitizer import Block, Capabilities, CaptureSettings, DigitizerError
from instrument.devices.ring import Ring
from instrument.devices.sources import open_source
from instrument.files.recording_error import RecordingError
from instrument.process import child as child_module
from instrument.process import device_process, shared_ring, subprocess_digitizer, subprocess_worker
from instrument.process.child import OPENED, STARTED, Answer, BlockReady, DeviceState, Order, _Child
from instrument.process.device_process import DeviceProcess
from instrument.process.shared_ring import SharedRing
from instrument.process.subprocess_digitizer import SubprocessDigitizer, open_in_subprocess
from instrument.process.subprocess_worker import SubprocessWorker, _Report, _run, _seal, _Task
from tests.child import child_id
from tests.instrument.fake_digitizer import CHANNELS, FakeDigitizer, samples

CAPACITY = 700


@pytest.fixture(scope="module")
def ring() -> Iterator[SharedRing]:
    made = SharedRing.create(0, 2, CAPACITY)
    made.unlink()
    yield made
    made.close()


class Parent(SubprocessDigitizer):
    """A parent whose child has sent ``messages``."""

    def __init__(self, ring: SharedRing | None, messages: list[Any], able: Capabilities | None = None) -> None:
        self._exchange = threading.RLock()
        self._stopped, self._closed = threading.Event(), False
        self._ring, self._run, self._block, self._read_of_block = ring, 5, None, 0
        self._attached = None
        self._blocks, self._beats, self._alive_s = 40, -1, 0.0
        device = SimpleNamespace(capabilities=able or FakeDigitizer().capabilities)
        self.ended = 0
        self._child = SimpleNamespace(  # type: ignore[assignment]
            device=device, over=False, receive=lambda timeout_s: messages.pop(0) if messages else None,
            end_silent=lambda: DigitizerError("the digitizer does not answer"),
        )  # fmt: skip


BLOCKS = st.lists(
    st.tuples(st.integers(0, 90), st.sampled_from([0, 0, 3, None]), st.integers(-1, 89)), min_size=1, max_size=7
)


@settings(max_examples=120, deadline=None)
@given(BLOCKS, st.lists(st.integers(1, 60), min_size=1, max_size=4), st.booleans())
def test_the_pieces_of_a_block_are_its_samples_with_its_loss_before_the_first_and_its_end_after_the_last(
    ring: SharedRing, blocks: list[tuple[int, int | None, int]], rooms: list[int], fired: bool
) -> None:
    told = [(n, lost, at if 0 <= at < n else None) for n, lost, at in blocks]
    messages: list[Any] = [None, BlockReady(4, 0, Block(7))]  # nothing yet, and what an earlier stream has left
    at = 1400  # of the ring's third turn
    for number, (n, lost, trigger) in enumerate(told):
        at += -at % CAPACITY if at % CAPACITY + n > CAPACITY else 0  # a block never wraps
        numbers = np.arange(at, at + n, dtype=np.int16)
        ring.view(at, n)[:] = np.stack((numbers, -numbers), axis=1)
        last = number == len(told) - 1
        messages.append(BlockReady(5, at, Block(n, lost, last, trigger, fired)))
        at += n
    known = [(m.first, m.block) for m in messages[2:]]
    parent, turn = Parent(ring, messages), 0
    for number, (first, block) in enumerate(known):
        come = 0
        while True:
            buffer = np.zeros((rooms[turn % len(rooms)], 2), np.int16)
            turn += 1
            piece = parent.read_into(buffer, 0.0)
            if piece == Block(0) and number == come == 0 and turn == 1:
                continue  # nothing had come
            length = min(block.samples - come, len(buffer))
            whole = come + length == block.samples
            trigger = None if block.trigger_sample is None else block.trigger_sample - come
            assert piece == Block(
                length,
                block.lost_before if come == 0 else 0,
                block.ended and whole,
                trigger if trigger is not None and 0 <= trigger < length else None,
                fired,
            )
            numbers = np.arange(first + come, first + come + length, dtype=np.int16)
            assert np.array_equal(buffer[:length], np.stack((numbers, -numbers), axis=1))
            come += length
            assert (ring.room(first + come), ring.blocks_read) == (CAPACITY, 40 + number + whole)
            if whole:
                break
    assert parent.read_into(np.zeros((5, 2), np.int16), 0.0) == Block(0, ended=True)


def test_a_fault_comes_after_the_blocks_before_it_and_ends_the_stream(ring: SharedRing) -> None:
    fault = DigitizerError("unplugged", "plug it in")
    parent = Parent(ring, [BlockReady(5, 0, Block(3)), BlockReady(5, 3, Block(0, ended=True), fault)])
    buffer = np.zeros((5, 2), np.int16)
    assert parent.read_into(buffer, 0.0) == Block(3)
    with pytest.raises(DigitizerError, match="unplugged"):
        parent.read_into(buffer, 0.0)
    assert parent.read_into(buffer, 0.0) == Block(0, ended=True)
    stopped = Parent(ring, [BlockReady(5, 0, Block(3))])
    stopped._stopped.set()
    assert stopped.read_into(buffer, 0.0) == Block(0, ended=True)


@pytest.mark.parametrize(("simulated", "limit_s"), [(False, 5.0), (True, 60.0)])
def test_a_child_whose_heart_stands_still_does_not_answer(ring: SharedRing, simulated: bool, limit_s: float) -> None:
    parent = Parent(ring, [], FakeDigitizer(simulated=simulated).capabilities)
    parent._check_alive(100.0)
    parent._check_alive(100.0 + limit_s)
    ring.beat()
    parent._check_alive(110.0 + limit_s)
    parent._check_alive(110.0 + 2 * limit_s)
    with pytest.raises(DigitizerError, match="does not answer"):
        parent._check_alive(110.1 + 2 * limit_s)


@pytest.mark.parametrize(
    ("rate", "how", "blocks"),
    [
        (10e6, {"real_time": True}, 37),  # 1.5 s in blocks of 400,000
        (10e6, {"real_time": True, "simulated": True}, 12),  # 0.5 s
        (30e6, {"real_time": True}, 42),  # 1.5 s of three channels are 270 MB
        (50e6, {"real_time": True}, 53),  # 320 MiB of three channels
        (10e6, {}, 13),  # 32 MiB: what keeps the shot until it is read can wait
        (1e3, {"real_time": True}, 5),
        (100.0, {"real_time": True}, 4),
    ],
)
def test_the_ring_holds_a_lag_of_a_second_and_a_half_within_its_memory(
    rate: float, how: dict[str, bool], blocks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[int, int, int]] = []

    def create(capacity: int, channels: int, ahead: int) -> SimpleNamespace:
        made.append((capacity, channels, ahead))
        ring = Ring(capacity, channels, np.empty((0, channels), np.int16))
        return SimpleNamespace(capacity=capacity, channels=channels, ahead=ahead, suits=ring.suits, unlink=int)

    monkeypatch.setattr(SharedRing, "create", create)
    parent = Parent(None, [], FakeDigitizer(**how).capabilities)
    settings = CaptureSettings(rate, 1000, 100)
    block = {10e6: 400_000, 30e6: 1 << 20, 50e6: 1 << 20}.get(rate, 256)
    first = parent._ring_for(settings)
    assert parent._ring_for(settings) is first and made == [(0, 3, blocks * block)]  # the present one serves
    held = parent.ring(5000, settings, None)
    assert held is not first and made[1:] == [(5000, 3, blocks * block)]  # for a reader without a buffer of its own
    assert parent._ring_for(settings) is held and parent.ring(1250, settings, None) is held
    assert parent.ring(1249, settings, None).capacity == 1249 and parent.ring(1250, settings, None).capacity == 1250
    two = Capabilities("fake", CHANNELS[:2], 12, (), None, hardware_trigger=False, real_time=True)
    parent._child.device.capabilities = two  # type: ignore[misc]
    assert parent._ring_for(settings).channels == made[-1][1] == 2


def test_memory_for_another_lag_replaces_the_one_before() -> None:
    parent = Parent(None, [])
    first = parent._ring_for(CaptureSettings(1e6, 10, 1))
    memory = first._memory
    assert first.key == (memory.name, 0, 3, first.ahead)
    assert parent._ring_for(CaptureSettings(1e6, 99, 9)) is parent._ring is first  # it fits
    assert parent._ring_for(CaptureSettings(2e6, 10, 1)) is parent._ring is not first
    assert memory.buf is not None and first.view(0, 5).shape == (5, 3)  # whoever has it still reads it
    del first
    assert memory.buf is None
    parent._forget_ring()
    assert parent._ring is None


@pytest.mark.parametrize("over", [False, True])
def test_a_ring_that_another_child_filled_or_one_that_is_gone_is_replaced(over: bool) -> None:
    parent = Parent(None, [])
    first = parent._ring_for(ONE)
    parent._attached = parent._child if over else SimpleNamespace()  # type: ignore[assignment]
    parent._child.over = over  # type: ignore[misc]
    assert parent._ring_for(ONE) is not first and parent._attached is None


def test_what_is_read_into_the_ring_lies_there_and_stays_until_it_is_overwritten() -> None:
    """The writer of this test is ahead as far as it may, and readers still get what they were told they have."""
    ring = SharedRing.create(300, 2, 200)
    ring.unlink()
    parent = Parent(ring, messages := [])
    at = come = 0
    rng = np.random.default_rng(5)
    while come < 5_000:
        while (most := min(ring.room(at), int(rng.integers(1, 60)))) > 0 and len(messages) < 20:
            view = ring.view(at, most)
            view[:] = (np.arange(at, at + len(view)) % 30_000)[:, None]
            messages.append(BlockReady(5, at, Block(len(view))))
            at += len(view)
        space = ring.space(60)
        space_before = space.copy()
        block = parent.read_into(space, 0.0)
        assert np.array_equal(space, space_before)  # nothing was copied
        ring.commit(block.samples)
        come += block.samples
        assert ring.total == come and ring.oldest <= max(0, come - 300)
        out = np.empty((come - ring.oldest, 2), np.int16)
        ring.copy_into(ring.oldest, out)
        assert np.array_equal(out[:, 1], np.arange(ring.oldest, come) % 30_000)
    ring.close()


def test_a_ring_has_room_for_what_was_read_and_counts_blocks_and_beats(ring: SharedRing) -> None:
    ring.mark_read(1000, 7)
    assert [ring.room(at) for at in (1000, 1001, 1700)] == [700, 699, 0]
    assert ring.blocks_read == 7 and ring.view(1390, 100).shape == (10, 2)  # up to the wrap
    before = ring.beats
    ring.beat()
    assert ring.beats == before + 1


@dataclass(frozen=True)
class Held:
    """A dataclass that holds an array."""

    inside: Any


def test_every_array_of_a_task_or_a_result_is_read_only_again_wherever_it_lies() -> None:
    arrays = [np.zeros(2) for _ in range(8)]
    one, two, three, four, five, six, seven, eight = arrays
    work = partial(print, one, [two, (three,)], key={"a": four, "b": Held(five)})
    _seal((work, Held({"c": [six]}), MappingProxyType({"d": seven}), eight, None, "text", 3))
    assert not any(array.flags.writeable for array in arrays)


def _reported(work: Any, dropped: set[int]) -> tuple[list[_Report], _Report, set[int]]:
    sent: list[_Report] = []
    report = _run(_Task(7, work), SimpleNamespace(send=sent.append), dropped)  # type: ignore[arg-type]
    return sent, report, dropped


def test_a_task_reports_its_progress_twenty_times_a_second_and_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(subprocess_worker.time, "monotonic", lambda: now[0])

    def work(progress: Any, cancelled: Any) -> str:
        assert not cancelled()
        for step in range(11):
            progress("reading", step / 10)
            now[0] += 0.02
        return "done"

    sent, report, _ = _reported(work, {6, 8})
    assert [one.progress for one in sent] == [("reading", share) for share in (0.0, 0.3, 0.6, 0.9)]
    assert {one.number for one in sent} == {7} and report == _Report(7, result="done")


@pytest.mark.parametrize(
    ("error", "ends"),
    [
        (Cancelled(), {"cancelled": True}),
        (AnalysisError("no\nbeat"), {"problem": "no beat"}),
        (RecordingError("a", "gone"), {"problem": "a: gone"}),
        (OSError(28, "No space left on device"), {"problem": "[Errno 28] No space left on device"}),
        (ZeroDivisionError("oh\nno"), {"problem": "a fault of the program: ZeroDivisionError('oh\\nno')"}),
    ],
)
def test_a_task_that_fails_says_why_and_is_no_longer_dropped(error: Exception, ends: dict[str, Any]) -> None:
    def work(progress: Any, cancelled: Any) -> None:
        assert cancelled()
        raise error

    _, report, dropped = _reported(work, {7, 9})
    assert report == _Report(7, **ends) and dropped == {9}


def test_after_its_end_a_worker_works_here(monkeypatch: pytest.MonkeyPatch) -> None:
    worker = SubprocessWorker()
    worker.close()
    worker.start()
    assert child_id(worker) is None
    assert worker.run(lambda progress, cancelled: (progress, cancelled), print, len) == (print, len)


class Waiting(DeviceProcess):
    """The parent's end of a child that sends ``messages``, each at its time, on a clock of its own."""

    def __init__(self, messages: list[tuple[float, Answer]]) -> None:
        self.now, self.messages, self.waits = 100.0, messages, []
        self._process = SimpleNamespace(over=False)  # type: ignore[assignment]
        self.ended: list[float] = []

    def receive(self, timeout_s: float) -> Answer | None:  # type: ignore[override]
        self.waits.append(timeout_s)
        if self.messages and self.messages[0][0] <= self.now + timeout_s:
            at, message = self.messages.pop(0)
            self.now = max(self.now, at)
            return message
        self.now += timeout_s
        return None

    def end(self, patience_s: float = 5.0) -> None:
        self.ended.append(patience_s)


@pytest.mark.parametrize(
    ("messages", "give_up_s", "patience_s", "ends"),
    [
        ([(100.5, Answer(3, None)), (101.9, Answer(4, None))], None, None, "answer"),
        ([(102.3, Answer(4, None))], None, None, "the digitizer does not answer: arm again"),
        ([(100.5, Answer(4, None, DigitizerError("jammed")))], None, None, "jammed"),
        ([(101.9, Answer(4, None))], 100.5, None, "nothing"),
        ([(101.2, Answer(4, None))], 100.5, 1.0, "answer"),
        ([(101.9, Answer(4, None))], 100.5, 1.0, "the arming was given up: arm again: it is started anew"),
        ([(102.3, Answer(4, None))], 101.5, 9.0, "the arming was given up"),  # no longer than without giving up
    ],
)
def test_an_order_is_waited_for_until_its_answer_its_limit_or_a_giving_up(
    messages: list[tuple[float, Answer]], give_up_s: float | None, patience_s: float | None, ends: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    child = Waiting(messages)
    monkeypatch.setattr(device_process, "time", SimpleNamespace(monotonic=lambda: child.now))

    def given_up() -> bool:
        return give_up_s is not None and child.now >= give_up_s - 1e-9

    if ends in ("answer", "nothing"):
        found = child.answer_to(4, 2.0, given_up, patience_s)
        assert (found is None) == (ends == "nothing") and child.ended == []
        assert found is None or found.serial == 4
    else:
        with pytest.raises(DigitizerError, match=ends):
            child.answer_to(4, 2.0, given_up, patience_s)
        assert child.ended == ([] if ends == "jammed" else [0.0])
    assert set(child.waits) == {0.1}  # between two looks for a giving up
    if ends.startswith("the arming"):
        assert child.now == pytest.approx(min(give_up_s or 0.0, 101.0) + 1.0, abs=0.11)


@pytest.mark.parametrize(
    ("code", "how"), [(0, "status 0"), (2, "status 2"), (-1, "killed by signal 1"), (None, "status None")]
)
def test_a_child_that_ended_by_itself_is_told_with_its_status_or_its_signal(
    code: int | None, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken() -> None:
        raise EOFError

    context, child = Context(monkeypatch), Waiting([])
    context.exitcode = code
    child._process = WorkerProcess("digitizer", print)
    child._process.messages = SimpleNamespace(  # type: ignore[assignment]
        poll=lambda timeout_s: True, recv=broken, close=lambda: None
    )
    with pytest.raises(DigitizerError, match=rf"process ended by itself \({how}\): arm again"):
        DeviceProcess.receive(child, 0.0)
    assert context.did[-2:] == [("join", 1.0), "close"] and child.over and child._process.exit_code == code


def test_a_device_tells_its_state_or_the_fault_that_hides_it_anew_each_time() -> None:
    child = Waiting([])
    child._device = DigitizerError("unplugged")
    for _ in range(2):
        with pytest.raises(DigitizerError, match="unplugged"):
            child.device  # noqa: B018 - the reading is what is tested
    child._device = DeviceState(FakeDigitizer().capabilities, FakeDigitizer().setup)
    assert child.device.capabilities == FakeDigitizer().capabilities


class Sent:
    """A process that notes what is sent to it."""

    def __init__(self, fails: bool = False) -> None:
        self.orders: list[Order] = []
        self.fails, self.over = fails, fails

    def send(self, order: Order) -> None:
        if self.fails:
            raise ProcessEnded("broken")
        self.orders.append(order)


def test_orders_are_numbered_and_none_is_sent_to_a_child_that_is_gone() -> None:
    child = Waiting([])
    child._sending, child._serial, child._process = threading.Lock(), 0, Sent()  # type: ignore[assignment]
    settings = CaptureSettings(1e6, 100, 10)
    assert [child.send("prepare"), child.send("arm", settings, ("ring", 5, 2, 3), 9), child.send("stop")] == [1, 2, 3]
    assert child._process.orders == [  # type: ignore[attr-defined]
        Order("prepare", 1), Order("arm", 2, settings, ("ring", 5, 2, 3), 9), Order("stop", 3),
    ]  # fmt: skip
    child._process = Sent(fails=True)  # type: ignore[assignment]
    for ask in (lambda: child.send("stop"), lambda: DeviceProcess.receive(child, 0.0)):
        with pytest.raises(DigitizerError, match="the digitizer's process is gone: arm again"):
            ask()


class Context:
    """Stands for ``multiprocessing``: pipes and one process that notes what is done to it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, alive: bool = False, starts: bool = True) -> None:
        self.did: list[Any] = []
        self.alive, self.starts, self.daemon, self.pid, self.exitcode = alive, starts, False, 77, -9
        self.closed: list[str] = []
        self._ends = iter(("first reads", "first writes", "second reads", "second writes"))
        monkeypatch.setattr(worker_process.multiprocessing, "get_context", lambda kind: self if kind == "spawn" else 0)

    def Pipe(self, duplex: bool) -> tuple[Any, Any]:
        assert not duplex
        return tuple(
            SimpleNamespace(end=end, close=lambda end=end: self.closed.append(end))
            for end in (next(self._ends), next(self._ends))
        )

    def Process(self, target: Any, args: Any, name: str) -> "Context":
        main, given, *ends = args
        assert target is worker_process._run
        self.did.append((main, [*given, *(end.end for end in ends)], name))
        return self

    def start(self) -> None:
        if not self.starts:
            raise OSError("no room for a process")
        self.did.append(("start", self.daemon))  # else it would outlive its parent

    def join(self, longest_s: float) -> None:
        self.did.append(("join", longest_s))

    def is_alive(self) -> bool:
        return self.alive

    def kill(self) -> None:
        self.did.append("kill")

    def close(self) -> None:
        self.did.append("close")


@pytest.mark.parametrize("refused", [False, True])
def test_what_is_left_of_a_stream_is_none_of_the_next(ring: SharedRing, refused: bool) -> None:
    parent, buffer = Parent(ring, [BlockReady(5, 0, Block(7))]), np.zeros((5, 2), np.int16)
    assert parent.read_into(buffer, 0.0).samples == 5

    def answer_to(order: int, *how: object) -> Answer:
        if refused:
            raise DigitizerError("too fast", "choose a lower rate")
        return Answer(8, None, blocks=3)

    parent._arm_s, parent._child.send = 1.0, lambda *order: 8  # type: ignore[method-assign, assignment]
    parent._child.answer_to = answer_to  # type: ignore[method-assign, assignment]
    parent._ring_for = lambda settings: ring  # type: ignore[method-assign]
    if refused:
        with pytest.raises(DigitizerError, match="too fast"):
            parent.arm(ONE)
    else:
        parent.arm(ONE)
        assert (parent._run, parent._blocks) == (8, 3)
    assert parent.read_into(buffer, 0.0) == Block(0, ended=refused)


@pytest.mark.parametrize("alive", [False, True])
def test_a_device_s_process_is_started_with_one_end_of_each_pipe_and_ended_by_force_where_it_does_not_end(
    alive: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    context, waited = Context(monkeypatch, alive), []  # type: ignore[var-annotated]
    monkeypatch.setattr(DeviceProcess, "answer_to", lambda child, *how: waited.append(how))
    made = DeviceProcess("opener", len, 7.0)  # type: ignore[arg-type]
    ends = ["opener", "first reads", "second writes"]
    assert context.did == [(child_module.serve, ends, "levimass digitizer"), ("start", True)]
    assert waited == [(STARTED, 60.0, len), (OPENED, 7.0, len)]
    assert context.closed == ends[1:] and made._process.messages.end == "second reads"  # type: ignore[attr-defined]
    context.did.clear()
    made.end()
    made.end()
    assert made.over and made._process.exit_code == -9
    forced = ["kill", ("join", 5.0)] if alive else []
    assert context.did == [("join", 5.0), *forced, "close"]
    assert context.closed[2:] == ["first writes", "first writes", "second reads"]  # the child is told by the first


def test_a_device_that_does_not_open_leaves_no_process_and_one_that_does_not_start_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def jammed(child: DeviceProcess, serial: int, *how: object) -> None:
        if serial == OPENED:
            raise DigitizerError("jammed")

    context = Context(monkeypatch)
    monkeypatch.setattr(DeviceProcess, "answer_to", jammed)
    with pytest.raises(DigitizerError, match="jammed"):
        DeviceProcess("opener", len, 7.0)  # type: ignore[arg-type]
    assert context.did[-2:] == [("join", 5.0), "close"] and set(context.closed[2:]) == {"first writes", "second reads"}
    Context(monkeypatch, starts=False)
    with pytest.raises(DigitizerError, match="did not start: no room for a process: close other programs"):
        DeviceProcess("opener", len, 7.0)  # type: ignore[arg-type]


def test_a_child_that_dies_during_a_task_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    context, worker = Context(monkeypatch), SubprocessWorker(print)

    def broken(task: object) -> None:
        raise BrokenPipeError(32, "broken")

    for cancelled, fault in ((False, AnalysisError), (True, Cancelled)):
        worker.start()
        worker._process._orders.send = broken  # type: ignore[union-attr, method-assign]
        with pytest.raises(fault):
            worker.run(len, print, lambda cancelled=cancelled: cancelled)  # type: ignore[misc]
        assert context.did[-3:] == [("start", True), ("join", 0.0), "close"] and child_id(worker) is None
        context = Context(monkeypatch)


@pytest.mark.parametrize("alive", [False, True])
def test_a_working_process_is_started_once_and_ended_by_force_where_it_does_not_end(
    alive: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    context, worker = Context(monkeypatch, alive), SubprocessWorker(print)
    worker.start()
    worker.start()
    ends = [print, "first reads", "second writes"]
    assert context.did == [(subprocess_worker._serve, ends, "levimass work"), ("start", True)]
    assert context.closed == ends[1:] and child_id(worker) == 77
    context.did.clear()
    worker.close()
    worker.close()
    worker.start()  # there is none any more
    forced = ["kill", ("join", 5.0)] if alive else []
    assert context.did == [("join", 5.0), *forced, "close"] and child_id(worker) is None
    assert context.closed[2:] == ["first writes", "first writes", "second reads"]


class Told:
    """The parent's end of a pipe: notes what a child sends."""

    def __init__(self) -> None:
        self.messages: list[Any] = []

    def send(self, message: Any) -> None:
        self.messages.append(message)

    def take(self) -> list[Any]:
        taken, self.messages = self.messages, []
        return taken


ONE = CaptureSettings(1e6, 20_000, 2_000)


@pytest.fixture
def memory() -> Iterator[SharedRing]:
    made = SharedRing.create(0, 3, 20_000)
    yield made
    made.unlink()
    made.close()


def _armed(digitizer: FakeDigitizer, memory: SharedRing) -> tuple[_Child, Told]:
    told = Told()
    served = _Child(digitizer, None, told)  # type: ignore[arg-type]
    served._carry_out(Order("arm", 2, ONE, memory.key))
    (answer,) = told.take()
    assert answer == Answer(2, served._device_state(), None, None, 0) and served._run == 2
    return served, told


def test_a_child_fills_the_ring_as_far_as_it_is_read_and_tells_each_block(memory: SharedRing) -> None:
    served, told = _armed(FakeDigitizer(gaps={7_000: 11}), memory)
    for _ in range(7):
        served._turn()
    known = [(0, 5_000, 0), (5_000, 2_000, 0), (7_000, 5_000, 11), (12_000, 5_000, 0), (17_000, 3_000, 0)]
    assert [(m.run, m.first, m.block.samples, m.block.lost_before) for m in told.take()] == [(2, *one) for one in known]
    assert memory.beats == 7  # though two of the turns found the ring full
    assert np.array_equal(memory.view(0, 20_000), np.concatenate((samples(0, 7_000), samples(7_011, 13_000))))
    memory.mark_read(19_999, 4)
    served._turn()
    assert told.take() == []  # a block is filled where there is room for it
    memory.mark_read(20_000, 5)
    served._turn()
    (message,) = told.take()
    assert (message.first, message.block.samples) == (20_000, 5_000)
    served._carry_out(Order("arm", 9, ONE, at=25_000))  # in the same memory, from where the reader is
    assert told.take() == [Answer(9, served._device_state(), None, None, 6)]
    assert (memory.room(25_000), memory.blocks_read) == (20_000, 6)


def test_before_a_device_is_armed_its_child_lets_go_of_the_memory_before_and_clears_up(
    memory: SharedRing, monkeypatch: pytest.MonkeyPatch
) -> None:
    did: list[str] = []

    class Device(FakeDigitizer):
        def arm(self, settings: CaptureSettings) -> None:
            did.append("arm")
            super().arm(settings)

    monkeypatch.setattr(child_module, "gc", SimpleNamespace(collect=lambda: did.append("gc")))
    served, told = _armed(Device(), memory)
    served._turn()
    before, other = served._ring, SharedRing.create(0, 3, 30_000)
    served._carry_out(Order("arm", 5, ONE, other.key))
    assert did == ["gc", "arm"] * 2 and before is not None and before._memory.buf is None
    served._turn()
    answer, ready = told.take()[1:]
    assert (answer.blocks, ready.run, ready.first, other.room(5_000)) == (0, 5, 0, 25_000)  # both count anew
    other.unlink()
    other.close()


def test_a_child_whose_ring_is_full_looks_again_after_two_milliseconds(
    memory: SharedRing, monkeypatch: pytest.MonkeyPatch
) -> None:
    served, told = _armed(FakeDigitizer(), memory)
    slept: list[float] = []
    monkeypatch.setattr(child_module, "time", SimpleNamespace(sleep=slept.append))
    for _ in range(6):
        served._turn()
    assert len(told.take()) == 4 and slept == [0.002, 0.002]


class Exit:
    """Stands for ``os._exit``: leaves the main thread, and notes which thread asked for it and how."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.asked: list[tuple[bool, int]] = []
        monkeypatch.setattr(os, "_exit", self)

    def __call__(self, status: int) -> None:
        main = threading.current_thread() is threading.main_thread()
        self.asked.append((main, status))
        if main:
            raise SystemExit


def _until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


@pytest.mark.parametrize("simulated", [False, True])
@pytest.mark.parametrize("ends", ["closed", "parent gone", "pipe broken", "bug"])
def test_a_child_serves_until_it_is_closed_or_its_parent_is_gone_and_closes_its_device(
    ends: str, simulated: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    leave, told, did, lowered, slept = Exit(monkeypatch), Told(), [], [], []  # type: ignore[var-annotated]
    monkeypatch.setattr(child_module, "time", SimpleNamespace(sleep=slept.append))
    monkeypatch.setattr(child_module, "lower_priority", lowered.append)
    monkeypatch.setattr(child_module, "gc", SimpleNamespace(freeze=lambda: did.append("freeze")))
    given = [Order("prepare", 2), *([Order("close", 3)] if ends == "closed" else [])]
    sent = told.send

    def recv() -> Order:
        if given and given[0].kind == "prepare":
            return given.pop(0)
        _until(lambda: len(told.messages) == 2 or bool(leave.asked))  # once the first order was carried out
        if not given:
            raise EOFError
        return given.pop(0)

    def send(message: Any) -> None:
        if message.serial == 2 and ends in ("pipe broken", "bug"):
            raise BrokenPipeError if ends == "pipe broken" else ValueError("cannot be pickled")
        sent(message)

    class Device(FakeDigitizer):
        def prepare(self) -> None:
            did.append("prepare")

        def close(self) -> None:
            did.append("close")

        def stop(self) -> None:
            did.append("stop")

    told.send = send  # type: ignore[method-assign]
    served = _Child(Device(simulated=simulated), SimpleNamespace(recv=recv), told)  # type: ignore[arg-type]
    with pytest.raises(SystemExit):
        served.work()
    _until(lambda: len(leave.asked) == 2)
    status = {"pipe broken": 1, "bug": 2}.get(ends, 0)
    assert sorted(leave.asked) == [(False, 1), (True, status)] and slept == [3.0]
    assert did[:2] == ["prepare", "freeze"] and did.count("close") == 1
    assert did.count("stop") == (2 if ends == "closed" else 1)  # by the order, and where the parent is gone
    serials = [message.serial for message in told.messages]
    assert serials == ([OPENED, 2] if status == 0 else [OPENED])
    assert lowered == ([5] if simulated else []) and ("cannot be pickled" in capfd.readouterr().err) == (ends == "bug")


def test_a_device_that_cannot_be_opened_is_told_after_the_start() -> None:
    told = Told()

    def opener() -> Any:
        raise DigitizerError("jammed", "oil it")

    child_module.serve(opener, None, told)  # type: ignore[arg-type]
    started, opened = told.messages
    assert started == Answer(STARTED, None)
    assert (opened.serial, opened.device, str(opened.fault)) == (OPENED, None, "jammed: oil it")


def _sum_of(array: np.ndarray, *, progress: Any, cancelled: Any) -> tuple[int, bool, bool]:
    return int(array.sum()), array.flags.writeable, cancelled()


def test_a_working_child_is_warm_before_it_says_so_does_its_tasks_in_turn_and_ends_with_its_parent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    leave, did, reports = Exit(monkeypatch), [], []  # type: ignore[var-annotated]
    monkeypatch.setattr(subprocess_worker, "lower_priority", lambda steps: did.append(("priority", steps)))
    monkeypatch.setattr(
        subprocess_worker, "gc", SimpleNamespace(freeze=lambda: did.append("freeze"), collect=lambda: did.append("gc"))
    )
    given: list[Any] = [8, _Task(7, partial(_sum_of, np.arange(3))), _Task(8, partial(_sum_of, np.arange(4)))]

    def recv() -> Any:
        if not given:
            raise EOFError
        return given.pop(0)

    def send(report: _Report) -> None:
        if report.result == "unpicklable":
            raise TypeError("no pickle")
        reports.append(report)
        if len(reports) == 3:
            raise BrokenPipeError(32, "the parent is gone")

    def warm() -> None:
        did.append("warm")
        raise RuntimeError  # kernels are then compiled at their first call

    subprocess_worker._serve(warm, SimpleNamespace(recv=recv), SimpleNamespace(send=send))  # type: ignore[arg-type]
    _until(lambda: len(leave.asked) == 1)
    assert leave.asked == [(False, 0)]
    assert reports == [_Report(None), _Report(7, result=(3, False, False)), _Report(8, result=(6, False, True))]
    assert did == [("priority", 10), "warm", "freeze", "gc"]


def test_a_child_that_is_to_give_up_has_five_seconds_and_is_then_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    now, ended, told = [100.0], [], []  # type: ignore[var-annotated]
    monkeypatch.setattr(subprocess_worker, "time", SimpleNamespace(monotonic=lambda: now[0]))

    def receive(timeout_s: float) -> None:
        assert timeout_s == 0.02
        now[0] += 0.5

    process, task = SimpleNamespace(send=told.append, receive=receive), _Task(4, len)
    process.end = lambda patience_s: ended.append((now[0], patience_s))
    with pytest.raises(Cancelled):
        SubprocessWorker._await(process, task, print, lambda: now[0] >= 110.0)  # type: ignore[arg-type]
    assert told == [task, 4] and ended == [(110.0 + 5.5, 0.0)]


def test_a_child_announces_no_more_blocks_than_its_pipe_holds(
    memory: SharedRing, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child_module, "MAX_BLOCKS", 2)
    served, told = _armed(FakeDigitizer(), memory)
    for _ in range(4):
        served._turn()
    assert len(told.take()) == 2
    memory.mark_read(0, 1)
    for _ in range(3):
        served._turn()
    assert len(told.take()) == 1


def test_a_fault_nonsense_and_an_end_are_told_and_end_the_stream(memory: SharedRing) -> None:
    gone = DigitizerError("unplugged", "plug it in")

    def of(answer: Any) -> Any:
        def told(fake: FakeDigitizer, at: int) -> Block:
            if isinstance(answer, Exception):
                raise answer
            return answer

        return told

    nonsense = DigitizerError("the digitizer sent nonsense", "stop it, re-plug it, and report this")
    bug = DigitizerError("unexpected: ValueError('a bug')", "arm again; report this if it happens again")
    for answer, fault in ((gone, gone), (Block(10**6), nonsense), (Block(-1), nonsense), (ValueError("a bug"), bug)):
        served, told = _armed(FakeDigitizer(before_block=of(answer)), memory)
        served._turn()
        (message,) = told.take()
        assert (message.run, message.block, str(message.fault)) == (2, Block(0, ended=True), str(fault))
        assert served._run is None
    for answer, said, goes_on in (
        (Block(0), 0, True),
        (Block(0, fired=True), 1, True),
        (Block(3, ended=True), 1, False),
    ):
        served, told = _armed(FakeDigitizer(before_block=of(answer)), memory)
        served._turn()
        assert (len(told.messages), served._run == 2) == (said, goes_on)
        if not goes_on:  # the next shot may have other capabilities
            assert told.messages[0].device == served._device_state()


def test_a_stop_that_comes_while_a_device_is_armed_or_its_ring_is_full_is_heeded(memory: SharedRing) -> None:
    digitizer = FakeDigitizer()
    served = _Child(digitizer, None, Told())  # type: ignore[arg-type]
    served._stopped = 3
    served._carry_out(Order("arm", 2, ONE, memory.key))
    assert digitizer.armed == 1 and not digitizer.running.is_set()
    served._carry_out(Order("arm", 4, ONE))
    assert digitizer.running.is_set() and served._run == 4
    for _ in range(4):
        served._turn()
    assert memory.room(served._at) == 0
    served._stopped = 5
    served._turn()
    assert served._run is None
    for kind, answered in (("defaults", digitizer.default_settings()), ("prepare", None)):
        told = Told()
        served._answers = told  # type: ignore[assignment]
        served._carry_out(Order(kind, 6))
        assert told.take() == [Answer(6, served._device_state(), None, answered, served._blocks)]
    refused = _Child(FakeDigitizer(), None, told := Told())  # type: ignore[arg-type]
    refused._carry_out(Order("arm", 1, CaptureSettings(5.0, 10, 1), memory.key))
    (answer,) = told.take()
    assert str(answer.fault) == "the fake knows one rate: choose 1 MS/s" and refused._run is None


@pytest.mark.skipif(not shared_ring._FILES.is_dir(), reason="the memory is no file here")
def test_memory_is_had_before_it_is_used_or_refused_in_one_line_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else Linux ends the process that touches a page that there is no room for."""
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(os, "posix_fallocate", lambda file, start, size: asked.append((start, size)))
    made = SharedRing.create(400_000, 2, 600_000)
    assert asked == [(0, 64 + 4_000_000)] and (made.capacity, made.channels, made.ahead) == (400_000, 2, 600_000)
    made.unlink()
    made.unlink()
    made.close()
    names: list[str] = []

    def full(file: int, start: int, size: int) -> None:
        names.append(os.path.basename(os.readlink(f"/proc/self/fd/{file}")))
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(DigitizerError) as refusal:
        SharedRing.create(400_000, 2, 600_000)
    assert refusal.value.what == "4 MB of shared memory cannot be had (No space left on device)"
    assert len(names) == 1 and not (shared_ring._FILES / names[0]).exists()


def test_a_worker_is_waited_for_until_it_is_warm_or_the_waiting_is_given_up_or_it_has_ended() -> None:
    worker, polls = SubprocessWorker(), []
    worker.await_ready(lambda: False)  # there is none
    ends: list[Any] = [None, None, _Report(None)]

    def receive(timeout_s: float) -> Any:
        polls.append(timeout_s)
        end = ends.pop(0)
        if isinstance(end, Exception):
            raise end
        return end

    worker._process = SimpleNamespace(receive=receive)  # type: ignore[assignment]
    worker.await_ready(lambda: False)
    assert len(polls) == 3 and ends == []
    ends = [None, ProcessEnded()]
    worker.await_ready(lambda: False)
    assert len(polls) == 5
    ends = [None, _Report(None)]
    with pytest.raises(Cancelled):
        worker.await_ready(lambda: True)
    assert len(polls) == 6


def test_a_device_has_as_long_to_open_as_is_allowed_up_to_a_minute_and_the_bench_always_a_minute(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(subprocess_digitizer, "SubprocessDigitizer", lambda opener, patience_s: (opener, patience_s))
    for source, allowed, patience_s in (("scpi:host", 5.0, 5.0), ("scpi:host", 100.0, 60.0), ("bench", 5.0, 60.0)):
        opener, found = open_in_subprocess(source, arm_s=allowed)  # type: ignore[misc]
        assert found == patience_s and (opener.func, opener.args) == (open_source, (source,))
    assert open_in_subprocess("hantek6022")[1] == 60.0  # type: ignore[index]


def test_each_request_has_its_time_and_a_child_that_is_gone_is_started_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    settings_asked = CaptureSettings(2e6, 7, 3)

    def answer_to(order: int, limit_s: float, give_up: Any = None, patience_s: float | None = None) -> Answer:
        asked.append((limit_s, give_up is not None and give_up(), patience_s))
        return Answer(order, None, None, settings_asked, 3)

    class Started(SimpleNamespace):
        def __init__(self, opener: Any, give_up: Any, open_s: float) -> None:
            asked.append((opener, give_up(), open_s))
            device = SimpleNamespace(capabilities=FakeDigitizer().capabilities)
            super().__init__(device=device, over=False, answer_to=answer_to, end=lambda: asked.append("end"))
            self.send = lambda *order: asked.append(order) or 8

    made = SimpleNamespace(
        key=("ring", 0, 3, 1_500_000),
        total=70,
        channels=3,
        ahead=1_520_000,
        unlink=lambda: asked.append("unlink"),
    )
    monkeypatch.setattr(SharedRing, "create", lambda *_: made)
    monkeypatch.setattr(subprocess_digitizer, "DeviceProcess", Started)
    opened = SubprocessDigitizer("opener", 12.0)  # type: ignore[arg-type]
    assert asked == [("opener", False, 12.0)]
    asked.clear()
    opened.stop()
    opened.prepare()  # given up at once
    assert asked == [("stop",), ("prepare",), (300.0, True, None)]
    asked.clear()
    assert opened.default_settings() == settings_asked and asked == [("defaults",), (12.0, False, None)]
    asked.clear()
    opened.arm(ONE)
    assert asked == [("arm", ONE, made.key, 70), (12.0, False, 5.0), "unlink"] and (opened._run, opened._blocks) == (
        8,
        3,
    )
    opened._child.over = True
    for ask, known in (
        (opened.default_settings, [("opener", False, 12.0), ("defaults",), (12.0, False, None)]),
        (
            lambda: opened.arm(ONE),
            [
                ("opener", False, 12.0),
                ("prepare",),
                (300.0, False, 5.0),
                "unlink",
                ("arm", ONE, made.key, 70),
                (12.0, False, 5.0),
            ],
        ),
    ):
        asked.clear()
        opened._child.over = True
        ask()
        assert asked[: len(known)] == known
    asked.clear()
    opened.close()
    assert asked == [("close",), "end", "unlink"]
    with pytest.raises(DigitizerError, match="the digitizer was closed: select the source again"):
        opened.arm(ONE)
