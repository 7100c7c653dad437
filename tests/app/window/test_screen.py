"""All that the operator is shown, page by page, against what is written down in ``screen/``.

What differs is said in one line each.  ``make screen`` writes the files anew; they are read before they are committed.
"""

import re
from dataclasses import replace
from pathlib import Path, PurePosixPath
from types import SimpleNamespace

import numpy as np
from PySide6.QtCore import QEvent, QPoint
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton

from analysis.collision.effects import CATALOGUE
from analysis.diagnosis.findings.result import Candidate, Verdict
from analysis.drive.driven_fit import fit_driven
from analysis.planning.next_shot import NextShot
from analysis.planning.plan import Plan
from analysis.planning.shot_log import PlannedStep, PlanningState
from analysis.reading.site import CENTRES_HZ, MachineLine, SiteFloor
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Role
from analysis.shot.shot import PlotNote
from app.session.candidate_residuals import CandidateResidual
from app.session.channel_guess import ChannelKind, ChannelSummary
from app.session.settings import FIELDS
from app.window.controls.theme import Tone
from app.window.panels.layout import Layout
from app.window.panels.session_model import VERDICT
from app.window.presenters import rig
from instrument.capture.acquisition import State
from instrument.capture.snapshot import CapturedShot, SignalLine
from instrument.devices.device_search import FoundDevice
from instrument.devices.digitizer import CaptureSettings
from instrument.files.foreign_file import ForeignChannel, ForeignContents
from instrument.live.live_view import ChannelSignal, LiveView, empty_view
from instrument.trigger.light_switch import Level
from tests.app import synthetic
from tests.app.on_screen import click_head
from tests.app.window import shown
from tests.app.window.scene import (
    DRAG,
    DRIVEN,
    FAILED,
    FIRST,
    SECOND,
    TILT,
    VISCOUS,
    bare,
    check,
    found_by,
    of,
    quiet,
    settle,
    show,
)

FLOOR = SiteFloor(
    4.0, CENTRES_HZ, np.geomspace(0.1e-6, 3e-6, len(CENTRES_HZ)), np.empty(0), np.empty(0),
    (
        MachineLine(49.98, 2.1e-9, "mains", 1.02),
        MachineLine(24.3, 8.4e-9, "a motor just below a multiple of the mains", 1.31),
        MachineLine(11.7, 0.4e-9, "unknown"),
        MachineLine(100.0, 0.6e-9, "mains, twice"),
        MachineLine(151.0, 0.1e-9, "unknown"),
    ),
    "VC-E", 2.2e-5,
)  # fmt: skip


def test_menus_and_what_surrounds_the_pages(window):
    panels = show(window, Layout.LIVE)
    menus = [action.menu() for action in window.menuBar().actions() if action.menu() is not None]
    top = [*of(panels.controls), *of(panels.banner), *of(panels.signals)]
    parts = {"title": [window.windowTitle()], "controls, banner and signal line": top, "status line": of(panels.work)}
    tabs = [panels.tabs.tabToolTip(page) for page in range(panels.tabs.count())]
    parts |= {"pages": tabs, "menus": [line for menu in menus for line in shown.of_menu(menu)]}
    check("around", parts)


