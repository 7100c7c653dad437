"""The Hantek 6022 driver's requests, byte by byte, on a scripted bus."""

import errno
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import usb.core

from analysis.shot.recording import Role
from instrument.devices import hantek6022_firmware
from instrument.devices.bulk_stream import Chunk
from instrument.devices.digitizer import Block, CaptureSettings, DigitizerError
from instrument.devices.hantek6022 import Hantek6022, channel_of
from tests.instrument.devices.scripted_usb import In, Out, Plugged, ScriptedUsb

EEPROM = In(0xA2, 8, 80, usb.core.USBError("Pipe error", -9, errno.EPIPE))
GONE = usb.core.USBError("No such device", -4, errno.ENODEV)


class GivenStream:
    """A stream whose chunks are given beforehand, with an error at its end if there is one."""

    def __init__(self, chunks: list[Chunk], error: DigitizerError | None = None) -> None:
        self.chunks, self.error = deque(chunks), error
        self.started = self.stopped = False
        self.waited: list[float] = []
        self.waits: Callable[[float], object] = lambda timeout_s: None

    def __call__(self, device: Any, endpoint: int, bytes_per_s: float, name: str) -> "GivenStream":
        self.asked_for = (endpoint, bytes_per_s)
        return self

    def start(self) -> None:
        self.started = True

    def take(self, timeout_s: float) -> Chunk | None:
        self.waited.append(timeout_s)
        self.waits(timeout_s)
        if self.chunks:
            return self.chunks.popleft()
        if self.error:
            raise self.error
        return None

    def wake(self) -> None:
        pass

    def stop(self) -> None:
        self.stopped = True


def _arming(rate_code: int, gains: tuple[int, int] = (2, 2)) -> list[Out]:
    return [
        Out(0xE3, 0, b"\x00"),
        Out(0xE0, 0, bytes([gains[0]])),
        Out(0xE1, 0, bytes([gains[1]])),
        Out(0xE2, 0, bytes([rate_code])),
        Out(0xE4, 0, b"\x02"),
        Out(0xE3, 0, b"\x01"),
    ]


def _codes(packets: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, packets * 512).astype(np.uint8)


@pytest.mark.parametrize(
    ("vendor", "product", "rate_hz", "code"),
    [
        (0x04B5, 0x6022, 10e6, 10),
        (0x04B5, 0x602A, 15e6, 15),
        (0x04B5, 0x6022, 100e3, 110),
        (0x1D50, 0x608E, 12e6, 12),
        (0x1D50, 0x608E, 100e3, 10),
    ],
)
def test_arming_sends_the_firmwares_own_rate_code(vendor: int, product: int, rate_hz: float, code: int) -> None:
    bus = ScriptedUsb([Plugged(vendor, product)], [EEPROM, *_arming(code, (1, 10)), Out(0xE3, 0, b"\x00")])
    stream = GivenStream([])
    scope = Hantek6022(gains=(1, 10), backend=bus, make_stream=stream)
    scope.arm(CaptureSettings(rate_hz, 1000, 0))
    assert stream.started and bus.claimed == [0]
    assert stream.asked_for == (0x86, 2 * rate_hz)
    scope.close()
    assert stream.stopped
    bus.finish()
    assert bus.opened == 0
    assert bus.timeouts_ms == [500, *[1000] * 7]  # the calibration, which a firmware may not have, then requests


