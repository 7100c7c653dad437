"""Drivers in a capture: from the device's bytes to a recording on disk."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Role
from instrument.capture.acquisition import State
from instrument.capture.capture import Capture, acquire
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.bulk_stream import Chunk
from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.devices.hantek6022 import Hantek6022
from instrument.devices.scpi import ScpiOscilloscope
from instrument.devices.scpi_dialects import RIGOL
from instrument.devices.scpi_links import VisaTransport
from instrument.devices.sources import open_source
from instrument.files.recording_file import read_recording
from tests.instrument.devices.scpi_emulator import EmulatedScope, TcpScope
from tests.instrument.devices.scripted_usb import In, Out, Plugged, ScriptedUsb
from tests.instrument.devices.test_hantek6022_bytes import GivenStream


def test_two_shots_of_an_oscilloscope_are_recorded(tmp_path: Path) -> None:
    scope = EmulatedScope("rigol", samples=600_000, trigger_at=60_000)
    with TcpScope(scope) as server:
        digitizer = open_source(f"scpi:127.0.0.1:{server.port}?mass=0.02")
        paths = acquire(digitizer, tmp_path, 2, timeout_s=20.0)
    assert len(paths) == 2
    for path in paths:
        shot = read_recording(path)
        assert (shot.samples, shot.sample_rate_hz, shot.trigger_sample) == (600_000, 1e7, 60_000)
        assert (shot.setup.moving_mass_kg, shot.setup.digitizer_bits, shot.gaps) == (0.02, 8, ())
        for column, channel in enumerate(shot.channels):
            volts = shot.counts[:, column] * channel.volts_per_count + channel.offset_v
            np.testing.assert_allclose(volts, scope.volts(column + 1), atol=1e-9)


class GatedStream(GivenStream):
    """A stream that begins when it is let, and then comes in its own time."""

    def __init__(self, gate: threading.Event, chunks: list[Chunk], error: DigitizerError) -> None:
        super().__init__(chunks, error)
        self.gate = gate

    def take(self, timeout_s: float) -> Chunk | None:
        if not self.gate.wait(timeout_s):
            return None
        time.sleep(0.005)
        return super().take(timeout_s)


def _wait_for(happened: Callable[[], object], timeout_s: float = 30.0) -> None:
    end = time.monotonic() + timeout_s
    while not happened():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.parametrize("unplugged", [False, True])
def test_a_hanteks_shot_is_recorded_as_far_as_it_came(tmp_path: Path, unplugged: bool) -> None:
    packets = 2000
    samples = packets * 256
    codes = np.empty((samples, 2), np.uint8)
    fires = 200_000
    codes[:, 0] = np.where(np.arange(samples) < fires, 220, 30)
    codes[:, 1] = 128 + 60 * np.cos(2 * np.pi * 0.27 * np.arange(samples))
    pieces = np.split(codes.reshape(-1), 20)
    arming = [Out(0xE3, 0, b"\x00"), *(Out(r, 0, bytes([v])) for r, v in ((0xE0, 2), (0xE1, 2), (0xE2, 10), (0xE4, 2)))]
    bus = ScriptedUsb(
        [Plugged(0x04B5, 0x6022)], [In(0xA2, 8, 80, b""), *arming, Out(0xE3, 0, b"\x01"), Out(0xE3, 0, b"\x00")]
    )
    armed = threading.Event()
    stream = GatedStream(
        armed,
        [Chunk(piece, i * piece.size / 20e6) for i, piece in enumerate(pieces)],
        DigitizerError("Hantek 6022 was unplugged", "plug it in again and re-arm"),
    )
    digitizer = Hantek6022((Role.SWITCH, Role.MEASUREMENT), backend=bus, make_stream=stream)
    wanted = 600_000 if unplugged else 200_000
    said: list[str] = []
    options = CaptureOptions(tmp_path, CaptureSettings(10e6, wanted, 50_000))
    with Capture(digitizer, options, live=False, say=said.append) as capture:
        capture.arm()
        _wait_for(lambda: capture.latest().state is State.ARMED)
        armed.set()
        _wait_for(lambda: any(shot.path for shot in capture.latest().finished))
        _wait_for(lambda: said or not unplugged)
    assert said == (["Hantek 6022 was unplugged: plug it in again and re-arm"] if unplugged else said)
    (path,) = tmp_path.glob("*.sigmf-meta")
    shot = read_recording(path)
    first = fires - 2048 - 50_000  # in the stream: the settling samples are not delivered
    kept = min(wanted, samples - 2048 - first)
    assert (shot.samples, shot.trigger_sample) == (kept, 50_000)
    expected = codes[2048 + first :][:kept].astype(np.int16) - 128
    np.testing.assert_array_equal(shot.counts, expected)
    assert dict(shot.setup.extra)["moving_mass_assumed"] is True
    # without PD0 only the clock tells a loss, and not a short one: the recording says so
    assert shot.extra["global"]["lmm:capture"]["unseen_loss_s"] == 0.004


class FakeVisa:
    """pyvisa's resource manager and session over an EmulatedScope."""

    def __init__(self, scope: EmulatedScope) -> None:
        self.scope, self.waiting, self.closed = scope, b"", False

    def open_resource(self, name: str) -> "FakeVisa":
        if "9.9.9.9" in name:
            raise OSError("VI_ERROR_RSRC_NFOUND:\n not found")
        return self

    def write(self, command: str) -> None:
        self.waiting = self.scope.answer(command) or b""

    def read(self) -> str:
        answer, self.waiting = self.waiting, b""
        return answer.decode()

    def read_bytes(self, count: int) -> bytes:
        part, self.waiting = self.waiting[:count], self.waiting[count:]
        assert len(part) == count
        return part

    def clear(self) -> None:
        self.waiting = b""

    def close(self) -> None:
        self.closed = True


def test_a_shot_over_visa() -> None:
    scope = EmulatedScope("rigol", samples=600_000, polls_until_trigger=1)
    visa = FakeVisa(scope)
    digitizer = ScpiOscilloscope(VisaTransport("TCPIP0::1.2.3.4::INSTR", visa))
    digitizer.arm(digitizer.default_settings())
    got = []
    while True:
        buffer = np.empty((200_000, 2), np.int16)
        block = digitizer.read_into(buffer, 2.0)
        got.append(buffer[: block.samples])
        if block.ended:
            break
    np.testing.assert_array_equal(np.concatenate(got)[:, 0] + 128, scope.codes(1))
    digitizer.close()
    assert visa.closed
    assert digitizer.capabilities.bits == RIGOL.bits


def test_an_unknown_visa_resource_is_one_line() -> None:
    with pytest.raises(DigitizerError, match=r"cannot be opened \(VI_ERROR_RSRC_NFOUND: not found\)"):
        VisaTransport("TCPIP0::9.9.9.9::INSTR", FakeVisa(EmulatedScope("rigol")))


@pytest.mark.parametrize("most", [4, 5])
def test_a_block_over_visa_is_taken_up_to_the_size_asked_for(most: int) -> None:
    visa = FakeVisa(EmulatedScope("rigol"))
    transport = VisaTransport("TCPIP0::1.2.3.4::INSTR", visa)
    visa.write = lambda _: setattr(visa, "waiting", b"#15abcde\n")  # type: ignore[method-assign]
    if most == 5:
        assert transport.query_block(":WAV:DATA?", most) == b"abcde" and visa.waiting == b""
    else:
        with pytest.raises(DigitizerError, match="announced 5 bytes where at most 4 were requested"):
            transport.query_block(":WAV:DATA?", most)
