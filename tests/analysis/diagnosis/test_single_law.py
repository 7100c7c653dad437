"""One law is asked before the long ways through the catalogue, and takes no name from a row that it may be."""

import math

import pytest

from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.evidence.cross_validation import choose
from analysis.diagnosis.findings.result import Verdict
from analysis.diagnosis.learning.single_law import SingleLaw
from analysis.diagnosis.search.time_limit import SECONDS, Limit
from analysis.inference.model.free_parameters import trial_effects
from tests.analysis.diagnosis.shots import base_fit, calm, shots
from tests.analysis.diagnosis.test_law_learning import begun
from tests.law_rigs import LawRig


@pytest.mark.slow
def test_a_law_that_explains_all_ends_the_search() -> None:
    rig = LawRig(on_block=lambda x, _v, _y, _u: -2e-5 * math.exp(-abs(x) / 7e-4), kinks=(lambda x, *_: x,))
    told: list[str] = []
    found = diagnose(rig.shots((0.15, 0.3)), progress=lambda what, _fraction: told.append(what))
    assert found.verdict is Verdict.LAW_LEARNED
    assert [(law.where, law.argument, law.form) for law in found.laws] == [("block", "place", "exponential")]
    assert "trying a force as a function of place" in told
    assert "searching from other first effects" not in told


def test_two_rows_that_look_like_a_third_are_named_before_a_law_is() -> None:
    # Both together are nearly a viscous drag, which the search finds first, and wholly a rising exponential.
    effects = {"quadratic_drag": {"coefficient_n_s2_per_m2": 2.8e-7}, "coulomb_friction": {"force_n": 1.95e-8}}
    found = diagnose(shots(effects, count=2))
    assert found.verdict is Verdict.EFFECT_FOUND and not found.laws
    assert {effect.name for effect in found.effects} == set(effects)


def test_one_shot_alone_shows_no_law_that_could_beat_anything() -> None:
    """No other shot could confirm it, so a search must not wait for it."""
    motions = shots({}, count=1)
    alone = SingleLaw(base_fit(motions), (), lambda _what, _fraction: None, calm, Limit(SECONDS, calm))
    assert alone.curves == [] and alone.found is None
    assert not alone.one_or_two_laws_may_beat(math.inf)


@pytest.mark.slow
def test_a_law_that_may_be_a_row_of_the_catalogue_stands_instead_of_none() -> None:
    start = begun(LawRig(on_plate=lambda _x, _v, y, _u: -100.0 * y**3))
    alone = SingleLaw(start, choose(start.problem.data), lambda _what, _fraction: None, calm, Limit(SECONDS, calm))
    assert alone.found is not None and alone.found.explains  # as a cubic of the bend, which cubic stiffness is
    assert not alone.replaces_effects(start, trial_effects())
