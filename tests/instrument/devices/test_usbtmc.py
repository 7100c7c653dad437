"""USBTMC, byte by byte on a scripted bus, and the SCPI driver over it."""

import errno
import struct
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
import usb.core

from instrument.devices import usb_bus, usbtmc
from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.devices.scpi import ScpiOscilloscope
from instrument.devices.scpi import _link as _link_of
from instrument.devices.scpi_links import Cancelled, Stalled
from instrument.devices.usbtmc import MAX_REQUEST_BYTES, UsbtmcTransport, find_instruments
from tests.instrument.devices.scpi_emulator import EmulatedScope
from tests.instrument.devices.scripted_usb import BulkIn, BulkOut, ClearHalt, In, Plugged, ScriptedUsb
from tests.instrument.devices.test_scpi import take

IN, OUT = 0x82, 0x03
TIMED_OUT = usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)


def _plugged(vendor: int = 0x1AB1, product: int = 0x04CE) -> Plugged:
    return Plugged(vendor, product, interface_class=(0xFE, 3, 1), endpoints=((IN, 2), (OUT, 2), (0x81, 3)))


def _link(script: list[Any]) -> tuple[ScriptedUsb, UsbtmcTransport]:
    bus = ScriptedUsb([_plugged()])
    (device,) = find_instruments(bus)
    link = UsbtmcTransport(device)
    bus.script = script
    return bus, link


def _command(tag: int, text: bytes) -> BulkOut:
    message = struct.pack("<BBBBIBBBB", 1, tag, 255 - tag, 0, len(text), 1, 0, 0, 0) + text
    return BulkOut(OUT, message + bytes(-len(message) % 4))


def _ask(tag: int, size: int) -> BulkOut:
    return BulkOut(OUT, struct.pack("<BBBBIBBBB", 2, tag, 255 - tag, 0, size, 0, 0, 0, 0))


