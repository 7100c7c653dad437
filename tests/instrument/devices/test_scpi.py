"""The SCPI driver against emulated oscilloscopes on a loopback socket."""

import math
import re
import socket
import threading
import time
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.shot.recording import Channel, Role
from instrument.devices.digitizer import Block, CaptureSettings, Digitizer, DigitizerError
from instrument.devices.scpi import EXTERNAL, ScpiOscilloscope
from instrument.devices.scpi_dialects import (
    DIALECTS,
    ImplausibleAnswer,
    Scaling,
    Timing,
    _timing,
    dialect_of,
    numbers,
    one_two_five,
    short_depth,
)
from instrument.devices.scpi_links import Deadline, SocketTransport, Stalled, block_start
from instrument.devices.sources import open_source
from instrument.devices.triggered_digitizer import HardwareTrigger, Piece
from tests.instrument.devices.scpi_emulator import EmulatedScope, TcpScope

MAKERS = ("rigol", "siglent", "keysight")


def take(digitizer: Digitizer, block_samples: int = 7_001, timeout_s: float = 5.0) -> tuple[np.ndarray, int | None]:
    """Return a whole shot and its trigger sample."""
    got, trigger, at = [], None, 0
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        buffer = np.full((block_samples, len(digitizer.capabilities.channels)), 9, np.int16)
        block = digitizer.read_into(buffer, 0.1)
        got.append(buffer[: block.samples].copy())
        if block.trigger_sample is not None:
            assert trigger is None
            trigger = at + block.trigger_sample
        at += block.samples
        if block.ended:
            return np.concatenate(got), trigger
    raise AssertionError("no end")


@pytest.mark.parametrize("maker", MAKERS)
def test_a_shot_as_set_on_the_instrument(maker: str) -> None:
    scope = EmulatedScope(maker)
    with TcpScope(scope) as server:
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port))
        settings = digitizer.default_settings()
        assert settings == CaptureSettings(1e7, 60_000, 6_000)
        digitizer.arm(settings)
        counts, trigger = take(digitizer)
        assert trigger == 6_000
        for column, channel in enumerate(digitizer.capabilities.channels):
            volts = counts[:, column] * channel.volts_per_count + channel.offset_v
            np.testing.assert_allclose(volts, scope.volts(column + 1), atol=1e-12)
        set_words = ("MDEP ", "SCAL ", "OFFS ", "TDIV ", "TRDL ", "MSIZ ", ":TIM:POS ")
        assert not [line for line in scope.log if any(word in line for word in set_words)]
        assert digitizer.read_into(np.empty((5, 2), np.int16), 0.01).ended
        digitizer.arm(settings)  # and once more: the stop of the first shot must not be taken for the second's
        scope.samples = 60_000
        assert take(digitizer)[0].shape == (60_000, 2)
        digitizer.close()


def test_the_rigols_words_in_their_order() -> None:
    scope = EmulatedScope("rigol", samples=600_000, trigger_at=60_000, polls_until_trigger=1)
    with TcpScope(scope) as server:
        trigger = HardwareTrigger(3, "falling", 1.25)
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port), {2: Role.MEASUREMENT}, trigger)
        digitizer.arm(CaptureSettings(1e7, 600_000, 60_000))
        take(digitizer)
        digitizer.close()
    fetch = [":WAV:SOUR CHAN2"]
    asked = [":ACQ:SRAT?", ":TIM:MAIN:OFFS?", ":ACQ:MDEP?"]
    assert scope.log == [
        *("*IDN?", ":WAV:MODE RAW", ":WAV:FORM BYTE", *fetch, ":WAV:PRE?"),
        *asked,
        *(":TRIG:MODE EDGE", ":TRIG:EDG:SOUR CHAN3", ":TRIG:EDG:SLOP NEG", ":TRIG:EDG:LEV 1.25", *fetch, ":WAV:PRE?"),
        *(":SING", ":TRIG:STAT?", ":TRIG:STAT?"),
        *fetch,
        ":WAV:PRE?",
        *asked,
        *(*fetch, ":WAV:STAR 1", ":WAV:STOP 250000", ":WAV:DATA?"),
        *(*fetch, ":WAV:STAR 250001", ":WAV:STOP 500000", ":WAV:DATA?"),
        *(*fetch, ":WAV:STAR 500001", ":WAV:STOP 600000", ":WAV:DATA?"),
    ]


