"""The window driven as a person would: by keys and buttons, on the simulated bench."""

import csv
import json
import pickle
import threading
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from shutil import copyfile

import pytest
from PySide6.QtCore import QEvent, QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent, QKeyEvent
from PySide6.QtWidgets import QLineEdit, QPushButton

from app.window import main_window
from app.window.controls.widgets import Sheet
from app.window.main_window import open_window
from app.window.panels.layout import Layout
from instrument.bench.simulated_shots import simulate
from instrument.capture.acquisition import State
from tests.app import rigs
from tests.app.on_screen import effect_button, read_entries

WAIT_MS = 60_000


@pytest.fixture
def opened(qtbot, tmp_path, warm_kernels):
    """Return a function that opens a window; at the end every one is closed and no thread is left."""
    windows = []

    def make(open_digitizer=rigs.quick_bench, settings=None):
        chosen = {"levimass_settings": 1, "folder": str(tmp_path / "data"), "duration_s": 0.12} | (settings or {})
        chosen = {"edge": "rising"} | chosen  # armed with the block behind the switch: wait for the next push
        (tmp_path / "settings.json").write_text(json.dumps(chosen))
        window = open_window(tmp_path, open_digitizer, apart=False)
        qtbot.addWidget(window)
        windows.append(window)
        window.show()
        window.activateWindow()
        qtbot.waitUntil(window.isActiveWindow, timeout=WAIT_MS)
        return window

    yield make
    for window in windows:
        if not window.close():  # armed, or at work: it asks once
            window.close()
    for thread in threading.enumerate():
        if thread.name == "levimass fit":  # a fit that was given up ends by itself, a moment later
            thread.join(WAIT_MS / 1e3)
    left = [thread.name for thread in threading.enumerate() if thread.name.startswith("levimass")]
    print("\n".join(map(str, left)))
    assert left == []


def _ready(qtbot, window):
    qtbot.waitUntil(lambda: window.panels.controls.arm.isEnabled() and window.rig.channels != (), timeout=WAIT_MS)


def test_a_whole_shot_by_keys_from_arming_to_the_exported_file(opened, qtbot, tmp_path):
    window = opened()
    window.resize(1600, 950)  # the tab of SHOT bears its number where there is room
    panels = window.panels
    _ready(qtbot, window)
    qtbot.keyClick(window, Qt.Key.Key_Space)
    words = set()

    def taken():
        words.add(panels.banner.word.text())
        return len(read_entries(window.workbench.session)) == 1

    qtbot.waitUntil(taken, timeout=WAIT_MS)
    assert "ANALYSING" in words
    assert words & {"ARMED", "CAPTURED"}  # a busy machine may show no frame before the bench's switch fires
    entry = window.workbench.session.entries[0]
    assert entry.shot.problem is None
    assert entry.shot.impact.cor_quasi_static.value == pytest.approx(0.98756, abs=2e-3)
    assert panels.tabs.currentIndex() == Layout.SHOT
    assert panels.tabs.tabText(Layout.SHOT) == "SHOT 1"
    assert panels.numbers.values["quasi-static"].text().startswith("0.98")
    qtbot.waitUntil(lambda: "restitution 0.98" in panels.banner.detail.text(), timeout=WAIT_MS)
    for key, view in zip("23451", ("contact", "deflection", "gap", "raw", "whole"), strict=True):
        qtbot.keyClick(window, getattr(Qt.Key, f"Key_{key}"))
        assert panels.shot.view == view
    qtbot.keyClick(window, Qt.Key.Key_C)
    assert panels.shot.stack.cursors.shown
    assert "B-A" in panels.shot.stack.cursors.text()
    window.workbench.exports.export(window.panels.table.numbers, tmp_path / "csv")
    qtbot.waitUntil(lambda: (tmp_path / "csv" / "shots.csv").exists(), timeout=WAIT_MS)
    with (tmp_path / "csv" / "shots.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert float(row["cor_quasi_static"]) == pytest.approx(entry.shot.impact.cor_quasi_static.value)


def test_live_moves_before_arming_and_the_signal_line_answers(opened, qtbot):
    window = opened()
    _ready(qtbot, window)
    panels = window.panels
    qtbot.waitUntil(lambda: panels.live.numbers["velocity"].text() != "–", timeout=WAIT_MS)
    seen = set()

    def moved():
        seen.add(panels.live.numbers["velocity"].text())
        return len(seen) > 5

    qtbot.waitUntil(moved, timeout=WAIT_MS)
    qtbot.waitUntil(lambda: "MHz" in panels.signals.values["pd0"].text(), timeout=WAIT_MS)
    assert "MHz" in panels.signals.values["pd1"].text()
    assert "free" in panels.signals.values["disk"].text()


def test_abort_brings_back_ready_and_keeps_no_shot(opened, qtbot):
    window = opened(rigs.still_bench)
    _ready(qtbot, window)
    qtbot.keyClick(window, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "ARMED", timeout=WAIT_MS)
    assert not window.panels.controls.source.isEnabled()
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "READY", timeout=WAIT_MS)
    assert window.workbench.session.entries == ()


