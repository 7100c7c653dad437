"""Driver of the Hantek 6022BE/BL: two channels of 8 bits, streamed without gaps and without a hardware trigger.

The device does not report overruns; whole 512-byte packets are then missing.  The driver detects a loss by comparing
the byte count with the clock and, if a channel carries the rest beat (PD0), by the beat's phase packet by packet.  Both
report ``lost_before`` None.  The driver uses the vendor requests of the OpenHantek or the sigrok firmware, whose rate
codes differ: code 10 is 10 MS/s for one and 100 kS/s for the other.
"""

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import usb.core
from numpy.typing import NDArray

from analysis.shot import Channel, Role, Setup
from instrument.devices import hantek6022_firmware as firmware_files
from instrument.devices import usb_bus
from instrument.devices.bulk_stream import BulkStream
from instrument.devices.digitizer import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError
from instrument.devices.source_options import SourceOptions, assumed_rig
from instrument.devices.streamed_codes import LONG_STEP_S, StreamedCodes

NAME = "Hantek 6022"
ENDPOINT = 0x86
SILENCE_S = 2.0

_EEPROM, _GAIN_1, _GAIN_2, _RATE, _RUN, _CHANNELS = 0xA2, 0xE0, 0xE1, 0xE2, 0xE3, 0xE4
_RATES_OPENHANTEK = {1e5: 110, 2e5: 120, 5e5: 150} | {m * 1e6: m for m in (1, 2, 3, 4, 5, 6, 8, 10, 12, 15)}
_RATES_SIGROK = {1e5: 10, 2e5: 20, 5e5: 50} | {m * 1e6: m for m in (1, 2, 4, 8, 12)}

_EASY_HZ = 12e6  # preferred up to here, as two channels at 15 MS/s nearly exhaust USB 2.0

StreamMaker = Callable[[Any, int, float, str], BulkStream]