# 50 ms with 10 ms before the trigger: the next step of the time base is 5 ms; the trigger comes 15 ms before the middle
@pytest.mark.parametrize(
    ("maker", "words", "memory"),
    [
        ("rigol", [":ACQ:MDEP 60000", ":TIM:MAIN:SCAL 0.005", ":TIM:MAIN:OFFS 0.015"], 60_000),
        ("siglent", ["MSIZ 70K", "TDIV 0.005S", "TRDL 0.015S"], 70_000),
        ("keysight", [":TIM:SCAL 0.005", ":TIM:POS 0.015"], 50_000),
    ],
)
def test_time_base_depth_and_delay_are_set_where_they_differ(maker: str, words: list[str], memory: int) -> None:
    scope = EmulatedScope(maker, samples=1_000_000, rate_hz=1e6, polls_until_trigger=1)
    with TcpScope(scope) as server:
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port))
        before = len(scope.log)
        digitizer.arm(CaptureSettings(1e6, 50_000, 10_000))
        assert [line for line in scope.log[before:] if " " in line and not line.startswith(SPOKEN)] == words
        assert (scope.samples, scope.rate_hz) == (memory, pytest.approx(1e6))
        counts, trigger = take(digitizer)
        assert trigger == 10_000
        first = (memory - 50_000) // 2
        for n, column in ((1, 0), (2, 1)):
            wanted = scope.codes(n).astype(int) - (128 if maker == "rigol" else 0)
            np.testing.assert_array_equal(counts[:, column], wanted[first : first + 50_000])
        digitizer.close()


SPOKEN = (":WAV:", "TRMD ", "SANU? ")  # words with a blank that set no time


def test_a_rate_or_a_length_that_the_instrument_lacks_is_refused_with_what_it_has() -> None:
    scope = EmulatedScope("rigol", samples=12_000_000, rate_hz=2.5e8)
    with TcpScope(scope) as server:
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port))
        with pytest.raises(
            DigitizerError, match=r"takes 1e\+06 samples/s at this length, not 1.37e\+06: ask for 1e\+06"
        ):
            digitizer.arm(CaptureSettings(1.37e6, 50_000, 0))
        with pytest.raises(DigitizerError, match="at most 12000000"):
            digitizer.arm(CaptureSettings(1e6, 12_000_001, 0))
        with pytest.raises(DigitizerError, match="cannot take 600 samples with 600 before the trigger"):
            digitizer.arm(CaptureSettings(1e6, 600, 600))
        scope.garbage[":ACQ:SRAT?"] = b"1001100\n"
        with pytest.raises(DigitizerError, match="not 1e"):
            digitizer.arm(CaptureSettings(1e6, 50_000, 0))
        scope.garbage[":ACQ:SRAT?"] = b"1000900\n"  # to a thousandth it is the rate that was asked for
        digitizer.arm(CaptureSettings(1e6, 50_000, 0))
        digitizer.close()


@pytest.mark.parametrize(
    ("maker", "trigger", "words"),
    [
        (
            "siglent",
            HardwareTrigger(3, "falling", 1.25),
            [
                *("*IDN?", "CHDR OFF", "C2:VDIV?", "C2:OFST?", "SARA?", "SANU? C2", "TRDL?"),
                *("TRSE EDGE,SR,C3,HT,OFF", "C3:TRSL NEG", "C3:TRLV 1.25V", "C2:VDIV?", "C2:OFST?"),
                *("TRMD SINGLE", "ARM", "SAST?", "SAST?", "C2:VDIV?", "C2:OFST?", "SARA?", "SANU? C2", "TRDL?"),
                *("WFSU SP,1,NP,500000,FP,0", "C2:WF? DAT2", "WFSU SP,1,NP,100000,FP,500000", "C2:WF? DAT2"),
            ],
        ),
        (
            "keysight",
            HardwareTrigger(EXTERNAL, "rising", -0.5),
            [
                *("*IDN?", ":WAV:FORM WORD", ":WAV:BYT LSBF", ":WAV:UNS OFF", ":WAV:POIN:MODE RAW", ":WAV:POIN MAX"),
                *(":WAV:SOUR CHAN2", ":WAV:POIN MAX", ":WAV:PRE?", ":ACQ:SRAT?", ":TIM:RANG?", ":TIM:POS?"),
                *(":TRIG:MODE EDGE", ":TRIG:EDGE:SOUR EXT", ":TRIG:EDGE:SLOP POS", ":TRIG:EDGE:LEV -0.5"),
                *(":WAV:SOUR CHAN2", ":WAV:POIN MAX", ":WAV:PRE?", ":SING", ":OPER:COND?", ":OPER:COND?"),
                *(":WAV:SOUR CHAN2", ":WAV:POIN MAX", ":WAV:PRE?", ":WAV:PRE?"),
                *(":WAV:SOUR CHAN2", ":WAV:POIN MAX", ":WAV:DATA?"),
            ],
        ),
    ],
)
def test_the_words_of_the_other_makers_in_their_order(maker: str, trigger: HardwareTrigger, words: list[str]) -> None:
    scope = EmulatedScope(maker, samples=600_000, trigger_at=60_000, polls_until_trigger=1)
    with TcpScope(scope) as server:
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port), {2: Role.MEASUREMENT}, trigger)
        digitizer.arm(CaptureSettings(1e7, 600_000, 60_000))
        take(digitizer)
        digitizer.close()
    assert scope.log == words


