"""The queue of USB transfers, over a stand-in for libusb that sends a known sequence of bytes."""

import ctypes
import gc
import threading
import time
import weakref
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from instrument.devices.bulk_stream import (
    _CANCELLED,
    _COMPLETED,
    _NO_DEVICE,
    _STALL,
    BulkStream,
    _Transfer,
    transfer_size,
)
from instrument.devices.digitizer import DigitizerError

BYTES_PER_S = 2e6
SIZE = transfer_size(BYTES_PER_S)
NUMBERED = np.arange(SIZE).astype(np.uint8)  # what a transfer brings, its first byte the number of the transfer


class Libusb:
    """Finish the queued transfers in order, one at each call for events, with the statuses of ``plan``."""

    def __init__(self, plan: dict[int, int]) -> None:
        self.plan = plan
        self.made: list[Any] = []
        self.queued: deque[Any] = deque()
        self.queued_at_halt: list[int] = []
        self.most_queued = self.brought = self.freed = self.halts_cleared = 0
        # ctypes' functions carry the types of their arguments as attributes, which bound methods cannot
        for name in ("alloc_transfer", "submit_transfer", "cancel_transfer", "free_transfer", "clear_halt"):
            method = getattr(self, name)
            setattr(self, f"libusb_{name}", lambda *given, method=method: method(*given))
        self.libusb_handle_events_timeout_completed = self.finish_one

    def device(self) -> Any:
        """Return a device as pyusb holds it."""
        backend = SimpleNamespace(lib=self, ctx=None)
        return SimpleNamespace(_ctx=SimpleNamespace(backend=backend, handle=SimpleNamespace(handle=None)))

    def alloc_transfer(self, _packets: int) -> Any:
        self.made.append(_Transfer())
        return ctypes.pointer(self.made[-1])

    def submit_transfer(self, pointer: Any) -> int:
        asked = pointer.contents
        assert (asked.endpoint, asked.type, asked.flags, asked.timeout) == (0x86, 2, 0, 0)  # bulk, without a limit
        assert asked.length >= SIZE and asked.buffer and asked.num_iso_packets == 0
        self.queued.append(pointer)
        self.most_queued = max(self.most_queued, len(self.queued))
        return 0

    def cancel_transfer(self, pointer: Any) -> int:
        return 0

    def free_transfer(self, pointer: Any) -> None:
        self.freed += 1

    def clear_halt(self, _handle: Any, endpoint: ctypes.c_ubyte) -> int:
        assert endpoint.value == 0x86
        self.queued_at_halt.append(len(self.queued))
        self.halts_cleared += 1
        return 0

    def finish_one(self, _context: Any, longest: Any, *_: Any) -> int:
        assert (longest._obj.tv_sec, longest._obj.tv_usec) == (0, 50_000)
        time.sleep(1e-4)
        pointer = self.queued.popleft()
        transfer = pointer.contents
        transfer.status = self.plan.get(self.brought, _COMPLETED)
        transfer.actual_length = 0
        if transfer.status == _COMPLETED:
            content = NUMBERED + np.uint8(self.brought % 256)
            ctypes.memmove(transfer.buffer, content.ctypes.data, content.size)
            transfer.actual_length = content.size
        self.brought += 1
        transfer.callback(pointer)
        return 0


def read(libusb: Libusb, chunks: int) -> tuple[list[int], list[int], DigitizerError | None]:
    """Return the first byte of each chunk, the places before which something was lost, and the fault at the end."""
    stream = BulkStream(libusb.device(), 0x86, BYTES_PER_S, "scope")
    stream.start()
    assert stream._thread is not None and stream._thread.daemon and stream._thread.name == "usb scope"
    firsts, lost, fault = [], [], None
    try:
        for place in range(chunks):
            chunk = stream.take(5.0)
            assert chunk is not None
            assert np.array_equal(chunk.codes, NUMBERED + chunk.codes[0])
            firsts.append(int(chunk.codes[0]))
            if chunk.lost_before:
                lost.append(place)
    except DigitizerError as error:
        fault = error
    stream.stop()
    assert libusb.freed == len(libusb.made) and not libusb.queued
    return firsts, lost, fault


def test_every_byte_comes_in_order_and_several_transfers_are_always_queued() -> None:
    libusb = Libusb({})
    assert read(libusb, 100) == (list(range(100)), [], None)
    assert libusb.most_queued == len(libusb.made) == 32


