"""A faint mode that fits at several frequencies: all of them are found, and its uncertainty spans them."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.diagnosis.search.competing_models import _with_scales_of
from analysis.diagnosis.search.forward_selection import Trail, add_effects
from analysis.diagnosis.search.scale_maxima import (
    _beyond_edges,
    _place,
    _std,
    at_likeliest_scale,
    at_other_scales,
    with_std_over,
)
from analysis.inference import Fitted, effect_parameters, refit
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots

SUPPORT = KINDS["support_compliance"]
ADHESION = KINDS["adhesion"].effect


def searched(compliance_m_per_n: float, frequency_hz: float) -> tuple[Fitted, Trail]:
    values = {"compliance_m_per_n": compliance_m_per_n, "frequency_hz": frequency_hz}
    trail = Trail(base_fit(shots({"support_compliance": values})), [SUPPORT], calm)
    return add_effects(trail.start, trail, 1), trail


@pytest.fixture(scope="module")
def faint() -> tuple[Fitted, Trail]:
    return searched(2e-5, 1985.0)


def frequency_hz(fitted: Fitted) -> float:
    return fitted.point.values[0][SUPPORT.effect]["frequency_hz"]


def test_a_faint_support_is_found_at_the_frequency_that_is_likeliest_of_all(faint: tuple[Fitted, Trail]) -> None:
    first, trail = faint
    others = at_other_scales(first, trail)
    assert frequency_hz(first) < 1000.0  # where a search by scores ends
    best = at_likeliest_scale(first, trail)
    assert best.converged and best.bic < first.bic - 1.0
    assert frequency_hz(best) == pytest.approx(1985.0, rel=2e-3)
    # nothing on a grid that it does not know is likelier
    at = trail.start.linearise()
    for hz in np.geomspace(300.0, 2900.0, 12):
        start = {"compliance_m_per_n": 6e-6, "frequency_hz": float(hz)}
        trial = refit(at, SUPPORT, (start,) * 3, calm)
        assert trial is None or trial.refitted(evaluations=16).bic > best.bic - 1.0
    # each is a maximum by itself, not more than the limit behind, and stands once
    for one in others:
        assert one.bic < first.bic + 20.0
        assert one.refitted(evaluations=40).bic > one.bic - 1.0
    at_ln = np.sort(np.log([frequency_hz(one) for one in (first, *others)]))
    assert len(others) >= 5 and float(np.diff(at_ln).min()) > 0.02
    # a large one keeps no promise to first order: not thoroughly, only those are seen that do
    quickly = at_other_scales(first, replace(trail, elsewhere={}), thoroughly=False)
    assert 0 < len(quickly) < len(others)


def test_the_uncertainty_of_a_faint_support_spans_all_its_frequencies(faint: tuple[Fitted, Trail]) -> None:
    first, trail = faint
    best = at_likeliest_scale(first, trail)
    others = at_other_scales(best, trail)
    assert [frequency_hz(one) for one in others].count(frequency_hz(first)) == 1
    assert frequency_hz(best) not in [frequency_hz(one) for one in others]
    found = effect_parameters(with_std_over(best, others))[SUPPORT.effect]
    of_one = effect_parameters(best)[SUPPORT.effect]
    assert of_one["frequency_hz"].std < 10.0 and found["frequency_hz"].value == of_one["frequency_hz"].value
    every = [best, *others]
    weights = np.exp([0.5 * (best.bic - one.bic) for one in every])
    ln = np.log([frequency_hz(one) for one in every])
    spread = best.point.values[0][SUPPORT.effect]["frequency_hz"] * math.sqrt(
        float(weights @ (ln - ln[0]) ** 2 / weights.sum())
    )
    assert found["frequency_hz"].std == pytest.approx(spread, rel=0.02)


def test_a_support_that_stands_out_has_one_frequency() -> None:
    first, trail = searched(2e-6, 1000.0)
    assert at_other_scales(first, trail) == [] and at_likeliest_scale(first, trail) is first
    assert with_std_over(first, []) is first


def fit(z: list[float], std: list[float], bic: float, names: str = "ab") -> Any:
    problem = SimpleNamespace(names=list(names[: len(z)]))
    return SimpleNamespace(z=np.array(z), inverse=np.diag(np.square(std)), bic=bic, problem=problem)


def test_the_covariance_is_that_of_numbers_drawn_from_all_fits_by_their_likelihood(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("analysis.diagnosis.search.scale_maxima.replace", lambda one, inverse: inverse)
    fits = [fit([1.0, 5.0], [0.3, 0.1], 0.0), fit([3.0, 4.0], [0.2, 0.4], 1.2), fit([-2.0, 7.0], [0.5, 0.2], 4.0)]
    turned = fit([7.0, -2.0], [0.2, 0.5], 4.0, "ba")  # the same fit, its parameters in another order
    got: Any = with_std_over(fits[0], [fits[1], turned])
    rng = np.random.default_rng(4)
    odds = np.exp([-0.5 * one.bic for one in fits])
    chosen = rng.choice(3, size=200_000, p=odds / odds.sum())
    drawn = np.array([one.z for one in fits])[chosen]
    drawn += rng.standard_normal(drawn.shape) * np.array([np.sqrt(np.diag(one.inverse)) for one in fits])[chosen]
    off = drawn - fits[0].z
    np.testing.assert_allclose(got, off.T @ off / len(off), rtol=0.02)


def test_a_fit_that_is_likelier_than_the_one_reported_weighs_no_more_than_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.diagnosis.search.scale_maxima.replace", lambda one, inverse: inverse)
    here, there = fit([0.0], [0.1], 10.0), fit([4.0], [0.1], -50.0)
    assert float(np.asarray(with_std_over(here, [there]))[0, 0]) == pytest.approx(0.01 + 8.0)


def test_a_faint_adhesion_may_end_between_other_gaps_that_the_bounces_reach() -> None:
    adhesion = KINDS["adhesion"]
    trail = Trail(base_fit(shots({"adhesion": {"force_n": 5e-7, "range_m": 4e-5}})), [adhesion], calm)

    def range_m(fitted: Fitted) -> float:
        return fitted.point.values[0][adhesion.effect]["range_m"]

    begun = refit(trail.start.linearise(), adhesion, ({"force_n": 5e-7, "range_m": 3e-4},) * 3, calm)
    assert begun is not None
    wrong = begun.refitted(evaluations=40)
    assert wrong.converged and range_m(wrong) > 2e-4  # a maximum by itself
    best = at_likeliest_scale(wrong, trail)
    assert best.bic < wrong.bic - 5.0 and 2e-5 < range_m(best) < 5e-5
    others = at_other_scales(best, trail)
    assert any(range_m(one) == pytest.approx(range_m(wrong), rel=0.02) for one in others)
    found, alone = (effect_parameters(one)[adhesion.effect]["range_m"] for one in (with_std_over(best, others), best))
    assert found.value == alone.value and found.std > 1.2 * alone.std


@pytest.fixture(scope="module")
def sides() -> tuple[Fitted, Fitted, Trail]:
    """Return the fits of an adhesion on the right and on the wrong side of an edge, 100 of the criterion apart."""
    adhesion = KINDS["adhesion"]
    trail = Trail(base_fit(shots({"adhesion": {"force_n": 3e-6, "range_m": 4e-5}})), [adhesion], calm)
    begun = refit(trail.start.linearise(), adhesion, ({"force_n": 3e-6, "range_m": 4e-5},) * 3, calm)
    assert begun is not None
    right = begun.refitted(evaluations=60)
    std = _std(right, ADHESION)
    wrong = right.problem.fit(right.z + 15.0 / std * right.inverse[:, _place(right, ADHESION)], evaluations=40)
    assert wrong.converged and wrong.bic > right.bic + 50.0 and abs(range_off(wrong, right)) > 4.0 * std
    return right, wrong, trail


def range_off(one: Fitted, other: Fitted) -> float:
    return float(one.z[_place(one, ADHESION)] - other.z[_place(other, ADHESION)])


def test_a_range_on_the_wrong_side_of_an_edge_is_found_without_a_score(
    sides: tuple[Fitted, Fitted, Trail], monkeypatch: pytest.MonkeyPatch
) -> None:
    right, wrong, trail = sides
    monkeypatch.setattr("analysis.diagnosis.search.scale_maxima._fitted_from", lambda *_: [])
    best = at_likeliest_scale(wrong, replace(trail, elsewhere={}))
    assert best.bic < right.bic + 0.1 and abs(range_off(best, right)) < 0.2 * _std(right, ADHESION)
    assert at_likeliest_scale(right, replace(trail, elsewhere={})) is right
    nothing = replace(right, inverse=np.full_like(right.inverse, np.nan))
    assert not _beyond_edges(nothing, ADHESION, trail)


def test_beside_a_look_alike_an_effect_also_starts_at_the_range_of_the_best_fit(
    sides: tuple[Fitted, Fitted, Trail], monkeypatch: pytest.MonkeyPatch
) -> None:
    right, wrong, trail = sides
    assert _with_scales_of(right, right, trail) is None
    back = _with_scales_of(right, wrong, trail)
    assert back is not None and np.flatnonzero(back.z != wrong.z).size <= 2  # force and range
    assert back.point.values[0][ADHESION] == pytest.approx(right.point.values[0][ADHESION], rel=1e-9)

    def nowhere(*_: object) -> None:
        raise Infeasible("no trajectory")

    monkeypatch.setattr(type(wrong.problem), "linearise", nowhere)
    assert _with_scales_of(right, wrong, trail) is None
