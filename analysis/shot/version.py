"""Which program this is."""

import hashlib
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_HOUSE = Path(__file__).resolve().parents[2]


def program_version() -> str:
    """Return the installed version of the program, or "unknown" when run from an uninstalled tree."""
    try:
        return version("levimass")
    except PackageNotFoundError:
        return "unknown"


@cache
def program() -> str:
    """Return the version with a digest of the source: two programs that tell the same give the same numbers.

    Where the sources are not there to be read (a frozen application) it is the executable's.
    """
    digest = hashlib.sha256()
    parts = ("analysis", "instrument", "app", "levimass")
    sources = [source for part in parts for source in sorted((_HOUSE / part).rglob("*.py"))]
    for source in sources:
        digest.update(source.relative_to(_HOUSE).as_posix().encode() + source.read_bytes())
    if not sources:
        digest.update(Path(sys.executable).read_bytes())
    return f"{program_version()} ({digest.hexdigest()[:12]})"
