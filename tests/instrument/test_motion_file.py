"""Motion records: what is read, and one clear line for an error."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from instrument.files.motion_file import read_motion
from instrument.files.recording_error import RecordingError


def write(folder: Path, table: str, about: str = 'model = "contact"\nmoving_mass_kg = 0.5\n') -> Path:
    (folder / "m.csv").write_text(table)
    (folder / "m.toml").write_text(about)
    return folder / "m.csv"


def test_columns_are_found_by_name(tmp_path: Path) -> None:
    path = write(tmp_path, "other, velocity_m_per_s ,time_s\nx,1.5,0\ny,2.5,0.25\n", 'model = "plate"\nrig = "r"\n')
    record = read_motion(path.with_suffix(".toml"))
    assert record.displacement_m is None and record.force_n is None and record.moving_mass_kg is None
    np.testing.assert_array_equal(record.time_s, [0, 0.25])
    np.testing.assert_array_equal(record.velocity_m_per_s, [1.5, 2.5])
    assert record.extra == {"rig": "r"} and not record.time_s.flags.writeable


def test_measured_records_open(measured: Path) -> None:
    record = read_motion(measured / "airtrack-1.csv")
    assert record.model == "contact" and record.moving_mass_kg == 0.0912 and record.velocity_m_per_s is None
    driven = read_motion(measured / "emps.csv")
    assert driven.model == "driven" and driven.force_n is not None and driven.force_n.shape == driven.time_s.shape


@pytest.mark.parametrize(
    ("table", "about", "named"),
    [
        ("time_s\n0\n1\n", 'model="plate"', "displacement_m"),
        ("displacement_m\n0\n1\n", 'model="plate"', "time_s"),
        ("time_s,displacement_m\n0,1\n", 'model="plate"', "rows"),
        ("time_s,displacement_m\n0,1\n1,abc\n", 'model="plate"', "abc"),
        ("time_s,displacement_m\n0,1\n1,nan\n", 'model="plate"', "row 3"),
        ("time_s,displacement_m\n0,1\n1,1e300\n", 'model="plate"', "row 3"),
        ("time_s,displacement_m\n0,1\n1,2\n1,3\n", 'model="plate"', "row 4"),
        ("time_s,displacement_m\n0,1\n1\n", 'model="plate"', "m.csv"),
        ("time_s,time_s,displacement_m\n0,0,1\n1,1,2\n", 'model="plate"', "two columns"),
        ("", 'model="plate"', "time_s"),
        ("time_s,displacement_m\n0,1\n1,2\n", "model=3", "model"),
        ("time_s,displacement_m\n0,1\n1,2\n", 'model="x"', "model"),
        ("time_s,displacement_m\n0,1\n1,2\n", "", "model"),
        ("time_s,displacement_m\n0,1\n1,2\n", "model=", "TOML"),
        ("time_s,displacement_m\n0,1\n1,2\n", 'model="plate"\nmoving_mass_kg=-1', "moving_mass_kg"),
        ("time_s,displacement_m\n0,1\n1,2\n", 'model="plate"\nmoving_mass_kg=nan', "moving_mass_kg"),
    ],
)
def test_refusals_are_one_line(tmp_path: Path, table: str, about: str, named: str) -> None:
    with pytest.raises(RecordingError) as caught:
        read_motion(write(tmp_path, table, about))
    assert named in str(caught.value) and "\n" not in str(caught.value) and "m." in str(caught.value)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200), st.binary(max_size=60))
def test_any_bytes_are_refused_in_one_line(tmp_path: Path, table: bytes, about: bytes) -> None:
    (tmp_path / "m.csv").write_bytes(b"time_s,displacement_m\n" + table)
    (tmp_path / "m.toml").write_bytes(b'model = "plate"\n' + about)
    try:
        read_motion(tmp_path / "m.csv")
    except RecordingError as error:
        assert "\n" not in str(error)
