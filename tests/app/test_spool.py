"""The arrays of shots that are not looked at cost no memory; they are the same, also where the disk is full."""

import errno
import gc
import os
import pickle
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.shot.shot import AnalysisSettings
from app.session import spool as spools
from app.session.session import Session
from app.session.spool import MIN_BYTES, Spool
from app.session.workbench import Workbench
from tests.app import synthetic


def _arrays(value, place="shot"):
    if isinstance(value, np.ndarray):
        yield place, value
    elif is_dataclass(value):
        for field in fields(value):
            yield from _arrays(getattr(value, field.name), f"{place}.{field.name}")
    elif isinstance(value, tuple | list):
        for index, one in enumerate(value):
            yield from _arrays(one, f"{place}[{index}]")


def _own_bytes(value) -> int:
    """Return how much memory the arrays of a value have for themselves, in bytes."""
    own = {}
    for _, array in _arrays(value):
        base = array
        while isinstance(base.base, np.ndarray):
            base = base.base
        if base.base is None:
            own[id(base)] = base.nbytes
    return sum(own.values())


def _same(one, other) -> bool:
    pairs = list(zip(_arrays(one), _arrays(other), strict=True))
    return bool(pairs) and all(
        a == b and x.dtype == y.dtype and np.array_equal(x, y, equal_nan=True) for (a, x), (b, y) in pairs
    )


@pytest.fixture(scope="module")
def shot():
    return synthetic.shot(count=9000)


def test_a_shot_is_the_same_and_its_arrays_are_no_longer_in_memory(tmp_path, shot):
    moved = Spool(tmp_path / "kept").moved(shot)
    assert _same(shot, moved) and moved.name == shot.name and moved.settings == shot.settings
    assert repr(moved.impact) == repr(shot.impact)
    assert moved.fit.shots[0].overlay.time_s is moved.motion.time_s  # one array, as before
    assert _own_bytes(shot) > 500_000 and _own_bytes(moved) < 20 * MIN_BYTES
    assert not moved.motion.force_n.flags.writeable
    assert _same(pickle.loads(pickle.dumps(moved)), shot)  # it goes to another process as before
    assert list((tmp_path / "kept").iterdir()) == [] or os.name == "nt"  # the file has no name that could be left over


def test_a_session_holds_shots_and_diagnoses_so_whatever_way_they_come(tmp_path, shot):
    spool = Spool(tmp_path)
    bench = Workbench(Session(), AnalysisSettings, spool=spool)
    try:
        first = bench.session.add(shot)
        bench.session.fill(first.number, shot)
        captured = bench.session.add_captured("shot-2", None, AnalysisSettings())
        bench.session.fill(captured.number, shot)
        for entry in bench.session.entries:
            assert _same(entry.shot, shot) and _own_bytes(entry.shot) < 20 * MIN_BYTES
        found = _diagnosed(bench, shot)
        assert _own_bytes(found.diagnosis) < 20 * MIN_BYTES
    finally:
        bench.close()


def _diagnosed(bench, shot):
    bench._take_diagnosis((1,), synthetic.diagnosis(shot))
    return bench.diagnoses.newest


def test_what_is_read_stays_right_after_its_memory_was_given_back(tmp_path, shot, monkeypatch):
    monkeypatch.setattr(spools, "RELEASE_EVERY_S", 0.0)
    spool = Spool(tmp_path)
    moved = [spool.moved(shot) for _ in range(5)]
    for _ in range(3):
        assert all(_same(one, shot) for one in moved)
        spool.release()


def test_memory_is_given_back_now_and_then_and_not_at_every_look(tmp_path, shot, monkeypatch):
    class Mapped:
        given_back = 0

        def madvise(self, _):
            Mapped.given_back += 1

    spool, mapped, clock = Spool(tmp_path), Mapped(), iter((100.0, 104.0, 106.0, 107.0))
    spool._mapped.add(mapped)
    monkeypatch.setattr(spools.time, "monotonic", lambda: next(clock))
    counts = []
    for _ in range(4):
        spool.release()
        counts.append(Mapped.given_back)
    assert counts == [1, 1, 2, 2]  # at once, then no sooner than after five seconds


def test_many_shots_fill_several_pieces_and_each_goes_with_its_last_array(tmp_path, shot, monkeypatch):
    monkeypatch.setattr(spools, "PIECE_BYTES", 2 * 2**20)
    spool = Spool(tmp_path)
    moved = [spool.moved(shot) for _ in range(8)]
    assert all(_same(one, shot) for one in moved)
    pieces = len(spool._mapped)
    assert pieces >= 4
    del moved[:-1]
    gc.collect()
    assert len(spool._mapped) < pieces / 2
    assert _same(moved[0], shot)


@pytest.mark.parametrize("after", [0, 100_000])
def test_on_a_full_disk_a_shot_stays_in_memory_and_the_next_is_moved_again(tmp_path, shot, monkeypatch, after):
    spool = Spool(tmp_path)
    before = spool.moved(shot)
    file = spool._piece._file

    def full(content: bytes) -> int:
        if after and len(content) > after:
            return file.write(content[:after])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(spool._piece, "_file", SimpleNamespace(seek=file.seek, write=full))
    assert spool.moved(shot) is shot
    monkeypatch.undo()
    again = spool.moved(shot)
    assert _same(before, shot) and _same(again, shot) and _own_bytes(again) < 20 * MIN_BYTES


def test_a_folder_that_cannot_be_written_is_no_hindrance(tmp_path, shot):
    (tmp_path / "file").write_text("")
    assert Spool(Path(tmp_path / "file")).moved(shot) is shot
