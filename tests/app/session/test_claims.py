"""Which results are kept for which shots, remainders of candidates, session files, and waiting for what is compiled."""

import os
import sys
import threading
from dataclasses import replace
from types import SimpleNamespace

import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.result import Candidate
from analysis.fitted.fitted_shot import unfitted, with_fit_pending
from analysis.shot.shot import AnalysisSettings, Cancelled
from app.report.exports import motion_file_names
from app.session import candidate_residuals as remainders
from app.session import kernels, load
from app.session.candidate_residuals import CandidateResiduals, by_evidence
from app.session.jobs import JobQueues, ShotJob
from app.session.log import NAME, ProgramLog, note
from app.session.result_archive import kinds
from app.session.result_cache import Key, ResultCache
from app.session.session import Session
from app.session.session_files import is_session, listed_by, unlisted
from app.session.workbench import Workbench
from app.words.flags import flags_in_short
from tests.app import synthetic

DRAG, VISCOUS, FRICTION, TILT = effects_named(("quadratic_drag", "viscous_drag", "coulomb_friction", "tilt"))


def test_files_of_one_name_are_numbered_and_reserved_names_are_kept():
    assert motion_file_names(["a", "A", "a", "shots", "", "../b c", "a-2"]) == [
        "a.csv", "A-2.csv", "a-3.csv", "shots-2.csv", "shot.csv", "b_c.csv", "a-2-2.csv",
    ]  # fmt: skip
    assert len(motion_file_names(["é" * 300])[0].encode()) <= 204


def test_every_uncaught_exception_is_in_the_log_and_a_line_on_the_screen(tmp_path, capsys, monkeypatch):
    log = ProgramLog(tmp_path / "logs")
    log.install()
    try:
        note("said\n  twice")
        for raised in (ValueError("two\n lines"), KeyboardInterrupt(), SystemExit(3)):
            sys.excepthook(type(raised), raised, None)
        thread = threading.Thread(target=lambda: {}["lost"])
        thread.start()
        thread.join()
    finally:
        log.close()
    said = "a fault of the program: {} (see the log: Help, Log folder)"
    assert log.take_problems() == [said.format("ValueError: two lines"), said.format("KeyError: 'lost'")]
    assert log.take_problems() == [] and sys.excepthook is sys.__excepthook__
    text = (tmp_path / "logs" / NAME).read_text()
    assert "INFO said twice\n" in text and text.count("ERROR not caught") == 2 and "KeyError: 'lost'" in text
    (tmp_path / "taken").write_text("")
    blocked = ProgramLog(tmp_path / "taken" / "logs")
    blocked.install()
    blocked.close()
    assert blocked.take_problems()[0].startswith("no log file is written: ")
    assert capsys.readouterr().err.count("ValueError") == 1


def test_flags_in_short_name_the_weightiest_and_count_the_others():
    assert flags_in_short(()) == "" and flags_in_short(["clipped"]) == "clipped"
    assert flags_in_short(["vibration", "clipped"]) == "clipped + 1"
    assert flags_in_short(["vibration", "gap", "clipped"]).endswith("+ 2")


