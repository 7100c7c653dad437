"""A real file system that is small: full, it refuses a byte as the disk of an instrument does."""

import contextlib
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

PAGE_BYTES = 4096  # what this file system gives a file at a time
_PIECE_BYTES = 2**20
_BALLAST = "ballast"


@contextlib.contextmanager
def small_disk(place: Path, megabytes: int) -> Iterator[Path]:
    """Mount an empty file system of so many MB at ``place``; skip the test where mounting is not allowed."""
    place.mkdir()
    try:
        subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "levimass-test", str(place)],
            check=True, capture_output=True, text=True,
        )  # fmt: skip
    except FileNotFoundError:
        pytest.skip("a small file system cannot be mounted here: there is no mount")
    except subprocess.CalledProcessError as error:
        pytest.skip(f"a small file system cannot be mounted here: {' '.join(error.stderr.split())}")
    try:
        yield place
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)


def free_bytes(disk: Path) -> int:
    """Return the room that is left."""
    now = os.statvfs(disk)
    return now.f_bavail * now.f_frsize


def fill(disk: Path, left_bytes: int = 0) -> None:
    """Fill the disk with another program's file until ``left_bytes`` are left, to a page."""
    with open(disk / _BALLAST, "ab", buffering=0) as file, contextlib.suppress(OSError):
        while (more := free_bytes(disk) - left_bytes) > 0:
            file.write(bytes(min(more, _PIECE_BYTES)))


def make_room(disk: Path) -> None:
    """Remove the other program's file."""
    (disk / _BALLAST).unlink()