def test_every_state_of_the_rig(window, monkeypatch):
    panels = show(window, Layout.SHOT, FIRST)
    waiting = tuple(CapturedShot(n, f"shot-{n}", None, CaptureSettings(1e6, 64, 0), waits=True) for n in (5, 6))
    poor = SignalLine(
        (
            ChannelSignal(Role.REFERENCE, 0.2, 1.0, 0.0, 2.73e6, 21.0),
            ChannelSignal(Role.MEASUREMENT, 0.9, 1.0, 4e-3, 2.5e6, 30.0),
        ),
        Level.UNKNOWN, 0, disk_free_bytes=10**9, folder=PurePosixPath("/full"),
    )  # fmt: skip
    weak = replace(poor, channels=tuple(replace(c, snr_db=12.0, clipped_fraction=0.0) for c in poor.channels))
    lost = replace(
        poor,
        channels=(ChannelSignal(Role.MEASUREMENT, 0.0, 1.0, 0.0, None, None),),
        folder_problem="/full is read-only",
    )
    states = {
        "arming": quiet(state=State.ARMING),
        "armed, again by itself": quiet(state=State.ARMED, automatic=True),
        "armed, one waits": quiet(state=State.ARMED, captured=waiting[:1]),
        "the switch fired": quiet(state=State.TRIGGERED, signal=poor),
        "samples are saved": quiet(state=State.TRANSFERRING, signal=weak),
        "analysing": quiet(state=State.ANALYSING, captured=waiting, doing="shot-5: reading", progress=0.4),
        "a fault before any shot": quiet(
            state=State.FAULT, message="the cable is out", remedy="plug it in", signal=lost
        ),
        "a fault, all saved": quiet(state=State.FAULT, message="the cable is out", save_failed=True, shots=2),
        "a fault, two unsaved": quiet(state=State.FAULT, message="disk full", shots=3, unsaved=("shot-2", "shot-3")),
        "at rest, one unsaved": quiet(unsaved=("run-1",), message="stopped", remedy="arm again"),
    }
    parts = {}
    monkeypatch.setattr(rig, "time", SimpleNamespace(monotonic=lambda: 112.0))
    monkeypatch.setattr(window.rig, "take_shots", lambda _: [])
    for name, snapshot in states.items():
        monkeypatch.setattr(window.rig, "latest", lambda snapshot=snapshot: replace(snapshot, since_s=100.0))
        window.pull()
        QTest.qWait(5)
        parts[name] = [*bare(panels.controls), *bare(panels.banner), *of(panels.signals), *of(panels.work.progress)]
    check("rig", parts)


def _live(floor):
    time_s = 3.0 + np.arange(4000) / 2e3
    velocity = -0.265 * np.sin(2 * np.pi * 0.5 * (time_s - time_s[-1]))
    raw_s = 3.0 + np.arange(400) / 10e6
    raw = np.stack(
        [0.8 * np.sin(2 * np.pi * 2.73e6 * raw_s), 0.6 * np.cos(2 * np.pi * 2.7e6 * raw_s), 4 + 0 * raw_s], 1
    )
    force = 0.5 * np.where(time_s > 4.0, velocity, np.nan)
    return LiveView(time_s, 2.73e6 - 3.16e6 * velocity, velocity, force, raw_s, raw.astype(np.float32), floor=floor)


def test_live(window, monkeypatch):
    panels = show(window, Layout.LIVE)
    parts = {"no samples": of(panels.live)}
    view = _live(FLOOR)
    for name, later in (("running", view), ("without a floor", replace(view, time_s=view.time_s + 1.0, floor=None))):
        monkeypatch.setattr(window.rig, "latest", lambda later=later: quiet(live=later))
        window.pull()
        QTest.qWait(5)
        parts[name] = of(panels.live)
    advice = replace(FLOOR, lines=(), criterion="")
    panels.live.floor.show_floor(advice)
    parts["a floor that meets nothing"] = of(panels.live.floor)
    panels.live.show_live(replace(empty_view(), problem="PD1 has no beat"))
    parts["a problem"] = of(panels.live)
    check("live", parts)


def test_the_views_of_a_shot(window):
    panels = show(window, Layout.SHOT, FIRST)
    shot = panels.shot
    zero = synthetic.TOUCH_S
    window.workbench.session.change_plot_note(FIRST, None, PlotNote("velocity", zero + 0.02, 0.1, "a knock?"))
    window.workbench.session.change_plot_note(FIRST, None, PlotNote("gap", zero + 0.002, 5e-6, "lifts off"))
    parts = {}
    for view in ("whole", "contact", "deflection", "gap", "raw"):
        window.view_presenter.show_view(view)
        settle(window)
        parts[view] = of(shot) if view == "whole" else bare(shot)
    window.view_presenter.show_view("whole")
    for kind in ("velocity", "displacement"):
        shot.motion.kind.setCurrentIndex(shot.motion.kind.findData(kind))
        parts[f"residual of {kind}"] = of(shot.stack)
    shot.motion.kind.setCurrentIndex(0)
    for view, a, b in (("whole", -20.0, 40.0), ("deflection", 0.5, 2.0)):
        window.view_presenter.show_view(view)
        plot = shot.plot_in_front()
        plot.show_cursors(True)
        plot.cursors.place(a, b)
        QTest.qWait(5)
        parts[f"cursors, {view}"] = bare(shot)
        parts[f"menu of the plot, {view}"] = shown.of_menu(plot.menu())
        plot.show_cursors(False)
    window.view_presenter.show_view("raw")
    there = shot.raw.stack
    place = there.mapFromScene(there.plots[0].view.sceneBoundingRect().center())
    parts["menu where a note can be written"] = shown.of_menu(there.menu(QPoint(place)))
    window.view_presenter.show_view("whole")
    for _ in range(2):
        window.workbench.session.undo()
    check("shot", parts)


