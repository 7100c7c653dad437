"""One rule of ±: a number is shown with its combined uncertainty wherever it stands, or a word says that it is not."""

import csv
import math
import tomllib
from dataclasses import replace

import pytest

from analysis.diagnosis.findings.model_file import from_text
from analysis.paper.paper import reproduce
from analysis.report import result
from analysis.shot.quantity import Quantity
from analysis.uncertainty.gum_budget import budget
from analysis.uncertainty.numbers import Origin, collision_numbers, number_with_key
from analysis.uncertainty.series_statistics import series
from app.report.exports import columns_of, export
from app.report.number_tables import summary
from app.report.page import report_of
from app.session.model_in_use import write_model
from app.session.session import Session
from app.window.panels.compare import ComparePanel
from app.window.panels.large import LargePanel
from app.window.panels.numbers import NumbersPanel
from app.window.panels.session_table import SessionTable
from app.window.panels.state_words import last_shot
from app.words.wording import concise_text, value_text
from tests.app import synthetic
from tests.app.on_screen import large_text


@pytest.fixture(scope="module")
def entry():
    """A shot whose clock and mass leave more of some numbers in doubt than its noise does."""
    session = Session()
    return session.add(synthetic.shot())


@pytest.fixture(scope="module")
def combined(entry):
    return {q.key: q.quantity for q in budget(entry.shot).quantities}


def test_every_number_of_the_panel_that_was_read_has_a_budget(entry, combined):
    rows = collision_numbers(Origin.READ, Origin.FITTED)
    read = {row.key for row in rows if value_text(row.find(entry.shot)) != "–"}
    assert read and read <= set(combined)


def test_banner_panel_list_and_terminal_state_the_same_uncertainty(qtbot, entry, combined):
    panel, table = NumbersPanel(), SessionTable()
    for widget in (panel, table):
        qtbot.addWidget(widget)
    panel.resize(900, 700)
    panel.show()
    panel.show_shot(entry.shot)
    cor = value_text(combined["cor_quasi_static"])
    assert panel.values["quasi-static"].text() in (cor, concise_text(combined["cor_quasi_static"]))
    assert cor in last_shot(entry).saved
    told = summary(entry.shot)
    assert f"COR quasi-static           {cor}" in told
    assert str(combined["velocity_in_m_per_s"]) in told and str(combined["plate_stiffness_n_per_m"]) in told
    assert str(entry.shot.fit.parameters["plate_stiffness_n_per_m"]) not in told


def test_the_papers_table_states_a_recording_as_the_panel_does(entry, combined):
    rows = [row for row in reproduce(entry.shot).rows if isinstance(row.recorded, Quantity)]
    assert len(rows) > 5 and {row.recorded.std for row in rows} <= {q.std for q in combined.values()}


def test_a_parameter_without_a_budget_says_that_its_uncertainty_is_noise_alone(entry):
    fit = entry.shot.fit
    name = "quadratic_drag.coefficient_n_s2_per_m2"
    shot = replace(entry.shot, fit=replace(fit, parameters={**fit.parameters, name: fit.parameters["plate_mass_kg"]}))
    line = next(line for line in summary(shot).splitlines() if name in line)
    assert line.endswith("(± from noise alone)")


def test_large_letters_are_rounded_to_the_combined_uncertainty(qtbot, entry, combined):
    panel = LargePanel()
    qtbot.addWidget(panel)
    panel.show_shot(entry.shot, "Shot 1")
    whole = str(combined["velocity_in_m_per_s"]).partition(" ±")[0]
    assert whole.startswith(large_text(panel, "v in")) and len(large_text(panel, "v in")) <= len(whole)


def test_a_trend_says_which_uncertainty_its_bars_are(qtbot):
    session = Session()
    for index, speed in enumerate((0.2, 0.25, 0.3), 1):
        session.add(synthetic.shot(f"shot-{index}", speed, index))
    panel = ComparePanel()
    qtbot.addWidget(panel)
    panel.show_entries(list(session.entries))
    panel.which.setCurrentIndex(panel.which.findData("plate_stiffness_n_per_m"))
    assert "bars: ± from each shot's noise only" in panel.repeatability.text()  # what all share scatters nothing
    assert "standard uncertainty, noise alone" in panel.trend.columns


def test_the_report_parts_noise_from_the_whole_of_a_fitted_number(entry, combined):
    page = report_of([entry.shot])
    assert str(combined["plate_stiffness_n_per_m"]) in page
    assert str(entry.shot.fit.parameters["plate_stiffness_n_per_m"]) not in page


def test_shots_csv_has_the_combined_uncertainty_and_the_noise_in_a_column_named_so(entry, combined, tmp_path):
    export([entry.shot], tmp_path)
    with (tmp_path / "shots.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    seen = 0
    for key, whole in combined.items():
        if number_with_key(key).origin is Origin.DERIVED:  # in budget.csv alone
            continue
        value, std, noise = columns_of(number_with_key(key))
        assert float(row[std]) == whole.std, key
        reading = number_with_key(key).find(entry.shot)
        if isinstance(reading, Quantity):
            assert float(row[value]) == reading.value and float(row[noise]) == reading.std, key
            seen += reading.std < whole.std
    assert seen > 8
    assert float(row["cor_kinetic_force_peaks_std"]) == combined["cor_kinetic.force_peaks"].std
    noise = entry.shot.fit.parameters["plate_stiffness_n_per_m"].std
    assert float(row["plate_stiffness_n_per_m_std"]) == combined["plate_stiffness_n_per_m"].std
    assert float(row["plate_stiffness_n_per_m_std_noise"]) == noise


def test_the_result_file_states_the_combined_uncertainty_of_every_number_of_the_panel(entry, combined):
    (told,) = result([entry.shot], None)["shots"]
    stated = told["budget"]["quantities"]
    assert set(stated) == set(combined)
    for key, whole in combined.items():
        assert (stated[key]["value"], stated[key]["std"]) == (whole.value, whole.std), key
        assert stated[key]["expanded"] == 2.0 * whole.std


def test_a_reports_table_of_all_shots_states_the_combined_uncertainty(entry, combined):
    shots = [entry.shot, synthetic.shot("shot-2", 0.27, 2)]
    page = report_of(shots)
    for key in ("velocity_in_m_per_s", "cor_quasi_static"):
        assert f"<td>{combined[key]}</td>" in page
        assert f"<td>{getattr(entry.shot.impact, key)}</td>" not in page
    mean = series(shots).of("force_peak_n").mean
    shared = budget(entry.shot).of("force_peak_n").std_b
    assert f"<td>{replace(mean, std=math.hypot(mean.std, shared))}</td>" in page


def test_a_model_file_says_which_uncertainty_is_which(entry, combined, tmp_path):
    fit = entry.shot.fit
    path = "/data/# value and standard uncertainty, SI units"  # a name that looks like the file's own comment
    write_model(tmp_path / "model.toml", fit, [replace(entry.shot, path=path)], None, ())
    text = (tmp_path / "model.toml").read_text(encoding="utf-8")
    whole = tomllib.loads(text)
    name = "plate_stiffness_n_per_m"
    assert "value, and standard uncertainty from noise alone" in text and from_text(text).shots == (path,)
    assert whole["parameters"][name]["std"] == fit.parameters[name].std
    assert whole["combined_std"][name] == pytest.approx(combined[name].std)
    assert from_text(text).parameters[name].std == fit.parameters[name].std