@pytest.mark.parametrize(
    ("ids", "slow", "megas"),
    [
        ((0x04B5, 0x6022), 100, {1, 2, 3, 4, 5, 6, 8, 10, 12, 15}),
        ((0x04B5, 0x602A), 100, {1, 2, 3, 4, 5, 6, 8, 10, 12, 15}),
        ((0x1D50, 0x608E), 0, {1, 2, 4, 8, 12}),
    ],
)
def test_every_rate_has_the_code_of_its_firmware(ids: tuple[int, int], slow: int, megas: set[int]) -> None:
    """Both count in MS/s from 1 MS/s on, and in tens of kS/s below it, OpenHantek's from 100 on."""
    bus = ScriptedUsb([Plugged(*ids)], [EEPROM])
    scope = Hantek6022(backend=bus, make_stream=GivenStream([]))
    rates = scope.capabilities.rates_hz
    assert set(rates) == {1e5, 2e5, 5e5} | {1e6 * mega for mega in megas}
    easy = [rate for rate in rates if rate <= 12e6]
    assert list(rates) == sorted(easy, reverse=True) + [rate for rate in rates if rate > 12e6]
    for rate in rates:
        code = round(rate / 1e6) if rate >= 1e6 else slow + round(rate / 1e4)
        bus.script.extend([*_arming(code), Out(0xE3, 0, b"\x00")])
        scope.arm(CaptureSettings(rate, 1000, 0))
        scope.stop()
    scope.close()
    bus.finish()


@pytest.mark.parametrize(
    ("gain", "place", "full_scale_v"), [(1, 14, 5.12), (2, 8, 2.56), (5, 6, 1.024), (10, 0, 0.512)]
)
@pytest.mark.parametrize("column", [0, 1])
def test_a_gain_step_reads_its_own_bytes_of_the_calibration(
    gain: int, place: int, full_scale_v: float, column: int
) -> None:
    eeprom = bytearray([0x80] * 80)
    eeprom[place + column] = 0x80 - 4
    eeprom[32 + place + column] = 128 - 25  # a twentieth
    eeprom[48 + place + column] = 128 + 50  # a fifth of a code
    volts = 0.95 * full_scale_v / 128
    found = channel_of(Role.MEASUREMENT, gain, column, bytes(eeprom))
    assert found.volts_per_count == pytest.approx(volts)
    assert found.offset_v == pytest.approx(3.8 * volts)
    for unset in (b"\x00" * 80, b"\xff" * 80, b"", bytes(eeprom[: place + column])):
        plain = channel_of(Role.MEASUREMENT, gain, column, unset)
        assert plain.volts_per_count == pytest.approx(full_scale_v / 128) and plain.offset_v == 0.0


@pytest.mark.parametrize(
    ("ids", "rate", "offered"),
    [
        ((0x1D50, 0x608E), 10e6, "0.1, 0.2, 0.5, 1, 2, 4, 8, 12"),
        ((0x04B5, 0x6022), 30e6, "0.1, 0.2, 0.5, 1, 2, 3, 4, 5, 6, 8, 10, 12, 15"),
    ],
)
def test_a_rate_the_firmware_lacks_is_refused_before_anything_is_sent(
    ids: tuple[int, int], rate: float, offered: str
) -> None:
    bus = ScriptedUsb([Plugged(*ids)], [EEPROM])
    scope = Hantek6022(backend=bus, make_stream=GivenStream([]))
    with pytest.raises(DigitizerError) as refusal:
        scope.arm(CaptureSettings(rate, 1000, 0))
    refused = f"Hantek 6022 cannot sample at {rate:g} samples/s: take one of {offered} MS/s"
    assert str(refusal.value) == refused
    bus.finish()


def test_the_firmware_is_loaded_and_the_device_found_again(tmp_path: Path) -> None:
    image = bytes(range(256)) * 20
    path = tmp_path / "scope.fw"
    path.write_bytes(image)
    cold, warm = Plugged(0x04B4, 0x6022), Plugged(0x1D50, 0x608E, address=2)
    bus = ScriptedUsb([cold])
    bus.script = [
        Out(0xA0, 0xE600, b"\x01"),
        Out(0xA0, 0x0000, image[:4096]),
        Out(0xA0, 0x1000, image[4096:]),
        lambda: bus.devices.__setitem__(0, warm),
        Out(0xA0, 0xE600, b"\x00", answer=GONE),
        EEPROM,
    ]
    scope = Hantek6022(firmware=path, backend=bus, make_stream=GivenStream([]))
    assert bus.timeouts_ms == [1000] * 4 + [500] and bus.claimed == [0]
    assert scope.capabilities.rates_hz[:3] == (12e6, 8e6, 4e6)  # the sigrok firmware's
    assert scope.default_settings() == CaptureSettings(12e6, 2_000_000, 300_000)
    assert scope.capabilities.unseen_loss_s == 0.0  # PD0 tells every loss
    scope.close()
    bus.finish()