def test_the_rigols_automatic_memory_depth_is_that_of_its_time_base_and_the_other_triggers_have_their_words() -> None:
    scope = EmulatedScope("rigol", samples=600_000)
    scope.garbage = {":ACQ:MDEP?": b"AUTO\n", ":TIM:MAIN:SCAL?": b"5.0e-3\n"}  # 12 x 5 ms at 10 MS/s
    with TcpScope(scope) as server:
        for slope, word in (("rising", "POS"), ("falling", "NEG")):
            link = SocketTransport("127.0.0.1", server.port)
            digitizer = ScpiOscilloscope(link, trigger=HardwareTrigger(EXTERNAL, slope))
            settings = digitizer.default_settings()
            assert settings == CaptureSettings(1e7, 600_000, 6_000)
            before = len(scope.log)
            digitizer.arm(settings)
            told = [line for line in scope.log[before:] if line.startswith(":TRIG:") and "?" not in line]
            assert told == [":TRIG:MODE EDGE", ":TRIG:EDG:SOUR EXT", f":TRIG:EDG:SLOP {word}"]
            digitizer.close()


@pytest.mark.parametrize("maker", MAKERS)
def test_waiting_is_stopped_from_another_thread(maker: str) -> None:
    scope = EmulatedScope(maker, polls_until_trigger=10**9)
    with TcpScope(scope) as server:
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port))
        digitizer.arm(digitizer.default_settings())
        assert digitizer._worker is not None and digitizer._worker.daemon  # a program can end meanwhile
        buffer = np.empty((100, 2), np.int16)
        begun = time.monotonic()
        assert digitizer.read_into(buffer, 0.05).samples == 0
        assert time.monotonic() - begun < 0.5
        thread = threading.Timer(0.1, digitizer.stop)
        thread.start()
        block = digitizer.read_into(buffer, 10.0)
        thread.join()
        assert (block.samples, block.ended) == (0, True)
        end = time.monotonic() + 2.0
        while not scope.stopped and time.monotonic() < end:
            time.sleep(0.01)
        assert scope.stopped  # the instrument was told
        digitizer.close()


@pytest.mark.parametrize("maker", MAKERS)
def test_a_transfer_is_cancelled_and_the_next_shot_is_whole(maker: str) -> None:
    scope = EmulatedScope(maker, samples=600_000)
    with TcpScope(scope, pieces=(4096, 0.02)) as server:
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port))
        settings = digitizer.default_settings()
        digitizer.arm(settings)
        time.sleep(0.4)
        begun = time.monotonic()
        digitizer.stop()
        assert time.monotonic() - begun < 2.0
        server.pieces = None
        digitizer.arm(settings)
        counts, trigger = take(digitizer)
        assert (counts.shape[0], trigger) == (600_000, 6_000)
        assert server.connections == 2
        digitizer.close()


@pytest.mark.parametrize(
    ("command", "answer", "line"),
    [
        (":WAV:PRE?", b"nonsense\n", "answered 'nonsense' where the waveform's preamble is due"),
        (":WAV:PRE?", b"0,2,6,1,nan,0,0,nan,nan,nan\n", "where the waveform's preamble is due"),
        (":ACQ:SRAT?", b"0\n", "60000 samples at 0 a second"),
        (":WAV:DATA?", b"#9999999999" + bytes(100), "announced 999999999 bytes where at most 60000 were requested"),
        (":WAV:DATA?", b"#9000000010" + bytes(10) + b"\n", "sent 10 of 60000 samples of channel 1"),
        (":WAV:DATA?", bytes(100), "answered no data block"),
        (":WAV:DATA?", b"#x123", "damaged data block head"),
        (":ACQ:SRAT?", b"-1\n", "samples at -1 a second"),
        (":ACQ:MDEP?", b"1e300\n", "samples at"),
    ],
)
def test_garbage_is_one_clear_line(command: str, answer: bytes, line: str) -> None:
    scope = EmulatedScope("rigol", polls_until_trigger=1)
    with TcpScope(scope) as server:
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port))
        settings = digitizer.default_settings()
        scope.garbage[command] = answer
        with pytest.raises(DigitizerError, match=line) as caught:
            digitizer.arm(settings)
            take(digitizer)
        assert "\n" not in str(caught.value)
        scope.garbage.clear()
        digitizer.arm(settings)
        assert take(digitizer)[0].shape == (60_000, 2)
        digitizer.close()


