"""A diagnosis out of its time leaves out what may be left out, says so, and tells what it had found by then."""

import math
import time
from collections.abc import Callable

import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings.result import Verdict
from analysis.diagnosis.findings.result_file import diagnosis_result
from analysis.diagnosis.findings.wording import in_words
from analysis.diagnosis.search import time_limit as module
from analysis.diagnosis.search.time_limit import Limit
from analysis.shot.shot import AnalysisError, Cancelled
from tests.analysis.diagnosis.shots import calm, shots
from tests.law_rigs import LawRig


def _worked(seconds: float) -> None:
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass


def test_work_is_left_out_only_after_its_time() -> None:
    limit = Limit(1.0, calm)
    assert limit.within("early", lambda: "done", "not done") == "done" and limit.left_out == ()

    def endless() -> str:
        while not limit():
            _worked(0.05)
        raise Cancelled

    assert limit.within("endless", endless, "not done") == "not done"
    assert limit.within("late", lambda: "done", "not done") == "not done"
    assert limit.left_out == ("endless", "late")


def test_of_the_time_some_is_left_for_judging_what_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FitTime", lambda *given: given)
    limit = Limit(40.0, calm)
    assert limit._time == (34.0, calm) and limit.seconds == 40.0  # type: ignore[comparison-overlap]


def test_who_asks_to_stop_is_not_out_of_time() -> None:
    limit = Limit(60.0, lambda: True)
    with pytest.raises(Cancelled):
        limit.within("anything", lambda: "done", "not done")
    assert limit.left_out == ()


def test_a_law_that_there_was_no_time_for_is_named_as_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    within = Limit.within

    def once(self: Limit, what: str, work: Callable[[], object], otherwise: object) -> object:
        result = within(self, what, work, otherwise)
        done.append(what)
        return result

    monkeypatch.setattr(Limit, "within", once)
    monkeypatch.setattr(Limit, "__call__", lambda self: bool(done))  # over when the catalogue was compared
    rig = LawRig(on_block=lambda x, _v, _y, _u: -2e-5 * math.exp(-abs(x) / 7e-4), kinks=(lambda x, *_: x,))
    found = diagnose(rig.shots((0.15, 0.3)))
    assert done[0] == "effects of the catalogue"
    assert found.verdict in (Verdict.UNEXPLAINED, Verdict.PARTLY_EXPLAINED) and not found.laws
    assert "one law in the place of effects" in found.not_asked
    assert diagnosis_result(found)["not_asked"] == list(found.not_asked)


def test_without_time_for_the_catalogue_nothing_is_called_adequate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise that is learned without an effect may hold it: five shots with a drag were called adequate so."""
    monkeypatch.setattr(Limit, "__call__", lambda self: True)
    with pytest.raises(AnalysisError, match="no time within 60 s to compare the effects of the catalogue"):
        diagnose(shots({}))


def test_what_is_seen_to_be_missing_is_told_without_time_for_the_catalogue_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Limit, "__call__", lambda self: True)
    found = diagnose(shots({"coulomb_friction": {"force_n": 1e-4}}))
    assert found.verdict is Verdict.UNEXPLAINED and "effects of the catalogue" in found.not_asked
    assert in_words(found).sentence.startswith(
        "Unexplained: the residual is significant and the catalogue was not tried"
    )


def test_what_is_done_in_time_leaves_nothing_out() -> None:
    assert diagnose(shots({})).not_asked == ()
