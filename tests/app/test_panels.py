"""Panels, each by itself, on shots whose numbers are known."""

import csv
import math
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QTextDocumentFragment
from PySide6.QtWidgets import QLabel, QPushButton

from analysis.collision.effects import effect_named
from analysis.collision.laws.user_law import law_from_table
from analysis.diagnosis.findings.result import Candidate, Errors, Verdict
from analysis.drive.catalogue import LAWS
from analysis.drive.curves import drive_curves
from analysis.shot.impact import Disturbance, VibrationSpectrum
from analysis.shot.quantity import NotSeen, Quantity
from analysis.uncertainty.gum_budget import budget
from app.report.number_tables import fitted
from app.session.session import Session
from app.session.verdict_basis import VerdictBasis
from app.window.controls.theme import LIGHT, MARKS, Tone
from app.window.panels.compare import ComparePanel
from app.window.panels.diagnosis import DiagnosisPanel
from app.window.panels.effects import CandidateBars
from app.window.panels.help import licence_words
from app.window.panels.large import LargePanel
from app.window.panels.model import ModelPanel
from app.window.panels.numbers import NumbersPanel, wide_words
from app.window.panels.rig import Banner
from app.window.panels.session_model import FLAGS, NAME
from app.window.panels.session_table import NOTE, SessionTable
from app.window.panels.setup_sheet import SetupSheet
from app.window.panels.shot import VIEWS, ShotPanel
from app.window.panels.shot_motion import RESIDUALS
from app.window.panels.tables import BudgetPanel
from app.window.panels.work_line import NoticeLine
from app.window.plots import save
from app.words.wording import number, unbroken, value_text
from instrument.devices.device_search import FoundDevice
from tests.app import synthetic
from tests.app.on_screen import click_head, effect_button, large_text, next_buttons, trend_points


@pytest.fixture(scope="module")
def shot():
    return synthetic.shot()


@pytest.fixture
def shot_panel(qtbot, shot):
    panel = ShotPanel()
    qtbot.addWidget(panel)
    panel.resize(1000, 700)
    panel.show()
    panel.show_shot(shot)
    return panel


def test_nothing_a_panel_replaces_ever_appears_as_a_window_of_its_own(qtbot, appeared, shot_panel, shot):
    def replaced():
        shot_panel.show_shot(shot)
        shot_panel.show_shot(None)
        shot_panel.show_shot(shot)
        qtbot.wait(50)

    assert appeared(replaced) == []


def test_numbers_state_value_uncertainty_and_how_they_were_read(qtbot, shot):
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    panel.resize(panel.minimumWidth(), 700)
    panel.show()
    panel.show_shot(shot)
    assert panel.values["quasi-static"].text() == "0.9875560(72)"  # a small screen
    panel.resize(600, 700)
    assert panel.values["quasi-static"].text() == "0.9875560 ± 0.0000072"
    assert panel.values["pulse width"].text() == "19.100 ± 0.040"
    assert panel.values["m_p*"].text() == "0.19840 ± 0.00040"
    assert panel.values["kinetic, flights"].text() == "–"
    assert "shorter than the filter" in panel.values["kinetic, flights"].toolTip()
    assert "speeds of both flights" in panel.values["quasi-static"].toolTip()
    assert "agree" in panel.agreement.text() and "relative to their noise" in panel.agreement.toolTip()
    (of,) = [q for q in budget(shot).quantities if q.key == "velocity_in_m_per_s"]
    assert of.std > 3 * shot.impact.velocity_in_m_per_s.std
    assert panel.values["velocity in"].text() == value_text(Quantity(of.value, of.std))  # as in the budget
    assert "combined" in panel.values["velocity in"].toolTip()
    panel.noise_only.setChecked(True)
    assert panel.values["velocity in"].text() == value_text(shot.impact.velocity_in_m_per_s)
    assert "noise alone" in panel.values["velocity in"].toolTip()
    driven = replace(shot, settings=replace(shot.settings, model="driven"))
    panel.show_shot(driven)
    assert panel.values["mass"].isVisible() and not panel.values["quasi-static"].isVisible()


def test_a_flag_stands_at_the_number_it_is_about(qtbot, shot):
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    panel.show_shot(replace(shot, flags=("momentum_disagrees", "vibration")))
    marked = {name for name, label in panel._names.items() if MARKS[Tone.WARNING] in label.text()}
    assert marked == {"peak force", "velocity in", "velocity out"}
    assert (
        "impulse of the force" in panel.values["peak force"].toolTip()
        and "the path vibrates" in panel.values["quasi-static"].toolTip()
    )
    assert "impulse of the force" in panel.values["peak force"].accessibleDescription()
    panel.show_shot(shot)
    assert not any(MARKS[Tone.WARNING] in label.text() for label in panel._names.values())


def test_a_long_name_of_a_shot_makes_the_numbers_no_wider(qtbot, shot):
    widths = []
    for name in ("a", "a shot whose name says all that was done to the rig before it was taken, and by whom"):
        panel = NumbersPanel()
        qtbot.addWidget(panel)
        panel.show_shot(shot, name)
        widths.append(panel.widget().minimumSizeHint().width())
    assert widths[0] == widths[1]


@pytest.mark.parametrize(
    ("reading", "said"),
    [
        (Quantity(-0.2, 0.03), ""),
        (Quantity(-0.2, 0.05), "Poorly determined: ± is 25 % of the value"),
        (Quantity(1e-4, 3e-4), "Poorly determined: ± is 300 % of the value"),
        (Quantity(0.0, 0.1), ""),  # a share of nothing is none
        (Quantity(math.nan, 0.1), ""),
        (Quantity(0.2, math.nan), ""),
        (Quantity(0.2, math.inf), ""),
        (NotSeen("no bounce"), ""),
        (None, ""),
    ],
)
def test_a_number_whose_uncertainty_is_a_large_part_of_it_is_poorly_determined(qtbot, shot, reading, said):
    assert wide_words(reading) == said
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    if isinstance(reading, Quantity) and reading.value != 0.0:  # a block at rest strikes nothing
        panel.show_shot(replace(shot, impact=replace(shot.impact, velocity_in_m_per_s=reading)))
        assert ("Poorly determined" in panel.values["velocity in"].toolTip()) is bool(said)


