"""Find and load the firmware of the Hantek 6022, which is lost whenever it is unplugged.  Levimass contains none.

The FX2's loader takes control request 0xA0: 0x01 to 0xE600 stops its processor, the RAM image follows, and 0x00 to
0xE600 starts it.  The device then leaves the bus and returns with another identity (Cypress EZ-USB TRM, 3.8).
"""

import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import usb.core

from instrument.devices import usb_bus
from instrument.devices.digitizer import DigitizerError


def firmware_folders(system: str, environment: Mapping[str, str], home: Path) -> tuple[Path, ...]:
    """Return the folders of sigrok's firmware on a system (``sys.platform``): sigrok's own and PulseView's."""
    name = "sigrok-firmware"
    if system == "win32":
        programs = [environment[key] for key in ("ProgramFiles", "ProgramFiles(x86)") if key in environment]
        shared = [
            Path(root) / "sigrok" / program / "share" for root in programs for program in ("PulseView", "sigrok-cli")
        ]
        return tuple(folder / name for folder in (*shared, Path(environment.get("LOCALAPPDATA", home)) / "levimass"))
    own = home / ".local/share"
    if system == "darwin":
        return tuple(
            folder / name
            for folder in (Path("/opt/homebrew/share"), Path("/usr/local/share"), Path("/opt/local/share"),
                           Path("/Applications/PulseView.app/Contents/share"), own)
        )  # fmt: skip
    return tuple(folder / name for folder in (Path("/usr/share"), Path("/usr/local/share"), own))


def firmware_remedy(system: str) -> str:
    """Return instructions to install the firmware on a system (``sys.platform``)."""
    if system in ("win32", "darwin"):
        how = "install PulseView of sigrok, which brings it,"
    else:
        how = "install it (Debian: apt install sigrok-firmware-fx2lafw)"
    return f"{how} or name a firmware file in the device's settings"


FOLDERS = firmware_folders(sys.platform, os.environ, Path.home())
FILES = {0x6022: "fx2lafw-hantek-6022be.fw", 0x602A: "fx2lafw-hantek-6022bl.fw", 0x2020: "fx2lafw-hantek-6022be.fw"}
REMEDY = firmware_remedy(sys.platform)

IDS_WITHOUT_FIRMWARE = {(0x04B4, 0x6022), (0x04B4, 0x602A), (0x04B4, 0x2020)}
OPENHANTEK_IDS = {(0x04B5, 0x6022), (0x04B5, 0x602A), (0x04B5, 0x2020)}
SIGROK_ID = (0x1D50, 0x608E)
IDS_WITH_FIRMWARE = OPENHANTEK_IDS | {SIGROK_ID}

_LOAD = 0xA0
_CPU_CONTROL = 0xE600
_RAM_BYTES = 0x4000
_PIECE = 4096


Segments = list[tuple[int, bytes]]  # (address in the FX2's RAM, bytes to be written from there on)


def find_firmware(product: int) -> Path:
    """Return the installed firmware file for a product id.  Raises DigitizerError with the remedy."""
    name = FILES[product]
    for folder in FOLDERS:
        if (folder / name).is_file():
            return folder / name
    raise DigitizerError(f"the Hantek 6022 needs its firmware {name}, which is not on this computer", REMEDY)


def read_firmware(path: Path) -> Segments:
    """Read a RAM image (raw from address 0, or Intel HEX).  Raises a DigitizerError that names the file."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise DigitizerError(f"firmware file {path} cannot be read ({error.strerror})", REMEDY) from error
    if content[:1] == b":":
        return _intel_hex(content, path)
    if not 0 < len(content) <= _RAM_BYTES:
        raise DigitizerError(f"{path} is no FX2 firmware: {len(content)} bytes, at most {_RAM_BYTES} fit", REMEDY)
    return [(0, content)]


def _intel_hex(content: bytes, path: Path) -> Segments:
    segments: Segments = []
    for number, line in enumerate(content.split(), start=1):
        try:
            record = bytes.fromhex(line[1:].decode("ascii"))
        except ValueError as error:
            raise DigitizerError(f"{path}, line {number}: not a line of Intel HEX", REMEDY) from error
        if line[:1] != b":" or len(record) < 5 or len(record) != record[0] + 5 or sum(record) % 256:
            raise DigitizerError(f"{path}, line {number}: damaged line of Intel HEX", REMEDY)
        address = int.from_bytes(record[1:3], "big")
        if record[3] == 1:
            return segments
        if record[3] != 0 or address + record[0] > _RAM_BYTES:
            raise DigitizerError(f"{path}, line {number}: no record for the FX2's RAM", REMEDY)
        segments.append((address, record[4:-1]))
    raise DigitizerError(f"{path} ends before its last record", REMEDY)


def load_firmware(device: Any, segments: Segments, name: str) -> None:
    """Load the image into the RAM of a device without firmware and start it.  Raises DigitizerError."""
    with usb_bus.usb_errors_of(name):
        _write(device, _CPU_CONTROL, b"\x01")
        for address, content in segments:
            for at in range(0, len(content), _PIECE):
                _write(device, address + at, content[at : at + _PIECE])
    try:
        _write(device, _CPU_CONTROL, b"\x00")
    except usb.core.USBError:
        pass  # some devices leave the bus before they acknowledge; ``wait_for_firmware`` detects a failed start
    finally:
        usb_bus.release(device)


def _write(device: Any, address: int, content: bytes) -> None:
    written = device.ctrl_transfer(0x40, _LOAD, address, 0, content)
    if written != len(content):
        raise usb.core.USBError(f"{written} of {len(content)} firmware bytes taken", errno=5)


def wait_for_firmware(
    backend: Any,
    timeout_s: float = 3.0,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], object] = time.sleep,
) -> Any:
    """Return the device that reappears after its firmware was loaded.  Raises DigitizerError after ``timeout_s``."""
    end = clock() + timeout_s
    while True:
        if warm := usb_bus.find_devices(IDS_WITH_FIRMWARE, backend):
            return warm[0]
        if clock() >= end:
            raise DigitizerError(
                f"the Hantek 6022 did not come back within {timeout_s:g} s of loading its firmware",
                "unplug it, plug it in again and re-arm",
            )
        sleep(0.05)
