"""A changed source recompiles the kernels that depend on it, and no others."""

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import llvmlite.binding
import pytest
from numba.core import caching

from analysis.compiled import kernel_cache, kernel_safety

HOUSE = Path(__file__).resolve().parents[3]

SOURCES = {
    "__init__": "from analysis.compiled import kernel_cache\nkernel_cache.use_kernel_cache()\n",
    "compiled/__init__": "",
    "plain": "FACTOR = 2.0\n",
    "small": (
        "from numba import njit\nfrom analysis import plain\n\n"
        "@njit(cache=True)\ndef small(x):\n    return plain.FACTOR * x + 1.0\n"
    ),
    "large": (
        "from numba import njit\nfrom analysis.small import small\n\n@njit(cache=True)\ndef large(x):\n"
        "    return small(x) * 10.0\n"
    ),
    "other": "WORDS = 'no kernel needs this'\n",
    "parts/__init__": (
        "import lazy_loader\n\n__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)\n"
    ),
    "parts/inner/factors": "FACTOR = 2.0\n",
    "parts/words": "WORDS = 'no kernel needs this'\n",
    "exported": (
        "from numba import njit\nfrom analysis.parts import FACTOR\n\n"
        "@njit(cache=True)\ndef large(x):\n    return FACTOR * x\n"
    ),
}
STUB = 'from .inner.factors import FACTOR\nfrom .words import WORDS\n\n__all__ = ["FACTOR", "WORDS"]\n'
ASK = (
    "import sys; sys.path.insert(0, sys.argv[1])\nfrom analysis.{module} import large\n"
    "print(large(1.0), sum(large.stats.cache_hits.values()))"
)


def _house(tmp_path: Path) -> tuple[Path, Callable[[str], str]]:
    """Write a small program; return its package, and a function that runs ``large`` of one of its modules."""
    package = tmp_path / "house" / "analysis"
    (package / "compiled").mkdir(parents=True)
    for module in (kernel_cache, kernel_safety):
        shutil.copy(module.__file__, package / "compiled")
    for name, text in SOURCES.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / f"{name}.py").write_text(text)
    (package / "parts" / "__init__.pyi").write_text(STUB)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "mine"), "PYTHONDONTWRITEBYTECODE": "1"}

    def asked(module: str) -> str:
        command = [sys.executable, "-c", ASK.format(module=module), str(package.parent)]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    return package, asked


def test_a_changed_helper_or_constant_is_seen_and_nothing_else_compiles(tmp_path: Path) -> None:
    package, asked = _house(tmp_path)
    assert asked("large") == "30.0 0"
    (package / "other.py").write_text("WORDS = 'changed'\n")
    assert asked("large") == "30.0 1"  # from the disk
    (package / "plain.py").write_text("FACTOR = 3.0\n")
    assert asked("large") == "40.0 0"
    (package / "small.py").write_text(SOURCES["small"].replace("1.0", "-7.0"))
    assert asked("large") == "-40.0 0"
    assert any((tmp_path / "mine").rglob("*.nbi"))  # the folder the user chose is respected, and no less true


def test_an_exported_name_leads_to_its_module_and_to_no_other_of_the_package(tmp_path: Path) -> None:
    package, asked = _house(tmp_path)
    assert asked("exported") == "2.0 0"
    (package / "parts" / "words.py").write_text("WORDS = 'changed'\n")
    (package / "parts" / "__init__.pyi").write_text(f"{STUB}# changed\n")
    assert asked("exported") == "2.0 1"  # from the disk
    (package / "parts" / "inner" / "factors.py").write_text("FACTOR = 3.0\n")
    assert asked("exported") == "3.0 0"
    (package / "parts" / "thirds.py").write_text("FACTOR = 9.0\n")
    (package / "parts" / "__init__.pyi").write_text(STUB.replace(".inner.factors", ".thirds"))
    assert asked("exported") == "9.0 0"  # the name now comes from elsewhere