class Hantek6022(Digitizer):
    """A Hantek 6022BE/BL, or a DDS/2020 of the same maker; the firmware is loaded if it is missing.

    ``roles`` are the roles of CH1 and CH2, ``gains`` their gain steps (1, 2, 5, 10 for +-5, 2.5, 1, 0.5 V).  If the
    device was unplugged, the next ``arm`` opens it again.
    """

    def __init__(
        self,
        roles: Sequence[Role] = (Role.REFERENCE, Role.MEASUREMENT),
        gains: Sequence[int] = (2, 2),
        *,
        firmware: Path | None = None,
        setup: Setup | None = None,
        backend: Any = None,
        make_stream: StreamMaker = BulkStream,
    ) -> None:
        if len(roles) != 2 or len(set(roles)) != 2 or Role.MEASUREMENT not in roles:
            raise DigitizerError(f"{NAME}: one of its two channels must carry the measuring beat, the other not")
        if len(gains) != 2 or any(gain not in GAINS for gain in gains):
            raise DigitizerError(f"{NAME}: input gain must be one of {', '.join(map(str, GAINS))}")
        self._roles = tuple(roles)
        self._gains = tuple(gains)
        self._firmware = firmware
        self._setup = setup or assumed_rig()
        self._backend = backend
        self._make_stream = make_stream
        self._device: Any = None
        self._lock = threading.Lock()
        self._stream: BulkStream | None = None
        self._rates: dict[float, int] = {}
        self._eeprom = b""
        self._reference_column = self._roles.index(Role.REFERENCE) if Role.REFERENCE in self._roles else None
        self._codes: StreamedCodes | None = None  # codes of the stream armed last
        self._fault: DigitizerError | None = None
        self._received_s: float  # time at which the last bytes arrived
        self._open()

    @property
    def capabilities(self) -> Capabilities:
        """Get the device's capabilities; the scales come from its calibration EEPROM."""
        return Capabilities(
            name=NAME,
            channels=tuple(channel_of(self._roles[n], gain, n, self._eeprom) for n, gain in enumerate(self._gains)),
            bits=8,
            rates_hz=tuple(sorted(self._rates, key=lambda rate: (rate > _EASY_HZ, -rate))),
            max_samples=None,
            hardware_trigger=False,
            real_time=True,
            unseen_loss_s=LONG_STEP_S if self._reference_column is None else 0.0,
        )

    @property
    def setup(self) -> Setup:
        return self._setup

    def default_settings(self) -> CaptureSettings:
        """Return the settings of a sixth of a second at the fastest rate that USB carries easily."""
        rate = self.capabilities.rates_hz[0]
        samples = round(rate / 6)
        return CaptureSettings(rate, samples, round(0.15 * samples))

    def arm(self, settings: CaptureSettings) -> None:
        """Start sampling; open the device again if it was unplugged.  Raises DigitizerError."""
        self.stop()
        if self._device is None:
            self._open()
        code = self._rates.get(settings.sample_rate_hz)
        if code is None:
            offered = ", ".join(f"{rate / 1e6:g}" for rate in sorted(self._rates))
            raise DigitizerError(
                f"{NAME} cannot sample at {settings.sample_rate_hz:g} samples/s", f"take one of {offered} MS/s"
            )
        try:
            with usb_bus.usb_errors_of(NAME):
                self._request(_RUN, 0)
                self._request(_GAIN_1, self._gains[0])
                self._request(_GAIN_2, self._gains[1])
                self._request(_RATE, code)
                self._request(_CHANNELS, 2)
                bytes_per_s = 2 * settings.sample_rate_hz
                stream = self._make_stream(self._device, ENDPOINT, bytes_per_s, NAME)
                stream.start()  # before sampling begins, so that the device's small FIFO never overflows
                self._codes = StreamedCodes(bytes_per_s, self._reference_column)
                self._fault = None
                self._received_s = time.monotonic()
                self._stream = stream
                self._request(_RUN, 1)
        except DigitizerError:
            self.stop()
            self._forget_device()
            raise

    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        """Fill ``buffer`` with codes minus 128; a loss begins a new block, a fault is raised after its samples."""
        stream, codes = self._stream, self._codes
        end = time.monotonic() + timeout_s
        while codes is None or not codes.ready:
            if codes is None or stream is None or self._stream is not stream:
                return Block(0, ended=True)
            if self._fault is not None:
                fault = self._fault
                self.stop()
                self._forget_device()
                raise fault
            try:
                chunk = stream.take(end - time.monotonic())
            except DigitizerError as error:
                self._fault = error
                codes.flush()
                continue
            if chunk is not None:
                self._received_s = chunk.received_s
                codes.accept(chunk)
            elif self._stream is stream:
                if time.monotonic() - self._received_s > SILENCE_S:
                    self._fault = DigitizerError(f"{NAME} sends nothing", "unplug it, plug it in again and re-arm")
                    codes.flush()
                elif time.monotonic() >= end:
                    return Block(0)
        return codes.deliver(buffer)

    def stop(self) -> None:
        with self._lock:
            stream, self._stream = self._stream, None
            if stream is None:
                return
            stream.wake()
            stream.stop()
            try:
                self._request(_RUN, 0)
            except (usb.core.USBError, NotImplementedError):
                return  # the device is gone or hangs; the next ``arm`` reports this

    def close(self) -> None:
        self.stop()
        self._forget_device()

    def _open(self) -> None:
        backend = self._backend if self._backend is not None else usb_bus.find_backend()
        warm = usb_bus.find_devices(firmware_files.IDS_WITH_FIRMWARE, backend)
        if warm:
            device = warm[0]
        else:
            cold = usb_bus.find_devices(firmware_files.IDS_WITHOUT_FIRMWARE, backend)
            if not cold:
                raise DigitizerError(f"no {NAME} is plugged in", "plug it in and try again")
            device = self._load_firmware(cold[0], backend)
        usb_bus.claim(device, 0, NAME)
        self._device = device
        sigrok = (device.idVendor, device.idProduct) == firmware_files.SIGROK_ID
        self._rates = _RATES_SIGROK if sigrok else _RATES_OPENHANTEK
        self._eeprom = self._read_eeprom()

    def _load_firmware(self, device: Any, backend: Any) -> Any:
        path = self._firmware or firmware_files.find_firmware(device.idProduct)
        segments = firmware_files.read_firmware(path)
        usb_bus.claim(device, 0, NAME)
        firmware_files.load_firmware(device, segments, NAME)
        return firmware_files.wait_for_firmware(backend)

    def _read_eeprom(self) -> bytes:
        try:
            return bytes(self._device.ctrl_transfer(0xC0, _EEPROM, EEPROM_START, 0, EEPROM_BYTES, timeout=500))
        except (usb.core.USBError, NotImplementedError):
            return b""  # the sigrok firmware cannot read the EEPROM, so the nominal scales apply

    def _request(self, request: int, value: int) -> None:
        self._device.ctrl_transfer(0x40, request, 0, 0, bytes([value]))

    def _forget_device(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            usb_bus.release(device)


def open_digitizer(_: str, options: SourceOptions) -> Hantek6022:
    """Open the first Hantek 6022 that is plugged in."""
    firmware = options.text("firmware", "")
    return Hantek6022(
        options.roles("reference,measurement"),
        options.wholes("gains", "2,2", "gain"),
        firmware=Path(firmware) if firmware else None,
        setup=options.rig(),
    )


FULL_SCALE_V = 5.12  # at gain 1, from the middle code to the rail
GAINS = (1, 2, 5, 10)  # +- 5, 2.5, 1 and 0.5 V
EEPROM_START = 8
EEPROM_BYTES = 80

_RANGE_INDEX = {10: 0, 5: 3, 2: 4, 1: 7}  # gain -> index of its range among the eight of the calibration programs
_OFFSET, _GAIN, _FINE = 0, 32, 48  # byte positions relative to EEPROM_START
_UNSET = b"\x00\xff"


def channel_of(role: Role, gain: int, column: int, eeprom: bytes) -> Channel:
    """Return the channel of ``column`` (0 or 1) at a gain step; ``eeprom`` are the bytes from EEPROM_START on.

    A count is the code minus 128.
    """
    at = 2 * _RANGE_INDEX[gain] + column
    offset = _correction(eeprom, _OFFSET + at) + _correction(eeprom, _FINE + at) / 250
    volts = FULL_SCALE_V / (128 * gain) * (1 + _correction(eeprom, _GAIN + at) / 500)
    return Channel(role, volts, -offset * volts)


def _correction(eeprom: bytes, at: int) -> int:
    if at >= len(eeprom) or eeprom[at] in _UNSET:
        return 0
    return eeprom[at] - 128
