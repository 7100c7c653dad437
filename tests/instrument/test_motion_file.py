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


@pytest.mark.parametrize(
    ("body", "line"),
    [
        ("0,1\n\n1\n", "row 4 has 1 cells, displacement_m would be number 2"),
        ("0,1\n1, b c \n", "displacement_m: row 3: 'b c' is not a number"),
        ("x,1\n1,2\n", "time_s: row 2: 'x' is not a number"),
        ("0,1\n1,-1.01e12\n", "displacement_m: row 3 is not a finite number a rig could give"),
        ("0,1\n1,2\n1,3\n", "time_s: time does not rise at row 4"),
        ("0,1\n2,2\n1,3\n3,1\n", "time_s: time does not rise at row 4"),
        ("0,1\n", "1 rows, at least 2 are needed"),
        ("\n", "0 rows, at least 2 are needed"),
    ],
)
def test_a_bad_cell_is_told_by_row_and_column_as_a_spreadsheet_counts(tmp_path: Path, body: str, line: str) -> None:
    path = write(tmp_path, f"time_s,displacement_m\n{body}")
    with pytest.raises(RecordingError) as caught:
        read_motion(path)
    assert str(caught.value) == f"{path}: {line}"


def test_numbers_are_read_up_to_what_a_rig_can_give(tmp_path: Path) -> None:
    record = read_motion(write(tmp_path, "time_s,displacement_m\n-1e12,1e12\n1e12,-1e12\n", 'model = "driven"\n'))
    assert record.displacement_m is not None and record.displacement_m.tolist() == [1e12, -1e12]
    assert (record.name, record.path, record.moving_mass_u_kg) == ("m", str(tmp_path / "m.csv"), None)
    table = "time_s,force_n,velocity_m_per_s\n0,5,1\n1,6,2\n"
    for key, low, high in (("moving_mass_kg", 1e-9, 1e6), ("moving_mass_u_kg", 0.0, 1e6)):
        for value in (low, high):
            found = read_motion(write(tmp_path, table, f'model = "plate"\n{key} = {value!r}\n'))
            assert getattr(found, key) == value and found.force_n is not None and found.force_n.tolist() == [5, 6]
        for value in (low * 0.99 - 1e-12, high * 1.01):
            with pytest.raises(RecordingError, match=f"{key}: .* is not from"):
                read_motion(write(tmp_path, table, f'model = "plate"\n{key} = {value!r}\n'))
    (tmp_path / "t.tsv").write_text("time_s\tdisplacement_m\n0\t1\n1\t2\n")
    (tmp_path / "t.toml").write_text('model = "contact"\n')
    assert read_motion(tmp_path / "t.toml").path == str(tmp_path / "t.tsv")
    lone = tmp_path / "lone.csv"
    lone.write_text("a\n")
    with pytest.raises(RecordingError, match=r"neither lone.toml .* nor a mapping .*'levimass map lone.csv'"):
        read_motion(lone)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200), st.binary(max_size=60))
def test_any_bytes_are_refused_in_one_line(tmp_path: Path, table: bytes, about: bytes) -> None:
    (tmp_path / "m.csv").write_bytes(b"time_s,displacement_m\n" + table)
    (tmp_path / "m.toml").write_bytes(b'model = "plate"\n' + about)
    try:
        read_motion(tmp_path / "m.csv")
    except RecordingError as error:
        assert "\n" not in str(error)
