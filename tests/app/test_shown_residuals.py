"""The residuals, the gap, the deflection and the law that the window draws: units, places, bands and words."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.diagnosis.findings.result import Errors
from analysis.shot.quantity import NotSeen, Quantity
from analysis.uncertainty import diagnosis_band
from app.report.shot_figures import contact_span_ms, deflection_of
from app.window.controls.theme import MARKS, Tone
from app.window.panels.law import LawCurve
from app.window.panels.numbers import NumbersPanel, wide_words
from app.window.panels.residuals import Residuals, _errors_table
from app.window.panels.shot_motion import DeflectionView, GapView
from tests.app import synthetic

ONE = synthetic.shot()
MOTION, PART = ONE.motion, ONE.fit.shots[0]


def _told(factor: float = 800.0):
    before = replace(ONE.fit, shots=(replace(PART, residual_m=factor * PART.residual_m),))
    return replace(synthetic.diagnosis(ONE), fit_before=before)


@pytest.fixture
def residuals(qtbot):
    one = Residuals()
    qtbot.addWidget(one)
    one.resize(900, 600)
    one.show()
    return one


def test_a_residual_is_drawn_before_and_after_in_its_own_unit_with_twice_the_band(residuals) -> None:
    told = _told()
    residuals.show_diagnosis(told, [ONE])
    scales = (1e6, 1e9)
    band, what = diagnosis_band(told, ONE)
    for curve, shown, scale, factor in zip(residuals.curves, residuals.stack.bands, scales, (800.0, 1.0), strict=True):
        assert curve.samples == pytest.approx(scale * factor * PART.residual_m, rel=1e-9, abs=0.0)
        assert curve.grid == pytest.approx((-60.0, 0.01))
        assert shown.typical == pytest.approx(2.0 * scale * np.nanmedian(band), rel=1e-9)
    assert [plot.unit for plot in residuals.stack.plots] == ["µm", "nm"]
    assert residuals._heading.text() == f"RESIDUAL OF DISPLACEMENT, shot-1 (band: {what}, ±2 σ)"
    assert residuals.stack.whole == pytest.approx((-60.0, 80.0))
    assert residuals.stack.isVisible() and not residuals.forces.isVisible()
    assert residuals.stack_in_view is residuals.stack
    residuals.clear()
    assert all(curve.samples.size == 0 for curve in residuals.curves) and residuals._errors.text() == ""


def test_a_shot_without_a_motion_moves_no_other_shots_residual(residuals) -> None:
    told, dark = _told(), replace(ONE, motion=None, name="dark")
    residuals.show_diagnosis(told, [dark, ONE])
    assert residuals.curves[1].samples == pytest.approx(1e9 * PART.residual_m, rel=1e-9, abs=0.0)
    assert residuals._heading.text().startswith("RESIDUAL OF DISPLACEMENT, shot-1 ")
    nothing = replace(ONE.fit, shots=())
    for shots, said in (([dark], told), ([], told), ([ONE], replace(told, fit_before=nothing, fit_after=nothing))):
        residuals.show_diagnosis(told, [ONE])
        residuals.show_diagnosis(said, shots)
        assert all(curve.samples.size == 0 for curve in residuals.curves) and residuals._heading.text() == ""


def test_errors_share_a_unit_and_what_is_not_known_is_a_dash() -> None:
    told = replace(_told(), error_held_out_before=None, error_held_out_after=None)
    told = replace(told, error_before=Errors(1.41e-7, 4e-5, float("nan"), 3800.0))
    told = replace(told, error_after=Errors(1.52e-10, 8e-6, float("nan"), 1.012345))
    said = str(_errors_table(told))
    assert "(nm)" in said and "141" in said and "0.152" in said and "(µm/s)" in said and "40" in said
    assert "force" not in said and "1.012" in said and "3800" in said
    assert said.count(">–<") == 2 * 3  # the validation shots' two and joint chi2


def test_the_gap_is_drawn_in_micrometres_over_the_force(qtbot) -> None:
    view = GapView(None)
    qtbot.addWidget(view.stack)
    view.show_shot(ONE)
    assert view._gap.samples == pytest.approx(1e6 * PART.overlay.gap_m) and view._gap.grid == pytest.approx(
        (-60.0, 0.01)
    )
    assert np.array_equal(view._measured.samples, MOTION.force_n)
    assert np.array_equal(view._simulated.samples, PART.overlay.force_n)
    assert view.stack.whole == pytest.approx(contact_span_ms(ONE))
    assert [(line.value(), line.toolTip()) for line in view._gap_plot._levels] == [(0.0, "below: overlap")]
    view.show_shot(replace(ONE, fit=None))
    assert view._gap.samples.size == view._simulated.samples.size == 0 and view._measured.samples.size == 14000


def test_the_deflection_has_a_branch_in_and_a_branch_out_with_room_about_them(qtbot) -> None:
    view = DeflectionView()
    qtbot.addWidget(view)
    view.show_shot(ONE)
    found = deflection_of(ONE, PART.overlay)
    for curves, (x, y) in ((view._measured, found.measured), (view._simulated, found.simulated)):
        turn = int(np.nanargmax(x))
        assert np.array_equal(curves[0].samples, y[: turn + 1]) and np.array_equal(curves[1].samples, y[turn:])
        assert np.array_equal(curves[0].getData()[0], x[: turn + 1]) and np.array_equal(
            curves[1].getData()[0], x[turn:]
        )
    assert np.array_equal(view._slope.getData()[1], found.slope[1])
    names = ["deflection_mm", "force_n", "deflection_simulated_mm", "force_simulated_n"]
    assert list(view.columns) == names and np.array_equal(view.columns["force_simulated_n"], found.simulated[1])
    (left, right), (low, high) = view.plot.view.viewRange()
    x, y = found.measured
    assert (left, right) == pytest.approx((x.min() - 0.05 * np.ptp(x), x.max() + 0.05 * np.ptp(x)), abs=1e-5)
    assert (low, high) == pytest.approx((y.min() - 0.08 * np.ptp(y), y.max() + 0.08 * np.ptp(y)), abs=1e-5)
    view.show_shot(replace(ONE, fit=None, impact=replace(ONE.impact, stiffness_slope_n_per_m=NotSeen("short"))))
    assert (list(view.columns) == names[:2] and view._slope.getData()[0] is None) or view._slope.getData()[0].size == 0
    view.show_shot(replace(ONE, impact=None))
    assert view.columns == {} and view._measured[0].samples.size == 0


def test_a_law_is_headed_by_where_it_acts_and_told_with_its_rivals(qtbot) -> None:
    panel = LawCurve()
    qtbot.addWidget(panel)
    law = synthetic.learned_law()
    for where, said in (("block", "on the block"), ("plate", "on the plate"), ("gap", "between block and plate")):
        panel.show_laws((replace(law, where=where),))
        assert panel._heading.text() == f"LEARNED LAW: a force {said} as a function of place"
    assert panel._words.text() == (
        "closed form: exponential; not excluded: inverse square (ΔBIC +4.2), hinge (ΔBIC +8.0). The plot spans the "
        "range covered. Not observable: any part outside the range covered."
    )
    force = 1e3 * law.curve_force_n
    low, high = panel.plot.plot.view.viewRange()[1]
    assert (low, high) == pytest.approx((force.min() - 0.1 * np.ptp(force), force.max() + 0.1 * np.ptp(force)))
    assert [words for words, _ in panel.plot.legend] == [
        "free curve", "± 2 σ", "closed form: exponential",
    ]  # fmt: skip
    panel.compare.click()
    assert [words for words, _ in panel.plot.legend][3:] == ["inverse square"]
    panel.compare.click()
    panel.show_laws((replace(law, form=None, other_forms=()),))
    assert panel._words.text().startswith("no closed form fits; nearest: exponential. The plot")
    assert panel.plot.legend[2][0] == "nearest form: exponential" and not panel.compare.isEnabled()
    assert panel.plot.columns["place_m"] == pytest.approx(law.curve_argument)
    assert panel.law is not None and panel.keep.isEnabled()


@pytest.mark.parametrize(
    ("reading", "said"),
    [
        (Quantity(10.0, 2.0), ""),
        (Quantity(10.0, 2.01), "Poorly determined: ± is 20 % of the value"),
        (Quantity(-10.0, 5.0), "Poorly determined: ± is 50 % of the value"),
        (Quantity(0.0, 5.0), ""),
        (Quantity(10.0, float("inf")), ""),
        (Quantity(float("nan"), 5.0), ""),
        (NotSeen("dark"), ""),
        (None, ""),
    ],
)
def test_a_number_is_poorly_determined_from_a_fifth_on(reading, said) -> None:
    assert wide_words(reading) == said


def test_two_restitutions_agree_up_to_three_standard_deviations(qtbot) -> None:
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    for apart, said in (
        (2.9, "quasi-static and impulse COR agree"),
        (4.4, "quasi-static and impulse COR differ by 4 σ"),
    ):
        first, second = Quantity(0.98, 3e-5), Quantity(0.98 - apart * 5e-5, 4e-5)
        impact = replace(ONE.impact, cor_quasi_static=first, cor_impulse=second)
        panel.show_shot(replace(ONE, impact=impact))
        assert said in panel.agreement.text(), apart
    sure = replace(ONE.impact, cor_quasi_static=Quantity(0.98, 0.0), cor_impulse=Quantity(0.9, 0.0))
    panel.show_shot(replace(ONE, impact=sure))
    assert "differ by inf" in panel.agreement.text()
    panel.show_shot(replace(ONE, impact=replace(sure, cor_impulse=NotSeen("short"))))
    assert panel.agreement.text() == ""


def test_problem_flags_and_a_cached_result_are_told_worst_first(qtbot) -> None:
    panel = NumbersPanel()
    qtbot.addWidget(panel)
    panel.show_shot(replace(ONE, flags=("wander", "clipped"), problem="no impact"), "a title", "1.2")
    said = panel.flags.text().split("<br>")
    assert len(said) == 4 and f"{MARKS[Tone.BAD]} no impact" in said[0]
    assert "cut off" in said[1] and "drifted" in said[2] and "version 1.2" in said[3]
    signs = panel.colours.signs
    assert f"color: {signs[Tone.BAD]}" in said[0] and f"color: {signs[Tone.NEUTRAL]}" in said[3]
    assert panel.title.toolTip() == "a title"
    panel.show_shot(None)
    assert panel.flags.text() == "" and panel.title.toolTip() == "No shot"
