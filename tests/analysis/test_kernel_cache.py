"""Kernels are compiled anew when their text changes, and wherever the home folder cannot be written to."""

import subprocess
import sys
from pathlib import Path

import pytest

from analysis import kernel_cache

ROOT = Path(__file__).resolve().parents[2]
ASK = "import os, analysis; print(os.environ['NUMBA_CACHE_DIR'])"


def _cache_dir(environment: dict[str, str]) -> str:
    done = subprocess.run(
        [sys.executable, "-c", ASK], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_one_folder_for_one_text(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    before = kernel_cache._fingerprint()
    assert before == kernel_cache._fingerprint()
    changed = tmp_path / "house" / "analysis"
    changed.mkdir(parents=True)
    (changed / "kernel.py").write_text("@njit\ndef f(): return 1\n")
    monkeypatch.setattr(kernel_cache, "__file__", str(changed / "kernel_cache.py"))
    first = kernel_cache._fingerprint()
    (changed / "kernel.py").write_text("@njit\ndef f(): return 2\n")
    assert kernel_cache._fingerprint() != first


def test_a_home_that_cannot_be_written_to(tmp_path: Path) -> None:
    wall = tmp_path / "a file, not a folder"
    wall.write_text("")
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(wall), "XDG_CACHE_HOME": str(wall), "TMPDIR": str(tmp_path)}
    assert _cache_dir(environment).startswith(str(tmp_path / "levimass-kernels"))


def test_a_folder_the_user_chose_is_respected(tmp_path: Path) -> None:
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "mine")}
    assert _cache_dir(environment) == str(tmp_path / "mine")