def test_a_shot_without_a_fit_one_that_failed_a_drive_and_none(window):
    parts = {}
    for name, numbers in (("one that failed", [FAILED]), ("none", []), ("a drive", [DRIVEN])):
        panels = show(window, Layout.SHOT, *numbers)
        for view in ("whole", "contact", "deflection") if numbers == [DRIVEN] else ("whole",):
            window.view_presenter.show_view(view)
            settle(window)
            parts[f"{name}, {view}"] = of(panels.shot)
    window.view_presenter.show_view("whole")
    panels.shot.show_shot(replace(synthetic.shot(), fit=None))
    parts["not fitted"] = bare(panels.shot)
    show(window, Layout.SHOT, FIRST)
    check("shot-others", parts)


def test_the_numbers_and_the_model(window):
    parts = {}
    panels = show(window, Layout.SHOT, FIRST)
    parts["a shot"] = [*of(panels.numbers), *of(panels.model)]
    panels.numbers.others.setChecked(True)
    panels.model.correlated.setChecked(True)
    panels.numbers.noise_only.setChecked(True)
    parts["unfolded, from noise only"] = [*of(panels.numbers), *of(panels.model)]
    panels.numbers.noise_only.setChecked(False)
    show(window, Layout.SHOT, SECOND)
    parts["with flags"] = [*of(panels.numbers), *of(panels.model)]
    panels.numbers.others.setChecked(False)
    panels.model.correlated.setChecked(False)
    shot = synthetic.shot("with drag")
    drag = {f"{DRAG.key}.coefficient_n_s2_per_m2": Quantity(1.9e-3, 1e-4)}
    fit = replace(shot.fit, effects=(DRAG,), parameters=shot.fit.parameters | drag, covariance=np.eye(5))
    apart = replace(shot.impact, cor_impulse=Quantity(0.9871, 4e-5), force_peak_n=Quantity(0.5, 0.2))
    panels.numbers.show_shot(replace(shot, impact=apart, fit=fit), "Shot 9", "0.1.0")
    panels.model.show_shot(replace(shot, fit=replace(fit, reduced_chi2=3.7)), (DRAG,))
    panels.model.show_known("differs from the model file", Tone.WARNING)
    parts["two numbers differ, an effect, a kept result"] = [*of(panels.numbers), *of(panels.model)]
    panels.model.show_known("", Tone.NEUTRAL)
    panels.model.show_shot(replace(shot, fit=replace(fit, converged=False)))
    parts["a fit without an end"] = of(panels.model)
    panels.model.show_shot(replace(shot, fit=None))
    parts["no fit"] = of(panels.model)
    show(window, Layout.SHOT, FAILED)
    parts["one that failed"] = [*of(panels.numbers), *of(panels.model)]
    show(window, Layout.SHOT, DRIVEN)
    parts["a drive"] = [*of(panels.numbers), *of(panels.model)]
    show(window, Layout.SHOT)
    parts["no shot"] = [*of(panels.numbers), *of(panels.model)]
    check("numbers", parts)


def test_compare(window):
    panels = show(window, Layout.COMPARE, FIRST, SECOND)
    parts = {"two shots": of(panels.compare)}
    panels.compare.show_contact()
    parts["first contact"] = of(panels.compare.stack)
    panels.compare.stack.reset()
    for place in range(panels.compare.which.count()):
        panels.compare.which.setCurrentIndex(place)
        parts[f"trend of {panels.compare.which.currentText()}"] = [
            *of(panels.compare.trend), *of(panels.compare.repeatability),
        ]  # fmt: skip
    panels.compare.which.setCurrentIndex(0)
    show(window, Layout.COMPARE, FIRST)
    parts["one shot"] = bare(panels.compare)
    show(window, Layout.COMPARE)
    parts["none"] = bare(panels.compare)
    entry = window.workbench.session.entry(FIRST)
    panels.compare.show_entries([replace(entry, number=n, name=f"copy-{n}") for n in range(11, 21)])
    parts["more than there is room for"] = [line[:120] for line in bare(panels.compare)]
    show(window, Layout.COMPARE, FIRST)
    check("compare", parts)


