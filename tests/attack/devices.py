"""Devices on a bad day: USB pulled and plugged in mid-shot, requests that fail, NI errors, clocks set back."""

import errno
import random
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import usb.core

from analysis.shot.recording import Role
from instrument.capture.acquisition import Acquisition
from instrument.capture.capture import AcquireError, acquire
from instrument.capture.snapshot import Snapshot
from instrument.devices.bulk_stream import Chunk
from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.devices.hantek6022 import Hantek6022
from instrument.devices.niscope_card import NiscopeCard
from instrument.files.recording_file import read_recording
from tests.attack.trial import REFUSED, SURVIVED, Attempt, refused_in_a_line
from tests.instrument.capturing import Capturing, assert_true_samples, until
from tests.instrument.devices.scripted_usb import Plugged, ScriptedUsb
from tests.instrument.fake_digitizer import FakeDigitizer

USB_ERRORS = (
    usb.core.USBError("Pipe error", -9, errno.EPIPE), usb.core.USBError("Timed out", -7, errno.ETIMEDOUT),
    usb.core.USBError("No such device", -4, errno.ENODEV), usb.core.USBError("I/O error", -1, errno.EIO),
    usb.core.USBError("Overflow", -8, errno.EOVERFLOW), usb.core.USBError("unknown"), NotImplementedError("not here"),
)  # fmt: skip
SETTINGS = CaptureSettings(1e6, 20_000, 3_000)


class RogueBus(ScriptedUsb):
    """Answers every request; the ``fail_at``-th fails, and what is read may be anything."""

    def __init__(self, random_: random.Random, fail_at: int) -> None:
        super().__init__([Plugged(0x04B5, 0x6022)])
        self.random = random_
        self.fail_at = fail_at
        self.asked = 0
        self.error = random_.choice(USB_ERRORS)

    def ctrl_transfer(
        self, handle: Plugged, request_type: int, request: int, value: int, index: int, data: Any, timeout: int
    ) -> int:
        self.asked += 1
        if self.asked == self.fail_at:
            raise self.error
        if request_type & 0x80:
            answer = self.random.randbytes(self.random.choice((0, 1, len(data))))
            data[: len(answer)] = type(data)("B", answer)
            return len(answer)
        return len(data)


