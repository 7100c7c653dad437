"""The mark that says the kernels are on disk: true only for what wrote it."""

import llvmlite
import numba
import pytest

from analysis import kernel_cache
from app.session import warm


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_cache, "root", lambda: tmp_path)
    monkeypatch.setattr(warm, "run_once", lambda **_: None)
    monkeypatch.setattr(warm.os, "nice", lambda _: 0)
    return tmp_path


def test_the_mark_holds_for_the_program_that_wrote_it(folder):
    assert not warm._on_disk()
    warm.main()
    assert warm._on_disk()


@pytest.mark.parametrize("what", [numba, llvmlite])
def test_another_numba_does_not_trust_it(folder, monkeypatch, what):
    warm.main()
    monkeypatch.setattr(what, "__version__", "999.0")
    assert not warm._on_disk()


def test_a_mark_that_says_nothing_or_nonsense_is_none(folder):
    (folder / "complete").touch()  # as an older version of the program left it
    assert not warm._on_disk()
    (folder / "complete").write_bytes(b"\xff\xfe")
    assert not warm._on_disk()


def test_what_is_not_on_disk_is_compiled_elsewhere_and_only_once(folder, monkeypatch):
    compiled = []
    monkeypatch.setattr(warm, "_in_another_process", lambda _: compiled.append(warm.main()))
    for _ in range(2):
        warm.Kernels().work(lambda words, share: None, lambda: False)
    assert compiled == [0]
