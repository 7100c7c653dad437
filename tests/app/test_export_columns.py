"""The tables of an export, cell by cell: which column holds which number, and what is empty."""

import csv
from dataclasses import replace

import h5py
import numpy as np
import pytest

from analysis.diagnosis.findings.result import Errors
from analysis.shot.quantity import Quantity
from analysis.shot.version import program_version
from analysis.uncertainty import combined_uncertainties
from app.report.exports import (
    MODEL_COLUMNS,
    MOTION_COLUMNS,
    _error_cells,
    columns_of,
    export,
    export_hdf5,
    export_laws,
    law_columns,
    motion_columns,
    motion_file_names,
    shot_columns,
    shot_numbers,
    shot_row,
)
from tests.app.synthetic import diagnosis, learned_law, shot


def test_a_file_name_is_safe_short_and_its_own() -> None:
    names = ["a b/c", "A_b_c", "..", "", "shots", "budget", "series", "foretold", "_x.", "x", "é" * 150, "é" * 150]
    found = motion_file_names(names)
    assert found[:10] == [
        "a_b_c.csv", "A_b_c-2.csv", "shot.csv", "shot-2.csv", "shots-2.csv", "budget-2.csv", "series-2.csv",
        "foretold-2.csv", "x.csv", "x-2.csv",
    ]  # fmt: skip
    assert found[10:] == ["é" * 100 + ".csv", "é" * 100 + "-2.csv"]
    assert motion_file_names(["a", "a-2", "a"]) == ["a.csv", "a-2.csv", "a-3.csv"]


def test_the_columns_of_a_number_keep_its_unit_at_their_end() -> None:
    of_key = {number.key: columns_of(number) for number in shot_numbers()}
    assert of_key["velocity_in_m_per_s"] == [
        "velocity_in_m_per_s",
        "velocity_in_std_m_per_s",
        "velocity_in_std_noise_m_per_s",
    ]
    assert of_key["force_peak_n"] == ["force_peak_n", "force_peak_std_n", "force_peak_std_noise_n"]
    fitted = of_key["plate_stiffness_n_per_m"]
    assert fitted == [f"plate_stiffness_n_per_m{ending}" for ending in ("", "_std", "_std_noise")]
    names = [f"cor_kinetic_force_peaks{ending}" for ending in ("", "_std", "_std_noise")]
    assert of_key["cor_kinetic.force_peaks"] == names
    assert len(set(shot_columns())) == len(shot_columns())


def test_a_row_of_a_shot_has_a_cell_for_every_column() -> None:
    one = replace(shot("one", seed=2), path="/x/one.sigmf-data", note="a note", flags=("clipped", "gap"))
    row = dict(zip(shot_columns(), shot_row(one, "one.csv"), strict=True))
    first = {"name": "one", "path": "/x/one.sigmf-data", "started_at": "2026-03-01T10:12:05Z", "status": "ok"}
    first |= {"problem": "", "flags": "clipped gap", "note": "a note", "motion_file": "one.csv", "model": "paper"}
    assert {key: row[key] for key in first} == first and row["reduced_chi2"] == "1.02"
    combined = combined_uncertainties(one)
    for number in shot_numbers():
        cells = [row[name] for name in columns_of(number)]
        reading = number.find(one)
        if isinstance(reading, Quantity):
            std = reading.std if combined.get(number.key) is None else combined[number.key]
            assert [float(cell) for cell in cells] == [reading.value, std, reading.std], number.key
        else:
            assert cells == ["", "", ""], number.key
    unfitted = replace(one, fit=replace(one.fit, converged=False))
    assert shot_row(unfitted, "")[-1] == ""
    failed = dict(zip(shot_columns(), shot_row(shot("no", problem="no impact"), ""), strict=True))
    assert (failed["status"], failed["problem"], failed["model"], failed["reduced_chi2"]) == (
        "failed",
        "no impact",
        "",
        "",
    )
    assert failed["path"] == failed["velocity_in_m_per_s"] == failed["velocity_in_std_m_per_s"] == ""


def test_a_series_is_written_of_several_shots_and_failed_ones_have_no_motion(tmp_path) -> None:
    one, two, failed = shot("one"), shot("two", seed=3), shot("three", problem="no impact")
    written = [path.name for path in export([one, failed, two], tmp_path / "new" / "folder")]
    assert written == ["one.csv", "two.csv", "shots.csv", "budget.csv", "series.csv"]
    rows = list(csv.DictReader((tmp_path / "new" / "folder" / "shots.csv").open()))
    assert [(row["name"], row["motion_file"]) for row in rows] == [
        ("one", "one.csv"),
        ("three", ""),
        ("two", "two.csv"),
    ]
    assert [path.name for path in export([one], tmp_path)] == ["one.csv", "shots.csv", "budget.csv"]


