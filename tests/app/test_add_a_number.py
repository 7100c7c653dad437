"""Follow docs/add-a-number.md with the code that stands there: the number is found wherever numbers are shown."""

import csv
import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from PySide6.QtCore import Qt

from analysis.report import result
from analysis.shot.quantity import NotSeen, Quantity
from analysis.uncertainty import gum_budget, measurement_equations, numbers
from analysis.uncertainty.gum_budget import combined_uncertainties, with_combined_uncertainty
from app.report.exports import export
from app.report.number_tables import summary
from app.report.page import report_of
from app.session.session import Session
from app.window.panels.compare import ComparePanel
from app.window.panels.numbers import NumbersPanel
from app.window.panels.session_table import SessionTable
from app.words.wording import concise_text
from tests.analysis.uncertainty import test_equations
from tests.app import synthetic
from tests.app.on_screen import trend_points
from tests.pages import code_blocks


def _of_the_page():
    """Return the number of the page: its function and its row, as they would stand in ``numbers.py``."""
    function, equation, row = code_blocks("add-a-number.md")
    equations = dict(vars(measurement_equations))
    exec(compile(equation, "measurement_equations.py", "exec"), equations)
    names = vars(numbers) | {"by": SimpleNamespace(**equations)}
    exec(compile(function, "numbers.py", "exec"), names)
    return eval(row, names)


IMPULSE = _of_the_page()


def _impulse(shot):
    peak, width = shot.impact.force_peak_n, shot.impact.force_fwhm_s
    value = peak.value * width.value
    return Quantity(value, value * math.hypot(peak.std / peak.value, width.std / width.value), "peak times width")


@pytest.fixture
def shots(monkeypatch):
    with_it = (*numbers.NUMBERS, IMPULSE)
    for module in (numbers, gum_budget):
        monkeypatch.setattr(module, "NUMBERS", with_it)
    return [synthetic.shot(f"shot-{n}", speed, n) for n, speed in enumerate((0.2, 0.25, 0.3), 1)]


def test_a_number_stands_in_every_file_with_both_uncertainties(shots, tmp_path):
    found, whole = result(shots, None), [_impulse(shot) for shot in shots]
    assert [shot["pulse_impulse_n_s"]["value"] for shot in found["shots"]] == [q.value for q in whole]
    budget = found["shots"][0]["budget"]["quantities"]["pulse_impulse_n_s"]
    assert budget["unit"] == "N s" and budget["std_b"] > 0.0
    mean = found["series"]["quantities"]["pulse_impulse_n_s"]["mean"]["value"]
    assert mean == pytest.approx(sum(q.value for q in whole) / 3)
    export(shots, tmp_path)
    with (tmp_path / "shots.csv").open(newline="") as file:
        row = next(csv.DictReader(file))
    assert float(row["pulse_impulse_n_s"]) == whole[0].value
    assert float(row["pulse_impulse_std_noise_n_s"]) == whole[0].std
    assert float(row["pulse_impulse_std_n_s"]) == budget["std"] > whole[0].std
    assert "pulse_impulse_n_s" in (tmp_path / "series.csv").read_text() + (tmp_path / "budget.csv").read_text()


def test_a_number_stands_in_report_terminal_and_window(shots, qtbot):
    page = report_of(shots).replace("\u00a0", " ")  # no unit is broken over two lines
    assert page.count("peak force times width (N s)") >= 3 + 1 + 1  # each shot, across the shots, its trend
    assert "  impulse  " in summary(shots[0])
    session = Session()
    for shot in shots:
        session.add(shot)
    panel, table, compare = NumbersPanel(), SessionTable(), ComparePanel()
    for widget in (panel, table, compare):
        qtbot.addWidget(widget)
    panel.show_shot(shots[0])
    assert panel.values["impulse"].text() != "–" and "About the impulse" in panel.values["impulse"].toolTip()
    table.show_session(session)
    column = next(place for place, of in enumerate(table.model.columns) if of.head == "impulse (N s)")
    assert table.table.isColumnHidden(column)
    combined = with_combined_uncertainty(_impulse(shots[0]), IMPULSE.key, combined_uncertainties(shots[0]))
    assert table.model.index(0, column).data(Qt.ItemDataRole.DisplayRole) == concise_text(combined)
    compare.show_entries(list(session.entries))
    compare.which.setCurrentIndex(compare.which.findData("pulse_impulse_n_s"))
    assert [y for _, y in trend_points(compare.trend)] == [_impulse(shot).value for shot in shots]
    assert compare.trend.columns["impulse (N s)"].size == 3


@pytest.mark.usefixtures("shots")
def test_the_pages_equation_scales_as_an_impulse_does(monkeypatch):
    monkeypatch.setitem(test_equations.POWERS, IMPULSE.key, (1, -1, 1))
    scales = test_equations.test_every_number_scales_with_its_powers_of_mass_clock_and_length
    for case in scales.pytestmark[0].args[1]:
        scales(*case)
    test_equations.test_a_contradicted_rate_is_in_the_clock_alone_though_every_reading_carries_it()


def test_what_the_pages_number_lacks_is_said(shots):
    impact = replace(shots[0].impact, force_fwhm_s=NotSeen("no pulse"))
    assert IMPULSE.find(replace(shots[0], impact=impact)) == NotSeen("no pulse")
    assert IMPULSE.find(replace(shots[0], impact=None, problem="no light")) == NotSeen("no light")


def test_every_number_is_declared_once():
    keys = [number.key for number in numbers.NUMBERS]
    assert len(keys) == len(set(keys))
    names = [(number.group, number.name) for number in numbers.NUMBERS]
    assert len(names) == len(set(names)) and len({number.head for number in numbers.NUMBERS}) == len(names)