def test_a_lost_connection_is_a_fault_and_the_next_arm_connects_again() -> None:
    scope = EmulatedScope("rigol", polls_until_trigger=1)
    with TcpScope(scope) as server:
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port))
        settings = digitizer.default_settings()
        server.drop_at = ":WAV:DATA?"
        digitizer.arm(settings)
        with pytest.raises(DigitizerError, match="closed the connection: check its network address"):
            take(digitizer)
        server.drop_at = None
        digitizer.arm(settings)
        assert take(digitizer)[0].shape == (60_000, 2)
        digitizer.close()


def test_no_answer_is_a_fault() -> None:
    scope = EmulatedScope("rigol")
    with TcpScope(scope) as server:
        link = SocketTransport("127.0.0.1", server.port)
        assert link._socket is not None
        assert link._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) != 0  # else each command waits
        with pytest.raises(DigitizerError, match=r"does not answer :NOTHING\?"):
            link.query(":NOTHING?", timeout_s=0.2)
        assert link.query("*IDN?").startswith("RIGOL")


@pytest.mark.parametrize(("port", "tried"), [(None, [5025, 5555]), (77, [77])])
def test_the_usual_ports_are_tried_in_turn_each_for_as_long_as_is_allowed(
    port: int | None, tried: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[object, ...]] = []

    def closed(address: tuple[str, int], timeout: float = math.inf) -> None:
        asked.append((*address, timeout))
        raise OSError(111, "Connection refused")

    monkeypatch.setattr(socket, "create_connection", closed)
    where = "scope.lab" if port is None else "scope.lab:77"
    with pytest.raises(DigitizerError, match=f"oscilloscope at {where} does not answer .*refused.*: check its network"):
        SocketTransport("scope.lab", port, 2.5)
    assert asked == [("scope.lab", one, 2.5) for one in tried]


def test_a_command_is_sent_whole_and_has_three_seconds_for_it_whatever_was_received_before() -> None:
    with TcpScope(EmulatedScope("rigol")) as server:
        link = SocketTransport("127.0.0.1", server.port)
        link.query("*IDN?")
        real, did = link._socket, []  # type: ignore[var-annotated]
        link._socket = SimpleNamespace(  # type: ignore[assignment]
            settimeout=did.append, sendall=did.append, recv=lambda most: (did.append(most), b"ab")[1]
        )
        link.write(":SING")
        assert did == [3.0, b":SING\n"]
        link._receive(Deadline(0.07), 5.0, "*IDN?", lambda: False)  # and no longer than is asked for what comes
        assert did[2:] == [pytest.approx(0.07, abs=0.01), 1 << 18] and link._received == b"ab"
        link._received.clear()
        link._socket = real
        assert link.query("*IDN?").startswith("RIGOL")
        link.close()


class Link:
    """A link to an instrument that only says what it is."""

    def __init__(self, *answers: str) -> None:
        self.answers, self.closed = list(answers), 0

    def write(self, command: str) -> None:
        pass

    def query(self, command: str, timeout_s: float = 5.0) -> str:
        return self.answers.pop(0) if self.answers else "0"

    def close(self) -> None:
        self.closed += 1


@settings(max_examples=80, deadline=None)
@given(
    st.lists(st.integers(1, 40), min_size=1, max_size=5), st.integers(-20, 150), st.booleans(),
    st.lists(st.integers(1, 30), min_size=1, max_size=3),
)  # fmt: skip
def test_fetched_pieces_are_read_in_any_blocks_with_the_trigger_once_and_the_end_last(
    lengths: list[int], trigger: int, known: bool, rooms: list[int]
) -> None:
    scope = ScpiOscilloscope(Link("RIGOL,DS1,0,0"))  # type: ignore[arg-type]
    assert scope.read_into(np.empty((1, 2), np.int16), 0.0) == Block(0, ended=True)  # not armed
    whole = np.arange(2 * sum(lengths), dtype=np.int16).reshape(-1, 2)
    scope._armed = True
    scope._blocks.put(Piece(np.empty((0, 2), np.int16), None, False))
    at = 0
    for length in lengths:
        place = trigger - at if known else None
        scope._blocks.put(Piece(whole[at : at + length], place, at + length == len(whole)))
        at += length
    assert scope.read_into(np.empty((1, 2), np.int16), 0.0) == Block(0, fired=True)
    came, found, turn = [], [], 0
    while True:
        buffer = np.empty((rooms[turn % len(rooms)], 2), np.int16)
        turn += 1
        block = scope.read_into(buffer, 0.0)
        if block.trigger_sample is not None:
            assert 0 <= block.trigger_sample < block.samples
            found.append(sum(map(len, came)) + block.trigger_sample)
        came.append(buffer[: block.samples])
        assert block.samples > 0 and block.lost_before == 0 and not block.fired
        if block.ended:
            break
    assert np.array_equal(np.concatenate(came), whole)
    assert found == ([trigger] if known and 0 <= trigger < len(whole) else [])
    assert scope.read_into(buffer, 0.0) == Block(0, ended=True)
    assert scope._blocks.empty()


