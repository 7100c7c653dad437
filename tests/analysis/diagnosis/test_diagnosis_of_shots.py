"""From shots to a question, and from an explanation to the result that people and files see."""

from types import SimpleNamespace
from typing import Any

import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis import diagnosis_of_shots as module
from analysis.diagnosis.findings.result import Verdict
from analysis.shot import AnalysisError, Motion, Shot

TILT = effect_named("tilt")


def motion() -> Any:
    return object.__new__(Motion)


def shot(model: str = "paper", moved: Any = None, problem: str | None = None) -> Any:
    made = object.__new__(Shot)
    for name, value in (
        ("settings", SimpleNamespace(model=model)), ("motion", moved), ("name", "first"), ("problem", problem),
    ):  # fmt: skip
        object.__setattr__(made, name, value)
    return made


def asked(shots: list[Any], patch: pytest.MonkeyPatch, **options: Any) -> Any:
    """Return the question that is asked of these shots."""
    told: list[Any] = []
    patch.setattr(module, "BestFirst", lambda question: SimpleNamespace(explanation=lambda: ("explained", question)))
    patch.setattr(module, "_diagnosis", lambda question, explanation: (question, explanation))
    patch.setattr(module, "vibration_of", lambda one: f"shaking {one.settings.model}")
    patch.setattr(module, "Limit", lambda seconds, stop: ("limit", seconds, stop))
    question, explanation = module.diagnose(shots, progress=lambda *what: told.append(what), **options)  # type: ignore[misc]
    assert explanation == ("explained", question) and told == [("fitting the base model", 0.0)]
    return question


def test_what_is_asked_of_shots(monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = motion(), motion()

    def stop() -> bool:
        return False

    law: Any = "law"
    question = asked(
        [shot("clamped", one), shot("clamped", two)], monkeypatch, accepted=("tilt",), laws=(law,),
        seconds=7.0, cancelled=stop,
    )  # fmt: skip
    assert list(question.motions) == [one, two] and question.model == "clamped"
    assert list(question.named) == [TILT] and question.laws == (law,)
    assert question.stop is stop and question.limit == ("limit", 7.0, stop)
    assert list(question.vibrations_read) == ["shaking clamped"] * 2
    alone = asked([one, shot("contact", two)], monkeypatch, model="no_tension")
    assert alone.model == "no_tension" and alone.vibrations_read is None and not alone.stop()
    assert alone.limit[1] == module.SECONDS
    assert (
        asked([one], monkeypatch).model == "paper"
        and asked([one, shot("contact", two)], monkeypatch).model == "contact"
    )


def test_what_cannot_be_asked_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="no shot to diagnose"):
        module.diagnose([])
    with pytest.raises(ValueError, match="different base models: clamped, paper"):
        module.diagnose([shot("paper", motion()), shot("clamped", motion())])
    with pytest.raises(AnalysisError, match="first has no motion: too short"):
        module.diagnose([shot(problem="too short")])
    with pytest.raises(AnalysisError, match="it was not demodulated"):
        module.diagnose([shot()])


def test_a_drive_is_diagnosed_by_its_own_means(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "diagnose_driven", lambda *given: given)
    one = motion()
    found: Any = module.diagnose([one], model="driven", accepted=("a",), progress="tell", cancelled="stop")  # type: ignore[arg-type]
    assert found == ([one], ("a",), "tell", "stop")


class Fit:
    """A fit of three shots."""

    def __init__(self, name: str) -> None:
        self.name, self.noise, self.point = name, f"noise of {name}", f"point of {name}"
        shots = [SimpleNamespace(course=SimpleNamespace(velocity_in_m_per_s=-v)) for v in (0.1, 0.2, 0.3)]
        self.problem = SimpleNamespace(data=SimpleNamespace(shots=shots), full=lambda point: ("full", point), size=12)


@pytest.mark.parametrize("lacks", [True, False])
@pytest.mark.parametrize("held", [(), (0, 2)])
@pytest.mark.parametrize("verdict", [Verdict.EFFECT_FOUND, Verdict.UNEXPLAINED])
def test_an_explanation_becomes_a_result(
    verdict: Verdict, held: tuple[int, ...], lacks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[Any] = []
    before = Fit("before")
    after = Fit("after") if lacks else before
    first, second = (SimpleNamespace(displacement_m=f"path {k}") for k in (0, 1))
    question: Any = SimpleNamespace(
        motions=["m0", "m1", "m2"], model="paper", seconds=9.0, progress=lambda *what: told.append(what),
        limit=SimpleNamespace(left_out=("laws",)),
    )  # fmt: skip
    explanation: Any = SimpleNamespace(
        before=before, after=after, verdict=verdict, predictions=(first, second) if held else None, linearised="at",
        trail=SimpleNamespace(catalogue="catalogue", compared=True), nearest="nearest", effects=("effects",),
        held_out=held, remainder="left", laws=("laws",), imitations=("imitations",),
    )  # fmt: skip
    monkeypatch.setattr(module, "errors", lambda *given: given)
    monkeypatch.setattr(module, "blind_spots", lambda *given: given)
    monkeypatch.setattr(module, "candidates", lambda *given: given)
    monkeypatch.setattr(
        module, "as_fit", lambda fitted, motions, model, seconds: (fitted.name, motions, model, seconds)
    )
    monkeypatch.setattr(module, "replace", lambda fit, *, seconds: (*fit, seconds))
    monkeypatch.setattr(module, "Diagnosis", lambda **given: given)
    made: Any = module._diagnosis(question, explanation)
    shots = before.problem.data.shots
    expected = {
        "verdict": verdict, "effects": ("effects",), "candidates": ("nearest", explanation.trail), "remainder": "left",
        "blind_spots": ("at", "catalogue", "nearest") if verdict is Verdict.EFFECT_FOUND else (),
        "speeds_m_per_s": (0.1, 0.2, 0.3), "seconds": 9.0, "laws": ("laws",), "imitated_by": ("imitations",),
        "not_asked": ("laws",), "compared": True,
        "fit_before": ("before", question.motions, "paper", 0.0),
        "fit_after": (after.name, question.motions, "paper", 0.0, 9.0),
    }  # fmt: skip
    for name, fit in (("error_before", before), ("error_after", after)):
        expected[name] = (question.motions, fit.problem.data.shots, ("full", fit.point), after.noise, 12)
    for name, path in (("error_held_out_before", "path 0"), ("error_held_out_after", "path 1")):
        expected[name] = (["m0", "m2"], [shots[0], shots[2]], path, after.noise, 6) if held else None
    assert made == expected
    assert told == [("errors before and after", 0.9), ("diagnosed", 1.0)]