def test_a_motion_has_the_columns_of_its_record_and_those_of_a_fit_that_converged(tmp_path) -> None:
    one = shot("one")
    hidden = one.motion.displacement_m.copy()
    hidden[3] = np.nan
    one = replace(one, motion=replace(one.motion, displacement_m=hidden))
    columns = motion_columns(one)
    assert list(columns) == [*MOTION_COLUMNS, *MODEL_COLUMNS]
    overlay = one.fit.shots[0].overlay
    kept = (overlay.displacement_m, overlay.velocity_m_per_s, overlay.force_n, overlay.gap_m)
    assert all(np.array_equal(columns[name], values) for name, values in zip(MODEL_COLUMNS, kept, strict=True))
    assert np.array_equal(columns["velocity_m_per_s"], one.motion.velocity_m_per_s)
    failed = replace(one, fit=replace(one.fit, converged=False))
    assert list(motion_columns(failed)) == list(motion_columns(replace(one, fit=None))) == list(MOTION_COLUMNS)
    two_shots = replace(one, fit=replace(one.fit, shots=2 * one.fit.shots))  # whose overlay is not of this shot alone
    assert list(motion_columns(two_shots)) == list(MOTION_COLUMNS)
    export([one], tmp_path)
    header, *rows = csv.reader((tmp_path / "one.csv").open())
    assert header == list(columns) and len(rows) == one.motion.time_s.size
    assert rows[3][1] == "" and [float(cell) for cell in rows[4]] == [values[4] for values in columns.values()]


def test_hdf5_says_what_the_shot_was(tmp_path) -> None:
    one = replace(shot("one"), note="a\x00note" + 17000 * "x", flags=("clipped", "gap"))
    other = shot("two", seed=3)
    (path, second) = export_hdf5([one, other], tmp_path)
    assert (path.name, second.name) == ("one.h5", "two.h5")
    with h5py.File(path) as file:
        assert file.attrs["program"] == f"levimass {program_version()}" and file.attrs["name"] == "one"
        assert file.attrs["flags"] == "clipped gap" and file.attrs["started_at"] == one.started_at
        assert file.attrs["note"].startswith("a note") and len(file.attrs["note"]) == 16000
        group = file["motion"]
        rates = [group.attrs[name] for name in ("sample_rate_hz", "bandwidth_hz", "moving_mass_kg")]
        assert rates == [one.motion.sample_rate_hz, one.motion.bandwidth_hz, one.motion.moving_mass_kg]
        assert group["velocity_m_per_s"].attrs["unit"] == "m/s"
        assert group["force_n"].attrs["unit"] == "N"
        assert np.array_equal(group["valid"][:], one.motion.valid)
        assert '"budget"' not in file.attrs["result"] and '"cor_quasi_static"' in file.attrs["result"]


def test_a_law_has_a_column_for_each_form_that_has_a_curve(tmp_path) -> None:
    law = replace(
        learned_law(), argument="rate of bend", curve_unit="m/s", form_force_n=2.0 * learned_law().curve_std_n
    )
    columns = law_columns(law)
    names = ["rate_of_bend_m_per_s", "force_n", "force_std_n", "exponential_n", "inverse_square_n"]
    assert list(columns) == names
    values = (
        law.curve_argument,
        law.curve_force_n,
        law.curve_std_n,
        law.form_force_n,
        law.other_forms[0].curve_force_n,
    )
    assert [column == wanted.tolist() for column, wanted in zip(columns.values(), values, strict=True)] == 5 * [True]
    told = replace(diagnosis(shot()), laws=(law, learned_law()))
    paths = export_laws(told, tmp_path)
    assert [path.name for path in paths] == ["law_1.csv", "law_2.csv"]
    header, *rows = csv.reader(paths[0].open())
    assert header == names and [[float(cell) for cell in row] for row in rows] == [
        list(row) for row in zip(*columns.values(), strict=True)
    ]


@pytest.mark.parametrize(
    ("errors", "cells"),
    [
        (None, ["", "", "", ""]),
        (Errors(1e-9, 2e-6, float("nan"), 1.5), ["1e-09", "2e-06", "", "1.5"]),
    ],
)
def test_an_error_that_there_is_not_is_an_empty_cell(errors, cells) -> None:
    assert _error_cells(errors) == cells