@pytest.mark.parametrize(
    "text", ["from analysis import parts", "import analysis.parts", "from analysis.parts import *"]
)
def test_a_package_imported_as_a_whole_may_give_all_it_exports(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, _ = _house(tmp_path)
    (package / "whole.py").write_text(f"{text}\n")
    monkeypatch.setattr(kernel_cache, "_BASE", tmp_path / "house")
    for cached in (kernel_cache.source_of, kernel_cache.exports_of, kernel_cache._imported, kernel_cache.closure):
        monkeypatch.setattr(kernel_cache, cached.__name__, cached.__wrapped__)
    assert {"analysis.parts.inner.factors", "analysis.parts.words"} <= kernel_cache.closure("analysis.whole")


def test_every_import_of_the_program_is_seen() -> None:
    for path in [*(HOUSE / "analysis").rglob("*.py"), *(HOUSE / "instrument").rglob("*.py")]:
        text = path.read_text(encoding="utf-8")
        every = {ast.dump(n) for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Import | ast.ImportFrom)}
        assert every <= {ast.dump(n) for n in kernel_cache.import_statements(text)}, path
        holds_kernels = "numba" in text and path.name != "kernel_cache.py"
        assert not (holds_kernels and ("import_module" in text or "__import__" in text)), f"{path}: no stamp sees it"


@pytest.mark.parametrize(
    "text",
    [
        "from a import (  # one (of two)\n    b,  # here)\n    c,\n)\n",
        "if True: import a\n",
        "import a; import b\n",
        "from a \\\n    import b\n",
        "def f():\n    from . import a as b, c\n",
        '"""From here one may\n\nimport what (one\nlikes.\n"""\nimport a.b, c\n',
    ],
)
def test_imports_of_any_form(text: str) -> None:
    every = {ast.dump(n) for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Import | ast.ImportFrom)}
    assert every <= {ast.dump(n) for n in kernel_cache.import_statements(text)}


def test_a_source_that_changed_under_a_running_process_is_not_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    assert kernel_cache._text_digest("analysis.collision.solver.gear") == kernel_cache._text_digest(
        "analysis.collision.solver.gear"
    )
    monkeypatch.setattr(kernel_cache, "_BEGAN_NS", 0)  # as though everything had changed since
    assert kernel_cache._text_digest("analysis.collision.solver.gear") != kernel_cache._text_digest(
        "analysis.collision.solver.gear"
    )


def test_without_sources_the_installation_stands_for_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_cache, "source_of", lambda module: None)
    listed = kernel_cache._text_digest("analysis.collision.solver.gear")
    assert listed == kernel_cache._text_digest("analysis.collision.solver.gear")
    another = SimpleNamespace(read_text=lambda name: "another list", version="0")  # whoever finds distributions
    monkeypatch.setattr(metadata, "distribution", lambda name: another)
    kernel_cache._installation.cache_clear()
    assert kernel_cache._text_digest("analysis.collision.solver.gear") != listed
    kernel_cache._installation.cache_clear()


def test_two_types_compiled_at_once_do_not_share_a_name(tmp_path: Path) -> None:
    one, two = (caching.IndexDataCacheFile(str(tmp_path), "kernel", "stamp") for _ in range(2))
    both_began = {}
    one._load_index = two._load_index = lambda: dict(both_began)
    one.save("a float", "its code")
    two.save("an integer", "other code")
    index = caching.IndexDataCacheFile(str(tmp_path), "kernel", "stamp")
    assert index.load("an integer") == "other code"
    assert index.load("a float") in (None, "its code")
    assert len(list(tmp_path.glob("*.nbc"))) == 2


def _root(environment: dict[str, str]) -> str:
    ask = "from analysis.compiled import kernel_cache; print(kernel_cache.cache_folder())"
    command = [sys.executable, "-c", ask]
    done = subprocess.run(command, cwd=HOUSE, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_home_that_cannot_be_written_to(tmp_path: Path) -> None:
    wall = tmp_path / "a file, not a folder"
    wall.write_text("")
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(wall), "XDG_CACHE_HOME": str(wall), "TMPDIR": str(tmp_path)}
    kept = _root(environment)
    assert kept.startswith(str(tmp_path / "levimass-kernels"))
    assert os.name == "nt" or Path(kept).stat().st_mode & 0o7777 == 0o700  # no other user may lay binaries there
    environment["NUMBA_CACHE_DIR"] = str(wall)
    assert _root(environment) == kept


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners here")
def test_binaries_that_somebody_else_may_have_laid_are_not_run(tmp_path: Path) -> None:
    wall, theirs = tmp_path / "a file", tmp_path / "theirs"
    wall.write_text("")
    theirs.mkdir()
    (tmp_path / f"levimass-kernels-{os.getuid()}").symlink_to(theirs)
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(wall), "XDG_CACHE_HOME": str(wall), "TMPDIR": str(tmp_path)}
    assert Path(_root(environment)).resolve() != theirs


