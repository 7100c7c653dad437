"""Every plot draws what is selected, in whatever order shots of different kinds come to whatever page."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from PySide6.QtTest import QTest

from analysis.drive.curves import drive_curves
from app.session.session import Entry
from app.session.verdict_basis import Diagnosed
from app.window.main_window import MainWindow, open_window
from app.window.panels.layout import Layout
from app.window.plots.plot_view import PlotView
from tests.app import rigs, synthetic

KINDS = ("slow", "fast", "driven", "broken")


@pytest.fixture(scope="module")
def window(qapp, tmp_path_factory, warm_kernels):
    """Return one window with a shot of every kind, by names as in ``KINDS``."""
    window = open_window(tmp_path_factory.mktemp("drawn"), rigs.idle_bench, apart=False)
    for number, speed in ((1, 0.2), (2, 0.26)):
        window.workbench.session.add(synthetic.shot(KINDS[number - 1], speed, number))
    window.workbench.session.add(synthetic.driven_shot("driven"))
    window.workbench.session.add(synthetic.shot("broken", problem="no beat"))
    window.show()
    window.pull()
    yield window
    window.close()


def select(window: MainWindow, kind: str) -> Entry:
    entry = next(e for e in window.workbench.session.entries if e.name == kind)
    window.panels.table.select([entry.number])
    return entry


def drawn(window: MainWindow, page: int) -> list[PlotView]:
    """Return the plots of a page that are in view and show a curve of some shot."""
    widget = window.panels.tabs.widget(page)
    assert widget is not None
    return [plot for plot in widget.findChildren(PlotView) if plot.isVisible() and plot.shows]


def settled(window: MainWindow) -> None:
    for _ in range(3000):
        window.pull()
        if window.workbench.short_jobs.open_jobs == 0 and window.workbench.jobs.open_jobs == 0:
            window.pull()
            return
        QTest.qWait(10)
    raise AssertionError("the work never ended")


@pytest.mark.parametrize("page", [Layout.SHOT, Layout.COMPARE, Layout.SPECTRUM, Layout.DIAGNOSIS])
def test_in_every_order_of_kinds(window, page):
    for before, after in permutations(KINDS, 2):
        window.panels.tabs.setCurrentIndex(page)
        select(window, before)
        settled(window)
        if page == Layout.COMPARE:  # the other way in: chosen elsewhere, looked at here
            window.panels.tabs.setCurrentIndex(Layout.LIVE)
        entry = select(window, after)
        window.panels.tabs.setCurrentIndex(page)
        settled(window)
        for plot in drawn(window, page):
            assert [shot is entry.shot for shot in plot.shows] == [True], (before, after, plot.name)
            assert str(entry.number) in plot.accessibleDescription()


@pytest.mark.parametrize("view", ["whole", "contact", "deflection", "gap"])
def test_the_samples_drawn_are_those_of_the_shot(window, view):
    panel = window.panels.shot
    window.panels.tabs.setCurrentIndex(Layout.SHOT)
    for kind in ("slow", "driven", "fast", "driven", "slow"):
        shot = select(window, kind).shot
        panel.set_view(view)
        settled(window)
        (plot,) = {id(plot): plot for plot in drawn(window, Layout.SHOT)}.values() if kind != "driven" else (None,)
        if plot is panel.stack:
            assert np.array_equal(panel.stack.plots[0].sampled[1].samples, shot.motion.velocity_m_per_s)
            assert np.array_equal(panel.stack.plots[1].sampled[0].samples, shot.fit.shots[0].overlay.force_n)
        if kind == "driven":
            told = drive_curves(shot.motion, shot.fit)
            force = panel.drive.stack.plots[1]
            assert np.array_equal(force.sampled[1].samples, told.measured_n, equal_nan=True)
            assert np.array_equal(force.sampled[0].samples, told.modelled_n, equal_nan=True)
            assert panel.plot_in_front() in panel.drive.plots


def test_a_driven_record_has_views_and_numbers_of_its_own(window):
    panel = window.panels.shot
    window.panels.tabs.setCurrentIndex(Layout.SHOT)
    select(window, "driven")
    settled(window)
    assert [b.text() for b in panel._buttons.values() if b.isVisible()] == [
        "Over time", "Force vs speed", "Force vs position"
    ]  # fmt: skip
    assert "N rms, " in panel.drive.say.text() and panel.drive.say.isVisible()
    assert panel.drive.stack.cursors.axis.unit == "s"
    numbers = window.panels.numbers
    assert numbers.values["mass"].isVisible() and not numbers.values["quasi-static"].isVisible()
    assert numbers.values["mass"].text().startswith("9")
    select(window, "fast")
    assert panel._buttons["gap"].isVisible() and not panel.drive.say.isVisible()
    assert panel._buttons["contact"].text() == "First contact"


def test_a_drives_diagnosis_draws_what_its_force_leaves_over(window):
    entry = select(window, "driven")
    fit = entry.shot.fit
    told = replace(synthetic.diagnosis(entry.shot), fit_before=fit, fit_after=fit, candidates=())
    slow = select(window, "slow")
    plain = replace(synthetic.diagnosis(slow.shot), candidates=())  # none is fitted meanwhile
    window.workbench.diagnoses += [Diagnosed(told, (entry.number,)), Diagnosed(plain, (slow.number,))]
    window.panels.tabs.setCurrentIndex(Layout.DIAGNOSIS)
    residuals = window.panels.diagnosis.residuals
    window.panels.diagnosis.fold.setChecked(True)
    curves = drive_curves(entry.shot.motion, fit)
    try:
        for _ in range(2):
            select(window, "driven")
            settled(window)
            (plot,) = drawn(window, Layout.DIAGNOSIS)
            assert plot is residuals.forces and plot.shows == (entry.shot,)
            for part in plot.plots:
                (curve,) = part.sampled
                scale = {"N": 1.0, "mN": 1e3, "µN": 1e6}[part.unit]
                np.testing.assert_allclose(curve.samples, scale * curves.residual_n)
            assert "RESIDUAL OF FORCE, driven" in residuals._heading.text()
            assert window.panels.plot_in_front() is residuals.forces
            select(window, "slow")
            settled(window)
            (plot,) = drawn(window, Layout.DIAGNOSIS)
            assert plot is residuals.stack and plot.shows == (slow.shot,)
            assert not len(residuals.force_curves[0].samples)
    finally:
        window.workbench.diagnoses.clear()
