"""A small or a busy screen: messages with a list, low readouts, steady tabs, pages that say what they wait for."""

import time

import pytest
from PySide6.QtCore import QLocale, QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication

from app.session.jobs import Jobs
from app.window.layout import Layout
from app.window.panels.notice import NoticeLine
from app.window.panels.setup_sheet import SetupSheet
from app.window.plots.cursor_readout import CursorReadout
from app.window.theme import LIGHT, Theme, Tone
from app.window.waiting import waits_for
from instrument.doctor import Check, Grade
from tests.app import synthetic


@pytest.fixture
def panels(qtbot):
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    return panels


def test_the_wheel_over_the_tabs_changes_no_page(panels, qtbot):
    panels.show()
    bar = panels.tabs.tabBar()
    at = QPointF(bar.rect().center())
    for turn in (-120, 120, -120):
        event = QWheelEvent(
            at, bar.mapToGlobal(at), QPoint(), QPoint(0, turn), Qt.MouseButton.NoButton,
            Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
        )  # fmt: skip
        QApplication.sendEvent(bar, event)
    assert panels.tabs.currentIndex() == Layout.LIVE


def test_messages_have_an_age_and_a_list(panels, monkeypatch):
    line = panels.work.notices
    line.say("the disk is full", Tone.BAD)
    line.say("saved elsewhere", Tone.GOOD)
    assert "ago" not in line._whole
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now + 185)
    line._aged()
    assert line._whole.endswith("(3 min ago)")
    line.next()
    line.next()
    panels.messages.open()
    rows = [panels.messages.list.item(row).text() for row in range(panels.messages.list.count())]
    assert [row.partition("  ")[2][2:] for row in rows] == ["saved elsewhere", "the disk is full"]
    assert all(row[2] == ":" for row in rows)


def test_a_message_that_is_too_long_keeps_its_beginning(qtbot):
    line = NoticeLine(LIGHT)
    qtbot.addWidget(line)
    line.resize(500, 30)
    line.show()
    line.say("The recording is saved and " + "a very long path " * 20, Tone.BAD)
    assert "The recording is saved" in line._words.text() and line._words.text().endswith("…")


def test_on_a_low_window_the_cursors_leave_the_plots_their_room(panels, qtbot):
    panels.resize(960, 500)
    panels.show()
    panels.shot.show_shot(synthetic.shot())
    panels.tabs.setCurrentIndex(Layout.SHOT)
    before = panels.size()
    panels.shot.show_cursors(True)
    qtbot.wait(50)
    assert panels.size() == before and panels.minimumSizeHint().height() <= 500
    assert panels.shot.stack.height() > 100
    panels.resize(1400, 1000)
    panels.shot.stack.cursors.moved.emit()
    readout = next(r for r in panels.shot.findChildren(CursorReadout) if r.isVisible())
    assert "rms" in readout._table.text()


def test_a_page_says_which_work_it_waits_for():
    jobs = Jobs()
    try:
        first = jobs.submit("diagnosis", lambda report, cancelled: time.sleep(0.3), "diagnosis")
        second = jobs.submit("the paper", lambda report, cancelled: None, "paper")
        while jobs.current is None:
            time.sleep(0.001)
        assert waits_for(jobs, second, "the paper's numbers").startswith("waiting for diagnosis to end")
        assert waits_for(jobs, first, "it") == "computing it …"
    finally:
        jobs.close()


def test_the_set_up_writes_numbers_as_the_system_does(qtbot):
    before = QLocale()
    QLocale.setDefault(QLocale("de_DE"))
    try:
        sheet = SetupSheet(LIGHT)
        qtbot.addWidget(sheet)
        sheet.show_checks((Check("PD0", Grade.OK, "beat at 2.7300 MHz, 0.45 V (45 % of the range), 41 dB"),))
        assert "2,7300 MHz, 0,45 V" in sheet.lines[0]
    finally:
        QLocale.setDefault(before)