def test_after_a_stall_the_halt_is_cleared_and_the_loss_is_flagged_once() -> None:
    libusb = Libusb({10: _STALL})
    firsts, lost, fault = read(libusb, 100)
    assert firsts == [n for n in range(101) if n != 10] and fault is None
    assert libusb.halts_cleared == 1 and libusb.queued_at_halt == [0]  # with one queued it would halt again
    assert len(lost) == 1


def test_a_device_that_is_gone_by_the_time_its_halt_is_cleared_is_told_as_unplugged() -> None:
    libusb = Libusb({10: _STALL})
    libusb.libusb_clear_halt = lambda *_: -4  # type: ignore[attr-defined]
    firsts, lost, fault = read(libusb, 100)
    assert (firsts[:10], lost) == (list(range(10)), []) and fault is not None
    assert str(fault) == "scope was unplugged: plug it in again and re-arm"


def test_a_device_that_is_unplugged_is_told_after_what_came_before() -> None:
    firsts, lost, fault = read(Libusb({number: _NO_DEVICE for number in range(20, 200)}), 100)
    assert (firsts, lost) == (list(range(20)), [])
    assert "was unplugged" in str(fault)


def test_after_a_fault_what_is_under_way_is_waited_for_and_nothing_is_queued_again() -> None:
    libusb = Libusb({20: _NO_DEVICE})
    stream = BulkStream(libusb.device(), 0x86, BYTES_PER_S, "scope")
    stream.start()
    assert stream._thread is not None
    stream._thread.join(5.0)  # it ends before anybody asks it to stop
    assert not stream._thread.is_alive() and not libusb.queued
    assert libusb.brought == 20 + 32  # those that were queued
    firsts = [int(chunk.codes[0]) for _ in range(51) if (chunk := stream.take(0.0)) is not None]
    assert firsts == [n for n in range(52) if n != 20]
    with pytest.raises(DigitizerError, match="was unplugged"):
        stream.take(0.0)
    stream.stop()
    assert libusb.freed == len(libusb.made)


def test_three_stalls_in_a_row_are_borne_and_any_number_with_data_between_them() -> None:
    in_a_row = {number: _STALL for number in range(10, 13)}
    firsts, lost, fault = read(Libusb(in_a_row), 60)
    assert fault is None and len(firsts) == 60 and len(lost) >= 1
    apart = {number: _STALL for number in range(40, 40 + 6 * 80, 80)}
    firsts, lost, fault = read(Libusb(apart), 500)
    assert fault is None and len(lost) == 6
    firsts, lost, fault = read(Libusb({number: _STALL for number in range(10, 500)}), 60)
    assert firsts == list(range(10)) and fault is not None and "keeps refusing to send" in fault.what


@pytest.mark.parametrize(("bytes_per_s", "size"), [(0.0, 8 << 10), (2e6, 64 << 10), (30e6, 1 << 20), (1e9, 1 << 20)])
def test_a_transfer_holds_about_20_ms_between_8_kib_and_1_mib(bytes_per_s: float, size: int) -> None:
    assert transfer_size(bytes_per_s) == size


class Silent(Libusb):
    """Bring nothing; what is cancelled ends as cancelled."""

    def __init__(self) -> None:
        super().__init__({})
        self.cancelled = 0

    def cancel_transfer(self, pointer: Any) -> int:
        self.cancelled += 1
        return 0

    def finish_one(self, *_: Any) -> int:
        time.sleep(1e-3)
        if self.cancelled > 0:
            self.cancelled -= 1
            pointer = self.queued.popleft()
            pointer.contents.status, pointer.contents.actual_length = _CANCELLED, 0
            pointer.contents.callback(pointer)
        return 0


def test_a_reader_that_waits_for_a_silent_device_is_woken_at_once() -> None:
    """Otherwise a stop would last as long as the reader is willing to wait."""
    libusb = Silent()
    stream = BulkStream(libusb.device(), 0x86, BYTES_PER_S, "scope")
    stream.start()
    assert stream.take(0.01) is None
    with ThreadPoolExecutor(1) as reader:
        waiting = reader.submit(stream.take, 60.0)
        time.sleep(0.1)
        assert not waiting.done()
        stream.wake()
        assert waiting.result(10.0) is None
    stream.stop()
    assert libusb.freed == len(libusb.made) and not libusb.queued


class Late(Libusb):
    """Bring nothing until it is let go."""

    def __init__(self, plan: dict[int, int]) -> None:
        super().__init__(plan)
        self.go = threading.Event()

    def finish_one(self, *given: Any) -> int:
        return super().finish_one(*given) if self.go.wait(0.01) else 0


