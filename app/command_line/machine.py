"""Versions of the installed packages, and the test whether Qt can open a window on this machine."""

import importlib.util
import os
import platform
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version

_LISTED = ("numpy", "scipy", "numba", "llvmlite", "PySide6-Essentials", "pyqtgraph")
TRY_WINDOW = "--try-window"  # argument with which the frozen application tests Qt in a subprocess
QT_LIBRARIES = (
    "libglib2.0-0 libegl1 libgl1 libdbus-1-3 libfontconfig1 libxkbcommon0 libxkbcommon-x11-0 libxcb-cursor0 "
    "libxcb-icccm4 libxcb-image0 libxcb-keysyms1 libxcb-randr0 libxcb-render-util0 libxcb-shape0 libxcb-xkb1"
)


def version_text() -> str:
    """Return a line with version and licence, and a line with the versions of Python and the main dependencies."""
    others = ", ".join(f"{name} {installed(name)}" for name in _LISTED)
    return f"levimass {installed('levimass')}, MIT licence\nPython {platform.python_version()}, {others}"


def installed(package: str) -> str:
    """Return the installed version of a package, or "unknown"."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


def why_no_window() -> str | None:
    """Return why Qt cannot open a window on this machine, or None."""
    chosen = os.environ.get("QT_QPA_PLATFORM", "")
    unix = os.name == "posix" and sys.platform != "darwin"
    if unix and not chosen and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "no display"
    if importlib.util.find_spec("PySide6") is None:
        return "PySide6 is not installed"
    # tested in a subprocess, because Qt aborts the process if it cannot start
    tried = subprocess.run(_probe(), capture_output=True, text=True, timeout=60, check=False)
    if tried.returncode == 0:
        return None
    lines = [line for line in tried.stderr.strip().splitlines() if line.strip()]
    cause = lines[-1].strip() if lines else f"status {tried.returncode}"
    return f"Qt does not start: {cause}; on Debian: apt install {QT_LIBRARIES}"


def _probe() -> list[str]:
    """Return a command that succeeds if Qt can start; the frozen application calls itself."""
    if getattr(sys, "frozen", False):
        return [sys.executable, TRY_WINDOW]
    return [sys.executable, "-c", "from PySide6.QtWidgets import QApplication; QApplication([])"]


def try_window() -> None:
    """Start Qt, which aborts the process if it cannot start."""
    from PySide6.QtWidgets import QApplication

    QApplication([])