def test_an_instrument_that_says_stopped_soon_after_arming_speaks_of_the_shot_before() -> None:
    now, link = [100.0], Link("RIGOL")
    scope = ScpiOscilloscope(link, clock=lambda: now[0])  # type: ignore[arg-type]
    link.query = lambda command, timeout_s=5.0: said[0]  # type: ignore[method-assign]
    said = ["STOP"]

    def waited() -> threading.Thread:
        thread = threading.Thread(target=scope._wait_for_shot, daemon=True)
        thread.start()
        thread.join(0.1)
        assert thread.is_alive()
        return thread

    thread = waited()
    now[0] = 100.49
    thread.join(0.1)
    assert thread.is_alive()
    now[0] = 100.51  # half a second later it means this one
    thread.join(5.0)
    assert not thread.is_alive()
    said[0] = "WAIT"
    thread = waited()
    said[0] = "STOP"  # it was seen to wait: done at once
    thread.join(5.0)
    assert not thread.is_alive()


def test_the_makers_guides_say_how_much_is_read_at_once_and_what_memories_there_are() -> None:
    assert {
        one.name: (one.bits, one.bytes_per_sample, one.points_per_read, one.depths, one.divisions, one.max_samples)
        for one in DIALECTS
    } == {
        "Siglent SDS1000X-E": (8, 1, 500_000, (7_000, 70_000, 700_000, 7_000_000), 14, 7_000_000),
        "Rigol DS1000Z": (8, 1, 250_000, (6_000, 60_000, 600_000, 6_000_000, 12_000_000), 12, 12_000_000),
        "Keysight InfiniiVision": (16, 2, None, (), 10, 8_000_000),
    }


@pytest.mark.parametrize(
    ("maker", "stalls_at", "received", "rows"),
    [
        ("RIGOL", 70, 7, [20, 20, 7]),  # in parts of 20 points
        ("RIGOL", 30, 0, [0]),
        ("RIGOL", None, 0, [20, 20, 10]),
        ("KEYSIGHT", 30, 45, [15]),  # the whole memory at once, of which the first 30 points lie before the shot
        ("KEYSIGHT", 30, 99, [50]),
        ("KEYSIGHT", None, 0, [50]),
    ],
)
def test_of_a_transfer_that_stalls_the_rows_are_kept_that_every_channel_has(
    maker: str, stalls_at: int | None, received: int, rows: list[int]
) -> None:
    scope = ScpiOscilloscope(Link(maker))  # type: ignore[arg-type]
    whole = scope._dialect.points_per_read is None
    scope._dialect = replace(
        scope._dialect,
        points_per_read=None if whole else 20,
        timing=lambda query, n: Timing(1e6, 100, 40),
        scaling=lambda query, n: Scaling(0.5 * n, 0.25),
    )
    memory = np.arange(100, dtype=np.int16)

    def points(n: int, at: int, count: int, timing: Timing) -> np.ndarray:
        if n == 2 and at == stalls_at:
            start = 0 if whole else at
            sent = (memory + 50)[start : start + received]
            raise Stalled("slow", "re-arm", sent.tobytes() if whole else (sent + 128).astype(np.uint8).tobytes())
        return (memory + (50 if n == 2 else 0))[at : at + count]

    scope._points = points  # type: ignore[method-assign]
    with pytest.raises(Stalled, match="slow") if stalls_at is not None else nullcontext():
        scope._fetch(CaptureSettings(1e6, 50, 10), scope._blocks)
    pieces = []
    while not scope._blocks.empty():
        pieces.append(scope._blocks.get())
    assert [channel.volts_per_count for channel in scope.capabilities.channels] == [0.5, 1.0]  # read with the shot
    fired, *parts = pieces
    assert isinstance(fired, Piece) and fired.counts.shape == (0, 2) and not fired.last
    assert [len(part.counts) for part in parts if isinstance(part, Piece)] == rows
    at = 30  # ten samples before the trigger
    for part in parts:
        assert isinstance(part, Piece) and part.trigger_sample == 40 - at
        wanted = memory[at : at + len(part.counts)]
        assert np.array_equal(part.counts, np.stack((wanted, wanted + 50), axis=1))
        at += len(part.counts)
        assert part.last == (at == 80 and stalls_at is None)


@pytest.mark.parametrize("off", [9e-4, -9e-4, 1.1e-3, -1.1e-3])
def test_a_shot_is_taken_at_its_rate_to_a_thousandth(off: float) -> None:
    scope = ScpiOscilloscope(Link("RIGOL"))  # type: ignore[arg-type]
    rate = 1e6 * (1 + off)
    scope._dialect = replace(
        scope._dialect, timing=lambda query, n: Timing(rate, 100, 40), scaling=lambda query, n: Scaling(1.0, 0.0)
    )
    scope._points = lambda n, at, count, timing: np.zeros(count, np.int16)  # type: ignore[method-assign]
    refused = pytest.raises(DigitizerError, match=re.escape(f"Rigol took {rate:g} samples/s, not 1e+06: re-arm"))
    with refused if abs(off) > 1e-3 else nullcontext():
        scope._fetch(CaptureSettings(1e6, 50, 10), scope._blocks)