@pytest.mark.parametrize("brings", ["bytes", "stalls", "unplugged"])
def test_a_reader_that_waits_has_bytes_or_a_fault_as_soon_as_they_come(brings: str) -> None:
    statuses = {"bytes": _COMPLETED, "stalls": _STALL, "unplugged": _NO_DEVICE}
    libusb = Late({number: statuses[brings] for number in range(500)})
    stream = BulkStream(libusb.device(), 0x86, BYTES_PER_S, "scope")
    stream.start()
    with ThreadPoolExecutor(1) as reader:
        waiting = reader.submit(stream.take, 60.0)
        time.sleep(0.05)
        assert not waiting.done()
        libusb.go.set()
        ended = waiting.exception(10.0)
        if brings == "bytes":
            assert waiting.result().codes[0] == 0  # type: ignore[union-attr]
        else:
            assert isinstance(ended, DigitizerError) and brings in str(ended).replace("stalled", "stalls")
    stream.stop()
    assert libusb.freed == len(libusb.made)


def test_buffers_that_the_kernel_may_still_fill_are_kept_though_nobody_holds_the_stream() -> None:
    """The thread that reads events hangs in the kernel: memory that was freed would be written into."""
    libusb = Silent()
    stream = BulkStream(libusb.device(), 0x86, BYTES_PER_S, "scope")
    stream.start()
    waited: list[float] = []
    real, hung = stream._thread, SimpleNamespace(join=lambda timeout: waited.append(timeout), is_alive=lambda: True)
    stream._thread = hung  # type: ignore[assignment]
    stream.stop()
    assert (waited, libusb.freed) == ([5.0], 0)
    assert real is not None
    real.join(5.0)
    seen = weakref.ref(stream)
    del stream
    gc.collect()
    assert seen() is not None and libusb.freed == 0


def test_a_reader_that_is_late_loses_what_no_transfer_was_queued_for_and_that_is_flagged() -> None:
    """All transfers are parked once more than 64 MiB wait; they are queued again when half of it is taken."""
    libusb = Libusb({})
    stream = BulkStream(libusb.device(), 0x86, 1e9, "scope")
    megabyte = transfer_size(1e9)
    NUMBERED.resize(megabyte, refcheck=False)  # what a transfer brings
    try:
        stream.start()
        end = time.monotonic() + 20.0
        while stream._in_flight and time.monotonic() < end:
            time.sleep(0.01)
        waiting = libusb.brought
        assert waiting == 64 + 12  # those in flight when the room was spent came all the same
        for taken in range(waiting - 31):
            chunk = stream.take(0.0)
            assert chunk is not None and not chunk.lost_before and chunk.codes[0] == taken
            assert libusb.brought == waiting or taken == waiting - 32
        lost = []
        while len(lost) < 40:
            chunk = stream.take(5.0)
            assert chunk is not None
            lost.append(chunk.lost_before)
        assert lost.index(True) == 31 and sum(lost) == 1
    finally:
        stream.stop()
        NUMBERED.resize(SIZE, refcheck=False)
    assert libusb.freed == len(libusb.made) == 12


@pytest.mark.parametrize(
    ("accepted", "code", "fault"),
    [
        (0, -4, "scope was unplugged: plug it in again and re-arm"),
        (0, -11, r"scope: a USB transfer was refused \(libusb -11\): re-plug it"),
        (1, -4, "scope was unplugged"),
        (1, -11, None),  # the system grants fewer transfers than were asked for: they do
    ],
)
def test_transfers_that_are_not_accepted(accepted: int, code: int, fault: str | None) -> None:
    libusb = Silent()
    libusb.libusb_submit_transfer = lambda pointer: (  # type: ignore[attr-defined]
        code if len(libusb.queued) >= accepted else libusb.submit_transfer(pointer)
    )
    stream = BulkStream(libusb.device(), 0x86, BYTES_PER_S, "scope")
    with pytest.raises(DigitizerError, match=fault) if fault else nullcontext():
        stream.start()
        assert stream.take(0.0) is None
    stream.stop()
    assert len(libusb.made) == 32 and libusb.freed == 32


def test_without_memory_for_a_transfer_nothing_is_queued() -> None:
    libusb = Silent()
    libusb.libusb_alloc_transfer = lambda _packets: None  # type: ignore[attr-defined]
    with pytest.raises(DigitizerError, match="no USB transfer could be queued: re-plug it"):
        BulkStream(libusb.device(), 0x86, BYTES_PER_S, "scope").start()