PLANTED = """
import os, sys
from pathlib import Path
{first}
import analysis
import numba
from analysis.compiled import kernel_cache
from numba import njit

@njit
def doubled(x):
    return 2 * x

assert doubled(2) == 4  # numba looks for its configuration at every compilation
print(numba.config.CACHE_DIR, numba.config.DISABLE_JIT, kernel_cache.cache_folder(), doubled.signatures)
"""


@pytest.mark.parametrize("first", ["", "import numba", "import yaml"])
def test_a_configuration_in_the_working_folder_is_not_read(first: str, tmp_path: Path) -> None:
    pytest.importorskip("yaml", reason="PyYAML comes with the extra 'cluster'")
    planted = tmp_path / "beside the recordings"
    planted.mkdir()
    (planted / ".numba_config.yaml").write_text("cache_dir: crafted\ndisable_jit: 1\n")
    environment = {name: text for name, text in os.environ.items() if not name.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(HOUSE), "XDG_CACHE_HOME": str(tmp_path / "own")}
    environment["NUMBA_CACHE_DIR"] = str(tmp_path / "chosen")
    command = [sys.executable, "-c", PLANTED.format(first=first)]
    done = subprocess.run(command, cwd=planted, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    chosen = tmp_path / "chosen"
    assert done.stdout == f"{chosen} 0 {chosen / 'levimass'} [(int64,)]\n" and done.stderr == ""
    del environment["NUMBA_CACHE_DIR"]
    done = subprocess.run(command, cwd=planted, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == f" 0 {tmp_path / 'own' / 'levimass' / 'kernels'} [(int64,)]\n", done.stderr
    assert not (planted / "crafted").exists()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners here")
def test_a_folder_that_others_may_write_to_is_not_loaded_from(tmp_path: Path) -> None:
    open_to_all = tmp_path / "open"
    (open_to_all / "levimass").mkdir(parents=True)
    (open_to_all / "levimass").chmod(0o777)
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "own")}
    environment["NUMBA_CACHE_DIR"] = str(open_to_all)
    assert _root(environment) == str(tmp_path / "own" / "levimass" / "kernels")
    (open_to_all / "levimass").chmod(0o755)
    assert _root(environment) == str(open_to_all / "levimass")


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners here")
def test_nor_is_one_kernel_folder_of_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    module = "analysis.collision.solver.gear"
    folder = kernel_cache.folder_of(module)
    assert folder.is_relative_to(tmp_path)
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    assert not kernel_cache.folder_of(module).is_relative_to(tmp_path)
    folder.chmod(0o700)
    assert kernel_cache.folder_of(module) == folder
    monkeypatch.setattr(os, "getuid", lambda: os.stat(folder).st_uid + 1)  # somebody else's, though closed
    owned_by_root = os.stat(folder).st_uid == 0  # who may do everything anyway
    assert (kernel_cache.folder_of(module) == folder) is owned_by_root


def test_of_one_file_the_four_versions_used_last_are_kept_and_of_others_all(tmp_path: Path) -> None:
    def folder(name: str, age_s: float) -> Path:
        path = tmp_path / name
        path.mkdir(mode=0o755)
        (path / "kernel.nbc").write_bytes(b"code")
        os.utime(path, (1e9 - age_s, 1e9 - age_s))
        return path

    versions = [folder(f"analysis.a-{n}", 10.0 * n) for n in range(6)]
    others = [folder(name, 1e6) for name in ("analysis.a-b-1", "analysis.ab-1", "analysis.b-1")]
    kernel_cache._ready.__wrapped__(str(versions[5]))  # there already: it is used, and nothing is removed
    assert all(path.is_dir() for path in versions) and versions[5].stat().st_mtime > 1e9
    made = tmp_path / "analysis.a-new"
    kernel_cache._ready.__wrapped__(str(made))
    assert made.stat().st_mode & 0o777 == 0o700 or os.name == "nt"
    left = {path.name for path in tmp_path.iterdir()} - {path.name for path in others}
    assert left == {"analysis.a-new", "analysis.a-5", "analysis.a-0", "analysis.a-1"}
    assert all(path.is_dir() for path in others)
    kernel_cache._ready.__wrapped__(str(tmp_path / "analysis.a-0" / "kernel.nbc" / "none"))  # cannot be: no error


