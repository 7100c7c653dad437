"""The version of the program."""

import hashlib
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]


def program_version() -> str:
    """Return the installed version of the program, or "unknown" when run from an uninstalled tree."""
    try:
        return version("levimass")
    except PackageNotFoundError:
        return "unknown"


@cache
def version_and_digest() -> str:
    """Return the version with a digest of the source; programs with the same digest compute the same numbers.

    Without sources (a frozen application) the executable is digested instead.
    """
    digest = hashlib.sha256()
    parts = ("analysis", "instrument", "app", "levimass")
    folders = [_ROOT / part for part in parts]
    sources = [source for folder in folders for source in sorted([*folder.rglob("*.py"), *folder.rglob("*.pyi")])]
    for source in sources:
        digest.update(source.relative_to(_ROOT).as_posix().encode() + source.read_bytes())
    if not sources:
        digest.update(Path(sys.executable).read_bytes())
    return f"{program_version()} ({digest.hexdigest()[:12]})"