def test_a_stop_that_the_instrument_does_not_take_is_a_fault_and_ends_the_shot() -> None:
    link = Link("RIGOL")
    scope = ScpiOscilloscope(link)  # type: ignore[arg-type]
    asked: list[str] = []

    def gone(command: str) -> None:
        asked.append(command)
        raise DigitizerError("connection lost")

    link.write = gone  # type: ignore[method-assign]
    scope._cancel.set()
    scope._armed = True
    scope._work(CaptureSettings(1e6, 50, 10), scope._blocks)
    assert asked == [":STOP"]
    with pytest.raises(DigitizerError, match="connection lost"):
        scope.read_into(np.empty((1, 2), np.int16), 0.0)
    assert scope._blocks.get_nowait() is None and scope._blocks.empty()


def test_arming_again_gives_up_the_shot_before() -> None:
    scope, begun = EmulatedScope("rigol", polls_until_trigger=10**9), []
    with TcpScope(scope) as server:
        digitizer = ScpiOscilloscope(SocketTransport("127.0.0.1", server.port))
        for _ in range(2):
            digitizer.arm(digitizer.default_settings())
            begun.append(digitizer._worker)
        assert begun[0] is not begun[1] and begun[0] is not None and not begun[0].is_alive()
        digitizer.close()
    assert scope.log.count(":STOP") == 2 == scope.log.count(":SING")


def test_a_driver_that_hangs_is_waited_for_a_quarter_of_a_minute_and_left_behind() -> None:
    scope, waited = ScpiOscilloscope(Link("RIGOL")), []  # type: ignore[arg-type, var-annotated]
    scope._worker = SimpleNamespace(join=lambda timeout: waited.append(timeout))  # type: ignore[assignment]
    scope.stop()
    scope.stop()
    assert waited == [15.0]


def test_a_fault_or_a_stop_while_it_is_fetched_ends_the_shot() -> None:
    scope, buffer = ScpiOscilloscope(Link("RIGOL,DS1,0,0")), np.empty((1, 2), np.int16)  # type: ignore[arg-type]
    scope._armed = True
    assert scope.read_into(buffer, 0.0) == Block(0)
    for item in (DigitizerError("gone"), None):
        scope._armed = True
        scope._blocks.put(item)
        if item is not None:
            with pytest.raises(DigitizerError, match="gone"):
                scope.read_into(buffer, 0.0)
        else:
            assert scope.read_into(buffer, 0.0) == Block(0, ended=True)
        assert scope.read_into(buffer, 0.0) == Block(0, ended=True)


def test_an_instrument_is_called_by_its_maker_and_model_and_an_unknown_one_is_let_go() -> None:
    for identity, name in (
        ("RIGOL TECHNOLOGIES,DS1104Z,DS1ZA0,00", "Rigol DS1104Z"),
        ("Siglent Technologies, SDS1104X-E ,1,2", "Siglent SDS1104X-E"),
        ("AGILENT", "Keysight"),
    ):
        scope = ScpiOscilloscope(Link(identity))  # type: ignore[arg-type]
        able = scope.capabilities
        assert able.name == name and able.hardware_trigger and not able.real_time and able.rates_hz == ()
        assert able.channels == (Channel(Role.REFERENCE, 1.0), Channel(Role.MEASUREMENT, 1.0))  # before its first shot
        assert (able.bits, able.max_samples) == (scope._dialect.bits, scope._dialect.max_samples)
    other = Link("TEKTRONIX,TDS1002")
    with pytest.raises(DigitizerError, match="no dialect"):
        ScpiOscilloscope(other)  # type: ignore[arg-type]
    assert other.closed == 1
    for roles in ({1: Role.REFERENCE}, {1: Role.MEASUREMENT, 2: Role.MEASUREMENT}):
        with pytest.raises(DigitizerError, match="one channel of the oscilloscope, and only one"):
            ScpiOscilloscope(Link("RIGOL"), roles)  # type: ignore[arg-type]
    turned = ScpiOscilloscope(Link("RIGOL"), {4: Role.SWITCH, 2: Role.MEASUREMENT})  # type: ignore[arg-type]
    assert [channel.role for channel in turned.capabilities.channels] == [Role.MEASUREMENT, Role.SWITCH]


