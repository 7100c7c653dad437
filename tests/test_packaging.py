"""Package, page and program say one thing of a bare Debian; the Makefile freezes only what changed."""

import importlib.util
import os
import re
import subprocess
from pathlib import Path

import pytest

from app.command_line.machine import QT_LIBRARIES

HOUSE = Path(__file__).resolve().parents[1]


def _deb():
    spec = importlib.util.spec_from_file_location("deb", HOUSE / "packaging" / "deb.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_readme_program_and_package_name_the_same_libraries_of_qt():
    needed = {name.split(" ")[0] for name in _deb().NEEDS} - {"libc6"}
    said = re.search(r"apt install (lib[^`]*)`", (HOUSE / "README.md").read_text(encoding="utf-8"))
    assert needed == set(QT_LIBRARIES.split()) == set(said.group(1).split())


def test_the_package_has_commands_desktop_entry_icon_and_rule(tmp_path):
    frozen, root = tmp_path / "frozen", tmp_path / "root"
    frozen.mkdir()
    (frozen / "levimass").write_text("program")
    _deb().lay_out(root, frozen)
    assert (root / "opt/levimass/levimass").read_text() == "program"
    assert (root / "usr/bin/levimass").readlink() == Path("/opt/levimass/levimass")
    entry = (root / "usr/share/applications/levimass.desktop").read_text()
    icon = re.search(r"^Icon=(.+)$", entry, re.MULTILINE).group(1)
    assert (root / f"usr/share/icons/hicolor/scalable/apps/{icon}.svg").exists()
    program = re.search(r"^Exec=(\S+)", entry, re.MULTILINE).group(1)
    assert (root / "usr/bin" / program).is_symlink()
    assert (root / "usr/lib/udev/rules.d/70-levimass.rules").read_text().count("SUBSYSTEM") >= 1


def test_an_unchanged_folder_is_not_frozen_again(tmp_path):
    """Asked of make itself, in a house of empty files: frozen once, again only where something of it is newer."""
    house = tmp_path / "house"
    for folder in ("analysis", "app", "instrument", "levimass", "resources", "packaging", "dist", ".venv"):
        (house / folder).mkdir(parents=True)
        (house / folder / "one").touch()
    for name in ("LICENSE", "pyproject.toml", ".venv/.ready"):
        (house / name).touch()
    (house / "Makefile").write_bytes((HOUSE / "Makefile").read_bytes())

    def freezes(target):
        command = ["make", "--dry-run", "-C", str(house), target]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=True)
        except FileNotFoundError:
            pytest.skip("no make on this machine")
        return "PyInstaller" in done.stdout

    assert freezes("app") and freezes("deb")
    (house / "dist" / ".frozen").touch()
    assert not freezes("app") and not freezes("deb")
    later = (house / "dist" / ".frozen").stat().st_mtime + 5
    os.utime(house / "analysis" / "one", (later, later))
    assert freezes("deb")
