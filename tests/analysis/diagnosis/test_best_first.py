"""What the search does next with either branch, and what each step hands on, without a single fit."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.diagnosis import best_first as module
from analysis.diagnosis.best_first import BestFirst, Branch
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import Verdict
from analysis.inference.noise.site import STILL_FRAME
from analysis.shot import AnalysisError

MOST = CRITERIA.most_effects


class Over:
    """A limit of time that is over where its question says so."""

    seconds = 7.0

    def __init__(self, question: "DiagnosisInput") -> None:
        self._question = question

    def __call__(self) -> bool:
        """Return whether the time is over."""
        return self._question.over


MOVING = SimpleNamespace(moves=True)


class DiagnosisInput:
    """A question whose time is over or not, of shots in a building or at rest."""

    motions, shots, begin, catalogue, accepted, stop = "motions", "shots", "begin", "catalogue", "accepted", "stop"

    def __init__(self, site: Any = MOVING, *, over: bool = False) -> None:
        self.site, self.over, self.told = site, over, []
        self.limit: Any = Over(self)
        self.progress = self.told.append

    def single_law_given(self, start: Any) -> Any:
        """Return the law that may be missing beside a fit."""
        return SimpleNamespace(beside=start, held=("held", start))


def explanation(*, explained: bool, bic: float = 0.0) -> Any:
    verdict = Verdict.ADEQUATE if explained else Verdict.UNEXPLAINED
    return SimpleNamespace(explained=explained, bic=bic, verdict=verdict, trail=None, after="fit")


@pytest.fixture(autouse=True)
def frame_is_calm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "frame_hides_effects", lambda fitted, stop: False)


EXPLAINED, UNEXPLAINED = explanation(explained=True), explanation(explained=False)


def branch(
    bic: float, *, left: bool = True, tried: bool = True, named: Any = None, complete: Any = None, rounds: int = 0,
    compared: bool = True, effects: tuple[str, ...] = ("effect",),
) -> Branch:  # fmt: skip
    start = SimpleNamespace(bic=100.0, problem=SimpleNamespace(data="data"))
    trail = SimpleNamespace(compared=compared, start=start, linearised=lambda fit: ("linear", fit))
    searched: Any = SimpleNamespace(
        best=SimpleNamespace(bic=bic, effects=effects),
        trail=trail,
        leaves_something=left,
        rounds=rounds,
        residual="residual",
    )
    law: Any = SimpleNamespace(held="held by law")
    return Branch(searched, law, tried, named, complete)


def searching(
    building: Branch | None, rest: Branch | None, question: Any = None, *, without_site: bool = False
) -> BestFirst:
    found = BestFirst(question or DiagnosisInput())
    found._in_building, found._at_rest = building, rest
    like: Any = SimpleNamespace(likelier_without_frame_motion=lambda best: without_site)
    found._search = like
    return found


def next_step(*given: Any, **more: Any) -> tuple[str, tuple[Any, ...]]:
    step: Any = searching(*given, **more)._next_step()
    function = getattr(step, "func", step)
    return function.__name__, getattr(step, "args", ())


def test_a_search_begins_in_a_building_where_there_is_one_and_else_at_rest() -> None:
    assert next_step(None, None) == ("_search_in_building", ())
    assert next_step(None, None, DiagnosisInput(STILL_FRAME)) == ("_search_at_rest", ())


@pytest.mark.parametrize(
    ("building", "step"),
    [
        (branch(0.0, left=False), "_name"),
        (branch(0.0, left=False, tried=False, named=EXPLAINED), "_end_with"),
        (branch(0.0, tried=False), "_try_one_law_instead"),
        (branch(0.0, left=False, tried=False, named=UNEXPLAINED), "_try_one_law_instead"),
        (branch(0.0, rounds=2), "_search_on"),
        (branch(0.0, rounds=0), "_search_at_rest"),
        (branch(0.0, rounds=2, named=UNEXPLAINED), "_search_at_rest"),
    ],
)
def test_in_a_building_the_cheap_comes_before_the_dear_and_the_other_noise_last(building: Branch, step: str) -> None:
    given = {"_end_with": (building.named,), "_try_one_law_instead": (building, building), "_search_at_rest": ()}
    assert next_step(building, None) == (step, given.get(step, (building,)))
    ends = step in ("_name", "_end_with")  # which takes no time
    assert next_step(building, None, DiagnosisInput(over=True)) == (
        step if ends else "_complete",
        given.get(step, (building,)) if ends else (building,),
    )


def test_what_is_explained_in_a_building_but_likelier_at_rest_is_searched_at_rest_while_there_is_time() -> None:
    building = branch(0.0, left=False, tried=False, named=EXPLAINED)
    assert next_step(building, None, without_site=True) == ("_search_at_rest", ())
    assert next_step(building, None, DiagnosisInput(over=True), without_site=True) == ("_complete", (building,))


@pytest.mark.parametrize(("promised", "hides"), [(-28.1, True), (-27.9, False)])
def test_a_building_that_explains_all_by_itself_is_asked_for_one_law_that_it_hides(
    promised: float, hides: bool
) -> None:
    """A step of a curve at rest promises to come to a criterion; the building's is 0, and a law must bring 28."""
    question: Any = DiagnosisInput()
    asked: list[float] = []

    def reaches(beat: float) -> bool:
        asked.append(beat)
        return promised < beat

    question.single_law_given = lambda start: SimpleNamespace(of=start, flight_law_may_beat=reaches)
    building = branch(0.0, left=False, named=EXPLAINED, effects=())
    search = searching(building, None, question)
    search._search.base_without_frame_motion = lambda: "at rest"  # type: ignore[method-assign, assignment]
    step: Any = search._next_step()
    assert asked == [-28.0] and getattr(step, "func", step).__name__ == ("_search_at_rest" if hides else "_end_with")
    search._at_rest = branch(50.0, tried=False)
    then: Any = search._next_step()
    assert then.func.__name__ == ("_try_one_law_instead" if hides else "_end_with")

    def nowhere() -> Any:
        raise AnalysisError("no motion comes near")

    search = searching(building, None, question)
    search._search.base_without_frame_motion = nowhere  # type: ignore[method-assign, assignment]
    assert search._next_step().func.__name__ == "_end_with"  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("building", "rest", "step", "of"),
    [
        (None, branch(0.0, tried=False), "_try_one_law_instead", "rest rest"),
        (None, branch(0.0), "_complete", "rest"),
        (None, branch(0.0, left=False, tried=False), "_complete", "rest"),
        (branch(0.0), branch(1.0, left=False, tried=False), "_try_one_law_instead", "rest building"),
        (branch(0.0, left=False), branch(1.0, tried=False), "_name", "building"),
        (branch(0.0), branch(0.0), "_complete", "rest"),  # as likely
        (branch(0.0, compared=False), branch(0.0), "_complete", "rest"),
        (branch(0.0), branch(-9.0, compared=False), "_name", "building"),  # likelier, of which nothing is known
        (branch(0.0), branch(1.0), "_name", "building"),
        (branch(0.0, named=EXPLAINED), branch(1.0), "_end_with", "building.named"),
        (branch(0.0, named=UNEXPLAINED), branch(1.0), "_complete_where_it_may_win", "rest building.named.bic"),
        (
            branch(0.0, named=UNEXPLAINED), branch(1.0, complete=explanation(explained=True, bic=-0.1)),
            "_end_with", "rest.complete",
        ),
        (branch(0.0, named=UNEXPLAINED), branch(1.0, complete=EXPLAINED), "_complete", "building"),
        (
            branch(0.0, named=UNEXPLAINED), branch(1.0, complete=explanation(explained=False, bic=-9.0)),
            "_complete", "building",
        ),
    ],
)  # fmt: skip
def test_of_two_branches_the_likelier_is_carried_on(building: Branch | None, rest: Branch, step: str, of: str) -> None:
    question = DiagnosisInput(STILL_FRAME if building is None else MOVING)
    args = tuple(eval(one, {"building": building, "rest": rest}) for one in of.split())
    assert next_step(building, rest, question) == (step, args)
    question.over = True
    if step == "_complete_where_it_may_win" or "complete" in of:
        assert next_step(building, rest, question) == ("_complete", (building,))
    else:
        assert next_step(building, rest, question) == (step, args)


