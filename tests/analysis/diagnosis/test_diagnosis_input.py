"""What follows from a question alone: what may be tried, which shots are held out, where a search begins."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.collision.effects import CATALOGUE, effect_named
from analysis.diagnosis import diagnosis_input as module
from analysis.diagnosis.diagnosis_input import DiagnosisInput
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.drive import LAWS
from tests.analysis.collision.laws.test_user_law import law_from_table

LAW = law_from_table(
    {"name": "law", "where": "block", "formula": "a*v", "parameters": {"a": {"unit": "N s/m", "start": 2.0}}}
)


def question(**changed: Any) -> DiagnosisInput:
    given: dict[str, Any] = {
        "motions": "motions", "model": "paper", "named": (), "laws": (), "vibrations_read": "read",
        "progress": "tell", "stop": "stop", "limit": "limit",
    }  # fmt: skip
    return DiagnosisInput(**{**given, **changed})


def test_a_persons_laws_and_effects_of_the_model_are_tried_as_the_catalogue_is() -> None:
    names = [kind.effect.name for kind in question().catalogue]
    assert set(names) <= set(CATALOGUE) and len(names) == len(set(names))
    friction = LAWS["stribeck_friction"]
    more = question(laws=(LAW,), named=(effect_named("tilt"), friction))
    assert [kind.effect for kind in more.catalogue if kind.effect not in CATALOGUE.values()] == [LAW]
    assert [kind.effect.name for kind in more.catalogue].count("tilt") == 1
    assert effect_named("tilt") in more.accepted


def test_of_a_plate_that_does_not_move_only_what_has_a_meaning_there_is_tried() -> None:
    every, some = question().catalogue, question(model="contact").catalogue
    assert [kind.effect for kind in some] == [kind.effect for kind in every if kind.effect.one_body]
    assert 0 < len(some) < len(every)
    two = next(kind.effect for kind in every if not kind.effect.one_body)
    kept = question(model="contact", named=(two,)).catalogue
    assert two in [kind.effect for kind in kept] and len(kept) == len(some) + 1


def test_a_law_is_tested_by_the_shots_chosen_to_be_held_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "choose", lambda data: ("chosen of", data))
    start: Any = SimpleNamespace(problem=SimpleNamespace(data="data"))
    law = question().single_law_given(start)
    assert (law.start, law.held, law.tell, law.stop, law.limit) == (
        start,
        ("chosen of", "data"),
        "tell",
        "stop",
        "limit",
    )  # type: ignore[comparison-overlap]


def test_what_shook_the_rig_and_where_a_search_begins_are_read_from_the_shots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "frame_motions_of", lambda *given: ("vibrations", *given))
    monkeypatch.setattr(module, "site_under", lambda *given: ("site", *given))
    monkeypatch.setattr(module, "averaged_shots", lambda motions: f"averaged {motions}")
    monkeypatch.setattr(module, "first_fit", lambda *given: given)
    site: Any = ("site", "motions", ("vibrations", "motions", "paper", "read"), CRITERIA.site_nm)
    one = question()
    assert one.site == site and one.begin == ("averaged motions", "paper", site, "stop")  # type: ignore[comparison-overlap]
    monkeypatch.setattr(module.time, "perf_counter", lambda: 130.0)
    assert replace(one, began=100.0).seconds == 30.0
