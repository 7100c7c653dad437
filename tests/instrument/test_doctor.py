"""The checks of the computer, with simulated buses and disks."""

import importlib.metadata
import os
import re
import sys
from collections import namedtuple
from pathlib import Path
from types import ModuleType

import pytest

from instrument.devices import device_search, doctor, hantek6022_firmware, usb_bus
from instrument.devices.digitizer import DigitizerError
from instrument.devices.doctor import Check, Grade, check_computer
from tests.instrument.devices.scripted_usb import Plugged, ScriptedUsb

TMC = {"interface_class": (0xFE, 3, 1), "endpoints": ((0x82, 2), (0x03, 2))}


@pytest.fixture(autouse=True)
def _not_this_computers_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_search, "_USB_NODES", Path("/nonexistent"))
    monkeypatch.setattr(device_search, "_PCI", Path("/nonexistent"))


def test_found_devices_say_what_stands_in_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hantek6022_firmware, "FOLDERS", ())
    bus = ScriptedUsb(
        [
            Plugged(0x04B4, 0x6022, address=1),
            Plugged(0x1D50, 0x608E, address=2, forbidden=True),
            Plugged(0x1AB1, 0x04CE, address=3, **TMC),
            Plugged(0x1AB1, 0x0999, address=4),  # Rigol's, but not for test and measurement
            Plugged(0x1234, 0x5678, address=5),
        ]
    )
    cold, barred, rigol = device_search.found_devices(bus)
    assert [(one.source, one.name, one.where) for one in (cold, barred, rigol)] == [
        ("hantek6022", "Hantek 6022", "USB bus 1, device 1, 04b4:6022"),
        ("hantek6022", "Hantek 6022", "USB bus 1, device 2, 1d50:608e"),
        ("scpi:usb:1ab1:04ce", "Rigol oscilloscope", "USB bus 1, device 3, 1ab1:04ce"),
    ]
    assert "fx2lafw-hantek-6022be.fw" in cold.problem
    assert "apt install sigrok-firmware-fx2lafw" in cold.remedy
    assert barred.problem == "no permission to open it"
    assert "udev" in barred.remedy
    assert [one.barred for one in (cold, barred, rigol)] == [False, True, False]
    assert (rigol.source, rigol.problem) == ("scpi:usb:1ab1:04ce", "")
    assert bus.opened == 0


def test_ni_cards_are_named_with_what_they_lack(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name, vendor in (("0000:01:00.0", "0x1093"), ("0000:02:00.0", "0x8086")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "vendor").write_text(vendor + "\n")
    monkeypatch.setattr(device_search, "_PCI", tmp_path)
    monkeypatch.setitem(__import__("sys").modules, "niscope", None)
    (card,) = device_search.found_devices(ScriptedUsb([]))
    assert (card.source, card.where) == ("niscope:Dev1", "PCI 0000:01:00.0") and "is not installed" in card.problem
    assert card.name.startswith("National Instruments card")
    assert "levimass[niscope]" in card.remedy


def test_every_check_is_one_line(tmp_path: Path) -> None:
    bus = ScriptedUsb([Plugged(0x1D50, 0x608E, forbidden=True), Plugged(0x1AB1, 0x04CE, address=3, **TMC)])
    checks = check_computer(tmp_path / "not" / "yet", bus)
    names = {check.name for check in checks}
    assert {"Python", "numpy", "USB library", "device", "Hantek firmware", "niscope", "disk"} <= names
    assert all(check.line and "\n" not in check.line for check in checks)
    barred, ready = (check for check in checks if check.name == "device")
    assert barred.grade is Grade.FAIL and "no permission" in barred.line and "udev" in barred.line
    assert ready.grade is Grade.OK and ready.line.endswith("source scpi:usb:1ab1:04ce")


def test_a_missing_usb_library_is_a_warning_with_its_remedy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def missing() -> None:
        raise DigitizerError("the USB library libusb-1.0 was not found", usb_bus.LIBRARY_REMEDY)

    monkeypatch.setattr(usb_bus, "find_backend", missing)
    found = {check.name: check for check in check_computer(tmp_path)}
    assert found["USB library"].grade is Grade.WARN
    assert "apt install libusb-1.0-0" in found["USB library"].line
    assert found["devices"].grade is Grade.WARN


@pytest.mark.parametrize(
    ("free", "grade"),
    [
        (2 * 2**30, "ok"),
        (2 * 2**30 - 1, "warn"),
        (200 * 2**20, "warn"),
        (200 * 2**20 - 1, "fail"),
    ],
)
def test_disk_room_is_graded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, free: int, grade: str) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda place: usage(1 << 40, 0, free))
    found = next(c for c in check_computer(tmp_path, ScriptedUsb([])) if c.name == "disk")
    assert found.grade == grade and found.line.startswith(f"{free / 1e9:.1f} GB free for {tmp_path}")
    left = "room for 9 shots; free some or choose another folder"  # of 20 MiB
    assert (left in found.line) == (grade == "fail")


