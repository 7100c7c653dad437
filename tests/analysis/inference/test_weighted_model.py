"""A model over several shots: what it shows at a vector, how it changes with it, and what is kept of that."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from analysis.collision import ARGUMENTS, FORMS, Effect, Infeasible
from analysis.collision.effects import effect_named
from analysis.inference.fit.problem import Fitted
from analysis.inference.joint import weighted_model
from analysis.inference.model.free_parameters import TrialEffect, trial_effect
from analysis.inference.model.response import respond
from tests.analysis.diagnosis.shots import base_fit, shots


@pytest.fixture(scope="module")
def best() -> Fitted:
    return base_fit(shots({}, count=2))


def test_what_a_vector_shows_is_the_mean_of_each_shots_motion(best: Fitted) -> None:
    problem, z = replace(best.problem), best.z
    point = problem.unpack(z)
    for index, found in enumerate(problem.displacement(z)):
        samples = problem.data.shots[index]
        run = respond(problem.shot_at(index, point), samples.time_s)
        np.testing.assert_allclose(found, samples.averaged(run.displacement_m), atol=1e-13)
        np.testing.assert_array_equal(found, problem.averaged(index, point))
        np.testing.assert_array_equal(problem.run(index, point).displacement_m, run.displacement_m)
        coarse = problem.run(index, point, coarse=True).displacement_m
        np.testing.assert_array_equal(problem.coarse(index, point), coarse)
        at_centres = np.interp(samples.centre_s, samples.time_s, run.displacement_m)
        np.testing.assert_allclose(coarse, at_centres, atol=2e-10)
        np.testing.assert_allclose(problem.residual_m(z)[index], samples.displacement_m - found, atol=1e-15)


def test_slopes_are_those_of_the_vector(best: Fitted) -> None:
    problem, z = replace(best.problem), best.z
    lines = problem.derivatives(z)
    for index, (x, columns) in enumerate(lines):
        alone = problem.of_shot(index, z)
        np.testing.assert_allclose(alone[0], x, atol=1e-15)
        np.testing.assert_allclose(alone[1], columns, rtol=1e-9, atol=1e-15)
        for column, place in enumerate(problem.places[index]):
            step = np.zeros(z.size)
            step[place] = 1e-3 * np.sqrt(best.inverse[place, place])
            ahead, back = (problem.displacement(z + way * step)[index] for way in (1, -1))
            slope = (ahead - back) / (2 * step[place])
            assert np.quantile(np.abs(columns[:, column] - slope), 0.99) < 1e-2 * np.abs(slope).max()
    whole, arrow = problem.whitened_lines(lines)
    np.testing.assert_allclose(whole, -problem.whitened_residual(z), atol=1e-9)
    kept = problem.data.shots
    white = [shot.whitened(problem.noise, line[1]) for shot, line in zip(kept, lines, strict=True)]
    for block, expected in zip(arrow.blocks, white, strict=True):
        np.testing.assert_allclose(block, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    left = problem.whitened([shot[:, None] for shot in problem.residual_m(z)])[:, 0]
    np.testing.assert_allclose(problem.whitened_residual(z), -left, atol=1e-9)


def test_the_last_few_results_are_kept_and_no_other(best: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weighted_model, "_REMEMBERED", 2)
    problem = replace(best.problem)
    vectors = [best.z + k * 1e-9 for k in range(3)]
    first = problem.derivatives(vectors[0])
    assert problem.derivatives(vectors[0].copy()) is first
    assert [x is y for x, (y, _) in zip(problem.displacement(vectors[0]), first, strict=True)] == [True, True]
    second = problem.derivatives(vectors[1])
    assert problem.derivatives(vectors[0]) is first and problem.derivatives(vectors[1]) is second
    third = problem.derivatives(vectors[2])  # in the place of the first
    assert problem.derivatives(vectors[2]) is third and problem.derivatives(vectors[1]) is second
    assert problem.derivatives(vectors[0]) is not first


def test_a_law_acts_besides_and_what_swings_too_fast_is_refused(best: Fitted) -> None:
    problem, z, row = replace(best.problem), best.z, effect_named("viscous_drag")
    drag = replace(row, name="law", parameters=(replace(row.parameters[0], fixed=True),))  # of its natural size
    plain, slowed = problem.displacement(z), problem.displacement(z, [drag])
    with_law = problem.derivatives(z, [drag])
    for before, after, line in zip(plain, slowed, with_law, strict=True):
        assert np.abs(after - before).max() > 1e-8
        np.testing.assert_allclose(line[0], after, atol=1e-15)
    assert problem.displacement(z)[0] is not slowed[0]
    np.testing.assert_array_equal(problem.displacement(z)[0], plain[0])
    point = problem.unpack(z)
    stiff = replace(point, base=point.base * [1.0, 1.0, 1e4, 1.0])
    with pytest.raises(Infeasible, match="faster than any record can show"):
        problem.averaged(0, stiff)


def test_a_law_that_moves_something_faster_than_the_averaged_samples_show_is_refused(best: Fitted) -> None:
    problem, row = replace(best.problem), effect_named("viscous_drag")
    shown = np.pi / problem.data.shots[0].spacing_s

    def law(rate: float) -> Effect:
        fixed = (replace(row.parameters[0], fixed=True),)
        return replace(row, name="law", parameters=fixed, fastest=lambda _values, _collision: rate)

    def beside(effects: Sequence[Effect], rate: float) -> None:
        model = problem.with_effects([TrialEffect(one, one.parameters, (), ()) for one in effects], {})
        values = tuple({one: {"coefficient_n_s_per_m": 1e-4} for one in effects} for _ in problem.data.shots)
        model.averaged(0, replace(problem.unpack(best.z), values=values), [law(rate)])

    beside([], 0.99 * shown)
    with pytest.raises(Infeasible, match="faster than the averaged samples show"):
        beside([], 1.01 * shown)
    quick = replace(row, name="quick", fastest=lambda _values, _collision: 2.0 * shown)
    beside([quick], 1.99 * shown)  # the model without the law is as fast
    with pytest.raises(Infeasible, match="faster than the averaged samples show"):
        beside([quick], 2.01 * shown)


def test_a_motion_in_short_steps_comes_with_the_derivatives_of_usual_ones(best: Fitted) -> None:
    """A hinge of the overlap is met the better the shorter the steps; a search needs only the displacement right."""
    form = next(one for one in FORMS if one.name == "hinge")
    overlap = next(one for one in ARGUMENTS if one.name == "overlap")
    kind = trial_effect(form.law(overlap, {"a": 400.0, "c": 1.5e-5}, 4e-5))
    usual = best.problem.with_effects((kind,), {})
    z = usual.pack(best.point.with_effect(kind.effect, [dict(kind.starts[0])] * 2))
    finer = replace(usual, stride=0.2)
    exact = finer.displacement(z)
    lines = replace(finer).derivatives(z)
    for shown, (x, slopes), (usual_x, usual_slopes) in zip(exact, lines, usual.derivatives(z), strict=True):
        np.testing.assert_array_equal(x, shown)
        np.testing.assert_array_equal(slopes, usual_slopes)
        assert 1e-13 < np.abs(shown - usual_x).max() < 1e-9