def test_spectrum(window):
    panels = show(window, Layout.SPECTRUM, FIRST)
    parts = {"a recording": of(panels.spectrum)}
    show(window, Layout.SPECTRUM, SECOND)
    parts["without a recording"] = of(panels.spectrum)
    check("spectrum", parts)


def test_diagnosis(window):
    panels = show(window, Layout.DIAGNOSIS, FIRST, SECOND)
    page = panels.diagnosis
    parts = {"none yet": of(page)}
    page.show_progress("fit 3 of 7", 0.42, "diagnosis of shots 1, 2")
    parts["under way"] = of(page)
    page.show_progress(None, 0.0)
    page.show_problem("select at least one analysed shot")
    parts["not possible"] = of(page)[:8]
    found = found_by([window.workbench.session.entry(n).shot for n in (FIRST, SECOND)])
    window.workbench._take_diagnosis((FIRST, SECOND), found)
    settle(window)
    parts["effect found"] = of(page)
    page.fold.setChecked(True)
    QTest.qWait(5)
    parts["unfolded"] = [*of(page.residuals), *of(page._blind)]
    page.fold.setChecked(False)
    for candidate in found.candidates:
        page.why.point_at(candidate.effect)
        parts[f"pointed at {candidate.name}"] = [*of(page.why.grid), *of(page.why.said)]
    left = [tuple(f * np.asarray(part.residual_m) for part in found.fit_before.shots) for f in (0.3, 0.6)]
    page.why.show_found(
        {DRAG: CandidateResidual(DRAG, left[0], 1.01), VISCOUS: CandidateResidual(VISCOUS, left[1], 1.9)}
    )
    page.why.point_at(VISCOUS)
    parts["pointed at one fitted in full"] = [*of(page.why.grid), *of(page.why.said)]
    page.why.point_at(None)
    page.why.neighbour.setChecked(True)
    parts["beside its neighbour"] = of(page.why)
    page.why.neighbour.setChecked(False)
    settle(window)
    # the list and the panel of the model say it too
    parts["the verdict in the list"] = [*of(panels.table.table), *of(panels.model)]
    parts["hover of the verdict"] = [shown.hovers(panels.table.table, 0)[VERDICT]]
    check("diagnosis", parts)


def test_what_else_a_diagnosis_may_say(window):
    panels = show(window, Layout.DIAGNOSIS, FIRST, SECOND)
    page, shots = panels.diagnosis, [window.workbench.session.entry(n).shot for n in (FIRST, SECOND)]
    found = found_by(shots)
    law = synthetic.learned_law()
    second = replace(law, form=None, where="plate", argument="bend", other_forms=())
    parts = {}
    page.show_diagnosis(found, shots, (DRAG,), "0.1.0")
    parts["in the model, a kept result"] = of(page)
    page.show_diagnosis(found, shots, (TILT,), holds=False)
    parts["another effect in the model, outdated"] = of(page)[:14]
    page.tried = (TILT,)
    open_one = replace(found, verdict=Verdict.UNEXPLAINED, effects=(), error_after=found.error_before)
    page.show_diagnosis(open_one, shots, (TILT,))
    parts["unexplained"] = of(page)
    page.tried = ()
    page.show_diagnosis(replace(found, verdict=Verdict.PARTLY_EXPLAINED), shots)
    parts["partly explained"] = of(page)[:20]
    page.show_diagnosis(replace(found, verdict=Verdict.ADEQUATE, effects=()), shots)
    parts["adequate"] = of(page)[:8]
    page.show_diagnosis(replace(found, verdict=Verdict.LAW_LEARNED, effects=(), laws=(law, second)), shots)
    parts["two laws learned"] = [*of(page)[:20], "...", *of(page.law_curve)]
    page.law_curve.compare.setChecked(True)
    page.law_curve._draw()
    parts["forms compared"] = of(page.law_curve)
    page.law_curve.compare.setChecked(False)
    page.law_curve._turn()
    parts["the other law"] = of(page.law_curve)
    many = [(replace(shots[0], name=f"series-a-{n}")) for n in range(7)]
    page.show_diagnosis(found, many)
    parts["of many shots"] = of(page._of)
    page.show_diagnosis(None, [])
    check("diagnosis-others", parts)