def test_no_law_is_learned_where_the_frame_moves_too_far_for_its_response(monkeypatch: pytest.MonkeyPatch) -> None:
    building, rest = branch(0.0, named=UNEXPLAINED), branch(1.0)
    assert next_step(building, rest) == ("_complete_where_it_may_win", (rest, building.named.bic))  # type: ignore[union-attr]
    monkeypatch.setattr(module, "frame_hides_effects", lambda fitted, stop: fitted == "fit")
    search = searching(building, rest)
    search._next_step()()
    with pytest.raises(AnalysisError, match="moves so far in contact"):
        search.explanation()


@pytest.mark.parametrize("compared", [True, False])
@pytest.mark.parametrize("verdict", [Verdict.ADEQUATE, Verdict.UNEXPLAINED])
def test_nothing_is_called_adequate_before_the_catalogue_was_compared(verdict: Verdict, compared: bool) -> None:
    answer: Any = SimpleNamespace(verdict=verdict, trail=SimpleNamespace(compared=compared), after="fit")
    search = searching(branch(0.0, left=False, named=EXPLAINED), None)
    search._end_with = lambda explanation: setattr(search, "_answer", answer)  # type: ignore[method-assign]
    if verdict is Verdict.ADEQUATE and not compared:
        with pytest.raises(AnalysisError, match="no time within 7 s"):
            search.explanation()
    else:
        assert search.explanation() is answer
    del search._end_with
    search._end_with(answer)
    assert search._answer is answer