def test_what_only_widens_an_uncertainty_is_no_alarm(qtbot, shot):
    panel, table, session = NumbersPanel(), SessionTable(), Session()
    qtbot.addWidget(panel)
    qtbot.addWidget(table)
    signs = LIGHT.signs
    panel.show_shot(replace(shot, flags=("wander", "clipped", "vibration")))
    lines = panel.flags.text().split("<br>")
    assert [signs[Tone.WARNING] in line for line in lines] == [True, False, False] and "cut off" in lines[0]
    session.add(replace(shot, flags=("wander", "clipped", "vibration")))
    session.add(replace(shot, flags=("wander",)))
    table.show_session(session)
    shown = [table.model.index(row, FLAGS).data() for row in range(2)]
    assert shown == ["clipped + 2", "path drift"]
    assert table.model.index(0, FLAGS).data(Qt.ItemDataRole.ToolTipRole).count("\n") == 2
    table.select([1])
    assert "clipped, wander, vibration" in table.as_text()  # whole, by the names that files have


def test_a_number_in_the_session_s_table_says_on_hovering_what_it_is(qtbot, shot):
    table, session = SessionTable(), Session()
    qtbot.addWidget(table)
    session.add(shot)
    table.show_session(session)
    model, told = table.model, 0
    for column, of in enumerate(model.columns):
        if of.number is None:
            continue
        hover, reading = model.index(0, column).data(Qt.ItemDataRole.ToolTipRole), of.number.find(shot)
        assert f"<b>{of.number.head}</b>" in hover
        if isinstance(reading, Quantity):
            told += 1
            assert model.index(0, column).data().partition("(")[0] in hover
            assert ("standard uncertainty" in hover) == (reading.std > 0.0)
        else:
            assert "Not measured" in hover or "No shot" in hover
    assert told >= 4


def test_the_numbers_name_what_the_effects_in_the_model_came_to(qtbot):
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    driven = synthetic.driven_shot()
    fit = replace(
        driven.fit,
        effects=(effect_named("coulomb_friction"),),
        parameters={**driven.fit.parameters, "coulomb_friction.force_n": Quantity(20.0, 0.1)},
    )
    panel.show_shot(replace(driven, fit=fit))
    assert panel.effects.text() == f"Coulomb friction on the block: {unbroken('force 20.00 ± 0.10 N')}"


def test_no_line_ends_within_a_number_and_its_unit(qtbot):
    """The panel showed "(3.01 ± 0.05)e-3 N s²/" and "m²" below it."""
    label = QLabel(f"coefficient {unbroken('(3.01 ± 0.05)e-3 N s²/m²')}")
    qtbot.addWidget(label)
    label.setWordWrap(True)
    height = label.fontMetrics().height()
    room = label.fontMetrics().horizontalAdvance("coefficient (3.01 ± 0.05)e-3 N s²/m")
    assert label.heightForWidth(room) >= 2 * height  # the number goes to the next line whole
    assert "\u00a0" in label.text() and " ±" not in label.text() and "/m" not in label.text()


def test_numbers_of_a_fit_that_did_not_converge_are_not_shown(qtbot, shot):
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    panel.show_shot(replace(shot, fit=replace(shot.fit, converged=False)))
    assert panel.values["k_p"].text() == "–"
    assert "did not converge" in panel.values["k_p"].toolTip()


def test_numbers_warn_where_the_two_ratios_differ(qtbot, shot):
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    apart = replace(shot.impact.cor_impulse, value=0.9)
    panel.show_shot(replace(shot, impact=replace(shot.impact, cor_impulse=apart)))
    assert "differ" in panel.agreement.text()
    panel.show_shot(replace(shot, impact=replace(shot.impact, cor_impulse=NotSeen("no unloading"))))
    assert panel.agreement.text() == ""


def test_the_shots_plots_are_linked_and_zoom_to_a_bounce_that_is_clicked(shot_panel):
    shot_panel.stack.zoom(-1.0, 8.0)
    shot_panel.stack.plots[0].view.clicked.emit(1.7708)
    for plot in shot_panel.stack.plots:
        (left, right), _ = plot.view.viewRange()
        assert left == pytest.approx(1.7708 - 0.6, abs=1e-3)
        assert right == pytest.approx(1.7708 + 0.6, abs=1e-3)
    shot_panel.reset()
    assert shot_panel.stack.span[0] == pytest.approx(-60.0, abs=0.1)


def test_of_plots_above_one_another_only_the_lowest_takes_room_for_the_time_and_force_has_most(shot_panel):
    *above, lowest = shot_panel.stack.plots
    assert max(plot.getAxis("bottom").height() for plot in above) < 7 < lowest.getAxis("bottom").height()
    velocity, force, residual = (plot.view.height() for plot in (*above, lowest))
    assert force > 1.2 * velocity > 1.2 * residual


def test_a_click_on_a_motion_without_a_collision_zooms_nowhere(shot_panel, shot):
    shot_panel.show_shot(replace(shot, impact=None, fit=None))
    before = shot_panel.stack.span
    shot_panel.stack.plots[0].view.clicked.emit(1.7708)
    assert shot_panel.stack.span == before


def test_cursors_measure_what_lies_between_them_on_every_curve(shot_panel, shot):
    shot_panel.stack.toggle_cursors()
    shot_panel.stack.cursors.place(-40.0, -10.0)
    measures = {m.name: m for m in shot_panel.stack.cursors.measures()}
    assert len(measures) == 5
    flight = measures["velocity, measured"]
    assert flight.mean == pytest.approx(-0.265, abs=1e-6)
    assert abs(flight.slope) < 1e-4
    assert shot_panel.stack.cursors.text().count("\n") == 6


