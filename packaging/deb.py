"""Make a Debian package of the frozen folder: ``python packaging/deb.py dist/levimass dist``.

The folder goes to /opt/levimass; desktop entry, icon and udev rule where every desktop looks for them.  Needs dpkg-deb,
nothing of Python but itself.
"""

import argparse
import shutil
import subprocess
import tempfile
import tomllib
from pathlib import Path

HOUSE = Path(__file__).resolve().parents[1]
HOME = "opt/levimass"
NEEDS = (  # of the system, by Qt; the rest lies in the folder
    "libc6", "libegl1", "libgl1", "libdbus-1-3", "libfontconfig1", "libglib2.0-0 | libglib2.0-0t64", "libxkbcommon0",
    "libxkbcommon-x11-0", "libxcb-cursor0", "libxcb-icccm4", "libxcb-image0", "libxcb-keysyms1", "libxcb-randr0",
    "libxcb-render-util0", "libxcb-shape0", "libxcb-xkb1",
)  # fmt: skip
CONTROL = """Package: levimass
Version: {version}
Section: science
Priority: optional
Architecture: {architecture}
Maintainer: The Levimass authors <levimass@localhost>
Installed-Size: {kib}
Depends: {needs}
Recommends: libusb-1.0-0
Suggests: sigrok-firmware-fx2lafw
Description: instrument program for the Levitation Mass Method
 A small block on an air bearing strikes a spring plate; from the beat of a
 laser interferometer come velocity, force and two coefficients of
 restitution. Everything the program needs of Python is in the package.
"""
# what the desktop and udev keep in memory is read again, where they are there at all; nothing of it may stop dpkg
AFTER = """#!/bin/sh
set -e
if command -v udevadm >/dev/null; then udevadm control --reload 2>/dev/null && udevadm trigger 2>/dev/null || true; fi
if command -v update-desktop-database >/dev/null; then update-desktop-database -q || true; fi
"""


def main() -> None:
    """Make it and print its path."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("frozen", type=Path, help="the folder that `make app` made")
    parser.add_argument("out", type=Path, help="where the package goes")
    parser.add_argument("--fast", action="store_true", help="compress little")
    options = parser.parse_args()
    with (HOUSE / "pyproject.toml").open("rb") as file:
        version = tomllib.load(file)["project"]["version"]
    asked = subprocess.run(["dpkg", "--print-architecture"], capture_output=True, text=True, check=True)
    architecture = asked.stdout.strip()
    options.out.mkdir(parents=True, exist_ok=True)
    package = options.out / f"levimass_{version}_{architecture}.deb"
    with tempfile.TemporaryDirectory(dir=options.out, prefix="deb-") as name:
        root = Path(name)
        root.chmod(0o755)
        lay_out(root, options.frozen)
        kib = sum(path.lstat().st_size for path in root.rglob("*")) // 1024
        control = CONTROL.format(version=version, architecture=architecture, kib=kib, needs=", ".join(NEEDS))
        _write(root / "DEBIAN" / "control", control)
        for script in ("postinst", "postrm"):
            _write(root / "DEBIAN" / script, AFTER, 0o755)
        strength = ["-Zgzip", "-z1"] if options.fast else ["-Zxz", "-z1"]  # -z6: a tenth smaller, many times as long
        subprocess.run(["dpkg-deb", "--root-owner-group", *strength, "--build", root, package], check=True)
    print(package)


def lay_out(root: Path, frozen: Path) -> None:
    """Put every file where it is installed, below ``root``."""
    shutil.copytree(frozen, root / HOME, symlinks=True)
    desktop = HOUSE / "resources" / "desktop"
    for source, target in (
        (desktop / "levimass.desktop", "usr/share/applications/levimass.desktop"),
        (desktop / "levimass.svg", "usr/share/icons/hicolor/scalable/apps/levimass.svg"),
        (HOUSE / "resources" / "udev" / "70-levimass.rules", "usr/lib/udev/rules.d/70-levimass.rules"),
        (HOUSE / "LICENSE", "usr/share/doc/levimass/copyright"),
    ):
        _write(root / target, source.read_text(encoding="utf-8"))
    (root / "usr/bin").mkdir(parents=True)
    for command in ("levimass", "levimass-window"):
        (root / "usr/bin" / command).symlink_to(f"/{HOME}/{command}")


def _write(path: Path, text: str, mode: int = 0o644) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    path.chmod(mode)


if __name__ == "__main__":
    main()