def test_the_program_as_a_whole_changes_with_each_source_of_kernels_and_each_compiler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, _ = _house(tmp_path)
    monkeypatch.setattr(kernel_cache, "_BASE", tmp_path / "house")
    seen = [kernel_cache.whole_program(), kernel_cache.whole_program()]
    assert seen[0] == seen[1]
    with pytest.MonkeyPatch.context() as turned:  # a disk lists files in any order
        listed = Path.rglob
        turned.setattr(Path, "rglob", lambda folder, pattern: reversed(list(listed(folder, pattern))))
        assert kernel_cache.whole_program() == seen[0]
    (package / "parts" / "__init__.pyi").write_text(f"{STUB}# changed\n")
    seen.append(kernel_cache.whole_program())
    (package / "other.py").write_text("WORDS = 'changed'\n")
    seen.append(kernel_cache.whole_program())
    (package / "other.py").rename(package / "another.py")
    seen.append(kernel_cache.whole_program())
    for top in ("app", "tests"):  # which hold no kernels that are shipped
        (tmp_path / "house" / top).mkdir()
        (tmp_path / "house" / top / "new.py").write_text("")
    (package / "notes.txt").write_text("no source")
    assert kernel_cache.whole_program() == seen[-1]
    (tmp_path / "house" / "instrument").mkdir()
    (tmp_path / "house" / "instrument" / "new.py").write_text("")
    seen.append(kernel_cache.whole_program())
    monkeypatch.setattr(kernel_cache, "_BASE", tmp_path / "frozen")  # without sources the installation counts
    frozen = []
    for installed in ("one", "two"):
        monkeypatch.setattr(kernel_cache, "_installation", lambda installed=installed: installed)
        frozen.append(kernel_cache.whole_program())
    assert frozen[0] != frozen[1]
    monkeypatch.setattr(kernel_cache, "_BASE", tmp_path / "house")
    assert kernel_cache.whole_program() == seen[-1]
    makers = kernel_cache._makers()
    assert all(f"{name} {metadata.version(name)}" in makers for name in ("numba", "llvmlite", "numpy"))
    assert makers.startswith(sys.version)
    for name, value in (("_makers", "others"), ("get_host_cpu_name", "another")):
        where = kernel_cache if name == "_makers" else llvmlite.binding
        monkeypatch.setattr(where, name, lambda value=value: value)
        seen.append(kernel_cache.whole_program())
    assert len(set(seen)) == len(seen) - 1


def test_a_frozen_program_has_no_sources_and_may_have_been_built_elsewhere(tmp_path: Path) -> None:
    here = tmp_path / "a.py"
    here.write_text("")
    (tmp_path / "b.py").write_text("")
    assert kernel_cache._same_file(here, str(tmp_path / "." / "a.py"))
    assert not kernel_cache._same_file(here, str(tmp_path / "b.py"))
    assert not kernel_cache._same_file(here, str(tmp_path / "gone.py"))
    assert kernel_cache._same_file(here, "analysis/a.py")  # as it was called where it was built


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners here")
@pytest.mark.parametrize(
    ("group", "own"),
    [
        ({}, True),
        ({"gr_mem": ["me"]}, True),
        ({"gr_mem": ["me", "you"]}, False),
        ({"gr_name": "staff"}, False),
        ({"gr_gid": 101}, False),  # not the group that this user's files get
        (None, False),
    ],
)
@pytest.mark.parametrize(("mode", "safe"), [(0o755, True), (0o775, None), (0o757, False), (0o777, False)])
def test_a_group_of_this_user_alone_may_write(
    group: dict[str, object] | None, own: bool, mode: int, safe: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    import grp
    import pwd

    def of(gid: int) -> SimpleNamespace:
        if group is None:
            raise KeyError(gid)
        return SimpleNamespace(**{"gr_name": "me", "gr_mem": [], "gr_gid": gid} | group)

    asked = 101 if group == {"gr_gid": 101} else 100
    monkeypatch.setattr(grp, "getgrgid", of)
    monkeypatch.setattr(pwd, "getpwuid", lambda user: SimpleNamespace(pw_gid=100, pw_name="me"))
    monkeypatch.setattr(os, "getuid", lambda: 7)
    for owner, mine in ((7, True), (0, True), (8, False)):
        there = SimpleNamespace(st_uid=owner, st_gid=asked, st_mode=0o40000 | mode)
        folder = SimpleNamespace(stat=lambda there=there: there)
        wanted = mine and (own if safe is None else safe)
        assert kernel_safety.only_own(folder) is wanted  # type: ignore[arg-type]


def test_what_does_not_exist_was_written_by_nobody_and_what_cannot_be_looked_at_is_not_trusted(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert kernel_safety.only_own(tmp_path / "none")
    assert not kernel_safety.only_own(tmp_path / "file" / "inside")
