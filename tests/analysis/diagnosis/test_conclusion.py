"""The verdict of collisions and drives alike: one function, and nowhere else in the analysis."""

import ast
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis import laws_outside_catalogue as beyond
from analysis.diagnosis.findings import words
from analysis.diagnosis.findings.result import Errors, FoundEffect, Freedom, Remainder, Verdict
from analysis.diagnosis.findings.result_file import diagnosis_result
from analysis.diagnosis.search.time_limit import Limit
from analysis.diagnosis.verdict.acceptance import conclude
from analysis.shot.quantity import Quantity
from tests.app import synthetic

ANALYSIS = Path(__file__).parents[3] / "analysis"
EFFECT = FoundEffect(effect_named("tilt"), {"angle_rad": Quantity(1e-4, 1e-6)}, {"snr": 40.0})
LEFT = Remainder(12e-9, 1e-10, ())
LAW = cast(Any, SimpleNamespace())


@pytest.mark.parametrize(
    ("explained", "effects", "laws", "better", "verdict"),
    [
        (True, 0, 0, False, Verdict.ADEQUATE),
        (True, 1, 0, False, Verdict.EFFECT_FOUND),
        (True, 0, 1, False, Verdict.LAW_LEARNED),
        (True, 1, 1, False, Verdict.LAW_LEARNED),
        (False, 0, 0, False, Verdict.UNEXPLAINED),
        (False, 1, 0, False, Verdict.PARTLY_EXPLAINED),
        (False, 0, 1, False, Verdict.PARTLY_EXPLAINED),
        (False, 0, 0, True, Verdict.PARTLY_EXPLAINED),
    ],
)
def test_the_verdict_follows_from_what_is_named_and_what_remains(
    explained: bool, effects: int, laws: int, better: bool, verdict: Verdict
) -> None:
    assert (
        conclude(explained=explained, effects=[EFFECT] * effects, laws=[LAW] * laws, predicts_better=better) is verdict
    )


def _made(source: Path) -> list[int]:
    """Return the lines of a source that name a verdict otherwise than to compare with it."""
    tree = ast.parse(source.read_text(encoding="utf-8"))
    compared = {id(part) for node in ast.walk(tree) if isinstance(node, ast.Compare) for part in ast.walk(node)}
    return [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "Verdict"
        and id(node) not in compared
    ]


def test_a_verdict_is_made_in_one_place() -> None:
    made = {source.name: lines for source in sorted(ANALYSIS.rglob("*.py")) if (lines := _made(source))}
    assert set(made) == {"acceptance.py"}


WORDS = ("words", "driven_words", "contact_laws", "wording", "result_file")


def test_what_decides_imports_no_words() -> None:
    """... but for the verdict in words that a script may ask a diagnosis for."""
    module = re.compile(rf"from analysis\.diagnosis\.findings(\.| import )({'|'.join(WORDS)})\b")
    sources = {source: source.read_text(encoding="utf-8") for source in (ANALYSIS / "diagnosis").rglob("*.py")}
    assert {source.stem for source, text in sources.items() if module.search(text)} - {*WORDS} == {"result"}
    assert sources[ANALYSIS / "diagnosis" / "findings" / "result.py"].count("import in_words") == 1


class _Law(SimpleNamespace):
    form = "linear"


