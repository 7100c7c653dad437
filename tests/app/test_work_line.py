"""Messages at the foot of the window: the newest first, none twice, each with its age; how long work still takes."""

import pytest
from PySide6.QtGui import QGuiApplication

from app.session.jobs import Job, Jobs
from app.window.controls.theme import MARKS, Tone
from app.window.panels import work_line
from app.window.panels.work_line import KEPT, LISTED, NoticeLine, NoticeList, WorkLine, _remaining


@pytest.fixture
def line(qtbot):
    one = NoticeLine()
    qtbot.addWidget(one)
    one.resize(900, 40)
    one.show()
    return one


def _whole(line: NoticeLine) -> str:
    return line._words.accessibleDescription()


def test_the_newest_message_stands_before_the_number_of_others(line) -> None:
    assert line.words == "" and _whole(line) == "" and not line._close.isVisible() and not line._do.isVisible()
    line.say("first", Tone.GOOD)
    assert _whole(line) == f"{MARKS[Tone.GOOD]} first" and line._close.isVisible() and not line._do.isVisible()
    line.say("first", Tone.GOOD)
    assert len(line.history) == 1
    line.say("first", Tone.BAD)
    line.say("second", Tone.BAD)
    assert _whole(line) == f"{MARKS[Tone.BAD]} second   (2 more)" and line.words == "second"
    assert line._words.toolTip() == "second\nfirst\nfirst"
    line.next()
    line.next()
    assert _whole(line) == f"{MARKS[Tone.GOOD]} first"
    line.next()
    line.next()
    assert line.words == _whole(line) == line._words.toolTip() == ""


def test_an_offer_is_done_or_declined_once(line) -> None:
    done: list[str] = []
    line.say("read them?", Tone.WARNING, "Read", lambda: done.append("read"), lambda: done.append("declined"))
    assert line._do.text() == line._do.accessibleName() == "Read" and line._do.isVisible()
    line._do.click()
    assert done == ["read"] and line.words == "" and not line._do.isVisible()
    line.say("read them?", Tone.WARNING, "Read", lambda: done.append("read"), lambda: done.append("declined"))
    line._close.click()
    assert done == ["read", "declined"] and line.words == ""
    line.say("again?", Tone.WARNING, "Again", lambda: None)
    line._close.click()
    assert line.words == ""


def test_an_age_is_told_from_a_minute_on(line, monkeypatch) -> None:
    now = [5000.0]
    monkeypatch.setattr(work_line.time, "monotonic", lambda: now[0])
    line.say("old", Tone.WARNING)
    for later, said in ((59.0, ""), (61.0, "   (1 min ago)"), (3590.0, "   (59 min ago)"), (7300.0, "   (2 h ago)")):
        now[0] = 5000.0 + later
        line._refresh()
        assert _whole(line) == f"{MARKS[Tone.WARNING]} old{said}"
    line.say("old", Tone.WARNING)  # the same once more is new again
    assert _whole(line) == f"{MARKS[Tone.WARNING]} old" and len(line.history) == 1


def test_so_many_messages_are_kept_and_listed(line) -> None:
    for n in range(LISTED + 5):
        line.say(f"message {n}", Tone.GOOD)
    assert _whole(line).endswith(f"({KEPT - 1} more)") and len(line.history) == LISTED
    assert line.history[0][1].words == "message 5"
    for _ in range(KEPT):
        line.next()
    assert line.words == ""


def test_the_list_has_all_of_them_newest_first_and_copies_what_is_chosen(line, qtbot) -> None:
    listed = NoticeList(line)
    qtbot.addWidget(listed)
    line.say("one", Tone.GOOD)
    assert listed.list.count() == 0  # it is closed
    listed._refresh(True)
    listed.show()
    line.say("two", Tone.BAD)
    said = [listed.list.item(row).text() for row in range(listed.list.count())]
    assert [text[8:] for text in said] == [f"  {MARKS[Tone.BAD]} two", f"  {MARKS[Tone.GOOD]} one"]
    assert listed.list.item(0).foreground().color().name() == listed.colours.signs[Tone.BAD].lower()
    listed.copy.click()
    assert QGuiApplication.clipboard().text() == "\n".join(said)
    listed.list.item(1).setSelected(True)
    listed.copy.click()
    assert QGuiApplication.clipboard().text() == said[1]


def test_a_list_without_a_message_says_so(qtbot) -> None:
    line = NoticeLine()
    listed = NoticeList(line)
    qtbot.addWidget(line)
    qtbot.addWidget(listed)
    listed._refresh(True)
    assert [listed.list.item(row).text() for row in range(listed.list.count())] == ["No message yet."]


@pytest.mark.parametrize(
    ("left_s", "said"),
    [(None, ""), (0.2, ", 1 s left"), (89.5, ", 90 s left"), (90.0, ", 2 min left"), (121.0, ", 3 min left")],
)
def test_time_is_told_in_seconds_below_a_minute_and_a_half(left_s, said, monkeypatch) -> None:
    monkeypatch.setattr(Job, "remaining_s", lambda self: left_s)
    assert _remaining(object.__new__(Job)) == said


def test_progress_is_that_of_the_job_else_of_the_digitizer(qtbot) -> None:
    shown = WorkLine()
    qtbot.addWidget(shown)
    shown.resize(2000, 40)
    shown.show()
    jobs = Jobs()

    def state() -> tuple[bool, bool, str, int]:
        return shown.progress.isVisible(), shown.cancel.isVisible(), shown.progress.format(), shown.progress.value()

    try:
        shown.show_work(jobs, None, None)
        assert state()[:2] == (False, False)
        shown.show_work(jobs, "transferring", 0.25)
        assert state() == (True, False, "transferring", 250)
        shown.show_work(jobs, "waiting", None)
        assert state() == (True, False, "waiting", 0)
        shown.show_work(jobs, None, None)
        assert state()[:2] == (False, False)
    finally:
        jobs.close()
