"""An attraction's uncertainty follows its bent valley."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.effects import effect_named
from analysis.inference.fit.profile import _stds_to_unit_rise, with_profile_std
from analysis.inference.model.effective_parameters import Point
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots


def test_an_attraction_is_no_surer_than_the_likelihood_along_its_valley() -> None:
    true = {"force_n": 3.2e-7, "range_m": 3e-5}
    start = base_fit(shots({"adhesion": true}))
    assert with_profile_std(start, calm) is start
    problem = start.problem.with_effects((KINDS["adhesion"],), {})
    z = problem.pack(Point(start.point.base, start.point.own, ({effect_named("adhesion"): true},) * 3))
    best = problem.fit(z, evaluations=60)
    own = slice(problem.offset, problem.size)
    wide = with_profile_std(best, calm)
    assert np.all(wide.std[own] >= best.std[own] * (1 - 1e-12))
    too_sure = replace(best, inverse=best.inverse / 36)
    widened = with_profile_std(too_sure, calm)
    assert np.all(widened.std[own] > 3 * too_sure.std[own])  # the likelihood itself says six tenths of ``best``
    assert np.array_equal(wide.std[: problem.offset], best.std[: problem.offset])
    found = [best.point.values[0][effect_named("adhesion")][name] for name in ("force_n", "range_m")]
    assert np.all(np.abs(np.subtract(found, list(true.values()))) < 3 * wide.std[own])


STD = 0.5


def rise(chi2: Callable[[float], float], side: float, *, bound: float = 1e9) -> tuple[float, list[float]]:
    """Return how many stds raise chi^2 by one where it grows so with the stds off, and where that was asked.

    ``bound`` is how many stds off the parameter may be.
    """
    asked: list[float] = []
    inverse = np.array([[STD**2, 0.3], [0.3, 9.0]])

    def search(z: np.ndarray, *, held: list[int], evaluations: int, cancelled: Any) -> Any:
        assert held == [0] and evaluations == 8 and cancelled is calm
        off = (z[0] - 2.0) / STD
        if bound == 1e9:
            np.testing.assert_allclose(z[1], 5.0 + 0.3 / STD * off)  # the other follows along the valley
        asked.append(off)
        return SimpleNamespace(square=SimpleNamespace(chi2=100.0 + chi2(off)))

    wide = np.array([bound * STD, 1e9])
    problem = SimpleNamespace(bounds=(np.array([2.0, 5.0]) - wide, np.array([2.0, 5.0]) + wide), search=search)
    fitted: Any = SimpleNamespace(
        problem=problem, z=np.array([2.0, 5.0]), inverse=inverse, noise=None, chi2=lambda noise: 100.0
    )
    return _stds_to_unit_rise(fitted, 0, side, calm), asked


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_distance_to_a_growth_of_one_is_found_along_the_valley(side: float) -> None:
    assert rise(lambda off: off**2, side) == (1.0, [side])
    wide, asked = rise(lambda off: (off / 2.0) ** 2, side)
    assert wide == pytest.approx(2.0) and asked == pytest.approx([side, 2.0 * side])
    narrow, asked = rise(lambda off: (off / 0.5) ** 2, side)
    assert narrow == pytest.approx(0.5) and asked == pytest.approx([side, 0.5 * side])
    # flat at first: four times as far at most from one try to the next, and three tries
    flat, asked = rise(lambda off: 0.04, side)
    assert flat == pytest.approx(64.0) and asked == pytest.approx([side, 4.0 * side, 16.0 * side])
    just, asked = rise(lambda off: 0.06 * off**2, side)
    assert just == pytest.approx(0.06**-0.5, rel=1e-6) and asked[1] == pytest.approx(4.0 * side)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_bound_that_comes_before_a_growth_of_one_is_as_far_as_the_parameter_goes(side: float) -> None:
    """Taken for the whole way, what little chi^2 grows up to the bound would say 64 standard deviations."""
    assert rise(lambda off: (off / 8.0) ** 2, side, bound=3.0) == (3.0, [side, 3.0 * side])
    assert rise(lambda off: (off / 2.0) ** 2, side, bound=0.0) == (0.0, [0.0])
    steep, asked = rise(lambda off: (off / 2.0) ** 2, side, bound=3.0)
    assert steep == pytest.approx(2.0) and asked == pytest.approx([side, 2.0 * side])
    steep, asked = rise(lambda off: 0.09 if abs(off) < 2 else (off / 2.0) ** 2, side, bound=2.8)
    assert steep == pytest.approx(2.0) and asked == pytest.approx([side, 2.8 * side, 2.0 * side])  # as far as it went


def test_where_nothing_moves_the_curvature_has_to_do() -> None:
    def nothing(_: float) -> float:
        raise Infeasible("no motion")

    assert rise(nothing, 1.0)[0] == 1.0
