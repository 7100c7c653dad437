"""Saving beside the screen: nothing waits for the disk, and the last state is on it at the end."""

import threading
from dataclasses import replace

from analysis.diagnosis.findings.result import Verdict
from app.session.jobs import Saver
from app.session.session import Session
from app.session.verdict_basis import VerdictBasis
from tests.app import synthetic


def test_the_newest_is_saved_and_what_it_replaced_is_not():
    saver, first, done = Saver(), threading.Event(), []
    began = threading.Event()

    def slow() -> None:
        began.set()
        first.wait(10.0)
        done.append(0)

    saver.submit(slow)
    assert began.wait(10.0)
    for number in (1, 2, 3):
        saver.submit(lambda number=number: done.append(number))  # none of them waits
    first.set()
    assert saver.close()
    assert done == [0, 3]


def test_a_session_is_on_disk_when_the_saver_has_ended_and_a_full_disk_is_told(tmp_path):
    path = tmp_path / "folder" / "session.json"
    session, saver = Session(path), Saver()
    session.save_by = saver.submit
    shot = replace(synthetic.bare_shot("shot-1"), path="/data/x.sigmf-meta")
    for number in range(5):
        session.add(replace(shot, note=str(number)))
    assert saver.close()
    assert [entry.note for entry in Session.reopen(path).entries] == ["0", "1", "2", "3", "4"]
    assert session.problem is None

    path.unlink()
    path.mkdir()  # cannot be replaced by a file
    seen = session.revision
    session.save_by = lambda save: save()
    session.set_verdict(1, VerdictBasis((), (), (1,), Verdict.ADEQUATE))
    assert "could not be saved" in (session.problem or "")
    assert session.revision > seen + 1, "who looks at revisions learns of it"
