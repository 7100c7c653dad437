"""Checks of this computer for ``levimass doctor``: Python, packages, USB, devices, drivers and disk, one line each."""

import importlib.metadata
import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from instrument.devices.device_search import found_devices, udev_instructions
from instrument.devices.digitizer import DigitizerError
from instrument.files import error_words

LOW_DISK_BYTES = 2 << 30
EMPTY_DISK_BYTES = 200 << 20
SHOT_BYTES = 20 << 20  # 5 M samples of two channels
_RULES = (Path("/etc/udev/rules.d"), Path("/usr/lib/udev/rules.d"), Path("/lib/udev/rules.d"))


class Grade(StrEnum):
    """The result of a check."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Check:
    """One check: name, result, and one line with the finding and its remedy."""

    name: str
    grade: Grade
    line: str


def check_computer(folder: Path, backend: Any = None) -> tuple[Check, ...]:
    """Run all checks; ``folder`` is the intended folder of recordings.  Never raises."""
    checks: list[Check] = []
    parts: tuple[tuple[str, Callable[[], list[Check]]], ...] = (
        ("Python", _python),
        ("packages", _packages),
        ("USB library", lambda: _usb_library(backend)),
        ("devices", lambda: _devices(backend)),
        ("USB permission", _udev_rule),
        ("drivers", _drivers),
        ("disk", lambda: [_disk(folder)]),
    )
    for name, part in parts:
        try:
            checks += part()
        except Exception as error:  # a check that crashes is itself a finding
            checks.append(Check(name, Grade.FAIL, f"could not be examined: {error_words(error)}"))
    return tuple(checks)


def _python() -> list[Check]:
    line = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return [Check("Python", Grade.OK if sys.version_info >= (3, 11) else Grade.FAIL, line)]


def _packages() -> list[Check]:
    names = ("numpy", "scipy", "numba", "llvmlite", "PySide6-Essentials", "pyqtgraph", "pyusb")
    return [_package(name, Grade.FAIL, "not installed: reinstall Levimass") for name in names]


def _package(name: str, grade_if_missing: Grade, line_if_missing: str) -> Check:
    try:
        return Check(name, Grade.OK, importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return Check(name, grade_if_missing, line_if_missing)


def _usb_library(backend: Any) -> list[Check]:
    from instrument.devices.usb_bus import find_backend

    try:
        if backend is None:
            find_backend()
    except DigitizerError as error:
        return [Check("USB library", Grade.WARN, f"{error}; bench, replay and network oscilloscopes work without it")]
    return [Check("USB library", Grade.OK, "libusb 1.0 found")]


def _devices(backend: Any) -> list[Check]:
    try:
        found = found_devices(backend)
    except DigitizerError as error:
        return [Check("devices", Grade.WARN, f"USB not searched: {error.what}")]
    if not found:
        return [Check("devices", Grade.OK, "no digitizer is plugged in; the simulated bench needs none")]
    return [
        Check("device", Grade.FAIL, f"{d.name} ({d.where}): {d.problem}; {d.remedy}")
        if d.problem
        else Check("device", Grade.OK, f"{d.name} ({d.where}), source {d.source}")
        for d in found
    ]


def _udev_rule() -> list[Check]:
    if not sys.platform.startswith("linux"):
        return []
    for folder in _RULES:
        if (folder / "70-levimass.rules").is_file():
            return [Check("USB permission", Grade.OK, f"udev rule installed in {folder}")]
    steps = "; ".join(udev_instructions().splitlines())
    return [Check("USB permission", Grade.WARN, f"udev rule not installed; needed for USB digitizers only: {steps}")]


def _drivers() -> list[Check]:
    from instrument.devices import hantek6022_firmware as firmware
    from instrument.devices.niscope_card import load_package

    try:
        hantek = Check("Hantek firmware", Grade.OK, str(firmware.find_firmware(0x6022)))
    except DigitizerError as error:
        hantek = Check("Hantek firmware", Grade.WARN, f"not found, needed for a Hantek 6022 only; {error.remedy}")
    try:
        load_package()
        card = Check("niscope", Grade.OK, f"package {importlib.metadata.version('niscope')}")
    except (DigitizerError, importlib.metadata.PackageNotFoundError) as error:
        remedy = getattr(error, "remedy", "")
        card = Check("niscope", Grade.OK, f"not installed, needed for NI cards only; {remedy}")
    visa = _package("pyvisa", Grade.OK, "not installed, needed for VXI-11, HiSLIP and GPIB only")
    return [hantek, card, visa]


def _disk(folder: Path) -> Check:
    place = folder.absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    try:
        free = shutil.disk_usage(place).free
    except OSError as error:
        return Check("disk", Grade.FAIL, f"{folder}: {error.strerror}")
    line = f"{free / 1e9:.1f} GB free for {folder}"
    if free < EMPTY_DISK_BYTES:
        room = f"room for {free // SHOT_BYTES} shots"
        return Check("disk", Grade.FAIL, f"{line}: {room}; free some or choose another folder")
    return Check("disk", Grade.WARN if free < LOW_DISK_BYTES else Grade.OK, line)