def test_intel_hex_goes_where_its_records_say(tmp_path: Path) -> None:
    path = tmp_path / "scope.hex"
    path.write_text(":03001000010203E7\n:0100200055" + f"{(-(1 + 0x20 + 0x55)) & 255:02X}\n:00000001FF\n")
    assert hantek6022_firmware.read_firmware(path) == [(0x10, b"\x01\x02\x03"), (0x20, b"\x55")]
    for broken, why in (
        (":03001000010203E8", "line 1: damaged line"),  # its sum
        (":0300100001EC", "line 1: damaged line"),  # shorter than it says
        (":030010000102030400E3", "line 1: damaged line"),
        (":00000000", "line 1: damaged line"),
        (":zz", "line 1: not a line"),
        (":02000004FFFFFC", "line 1: no record for the FX2's RAM"),
        (":03001000010203E7\n;03001000010203E7", "line 2: damaged line"),
        (":03001000010203E7", None),
    ):
        path.write_text(broken + "\n:00000001FF\n")
        if why is None:
            assert len(hantek6022_firmware.read_firmware(path)) == 1
        else:
            with pytest.raises(DigitizerError, match=rf"scope\.hex, {why}"):
                hantek6022_firmware.read_firmware(path)


def _hex_record(address: int, content: bytes) -> str:
    record = bytes([len(content), *address.to_bytes(2, "big"), 0, *content])
    return f":{record.hex()}{-sum(record) & 255:02x}\n"


def test_firmware_fills_the_memory_of_the_device_to_its_last_byte_and_no_further(tmp_path: Path) -> None:
    path, end = tmp_path / "scope.fw", ":00000001FF\n"
    for content, why in (
        (bytes(0x4000), None),
        (bytes(0x4001), "is no FX2 firmware: 16385 bytes, at most 16384 fit"),
        (b"", "is no FX2 firmware: 0 bytes"),
        ((_hex_record(0x3FF0, bytes(16)) + end).encode(), None),
        ((_hex_record(0x3FF1, bytes(16)) + end).encode(), r"line 1: no record for the FX2's RAM"),
        (_hex_record(0x10, bytes(16)).encode(), "ends before its last record"),
    ):
        path.write_bytes(content)
        if why is None:
            ((address, content),) = hantek6022_firmware.read_firmware(path)
            assert address + len(content) == 0x4000
        else:
            with pytest.raises(DigitizerError, match=rf"scope\.fw.*{why}"):
                hantek6022_firmware.read_firmware(path)


def test_firmware_is_taken_from_the_first_folder_that_has_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folders = tuple(tmp_path / name for name in ("none", "first", "second"))
    monkeypatch.setattr(hantek6022_firmware, "FOLDERS", folders)
    for folder in folders[1:]:
        folder.mkdir()
        (folder / "fx2lafw-hantek-6022be.fw").write_bytes(b"image")
    (folders[2] / "fx2lafw-hantek-6022bl.fw").write_bytes(b"image")
    for product, folder, kind in ((0x6022, 1, "be"), (0x2020, 1, "be"), (0x602A, 2, "bl")):
        found = hantek6022_firmware.find_firmware(product)
        assert found == folders[folder] / f"fx2lafw-hantek-6022{kind}.fw"


def test_missing_firmware_is_one_line_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hantek6022_firmware, "FOLDERS", ())
    bus = ScriptedUsb([Plugged(0x04B4, 0x602A)])
    with pytest.raises(DigitizerError, match=r"6022bl\.fw.*apt install sigrok-firmware-fx2lafw") as caught:
        Hantek6022(backend=bus, make_stream=GivenStream([]))
    assert "\n" not in str(caught.value)


