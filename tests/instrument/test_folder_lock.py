"""One process at a time records into a folder: who holds it is told, and it is free again when they end."""

import os
import shutil
from pathlib import Path

import pytest

from instrument.files.folder_lock import LOCK_NAME, FolderLock, FolderLocked, disk_free_bytes
from instrument.files.recording_error import RecordingError


def test_a_second_one_is_refused_with_the_process_that_has_it_until_it_is_released(tmp_path: Path) -> None:
    (tmp_path / LOCK_NAME).write_text("what a longer number has left 123456789")
    first = FolderLock(tmp_path)
    assert (tmp_path / LOCK_NAME).read_text() == str(os.getpid())
    for _ in range(2):
        with pytest.raises(FolderLocked) as refusal:
            FolderLock(tmp_path)
        line = f"{tmp_path}: another Levimass is recording into this folder (process {os.getpid()})"
        assert str(refusal.value) == line
    other = FolderLock(tmp_path, "another.lock")  # of another kind: at the same time
    assert other.valid() and (tmp_path / "another.lock").is_file()
    (tmp_path / LOCK_NAME).write_text("nonsense")
    with pytest.raises(FolderLocked, match=r"into this folder$"):
        FolderLock(tmp_path)
    first.release()
    first.release()
    again = FolderLock(tmp_path)
    assert again.valid() and (tmp_path / LOCK_NAME).is_file()
    again.release()
    other.release()


def test_a_folder_that_was_removed_or_made_anew_is_no_longer_the_one_that_was_locked(tmp_path: Path) -> None:
    folder = tmp_path / "shots"
    folder.mkdir()
    lock = FolderLock(folder)
    assert lock.valid() and lock.folder == folder
    shutil.rmtree(folder)
    assert not lock.valid()
    folder.mkdir()
    (folder / LOCK_NAME).write_text("")
    assert not lock.valid()
    lock.release()
    assert not lock.valid()
    held = FolderLock(folder)
    held.release()
    assert not held.valid()  # released, though the file is there


def test_a_place_that_cannot_be_locked_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for place, why in ((tmp_path / "none", "the folder does not exist"), (tmp_path / "file", "cannot be written to")):
        with pytest.raises(RecordingError, match=why) as refusal:
            FolderLock(place)
        assert not isinstance(refusal.value, FolderLocked)
    assert disk_free_bytes(tmp_path) == pytest.approx(shutil.disk_usage(tmp_path).free, rel=0.5)
    assert disk_free_bytes(tmp_path / "none") is None