def test_many_candidates_and_several_effects(window):
    panels = show(window, Layout.DIAGNOSIS, FIRST, SECOND)
    page, shots = panels.diagnosis, [window.workbench.session.entry(n).shot for n in (FIRST, SECOND)]
    found = found_by(shots)
    many = tuple(Candidate(e, 50.0 - n, -500.0 / (n + 1) ** 2) for n, e in enumerate(list(CATALOGUE.values())[:9]))
    second = replace(found.effects[0], effect=TILT, parameters={"angle_rad": Quantity(2e-5, 1e-6)})
    page.show_diagnosis(replace(found, candidates=many, effects=(*found.effects, second)), shots, (VISCOUS,))
    parts = {"two effects, one of another in the model": bare(page.effects), "nine candidates": bare(page.bars)}
    page.bars.findChildren(QPushButton)[-1].click()
    parts["all of them"] = bare(page.bars)
    page.bars.findChildren(QPushButton)[-1].click()
    parts["fewer again"] = bare(page.bars)
    pointed, wanted = [], []
    page.bars.pointed.connect(lambda effect: pointed.append(effect and effect.name))
    page.effects.add_wanted.connect(lambda effects: wanted.append([effect.name for effect in effects]))
    page.effects.remove_wanted.connect(lambda effect: wanted.append(effect.name))
    name = next(label for label in page.bars.findChildren(QLabel) if label.property("candidate") == many[2].effect.key)
    for kind in (QEvent.Type.FocusIn, QEvent.Type.FocusOut, QEvent.Type.Enter, QEvent.Type.Leave, QEvent.Type.Resize):
        page.bars.eventFilter(name, QEvent(kind))
    assert pointed == [many[2].effect.name, None] * 2
    for button in page.effects.findChildren(QPushButton):
        button.click()
    parts["pressed"] = [str(one) for one in wanted if isinstance(one, str | list)]
    page.show_diagnosis(None, [])
    check("candidates", parts)


def test_settings_beyond_their_limits_are_refused(window):
    """The first below and above what a field takes, and no number at all."""
    panels = show(window, Layout.SHOT, FIRST)
    sheet, applied = panels.settings, []
    sheet.applied.disconnect()
    sheet.applied.connect(applied.append)
    usual = window._store.settings.values() | {"folder": "/data/rig", "session": "", "recent": ""}
    said = []
    for field in (field for field in FIELDS if field.kind in ("number", "numbers")):
        for typed in (f"{1.001 * field.high * field.scale:.12g}", f"{field.low * field.scale - 1e-3:.12g}", "", "x"):
            sheet.show_values(usual)
            sheet._editors[field.key].setText(typed)
            sheet.apply()
            said.append(f"{field.words} {typed!r}: {sheet.problem.text()}")
    edge = [field for field in FIELDS if field.kind == "number"]
    for place in ("low", "high"):
        sheet.show_values(usual)
        for field in edge:
            sheet._editors[field.key].setText(f"{getattr(field, place) * field.scale:.12g}")
        sheet.apply()
        assert [round(applied[-1][f.key] / (getattr(f, place) or 1.0), 9) for f in edge] == [
            float(bool(getattr(f, place))) for f in edge
        ]
    sheet.applied.disconnect()
    sheet.applied.connect(window.rig_presenter._settings_applied)
    check("settings-refused", {"refused": said})


