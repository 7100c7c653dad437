"""Oscilloscopes that flood, stall and send nonsense: reported in time; no received sample is lost."""

import time
from pathlib import Path

import numpy as np
import pytest

from instrument.capture.capture import AcquireError, acquire
from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.devices.scpi import ScpiOscilloscope
from instrument.devices.scpi_dialects import ImplausibleAnswer, Scaling
from instrument.devices.scpi_links import Deadline
from instrument.files.recording_file import read_recording
from tests.attack.scopes import BEFORE, RATE_HZ, SAMPLES, Hasty, Mischief, RogueScope
from tests.instrument.devices.scpi_emulator import EmulatedScope

SETTINGS = CaptureSettings(RATE_HZ, SAMPLES, BEFORE)


@pytest.mark.parametrize("flood", ["newlines", "blanks", "digits", "zeros"])
def test_a_flood_ends_with_the_deadline(flood: str) -> None:
    """A flood of newlines hung for ever: the clock was looked at only while nothing arrived."""
    with RogueScope(EmulatedScope("rigol"), Mischief(f"flood of {flood}", 1)) as server:
        begun = time.monotonic()
        with pytest.raises(DigitizerError) as caught:
            ScpiOscilloscope(Hasty("127.0.0.1", server.port))
        assert time.monotonic() - begun < 5.0 and "\n" not in str(caught.value)


@pytest.mark.parametrize("maker", ["rigol", "keysight"])
def test_a_transfer_that_stalls_is_told_as_such_and_what_came_is_kept(maker: str, tmp_path: Path) -> None:
    scope = EmulatedScope(maker)
    answers = _answers_until_block(scope, 2)
    with RogueScope(EmulatedScope(maker), Mischief("stall", answers, 0.5)) as server:
        digitizer = ScpiOscilloscope(Hasty("127.0.0.1", server.port))
        with pytest.raises(AcquireError, match="WAV:DATA") as caught:
            acquire(digitizer, tmp_path, 1, SETTINGS, timeout_s=1.0)
    assert "light switch did not fire" not in str(caught.value)
    (kept,) = tmp_path.glob("*.sigmf-meta")
    shot = read_recording(kept)
    assert 0.45 * SAMPLES < shot.samples < 0.55 * SAMPLES and "cut_short" in shot.flags
    volts = shot.counts[:, 1] * shot.channels[1].volts_per_count + shot.channels[1].offset_v
    np.testing.assert_allclose(volts, scope.volts(2)[: shot.samples], atol=1e-12)


def _answers_until_block(scope: EmulatedScope, block: int) -> int:
    """Return the number of the answer that is the ``block``-th block, in a talk that goes well."""
    seen: list[bytes] = []
    answer = scope.answer

    def listen(line: str) -> bytes | None:
        said = answer(line)
        if said is not None:
            seen.append(said)
        return said

    scope.answer = listen  # type: ignore[method-assign]
    with RogueScope(scope, Mischief("none", 10**9)) as server:
        digitizer = ScpiOscilloscope(Hasty("127.0.0.1", server.port))
        digitizer.arm(SETTINGS)
        buffer = np.empty((SAMPLES, 2), np.int16)
        while not digitizer.read_into(buffer, 0.5).ended:
            pass
        digitizer.close()
    return [place for place, said in enumerate(seen, 1) if said.startswith(b"#")][block - 1]


@pytest.mark.parametrize("maker", ["rigol", "siglent", "keysight"])
@pytest.mark.parametrize("number", ["0", "1e300", "-1e300", "1e-310"])
def test_scales_that_cannot_be_are_refused_before_arming(maker: str, number: str) -> None:
    """A preamble of zeros recorded volts_per_count 0, which the program itself would not open."""
    scope = EmulatedScope(maker)
    scope.garbage = {
        ":WAV:PRE?": ",".join([number] * 10).encode() + b"\n",
        "C1:VDIV?": number.encode() + b"\n",
    }
    with RogueScope(scope, Mischief("none", 10**9)) as server:
        digitizer = ScpiOscilloscope(Hasty("127.0.0.1", server.port))
        with pytest.raises(DigitizerError, match=r"V per count|due"):
            digitizer.arm(SETTINGS)
        digitizer.close()
        assert not {":SING", "ARM"} & set(scope.log)


@pytest.mark.parametrize("number", [b"0\n", b"1e300\n", b"-5\n", b"9.9E+37\n"])
def test_rates_that_cannot_be_are_refused(number: bytes) -> None:
    scope = EmulatedScope("rigol", garbage={":ACQ:SRAT?": number})
    with RogueScope(scope, Mischief("none", 10**9)) as server:
        digitizer = ScpiOscilloscope(Hasty("127.0.0.1", server.port))
        with pytest.raises(ImplausibleAnswer, match="a second"):
            digitizer.default_settings()
        digitizer.close()


def test_a_deadline_moves_with_the_size_alone() -> None:
    deadline = Deadline(0.0)
    with pytest.raises(DigitizerError, match="in time"):
        deadline.check("scope", ":WAV:DATA?")
    deadline.allow_for(5_000_000)
    assert 99 < deadline.check("scope", ":WAV:DATA?") <= 100
    with pytest.raises(ImplausibleAnswer):
        Scaling(0.0, 0.0)
