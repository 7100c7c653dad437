"""A finished file moved to where it belongs, though a virus scanner or a synchronised folder holds the old one."""

import contextlib
import os
import stat
import time
from pathlib import Path

PATIENCE_S = 2.0
_LOOK_S = 0.05


def into_place(source: Path, target: Path) -> None:
    """Do as ``os.replace``; where another program holds a file (Windows: PermissionError) try for two seconds.

    The new file has the rights of the one it replaces: what was closed to others stays so.  Raises OSError, naming
    ``target``, where it is held on or cannot be: ``source`` is where it was then.
    """
    same_rights(source, target)
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            os.replace(source, target)
            return
        except PermissionError as error:
            if time.monotonic() > end or not _may_be_held(target):
                raise PermissionError(error.errno, _in_words(error), str(target)) from error
        time.sleep(_LOOK_S)


def same_rights(path: Path, like: Path) -> None:
    """Give ``path`` mode and owner of the file ``like``, as far as it is there and this user may."""
    try:
        wanted, now = like.stat(), path.stat()
        if stat.S_ISREG(wanted.st_mode) and hasattr(os, "chown"):
            if (wanted.st_uid, wanted.st_gid) != (now.st_uid, now.st_gid):
                with contextlib.suppress(PermissionError):  # a stranger's: what is new is this user's
                    os.chown(path, wanted.st_uid, wanted.st_gid)
            os.chmod(path, stat.S_IMODE(wanted.st_mode) & 0o777)
    except OSError:
        return


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to disk: only then is a file that was moved into place safe.  Raises OSError."""
    if os.name == "posix":  # Windows has no such call and needs none
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _may_be_held(target: Path) -> bool:
    return os.name == "nt" or os.access(target.parent, os.W_OK)  # else nobody holds it: it is not ours to write


def _in_words(error: OSError) -> str:
    held = getattr(error, "winerror", None) in (5, 32)
    return "held by another program (a virus scanner, a synchronised folder?)" if held else str(error.strerror)