class RogueFlow:
    """A stream of a light switch and a beat, that ends in the middle in one of the ways a cable knows."""

    def __init__(self, random_: random.Random, end: str | None) -> None:
        self.end, self.random = end, random_
        self.at = 0
        self.ends_at = random_.randrange(1, 12)
        self.chunks = 0

    def __call__(self, device: Any, endpoint: int, bytes_per_s: float, name: str) -> "RogueFlow":
        self.begun_s = time.monotonic()
        return self

    def start(self) -> None:
        """Begin."""

    def take(self, timeout_s: float) -> Chunk | None:
        """Return the next 4096 samples of both channels."""
        self.chunks += 1
        if self.end is not None and self.chunks >= self.ends_at:
            if self.end == "unplugged":
                raise DigitizerError("Hantek 6022 was unplugged", "plug it in again and re-arm")
            if self.end == "stall":
                time.sleep(min(timeout_s, 0.02))
                return None
            if self.end == "odd":
                return Chunk(np.frombuffer(self.random.randbytes(self.random.choice((1, 511, 513))), np.uint8), 0.0)
        n = np.arange(self.at, self.at + 4096)
        self.at += 4096
        codes = np.empty((4096, 2), np.uint8)
        codes[:, 0] = np.where(n // 20_000 % 2, 220, 30)
        codes[:, 1] = 128 + 90 * np.sin(0.57 * n)
        return Chunk(codes.reshape(-1), self.begun_s + self.at / 1e6, self.end == "gaps" and self.chunks % 3 == 0)

    def wake(self) -> None:
        """Nothing waits."""

    def stop(self) -> None:
        """End."""


def usb_devices(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """A Hantek whose requests fail, or that is pulled, stalls or sends odd bytes in mid-shot; then it is well."""
    number = 0
    while True:
        number += 1
        end = random_.choice((None, "unplugged", "stall", "odd", "gaps"))
        fail_at = random_.choice((0, random_.randrange(1, 12)))

        def attempt(number: int = number, end: str | None = end, fail_at: int = fail_at) -> str:
            return _shot_from_usb(folder / str(number), random_, end, fail_at)

        yield f"{end}, request {fail_at} fails", attempt


def _shot_from_usb(folder: Path, random_: random.Random, end: str | None, fail_at: int) -> str:
    bus, roles = RogueBus(random_, fail_at), (Role.SWITCH, Role.MEASUREMENT)
    ended = REFUSED
    try:
        scope = Hantek6022(roles, backend=bus, make_stream=RogueFlow(random_, end))
        acquire(scope, folder, 1, SETTINGS, timeout_s=2.0)
        ended = SURVIVED
    except (AcquireError, DigitizerError) as error:
        refused_in_a_line(str(error))
    for path in folder.glob("*.sigmf-meta") if folder.exists() else ():
        assert read_recording(path).samples > 0
    # plugged in again, the next shot is whole
    again = Hantek6022(roles, backend=RogueBus(random_, 0), make_stream=RogueFlow(random_, None))
    (path,) = acquire(again, folder / "again", 1, SETTINGS, timeout_s=5.0)
    assert read_recording(path).samples == SETTINGS.samples
    return ended


class NiError(Exception):
    """As NI's package raises them: nothing but Exception above."""


def ni_cards(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """NI's package raising at every one of its calls in turn, or answering nonsense."""
    number = 0
    errors = [NiError("-1074135040: the memory\nis full"), OSError(5, "I/O"), ValueError("x"), RuntimeError("\x1b[2J"),
              MemoryError(), KeyError("gone")]  # fmt: skip
    while True:
        for fail_at in range(16):
            number += 1
            error = random_.choice(errors)
            gain = random_.choice((1e-4, 1e-4, 0.0, float("nan"), 1e300, -1.0))

            def attempt(
                number: int = number, fail_at: int = fail_at, error: Exception = error, gain: float = gain
            ) -> str:
                return _shot_from_ni(folder / str(number), fail_at, error, gain)

            yield f"call {fail_at}: {type(error).__name__}, gain {gain}", attempt


def _shot_from_ni(folder: Path, fail_at: int, error: Exception, gain: float) -> str:
    try:
        acquire(NiscopeCard("Dev1", package=_package(fail_at, error, gain)), folder, 1, SETTINGS, timeout_s=2.0)
    except (AcquireError, DigitizerError) as refusal:
        return refused_in_a_line(str(refusal))
    for path in folder.glob("*.sigmf-meta"):
        assert all(channel.volts_per_count for channel in read_recording(path).channels)
    return SURVIVED


def _package(fail_at: int, error: Exception, gain: float) -> Any:
    """Return what looks like NI's package, and fails at one call."""
    calls = [0]

    def counted(answer: Any = None) -> Any:
        def call(*_: Any, **__: Any) -> Any:
            calls[0] += 1
            if calls[0] == fail_at:
                raise error
            return answer() if callable(answer) else answer

        return call

    class Session:
        def __init__(self, *_: Any) -> None:
            counted()()
            channel = SimpleNamespace(configure_vertical=counted(), fetch_into=counted(self._infos))
            self.channels = SimpleNamespace()
            self.channels = {"0,1": channel}
            for name in (
                "configure_horizontal_timing",
                "configure_trigger_edge",
                "configure_trigger_digital",
                "abort",
                "close",
            ):
                setattr(self, name, counted())
            self.acquisition_status = counted("complete")

        def _infos(self) -> list[Any]:
            return [SimpleNamespace(gain=gain, offset=0.0, x_increment=1e-6, relative_initial_x=-3e-3)] * 2

        @property
        def horz_sample_rate(self) -> float:
            return counted(1e6)()  # type: ignore[no-any-return]

        def initiate(self) -> Any:
            counted()()
            outer = self

            class Begun:
                def __enter__(self) -> Any:
                    return outer

                def __exit__(self, *_: Any) -> None:
                    counted()()

            return Begun()

    names = SimpleNamespace(DC=1, POSITIVE=1, NEGATIVE=0, COMPLETE="complete")
    return SimpleNamespace(Session=Session, VerticalCoupling=names, TriggerSlope=names, TriggerCoupling=names,
                           AcquisitionStatus=names)  # fmt: skip


def clocks(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """A clock that is set back and forth, by hours, while shots are taken."""
    number = 0
    while True:
        number += 1

        def attempt(number: int = number) -> str:
            place = folder / str(number)
            place.mkdir(parents=True)
            shift = [0.0]

            def clock() -> float:
                if random_.random() < 0.02:
                    shift[0] += random_.choice((-3600.0, -1.0, 1.0, 2.0))
                return time.monotonic() + shift[0]

            with Capturing(place, FakeDigitizer(), live=False, machine=Acquisition(clock)) as rig:
                for index in range(2):
                    rig.capture.arm()
                    until(rig.capture, lambda now, index=index: _taken(now, index), 15.0)
            shots = sorted(place.glob("*.sigmf-meta"))
            assert len(shots) == 2
            for path in shots:
                assert_true_samples(read_recording(path))
            return SURVIVED

        yield "set back and forth", attempt


def _taken(now: Snapshot, number: int) -> bool:
    return any(shot.number > number and shot.path is not None for shot in now.finished)
