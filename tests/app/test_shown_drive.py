"""A drive in the window: force against time, speed and place, what is left of it, and what to do next."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE
from analysis.diagnosis.findings.result import Candidate, Verdict
from analysis.drive.curves import DriveCurves
from analysis.drive.repeatability import Repeatability
from app.window.panels.next_steps import ANOTHER_SHOT, NextSteps
from app.window.panels.residuals import Residuals
from app.window.panels.shot_drive import DriveView
from tests.app import synthetic
from tests.app.on_screen import next_buttons

TIME_S = np.linspace(0.5, 4.5, 401)
PLACE_M = 0.03 * np.sin(TIME_S)
SPEED_M_PER_S = 0.03 * np.cos(TIME_S)
MODELLED_N = 20.0 * np.sign(SPEED_M_PER_S)
LEFT_N = 0.06 * np.sin(40.0 * TIME_S)
CURVES = DriveCurves(
    TIME_S, PLACE_M, SPEED_M_PER_S, MODELLED_N + LEFT_N, MODELLED_N, Repeatability(0.02, True, 4.0), 250.0
)


@pytest.fixture
def view(qtbot):
    one = DriveView(None)
    for page in one.pages.values():
        qtbot.addWidget(page)
    one.show_curves(CURVES)
    return one


def test_every_curve_stands_over_its_own_axis(view) -> None:
    assert view.curves is not None
    expected = (
        (view._velocity, TIME_S, SPEED_M_PER_S), (view._measured, TIME_S, MODELLED_N + LEFT_N),
        (view._modelled, TIME_S, MODELLED_N), (view._residual, TIME_S, LEFT_N),
        (view.speed._measured, SPEED_M_PER_S, MODELLED_N + LEFT_N), (view.speed._modelled, SPEED_M_PER_S, MODELLED_N),
        (view.speed._residual, SPEED_M_PER_S, LEFT_N), (view.place._measured, 1e3 * PLACE_M, MODELLED_N + LEFT_N),
        (view.place._modelled, 1e3 * PLACE_M, MODELLED_N), (view.place._residual, 1e3 * PLACE_M, LEFT_N),
    )  # fmt: skip
    for curve, x, y in expected:
        shown_x, shown_y = curve.getData()
        assert np.allclose(shown_x, x, rtol=1e-12, atol=0.0) and np.allclose(shown_y, y, rtol=0.0, atol=1e-12)
    assert view.stack.whole == pytest.approx((0.5, 4.5))
    assert [band.typical for band in (view._band, view.speed._band, view.place._band)] == pytest.approx(3 * [0.04])
    assert list(view.place._force.columns) == ["position along the guide (mm)", "measured (N)", "modelled (N)"]
    assert view.place._residual_plot.columns["residual (N)"] == pytest.approx(LEFT_N)


def test_what_is_left_is_told_against_what_repeats(view) -> None:
    rms = float(np.sqrt(np.mean(LEFT_N**2)))
    assert view.say.text() == (
        f"residual {rms:.3g} N rms, {rms / 0.02:.2g} times the cycle-to-cycle repeatability "
        "(0.02 N under this shot's own fit); compared up to 250 Hz"
    )
    assert view.legend()[-1][0] == "±2 × the cycle-to-cycle repeatability"
    view.show_curves(replace(CURVES, repeatability=Repeatability(0.0, False)))
    noise = "the noise of the force in this band"
    assert f", – times {noise} (0 N" in view.say.text() and view.legend()[-1][0] == f"±2 × {noise}"
    view.show_curves(replace(CURVES, repeatability=Repeatability(0.02, True)))
    assert view.legend()[-1][0] == "±2 × the record-to-record repeatability"


def test_a_drive_that_went_leaves_nothing(view) -> None:
    view.show_curves(None)
    assert view.curves is None and view.legend()[-1][0] == "band"
    curves = (view._velocity, view._measured, view._modelled, view._residual)
    pages = (view.speed, view.place)
    assert all(curve.samples.size == 0 for curve in curves)
    assert all(curve.samples.size == 0 for page in pages for curve in (page._measured, page._modelled, page._residual))


def test_the_axes_hold_every_point_the_band_and_a_little_room(view) -> None:
    (left, right), (low, high) = view.place._force.plot.view.viewRange()
    x = 1e3 * PLACE_M
    assert (left, right) == pytest.approx((x.min() - 0.04 * np.ptp(x), x.max() + 0.04 * np.ptp(x)))
    y = np.concatenate([MODELLED_N, MODELLED_N + LEFT_N])
    assert (low, high) == pytest.approx((y.min() - 0.06 * np.ptp(y), y.max() + 0.06 * np.ptp(y)))
    view.show_curves(replace(CURVES, repeatability=Repeatability(0.5, True, 4.0)))
    low, high = view.speed._residual_plot.plot.view.viewRange()[1]
    assert (low, high) == pytest.approx((-1.12, 1.12))


def test_the_residual_of_a_force_is_drawn_before_and_after_each_in_its_unit(qtbot) -> None:
    page = Residuals()
    qtbot.addWidget(page)
    page.resize(900, 600)
    page.show()
    shot = synthetic.shot("a drive")
    page.show_diagnosis(replace(synthetic.diagnosis(shot), drive=synthetic.DRIVE), [shot])
    assert page._heading.text() == "RESIDUAL OF FORCE" and page.stack_in_view is page.forces
    before = replace(CURVES, modelled_n=MODELLED_N - 5.0, repeatability=Repeatability(0.1, True))
    page.show_forces(shot, before, CURVES)
    assert page._heading.text() == "RESIDUAL OF FORCE, a drive (band: ±2 × the cycle-to-cycle repeatability)"
    scales, lefts, halves = (1.0, 1e3), (LEFT_N + 5.0, LEFT_N), (0.2, 0.04)
    forces, curves = page.forces, page.force_curves
    for curve, band, scale, left, half in zip(curves, forces.bands, scales, lefts, halves, strict=True):
        assert np.allclose(curve.samples, scale * left, rtol=0.0, atol=1e-9) and curve.getData()[0][0] == 0.5
        assert band.typical == pytest.approx(scale * half)
    assert [plot.unit for plot in forces.plots] == ["N", "mN"] and forces.whole == pytest.approx((0.5, 4.5))


def test_the_three_strongest_that_are_not_named_may_be_tried(qtbot) -> None:
    steps = NextSteps()
    qtbot.addWidget(steps)
    told = synthetic.diagnosis(synthetic.shot())
    names = ("viscous_drag", "tilt", "adhesion", "frame_vibration", "coulomb_friction", "quadratic_drag")
    fitted = dict(told.effects[0].parameters)
    scores = (3.0, -9.0, 5.0, 7.0, 99.0, 50.0)
    candidates = tuple(
        Candidate(CATALOGUE[name], score, -1.0, {} if name == "coulomb_friction" else fitted)
        for name, score in zip(names, scores, strict=True)
    )
    told = replace(told, candidates=candidates, verdict=Verdict.PARTLY_EXPLAINED)
    steps.show_diagnosis(told, (CATALOGUE["adhesion"],))
    assert not steps.isHidden()
    left = ("tilt", "frame_vibration", "viscous_drag")
    said = [button.text() for button in next_buttons(steps)]
    assert said == [*(f"Try {CATALOGUE[name].words}" for name in left), "Propose a law …"]
    tried: list[object] = []
    steps.try_wanted.connect(tried.append)
    for button in next_buttons(steps)[:3]:
        button.click()
    assert tried == [CATALOGUE[name] for name in left]
    with qtbot.waitSignal(steps.law_wanted):
        next_buttons(steps)[3].click()
    steps.show_diagnosis(replace(told, verdict=Verdict.UNEXPLAINED, effects=()), ())
    said = [button.text() for button in next_buttons(steps)]
    assert said[:3] == [f"Try {CATALOGUE[name].words}" for name in ("quadratic_drag", "tilt", "frame_vibration")]
    assert steps.shot.text().startswith("Next shot: ") and ANOTHER_SHOT[:40] in steps.shot.text()
    for verdict in (Verdict.ADEQUATE, Verdict.EFFECT_FOUND, Verdict.LAW_LEARNED):
        steps.show_diagnosis(replace(told, verdict=verdict), ())
        assert steps.isHidden() and next_buttons(steps) == []
    steps.show_diagnosis(None, ())
    assert steps.isHidden()
