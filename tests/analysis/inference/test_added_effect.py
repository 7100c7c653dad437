"""The start of a fit with one more effect: the parameters fitted before move out of its way while that helps."""

from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.inference.fit import added_effect
from analysis.inference.fit.added_effect import joined, refit, with_both_effects
from analysis.inference.fit.as_fit import effect_parameters
from analysis.inference.fit.problem import Fitted
from analysis.inference.model.arrow import Arrow
from analysis.shot import Cancelled, Quantity
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots


@pytest.mark.parametrize(("start", "better"), [(0.3, True), (0.9, True), (1.06, False), (1.2, False), (2.0, False)])
def test_a_step_that_leaves_a_larger_residual_is_not_taken(start: float, better: bool) -> None:
    """Far from the straight line the step overshoots: from 1.06 on, what it would leave is larger than before."""

    def residual(z: np.ndarray) -> np.ndarray:
        return np.array([z[0] + 0.9 * z[0] ** 3])

    before = Some(offset=1, free_parameters=())
    bounds = np.array([-9.0]), np.array([9.0])
    problem: Any = Some(offset=1, free_parameters=(), bounds=bounds, whitened_residual=residual)
    at: Any = Some(problem=before, once=lambda name, made: made(), tangents=Arrow.of([np.ones((1, 1))], 1))
    found = added_effect._compensated(at, problem, np.array([start]))
    if better:
        assert abs(found[0]) < 0.95 * start
    else:
        assert found[0] == start


def test_parameters_compensate_by_a_least_squares_step_but_not_where_hardly_anything_shows() -> None:
    random = np.random.default_rng(1)
    columns = random.standard_normal((80, 4)) * [1.0, 1e5, 1e-6, 0.0]
    columns[:, 1] = 1e5 * columns[:, 0] + 1e-1 * columns[:, 1]  # a tenth of it its own
    left = random.standard_normal(80)
    some = Arrow.of([columns[:40], columns[40:]], 4)
    step = some.normal_matrix().solve(some.pull(left), damping=added_effect._DAMPING)
    assert step is not None
    exact = np.linalg.lstsq(columns[:, :3], left, rcond=None)[0]
    np.testing.assert_allclose(columns @ step, columns[:, :3] @ exact, atol=1e-5)
    assert step[3] == 0.0
    columns[:, 1] = 1e5 * columns[:, 0] + 1.0 * random.standard_normal(80)  # a hundred-thousandth
    some = Arrow.of([columns], 4)
    step = some.normal_matrix().solve(some.pull(left), damping=added_effect._DAMPING)
    assert step is not None
    kept = np.linalg.lstsq(columns[:, [0, 2]], left, rcond=None)[0]
    exact = np.linalg.lstsq(columns[:, :3], left, rcond=None)[0]
    whole = np.linalg.norm(columns[:, :3] @ exact - columns[:, [0, 2]] @ kept)
    assert np.linalg.norm(columns @ step - columns[:, [0, 2]] @ kept) < 0.02 * whole


DRAG, TILT = 4e-6, 3e-4


@pytest.fixture(scope="module")
def before() -> Fitted:
    """Return the base fit of two shots with a drag and a tilt."""
    effects = {"viscous_drag": {"coefficient_n_s_per_m": DRAG}, "tilt": {"angle_rad": TILT}}
    return base_fit(shots(effects, count=2))


@pytest.fixture(scope="module")
def after(before: Fitted) -> Fitted:
    return joined(before, [KINDS["viscous_drag"], KINDS["tilt"]], calm)


def test_effects_join_one_after_the_other_and_end_in_the_minimum_of_all(before: Fitted, after: Fitted) -> None:
    assert after.effects == (KINDS["viscous_drag"].effect, KINDS["tilt"].effect) and after.converged
    numbers = effect_parameters(after)
    for name, size in (("viscous_drag", DRAG), ("tilt", TILT)):
        (found,) = numbers[KINDS[name].effect].values()
        assert abs(found.value - size) < 5.0 * found.std < size
    again = after.problem.fit(after.z)
    assert again.bic == pytest.approx(after.bic, abs=0.1) and after.bic < before.bic - 100.0
    other_way = joined(before, [KINDS["tilt"], KINDS["viscous_drag"]], calm)
    assert other_way.bic == pytest.approx(after.bic, abs=0.5)


def test_two_effects_found_alone_go_together(before: Fitted, after: Fitted) -> None:
    at = before.linearise()
    alone = [refit(at, KINDS[name], at.scores(KINDS[name])[0].start, calm) for name in ("viscous_drag", "tilt")]
    drag, tilt = alone
    assert drag is not None and tilt is not None
    both = with_both_effects(drag, tilt, before, calm)
    assert both is not None and both.effects == after.effects
    ended = both.refitted(evaluations=30, cancelled=calm)
    assert ended.bic == pytest.approx(after.bic, abs=1.0) and both.bic < min(drag.bic, tilt.bic) - 10.0
    same = with_both_effects(drag, drag, before, calm)
    assert same is not None and same.effects == drag.effects
    with pytest.raises(Cancelled):
        with_both_effects(drag, tilt, before, lambda: True)
    with pytest.raises(Cancelled):
        refit(at, KINDS["tilt"], [{"angle_rad": 1e-5}] * 2, lambda: True)


def test_the_sum_of_both_moves_is_where_two_effects_begin(before: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    at = before.linearise()
    drag, tilt = (refit(at, KINDS[name], at.scores(KINDS[name])[0].start, calm) for name in ("viscous_drag", "tilt"))
    assert drag is not None and tilt is not None
    begun: list[np.ndarray] = []
    monkeypatch.setattr(type(before.problem), "fit_once", lambda _self, z, **_: begun.append(z))
    with_both_effects(drag, tilt, before, calm)
    (z,) = begun
    plain = before.z.size
    np.testing.assert_allclose(z[:plain], drag.z[:plain] + tilt.z[:plain] - before.z, rtol=1e-12)
    assert z[plain:].tolist() == [drag.z[-1], tilt.z[-1]]


def test_a_start_without_a_trajectory_is_tried_weaker(before: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    def vector(problem: Any, _effective: Any, _kind: Any, given: Any) -> np.ndarray:
        asked.append(given[0]["angle_rad"])
        if len(asked) < least:
            raise Infeasible("none")
        return np.zeros(problem.size)

    at = before.linearise()
    monkeypatch.setattr(added_effect, "_vector_with", vector)
    monkeypatch.setattr(added_effect, "_compensated", lambda _at, _problem, z: z)
    monkeypatch.setattr(type(before.problem), "fit_once", lambda *_, **__: "fitted")
    for least, found in ((1, "fitted"), (3, "fitted"), (4, None)):
        asked.clear()
        assert refit(at, KINDS["tilt"], [{"angle_rad": 1.0}] * 2, calm) == found
        np.testing.assert_allclose(asked, [1.0, 0.3, 0.1][: min(least, 3)])


def test_what_a_fit_chose_among_a_grid_is_told_as_tried_and_each_shots_own_by_its_number(before: Fitted) -> None:
    kind = KINDS["cyclic_error"]
    at = before.linearise()
    found = refit(at, kind, at.scores(kind)[0].start, calm)
    assert found is not None
    numbers = effect_parameters(found)[kind.effect]
    assert set(numbers) == {"amplitude_m", "phase_rad", "phase_rad.2", "order"}
    assert numbers["order"] == Quantity(at.scores(kind)[0].start[0]["order"], 0.0, "tried")
    for shot, name in enumerate(("phase_rad", "phase_rad.2")):
        assert numbers[name].value == found.point.values[shot][kind.effect]["phase_rad"]