def test_a_fault_says_what_happened_what_was_saved_and_what_to_do(opened, qtbot):
    bench = rigs.UnpluggedBench(patient=True, push_every_s=0.0)
    window = opened(lambda _: bench)
    _ready(qtbot, window)
    qtbot.keyClick(window, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "ARMED", timeout=WAIT_MS)
    bench.pulled = True
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "FAULT", timeout=WAIT_MS)
    said = window.panels.banner.detail.text()
    assert "unplugged" in said and "No shot was lost" in said and "Plug it in" in said
    bench.pulled = False
    qtbot.keyClick(window, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "ARMED", timeout=WAIT_MS)


def test_a_source_that_cannot_be_opened_is_a_fault_and_another_can_be_chosen(opened, qtbot):
    devices = {"bench": rigs.no_device, "other": rigs.still_bench}
    window = opened(lambda name: devices[name](name))
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "FAULT", timeout=WAIT_MS)
    assert "no Hantek 6022 found".capitalize()[:2] in window.panels.banner.detail.text()
    window.panels.controls.source_wanted.emit("other")
    qtbot.waitUntil(lambda: window.rig.channels != () and window.panels.banner.word.text() == "READY", timeout=WAIT_MS)


def test_spoilt_settings_and_session_do_not_stop_the_start(opened, qtbot, tmp_path):
    (tmp_path / "session.json").write_text("{")
    window = opened(settings={"moving_mass_kg": "heavy"})
    _ready(qtbot, window)
    assert "could not be" in window.panels.work.notices.words


def test_closing_while_armed_and_while_a_shot_comes_in_ends_every_thread(opened, qtbot):
    window = opened(rigs.still_bench)
    _ready(qtbot, window)
    qtbot.keyClick(window, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "ARMED", timeout=WAIT_MS)
    qtbot.keyClick(window, Qt.Key.Key_T)
    qtbot.waitUntil(lambda: window.rig.latest().state is not State.ARMED, timeout=WAIT_MS)
    window.close()


def test_recordings_are_opened_by_dropping_them_and_a_broken_one_says_why(opened, qtbot, recordings, tmp_path):
    window = opened(rigs.idle_bench)
    broken = tmp_path / "broken.sigmf-meta"
    broken.write_text("{")
    for file in (recordings / "plain").glob("shot-1.*"):  # a copy: the note is written into it
        copyfile(file, tmp_path / file.name)
    paths = [tmp_path / "shot-1.sigmf-meta", broken]
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    event = QDropEvent(
        QPointF(5, 5), Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    )
    window.dropEvent(event)
    qtbot.waitUntil(lambda: len(read_entries(window.workbench.session)) == 2, timeout=WAIT_MS)
    good, bad = window.workbench.session.entries
    assert good.shot.impact is not None
    assert "broken" in bad.shot.problem
    window.panels.table.select([1])
    window.panels.table.model.setData(window.panels.table.model.index(0, 11), "clean plate")
    assert window.workbench.session.entry(1).note == "clean plate"
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert window.workbench.session.entry(1).note == ""


def test_settings_are_refused_in_words_and_kept_when_right(opened, qtbot, tmp_path):
    window = opened(rigs.idle_bench)
    sheet = window.panels.settings
    qtbot.keyClick(window, Qt.Key.Key_F2)
    assert sheet.isVisible()
    sheet._editors["moving_mass_kg"].setText("-3")
    sheet.apply()
    assert "outside" in sheet.problem.text()
    sheet._editors["moving_mass_kg"].setText("18.5")
    sheet._editors["temperature_c"].setText("20")
    sheet.apply()
    assert "pressure" in sheet.problem.text()
    sheet._editors["temperature_c"].setText("")
    sheet.apply()
    assert json.loads((tmp_path / "settings.json").read_text())["moving_mass_kg"] == pytest.approx(0.0185)
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert not sheet.isVisible()


def test_every_key_of_the_sheet_is_bound_to_something(opened, qtbot):
    window = opened(rigs.idle_bench)
    window.resize(1480, 920)
    qtbot.keyClick(window, Qt.Key.Key_F1)
    assert window.panels.keys.isVisible()
    qtbot.waitUntil(lambda: window.panels.keys.height() > 600)
    assert window.panels.keys._scroll.verticalScrollBar().maximum() == 0  # all there at once
    qtbot.keyClick(window, Qt.Key.Key_F1)
    assert not window.panels.keys.isVisible()