@pytest.mark.parametrize("hidden", [True, False])
@pytest.mark.parametrize("verdict", list(Verdict))
def test_nothing_is_claimed_where_the_frame_moves_too_far_for_its_response(
    monkeypatch: pytest.MonkeyPatch, verdict: Verdict, hidden: bool
) -> None:
    monkeypatch.setattr(module, "frame_hides_effects", lambda fitted, stop: hidden and fitted == "fit")
    search = searching(branch(0.0, left=False, named=EXPLAINED), None)
    search._answer = SimpleNamespace(verdict=verdict, trail=SimpleNamespace(compared=True), after="fit")  # type: ignore[assignment]
    if hidden and verdict is not Verdict.ADEQUATE:
        with pytest.raises(AnalysisError, match=r"the frame moves so far in contact .* a quieter site"):
            search.explanation()
    else:
        assert search.explanation() is search._answer


def test_each_noise_is_searched_for_what_may_still_win() -> None:
    asked: list[Any] = []

    def under(site: Any, **more: Any) -> Any:
        asked.append((site, more))
        return branch(5.0).searched

    found = BestFirst(DiagnosisInput())
    question: Any = found._question
    assert found._search.question is question
    found._search = SimpleNamespace(under=under)
    found._search_at_rest()
    found._search_in_building()
    found._search_at_rest()
    question.site = STILL_FRAME
    found._in_building = None
    found._search_at_rest()
    assert asked == [
        (STILL_FRAME, {"most": MOST, "beat": math.inf}),
        (MOVING, {"most": MOST - 1}),
        (STILL_FRAME, {"most": MOST, "beat": 5.0}),
        (STILL_FRAME, {"most": MOST - 1, "beat": math.inf}),
    ]
    assert found._at_rest is not None and found._at_rest.law.beside is found._at_rest.searched.trail.start
    assert not found._at_rest.law_was_tried


