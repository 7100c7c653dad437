"""The metadata of a recording are checked against its data, and altered data are flagged."""

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pytest

from analysis.pipeline import analyse
from analysis.shot.recording import MAX_GAPS, Gap, Recording
from analysis.shot.shot import Cancelled, Shot
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import analyse_and_check_hash, hash_matches, read_recording
from instrument.files.recording_writer import write_recording


def test_gaps_longer_than_the_recording_are_of_unknown_length(shot: Recording) -> None:
    """A gap of 1e9 samples took 2 GB, one of 2**53 was a fault of the program."""
    long = dataclasses.replace(shot, gaps=(Gap(500, 2**53), Gap(300, 10), Gap(0, 7), Gap(shot.samples, 5), Gap(400, 0)))
    assert long.bridgeable_gaps == (Gap(300, 10), Gap(500, None))
    many = dataclasses.replace(shot, gaps=tuple(Gap(n, shot.samples // 3) for n in range(100, 110)))
    assert [gap.samples_lost is None for gap in many.bridgeable_gaps] == [False] * 3 + [True] * 7
    crowd = dataclasses.replace(shot, gaps=tuple(Gap(n, 1) for n in range(1, MAX_GAPS + 2)))
    assert all(gap.samples_lost is None for gap in crowd.bridgeable_gaps)


def test_a_recording_keeps_what_it_says_of_its_gaps(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(dataclasses.replace(shot, gaps=(Gap(500, 10**9),)), tmp_path / "s")
    assert read_recording(meta).gaps == (Gap(500, 10**9),)


def test_altered_data_are_said(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(shot, tmp_path / "s")
    assert "data_altered" not in read_recording(meta).flags
    data = tmp_path / "s.sigmf-data"
    raw = bytearray(data.read_bytes())
    raw[len(raw) // 2] ^= 1
    data.write_bytes(raw)
    assert "data_altered" in read_recording(meta).flags
    head = json.loads(meta.read_text())
    head["global"]["core:sha512"] = head["global"]["core:sha512"].upper()
    meta.write_text(json.dumps(head))
    data.write_bytes(np.ascontiguousarray(shot.counts).tobytes())
    assert "data_altered" not in read_recording(meta).flags


def test_altered_data_are_said_of_the_shot_analysed_while_they_were_hashed(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(dataclasses.replace(shot, flags=()), tmp_path / "s")
    assert "data_altered" not in analyse_and_check_hash(meta, analyse).flags
    data = tmp_path / "s.sigmf-data"
    data.write_bytes(bytes([data.read_bytes()[0] ^ 1]) + data.read_bytes()[1:])
    said = analyse_and_check_hash(meta, analyse)
    assert said.flags.count("data_altered") == 1 and said.samples == shot.samples


def test_an_analysis_that_is_stopped_does_not_wait_for_the_hash(shot: Recording, tmp_path: Path) -> None:
    big = dataclasses.replace(shot, counts=np.zeros((10_000_000, 3), np.int16))
    looked: list[int] = []

    def third_time() -> bool:
        looked.append(1)
        return len(looked) == 3

    assert hash_matches(big, "0" * 128, third_time)  # given up: nothing is said
    assert len(looked) == 3 and not hash_matches(big, "0" * 128)
    meta = write_recording(shot, tmp_path / "s")

    def stop(_: Recording) -> Shot:
        raise Cancelled

    with pytest.raises(Cancelled):
        analyse_and_check_hash(meta, stop)


def test_a_file_that_shrinks_after_it_was_opened_ends_nothing(shot: Recording, tmp_path: Path) -> None:
    """A mapped file cut short ended the process with SIGBUS at the next look."""
    meta = write_recording(shot, tmp_path / "s")
    opened = read_recording(meta)
    os.truncate(tmp_path / "s.sigmf-data", 0)
    np.testing.assert_array_equal(opened.counts, shot.counts)


@pytest.mark.parametrize(
    ("key", "value"), [("moving_mass_kg", 1e-300), ("rest_frequency_hz", 1e-300), ("moving_mass_kg", 0)]
)
def test_numbers_no_rig_has_are_refused_by_name(shot: Recording, tmp_path: Path, key: str, value: float) -> None:
    meta = write_recording(shot, tmp_path / "s")
    head = json.loads(meta.read_text())
    head["global"]["lmm:setup"][key] = value
    meta.write_text(json.dumps(head))
    with pytest.raises(RecordingError, match=key):
        read_recording(meta)
