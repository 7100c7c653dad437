"""The two ends of a subprocess, without the process: blocks cut into a reader's pieces, memory for a lag, reports."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.shot.shot import AnalysisError, Cancelled
from instrument.devices.digitizer import Block, Capabilities, CaptureSettings, DigitizerError
from instrument.files.recording_error import RecordingError
from instrument.process import subprocess_worker
from instrument.process.child import BlockReady
from instrument.process.shared_ring import SharedRing
from instrument.process.subprocess_digitizer import SubprocessDigitizer
from instrument.process.subprocess_worker import SubprocessWorker, _Report, _run, _seal, _Task
from tests.instrument.fake_digitizer import CHANNELS, FakeDigitizer

CAPACITY = 700


@pytest.fixture(scope="module")
def ring() -> Iterator[SharedRing]:
    made = SharedRing.create(CAPACITY, 2)
    made.unlink()
    yield made
    made.close()


class Parent(SubprocessDigitizer):
    """A parent whose child has sent ``messages``."""

    def __init__(self, ring: SharedRing | None, messages: list[Any], able: Capabilities | None = None) -> None:
        self._exchange = threading.RLock()
        self._stopped, self._closed = threading.Event(), False
        self._ring, self._run, self._block, self._read_of_block = ring, 5, None, 0
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
    made: list[tuple[int, int]] = []

    def create(capacity: int, channels: int) -> SimpleNamespace:
        made.append((capacity, channels))
        return SimpleNamespace(name="it", capacity=capacity, channels=channels, unlink=int, close=int)

    monkeypatch.setattr(SharedRing, "create", create)
    parent = Parent(None, [], FakeDigitizer(**how).capabilities)
    settings = CaptureSettings(rate, 1000, 100)
    block = {10e6: 400_000, 30e6: 1 << 20, 50e6: 1 << 20}.get(rate, 256)
    assert parent._ring_for(settings) == ("it", blocks * block, 3)
    assert parent._ring_for(settings) is None and made == [(blocks * block, 3)]  # the present one serves
    two = Capabilities("fake", CHANNELS[:2], 12, (), None, hardware_trigger=False, real_time=True)
    parent._child.device.capabilities = two  # type: ignore[misc]
    assert parent._ring_for(settings) is not None and made[-1][1] == 2


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
    assert worker.child_id is None
    assert worker.run(lambda progress, cancelled: (progress, cancelled), print, len) == (print, len)