def test_two_shots_are_diagnosed_reported_and_the_effect_joins_the_model(opened, qtbot, tmp_path):
    effect = {"quadratic_drag": {"coefficient_n_s2_per_m2": 2e-3}}
    paths = simulate(tmp_path / "drag", 2, 5, effect)
    window = opened(rigs.idle_bench)
    window.session_presenter.open_paths([Path(path) for path in paths])
    qtbot.waitUntil(lambda: len(read_entries(window.workbench.session)) == 2, timeout=WAIT_MS)
    window.panels.table.select([1, 2])
    qtbot.keyClick(window, Qt.Key.Key_D)
    assert window.panels.tabs.currentIndex() == Layout.DIAGNOSIS
    qtbot.waitUntil(lambda: window.workbench.diagnoses.newest is not None, timeout=3 * WAIT_MS)
    found = window.workbench.diagnoses.newest.diagnosis
    assert pickle.loads(ForkingPickler.dumps(found)).sentence == found.sentence  # it may come from another process
    qtbot.waitUntil(lambda: window.panels.diagnosis.sentence.text() == found.sentence, timeout=WAIT_MS)
    assert [named.name for named in found.effects] == ["quadratic_drag"]
    assert "quadratic drag" in window.workbench.session.entries[0].verdict
    before = window.workbench.session.entries[0].shot.fit.reduced_chi2
    effect_button(window.panels.diagnosis.effects, "quadratic_drag").click()
    assert window.workbench.session.effects.of("paper") == (found.effects[0].effect,)
    first = window.workbench.session.entries[0].number
    qtbot.waitUntil(
        lambda: window.workbench.session.entry(first).shot.fit.effects == (found.effects[0].effect,), timeout=WAIT_MS
    )
    after = window.workbench.session.entry(first).shot.fit
    assert after.effects == (found.effects[0].effect,)
    assert after.reduced_chi2 < 0.1 * before
    window.workbench.exports.report([], tmp_path / "report.html")
    qtbot.waitUntil((tmp_path / "report.html").exists, timeout=WAIT_MS)


def test_the_trigger_is_heard_and_seen_only_if_asked_for(opened, qtbot, monkeypatch):
    heard = []
    monkeypatch.setattr("app.window.presenters.rig.QApplication.beep", lambda: heard.append(1))
    window = opened()
    flashed = []
    flash = window.panels.banner.flash
    monkeypatch.setattr(window.panels.banner, "flash", lambda: (flashed.append(1), flash()))
    for chosen in (False, True):
        window.rig_presenter._store.change({"sound": chosen, "flash": chosen})
        _ready(qtbot, window)
        count = len(read_entries(window.workbench.session))
        qtbot.keyClick(window, Qt.Key.Key_Space)
        qtbot.waitUntil(lambda count=count: len(read_entries(window.workbench.session)) == count + 1, timeout=WAIT_MS)
        assert (heard, flashed) == (([1], [1]) if chosen else ([], []))
    qtbot.waitUntil(lambda: not window.panels.banner._flashing.isActive(), timeout=WAIT_MS)


def test_live_is_held_still_by_a_key_until_the_next_arming(opened, qtbot):
    window = opened()
    _ready(qtbot, window)
    live = window.panels.live
    qtbot.waitUntil(lambda: live.numbers["velocity"].text() != "–", timeout=WAIT_MS)
    qtbot.keyClick(window, Qt.Key.Key_H)
    held = live.numbers["beat"].text(), live.stack.plots[0].sampled[0].samples
    qtbot.wait(300)
    assert (live.numbers["beat"].text(), live.stack.plots[0].sampled[0].samples) == held
    qtbot.keyClick(window, Qt.Key.Key_Space)
    assert not live.hold.isChecked()


def test_a_session_reopens_at_its_last_shot(opened, qtbot, recordings):
    window = opened(rigs.idle_bench)
    window.session_presenter.open_paths(sorted((recordings / "plain").glob("*.sigmf-meta"))[:2])
    qtbot.waitUntil(lambda: len(read_entries(window.workbench.session)) == 2, timeout=WAIT_MS)
    name = window.workbench.session.entries[-1].name
    window.close()
    again = opened(rigs.idle_bench)
    assert name in again.panels.numbers.title.text()
    qtbot.waitUntil(lambda: again.panels.numbers.values["quasi-static"].text() != "–", timeout=WAIT_MS)