def test_the_next_shot(window):
    panels = show(window, Layout.DIAGNOSIS, FIRST, SECOND)
    card, shots = panels.diagnosis.next_shot, [window.workbench.session.entry(n).shot for n in (FIRST, SECOND)]
    found = found_by(shots)
    fast = NextShot(0.6, 0.05, 0.012, 0.02, True)
    between = (DRAG, VISCOUS)
    plan = Plan((fast,), between, 2.0, {DRAG: 9.0, VISCOUS: 8.1}, {DRAG: 9.0, VISCOUS: 8.1}, 9.0, ())
    step = PlannedStep(fast, between, {DRAG: 9.0, VISCOUS: 8.1}, 7.4, DRAG)
    cases = {
        "not planned": (None, None, False),
        "planned": (PlanningState(plan), None, False),
        "planned, on the bench": (PlanningState(plan), None, True),
        "armed for it": (PlanningState(plan, (step,)), fast, False),
        "taken by the bench": (PlanningState(plan, (replace(step, reached=None),)), fast, True),
        "resolved": (PlanningState(None, (step,)), None, False),
    }
    parts = {}
    for name, standing in cases.items():
        card.show_standing(found, *standing)
        QTest.qWait(2)
        parts[name] = of(card)
    card.show_standing(None, None, None, False)
    check("next-shot", parts)


def test_the_diagnosis_of_a_drive(window):
    panels = show(window, Layout.DIAGNOSIS, DRIVEN)
    drive = window.workbench.session.entry(DRIVEN).shot
    fit = fit_driven([drive.motion])
    one = synthetic.diagnosis(synthetic.shot())
    found = replace(
        one, fit_before=fit, fit_after=fit, effects=(), candidates=(), verdict=Verdict.ADEQUATE, drive=synthetic.DRIVE
    )
    window.workbench._take_diagnosis((DRIVEN,), found)
    settle(window)
    check("diagnosis-drive", {"a drive": of(panels.diagnosis)})


def test_tables_and_large_numbers(window):
    panels = show(window, Layout.BUDGET, FIRST, SECOND)
    table = panels.budget.table
    parts = {"budget": of(panels.budget)}
    for number, name in ((FAILED, "budget of one that failed"), (None, "budget of none")):
        show(window, Layout.BUDGET, *([number] if number else []))
        parts[name] = of(panels.budget)
    for number, name in ((FIRST, "large"), (SECOND, "large, in doubt"), (DRIVEN, "large, a drive"), (None, "none")):
        show(window, Layout.LARGE, *([number] if number else []))
        parts[name] = of(panels.large)
    table.selectAll()
    check("tables", parts)


def test_the_paper(window):
    panels = show(window, Layout.PAPER, FIRST)
    check("paper", {"the paper": of(panels.paper)})


def test_the_list_of_shots(window):
    panels = show(window, Layout.SHOT, FIRST)
    table = panels.table
    found = found_by([window.workbench.session.entry(n).shot for n in (FIRST, SECOND)])
    window.workbench._take_diagnosis((FIRST, SECOND), found)
    settle(window)
    rows = [line for row in range(table.model.rowCount()) for line in shown.hovers(table.table, row)]
    folder = str(Path(window.workbench.session.entry(FIRST).path).parent)
    parts = {"the list": of(table), "hovers of every cell": [line.replace(folder, "FOLDER") for line in rows]}
    table.filter.setText("clip")
    parts["filtered by 'clip'"] = bare(table.table)
    table.filter.setText("")
    for group in ("series", "verdict", "day", "model"):
        table.group.setCurrentIndex(table.group.findData(group))
        parts[f"grouped by {group}"] = bare(table.table)
    table.group.setCurrentIndex(0)
    for head in ("v in (m/s)", "name", "verdict"):
        column = [made.head for made in table.model.columns].index(head)
        for click in ("a click on", "a second click on", "a third click on"):
            click_head(table.table, column)
            parts[f"{click} {head}"] = bare(table.table)
    parts["copied"] = table.as_text().replace("\t", " | ").splitlines()
    check("list", parts)