def test_of_a_bare_computer_every_check_is_told_with_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def missing(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    monkeypatch.setitem(sys.modules, "niscope", None)
    monkeypatch.setattr(hantek6022_firmware, "FOLDERS", ())
    monkeypatch.setattr(doctor, "_RULES", (tmp_path / "none", tmp_path))
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys, "version_info", (3, 10, 9))
    packages = ("numpy", "scipy", "numba", "llvmlite", "PySide6-Essentials", "pyqtgraph", "pyusb")
    found = check_computer(tmp_path, ScriptedUsb([]))
    assert [(check.name, check.grade.value) for check in found] == [
        ("Python", "fail"),
        *((name, "fail") for name in packages),
        *(("USB library", "ok"), ("devices", "ok"), ("USB permission", "warn")),
        *(("Hantek firmware", "warn"), ("niscope", "ok"), ("pyvisa", "ok"), ("disk", "ok")),
    ]
    lines = {check.name: check.line for check in found}
    assert {lines[name] for name in packages} == {"not installed: reinstall Levimass"}
    assert lines["devices"].startswith("no digitizer is plugged in") and lines["USB library"] == "libusb 1.0 found"
    assert lines["USB permission"].startswith("udev rule not installed; needed for USB digitizers only: sudo cp ")
    assert lines["Hantek firmware"].startswith("not found, needed for a Hantek 6022 only; install it")
    assert lines["niscope"].startswith("not installed, needed for NI cards only; pip install 'levimass[niscope]'")
    (tmp_path / "70-levimass.rules").touch()
    monkeypatch.setattr(sys, "version_info", (3, 11))
    installed = {check.name: check for check in check_computer(tmp_path, ScriptedUsb([]))}
    assert installed["Python"].grade is Grade.OK
    assert installed["USB permission"] == Check("USB permission", Grade.OK, f"udev rule installed in {tmp_path}")
    monkeypatch.setattr(sys, "platform", "darwin")
    assert "USB permission" not in {check.name for check in check_computer(tmp_path, ScriptedUsb([]))}
    monkeypatch.setattr(importlib.metadata, "version", lambda name: f"{name} 9")
    there = {check.name: check.line for check in check_computer(tmp_path, ScriptedUsb([]))}
    assert there["numpy"] == "numpy 9" and there["pyvisa"] == "pyvisa 9"
    assert there["niscope"].startswith("not installed, needed for NI cards only")  # it cannot be imported all the same
    monkeypatch.setitem(sys.modules, "niscope", ModuleType("niscope"))
    assert {check.name: check.line for check in check_computer(tmp_path, ScriptedUsb([]))}[
        "niscope"
    ] == "package niscope 9"


def test_the_doctor_survives_a_part_that_fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(backend: object) -> None:
        raise RuntimeError("sysfs\nis odd")

    monkeypatch.setattr(doctor, "_devices", broken)
    devices = next(c for c in check_computer(tmp_path, ScriptedUsb([])) if c.name == "devices")
    assert (devices.grade, devices.line) == (Grade.FAIL, "could not be examined: sysfs is odd")


def test_the_udev_rule_covers_every_device_the_drivers_know() -> None:
    rule = device_search.udev_rule_path().read_text()
    for vendor, product in (*hantek6022_firmware.IDS_WITHOUT_FIRMWARE, *hantek6022_firmware.IDS_WITH_FIRMWARE):
        assert re.search(f'"{vendor:04x}".*"{product:04x}".*uaccess', rule)
    from instrument.devices.usbtmc import VENDORS

    for vendor in VENDORS:
        assert re.search(f'"{vendor:04x}", TAG\\+="uaccess"', rule)
    assert str(device_search.udev_rule_path()) in device_search.udev_instructions()


def test_permission_is_read_from_the_device_node(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "001").mkdir()
    (tmp_path / "001" / "007").touch()
    monkeypatch.setattr(device_search, "_USB_NODES", tmp_path)
    asked = []
    monkeypatch.setattr(device_search.os, "access", lambda node, mode: asked.append((node, mode)))
    (device,) = device_search.found_devices(ScriptedUsb([Plugged(0x1D50, 0x608E, address=7, forbidden=True)]))
    assert device.barred and device.problem == "no permission to open it"
    assert asked == [(tmp_path / "001" / "007", os.R_OK | os.W_OK)]
