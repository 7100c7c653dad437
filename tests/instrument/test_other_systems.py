"""The parts that differ on Windows and macOS, tested here with the answers of those systems."""

import importlib.util
import os
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from instrument.background.worker_process import lower_priority
from instrument.devices import device_search, usb_bus
from instrument.devices.digitizer import Block
from instrument.devices.hantek6022_firmware import firmware_folders, firmware_remedy
from instrument.files import folder_lock
from instrument.files.recording_error import RecordingError
from instrument.process import child
from instrument.process.child import BlockReady

WINDOWS_PIPE_BYTES = 8192


class FakeMsvcrt(ModuleType):
    """Locks bytes of files as Windows does: for everybody else they can neither be locked nor read."""

    LK_NBLCK = 2

    def __init__(self) -> None:
        super().__init__("msvcrt")
        self.locked: dict[tuple[int, int], int] = {}

    def locking(self, descriptor: int, mode: int, count: int) -> None:
        """Lock ``count`` bytes from where the file stands."""
        assert (mode, count) == (self.LK_NBLCK, 1)
        place = os.fstat(descriptor).st_ino, os.lseek(descriptor, 0, os.SEEK_CUR)
        if place in self.locked:
            raise PermissionError(13, "Permission denied")
        self.locked[place] = descriptor


def test_the_folder_lock_of_windows_does_not_cover_the_text_that_names_its_owner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    msvcrt = FakeMsvcrt()
    monkeypatch.setitem(sys.modules, "msvcrt", msvcrt)
    monkeypatch.setattr(sys, "platform", "win32")
    spec = importlib.util.spec_from_file_location("folder_lock_of_windows", folder_lock.__file__)
    assert spec is not None and spec.loader is not None
    windows: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(windows)
    lock = windows.FolderLock(tmp_path)
    text = (tmp_path / windows.LOCK_NAME).read_text()
    assert text == str(os.getpid())
    assert all(at >= len(text) for _, at in msvcrt.locked)
    with pytest.raises(RecordingError, match=rf"another Levimass is recording .*process {os.getpid()}\)"):
        windows.FolderLock(tmp_path)
    lock.release()


def test_ni_cards_are_found_in_the_registry() -> None:
    class Registry:
        HKEY_LOCAL_MACHINE = object()
        names = ("VEN_8086&DEV_1234", "VEN_1093&DEV_C4C4&SUBSYS_1", "ven_1093&dev_7000")

        @contextmanager
        def OpenKey(self, root: object, path: str) -> Iterator["Registry"]:
            if path != r"SYSTEM\CurrentControlSet\Enum\PCI":
                raise FileNotFoundError(2, "no such key")
            yield self

        def QueryInfoKey(self, key: object) -> tuple[int, int, int]:
            return len(self.names), 0, 0

        def EnumKey(self, key: object, n: int) -> str:
            return self.names[n]

    assert device_search._ni_in_registry(Registry()) == ["VEN_1093&DEV_C4C4&SUBSYS_1", "ven_1093&dev_7000"]
    closed = SimpleNamespace(HKEY_LOCAL_MACHINE=0, OpenKey=lambda *_: (_ for _ in ()).throw(PermissionError(5, "no")))
    assert device_search._ni_in_registry(closed) == []


def test_firmware_is_looked_for_where_each_system_keeps_it() -> None:
    """sigrok's folders and PulseView's, those that come with the system first."""
    given = {"ProgramFiles": "C:/Programs", "ProgramFiles(x86)": "C:/Programs32", "LOCALAPPDATA": "C:/me"}
    programs = [f"{root}/sigrok/{program}/share" for root in ("C:/Programs", "C:/Programs32") for program in SIGROK]
    for system, environment, folders in (
        ("win32", given, [*programs, "C:/me/levimass"]),
        ("win32", {"ProgramFiles(x86)": "C:/Programs32"}, [*programs[2:], "home/levimass"]),
        (
            "darwin",
            {},
            [
                *("/opt/homebrew/share", "/usr/local/share", "/opt/local/share"),
                *("/Applications/PulseView.app/Contents/share", "home/.local/share"),
            ],
        ),
        ("linux", {}, ["/usr/share", "/usr/local/share", "home/.local/share"]),
    ):
        found = firmware_folders(system, environment, Path("home"))
        assert found == tuple(Path(folder) / "sigrok-firmware" for folder in folders), system
    assert "apt" in firmware_remedy("linux")
    assert all("PulseView" in firmware_remedy(system) for system in ("win32", "darwin"))


SIGROK = ("PulseView", "sigrok-cli")


def test_what_may_wait_in_a_pipe_fits_into_one_of_windows() -> None:
    """A child whose pipe is full waits in the middle of its talk, and its device is not read."""
    message = BlockReady(2**40, 2**50, Block(2**18, 2**30, True, 2**18, True))
    assert child.MAX_BLOCKS_ELSEWHERE * (4 + len(pickle.dumps(message))) < 0.9 * WINDOWS_PIPE_BYTES


def test_priority_is_lowered_by_class_on_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[Any, int]] = []
    kernel = SimpleNamespace(
        GetCurrentProcess=lambda: -1, SetPriorityClass=lambda who, how: asked.append((who.value, how))
    )
    monkeypatch.setattr("ctypes.windll", SimpleNamespace(kernel32=kernel), raising=False)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(os, "nice", lambda steps: pytest.fail("there is none on Windows"))
    lower_priority(5)
    assert [how for _, how in asked] == [0x4000]


@pytest.mark.parametrize(("system", "scheduled"), [("linux", [(0, 3, 0)]), ("darwin", [])])
def test_priority_is_lowered_by_steps_elsewhere_and_on_linux_the_class_too(
    system: str, scheduled: list[tuple[int, int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[int] = []
    asked: list[tuple[int, int, int]] = []
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(os, "nice", steps.append, raising=False)
    monkeypatch.setattr(os, "SCHED_BATCH", 3, raising=False)
    monkeypatch.setattr(os, "sched_param", lambda priority: priority, raising=False)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *given: asked.append(given), raising=False)
    lower_priority(7)
    assert (steps, asked) == ([7], scheduled)


def test_libusb_comes_from_its_package_where_the_system_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("usb.backend.libusb1.get_backend", lambda: None)
    monkeypatch.setitem(sys.modules, "libusb_package", SimpleNamespace(get_libusb1_backend=lambda: "theirs"))
    assert usb_bus.find_backend() == "theirs"
