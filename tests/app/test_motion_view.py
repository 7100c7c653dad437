"""The plots of one shot: their curves, the residual that stands out, its band and prefix, gap and deflection."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.shot.quantity import NotSeen
from analysis.uncertainty import noise_band_of_shot
from app.report import contact_span_ms
from app.window.panels.shot_motion import RESIDUALS, DeflectionView, GapView, MotionView, _size
from tests.app import synthetic
from tests.app.synthetic import TOUCH_S


@pytest.fixture(scope="module")
def shot():
    return synthetic.shot()


@pytest.fixture
def view(qtbot):
    from PySide6.QtWidgets import QWidget

    parent = QWidget()
    qtbot.addWidget(parent)
    view = MotionView(parent)
    view.parent_kept = parent
    return view


def test_measured_and_simulated_lie_over_one_another_from_first_touch(view, shot) -> None:
    view.show_shot(shot)
    overlay = shot.fit.shots[0].overlay
    for curves, measured, simulated in (
        ((view._measured[0], view._simulated[0]), shot.motion.velocity_m_per_s, overlay.velocity_m_per_s),
        ((view._measured[1], view._simulated[1]), shot.motion.force_n, overlay.force_n),
    ):
        for curve, values in zip(curves, (measured, simulated), strict=True):
            assert np.array_equal(curve.samples, values) and curve.grid == pytest.approx((-60.0, 0.01))
    marks = [plot.marks.xvals for plot in view.stack.plots]
    assert marks == [pytest.approx([0.0, 28.7077])] * 3
    view.show_shot(replace(shot, fit=None, impact=replace(shot.impact, release_time_s=NotSeen("x"))))
    assert not any(len(curve.samples) for curve in (*view._simulated, view._residual)) and view.band_words == ""
    assert [plot.marks.xvals for plot in view.stack.plots] == [[0.0]] * 3


@pytest.mark.parametrize(("kind", "scale", "unit"), [(0, 1e3, "mN"), (1, 1e6, "µm/s"), (2, 1e9, "nm")])
def test_a_residual_is_measured_minus_simulated_in_a_readable_unit_within_its_band(
    view, shot, kind, scale, unit
) -> None:
    view.show_shot(shot)
    view.stack.show_span(-60.0, 80.0)
    view.kind.setCurrentIndex(kind)
    overlay, band = shot.fit.shots[0].overlay, noise_band_of_shot(shot)
    expected = (
        (shot.motion.force_n - overlay.force_n, band.force_n),
        (shot.motion.velocity_m_per_s - overlay.velocity_m_per_s, band.velocity_m_per_s),
        (shot.fit.shots[0].residual_m, band.displacement_m),
    )[kind]
    assert view.residual.unit == unit and view.residual.title == "residual"
    assert view._residual.samples == pytest.approx(scale * expected[0], nan_ok=True, abs=1e-9)
    assert view._band.typical == pytest.approx(2 * scale * np.nanmedian(expected[1]))
    low, high = view.residual.view.viewRange()[1]
    assert low < np.nanmin(view._residual.samples) and high > np.nanmax(view._residual.samples)


@pytest.mark.parametrize(("spoilt", "chosen"), [(None, 0), ("displacement", 2), ("velocity", 1), ("force", 0)])
def test_the_residual_that_stands_out_of_its_band_is_shown_unless_one_was_chosen(view, shot, spoilt, chosen) -> None:
    band, wave = noise_band_of_shot(shot), np.sin(np.arange(shot.motion.time_s.size))
    motion, own = shot.motion, shot.fit.shots[0]
    if spoilt == "displacement":
        own = replace(own, residual_m=own.residual_m + 6 * band.displacement_m * wave)
    elif spoilt == "velocity":
        motion = replace(motion, velocity_m_per_s=motion.velocity_m_per_s + 6 * band.velocity_m_per_s * wave)
    elif spoilt == "force":
        motion = replace(motion, force_n=motion.force_n + 6 * band.force_n * wave)
    spoiled = replace(shot, motion=motion, fit=replace(shot.fit, shots=(own,)))
    view.show_shot(spoiled)
    assert view.kind.currentIndex() == chosen
    other = (chosen + 1) % 3
    view.kind.setCurrentIndex(other)
    view.kind.activated.emit(other)
    view.show_shot(spoiled)
    assert view.kind.currentIndex() == other and len(RESIDUALS) == 3


def test_the_size_of_a_residual_is_its_rms_over_its_band() -> None:
    rest, std = np.array([3.0, -4.0, np.nan, 9.0, 9.0]), np.array([1.0, 2.0, 1.0, 0.0, np.inf])
    assert _size(rest, std) == pytest.approx(np.sqrt((9 + 4) / 2)) and _size(rest, np.zeros(5)) == 0.0


def test_the_whole_shot_or_its_first_contact_is_what_a_reset_shows(view, shot) -> None:
    view.show_shot(shot)
    view.choose(contact_only=False)
    assert view.stack.whole == pytest.approx((-60.0, 1e3 * (shot.motion.time_s[-1] - TOUCH_S)))
    view.choose(contact_only=True)
    assert view.stack.whole == pytest.approx(contact_span_ms(shot))


@pytest.mark.parametrize(("off", "zooms"), [(0.019, True), (-0.019, True), (0.021, False)])
def test_a_click_within_two_per_cent_of_the_view_of_a_bounce_zooms_to_it(view, shot, off, zooms) -> None:
    view.show_shot(shot)
    view.stack.show_span(-10.0, 10.0)
    view.stack.plots[2].view.clicked.emit(2.6767 + off * 20.0)
    assert view.stack.span == (pytest.approx((2.6767 - 0.6, 2.6767 + 0.6)) if zooms else (-10.0, 10.0))


def test_the_gap_is_in_micrometres_and_the_force_below_it(qtbot, view, shot) -> None:
    gap = GapView(view.parent_kept)
    gap.show_shot(shot)
    overlay = shot.fit.shots[0].overlay
    assert gap._gap.samples == pytest.approx(1e6 * overlay.gap_m) and np.array_equal(
        gap._simulated.samples, overlay.force_n
    )
    assert np.array_equal(gap._measured.samples, shot.motion.force_n)
    assert all(curve.grid == pytest.approx((-60.0, 0.01)) for curve in (gap._gap, gap._simulated, gap._measured))
    assert gap.stack.whole == contact_span_ms(shot)
    gap.show_shot(replace(shot, fit=None))
    assert not len(gap._gap.samples) and not len(gap._simulated.samples) and len(gap._measured.samples)


def test_force_against_deflection_is_split_where_the_plate_is_bent_most(qtbot, shot) -> None:
    panel = DeflectionView()
    qtbot.addWidget(panel)
    panel.show_shot(shot)
    deflection, force = panel.columns["deflection_mm"], panel.columns["force_n"]
    turn = int(np.argmax(deflection))
    loading, unloading = panel._measured
    assert np.array_equal(loading._x, deflection[: turn + 1]) and np.array_equal(unloading._y, force[turn:])
    assert loading.samples.size + unloading.samples.size == deflection.size + 1
    for (low, high), values, room in zip(panel.plot.view.viewRange(), (deflection, force), (0.05, 0.08), strict=True):
        spare = room * np.ptp(values)
        assert (low, high) == pytest.approx((values.min() - spare, values.max() + spare), abs=1e-5)
    x, y = panel._slope.getData()
    assert (y[1] - y[0]) / (1e-3 * (x[1] - x[0])) == pytest.approx(214.3)
    assert list(panel.columns) == ["deflection_mm", "force_n", "deflection_simulated_mm", "force_simulated_n"]
    panel.show_shot(replace(shot, impact=None))
    assert panel.columns == {} and not loading.samples.size and not panel._slope.getData()[0].size