def test_esc_closes_every_sheet_before_it_aborts(opened, qtbot):
    window = opened(rigs.still_bench)
    _ready(qtbot, window)
    panels = window.panels
    sheets = {name: part for name, part in vars(panels).items() if isinstance(part, Sheet)}
    assert {"settings", "setup", "mapping", "law", "about"} <= set(sheets)
    qtbot.keyClick(window, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: panels.banner.word.text() == "ARMED", timeout=WAIT_MS)
    for name, sheet in sheets.items():
        sheet.open_at(None)
        assert sheet.isVisible()
        qtbot.keyClick(window, Qt.Key.Key_Escape)
        assert not sheet.isVisible(), name
    qtbot.wait(200)
    assert panels.banner.word.text() == "ARMED"
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: panels.banner.word.text() == "READY", timeout=WAIT_MS)


def test_closing_while_armed_or_with_recordings_queued_is_asked_once(opened, qtbot, tmp_path):
    window = opened(rigs.still_bench)
    _ready(qtbot, window)
    qtbot.keyClick(window, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "ARMED", timeout=WAIT_MS)
    ended = threading.Event()
    window.workbench.jobs.submit("warm", lambda _, __: ended.wait(WAIT_MS / 1e3), "warm")
    for number in range(3):
        window.workbench.jobs.submit(f"shot-{number}", lambda _, __: None, "open")
    assert not window.close() and window.isVisible()
    words = window.panels.work.notices.words
    assert "armed" in words and "3 recordings still to be opened" in words and "again to quit" in words
    ended.set()
    assert window.close()


def test_a_filter_that_hides_the_shot_in_front_says_so_and_gives_it_back(opened, qtbot, tmp_path):
    for number in (1, 2):
        simulate(tmp_path / f"run-{number}", 1, number)
    window = opened(rigs.idle_bench)
    _ready(qtbot, window)
    table = window.panels.table
    window.session_presenter.open_paths([tmp_path / "run-1", tmp_path / "run-2"])
    qtbot.waitUntil(lambda: len(read_entries(window.workbench.session)) == 2, timeout=WAIT_MS)
    window.workbench.set_note(1, "cold")
    table.select([2])
    window.view_presenter.show_page("SHOT")
    window.pull()
    table.filter.setText("cold")
    assert "filter hides the selected shot 2" in window.panels.shot._empty.text()
    table.filter.setText("")
    assert table.numbers == [2] and window.panels.shot._pages.currentWidget() is window.panels.shot.stack


@pytest.mark.parametrize(("site", "wanted"), [(None, "bench?site=VC-C"), ("VC-A", "bench?site=VC-A")])
def test_the_source_of_the_settings_is_opened_at_the_site(qtbot, tmp_path, warm_kernels, monkeypatch, site, wanted):
    asked = []
    monkeypatch.setattr(main_window, "open_in_subprocess", lambda text: (asked.append(text), rigs.idle_bench(text))[1])
    settings = {"levimass_settings": 1, "folder": str(tmp_path / "data"), "site": "VC-C"}
    (tmp_path / "settings.json").write_text(json.dumps(settings))
    window = open_window(tmp_path, apart=False, site=site)
    qtbot.addWidget(window)
    qtbot.waitUntil(lambda: bool(asked), timeout=WAIT_MS)
    assert asked == [wanted]
    window.close()


def test_enter_presses_the_button_with_the_focus_once_and_other_keys_are_passed_on(opened, qtbot):
    window = opened()
    button, pressed = window.panels.controls.rearm, []
    button.clicked.connect(lambda: pressed.append(1))
    button.setFocus()
    for key, times, taken in ((Qt.Key.Key_Return, 1, True), (Qt.Key.Key_Enter, 2, True), (Qt.Key.Key_F24, 2, False)):
        event = QKeyEvent(QEvent.Type.KeyPress, key, Qt.KeyboardModifier.NoModifier)
        window.keyPressEvent(event)
        assert len(pressed) == times and event.isAccepted() is taken


def test_every_button_and_field_that_acts_at_once_is_connected_to_something(opened):
    window = opened()
    buttons = [b for b in window.findChildren(QPushButton) if not b.isCheckable() and b.group() is None]
    fields = window.findChildren(QLineEdit)
    assert len(buttons) > 30 and len(fields) > 20
    deaf = []
    for widget in buttons + fields:
        meta = widget.metaObject()
        signals = (meta.method(number) for number in range(meta.methodCount()))
        wanted = ("clicked", "returnPressed", "textChanged", "textEdited", "editingFinished")
        if not any(widget.isSignalConnected(s) for s in signals if bytes(s.name()).decode() in wanted):
            deaf.append(widget.accessibleName() or widget.text())
    assert deaf == []
