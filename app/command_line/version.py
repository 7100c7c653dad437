"""``levimass --version``: versions from the installed packages' metadata, without importing them."""

import platform
from importlib.metadata import PackageNotFoundError, version

SHOWN = ("numpy", "scipy", "numba", "llvmlite", "PySide6-Essentials", "pyqtgraph")


def version_text() -> str:
    """Return version and licence, and in a second line the versions of Python and of the main dependencies."""
    others = ", ".join(f"{name} {installed(name)}" for name in SHOWN)
    return f"levimass {installed('levimass')}, MIT licence\nPython {platform.python_version()}, {others}"


def installed(package: str) -> str:
    """Return the installed version of a package, or "unknown"."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