@pytest.mark.parametrize("changed", ["", "pairs", "effects", "none", "less likely", "site", "ripple"])
@pytest.mark.parametrize("place", ["building", "rest"])
def test_one_law_takes_the_place_of_effects_where_nothing_speaks_against_it(
    place: str, changed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    building, rest = branch(0.0, tried=False, named=UNEXPLAINED), branch(1.0, tried=False, named=UNEXPLAINED)
    trial = building if place == "building" else rest
    given: Any = searching(building, rest)
    searched: Any = building.searched
    pair: Any = SimpleNamespace(best=SimpleNamespace(bic=-3.0))
    laws_fit = SimpleNamespace(bic=(-13.1 if changed == "pairs" else -10.1) + 0.2 * (changed == "less likely"))
    searched.with_pairs = lambda: pair if changed == "pairs" else searched
    asked = []
    law: Any = SimpleNamespace(
        replaces_effects=lambda best, catalogue: asked.append((best, catalogue)) or changed != "effects",
        found=None if changed == "none" else SimpleNamespace(fitted=laws_fit),
    )
    trial.law = law
    given._search = SimpleNamespace(likelier_without_frame_motion=lambda fit: changed == "site" and fit is laws_fit)
    monkeypatch.setattr(
        module, "at_full_rate", lambda best, trail, motions: (best, trail, motions) if changed == "ripple" else None
    )
    monkeypatch.setattr(module, "explain_with_laws", lambda *of: of)
    monkeypatch.setattr(given, "_without_effects", lambda branch: ("without effects", branch))
    if trial is building and changed == "pairs":
        monkeypatch.setattr(module, "at_full_rate", lambda *_: None)
        pair.trail = None
    given._try_one_law_instead(trial, building)
    taken = changed in ("", "pairs") or (changed == "site" and place == "rest")
    assert given._answer == ((("without effects", trial), law) if taken else None)
    assert trial.law_was_tried and asked == [(searched.best, "catalogue")]
    assert building.searched is (pair if changed == "pairs" else searched)
    assert (building.named is None) is (changed == "pairs")


@pytest.mark.parametrize("finely", [False, True])
@pytest.mark.parametrize("found", [False, True])
@pytest.mark.parametrize("moved", [False, True])
def test_effects_are_named_at_the_records_own_rate_and_the_likeliest_frequency(
    finely: bool, found: bool, moved: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = branch(0.0, left=not found)
    searched: Any = one.searched
    if not found:
        searched.best = searched.trail.start
    fine: Any = ("fine best", SimpleNamespace(start=SimpleNamespace(problem=SimpleNamespace(data="fine data"))))
    monkeypatch.setattr(module, "at_full_rate", lambda *of: fine if finely and of[2] == "motions" else None)
    monkeypatch.setattr(
        module,
        "at_likeliest_scale",
        lambda best, trail, *, thoroughly: ("elsewhere", best, trail, thoroughly) if moved else best,
    )
    monkeypatch.setattr(module, "choose", lambda data, *, in_turn: (data, in_turn))
    monkeypatch.setattr(module, "settle", lambda *of: ("settled", of))
    monkeypatch.setattr(module, "explain_with_effects", lambda *of: of)
    given = searching(one, None)
    law = one.law
    given._name(one)
    question: Any = given._question
    best, trail = fine if finely else (searched.best, searched.trail)
    best = ("elsewhere", best, trail, not searched.leaves_something) if moved else best
    held = ("fine data" if finely else "data", finely or found)
    settled = best, trail, held, question.progress, None if finely or moved else "residual"
    assert one.named == (question, trail, ("settled", settled), held)
    assert (one.law is law) is not finely and (not finely or one.law.beside is trail.start)


def test_a_branch_is_completed_from_what_is_named_and_only_where_it_may_win(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "explain_with_laws", lambda *of, **more: (*of, more))
    monkeypatch.setattr(module, "explain_with_effects", lambda *of: of)
    monkeypatch.setattr(module, "GatedFit", lambda *of: of)
    monkeypatch.setattr(module, "residual_of", lambda fitted, at: ("residual of", fitted, at))
    given: Any = searching(None, None)
    monkeypatch.setattr(given, "_name", lambda branch: setattr(branch, "named", ("named", branch.searched)))
    one = branch(60.0)
    ended: Any = branch(50.0).searched
    first: Any = one.searched
    first.to_convergence = lambda: ended
    given._complete(one)
    assert given._answer == (("named", ended), one.law, {})
    one.named = UNEXPLAINED
    given._complete(one)
    assert given._answer == (UNEXPLAINED, one.law, {})
    # from 100 to 60: one round more leads to 20
    given._complete_where_it_may_win(one := branch(60.0), 20.1)
    assert one.named == ("named", one.searched)
    assert one.complete == (one.named, one.law, {"beat": 20.1})
    given._complete_where_it_may_win(one := branch(60.0), 19.9)
    trail = one.searched.trail
    start, at = trail.start, ("linear", trail.start)
    bare = (start, at, {}, ("residual of", start, at), None, start)
    assert one.named == (given._question, trail, bare, "held by law")
    assert one.complete == (one.named, one.law, {"beat": 19.9})
    given._search_on(one := SimpleNamespace(searched=first))
    assert one.searched is ended
