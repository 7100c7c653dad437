"""A small or a busy screen: messages with a list, low readouts, steady tabs, pages that say what they wait for."""

import time

import pytest
from PySide6.QtCore import QLocale, QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from analysis.uncertainty.gum_budget import combined_uncertainties, with_combined_uncertainty
from app.session.jobs import Job, Jobs
from app.session.session import Session
from app.window.controls.theme import Theme, Tone
from app.window.panels.layout import Layout
from app.window.panels.setup_sheet import SetupSheet
from app.window.panels.work_line import NoticeLine
from app.window.plots.cursors import CursorReadout
from app.words.wording import concise_text
from instrument.devices.doctor import Check, Grade
from tests.app import synthetic
from tests.app.on_screen import check_lines, click_head


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
    assert "ago" not in line._words.whole
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now + 185)
    line._refresh()
    assert line._words.whole.endswith("(3 min ago)")
    line.next()
    line.next()
    panels.messages.open()
    rows = [panels.messages.list.item(row).text() for row in range(panels.messages.list.count())]
    assert [row.partition("  ")[2][2:] for row in rows] == ["saved elsewhere", "the disk is full"]
    assert all(row[2] == ":" for row in rows)


def test_a_message_that_is_too_long_keeps_its_beginning(qtbot):
    line = NoticeLine()
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
        assert jobs.waiting_words(second, "the paper's numbers").startswith("waiting for diagnosis to end")
        assert jobs.waiting_words(first, "it") == "computing it …"
    finally:
        jobs.close()


def test_the_set_up_writes_numbers_as_the_system_does(qtbot):
    before = QLocale()
    QLocale.setDefault(QLocale("de_DE"))
    try:
        sheet = SetupSheet()
        qtbot.addWidget(sheet)
        sheet.show_checks((Check("PD0", Grade.OK, "beat at 2.7300 MHz, 0.45 V (45 % of the range), 41 dB"),))
        assert "2,7300 MHz, 0,45 V" in check_lines(sheet)[0]
    finally:
        QLocale.setDefault(before)


def test_any_number_can_be_a_column_and_is_sorted_by(panels, qtbot):
    session = Session()
    for n, speed in enumerate((0.3, 0.2), 1):
        session.add(synthetic.shot(f"shot-{n}", speed, n))
    table = panels.table
    table.show_session(session)
    names = [column.head for column in table.model.columns]
    wanted = {
        "contact time (ms)",
        "χ²/ν",
        "moving mass (g)",
        "COR impulse ratio",
        "COR kinetic, flights",
        "γ_N (N s/m)",
    }
    assert wanted <= set(names)
    hidden = [names[c] for c in range(len(names)) if table.table.isColumnHidden(c)]
    assert wanted <= set(hidden) and "note" not in hidden
    column = names.index("contact time (ms)")
    table.show_column(column, True)
    cell = table.model.data(table.model.index(0, column))
    assert cell == concise_text(stated_contact(session.entries[0].shot), 1e3)
    assert table.model.data(table.model.index(0, names.index("χ²/ν"))).startswith("1")
    click_head(table.table, column)
    assert "contact time (ms)" in table.as_text().splitlines()[0]


def stated_contact(shot):
    return with_combined_uncertainty(shot.impact.contact_time_s, "contact_time_s", combined_uncertainties(shot))


def test_work_of_more_than_two_seconds_says_how_long_it_still_takes(panels, monkeypatch):
    job = Job("diagnosis", lambda report, cancelled: None, kind="diagnosis", what="fitting", fraction=0.25)
    now = time.monotonic()
    job.started_s = now - 1.0
    assert job.remaining_s() is None
    job.started_s = now - 10.0
    assert job.remaining_s() == pytest.approx(30.0, abs=1.0)
    job.fraction = 0.01
    assert job.remaining_s() is None
    job.fraction = 0.25

    class One:
        current, open_jobs = job, 1

    panels.resize(1900, 900)
    panels.show()
    panels.work.show_work(One(), None, None)
    QTest.qWait(20)
    panels.work.show_work(One(), None, None)
    assert "s left" in panels.work.progress.toolTip()