def test_a_diagnosis_is_kept_for_its_shots_whatever_is_in_the_model(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x")
    plain = Key(str(path), AnalysisSettings())
    with_drag = Key(str(path), AnalysisSettings(effects=(DRAG,)))
    assert plain.text != with_drag.text and plain.bare == with_drag.bare == plain.text
    cache = ResultCache(tmp_path / "kept")
    cache.store_diagnosis(synthetic.diagnosis(synthetic.shot(count=9000)), [with_drag])
    (found,) = cache.diagnoses({7: plain})
    assert found.numbers == (7,) and found.version
    assert cache.diagnoses({7: Key(str(tmp_path / "b.csv"), AnalysisSettings())}) == []
    path.write_text("xy")  # another state of the recording
    assert cache.diagnoses({7: plain}) == []


def test_the_kinds_of_a_result_are_dataclasses_and_enumerations_and_no_effect():
    found = kinds()
    assert {"Shot", "Diagnosis", "Motion", "Quantity", "Verdict", "Standing"} <= found.keys()
    assert not {"Effect", "UserLaw", "Row", "ndarray", "float"} & found.keys()
    assert all(name == kind.__name__ for name, kind in found.items())


def test_candidates_stand_in_the_order_of_their_evidence():
    given = [
        Candidate(TILT, 9.0, None), Candidate(DRAG, -3.0, 2.0), Candidate(VISCOUS, 1.0, -50.0),
        Candidate(FRICTION, -20.0, None),
    ]  # fmt: skip
    assert [c.effect for c in by_evidence(given)] == [VISCOUS, DRAG, FRICTION, TILT]


def test_each_candidate_is_fitted_on_top_of_what_was_in_the_model(monkeypatch):
    work = JobQueues(None)
    first, second = synthetic.shot("a", 0.265, 1, count=9000), synthetic.shot("b", 0.2, 2, count=9000)
    asked = []

    def fitted(shots, base, effects, cancelled):
        asked.append((len(shots), base, [e.name for e in effects]))
        parts = tuple(replace(first.fit.shots[0]) for _ in shots)
        return replace(first.fit, shots=parts, effects=effects, converged=effects[-1] != VISCOUS, reduced_chi2=1.7)

    monkeypatch.setattr(remainders, "fit_jointly", fitted)
    one = synthetic.diagnosis(first)
    before = replace(one.fit_before, effects=(TILT,))
    candidates = tuple(Candidate(e, 1.0, bic) for e, bic in ((VISCOUS, -9.0), (FRICTION, -90.0), (TILT, -99.0)))
    found = replace(one, fit_before=before, candidates=candidates)
    why = CandidateResiduals(work)
    why.show(found, [first, synthetic.shot("c", problem="none"), second])
    why.first(VISCOUS)
    why.first(TILT)  # is in the model: it is not wanted

    def run():
        while work.jobs.open_jobs:
            pass
        assert list(work.collect_results()) == []

    ends = []
    for _ in range(10):
        ends.append(why.refresh())
        run()
    assert [of[2] for of in asked] == [
        ["tilt", "viscous_drag"],
        ["tilt", "quadratic_drag"],
        ["tilt", "coulomb_friction"],
    ]
    assert asked[0][:2] == (2, "paper") and ends.count(True) == 3 and not why._wanted
    assert set(why.found) == {VISCOUS, DRAG, FRICTION}
    assert why.found[VISCOUS].left_m is None and len(why.found[DRAG].left_m) == 2
    assert why.found[DRAG].reduced_chi2 == 1.7
    why.show(None, [])
    assert why.found == {} and not why.refresh()
    drive = synthetic.driven_shot()
    why.show(synthetic.diagnosis(drive), [drive])
    assert not why._wanted
    work.close()


def test_work_on_the_shot_in_view_is_begun_once_and_its_result_taken_once():
    queues = JobQueues(None)
    jobs, made, taken = queues.jobs, [], []
    job = ShotJob(jobs, "spectrum", lambda *result: taken.append(result))

    def twice(given):
        return lambda report, stop: made.append(given) or given * 2

    one, two = SimpleNamespace(number=1, name="a"), SimpleNamespace(number=2, name="b")
    assert job.start(one, twice(10)) and not job.start(one, twice(11))
    assert job.job.name == "spectrum of a" and job.job.kind == "spectrum"

    def ended(of):
        assert of.job.done.wait(60)
        return list(queues.collect_results())

    assert ended(job) == [] and taken == [(one, 20)] and not job.start(one, twice(12))
    job.forget()
    assert job.start(one, twice(13))
    job.job.done.wait(60)
    assert job.start(two, twice(14)) and made[:2] == [10, 13]
    job.job.done.wait(60)
    assert ended(job) == [] and taken == [(one, 20), (two, 28)]
    broken = ShotJob(jobs, "raw", lambda *result: taken.append(result))
    assert broken.start(one, lambda *_: 1 / 0)
    assert ended(broken) == ["raw of a: division by zero"] and len(taken) == 2
    assert broken.start(one, lambda *_: 1 / 0)  # it is tried again
    queues.close()


def test_a_fit_that_was_stopped_is_made_as_a_job_and_another_one_is_taken(tmp_path, monkeypatch):
    bench = Workbench(Session(), AnalysisSettings)
    told = []
    monkeypatch.setattr(bench.model, "refit_outdated", lambda also=(): told.append([entry.number for entry in also]))
    monkeypatch.setattr(bench.model, "needs_refit", lambda entry: False)
    shot = synthetic.shot("a", count=9000)
    waiting = with_fit_pending(replace(shot, fit=None, fit_problem=None, path=str(tmp_path / "a.x")))
    assert [bench.add_shot(waiting, of).number for of in (7, 8)] == [1, 2]
    assert bench.take_fit(unfitted(waiting, "given up", stopped=True), 8).number == 2
    assert told == [[2]] and bench.session.entry(2).shot.fit is None
    assert bench.take_fit(replace(shot, path=None), 7).number == 1  # of two shots of one name it is the right one
    assert bench.session.entry(1).shot.fit is not None and bench.session.entry(2).shot.fit is None
    assert bench.session.entry(1).shot.path == str(tmp_path / "a.x") and told == [[2]]
    assert bench.take_fit(shot, 7) is None and bench.take_fit(shot, 9) is None
    bench.close()


def test_a_fit_that_comes_after_the_session_was_changed_is_for_nobody(tmp_path):
    bench = Workbench(Session(tmp_path / "one.json"), AnalysisSettings)
    shot = synthetic.shot("a", count=9000)
    bench.add_shot(with_fit_pending(replace(shot, fit=None, path=str(tmp_path / "a.x"))), 7)
    other = Session(tmp_path / "two.json")
    other.add(with_fit_pending(replace(shot, fit=None, path=str(tmp_path / "b.x"))))  # has the same number
    bench._switch_to(other)
    assert bench.take_fit(shot, 7) is None and bench.session.entry(1).shot.fit is None
    bench.close()


def test_the_same_session_is_not_opened_or_saved_again(tmp_path):
    path = tmp_path / "session.json"
    bench = Workbench(Session(path), AnalysisSettings)
    bench.session.add(replace(synthetic.bare_shot("a"), path="/data/a"))
    before = bench.session.entries
    assert bench.open_session(path) is None and bench.session.entries is before
    assert bench.save_session(path) is None and bench.session.path == path
    assert "no such file" in bench.open_session(tmp_path / "other.json")
    (tmp_path / "other.json").write_text("{}")
    assert "not a Levimass session" in bench.open_session(tmp_path / "other.json") and bench.session.entries is before
    bench.close()
    bench = Workbench(Session(), AnalysisSettings)
    assert bench.open_unnamed_session() == "this window has no session file"
    bench.close()


def test_what_is_a_session_and_what_it_lists(tmp_path):
    session = Session(tmp_path / "a.json")
    session.add(replace(synthetic.bare_shot("x"), path="/data/x"))
    session.dismiss(["/data/y"])
    (tmp_path / "b.json").write_text("{}")
    (tmp_path / "c.txt").write_text((tmp_path / "a.json").read_text())
    assert [is_session(tmp_path / name) for name in ("a.json", "b.json", "c.txt", "d.json")] == [
        True,
        False,
        False,
        False,
    ]
    assert listed_by([tmp_path / "a.json", tmp_path / "b.json", tmp_path / "d.json"]) == {"/data/x", "/data/y"}


def test_recordings_written_before_a_time_and_not_listed_are_found_newest_first(tmp_path, monkeypatch):
    for n in range(5):
        meta = tmp_path / f"s{n}.sigmf-meta"
        meta.write_text("{}")
        os.utime(meta, (1000.0 + n, 1000.0 + n))

    def metadata(path):
        return SimpleNamespace(sha512=None if path.name.startswith("s2") else "hash")

    monkeypatch.setattr("app.session.session_files.read_metadata", metadata)
    found = unlisted(tmp_path, {str(tmp_path / "s1.sigmf-meta")}, 1004.0)
    assert [path.name[:2] for path in found.complete] == ["s3", "s0"]
    assert [path.name[:2] for path in found.cut_off] == ["s2"]
    assert unlisted(tmp_path / "missing", (), 1e12).complete == ()


def test_kernels_are_waited_for_until_they_are_there_or_it_is_given_up():
    made = kernels.Kernels()
    with pytest.raises(Cancelled):
        made.wait(kernels.Stage.FIT, lambda: True)
    made._reached(kernels.Stage.FIT)
    made.wait(kernels.Stage.FIT, lambda: True)
    said = []
    made._report_progress(lambda words, share: said.append((words, share)), "compiling b", 0.3)
    made._reached(kernels.Stage.READINGS)
    made._report_progress(lambda words, share: said.append((words, share)), "compiling b", 0.4)
    assert said == [("compiling the readings, at the first start only", 0.3), ("compiling b", 0.4)]


def test_a_shot_in_memory_has_no_raw_signals():
    entry = SimpleNamespace(path=None)
    assert load.raw_of(entry) is None and load.raw_of(SimpleNamespace(path="/no/such.sigmf-meta")) is None
    assert load.raw_of(SimpleNamespace(path="/no/such.csv")) is None
