"""What the window does when something happens: work ends, files arrive, a shot is taken, messages are answered."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from analysis.shot.quantity import Quantity
from app.session.jobs import Event, EventKind
from app.session.model_in_use import write_model
from app.window.controls.theme import Tone
from app.window.panels.layout import Layout
from app.window.presenters.files import _agreement
from app.window.presenters.session import is_unmapped
from instrument.capture.acquisition import State
from instrument.capture.snapshot import CapturedShot
from instrument.devices.device_search import FoundDevice
from instrument.devices.digitizer import DigitizerError
from instrument.live.live_view import empty_view
from tests.app import synthetic
from tests.app.window.scene import (
    DRAG,
    FIRST,
    SECOND,
    TILT,
    check,
    of,
    quiet,
    settle,
    show,
)


def _said(window):
    """Return all messages, newest first, with their tones, and dismiss them."""
    notices, found = window.panels.work.notices, []
    while notices._notices:
        newest = notices._notices[-1]
        found.append(f"{newest.tone.value}: {newest.words}" + (f" [{newest.label}]" if newest.label else ""))
        notices.next()
    return found


@pytest.fixture(autouse=True)
def no_messages(window):
    _said(window)


def test_the_end_of_each_kind_of_work_is_shown(window, monkeypatch):
    presenter, panels = window.session_presenter, window.panels
    printed = []
    monkeypatch.setattr(presenter, "_print", printed.append)
    show(window, Layout.LIVE, FIRST)
    events = {
        EventKind.EXPORTED: "2 shots exported", EventKind.MODEL: "a model", EventKind.PROBLEM: "no room",
        EventKind.PRINT: "<html>",
    }  # fmt: skip
    for kind, words in events.items():
        presenter._show_event(Event(kind, words))
    assert _said(window) == ["bad: no room", "good: a model", "good: 2 shots exported"] and printed == ["<html>"]
    presenter._show_event(Event(EventKind.SHOT, "opened", (SECOND,)))
    assert panels.table.numbers == [FIRST] and panels.tabs.currentIndex() == Layout.LIVE  # nobody asked for it
    presenter._choose_next = True
    presenter._show_event(Event(EventKind.SHOT, "opened", (SECOND,)))
    presenter._show_event(Event(EventKind.SHOT, "opened", (FIRST,)))
    assert panels.table.numbers == [SECOND] and panels.tabs.currentIndex() == Layout.SHOT  # the first of a folder
    opened, declined = [], []
    monkeypatch.setattr(presenter, "open_paths", opened.append)
    monkeypatch.setattr(window.workbench.session, "dismiss", declined.append)
    paths = (Path("/data/a"), Path("/data/b"))
    for _ in range(2):
        presenter._show_event(Event(EventKind.UNLISTED, "2 recordings", paths=paths))
        panels.work.notices._done() if not opened else panels.work.notices.next()
    assert opened == [list(paths)] and declined == [[str(path) for path in paths]]


def test_a_shot_of_the_rig_is_listed_at_once_and_comes_to_the_front_from_live(window, monkeypatch):
    presenter, panels, session = window.session_presenter, window.panels, window.workbench.session
    arrived = []
    presenter.arrived.connect(lambda entry: arrived.append(entry.number))
    show(window, Layout.LIVE, FIRST)
    shot = replace(synthetic.shot("run-5"), path="/data/run-5.sigmf-meta")
    waits = CapturedShot(1, "run-5", Path("/data/run-5.sigmf-meta"), None, waits=True)
    presenter.take(waits, stay=False)
    assert [entry.number for entry in session.entries][-1] == 5 and session.entry(5).shot is None
    done = replace(waits, shot=shot, waits=False)
    presenter.take(done, stay=True)
    assert panels.table.numbers == [5] and panels.tabs.currentIndex() == Layout.LIVE and arrived == [5]
    again = CapturedShot(2, "run-6", None, None, replace(shot, name="run-6", path=None), "the disk is full")
    presenter.take(again, stay=False)
    assert panels.table.numbers == [6] and panels.tabs.currentIndex() == Layout.SHOT
    assert _said(window) == ["bad: run-6: the disk is full"]
    window.pull()
    assert "Shot 6 is saved: restitution 0.987" in panels.banner.detail.text()
    panels.tabs.setCurrentIndex(Layout.BUDGET)
    panels.table.select([1, 2])
    presenter.take(CapturedShot(3, "run-7", None, None, None, "it was stopped"), stay=False)
    assert panels.table.numbers == [1, 2] and panels.tabs.currentIndex() == Layout.BUDGET  # whoever reads stays there
    assert session.entry(7).shot.problem == "it was stopped: analyse it again (Ctrl+R)"
    fit = replace(shot, fit=None, fit_problem="too slow")
    presenter.take(replace(done, shot=fit, fitted_later=True), stay=False)  # nobody waits for that fit
    assert arrived == [5, 6, 7]
    _said(window)


def test_files_are_opened_mapped_or_refused_by_what_they_are(window, calls, tmp_path, monkeypatch):
    presenter, asked = window.session_presenter, []
    monkeypatch.setattr(
        window.workbench, "open_paths", lambda paths: asked.append([p.name for p in paths]) or len(paths)
    )
    wanted = []
    presenter.mapping_wanted.connect(lambda paths: wanted.append([path.name for path in paths]))
    for name in ("a.sigmf-meta", "b.txt.zip", "beats.wav", "motion.csv", "motion.toml"):
        (tmp_path / name).write_text("x")
    files = [tmp_path / name for name in ("a.sigmf-meta", "b.txt.zip", "beats.wav", "motion.csv")]
    presenter.open_paths(files)
    assert asked == [["a.sigmf-meta", "motion.csv"]] and presenter._choose_next
    QTest.qWait(1)
    assert ["beats.wav"] in wanted and is_unmapped(tmp_path / "beats.wav") and not is_unmapped(tmp_path / "motion.csv")
    (refused,) = _said(window)
    assert refused.startswith("bad: b.txt.zip is not a recording (they end in .sigmf-meta, .sigmf-data, .csv, .toml")
    assert window._store.recent[:2] == [tmp_path / "a.sigmf-meta", tmp_path / "b.txt.zip"]
    assert presenter._dialogs.folder == tmp_path
    presenter.open_paths([])
    assert len(asked) == 1
    window.mapping_presenter._waiting.clear()
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(files[0])), QUrl("http://far/away")])
    window.dropEvent(QDropEvent(QPointF(5, 5), Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, _NONE))
    assert asked[1] == ["a.sigmf-meta"]
    for mime, taken in ((data, True), (QMimeData(), False)):
        event = QDragEnterEvent(
            QPointF(5, 5).toPoint(), Qt.DropAction.CopyAction, mime, Qt.MouseButton.LeftButton, _NONE
        )
        event.ignore()
        window.dragEnterEvent(event)
        assert event.isAccepted() is taken
    settle(window)


_NONE = Qt.KeyboardModifier.NoModifier


def test_what_was_open_lately_is_opened_again_from_its_menu(window, calls, tmp_path):
    presenter = window.files_presenter
    (tmp_path / "run.json").write_text('{"schema": "levimass.session/1", "shots": []}')
    (tmp_path / "a.sigmf-meta").write_text("x")
    window._store.remember_recent([tmp_path / name for name in ("gone.csv", "run.json", "a.sigmf-meta")])
    presenter.recent.aboutToShow.emit()
    assert presenter.recent.isEnabled()
    actions = presenter.recent.actions()
    assert [action.text() for action in actions[:3]] == ["gone.csv", "run.json", "a.sigmf-meta"]
    assert actions[0].toolTip() == str(tmp_path / "gone.csv")
    for action in actions[:3]:
        action.trigger()
    assert calls[0].startswith("workbench.open_session(") and calls[1].startswith("workbench.open_paths(")
    assert _said(window)[-1] == f"bad: {tmp_path / 'gone.csv'} no longer exists"


def test_a_named_session_names_the_window_and_its_folder_is_asked_first(window, calls, monkeypatch, tmp_path):
    presenter = window.files_presenter
    presenter.open_named(tmp_path / "run-3.json")
    assert window.windowTitle() == "run-3 – Levimass" and window._store.settings.session == str(tmp_path / "run-3.json")
    assert _said(window) == [f"good: Session {tmp_path / 'run-3.json'}: 4 shots"]
    monkeypatch.setattr(window.workbench, "open_session", lambda path: "another window has it open")
    presenter.open_named(tmp_path / "other.json")
    assert _said(window) == ["bad: another window has it open"] and window.windowTitle() == "run-3 – Levimass"
    monkeypatch.setattr(window.workbench.session, "path", tmp_path / "run-3.json")
    assert presenter._folder() == tmp_path
    window._store.change({"session": ""})
    assert presenter._folder() == window._store.start_folder
    presenter.usual_session()
    assert window.windowTitle() == "Levimass" and window._store.settings.session == ""
    _said(window)


def test_a_fit_is_held_against_the_model_file_in_use(tmp_path):
    shot = synthetic.shot()
    known = write_model(tmp_path / "m.toml", shot.fit, [shot], None, ())
    stiff = shot.fit.parameters["plate_stiffness_n_per_m"]
    far = shot.fit.parameters | {"plate_stiffness_n_per_m": Quantity(stiff.value + 1.0, stiff.std)}
    assert _agreement(None, shot.fit, False) == ("", Tone.NEUTRAL) == _agreement(known, None, False)
    assert _agreement(known, shot.fit, False) == ("agrees with the model file", Tone.GOOD)
    words, tone = _agreement(known, replace(shot.fit, parameters=far), False)
    assert words == "differs from the model file: plate stiffness +23.6 σ" and tone is Tone.WARNING
    assert _agreement(known, replace(shot.fit, model="contact"), False) == (
        "the model file has base model paper, this fit has contact", Tone.WARNING,
    )  # fmt: skip
    assert _agreement(None, None, True)[1] is Tone.WARNING and "earlier model" in _agreement(known, shot.fit, True)[0]


def test_a_model_file_makes_its_base_that_of_the_next_shots(window, tmp_path):
    shot = synthetic.shot()
    known = write_model(tmp_path / "m.toml", replace(shot.fit, model="clamped"), [shot], None, ())
    window.workbench.model._loaded = known
    settle(window)
    assert window._store.settings.model == "clamped"
    assert any("next shots is now clamped" in line and line.startswith("neutral") for line in _said(window))
    assert "the model file has base model clamped, this fit has paper" in _known(window, FIRST)
    window._store.change({"model": "paper"})
    window.workbench.model._loaded = None
    settle(window)
    assert _known(window, FIRST) == ""
    _said(window)


def _known(window, number):
    panels = show(window, Layout.SHOT, number)
    return panels.model.known.text() if panels.model.known.isVisible() else ""


def test_a_law_is_saved_and_diagnosed_with_or_refused_in_its_sheet(window, calls, monkeypatch):
    panels, law = window.panels, synthetic.learned_law().effect
    show(window, Layout.DIAGNOSIS, FIRST)
    panels.diagnosis.law_curve.keep_wanted.emit(law)
    assert panels.law.isVisible() and panels.law.name.text() == "law_exponential"
    panels.law.save.click()
    settle(window)
    assert not panels.law.isVisible() and calls == ["workbench.diagnose([1])"]
    (words,) = _said(window)
    assert words.startswith("good: The law 'law_exponential' is saved in ") and words.endswith(
        "and tried in every diagnosis"
    )
    panels.diagnosis.next_steps.law_wanted.emit()
    assert panels.law.isVisible()
    panels.law.save.click()
    assert "law_exponential" in panels.law.said.text() and panels.law.said.property("tone") == "bad" and len(calls) == 1
    window.panels.law.toggle()
    assert not panels.law.isVisible()


def test_effects_are_tried_and_removed_and_a_diagnosis_is_cancelled(window, calls, monkeypatch):
    panels = show(window, Layout.DIAGNOSIS, FIRST, SECOND)
    page, stopped = panels.diagnosis, []
    monkeypatch.setattr(window.workbench.jobs, "cancel", lambda *kinds: stopped.append(kinds))
    page.effects.remove_wanted.emit(TILT)
    page.next_steps.try_wanted.emit(DRAG)
    page.cancel.click()
    assert calls == [
        "workbench.model.remove(paper, a tilt of the guideway)",
        "workbench.model.add_tried(paper, quadratic drag on the block)",
    ]  # fmt: skip
    assert stopped == [("diagnosis",), ("plan",)]
    panels.work.cancel.clicked.emit()
    assert stopped[-1] == ()
    monkeypatch.setattr(window.workbench, "diagnose", lambda numbers: f"why not {numbers}")
    window.diagnosis_presenter.diagnose()
    assert page.sentence.text() == "why not [1, 2]"


def test_what_runs_is_said_on_the_page_of_the_diagnosis(window, monkeypatch):
    page, jobs = show(window, Layout.DIAGNOSIS, FIRST).diagnosis, window.workbench.jobs
    job = SimpleNamespace(name="diagnosis of shot 1", kind="diagnosis", what="fit 2 of 5", fraction=0.25)
    parts = {}
    cases = {
        "a diagnosis": (job, 0), "one that begins": (replace_of(job, what=""), 0),
        "a plan": (replace_of(job, kind="plan", name="next shot"), 0),
        "other work before it": (replace_of(job, kind="open", name="a.csv"), 1),
        "other work": (replace_of(job, kind="open", name="a.csv"), 0), "none": (None, 0),
    }  # fmt: skip
    for name, (current, waiting) in cases.items():
        monkeypatch.setattr(jobs, "current", current)
        monkeypatch.setattr(jobs, "waiting", lambda *kinds, waiting=waiting: waiting)
        window.diagnosis_presenter.refresh()
        parts[name] = [*(line for line in of(page) if "hover" not in line)][:7]
        parts[name].append(f"MODEL may diagnose: {window.panels.model.diagnose.isEnabled()}")
    check("diagnosis-running", parts)


def replace_of(job, **changes):
    return SimpleNamespace(**(vars(job) | changes))


def test_what_closing_would_lose_is_said_once_for_each_item(window, monkeypatch):
    monkeypatch.setattr(window.workbench, "close", lambda: None)
    waiting = {"open": 0, "diagnosis": 0}
    monkeypatch.setattr(window.workbench.jobs, "waiting", lambda *kinds: waiting[kinds[0]])
    cases = {
        "nothing": (quiet(), 0, 0), "unsaved": (quiet(unsaved=("a", "b")), 0, 0),
        "one unsaved": (quiet(unsaved=("a",)), 0, 0),
        "arming": (quiet(state=State.ARMING), 0, 0), "armed": (quiet(state=State.ARMED), 0, 0),
        "triggered": (quiet(state=State.TRIGGERED), 0, 0), "recording": (quiet(state=State.TRANSFERRING), 0, 0),
        "analysing": (quiet(state=State.ANALYSING), 0, 0), "files": (quiet(), 1, 0), "more files": (quiet(), 3, 1),
    }  # fmt: skip
    parts = {}
    for name, (snapshot, files, work) in cases.items():
        waiting.update({"open": files, "diagnosis": work})
        parts[name] = [f"{key}: {words}" for key, words in window._unsaved_items(snapshot).items()]
    check("at-stake", parts)


def test_the_pace_is_quick_while_something_happens_and_slow_else(window, monkeypatch):
    show(window, Layout.BUDGET, FIRST)
    busy = CapturedShot(1, "a", None, None, waits=True)
    assert window._pace_ms(quiet()) == 140 and window._pace_ms(quiet(state=State.ARMED)) == 35
    assert window._pace_ms(quiet(captured=(busy,))) == 35
    window.panels.tabs.setCurrentIndex(Layout.LIVE)
    assert window._pace_ms(quiet()) == 100
    show(window, Layout.SHOT, FIRST)
    window.panels.setup.show()
    assert window._pace_ms(quiet()) == 100
    window.panels.setup.hide()
    monkeypatch.setattr(type(window.workbench.short_jobs), "open_jobs", property(lambda _: 1))
    assert window._pace_ms(quiet()) == 35


def test_the_trigger_is_signalled_once_a_shot_as_chosen(window, monkeypatch):
    beeps, flashes = [], []
    monkeypatch.setattr(QApplication, "beep", lambda: beeps.append(1))
    monkeypatch.setattr(window.panels.banner, "flash", lambda: flashes.append(1))
    states = [
        quiet(state=State.ARMED), quiet(state=State.TRIGGERED), quiet(state=State.TRANSFERRING),
        quiet(state=State.ANALYSING, shots=1), quiet(state=State.ARMED, shots=1), quiet(state=State.IDLE, shots=2),
    ]  # fmt: skip
    for sound, flash in ((False, False), (True, False), (False, True)):
        window._store.change({"sound": sound, "flash": flash})
        window.rig_presenter._before = (State.IDLE, 0)
        for snapshot in states:
            window.rig_presenter._signal_trigger(snapshot)
    assert (len(beeps), len(flashes)) == (2, 2)  # the second came and went between two refreshes
    window._store.change({"sound": False, "flash": False})


def test_the_set_up_looks_for_devices_judges_and_arms(window, calls, monkeypatch):
    setup, panels = window.setup_presenter, window.panels
    found = (FoundDevice("hantek6022", "Hantek", "USB 1-2", "no permission", "install the rule"),)
    asked = []
    monkeypatch.setattr(setup, "_find", lambda: asked.append(1) or found)
    panels.work.setup.click()
    assert panels.setup.isVisible() and not panels.setup.look.isEnabled()
    settle(window, lambda: not setup._looking)
    assert panels.setup._found.text() == "1 device found" and panels.setup.look.isEnabled()
    assert window.rig._found == (("hantek6022", "Hantek, USB 1-2"),)
    panels.setup.look.click()
    settle(window, lambda: not setup._looking)
    assert len(asked) == 2

    def without_bus():
        raise DigitizerError("no bus", "reboot")

    monkeypatch.setattr(setup, "_find", without_bus)
    setup.look()
    settle(window, lambda: not setup._looking)
    assert panels.setup._found.text().endswith("The search for devices failed: no bus; reboot")
    monkeypatch.setattr(window.rig, "can_arm", lambda _: False)
    setup._judged_s = 0.0
    window.pull()
    assert not panels.setup.arm.isEnabled()
    monkeypatch.setattr(window.rig, "can_arm", lambda _: True)
    setup._judged_s = 0.0
    window.pull()
    assert panels.setup.arm.isEnabled()
    panels.setup.arm.click()
    assert not panels.setup.isVisible() and calls[-1] == "rig.arm()"
    setup.toggle_setup()
    panels.setup.address.setText("10.0.0.9")
    panels.setup.use_address.click()
    assert calls[-1] == "rig.open(scpi:10.0.0.9)" and panels.setup.address.text()
    monkeypatch.setattr(type(window.rig), "opened", property(lambda _: "scpi:10.0.0.9"))
    window.pull()
    assert panels.setup.address.text() == "" and window._store.settings.network_sources[0] == "scpi:10.0.0.9"
    panels.setup.address.setText("a b")
    panels.setup.use_address.click()
    assert panels.setup.refusal.isVisible()
    setup.toggle_setup()
    assert not panels.setup.isVisible()
    window._store.change({"network": ""})
    settle(window)


def test_before_a_source_is_open_the_set_up_says_what_it_waits_for(window, monkeypatch):
    setup = window.setup_presenter
    assert setup._verdicts(quiet(signal=replace(quiet().signal, channels=())))[1].startswith("No samples yet.")
    monkeypatch.setattr(type(window.rig), "rate_hz", property(lambda _: None))
    assert setup._verdicts(quiet()) == ((), "opening the source …")
    assert setup._verdicts(quiet(message="no device")) == ((), "no device")


def test_the_paper_is_asked_once_a_shot_and_why_it_failed_is_said(window, monkeypatch):
    jobs, made = window.workbench.jobs, []
    submit = jobs.submit
    monkeypatch.setattr(jobs, "submit", lambda *given: made.append(given[0]) or submit(*given))
    panels = show(window, Layout.PAPER, FIRST)
    window.pull()
    assert made == ["the paper"] and panels.paper.table.topLevelItemCount() > 0

    def fails(_):
        raise ValueError("it does not end")

    monkeypatch.setattr("app.window.presenters.selection.reproduce", fails)
    show(window, Layout.PAPER, SECOND)
    assert panels.paper.said.text() == "not computed: it does not end; choose another shot to try again"
    assert made == ["the paper", "the paper"]


def test_why_no_shot_is_shown(window):
    panels, why = show(window, Layout.SHOT, FIRST, SECOND), window.selection_presenter._why_none
    panels.table.filter.setText("nothing like it")
    assert why() == "The filter hides the selected shots 1, 2."
    panels.table.filter.setText("")
    assert panels.table.numbers == [FIRST, SECOND]
    panels.table.select([FIRST])
    panels.table.filter.setText("nothing like it")
    assert why() == "The filter hides the selected shot 1."
    panels.table.filter.setText("")
    panels.table.select([])
    assert why() == "No shot is selected: click one in the list below."
    panels.table.select([1, 2, 3, 4])
    window.session_presenter.remove_selected()
    settle(window)
    assert why() == "" and "Press ARM" in panels.shot._empty.text()


def test_a_session_that_cannot_be_saved_is_said_until_it_is_again(window, monkeypatch):
    session = window.workbench.session
    session.save_problem = "the disk is full"
    session.revision += 1
    window.pull()
    assert _said(window)[0].startswith("bad: the disk is full")
    session.save_problem = None
    session.revision += 1
    window.pull()
    assert _said(window) == ["good: The session is saved again"]


def test_live_is_drawn_only_while_it_is_in_view(window, monkeypatch):
    watched, drawn = [], []
    monkeypatch.setattr(window.rig, "watch", lambda curves, *, switch: watched.append((curves, switch)))
    monkeypatch.setattr(window.panels.live, "show_live", drawn.append)
    monkeypatch.setattr(window.panels.live, "show_raw", lambda *_: None)
    views = [replace(empty_view(), problem=str(n)) for n in range(2)]
    for page, view in ((Layout.BUDGET, 0), (Layout.LIVE, 0), (Layout.LIVE, 0), (Layout.LIVE, 1)):
        window.panels.tabs.setCurrentIndex(page)
        monkeypatch.setattr(window.rig, "latest", lambda view=view: quiet(live=views[view]))
        window.rig_presenter.refresh()
    assert watched == [(False, False), *[(True, False)] * 3]  # steps are counted for the set-up
    assert [view.problem for view in drawn] == ["0", "1"]