def test_it_says_when_it_did_not_come_back() -> None:
    now = [0.0]
    with pytest.raises(DigitizerError, match="did not come back within 3 s"):
        hantek6022_firmware.wait_for_firmware(
            ScriptedUsb([]), clock=lambda: now[0], sleep=lambda s: now.__setitem__(0, now[0] + s)
        )
    assert 3.0 <= now[0] < 3.2


@pytest.mark.parametrize(
    ("device", "line"),
    [
        (None, "no Hantek 6022 is plugged in"),
        (Plugged(0x04B5, 0x6022, forbidden=True), "no permission to open Hantek 6022: .*udev"),
        (Plugged(0x04B5, 0x6022, busy=True), "in use by another program"),
    ],
)
def test_what_keeps_it_from_opening_is_said(device: Plugged | None, line: str) -> None:
    bus = ScriptedUsb([device] if device else [])
    with pytest.raises(DigitizerError, match=line):
        Hantek6022(backend=bus, make_stream=GivenStream([]))


def test_eeprom_scales_the_channels() -> None:
    eeprom = bytearray([0x80] * 32 + [0xFF] * 48)
    eeprom[8] = 0x80 + 3  # CH1, gain 2: three codes
    eeprom[32 + 8] = 128 + 50  # and a tenth more volts
    eeprom[48 + 8] = 128 - 25  # and a tenth of a code less
    eeprom[7] = 0x80 - 2  # CH2, gain 5
    bus = ScriptedUsb([Plugged(0x04B5, 0x6022)], [In(0xA2, 8, 80, bytes(eeprom))])
    scope = Hantek6022((Role.SWITCH, Role.MEASUREMENT), (2, 5), backend=bus, make_stream=GivenStream([]))
    able = scope.capabilities
    first, second = able.channels
    assert first.role is Role.SWITCH and (able.bits, able.max_samples, able.real_time) == (8, None, True)
    assert (able.hardware_trigger, able.unseen_loss_s) == (False, 0.004)  # without PD0 the clock alone tells losses
    assert first.volts_per_count == pytest.approx(1.1 * 5.12 / 256)
    assert first.offset_v == pytest.approx(-2.9 * first.volts_per_count)
    assert second.volts_per_count == pytest.approx(5.12 / 640)
    assert second.offset_v == pytest.approx(2 * second.volts_per_count)


def test_counts_are_the_codes_less_128_whatever_the_blocks() -> None:
    codes = _codes(40)
    pieces = np.split(codes, [700, 5000, 5001, 12288])
    bus = ScriptedUsb([Plugged(0x04B5, 0x6022)], [EEPROM, *_arming(1), Out(0xE3, 0, b"\x00")])
    stream = GivenStream(
        [Chunk(piece, 0.001 * i) for i, piece in enumerate(pieces)], DigitizerError("Hantek 6022 was unplugged")
    )
    scope = Hantek6022((Role.SWITCH, Role.MEASUREMENT), backend=bus, make_stream=stream)
    scope.arm(CaptureSettings(1e6, 1000, 0))
    got = []
    with pytest.raises(DigitizerError, match="unplugged"):
        while True:
            buffer = np.full((333, 2), 999, np.int16)
            block = scope.read_into(buffer, 0.1)
            assert block.lost_before == 0
            got.append(buffer[: block.samples].copy())
    expected = codes[4096:].astype(np.int16).reshape(-1, 2) - 128
    np.testing.assert_array_equal(np.concatenate(got), expected)
    bus.finish()
    assert bus.opened == 0  # released, so that a re-plugged one is opened afresh


