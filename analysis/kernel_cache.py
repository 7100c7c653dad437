"""Where numba keeps compiled kernels, so that a changed kernel is never answered by an old binary.

numba's cache looks only at the file of the function that is called: a kernel that calls a kernel in another
file goes on using the old one after that other file has changed.  The cache folder is therefore named after
the text of every kernel file; a change anywhere starts a fresh folder, and old folders are cleared away.
The same move makes caching work where the program is installed read-only.
"""

import contextlib
import hashlib
import os
import shutil
import sys
import tempfile
from pathlib import Path

import platformdirs

KEPT_FOLDERS = 6
_PACKAGES = ("analysis", "instrument")


def keep_true() -> None:
    """Point numba's cache at a folder that belongs to exactly these kernel sources.

    A folder chosen by the user through ``NUMBA_CACHE_DIR`` is respected.
    """
    if os.environ.get("NUMBA_CACHE_DIR"):
        return
    name = _fingerprint()
    parent = Path(platformdirs.user_cache_dir("levimass", appauthor=False)) / "kernels"
    if not _writable(parent):  # a home that is read-only or missing: the kernels are compiled once a boot, not kept
        parent = Path(tempfile.gettempdir()) / f"levimass-kernels-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
    folder = parent / name
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    if not folder.exists():
        _clear_old(parent)


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def _fingerprint() -> str:
    digest = hashlib.sha256()
    house = Path(__file__).resolve().parent.parent
    digest.update(str(house).encode())
    for package in _PACKAGES:
        for source in sorted((house / package).rglob("*.py")):
            text = source.read_bytes()
            if any(word in text for word in (b"njit", b"cfunc", b"intrinsic")):
                digest.update(source.name.encode() + text)
    return digest.hexdigest()[:16]


def _clear_old(parent: Path) -> None:
    with contextlib.suppress(OSError):  # another process may be clearing the same folders
        folders = sorted((f for f in parent.iterdir() if f.is_dir()), key=lambda f: f.stat().st_mtime)
        for folder in folders[: -(KEPT_FOLDERS - 1)]:
            shutil.rmtree(folder, ignore_errors=True)