@pytest.mark.parametrize(
    ("passed", "remains", "named", "imitating"),
    [(True, True, 1, 0), (True, False, 1, 0), (False, False, 1, 0), (False, True, 0, 1)],
)
def test_effects_that_passed_no_gate_are_named_beside_a_law_only_where_nothing_remains(
    passed: bool, remains: bool, named: int, imitating: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = SimpleNamespace(bic=0.0, linearise=lambda: None)
    fit.continued = lambda _stop: fit
    for name, made in {
        "without_effect": lambda *_: SimpleNamespace(bic=1e3),
        "effect_parameters": lambda _: {EFFECT.effect: EFFECT.parameters},
        "snr": lambda *_: 40.0,
        "missed_without": lambda *_: 40.0,
        "in_joint_fit": lambda law, *_: law,
    }.items():
        monkeypatch.setattr(beyond, name, made)
    rest = SimpleNamespace(significant=remains)
    found = SimpleNamespace(
        start=None, fitted=fit, predictions=(None, None), residual=rest, explains=not remains, laws=(_Law(),)
    )
    monkeypatch.setattr(beyond, "_explained", lambda *of, **more: SimpleNamespace(verdict=of[2], **more))
    known = SimpleNamespace(effects=[EFFECT] if passed else [], imitations=[EFFECT])
    law = SimpleNamespace(held=(), stop=lambda: False)
    joined = beyond._together(cast(Any, known), cast(Any, law), cast(Any, found), cast(Any, None))
    assert (len(joined.effects), len(joined.imitations)) == (named, imitating)
    assert joined.verdict is (Verdict.PARTLY_EXPLAINED if remains else Verdict.LAW_LEARNED)


@pytest.mark.parametrize(
    ("alone", "with_second", "joined", "faint", "told"),
    [
        (Verdict.LAW_LEARNED, Verdict.LAW_LEARNED, Verdict.LAW_LEARNED, False, "alone"),
        # effects that leave no more than chance may are not replaced by a law that is less likely
        (Verdict.LAW_LEARNED, Verdict.LAW_LEARNED, Verdict.LAW_LEARNED, True, "joined"),
        (Verdict.LAW_LEARNED, Verdict.LAW_LEARNED, None, True, "effects"),
        (Verdict.PARTLY_EXPLAINED, Verdict.LAW_LEARNED, None, True, "with a second"),
        (Verdict.PARTLY_EXPLAINED, Verdict.LAW_LEARNED, Verdict.LAW_LEARNED, False, "with a second"),
        (Verdict.PARTLY_EXPLAINED, Verdict.PARTLY_EXPLAINED, Verdict.LAW_LEARNED, False, "joined"),
        (Verdict.PARTLY_EXPLAINED, Verdict.PARTLY_EXPLAINED, Verdict.PARTLY_EXPLAINED, False, "with a second"),
        (None, None, Verdict.LAW_LEARNED, False, "joined"),
        (None, None, None, False, "effects"),
    ],
)
def test_what_explains_all_first_is_told_and_else_the_likeliest(
    alone: Verdict | None,
    with_second: Verdict | None,
    joined: Verdict | None,
    faint: bool,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    likeliest = {"with a second": 1.0, "joined": 2.0, "effects": 3.0, "alone": 4.0}

    def found(what: str, verdict: Verdict | None) -> Any:
        explains = verdict is Verdict.LAW_LEARNED
        fitted = SimpleNamespace(bic=likeliest[what], what=what, linearise=lambda: None)
        return (
            SimpleNamespace(
                verdict=verdict, bic=fitted.bic, explains=explains, fitted=fitted, after=fitted, laws=[_Law()],
                residual=None, predictions=None,
            )
            if verdict
            else None
        )  # fmt: skip

    nearest = SimpleNamespace(bic=likeliest["effects"], what="effects", converged=True, linearise=lambda: None)
    for name, made in {
        "learn_second_law": lambda *_, **__: found("with a second", with_second),
        "learn_law": lambda *_, **__: found("joined", joined),
        "_explained": lambda known, held, verdict, found, **_: SimpleNamespace(
            verdict=verdict, bic=found.fitted.bic, after=found.fitted
        ),
        "_together": lambda known, law, one, base: one,
        "_helps": lambda *_: (None, None),
        "residual_of": lambda *_: SimpleNamespace(faint=faint),
    }.items():
        monkeypatch.setattr(beyond, name, made)
    law = SimpleNamespace(
        start=None,
        held=(),
        tell=lambda *_: None,
        stop=lambda: False,
        limit=Limit(60.0, lambda: False),
        one_or_two_laws_may_beat=lambda _beat: True,
        found=found("alone", alone),
    )
    known = SimpleNamespace(nearest=nearest, imitations=[])
    one = beyond.beyond_catalogue(cast(Any, known), cast(Any, law), math.inf)
    assert one is not None and cast(Any, one.after).what == told


def test_what_merely_imitates_the_remainder_has_numbers_without_uncertainties() -> None:
    diagnosis = replace(
        synthetic.diagnosis(synthetic.shot(count=9000)),
        verdict=Verdict.UNEXPLAINED,
        effects=(),
        imitated_by=(EFFECT,),
    )
    told = diagnosis_result(diagnosis)
    assert told["effects"] == [] and told["laws"] == []
    assert told["imitated_by"] == [{"name": "tilt", "parameters": {"angle_rad": {"value": 1e-4}}}]
    assert diagnosis.findings == ()  # what passed no test cannot join the model as a finding


@pytest.mark.parametrize(
    ("effects", "imitations", "said", "not_said"),
    [
        ([EFFECT], [], "the model lacks tilt", "mostly resembles"),
        ([], [EFFECT], "the residual mostly resembles tilt: angle (1.000 ± 0.010)e-4 rad, which failed", "lacks"),
    ],
)
def test_the_sentence_says_what_passed_and_what_only_comes_near(
    effects: list[FoundEffect], imitations: list[FoundEffect], said: str, not_said: str
) -> None:
    diagnosis = replace(
        synthetic.diagnosis(synthetic.shot(count=9000)),
        verdict=Verdict.PARTLY_EXPLAINED,
        effects=tuple(effects),
        imitated_by=tuple(imitations),
        remainder=LEFT,
        error_before=Errors(5e-9, 1e-6, 1e-3, 9.0),
        error_after=Errors(2e-9, 1e-6, 1e-3, 2.0),
    )
    sentence = words.sentence(diagnosis)
    assert said in sentence and not_said not in sentence
    assert "a significant residual remains: 12 nm rms" in sentence and "Residual reduced to 40 %." in sentence


@pytest.mark.parametrize("trace", [True, False])
def test_a_trace_beside_an_adequate_model_is_told(trace: bool) -> None:
    left = replace(LEFT, looks_like=Freedom.PLACE, norms=4.6) if trace else None
    adequate = replace(
        synthetic.diagnosis(synthetic.shot(count=9000)), verdict=Verdict.ADEQUATE, effects=(), remainder=left
    )
    said = words.sentence(adequate)
    assert said.startswith("The model is adequate: no missing effect within the detection limits.")
    assert ("A trace that resembles a position-dependent force (4.6 noise norms) is too weak" in said) is trace
