"""Find the digitizers plugged into this computer, check that this user may open them, and give a remedy if not."""

import contextlib
import os
import sys
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from instrument.devices import sources
from instrument.devices.digitizer import DigitizerError

_NI_VENDOR = b"0x1093"
_PCI = Path("/sys/bus/pci/devices")
_WINDOWS_PCI = r"SYSTEM\CurrentControlSet\Enum\PCI"
_USB_NODES = Path("/dev/bus/usb")


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A device on a bus; ``source`` is the text that opens it, ``problem`` is empty if it can be opened."""

    source: str
    name: str
    where: str
    problem: str = ""
    remedy: str = ""
    barred: bool = False  # True: this user has no permission to open it


def udev_rule_path() -> Path:
    """Return the path of the udev rule that comes with Levimass."""
    return Path(str(resources.files("resources") / "udev" / "70-levimass.rules"))


def udev_instructions() -> str:
    """Return the commands that install the udev rule, to be shown and copied."""
    return (
        f"sudo cp '{udev_rule_path()}' /etc/udev/rules.d/\n"
        "sudo udevadm control --reload\n"
        "sudo udevadm trigger\n"
        "then unplug the device and plug it in again"
    )


def found_devices(backend: Any = None) -> tuple[FoundDevice, ...]:
    """Return the digitizers plugged in, without opening any.  Raises DigitizerError if the USB library is missing."""
    finders = [sources.import_function(source.finder) for source in sources.SOURCES if source.finder]
    return tuple(device for find in finders for device in find(backend))


def hantek6022(backend: Any) -> list[FoundDevice]:
    """Return the Hantek 6022 on USB, with or without their firmware."""
    from instrument.devices import hantek6022_firmware as firmware
    from instrument.devices import usb_bus

    found = []
    for device in usb_bus.find_devices(firmware.IDS_WITHOUT_FIRMWARE | firmware.IDS_WITH_FIRMWARE, backend):
        problem, remedy, barred = _permission(device)
        if not problem and (device.idVendor, device.idProduct) in firmware.IDS_WITHOUT_FIRMWARE:
            try:
                firmware.find_firmware(device.idProduct)
            except DigitizerError as error:
                problem, remedy = error.what, error.remedy
        found.append(FoundDevice("hantek6022", "Hantek 6022", _where(device), problem, remedy, barred))
    return found


def oscilloscopes(backend: Any) -> list[FoundDevice]:
    """Return the oscilloscopes on USB that speak SCPI."""
    from instrument.devices import usb_bus, usbtmc

    found = []
    for device in usbtmc.find_instruments(backend):
        name = f"{usbtmc.VENDORS[device.idVendor]} oscilloscope"
        source = f"scpi:usb:{usb_bus.identity(device)}"
        found.append(FoundDevice(source, name, _where(device), *_permission(device)))
    return found


def _where(device: Any) -> str:
    from instrument.devices import usb_bus

    return f"USB bus {device.bus}, device {device.address}, {usb_bus.identity(device)}"


def _permission(device: Any) -> tuple[str, str, bool]:
    """Return (problem, remedy, barred) of opening ``device``; not barred if this user may open it or it is unknown."""
    from instrument.devices.usb_bus import PERMISSION_REMEDY, is_permitted

    node = _USB_NODES / f"{device.bus or 0:03d}" / f"{device.address or 0:03d}"
    if sys.platform.startswith("linux") and node.exists():
        permitted = os.access(node, os.R_OK | os.W_OK)
    else:
        permitted = is_permitted(device)
    return ("", "", False) if permitted else ("no permission to open it", PERMISSION_REMEDY, True)


def ni_cards(_: Any) -> list[FoundDevice]:
    """Return National Instruments' PCI cards; only NI's runtime can tell which of them are digitizers."""
    from instrument.devices.niscope_card import load_package

    places, problem, remedy = _ni_places(), "", ""
    if places:
        try:
            load_package()
        except DigitizerError as error:
            problem, remedy = error.what, error.remedy
    name = "National Instruments card (its name is in NI MAX or nilsdev)"
    return [FoundDevice("niscope:Dev1", name, f"PCI {place}", problem, remedy) for place in places]


def _ni_places() -> list[str]:
    """Return the PCI slots with a National Instruments card, as listed by this system."""
    if sys.platform == "win32":
        import winreg

        return _ni_in_registry(winreg)
    found = []
    for entry in sorted(_PCI.glob("*/vendor")):
        with contextlib.suppress(OSError):
            if entry.read_bytes().strip().lower() == _NI_VENDOR:
                found.append(entry.parent.name)
    return found


def _ni_in_registry(registry: Any) -> list[str]:
    """Return the slots from the Windows registry, which also lists removed cards."""
    try:
        with registry.OpenKey(registry.HKEY_LOCAL_MACHINE, _WINDOWS_PCI) as key:
            names = [registry.EnumKey(key, n) for n in range(registry.QueryInfoKey(key)[0])]
    except OSError:
        return []
    return sorted(name for name in names if name.upper().startswith("VEN_1093"))