def test_a_line_without_an_end_is_refused_and_what_follows_it_is_not_taken_for_the_next_answer() -> None:
    scope = EmulatedScope("rigol")
    scope.garbage = {"LONG?": b" " + b"x" * 65_534 + b"\n", "ENDLESS?": b"x" * 65_537}
    with TcpScope(scope) as server:
        link = SocketTransport("127.0.0.1", server.port)
        assert link.query("LONG?") == "x" * 65_534 and server.connections == 1
        with pytest.raises(DigitizerError, match=r"oscilloscope at 127.0.0.1:\d+ answered ENDLESS\? without an end"):
            link.query("ENDLESS?")
        assert link.query("*IDN?").startswith("RIGOL") and server.connections == 2
        with pytest.raises(DigitizerError, match=r"127.0.0.1:\d+ does not answer NO\? in time: check its"):
            link.query_block("NO?", 10, timeout_s=0.0)
        assert link.query("*IDN?").startswith("RIGOL") and server.connections == 3


def test_line_ends_left_over_by_a_block_are_skipped_and_a_block_may_come_in_pieces() -> None:
    scope = EmulatedScope("rigol")
    scope.garbage = {"D?": b"DAT2,#15a\ncd\n\r\n\n\n"}
    with TcpScope(scope, pieces=(3, 0.001)) as server:
        link = SocketTransport("127.0.0.1", server.port)
        for _ in range(3):
            assert link.query_block("D?", 5) == b"a\ncd\n"
            assert link.query("*IDN?").startswith("RIGOL")
        with pytest.raises(DigitizerError, match="announced 5 bytes where at most 4 were requested"):
            link.query_block("D?", 4)
        assert link.query("*IDN?").startswith("RIGOL") and server.connections == 2
        link.close()
        assert link.query("*IDN?").startswith("RIGOL") and server.connections == 3


@pytest.mark.parametrize(
    ("received", "start"),
    [
        (b"", None),
        (b"#", None),
        (b"#2", None),
        (b"#21", None),
        (b"#210", (4, 10)),
        (b"DAT2,#9000000012xyz", (16, 12)),
        (b"x" * 63, None),
        (b"x" * 63 + b"#15", (66, 5)),
        (b"x" * 64 + b"#15", "answered no data block"),
        (b"#0", "damaged data block head"),
        (b"#a", "damaged data block head"),
        (b"#:0000000012", "damaged data block head"),
        (b"#9000000012", (11, 12)),
        (b"#2+5", "damaged data block head"),
    ],
)
def test_the_head_of_a_block_is_a_hash_the_number_of_its_digits_and_its_length(
    received: bytes, start: tuple[int, int] | str | None
) -> None:
    """IEEE 488.2, 8.7.9; before it may stand what a maker likes, up to 64 bytes."""
    if isinstance(start, str):
        with pytest.raises(DigitizerError, match=f"scope .*{start}"):
            block_start(received, "scope", 100)
    else:
        assert block_start(received, "scope", 100) == start == block_start(bytearray(received), "scope", 100)


def test_a_deadline_passes_and_a_large_block_extends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("instrument.devices.scpi_links.time.monotonic", lambda: now[0])
    deadline = Deadline(2.0)
    now[0] = 101.5
    assert deadline.check("scope", "D?") == 0.5
    deadline.allow_for(100_000)  # 50 kB a second is the slowest link
    now[0] = 103.9
    assert deadline.check("scope", "D?") == pytest.approx(0.1)
    now[0] = 104.0
    with pytest.raises(DigitizerError, match=r"scope does not answer D\? in time: check its connection"):
        deadline.check("scope", "D?")


def test_the_source_text_reaches_the_driver() -> None:
    scope = EmulatedScope("siglent", polls_until_trigger=1)
    with TcpScope(scope) as server:
        digitizer = open_source(f"scpi:127.0.0.1:{server.port}?channels=2,1&trigger=external&slope=falling&level=0.5")
        assert [c.role for c in digitizer.capabilities.channels] == ["measurement", "reference"]
        assert digitizer.capabilities.name == "Siglent SDS1104X-E"
        digitizer.arm(digitizer.default_settings())
        counts, _ = take(digitizer)
        np.testing.assert_array_equal(counts[:, 1], scope.codes(2))
        told = [line for line in scope.log if line.startswith(("TRSE", "EX:"))]
        assert told == ["TRSE EDGE,SR,EX,HT,OFF", "EX:TRSL NEG", "EX:TRLV 0.5V"]
        digitizer.close()


