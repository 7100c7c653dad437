"""A button, its command in the menu and its key do the same: what is on the screen afterwards is compared."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QFileDialog

from app.window.main_window import MainWindow, open_window
from app.window.panels.layout import Layout
from tests.app import rigs, synthetic

PAIRS = {  # words of a button, and the command
    "Open …": "open_recordings", "Export …": "export:export", "Report …": "export:report",
    "Re-analyse": "reanalyse_selected", "Remove": "remove_selected", "Undo": "undo", "Columns …": "choose_columns",
    "Set-up": "toggle_setup", "Settings": "toggle_settings", "Keys": "toggle:keys", "Budget": "show_page:BUDGET",
    "Evidence": "show_page:DIAGNOSIS", "re-arm": "toggle:controls.rearm",
    "± from noise only": "toggle:numbers.noise_only",
    "Whole shot": "show_view:whole", "First contact": "show_view:contact",
    "Force vs deflection": "show_view:deflection", "Gap": "show_view:gap", "Raw signals": "show_view:raw",
    "Cursors": "on_plot:toggle_cursors", "Save plot …": "on_plot:open_menu", "Diagnose": "diagnose",
}  # fmt: skip


@pytest.fixture(scope="module")
def window(qapp, tmp_path_factory, warm_kernels):
    window = open_window(tmp_path_factory.mktemp("keys"), rigs.still_bench, apart=False)
    window.workbench.session.add(synthetic.bare_shot("kept"))
    window.workbench.session.add(synthetic.shot(count=9000))
    window.show()
    window.pull()
    yield window
    window.close()


def seen(window: MainWindow) -> tuple[object, ...]:
    """Return what a person sees of what commands do."""
    p = window.panels
    popup = QApplication.activePopupWidget()
    return (
        p.tabs.currentIndex(),
        tuple(sheet.isVisible() for sheet in (p.settings, p.setup, p.keys, p.about, p.tour)),
        tuple(sorted(q.windowTitle() for q in window.findChildren(QFileDialog) if q.isVisible())),
        tuple(action.text() for action in popup.actions()) if popup is not None else (),
        (p.controls.rearm.isChecked(), p.live.hold.isChecked(), p.numbers.noise_only.isChecked()),
        (p.shot.view, p.shot.stack.cursors.shown, p.diagnosis.sentence.text(), p.work.notices.words),
        tuple(entry.number for entry in window.workbench.session.entries),
        window.workbench.session.can_undo,
    )


def at_rest(window: MainWindow, command: str) -> None:
    """Bring the window to where every command is tried from."""
    p = window.panels
    while (popup := QApplication.activePopupWidget()) is not None:
        popup.close()
    for question in window.findChildren(QFileDialog):
        question.close()
    for sheet in (p.settings, p.setup, p.keys, p.about, p.tour):
        sheet.hide()
    session = window.workbench.session
    while session.undo() is not None:
        pass
    if command == "undo":
        session.set_note(1, "to be taken back")
    window.workbench.jobs.cancel("diagnosis")
    window.pull()
    p.tabs.setCurrentIndex(Layout.SHOT)
    p.table.select([1] if command == "diagnose" else [2])
    p.shot.set_view("gap" if command == "show_view:whole" else "whole")
    p.shot.show_cursors(False)
    p.controls.rearm.setChecked(False)
    p.numbers.noise_only.setChecked(False)
    p.diagnosis.show_diagnosis(None, [])
    while p.work.notices.words:
        p.work.notices.next()
    p.controls.arm.setFocus()
    QTest.qWait(5)


def button_of(window: MainWindow, words: str) -> QAbstractButton:
    there = [b for b in window.findChildren(QAbstractButton) if b.text() == words and b.isVisible()]
    assert there, words
    return there[0]


@pytest.mark.parametrize(("words", "command"), PAIRS.items(), ids=PAIRS.values())
def test_the_three_ways_lead_to_the_same(window, qtbot, words, command):
    action = window.actions_by_name[command]
    (stroke,) = action.shortcuts()[0]
    ways = (
        lambda: button_of(window, words).click(),
        action.trigger,
        lambda: qtbot.keyClick(window, stroke.key(), stroke.keyboardModifiers()),
    )
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    after = []
    for way in ways:
        at_rest(window, command)
        before = seen(window)
        way()
        QTest.qWait(5)
        window.pull()
        after.append(seen(window))
        at_rest(window, command)
        window.activateWindow()
        qtbot.waitUntil(window.isActiveWindow)
    assert after[0] == after[1] == after[2]
    assert after[0] != before, "nothing happened"


def test_arm_and_abort_by_all_three(window, qtbot):
    panels = window.panels
    qtbot.waitUntil(lambda: panels.controls.arm.isEnabled() and window.rig.channels != (), timeout=60_000)
    names = window.actions_by_name
    for arm, abort in (
        (panels.controls.arm.click, panels.controls.abort.click),
        (names["arm"].trigger, names["abort"].trigger),
        (lambda: qtbot.keyClick(window, Qt.Key.Key_Space), lambda: qtbot.keyClick(window, Qt.Key.Key_Escape)),
    ):
        window.activateWindow()
        qtbot.waitUntil(lambda: window.isActiveWindow() and panels.controls.arm.isEnabled(), timeout=60_000)
        arm()
        qtbot.waitUntil(lambda: panels.banner.word.text() == "ARMED", timeout=60_000)
        abort()
        qtbot.waitUntil(lambda: panels.banner.word.text() == "READY", timeout=60_000)


def test_every_button_that_names_a_key_is_compared_here(window):
    """A new button with a key in its tooltip belongs into the table above."""
    known = set(PAIRS) | {"ARM", "Abort"}
    keys = {QKeySequence(s).toString() for a in window.actions_by_name.values() for s in a.shortcuts()}
    panels = window.panels
    for page in range(panels.tabs.count()):
        panels.tabs.setCurrentIndex(page)
        for button in panels.findChildren(QAbstractButton):
            key = button.toolTip().rpartition("(")[2].rstrip(")")
            if button.isVisible() and QKeySequence(key).toString() in keys and button.text() not in known:
                assert button.text() in ("Hold", "Copy as text", "Whole shot", "First contact", "All …"), button.text()


def test_the_plot_in_front_is_on_the_clipboard_as_a_picture(window):
    at_rest(window, "copy_plot")
    QApplication.clipboard().clear()
    window.actions_by_name["copy_plot"].trigger()
    copied, plot = QApplication.clipboard().image(), window.panels.plot_in_front()
    assert copied.width() == 2 * plot.width() and copied.height() >= 2 * plot.height()
    assert (
        len({copied.pixel(x, copied.height() // 2) for x in range(copied.width())}) > 3
    )  # the curve, not an empty page