def test_after_an_unplugging_the_next_arm_opens_it_again() -> None:
    bus = ScriptedUsb([Plugged(0x04B5, 0x6022)], [EEPROM, *_arming(10), Out(0xE3, 0, b"\x00", answer=GONE)])
    stream = GivenStream([], DigitizerError("Hantek 6022 was unplugged"))
    scope = Hantek6022(backend=bus, make_stream=stream)
    settings = CaptureSettings(10e6, 1000, 0)
    scope.arm(settings)
    with pytest.raises(DigitizerError, match="unplugged"):
        scope.read_into(np.empty((10, 2), np.int16), 0.1)
    bus.devices.clear()
    with pytest.raises(DigitizerError, match="no Hantek 6022 is plugged in"):
        scope.arm(settings)
    bus.devices.append(Plugged(0x1D50, 0x608E, address=9))  # back, with the other firmware: 10 MS/s is not its own
    bus.script = [EEPROM]
    with pytest.raises(DigitizerError, match="cannot sample"):
        scope.arm(settings)
    bus.script = [*_arming(8), Out(0xE3, 0, b"\x00")]
    stream.error = None
    scope.arm(CaptureSettings(8e6, 1000, 0))
    scope.stop()
    assert scope.read_into(np.empty((10, 2), np.int16), 0.1).ended
    bus.finish()


def test_arming_again_stops_the_stream_before() -> None:
    stop = Out(0xE3, 0, b"\x00")
    bus = ScriptedUsb([Plugged(0x04B5, 0x6022)], [EEPROM, *_arming(10), stop, *_arming(8), stop])
    streams = [GivenStream([]), GivenStream([])]
    made = iter(streams)
    scope = Hantek6022(backend=bus, make_stream=lambda *given: next(made)(*given))  # type: ignore[arg-type, return-value]
    scope.arm(CaptureSettings(10e6, 1000, 0))
    scope.arm(CaptureSettings(8e6, 1000, 0))
    assert [stream.stopped for stream in streams] == [True, False]
    scope.close()
    assert streams[1].stopped
    bus.finish()


@pytest.mark.parametrize("fails_at", [3, 5])
def test_a_device_that_is_lost_while_it_is_armed_is_let_go_and_opened_anew(fails_at: int) -> None:
    requests = _arming(10)
    requests[fails_at] = replace(requests[fails_at], answer=GONE)
    stop = [Out(0xE3, 0, b"\x00", answer=GONE)] if fails_at == 5 else []  # once its stream was begun
    bus = ScriptedUsb([Plugged(0x04B5, 0x6022)], [EEPROM, *requests[: fails_at + 1], *stop])
    stream = GivenStream([])
    scope = Hantek6022(backend=bus, make_stream=stream)
    with pytest.raises(DigitizerError, match="Hantek 6022 was unplugged"):
        scope.arm(CaptureSettings(10e6, 1000, 0))
    bus.finish()
    assert bus.opened == 0 and stream.stopped == (fails_at == 5)
    assert scope.read_into(np.empty((10, 2), np.int16), 0.0).ended
    bus.script = [EEPROM, *_arming(10), Out(0xE3, 0, b"\x00")]
    scope.arm(CaptureSettings(10e6, 1000, 0))
    scope.close()
    bus.finish()


def test_a_device_that_falls_silent_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two seconds after its last bytes; until then each wait is as long as the reader is willing to wait."""
    now = [70.0]
    monkeypatch.setattr("instrument.devices.hantek6022.time", SimpleNamespace(monotonic=lambda: now[0]))
    bus = ScriptedUsb([Plugged(0x04B5, 0x6022)], [EEPROM, *_arming(10), Out(0xE3, 0, b"\x00")])
    stream = GivenStream([Chunk(_codes(4), 71.0)])
    stream.waits = lambda timeout_s: now.__setitem__(0, now[0] + min(timeout_s, 0.25))
    scope = Hantek6022(backend=bus, make_stream=stream)
    scope.arm(CaptureSettings(10e6, 1000, 0))
    buffer = np.empty((10, 2), np.int16)
    assert scope.read_into(buffer, 0.5) == Block(0) and stream.waited == [0.5, 0.25]
    now[0] = 72.875
    assert scope.read_into(buffer, 0.125) == Block(0) and now[0] == 73.0
    with pytest.raises(DigitizerError, match=r"^Hantek 6022 sends nothing: unplug it, plug it in again and re-arm$"):
        scope.read_into(buffer, 1.0)
    assert now[0] == 73.25
    bus.finish()
