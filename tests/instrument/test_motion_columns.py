"""A displacement in mm, um or nm is converted to m, whatever its header looks like."""

from pathlib import Path

import numpy as np
import pytest

from instrument.files import csv_table
from instrument.files.motion_file import LENGTHS_M, MotionColumns, length_unit, read_motion, save_columns
from instrument.files.recording_error import RecordingError
from instrument.files.recording_search import find_recordings, is_motion_record

TIME_MS = np.array([0.0, 0.5, 1.0, 2.0])
LENGTH_M = np.array([0.0, 1.25e-3, -2.5e-3, 4e-4])


def written(path: Path, header: str, *columns: np.ndarray, parted: str = ",", comma: bool = False) -> Path:
    rows = [parted.join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    text = "\n".join(rows).replace(".", "," if comma else ".")
    path.write_text(f"{header}\n{text}\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("displacement (mm)", "mm"), ("x [um]", "um"), ("x [\u00b5m]", "um"), ("x [\u03bcm]", "um"), ("x_nm", "nm"),
        ("x (m)", "m"), ("x", None), ("CH1 (V)", None), ("x_min", None), ("beam", None),
    ],
)  # fmt: skip
def test_the_unit_stands_in_the_header_and_the_numbers_come_out_in_metres(
    header: str, unit: str | None, tmp_path: Path
) -> None:
    chosen = unit or "um"
    path = written(tmp_path / "a.csv", f"time (ms),{header}", TIME_MS, LENGTH_M / LENGTHS_M[chosen])
    (channel,) = csv_table.contents(path).channels
    assert length_unit(channel) == unit
    assert save_columns(path, MotionColumns(channel.name, chosen, "contact", 0.1)) == tmp_path / "a.toml"
    record = read_motion(path)
    assert record.displacement_m is not None
    np.testing.assert_allclose(record.displacement_m, LENGTH_M, rtol=1e-12)
    np.testing.assert_allclose(record.time_s, 1e-3 * TIME_MS, rtol=1e-12)
    assert (record.model, record.moving_mass_kg, record.extra) == ("contact", 0.1, {})
    assert is_motion_record(path) and find_recordings([tmp_path]) == [path]


def test_a_table_with_decimal_commas_and_without_a_time(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "n;Weg (mm)", np.arange(4.0), 1e3 * LENGTH_M, parted=";", comma=True)
    with pytest.raises(RecordingError, match="no column is the time"):
        save_columns(path, MotionColumns("Weg", "mm"))
    assert (MotionColumns("Weg", "mm").model, MotionColumns("Weg", "mm").moving_mass_kg) == ("contact", None)
    assert list(tmp_path.iterdir()) == [path]  # what cannot be read is not remembered
    save_columns(path, MotionColumns("Weg", "mm", sample_rate_hz=2e3))
    record = read_motion(path)
    assert record.displacement_m is not None
    np.testing.assert_allclose(record.displacement_m, LENGTH_M, rtol=1e-12)
    np.testing.assert_allclose(record.time_s, np.arange(4) / 2e3)


def test_the_description_of_a_motion_record_is_not_overwritten(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "time_s,displacement_m,x (mm)", TIME_MS, LENGTH_M, LENGTH_M)
    about = tmp_path / "a.toml"
    about.write_text('model = "contact"\n')
    with pytest.raises(RecordingError, match="not overwritten"):
        save_columns(path, MotionColumns("x", "mm"))
    assert about.read_text() == 'model = "contact"\n'
    record = read_motion(path)  # without [columns] the numbers are in m, as ever
    assert record.displacement_m is not None and record.displacement_m[1] == LENGTH_M[1]


@pytest.mark.parametrize(
    ("about", "cause"),
    [
        ('[columns.displacement]\nname = "x"\nunit = "furlong"', "unit: is none of m, mm, um, nm"),
        ('[columns.displacement]\nname = "x"', "unit: is none of m, mm, um, nm"),
        ('[columns.displacement]\nunit = "mm"', "displacement.name: missing"),
        ('[columns.displacement]\nname = "y"\nunit = "mm"', "no channel 'y'"),
        ("columns = 3", "columns: 3 is not an object"),
    ],
)
def test_wrong_columns_are_refused_in_one_line(about: str, cause: str, tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "time (ms),x", TIME_MS, LENGTH_M)
    (tmp_path / "a.toml").write_text(f'model = "contact"\n{about}\n')
    with pytest.raises(RecordingError) as refused:
        read_motion(path)
    assert cause in str(refused.value) and "\n" not in str(refused.value)