def test_the_samples_in_view_are_saved_undecimated_with_units(shot_panel, tmp_path):
    shot_panel.stack.zoom(0.0, 5.0)
    save.save_csv(shot_panel.stack, tmp_path / "view.csv")
    with (tmp_path / "view.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head[:3] == ["time (ms)", "velocity simulated (m/s)", "velocity measured (m/s)"]
    assert len(rows) == 501
    force = np.array([float(row[head.index("force measured (N)")]) for row in rows])
    assert force.max() > 0.25


@pytest.mark.parametrize(
    ("fitted", "head"),
    [(True, "gap simulated (µm),force simulated (N),force measured (N)"), (False, "force measured (N)")],
)
def test_a_gap_is_shown_and_saved_of_no_shot_but_this_one(shot_panel, shot, tmp_path, fitted, head):
    shot_panel.set_view("gap")
    shot_panel.show_shot(shot if fitted else replace(shot, fit=None))
    save.save_csv(shot_panel.gap.stack, tmp_path / "view.csv")
    assert (tmp_path / "view.csv").read_text().splitlines()[0] == f"time (ms),{head}"


def test_plots_are_saved_as_picture_and_drawing(shot_panel, tmp_path):
    save.save_png(shot_panel.stack, tmp_path / "plot.png")
    save.save_svg(shot_panel.stack, tmp_path / "plot.svg")
    assert (tmp_path / "plot.png").read_bytes()[:4] == b"\x89PNG"
    assert "<svg" in (tmp_path / "plot.svg").read_text()[:500]
    with pytest.raises(OSError):
        save.save_png(shot_panel.stack, tmp_path / "nowhere" / "plot.png")


def test_at_most_two_points_a_pixel_are_drawn(shot_panel):
    for plot in shot_panel.stack.plots:
        for curve in plot.sampled:
            x, _ = curve.getData()
            assert len(x) <= 2 * max(64, plot.view.width())


def test_every_view_has_a_button_that_shows_it(shot_panel, qtbot):
    buttons = {button.text(): button for button in shot_panel.findChildren(QPushButton)}
    for view, (words, _) in reversed(VIEWS.items()):
        qtbot.mouseClick(buttons[words], Qt.MouseButton.LeftButton)
        assert shot_panel.view == view and buttons[words].isChecked()


def test_every_view_draws_what_a_shot_has_and_nothing_of_the_one_before(shot_panel, shot):
    lacking = (
        shot,
        None,
        replace(shot, fit=None),
        replace(shot, impact=None, fit=None),
        replace(shot, impact=replace(shot.impact, touch_time_s=NotSeen("none"), bounce_peaks_s=())),
        synthetic.shot("bad", problem="no beat on PD1"),
    )
    for candidate in lacking:
        for view in ("whole", "contact", "deflection", "gap", "raw"):
            shot_panel.show_shot(candidate)
            shot_panel.set_view(view)
            shot_panel.reset()
            assert shot_panel.view == view
            motion = candidate.motion if candidate is not None else None
            drawn = shot_panel.stack.plots[0].sampled[1].samples
            shown = shot_panel._pages.currentWidget() is shot_panel.stack
            assert not shown or motion is not None, (candidate, view)
            assert not shown or np.array_equal(drawn, motion.velocity_m_per_s), (candidate, view)
            assert shown or view != "whole" or motion is None


def test_the_table_shows_shots_and_passes_notes_on(qtbot, shot):
    session = Session()
    session.add(shot)
    session.add(synthetic.shot("bad", seed=4, problem="no beat on PD1"))
    table = SessionTable()
    qtbot.addWidget(table)
    table.show_session(session)
    model = table.model
    assert model.rowCount() == 2
    assert model.data(model.index(0, 5)) == "0.9875560(72)"  # the budget's, not from noise alone
    assert model.data(model.index(1, 5)) == "–"
    assert model.data(model.index(1, 9)) == "no beat on PD1"
    with qtbot.waitSignal(table.model.note_edited) as noted:
        model.setData(model.index(1, NOTE), "again", Qt.ItemDataRole.EditRole)
    assert noted.args == [2, "again"]
    table.select([1, 2])
    assert table.numbers == [1, 2]
    session.add(synthetic.bare_shot("later"))
    table.show_session(session)
    assert table.numbers == [1, 2]


def test_no_number_and_no_heading_of_the_table_is_cut(qtbot):
    table = SessionTable()
    qtbot.addWidget(table)
    cell, head = table.table.fontMetrics(), table.table.horizontalHeader().fontMetrics()
    for place, made in enumerate(table.model.columns):
        if made.number is not None and not made.hidden:
            width = table.table.columnWidth(place)
            assert width > head.horizontalAdvance(made.head)
            assert width > cell.horizontalAdvance("0.98729985(50)")


def test_the_table_sorts_filters_groups_and_hides_columns(qtbot):
    session, table = Session(), SessionTable()
    qtbot.addWidget(table)
    for seed, (name, speed) in enumerate((("paper-2", 0.3), ("steel-1", 0.1), ("paper-10", 0.2)), 1):
        session.add(synthetic.shot(name, speed, seed, count=9000))
    session.set_verdict(2, VerdictBasis((), (), (2,), Verdict.ADEQUATE))
    table.show_session(session)
    table.show()
    table.select([1])
    click = partial(click_head, table.table)
    click(3)  # v in
    assert table.shown == [1, 3, 2] and table.numbers == [1]
    click(3)
    assert table.shown == [2, 3, 1]
    click(3)
    assert table.shown == [1, 2, 3]
    click(9)
    assert table.shown[0] == 2  # what has no verdict stands last, both ways
    click(9)
    assert table.shown[0] == 2
    click(9)
    qtbot.keyClicks(table.filter, "paper")
    assert table.shown == [1, 3] and table.numbers == [1]
    table.select([2])  # what is to be seen is not kept back
    assert table.numbers == [2] and table.filter.text() == ""
    table.group.setCurrentIndex(table.group.findData("series"))
    assert [row if isinstance(row, str) else row.number for row in table.model.rows] == [
        "paper   (2)", 1, 3, "steel   (1)", 2,
    ]  # fmt: skip
    assert table.numbers == [2] and table.table.columnSpan(0, 0) > 5
    fonts = [table.model.data(table.model.index(row, 0), Qt.ItemDataRole.FontRole) for row in range(3)]
    assert [font is not None and font.bold() for font in fonts] == [True, False, False]
    session.add(synthetic.shot("steel-2", 0.25, 2, count=9000))
    table.show_session(session)
    assert table.numbers == [2] and table.shown == [1, 3, 2, 4]
    table.show_column(3, False)
    assert "v in" not in table.as_text().partition("\n")[0] and table.as_text().count("\n") == 2
    table.select([])
    assert table.as_text().count("\n") == 5


def test_compare_overlays_and_shows_the_trend_against_speed(qtbot):
    session = Session()
    for index, speed in enumerate((0.2, 0.25, 0.3), 1):
        session.add(synthetic.shot(f"shot-{index}", speed, index))
    panel = ComparePanel()
    qtbot.addWidget(panel)
    panel.show()
    panel.show_entries(list(session.entries))
    assert sorted(round(x, 3) for x, _ in trend_points(panel.trend)) == [0.2, 0.25, 0.3]
    told = [item for item in panel._labels if item.isVisible()]
    assert [item.toPlainText() for item in told] == ["1", "2", "3"]  # colour alone does not tell which is which
    assert len({item.pos().x() for item in told}) == 3
    panel.which.setCurrentIndex(panel.which.findData("plate_stiffness_n_per_m"))
    assert trend_points(panel.trend)[1][1] == pytest.approx(221.44)
    assert "3 shots" in panel.repeatability.text()
    assert panel._say.text() == ""
    panel.show_entries([])
    assert trend_points(panel.trend) == [] and "Select shots in the table" in panel._say.text()


def test_the_last_eight_are_overlaid_from_their_touch_on_and_bars_reach_one_std_up_and_down(qtbot):
    session = Session()
    for index in range(1, 11):
        shot = synthetic.shot(f"shot-{index}", 0.2 + 0.01 * index, index)
        later = replace(shot.motion, time_s=shot.motion.time_s + 0.3 * index)
        touch = shot.impact.touch_time_s
        impact = replace(shot.impact, touch_time_s=replace(touch, value=touch.value + 0.3 * index))
        session.add(replace(shot, motion=later, impact=impact))
    panel = ComparePanel()
    qtbot.addWidget(panel)
    panel.show()
    panel.show_entries(list(session.entries))
    assert [curve.label.split()[0] for curve in panel._velocity_curves] == [str(n) for n in range(3, 11)]
    assert len(trend_points(panel.trend)) == 10 and "the last 8 of 10" in panel._say.text()
    for curve in (*panel._velocity_curves, *panel._force_curves):
        assert curve.grid[0] == pytest.approx(panel._velocity_curves[0].grid[0], abs=0.02)  # ms
        assert curve.grid[0] < 0.0 < curve.grid[0] + curve.grid[1] * len(curve.samples)
    panel.which.setCurrentIndex(panel.which.findData("plate_stiffness_n_per_m"))
    stds = [entry.shot.fit.parameters["plate_stiffness_n_per_m"].std for entry in session.entries]
    assert list(panel.trend._bars.opts["height"]) == pytest.approx([2.0 * std for std in stds])
    values = np.array([y for _, y in trend_points(panel.trend)])
    assert np.ptp(values) > 0.0
    said = panel.repeatability.text().split("spread ")[1].split()[0].replace(",", ".")
    assert float(said) == pytest.approx(float(np.std(values, ddof=1)), rel=0.01)


def test_the_budget_states_three_digits_of_a_source_and_two_of_what_it_contributes(qtbot, shot):
    panel = BudgetPanel()
    qtbot.addWidget(panel)
    panel.show_shot(shot)
    (q,) = [q for q in budget(shot).quantities if q.key == "force_peak_n"]
    tree = panel.table
    line = next(
        tree.topLevelItem(i) for i in range(tree.topLevelItemCount()) if tree.topLevelItem(i).text(0) == q.words
    )
    assert [float(line.text(column)) for column in (3, 4, 5, 6)] == [
        float(f"{part:.2g}") for part in (q.std_a, q.std_b, q.std, q.expanded)
    ]
    assert line.childCount() == len(q.rows) > 2
    for place, row in enumerate(q.rows):
        cells = [line.child(place).text(column) for column in range(7)]
        assert cells[0] == row.source and cells[2] == row.unit.replace("1", "") and cells[3] == row.kind
        if row.std is not None:
            assert cells[1] == number(row.std, 3) and cells[4] == number(row.sensitivity, 3)
            assert cells[5] == number(row.contribution, 2)
            share = 100 * (row.contribution / q.std) ** 2
            assert float(cells[6].removesuffix(" %")) == pytest.approx(share if share >= 0.01 else 0.0, rel=0.05)


def test_the_diagnosis_says_the_verdict_first_and_offers_to_add_the_effect(qtbot, shot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    panel.show()
    panel.show_diagnosis(synthetic.diagnosis(shot), [shot])
    assert panel.sentence.text().startswith("The model lacks a drag whose form is undetermined: quadratic drag or")
    with qtbot.waitSignal(panel.effects.add_wanted) as added:
        effect_button(panel.effects, "quadratic_drag").click()
    assert added.args == [[effect_named("quadratic_drag")]]
    panel.show_diagnosis(synthetic.diagnosis(shot), [shot], (effect_named("quadratic_drag"),))
    with qtbot.waitSignal(panel.effects.remove_wanted) as removed:
        effect_button(panel.effects, "quadratic_drag").click()
    assert removed.args == [effect_named("quadratic_drag")]
    panel.show_progress("scoring", 0.4)
    assert not panel.diagnose.isEnabled() and panel.cancel.isVisible()
    panel.show_progress(None, 0.0)
    assert panel.diagnose.isEnabled()


def test_the_errors_before_and_after_are_told_in_one_unit(qtbot, shot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    before, after = Errors(141e-9, 33e-6, 2.4e-3, 22280.0), Errors(152e-12, 1.3e-6, 1e-3, 1.004)
    panel.show_diagnosis(replace(synthetic.diagnosis(shot), error_before=before, error_after=after), [shot])
    words = " ".join(re.sub("<[^>]*>", " ", panel.residuals._errors.text()).split())
    assert "displacement (nm)" in words and "force (mN)" in words
    assert words.split("before")[1].split()[0] == "141" and words.split("after")[1].split()[0] == "0.152"


def test_a_residual_is_counted_in_the_unit_that_suits_its_size(qtbot, shot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    found = synthetic.diagnosis(shot)
    for size, unit in ((3e-11, "pm"), (3e-9, "nm"), (3e-6, "µm")):
        left = size * np.sin(np.arange(shot.motion.time_s.size))
        fit = replace(found.fit_after, shots=(replace(found.fit_after.shots[0], residual_m=left),))
        panel.show_diagnosis(replace(found, fit_before=fit, fit_after=fit), [shot])
        assert [plot.unit for plot in panel.residuals.stack.plots] == [unit, unit]
        shown = {"pm": 30.0, "nm": 3.0, "µm": 3.0}[unit]
        assert np.nanmax(panel.residuals.curves[0].samples) == pytest.approx(shown, rel=1e-3)
    driven = synthetic.driven_shot()
    curves = drive_curves(driven.motion, driven.fit)
    for size, unit, shown in ((3e-5, "µN", 30.0), (3e-2, "mN", 30.0), (3.0, "N", 3.0)):
        left = size * np.sin(np.arange(curves.time_s.size))
        panel.residuals.show_forces(driven, curves, replace(curves, measured_n=curves.modelled_n + left))
        assert panel.residuals.forces.plots[1].unit == unit
        assert np.nanmax(panel.residuals.force_curves[1].samples) == pytest.approx(shown, rel=1e-3)


def test_a_shots_residual_takes_the_place_of_a_drives(qtbot, shot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    driven = synthetic.driven_shot()
    curves = drive_curves(driven.motion, driven.fit)
    panel.residuals.show_forces(driven, curves, curves)
    assert all(len(curve.samples) > 0 for curve in panel.residuals.force_curves)
    panel.show_diagnosis(synthetic.diagnosis(shot), [shot])
    assert [len(curve.samples) for curve in panel.residuals.force_curves] == [0, 0]


def test_a_reset_shows_the_whole_residual_again(qtbot, shot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    panel.show_diagnosis(synthetic.diagnosis(shot), [shot])
    stack, ends = panel.residuals.stack, 1e3 * (shot.motion.time_s[[0, -1]] - synthetic.TOUCH_S)
    stack.zoom(1.0, 2.0)
    stack.reset()
    assert stack.span == pytest.approx(ends, abs=0.1)


def test_a_chi2_near_one_beside_unexplained_says_why(qtbot, shot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    found = replace(synthetic.diagnosis(shot), verdict=Verdict.UNEXPLAINED, effects=())
    for chi2, said in ((0.86, True), (7.0, False)):
        panel.show_diagnosis(replace(found, error_after=replace(found.error_after, reduced_chi2=chi2)), [shot])
        words = " ".join(label.text() for label in panel.findChildren(QLabel))
        assert ("relative to noise estimated from this residual" in words) is said


def test_what_stays_open_offers_the_next_step(qtbot, shot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    panel.resize(900, 700)
    panel.show()
    found = synthetic.diagnosis(shot)
    panel.show_diagnosis(found, [shot])
    assert not panel.next_steps.isVisible()
    candidates = tuple(replace(c, parameters={"size_n": Quantity(1.0, 0.1)}) for c in found.candidates)
    left = replace(found, verdict=Verdict.UNEXPLAINED, effects=(), candidates=candidates)
    panel.show_diagnosis(left, [shot])
    assert panel.next_steps.isVisible() and "Next shot: more shots at other speeds" in panel.next_steps.shot.text()
    assert [button.text() for button in next_buttons(panel.next_steps)] == [
        "Try quadratic drag on the block", "Try viscous drag on the block", "Try Coulomb friction on the block",
        "Propose a law …",
    ]  # fmt: skip
    with qtbot.waitSignal(panel.next_steps.try_wanted) as tried:
        next_buttons(panel.next_steps)[1].click()
    assert tried.args == [effect_named("viscous_drag")]
    panel.tried = (effect_named("viscous_drag"),)
    panel.show_diagnosis(left, [shot], (effect_named("viscous_drag"),))
    words = " ".join(label.text() for label in panel.effects.findChildren(QLabel))
    assert "tried by the operator; not found by a diagnosis" in words
    assert all("viscous" not in button.text() for button in next_buttons(panel.next_steps))
    panel.show_diagnosis(replace(left, verdict=Verdict.PARTLY_EXPLAINED), [shot])
    assert (
        next_buttons(panel.next_steps)[-1].text() == "Propose a law …"
        and "other speeds" in panel.next_steps.shot.text()
    )
    with qtbot.waitSignal(panel.next_steps.law_wanted):
        next_buttons(panel.next_steps)[-1].click()


def test_large_numbers_fill_the_page_and_are_never_cut(qtbot, shot):
    panel = LargePanel()
    qtbot.addWidget(panel)
    panel.show()
    panel.show_shot(replace(shot, flags=("momentum_disagrees",)), "Shot 7   shot-0007")
    for size in ((420, 300), (900, 300), (1500, 900)):
        panel.resize(*size)
        qtbot.wait(20)
        for label in panel.findChildren(QLabel):
            assert label.fontMetrics().horizontalAdvance(label.text()) <= label.width(), (size, label.text())
    assert panel.findChildren(QLabel)[1].font().pixelSize() > 60
    assert (
        large_text(panel, "COR") == "0.987556"
        and large_text(panel, "contact") == "28.71"
        and large_text(panel, "v in") == "-0.26500"
    )
    assert MARKS[Tone.WARNING] in panel._title.text()
    tiny = replace(shot.impact, force_peak_n=Quantity(1.2e-6, 1e-8))
    panel.show_shot(replace(shot, impact=tiny), "")
    assert large_text(panel, "F max") == "1.2e-6"
    panel.show_shot(None, "")
    assert large_text(panel, "COR") == "–"
    panel.show_shot(replace(shot, flags=("plate_shaken",)), "")  # of the fitted plate, which is not shown here
    assert MARKS[Tone.WARNING] not in panel._title.text()
    panel.show_shot(synthetic.driven_shot(), "")
    seen = {label.text() for label in panel.findChildren(QLabel) if label.isVisible()}
    assert {"mass", "viscous drag", "offset"} <= seen and "COR" not in seen and large_text(panel, "mass") != "–"


def test_several_effects_are_added_by_one_press(qtbot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    shot = synthetic.shot()
    found = synthetic.diagnosis(shot)
    two = replace(found, effects=(*found.effects, replace(found.effects[0], effect=effect_named("tilt"))))
    panel.show_diagnosis(two, [shot], ())
    asked = []
    panel.effects.add_wanted.connect(asked.append)
    (button,) = [b for b in panel.findChildren(QPushButton) if b.text() == "Add all to the model"]
    button.click()
    assert asked == [[effect_named("quadratic_drag"), effect_named("tilt")]]
    panel.show_diagnosis(two, [shot], (effect_named("tilt"),))
    qtbot.waitUntil(lambda: not [b for b in panel.findChildren(QPushButton) if b.text() == "Add all to the model"])


def test_a_long_message_widens_nothing_and_is_whole_on_hover(qtbot):
    line = NoticeLine()
    qtbot.addWidget(line)
    line.resize(400, 30)
    line.show()
    before = line.minimumSizeHint().width()
    words = f"saved as /{'a-long-folder/' * 40}report.html"
    line.say(words, Tone.GOOD)
    assert line.minimumSizeHint().width() <= before + line.fontMetrics().horizontalAdvance("M Dismiss M") + 60
    assert line.words == words and words in line._words.toolTip()
    assert "…" in line._words.text()


def test_a_diagnosis_without_a_residual_to_draw_leaves_no_other_sets_picture(qtbot, shot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    found = synthetic.diagnosis(shot)
    panel.show_diagnosis(found, [shot])
    curves = panel.residuals.curves
    assert len(curves[0].samples) > 0 and shot.name in panel.residuals._heading.text() and shot.name in panel._of.text()
    slider = replace(found.fit_after, model="driven", shots=())
    drive = replace(found, fit_before=slider, fit_after=slider, drive=synthetic.DRIVE, verdict=Verdict.UNEXPLAINED)
    panel.show_diagnosis(drive, [replace(shot, name="emps")], (LAWS["quadratic_drag"],))
    assert [len(curve.samples) for curve in curves] == [0, 0]
    assert shot.name not in panel.residuals._heading.text() and "emps" in panel._of.text()
    assert "UNEXPLAINED" in panel._verdict.text() and MARKS[Tone.GOOD] not in panel._verdict.text()
    assert "χ²/ν is relative to noise" in panel._blind.text()


def test_a_diagnosis_whose_shots_are_removed_names_none(qtbot, shot):
    panel = DiagnosisPanel()
    qtbot.addWidget(panel)
    panel.show_diagnosis(synthetic.diagnosis(shot), [shot])
    assert panel._of.text() == f"of {shot.name}"
    panel.show_diagnosis(synthetic.diagnosis(shot), [], holds=False)
    assert panel._of.text() == "" and "<s>" in panel._verdict.text()


def test_candidates_stand_in_the_order_of_their_bars_and_a_tick_never_beside_a_worse_bic(qtbot, shot):
    bars = CandidateBars()
    qtbot.addWidget(bars)
    tilt, adhesion = effect_named("tilt"), effect_named("adhesion")
    bars.show_candidates((Candidate(tilt, 9.0, 4.0), Candidate(adhesion, 60.0, -80.0)), {tilt, adhesion})
    words = [label.text() for label in bars.findChildren(QLabel)]
    names = [text for text in words if "adhesion" in text or "tilt" in text]
    assert "adhesion" in names[0] and MARKS[Tone.GOOD] in names[0] and MARKS[Tone.GOOD] not in names[1]


def test_the_band_of_a_diagnosed_residual_says_what_it_is(qtbot, shot):
    line = VibrationSpectrum(np.array([100.0]), np.array([(5e-9) ** 2]), np.array([False]))
    shaken = replace(shot, impact=replace(shot.impact, disturbance=Disturbance((), 5e-9, 3e-6, vibration=line)))
    panels = ShotPanel(), DiagnosisPanel()
    for panel in panels:
        qtbot.addWidget(panel)
    of_shot, of_diagnosis = panels[0].motion, panels[1].residuals
    panels[0].show_shot(shaken)
    of_shot.kind.setCurrentIndex([kind for kind, _, _ in RESIDUALS].index("displacement"))
    white_m = float(np.nanmedian(shaken.motion.displacement_std_m))
    for noise_m, verdict, building in (
        (white_m, Verdict.EFFECT_FOUND, True),  # the fit weighed the building's spectrum beside white noise
        (40 * white_m, Verdict.UNEXPLAINED, True),  # what is not explained may pass for a path that wanders
        (40 * white_m, Verdict.EFFECT_FOUND, False),
    ):
        found = synthetic.diagnosis(shaken)
        found = replace(found, verdict=verdict, fit_after=replace(found.fit_after, noise_std_m=noise_m))
        panels[1].show_diagnosis(found, [shaken])
        same = of_diagnosis.stack.bands[1].typical == pytest.approx(of_shot._band.typical, rel=1e-9)
        assert same == building
        assert ("noise and floor vibration" if building else "noise, from all shots") in of_diagnosis._heading.text()


@pytest.fixture
def drive_shown(qtbot):
    """Return a panel that shows a driven record, the shot, and its curves."""
    driven = synthetic.driven_shot()
    panel = ShotPanel()
    qtbot.addWidget(panel)
    panel.show_shot(driven)
    return panel, driven, drive_curves(driven.motion, driven.fit)


def test_the_band_of_a_drive_lies_over_all_of_its_record_at_twice_its_repeatability(drive_shown):
    panel, driven, curves = drive_shown
    panel.show_drive(driven, curves)
    for edge, sign in zip(panel.drive._band.edges, (1.0, -1.0), strict=True):
        x, y = edge.getData()
        assert (x[0], x[-1]) == (curves.time_s[0], curves.time_s[-1])
        assert np.all(y == sign * 2.0 * curves.repeatability.force_n)


def test_every_point_of_a_drive_is_in_view_with_a_little_room_about_it(drive_shown):
    panel, driven, curves = drive_shown
    for offset_n in (0.0, -2 * float(np.nanmax(curves.measured_n))):  # forces of both signs, and of one
        moved = replace(curves, measured_n=curves.measured_n + offset_n, modelled_n=curves.modelled_n + offset_n)
        panel.show_drive(driven, moved)
        for plot in (*panel.drive.speed.plots, *panel.drive.place.plots):
            place, *drawn = plot.columns.values()
            for values, (low, high) in zip((place, np.concatenate(drawn)), plot.plot.view.viewRange(), strict=True):
                room = 0.02 * (high - low)
                assert low + room < np.nanmin(values) < np.nanmax(values) < high - room


@pytest.mark.parametrize("height", [200, 700])
def test_an_empty_drive_says_why_on_a_page_of_any_height(qtbot, height):
    panel = ShotPanel()
    qtbot.addWidget(panel)
    panel.resize(700, height)
    panel.show()
    driven = synthetic.driven_shot()
    panel.show_shot(driven)
    assert panel.drive.say.isVisible() and "modelling" in panel.drive.say.text()
    panel.show_drive(driven, drive_curves(driven.motion, driven.fit))
    assert panel.drive.say.isVisible() == (height > 400)
    panel.show_shot(replace(driven, fit=None, fit_problem="the record is too short"))
    assert panel.drive.say.isVisible() and "the record is too short" in panel.drive.say.text()


def test_the_shot_opens_on_the_residual_that_shows_most_and_then_on_what_was_chosen(qtbot, shot):
    panel = ShotPanel()
    qtbot.addWidget(panel)
    fit, motion = shot.fit, shot.motion
    wave = 1e-7 * np.sin(2 * np.pi * 20 * motion.time_s)
    strayed = replace(fit, shots=(replace(fit.shots[0], residual_m=fit.shots[0].residual_m + wave),))
    panel.show_shot(shot)
    assert panel.motion.kind.currentText() == "Residual of force"
    panel.show_shot(replace(shot, fit=strayed))
    assert panel.motion.kind.currentText() == "Residual of displacement"
    panel.motion.kind.setCurrentIndex(1)
    panel.motion.kind.activated.emit(1)
    panel.show_shot(shot)
    assert panel.motion.kind.currentText() == "Residual of velocity"


def test_the_band_is_what_the_verdict_was_judged_by(qtbot, shot):
    panel = ShotPanel()
    qtbot.addWidget(panel)
    found = synthetic.diagnosis(shot)
    wandering = replace(found, fit_after=replace(found.fit_after, noise_std_m=7e-9))
    panel.show_shot(shot)
    assert "noise, path drift and floor vibration, ±2 σ" in [words for words, _ in panel._legend.entries]
    panel.show_shot(shot, band_from=wandering)
    assert "noise, from all shots, ±2 σ" in [words for words, _ in panel._legend.entries]
    panel.show_shot(replace(shot, fit=None))  # no other shot's words
    assert "noise, path drift and floor vibration, ±2 σ" in [words for words, _ in panel._legend.entries]


def test_two_numbers_of_one_kind_have_two_names(qtbot, shot):
    """The panel said 599.8 and the diagnosis 5688, both of "χ²/ν"."""
    panel, page = ModelPanel(), DiagnosisPanel()
    for widget in (panel, page):
        qtbot.addWidget(widget)
    panel.show_shot(shot)
    page.show_diagnosis(synthetic.diagnosis(shot), [shot])
    assert "χ²/ν of this shot's fit" in panel._fit.text()
    assert "joint χ²/ν" in page.residuals._errors.text()


def test_a_law_with_a_less_than_in_its_words_is_named_whole(qtbot, shot):
    """Qt takes a "<" for markup of its own: "pull where x<0 & v>0" lost its end."""
    words = "pull where x<0 & v>0"
    parameters = {"a": {"unit": "N", "start": 1e-3}}
    law = law_from_table(
        {"name": "pull", "words": words, "where": "block", "formula": "a*sign(v)", "parameters": parameters}
    )
    found = synthetic.diagnosis(shot)
    curve = (np.zeros(500, np.float32),)
    found = replace(
        found,
        effects=(replace(found.effects[0], effect=law, indistinguishable_from=(law,)),),
        candidates=(Candidate(law, 60.0, -80.0, explains_m=curve),),
    )
    page, model = DiagnosisPanel(), ModelPanel()
    for widget in (page, model):
        qtbot.addWidget(widget)
    page.show_diagnosis(found, [shot])
    page.why.point_at(law)
    model.show_shot(replace(shot, fit=replace(shot.fit, effects=(law,))))
    (row,) = [label.text() for label in page.effects.findChildren(QLabel) if "ull where" in label.text()]
    (hover,) = {label.toolTip() for label in page.bars.findChildren(QLabel) if "pull where" in label.toolTip()}
    assert _seen(row).lower().count(words) == 2
    for text in (page.why.said.text(), model._model.text(), hover):
        assert words in _seen(text), text


def test_names_with_markup_in_them_are_shown_as_they_are(qtbot, shot):
    panel, sheet, session = ComparePanel(), SetupSheet(), Session()
    for widget in (panel, sheet):
        qtbot.addWidget(widget)
    panel.resize(700, 150)  # low: the legend comes on hovering
    panel.show()
    for name in ("R&D-1", "v<u>0"):
        session.add(replace(shot, name=name))
        panel.show_entries(list(session.entries))
        assert name in _seen(panel.stack.toolTip())
    sheet.show_devices([FoundDevice("visa?a", "scope <1>", "at <2>", "no answer from <3>", "look")], (), "bench")
    shown = " ".join(_seen(label.text()) for label in sheet.findChildren(QLabel))
    assert all(name in shown for name in ("scope <1>", "at <2>", "from <3>"))


def test_a_name_that_looks_like_markup_is_read_whole_in_labels_and_hovers(qtbot, shot):
    name = "of <b>v</b> & more"
    page, large, numbers, table, session = DiagnosisPanel(), LargePanel(), NumbersPanel(), SessionTable(), Session()
    for widget in (page, large, numbers, table):
        qtbot.addWidget(widget)
    named = replace(shot, name=name, path=name)
    session.add(named)
    session.set_note(1, name)
    table.show_session(session)
    page.show_diagnosis(synthetic.diagnosis(shot), [named])
    large.show_shot(named, name)
    numbers.resize(3000, 600)
    numbers.show_shot(named, name)
    labels = [label for widget in (page, large, numbers) for label in widget.findChildren(QLabel)]
    assert [label.textFormat() for label in labels if name in label.text()] == 4 * [Qt.TextFormat.PlainText]
    hovers = [table.model.index(0, column).data(Qt.ItemDataRole.ToolTipRole) for column in (NAME, NOTE)]
    for hover in (*hovers, numbers.title.toolTip()):
        assert name in QTextDocumentFragment.fromHtml(hover).toPlainText()


def _seen(text):
    """Return what Qt shows of a text, which begins with a tag where it has any."""
    return QTextDocumentFragment.fromHtml(text).toPlainText() if text.startswith("<") else text


def test_the_banner_flashes_once_in_exchanged_colours(qtbot):
    banner = Banner()
    qtbot.addWidget(banner)
    banner.resize(700, banner.height())
    banner.show_state("CAPTURED", "The light switch fired; recording the shot.", Tone.GOOD)
    banner._flashing.setInterval(0)

    def background():
        return banner.grab().toImage().pixelColor(350, 3).name()

    colours = [QColor(colour).name() for colour in LIGHT.tones[Tone.GOOD]]
    assert background() == colours[0] != colours[1]
    banner.flash()
    assert background() == colours[1]
    qtbot.waitUntil(lambda: background() == colours[0])


def test_about_names_every_part_and_its_licence_in_a_line_each():
    """Some packages state their whole licence where its name belongs."""
    _, parts = licence_words().split("It uses:\n")
    lines = dict(line.split(" ", 1) for line in parts.splitlines())
    assert {"numpy", "scipy", "PySide6-Essentials", "pyqtgraph"} <= set(lines)
    for words in lines.values():
        version, licence = words.split(": ")
        assert version[0].isdigit() and 2 < len(licence) < 200


def test_the_papers_kinetic_cor_is_marked_and_the_others_are_folded_under_it(qtbot, shot):
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    panel.resize(500, 800)
    panel.show()
    panel.show_shot(shot)
    others = ("kinetic, onsets", "kinetic, flights", "fitted contact")
    words = [label.text() for label in panel.findChildren(QLabel) if label.isVisible()]
    assert any("the paper's" in text and value_text(Quantity(0.5667, 0.0))[:3] in text for text in words)
    assert all(not panel.values[name].isVisible() for name in others)
    panel.others.click()
    assert all(panel.values[name].isVisible() for name in others)
    shown = [label.text() for label in panel.findChildren(QLabel) if label.isVisible()]
    assert sum(text.endswith(".") for text in shown) == 3
    panel.show_shot(synthetic.driven_shot())
    assert not panel.others.isVisible() and not panel.values["kinetic, onsets"].isVisible()


def test_a_number_of_which_little_is_known_is_marked(qtbot, shot):
    """Flights 0.68 with 0.34 stood there like any other number."""
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    kinetic = replace(shot.impact.cor_kinetic, flights=Quantity(0.68, 0.34, "two flights"))
    panel.show_shot(replace(shot, impact=replace(shot.impact, cor_kinetic=kinetic)))
    assert MARKS[Tone.WARNING] in panel._names["kinetic, flights"].text()
    assert "50 % of the value" in panel.values["kinetic, flights"].toolTip()
    assert MARKS[Tone.WARNING] not in panel._names["kinetic, peaks"].text()


def test_the_model_panel_unfolds_the_correlations_that_the_report_states(qtbot, shot):
    spread = np.array([[4.0, -1.2, 0.0, 0.0], [-1.2, 1.0, 0.0, 0.0], [0.0, 0.0, 9.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    fit = replace(shot.fit, covariance=spread, converged=True)
    panel = ModelPanel()
    qtbot.addWidget(panel)
    panel.show()
    panel.show_shot(replace(shot, fit=fit))
    assert not panel.correlations.isVisible()
    panel.correlated.click()
    assert panel.correlations.isVisible()
    cells = re.findall(r'<td align="right">(.*?)</td>', panel.correlations.text())
    assert cells == ["-0.60", "0.00", "0.00", "–", "–", "–"]
    page = str(fitted(fit))
    assert page.count("-0.60") == 2 and page.count("1.00") >= 3
    panel.show_shot(replace(shot, fit=replace(fit, converged=False)))
    assert not panel.correlations.isVisible() and not panel.correlated.isEnabled()


def test_the_first_contact_of_the_last_shot_is_what_is_zoomed_to(qtbot, shot, monkeypatch):
    session = Session()
    for name in ("a", "b", "c"):
        session.add(replace(shot, name=name))
    monkeypatch.setattr(
        "app.window.panels.compare.contact_span_ms", lambda of: (-1.0, {"a": 2.0, "b": 3.0}.get(of.name, 4.0))
    )
    panel = ComparePanel()
    qtbot.addWidget(panel)
    panel.show()
    panel.show_entries(list(session.entries))
    asked = []
    monkeypatch.setattr(panel.stack, "zoom", lambda *span: asked.append(span))
    panel.show_contact()
    panel.stack.reset()
    assert asked[0] == (-1.0, 4.0)
    assert asked[1][0] < -5.0 and asked[1][1] > 40.0
