"""A folder of which a crash leaves only what was synced: the order of the calls that write, and what each would lose.

The files are real.  Beside them stands what the disk surely holds: a file's bytes as of its last ``fsync``, a folder's
names as of its last ``fsync``.  Of names changed since, a crash may keep any number, in their order, as a journal does;
of bytes written since, nothing.  A file that is opened for writing anew may be empty from then on.
"""

import builtins
import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

Names = dict[str, int]  # of files, each with the number (inode) by which the disk knows its bytes
Image = dict[str, bytes]  # what is in the folder after a crash


@dataclass
class OnlySynced:
    """One folder, watched; ``images`` are what a crash may leave just now, ``calls`` what was asked for so far.

    ``at_every_call`` is given each image that a crash before or after each call may leave.
    """

    folder: Path
    at_every_call: Callable[[Image], None] = lambda image: None
    calls: list[str] = field(default_factory=list)
    crashes: int = 0
    _synced: dict[int, bytes] = field(default_factory=dict)
    _names: list[Names] = field(default_factory=list)  # as surely held, then as changed since
    _held: dict[int, int] = field(default_factory=dict)  # open, so that no number is given to another file

    def begin(self) -> None:
        """Take all that is in the folder now for safely there."""
        now = self._listing()
        self._synced |= {number: (self.folder / name).read_bytes() for name, number in now.items()}
        self._names = [now]

    def images(self) -> list[Image]:
        """Return what a crash may leave of the folder."""
        return [{name: self._synced.get(number, b"") for name, number in names.items()} for names in self._names]

    def crash(self) -> None:
        """Give every image that a crash may leave now to ``at_every_call``."""
        self._look()
        for image in self.images():
            self.crashes += 1
            self.at_every_call(image)

    def wrote_anew(self, path: Path) -> None:
        """Note that a file was opened and cut to nothing."""
        self._look()
        self._synced[path.stat().st_ino] = b""

    def synced(self, descriptor: int) -> None:
        """Note an ``fsync`` of a file or of the folder."""
        self._look()
        number = os.fstat(descriptor).st_ino
        if number == self.folder.stat().st_ino:
            self._names = self._names[-1:]
            self.calls.append("fsync folder")
            return
        names = [name for name, other in self._names[-1].items() if other == number]
        if names:
            self._synced[number] = (self.folder / names[0]).read_bytes()
            self.calls.append(f"fsync {shown(names[0])}")

    def close(self) -> None:
        """Let go of the files."""
        for descriptor in self._held.values():
            os.close(descriptor)

    def _look(self) -> None:
        now = self._listing()
        if now != self._names[-1]:
            self._names.append(now)

    def _listing(self) -> Names:
        now = {path.name: path.stat().st_ino for path in self.folder.iterdir() if path.is_file()}
        for name, number in now.items():
            if number not in self._held:
                self._held[number] = os.open(self.folder / name, os.O_RDONLY)
        return now


def shown(name: str) -> str:
    """Return a file's name, the one that stands beside another for a moment as "new"."""
    return "new" if name.endswith(".new") else name


@contextmanager
def only_synced(folder: Path, at_every_call: Callable[[Image], None] = lambda image: None) -> Iterator[OnlySynced]:
    """Watch ``folder``: ``os.fsync``, ``os.replace``, ``os.unlink`` and every ``open`` for writing."""
    disk = OnlySynced(folder, at_every_call)
    disk.begin()
    fsync, replace, unlink, opened = os.fsync, os.replace, os.unlink, builtins.open

    def here(path: Any) -> bool:
        return isinstance(path, str | Path) and Path(path).parent == folder

    def new_fsync(descriptor: int) -> None:
        disk.crash()
        fsync(descriptor)
        disk.synced(descriptor)
        disk.crash()

    def new_replace(source: Any, target: Any) -> None:
        disk.crash()
        replace(source, target)
        if here(target):
            disk.calls.append(f"replace {shown(Path(source).name)} -> {Path(target).name}")
        disk.crash()

    def new_unlink(path: Any, **more: Any) -> None:
        disk.crash()
        unlink(path, **more)
        disk.crash()

    def new_open(file: Any, mode: str = "r", *more: Any, **named: Any) -> Any:
        file_object = opened(file, mode, *more, **named)
        if here(file) and ("w" in mode or "x" in mode):
            disk.wrote_anew(Path(file))
            disk.crash()
        return file_object

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", new_fsync)
        patch.setattr(os, "replace", new_replace)
        patch.setattr(os, "unlink", new_unlink)
        patch.setattr(builtins, "open", new_open)
        patch.setattr(io, "open", new_open)  # a path opens by this name
        try:
            yield disk
        finally:
            disk.close()