def test_dialects_are_told_by_the_maker() -> None:
    assert [dialect_of(EmulatedScope.IDENTITY[maker]).name.split()[0].lower() for maker in MAKERS] == list(MAKERS)
    assert dialect_of("AGILENT TECHNOLOGIES,MSO-X 3054A,,").name == "Keysight InfiniiVision"
    with pytest.raises(DigitizerError, match="no dialect for the instrument 'TEKTRONIX,TDS1002': known are"):
        dialect_of("TEKTRONIX,TDS1002")
    assert len(DIALECTS) == 3
    rigol, siglent, keysight = (dialect_of(maker).is_done for maker in ("RIGOL", "SIGLENT", "KEYSIGHT"))
    for stops in (rigol, siglent):
        assert [stops(answer) for answer in ("STOP", "Stop", "RUN", "WAIT", "")] == [True, True, False, False, False]
    assert [keysight(answer) for answer in ("0", "+8", "1", "9", "247", "4095")] == [
        True,
        False,
        True,
        False,
        True,
        False,
    ]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *(("1.00E+09", 1e9), ("500MSa/s", 5e8), ("7Mpts", 7e6), ("2.00mV", 2e-3), ("-1.5", -1.5), ("700kpts", 7e5)),
        *((" 2GSa/s ", 2e9), ("3.KSa/s", 3e3), ("4.00us", 4e-6), ("50ns", 5e-8), ("12V", 12.0)),
    ],
)
def test_numbers_with_units(text: str, value: float) -> None:
    assert numbers(text, 1, "a number") == [pytest.approx(value)]


def test_steps_of_a_time_base_and_names_of_a_memory_depth() -> None:
    values = np.geomspace(1e-9, 50.0, 997)
    steps = np.array([one_two_five(float(value)) for value in values])
    table = np.array([m * 10.0**k for k in range(-10, 4) for m in (1, 2, 5)])
    assert steps == pytest.approx([table[table >= value * (1 - 1e-9)].min() for value in values])
    for step in (1e-6, 2e-6, 5e-6):
        assert one_two_five(step) == pytest.approx(step) == pytest.approx(one_two_five(step * 0.9))
    assert [short_depth(n) for n in (7_000, 70_000, 999_000, 1_000_000, 7_000_000)] == ["7K", "70K", "999K", "1M", "7M"]


@pytest.mark.parametrize(
    ("rate", "total", "trigger", "expected"),
    [
        (1e6, 100, 30.4, 30),
        (1e6, 100, -0.1, None),
        (1e6, 100, 0.0, 0),
        (1e6, 100, 99.4, 99),
        (1e6, 100, 99.6, None),
        (1e-3, 1, 0.0, 0),
        (1e12, 1 << 31, 0.0, 0),
    ],
)
def test_a_trigger_lies_within_its_record(rate: float, total: float, trigger: float, expected: int | None) -> None:
    assert _timing(rate, total, trigger) == Timing(rate, int(total), expected)


@pytest.mark.parametrize(
    ("step", "line"),
    [("0", "a sample every 0 s"), ("-1e-6", "a sample every -1e-06 s"), ("1e4", "at 0.0001 a"), ("1e-13", r"at 1e.13")],
)
def test_a_preamble_with_an_impossible_step_is_refused(step: str, line: str) -> None:
    preamble = f"0,0,100,1,{step},0,0,1,0,0"
    with pytest.raises(ImplausibleAnswer, match=f"the oscilloscope reports .*{line}.*: set its time base anew"):
        DIALECTS[2].timing(lambda command: preamble, 1)
    sound = DIALECTS[2].timing(lambda command: "0,0,100,1,1e-6,-25e-6,5,1,0,0", 1)
    assert sound == Timing(pytest.approx(1e6), 100, 30)  # type: ignore[arg-type]


@pytest.mark.parametrize(("rate", "total"), [(9e-4, 10), (1.1e12, 10), (1e6, 0.5), (1e6, 2**31 + 1), (math.nan, 10)])
def test_an_impossible_time_base_is_refused(rate: float, total: float) -> None:
    with pytest.raises(ImplausibleAnswer, match="samples at"):
        _timing(rate, total, 0.0)


@pytest.mark.parametrize(
    ("volts", "offset", "possible"),
    [
        *((1.01e-12, 0, True), (-9.9e3, -9.9e5, True), (0.99e-12, 0, False), (1.01e4, 0, False)),
        *((1.0, 1.01e6, False), (1.0, -1.01e6, False)),
    ],
)
def test_an_impossible_scale_is_refused(volts: float, offset: float, possible: bool) -> None:
    if possible:
        Scaling(volts, offset)
    else:
        with pytest.raises(ImplausibleAnswer, match="V per count"):
            Scaling(volts, offset)


def test_an_answer_with_too_few_or_unreadable_numbers_is_refused() -> None:
    assert numbers("1,2.5,3", 2, "x") == [1.0, 2.5]
    for answer in ("1", "1,x", "", "1,nan", "inf,1", "1,1e999"):
        with pytest.raises(DigitizerError, match="where a pair is due"):
            numbers(answer, 2, "a pair")
    assert [dialect.decode(bytes([0, 128, 255])).tolist() for dialect in DIALECTS[:2]] == [
        [0, -128, -1],
        [-128, 0, 127],
    ]
    assert DIALECTS[2].decode(b"\x01\x00\xff\xff\x07").tolist() == [1, -1]