def test_settings_set_up_help_and_the_other_sheets(window, tmp_path):
    panels = show(window, Layout.SHOT, FIRST)
    parts = {}
    window.rig_presenter.toggle_settings()
    values = window._store.settings.values() | {"folder": "/data/rig", "session": ""}
    panels.settings.show_values(values)
    parts["settings"] = of(panels.settings)
    panels.settings._editors["moving_mass_kg"].setText("a lot")
    panels.settings.apply()
    parts["settings, a mistake"] = of(panels.settings.problem)
    panels.settings.hide()
    panels.setup.show()
    panels.setup.show_looking()
    parts["set-up, looking"] = of(panels.setup)
    hantek = FoundDevice("hantek6022", "Hantek 6022BE", "USB 1-2", "no permission", "install the rule below")
    scope = FoundDevice("scpi:10.0.0.7", "10.0.0.7", "in the network")
    panels.setup.show_devices((hantek,), (scope,), "scpi:10.0.0.7")
    panels.setup.show_remedy("sudo cp rule /etc/udev")
    panels.setup.refuse_address("no host of this name")
    checks, said = window.setup_presenter._verdicts(quiet(live=_live(FLOOR)))
    panels.setup.show_checks(checks, said)
    parts["set-up"] = of(panels.setup)
    panels.setup.show_devices((), (), "bench", "the bus does not answer")
    panels.setup.show_remedy("")
    panels.setup.refuse_address("")
    poor = replace(quiet().signal, channels=tuple(replace(c, snr_db=9.0) for c in quiet().signal.channels[:2]))
    panels.setup.show_checks(*window.setup_presenter._verdicts(quiet(signal=poor, live=_live(None))))
    parts["set-up, weak beats"] = of(panels.setup)
    panels.setup.show_checks((), "opening the source …")
    parts["set-up, no samples"] = of(panels.setup)
    panels.setup.hide()
    channels = (ForeignChannel("ai0", 5000, "int16", "V", 1e6), ForeignChannel("ai1", 5000, "int16"))
    contents = ForeignContents(PurePosixPath("/data/beats.tdms"), "tdms", channels)
    panels.mapping.ask(contents, 17.85e-3, 2.73e6)
    parts["channels"] = of(panels.mapping)
    looks = (
        ChannelSummary("ai0", ChannelKind.MOVING, 0.8, 2.5e6, 2.8e6, True),
        ChannelSummary("ai1", ChannelKind.STILL, 0.6, 0.27, 0.27),
    )
    panels.mapping.ask(contents, 17.85e-3, None, looks)
    parts["channels that were looked at"] = of(panels.mapping)
    motion = ForeignContents(
        PurePosixPath("/data/motion.csv"), "csv", (ForeignChannel("x (mm)", 900, "float64", "mm"),)
    )
    panels.mapping.ask(motion, 17.85e-3, None)
    parts["channels of a motion"] = of(panels.mapping)
    panels.mapping.hide()
    panels.law.open()
    parts["a law, empty"] = of(panels.law)
    panels.law.fill(synthetic.learned_law().effect.written())
    parts["a law, filled"] = [line for line in of(panels.law) if "field" in line or "Formula" in line or "main" in line]
    panels.law.hide()
    window.panels.keys.toggle()
    parts["keys"] = shown.in_rows(panels.keys._scroll.widget())
    window.panels.keys.toggle()
    window.panels.tour.open()
    for step in range(5):
        parts[f"tour {step + 1}"] = of(panels.tour)
        panels.tour.next()
    check("sheets", parts)


def test_messages(window):
    panels = show(window, Layout.SHOT, FIRST)
    notices = panels.work.notices
    while notices.words:
        notices.next()
    parts = {"none": of(panels.work)}
    for words, tone in (("saved", Tone.GOOD), ("disk full", Tone.BAD), ("disk full", Tone.BAD)):
        window.panels.say(words, tone)
    parts["two"] = of(notices)
    notices.say("2 recordings are in no session", Tone.WARNING, "Open", lambda: None)
    parts["an offer"] = of(notices)
    window.panels.messages.toggle()
    listed = of(panels.messages)
    parts["listed"] = [re.sub(r"\d\d:\d\d:\d\d", "12:34:56", line) for line in listed]
    window.panels.messages.toggle()
    while notices.words:
        notices.next()
    check("messages", parts)


def test_a_difference_is_said_in_one_line():
    kept = ["# numbers", "peak force", "    0.5119 N", "width 19.10 ms", ""]
    assert all(map(shown.same, kept, ["# numbers", "peak force", "    0.5120 N", "width 19.10 ms", ""]))
    assert shown.differences(kept, ["# numbers", "peak force", "    0.5119 mN", "width 19.10 ms", ""]) == [
        "# numbers > peak force: 0.5119 N  ->  0.5119 mN"
    ]
    assert not shown.same("width 19.10 ms", "width 19.30 ms") and not shown.same("2 shots", "1 shot")
    assert shown.same("from -1.0001 to 2", "from -1.0000 to 2") and not shown.same("at 0.25", "at -0.25")
