"""``levimass --version``: read from what the installer noted, so that nothing has to be imported."""

import platform
from importlib.metadata import PackageNotFoundError, version

SHOWN = ("numpy", "scipy", "numba", "llvmlite", "PySide6-Essentials", "pyqtgraph")


def version_text() -> str:
    """Return the version and the licence, and in a second line the versions of what it works with."""
    others = ", ".join(f"{name} {installed(name)}" for name in SHOWN)
    return f"levimass {installed('levimass')}, MIT licence\nPython {platform.python_version()}, {others}"


def installed(package: str) -> str:
    """Return the installed version of a package, "unknown" of one that is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
