"""A file that another program has open for a moment (a virus scanner, a synchronised folder) is still replaced."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from app.session.settings import Settings
from app.session.settings_store import save
from instrument.files import atomic_file
from instrument.files.atomic_file import (
    check_writable,
    replace_file,
    write_json_atomic,
    write_text_atomic,
    write_toml_atomic,
)
from instrument.files.recording_error import RecordingError
from tests.only_synced import only_synced


class Held:
    """Stands for ``os.replace`` while another program holds the file, ``times`` times."""

    def __init__(self, times: int) -> None:
        self.asked, self._times, self._replace = 0, times, os.replace

    def __call__(self, source: Path, target: Path) -> None:
        self.asked += 1
        if self.asked <= self._times:
            error = PermissionError(13, "Access is denied", str(source))
            error.winerror = 32  # type: ignore[attr-defined]
            raise error
        self._replace(source, target)


def test_it_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    held = Held(3)
    monkeypatch.setattr(os, "replace", held)
    (tmp_path / "old").write_text("old")
    write_text_atomic(tmp_path / "old", "new", sync=True)
    assert held.asked == 4
    assert (tmp_path / "old").read_text() == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


def test_who_holds_on_is_told_and_nothing_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(atomic_file, "PATIENCE_S", 0.1)
    monkeypatch.setattr(os, "replace", Held(10**9))
    (tmp_path / "old").write_text("old")
    (tmp_path / "new").write_text("new")
    with pytest.raises(PermissionError, match="held by another program") as raised:
        replace_file(tmp_path / "new", tmp_path / "old")
    assert raised.value.filename == str(tmp_path / "old")
    assert (tmp_path / "new").read_text() == "new"
    with pytest.raises(RecordingError, match="held by another program"):
        write_text_atomic(tmp_path / "old", "newer", sync=True)
    assert (tmp_path / "old").read_text() == "old"


def test_where_nobody_holds_it_nobody_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "replace", Held(10**9))
    monkeypatch.setattr(atomic_file, "_may_be_open_elsewhere", lambda target: False)
    began = time.monotonic()
    with pytest.raises(PermissionError):
        replace_file(tmp_path / "new", tmp_path / "old")
    assert time.monotonic() - began < 1.0


@pytest.mark.skipif(os.name == "nt", reason="no modes here")
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o444])
def test_what_was_closed_to_others_stays_so(tmp_path: Path, mode: int, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "result.json"
    path.write_text("old")
    path.chmod(mode)
    seen: list[int] = []
    replace = os.replace

    def looked_at(source: Path, target: Path) -> None:
        seen.append(os.stat(source).st_mode & 0o777)
        replace(source, target)

    monkeypatch.setattr(os, "replace", looked_at)
    write_text_atomic(path, "new", sync=True)
    assert path.read_text() == "new" and path.stat().st_mode & 0o777 == mode and seen == [mode]
    assert [left.name for left in tmp_path.iterdir()] == ["result.json"]


@pytest.mark.skipif(os.name == "nt", reason="no modes here")
def test_settings_keep_their_rights_too(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    assert save(path, Settings()) is None
    path.chmod(0o600)
    for _ in range(2):
        assert save(path, Settings()) is None
        assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.skipif(os.name != "posix", reason="rights as POSIX has them")
def test_a_file_that_is_moved_over_another_takes_its_rights(tmp_path: Path) -> None:
    new, old = tmp_path / "new", tmp_path / "old"
    new.write_text("new")
    old.write_text("old")
    old.chmod(0o600)
    new.chmod(0o644)
    replace_file(new, old)
    assert old.read_text() == "new" and old.stat().st_mode & 0o777 == 0o600 and not new.exists()
    new.write_text("newer")
    new.chmod(0o640)
    replace_file(new, tmp_path / "nobody")  # where there was none it keeps its own
    assert (tmp_path / "nobody").stat().st_mode & 0o777 == 0o640


@pytest.mark.skipif(os.name == "nt", reason="a folder is not synced there")
@pytest.mark.parametrize(
    ("write", "synced"),
    [
        (lambda path: write_toml_atomic(path, {"a": 1}), True),
        (lambda path: write_json_atomic(path, {"a": 1}, sync=True), True),
        (lambda path: write_json_atomic(path, {"a": 1}, sync=False), False),
        (lambda path: write_text_atomic(path, ("in ", "pieces"), sync=True), True),
        (lambda path: write_text_atomic(path, "at once", sync=False), False),
    ],
)
def test_what_is_to_last_is_synced_before_it_takes_its_place_and_what_is_not_need_not_be(
    write: Callable[[Path], None], synced: bool, tmp_path: Path
) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"old")
    with only_synced(tmp_path) as disk:
        write(path)
        after = disk.images()
    moved = "replace new -> a.txt"
    assert disk.calls == (["fsync new", moved, "fsync folder"] if synced else [moved])
    assert ([image["a.txt"] for image in after] == [path.read_bytes()]) == synced


@pytest.mark.skipif(os.name == "nt", reason="links and rights as POSIX has them")
def test_a_place_that_cannot_be_written_to_is_told_before_a_long_computation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere" / "file")
    for sound in ("file", "new"):
        check_writable(tmp_path / sound)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "link"]  # nothing is written
    for wrong, why in (
        (tmp_path, "a folder, not a file"),
        (tmp_path / "none" / "new", "the folder does not exist"),
        (tmp_path / "link", "the folder does not exist"),
        (tmp_path / "file" / "new", "Not a directory"),
        (tmp_path / ("x" * 300), "File name too long"),
    ):
        with pytest.raises(RecordingError, match=why):
            check_writable(wrong)
    monkeypatch.setattr(os, "access", lambda place, mode: (place, mode) != (tmp_path, os.W_OK))
    with pytest.raises(RecordingError, match="no right to write there"):
        check_writable(tmp_path / "new")


@pytest.mark.skipif(os.name != "posix", reason="owners as POSIX has them")
@pytest.mark.parametrize("theirs", [False, True])
def test_a_file_keeps_its_owner_where_that_may_be_and_loses_the_right_to_run_as_its_owner(
    tmp_path: Path, theirs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, asked = tmp_path / "a", []  # type: ignore[var-annotated]
    path.write_text("old")
    path.chmod(0o4751)
    real = os.stat_result

    def stat(self: Path, **how: bool) -> real:
        found = os.stat(self, **how)
        return real((*found[:4], 77, 88, *found[6:])) if theirs and self == path else found

    def chown(which: Path, owner: int, group: int) -> None:
        asked.append((which.name.endswith(".new"), owner, group))
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "stat", stat)
    monkeypatch.setattr(os, "chown", chown)
    write_text_atomic(path, "new", sync=True)
    assert path.read_text() == "new" and os.stat(path).st_mode & 0o7777 == 0o751
    assert asked == ([(True, 77, 88)] * 2 if theirs else [])  # before there is content, and before it takes its place
