"""A lock that allows only one process at a time to record into a folder; it is released when the process ends."""

import contextlib
import os
import shutil
import sys
from pathlib import Path
from typing import IO

from instrument.files.recording_error import RecordingError, system_message

LOCK_NAME = ".levimass.lock"


class FolderLocked(RecordingError):
    """The folder is locked by another process."""


class FolderLock:
    """Locks a folder for this process.  Raises FolderLocked if another process holds it, else RecordingError.

    The lock is the operating system's (``flock``, on Windows ``locking``), so a killed process releases it.
    """

    def __init__(self, folder: Path, name: str = LOCK_NAME) -> None:
        self.folder = folder
        self._name = name
        path = folder / name
        try:
            file: IO[str] = open(path, "a+", encoding="utf-8")  # noqa: SIM115 - held until release
        except FileNotFoundError:
            raise RecordingError(folder, "the folder does not exist") from None
        except OSError as error:
            raise RecordingError(folder, f"cannot be written to ({system_message(error)})") from None
        try:
            _lock(file)
        except OSError:
            file.seek(0)
            owner = file.read(20).strip()
            file.close()
            by = f" (process {owner})" if owner.isdecimal() else ""
            raise FolderLocked(folder, f"another Levimass is recording into this folder{by}") from None
        with contextlib.suppress(OSError):  # on a full disk a shot can still be kept in memory
            file.truncate(0)
            file.write(str(os.getpid()))
            file.flush()
        self._file = file

    def valid(self) -> bool:
        """Return whether the folder is still the one that was locked; it may have been removed or replaced since."""
        try:
            here, held = os.stat(self.folder / self._name), os.fstat(self._file.fileno())
        except (OSError, ValueError):
            return False
        return (here.st_ino, here.st_dev) == (held.st_ino, held.st_dev)

    def release(self) -> None:
        """Release the lock.  The lock file is kept, as another process may already have locked it."""
        with contextlib.suppress(OSError):
            self._file.close()


if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[str]) -> None:
        file.seek(4096)  # beyond the text, which other processes may read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: IO[str]) -> None:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)


def disk_free_bytes(folder: Path) -> int | None:
    """Return the free space on the folder's disk, None if unknown."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return None
