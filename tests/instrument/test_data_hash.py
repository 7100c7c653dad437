"""The hash of the data a shot was analysed from."""

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.shot.recording import Recording
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import data_hash
from instrument.files.recording_writer import write_recording


def test_it_is_the_one_written_when_the_shot_was_taken(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(replace(shot, flags=()), tmp_path / "shot")
    data = tmp_path / "shot.sigmf-data"
    for path in (meta, data, tmp_path / "shot"):
        found = data_hash(path)
        assert found.agrees is True and found.file == data.name and found.size_bytes == data.stat().st_size
    data.write_bytes(data.read_bytes()[:-2] + b"\x01\x02")
    assert data_hash(meta).agrees is False


def test_any_other_file_is_hashed_as_it_is(tmp_path: Path) -> None:
    table = tmp_path / "motion.csv"
    table.write_text("time_s\n0\n")
    found = data_hash(table)
    assert found.sha512 == hashlib.sha512(table.read_bytes()).hexdigest()
    assert found.recorded is None and found.agrees is None
    with pytest.raises(RecordingError, match="no such file"):
        data_hash(tmp_path / "nothing.csv")