def _answer(tag: int, text: bytes, *, end: bool = True, size: int = 1 << 16, told: int | None = None) -> BulkIn:
    head = struct.pack("<BBBBIBBBB", 2, tag, 255 - tag, 0, len(text) if told is None else told, end, 0, 0, 0)
    message = head + text
    return BulkIn(IN, (12 + size + 3) // 4 * 4, message + bytes(-len(message) % 4))


def test_a_question_and_its_answer() -> None:
    bus, link = _link([_command(1, b"*IDN?\n"), _ask(2, 1 << 16), _answer(2, b"RIGOL,DS1\n")])
    assert link.query("*IDN?") == "RIGOL,DS1"
    bus.finish()
    link.close()
    assert (bus.opened, bus.claimed) == (0, [])


def test_an_answer_in_parts_after_an_empty_packet() -> None:
    bus, link = _link(
        [
            *(_command(1, b"A?\n"), _ask(2, 1 << 16), BulkIn(IN, 65548, b""), _answer(2, b"ab", end=False)),
            *(_ask(3, 1 << 16), _answer(3, b"cde\n")),
        ]
    )
    assert link.query("A?", 2.0) == "abcde"
    bus.finish()
    reads = [limit for limit in bus.timeouts_ms if limit != 3000]
    assert len(reads) == 3 and all(1500 < limit <= 2000 for limit in reads)


def test_tags_count_to_255_and_begin_again_at_1() -> None:
    bus, link = _link([_command(tag, b"X\n") for tag in (*range(1, 256), 1, 2)])
    for _ in range(257):
        link.write("X")
    bus.finish()


def test_a_block_is_fetched_in_requests_of_at_most_a_mebibyte() -> None:
    content = bytes(range(256)) * 6144  # 1.5 MiB
    message = b"#9%09d" % len(content) + content + b"\n"
    first = MAX_REQUEST_BYTES
    second = len(message) - 1 - first + 64
    bus, link = _link(
        [
            *(_command(1, b"D?\n"), _ask(2, first), _answer(2, message[:first], end=False, size=first)),
            *(_ask(3, second), _answer(3, message[first:-6], end=False, size=second)),
            *(_ask(4, 5 + 64), _answer(4, message[-6:], size=5 + 64)),
        ]
    )
    assert 12 + first == 1 << 20
    assert link.query_block("D?", len(content)) == content
    bus.finish()


def test_the_line_end_after_a_block_is_fetched_and_the_block_begins_after_its_head() -> None:
    block = b"DAT2,#15abcde"
    bus, link = _link(
        [
            *(_command(1, b"D?\n"), _ask(2, 8 + 64), _answer(2, block, end=False, size=72)),
            *(_ask(3, 64), _answer(3, b"\n", size=64)),
        ]
    )
    assert link.query_block("D?", 8) == b"abcde"
    bus.finish()


@pytest.mark.parametrize(("came", "kept"), [(b"#19abcd", b"abcd"), (b"#1", b"")])
def test_an_answer_that_ends_early_or_stalls_gives_the_bytes_of_its_block(came: bytes, kept: bytes) -> None:
    bus, link = _link([_command(1, b"D?\n"), _ask(2, 9 + 64), _answer(2, came, size=73)])
    with pytest.raises(Stalled, match=r"ended its answer to D\? early: re-arm") as stalled:
        link.query_block("D?", 9)
    assert stalled.value.received == kept
    bus.finish()
    left = 9 if came == b"#1" else 12 - len(came)
    bus, link = _link(
        [
            *(_command(1, b"D?\n"), _ask(2, 9 + 64), _answer(2, came, end=False, size=73)),
            *(_ask(3, left + 64), BulkIn(IN, (12 + left + 64 + 3) // 4 * 4, TIMED_OUT)),
            In(3, 3, 2, b"\x81\x00", request_type=0xA2, index=IN),
        ]
    )
    with pytest.raises(Stalled, match="does not answer") as stalled:
        link.query_block("D?", 9)
    assert stalled.value.received == kept
    bus.finish()


def test_what_takes_too_long_is_said_with_instrument_and_command() -> None:
    name = r"Rigol oscilloscope \(1ab1:04ce\)"
    bus, link = _link([_command(1, b"D?\n"), _command(2, b"D?\n")])
    for ask in (lambda: link.query("D?", 0.0), lambda: link.query_block("D?", 9, timeout_s=0.0)):
        with pytest.raises(DigitizerError, match=rf"{name} does not answer D\? in time"):
            ask()
    bus.script = [_command(3, b"L?\n")]
    for tag in range(4, 8):
        bus.script += [_ask(tag, 1 << 16), _answer(tag, b"x" * 22_000, end=False)]
    with pytest.raises(DigitizerError, match=rf"{name} answered L\? without an end"):
        link.query("L?")


def test_more_than_was_asked_for_is_refused_and_aborted() -> None:
    abort = In(3, 2, 2, b"\x81\x00", request_type=0xA2, index=IN)
    for text, line in ((b"#19" + bytes(138), "sends more than was requested"), (b"#3010", "announced 10 bytes")):
        bus, link = _link([_command(1, b"D?\n"), _ask(2, 9 + 64), _answer(2, text, size=73, end=False)])
        if len(text) > 100:
            bus.script.append(abort)
        with pytest.raises(DigitizerError, match=line):
            link.query_block("D?", 9)
        bus.finish()
    bus, link = _link([_command(1, b"D?\n"), _ask(2, 9 + 64), _answer(2, b"#19" + bytes(134), size=73)])
    assert link.query_block("D?", 9) == bytes(9)  # what an instrument pads its answer with is no fault
    bus.finish()


def test_the_instruments_of_the_known_makers_that_speak_the_class_are_opened_by_their_address(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bus = ScriptedUsb(
        [
            Plugged(0x1234, 0x0001, address=1, interface_class=(0xFE, 3, 1)),  # of no known maker
            Plugged(0x1AB1, 0x0002, address=2),  # of another class
            replace(_plugged(0x1AB1, 0x04CE), address=3),
            replace(_plugged(0x2A8D, 0x1797), address=4),
        ]
    )
    monkeypatch.setattr(usb_bus, "find_backend", lambda: bus)
    for address, name in (
        ("usb", "Rigol oscilloscope (1ab1:04ce)"),
        ("usb:2a8d:1797", "Keysight oscilloscope (2a8d:1797)"),
        ("USB:1AB1:04CE", "Rigol oscilloscope (1ab1:04ce)"),
    ):
        link = _link_of(address)
        assert (link.name, bus.claimed) == (name, [0])
        link.close()
    for address in ("usb:1ab1:0002", "usb:1234:0001", "usb:04ce:1ab1"):
        with pytest.raises(DigitizerError, match=f"no oscilloscope at {address}: plug it in"):
            _link_of(address)
    for endpoints in (((IN, 2),), ((OUT, 2),), ((IN, 3), (OUT, 2))):  # 2: bulk, 3: interrupt
        bus.devices = [replace(_plugged(), endpoints=endpoints)]
        with pytest.raises(DigitizerError, match="has no bulk endpoints: re-plug it"):
            _link_of("usb")


def test_after_a_timeout_the_answer_is_aborted_and_the_link_is_clean() -> None:
    bus, link = _link(
        [
            *(_command(1, b"D?\n"), _ask(2, 1 << 16), BulkIn(IN, 65548, TIMED_OUT)),
            In(3, 2, 2, b"\x01\x02", request_type=0xA2, index=IN),  # INITIATE_ABORT_BULK_IN of tag 2
            In(4, 0, 8, b"\x02\x01\0\0\0\0\0\0", request_type=0xA2, index=IN),  # pending, bytes to be taken
            BulkIn(IN, 1 << 16, b"rest"),
            In(4, 0, 8, b"\x01\0\0\0\4\0\0\0", request_type=0xA2, index=IN),
            ClearHalt(IN),
            *(_command(3, b"*IDN?\n"), _ask(4, 1 << 16), _answer(4, b"RIGOL\n")),
        ]
    )
    with pytest.raises(DigitizerError, match="does not answer"):
        link.query("D?", 2.0)
    write, ask, read, *abort = bus.timeouts_ms
    assert (write, ask) == (3000, 3000) and 1500 < read <= 2000 and abort == [500, 500, 200, 500]
    assert link.query("*IDN?") == "RIGOL"
    bus.finish()
    bus.timeouts_ms.clear()
    bus.script = [_command(5, b"D?\n"), _ask(6, 9 + 64), _answer(6, b"#15abcde", size=73)]
    assert link.query_block("D?", 9, timeout_s=0.5) == b"abcde"
    assert bus.timeouts_ms[:2] == [3000, 3000] and 300 < bus.timeouts_ms[2] <= 500


def test_an_answer_is_aborted_unless_the_instrument_is_off_the_bus() -> None:
    asked = [_command(1, b"D?\n"), _ask(2, 1 << 16)]
    bus, link = _link([*asked, BulkIn(IN, 65548, usb.core.USBError("No such device", -4, errno.ENODEV))])
    with pytest.raises(usb_bus.Unplugged, match="was unplugged"):
        link.query("D?")
    bus.finish()
    abort = In(3, 2, 2, b"\x81\x00", request_type=0xA2, index=IN)  # nothing to abort
    told = usb.core.USBError("the probe was unplugged", -9, errno.EPIPE)  # by an instrument still on the bus
    bus, link = _link([*asked, BulkIn(IN, 65548, told), abort])
    with pytest.raises(DigitizerError, match="the probe was unplugged"):
        link.query("D?")
    bus.finish()


def test_an_abort_ends_where_the_instrument_has_nothing_to_abort_or_stays_silent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]
    monkeypatch.setattr(usbtmc, "time", SimpleNamespace(monotonic=lambda: now[0]))
    pending = In(4, 0, 8, b"\x02\x00", request_type=0xA2, index=IN)
    begun = In(3, 2, 2, b"\x02", request_type=0xA2, index=IN)

    def later() -> None:
        now[0] += 0.6

    for abort in (
        [In(3, 2, 2, b"\x80", request_type=0xA2, index=IN)],
        [In(3, 2, 2, b"", request_type=0xA2, index=IN), ClearHalt(IN)],
        [begun, pending, In(4, 0, 8, b"\x81", request_type=0xA2, index=IN)],
        [begun, later, pending, later, pending, ClearHalt(IN)],  # a second is enough
        [begun, In(4, 0, 8, usb.core.USBError("gone", -4, 19), request_type=0xA2, index=IN)],
    ):
        bus, link = _link([_command(1, b"D?\n"), _ask(2, 1 << 16), _answer(9, b"x\n"), *abort])
        with pytest.raises(DigitizerError, match="answers no request"):
            link.query("D?")
        bus.finish()


@pytest.mark.parametrize(
    ("reply", "line"),
    [
        (_answer(9, b"x\n"), "answers no request"),
        (BulkIn(IN, 65548, b"\x02\x02\xfd"), "sent 3 bytes where a message head is due"),
        (_answer(2, b"x\n", told=1000), "announced 1000 bytes and sent 4"),
    ],
)
def test_a_wrong_head_is_refused_and_aborted(reply: BulkIn, line: str) -> None:
    abort = [
        In(3, 2, 2, b"\x01\x02", request_type=0xA2, index=IN),
        In(4, 0, 8, b"\x01\0\0\0\0\0\0\0", request_type=0xA2, index=IN),
        ClearHalt(IN),
    ]
    bus, link = _link([_command(1, b"D?\n"), _ask(2, 1 << 16), reply, *abort])
    with pytest.raises(DigitizerError, match=line):
        link.query("D?")
    bus.finish()


def test_a_cancelled_block_is_aborted() -> None:
    said = iter((False, True))
    size = (1 << 20) - 12
    bus, link = _link(
        [
            *(_command(1, b"D?\n"), _ask(2, size), _answer(2, b"#9009000000" + bytes(size - 11), end=False, size=size)),
            In(3, 2, 2, b"\x81\x00", request_type=0xA2, index=IN),  # nothing to abort
        ]
    )
    with pytest.raises(Cancelled):
        link.query_block("D?", 9_000_000, lambda: next(said))
    bus.finish()


def test_unplugging_is_said() -> None:
    bus, link = _link([_command(1, b"D?\n"), BulkOut(OUT, _ask(2, 1 << 16).content, usb.core.USBError("gone", -4, 19))])
    with pytest.raises(DigitizerError, match=r"Rigol oscilloscope \(1ab1:04ce\) was unplugged"):
        link.query("D?")
    bus.finish()


class TmcScope(ScriptedUsb):
    """An EmulatedScope behind USBTMC's messages."""

    def __init__(self, scope: EmulatedScope, device: Plugged) -> None:
        super().__init__([device])
        self.scope = scope
        self.waiting = b""
        self.asked: tuple[int, int] = (0, 0)

    def bulk_write(self, handle: Plugged, endpoint: int, interface: int, data: Any, timeout: int) -> int:
        kind, tag, inverse, _, size = struct.unpack_from("<BBBBI", bytes(data))
        assert (tag ^ inverse, endpoint, len(data) % 4) == (255, OUT, 0)
        if kind == 1:
            text = bytes(data)[12 : 12 + size].decode()
            assert text.endswith("\n")
            self.waiting = self.scope.answer(text[:-1]) or self.waiting
        else:
            self.asked = (tag, size)
        return len(data)

    def bulk_read(self, handle: Plugged, endpoint: int, interface: int, buffer: Any, timeout: int) -> int:
        tag, size = self.asked
        assert size <= 1 << 20
        part, self.waiting = self.waiting[:size], self.waiting[size:]
        message = struct.pack("<BBBBIBBBB", 2, tag, 255 - tag, 0, len(part), not self.waiting, 0, 0, 0) + part
        message += bytes(-len(message) % 4)
        assert len(buffer) >= len(message)
        buffer[: len(message)] = type(buffer)("B", message)
        return len(message)


@pytest.mark.parametrize(("maker", "vendor"), [("rigol", 0x1AB1), ("siglent", 0xF4EC), ("keysight", 0x2A8D)])
def test_a_shot_over_usb(maker: str, vendor: int) -> None:
    scope = EmulatedScope(maker, samples=600_000, polls_until_trigger=1)
    bus = TmcScope(scope, _plugged(vendor))
    digitizer = ScpiOscilloscope(UsbtmcTransport(find_instruments(bus)[0]))
    digitizer.arm(CaptureSettings(1e7, 600_000, 6_000))
    counts, trigger = take(digitizer, 100_000)
    assert (counts.shape[0], trigger) == (600_000, 6_000)
    for column, channel in enumerate(digitizer.capabilities.channels):
        volts = counts[:, column] * channel.volts_per_count + channel.offset_v
        assert abs(volts - scope.volts(column + 1)).max() < 1e-12
    digitizer.close()
    assert bus.opened == 0
