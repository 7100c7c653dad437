"""A fit that took its own error for a path that wanders is led out of there; predictions keep what is known."""

from dataclasses import replace
from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest

from analysis.collision.parameters import Infeasible
from analysis.inference.fit import problem as problem_module
from analysis.inference.fit.least_squares import Minimum
from analysis.inference.fit.problem import Fitted, Problem
from analysis.inference.noise.floor import Floor
from tests.analysis.diagnosis.shots import WHITE_M, base_fit, calm, shots
from tests.analysis.inference.shown import whole_slope


def test_a_fit_that_allows_for_its_own_error_is_led_on() -> None:
    best = base_fit(shots({}))
    off = best.z.copy()
    off[best.problem.data.count] += 2e-5  # of the speed of the first shot: it strays by hundreds of nm
    there = best.problem.fitted(Minimum(off, best.problem.square(off), True))
    assert max(there.noise.rms_m) > 10 * WHITE_M
    led = there.continued()
    assert led.log_likelihood > there.log_likelihood
    assert abs(led.log_likelihood - best.log_likelihood) < 0.5
    assert max(led.noise.rms_m) < WHITE_M


def test_a_shot_is_added_to_a_finished_fit() -> None:
    every = base_fit(shots({}, count=3))
    data = every.problem.data
    two = replace(every.problem, data=replace(data, shots=data.shots[:2]))
    begun = two.fit(every.z[:10] + 3.0 * np.sqrt(np.diag(every.inverse)[:10]))
    problem, z = begun.with_shots(data.shots[2:])
    point = problem.unpack(z)
    np.testing.assert_allclose(point.base, begun.point.base)
    np.testing.assert_allclose(point.own, [*begun.point.own, data.shots[2].course.own], rtol=1e-12, atol=1e-15)
    added = problem.fit(z)
    assert added.converged and added.log_likelihood == pytest.approx(every.log_likelihood, abs=0.05)
    np.testing.assert_allclose((added.z - every.z) / np.sqrt(np.diag(every.inverse)), 0.0, atol=0.1)


def test_what_is_at_its_end_stays_there() -> None:
    best = base_fit(shots({}))
    again = best.problem.search(best.z)
    assert np.allclose(best.continued().z, again.parameters, rtol=1e-6, atol=1e-9)


def test_another_noise_is_another_weight_and_the_same_trajectories() -> None:
    best = base_fit(shots({}))
    louder = best.problem.with_noise(replace(best.noise, white_m=2 * best.noise.white_m))
    assert louder.derivatives(best.z) is best.problem.derivatives(best.z)
    assert louder.square(best.z).chi2 == pytest.approx(best.problem.square(best.z).chi2 / 4, rel=1e-12)
    assert best.problem.noise is best.noise


def test_a_prediction_moves_only_what_is_a_shots_own() -> None:
    best = base_fit(shots({}))
    off = best.z.copy()
    off[best.problem.data.count :] += 1e-6
    end = best.problem.predict(off, evaluations=25, tolerance=1e-3).parameters
    assert np.array_equal(end[best.problem.shared], best.z[best.problem.shared])
    assert np.allclose(end, best.z, rtol=1e-6, atol=1e-9)


def cut_off(at: Fitted, stds: float) -> Minimum:
    """Return the end of a search whose first parameter is so many standard deviations off, the others followed."""
    square = at.problem.square(at.z)
    inverse = square.curvature.inverse()
    assert inverse is not None
    away = stds * np.sqrt(square.chi2 / square.samples) * inverse[0] / np.sqrt(inverse[0, 0])
    return Minimum(at.z, replace(square, gradient=-(square.curvature @ away)), False)


@pytest.mark.parametrize(("stds", "near"), [(0.19, True), (0.21, False)])
def test_a_search_cut_off_is_an_end_within_a_fifth_of_a_standard_deviation(stds: float, near: bool) -> None:
    best = base_fit(shots({}))
    end = cut_off(best, stds)
    assert best.problem.fitted(end).converged is near
    assert best.problem.fitted(replace(end, converged=True)).converged


@pytest.fixture(scope="module")
def best() -> Fitted:
    return base_fit(shots({}, count=2))


def test_the_square_of_a_vector_has_true_derivatives(best: Fitted) -> None:
    problem, z = best.problem, best.z + 1e-3 * np.sqrt(np.diag(best.inverse))
    square, left = problem.square(z), problem.whitened_residual(z)
    assert square.chi2 == pytest.approx(float(left @ left)) and square.samples == left.size == best.samples
    assert square.residual is not None and square.along is not None and square.pull is not None
    np.testing.assert_allclose(square.residual, left, atol=1e-9)
    for k in range(problem.size):
        step = np.zeros(z.size)
        step[k] = 1e-2 * np.sqrt(best.inverse[k, k])
        column = (problem.whitened_residual(z + step) - problem.whitened_residual(z - step)) / (2 * step[k])
        size = np.linalg.norm(column)
        np.testing.assert_allclose(square.along(np.eye(z.size)[k]), column, atol=1e-3 * size)
        assert square.gradient[k] == pytest.approx(column @ left, abs=2e-3 * size * np.sqrt(square.chi2))
        assert square.curvature.dense()[k, k] == pytest.approx(size**2, rel=1e-2)
    np.testing.assert_allclose(square.pull(left), square.gradient, rtol=1e-6, atol=1e-6 * np.abs(square.gradient).max())
    both = zip(problem.data.shots, problem.residual_m(z), strict=True)
    other = [shot.whitened(best.noise, x[:, None])[:, 0] for shot, x in both]
    np.testing.assert_allclose(np.concatenate(other), -left, atol=1e-9)


def test_a_fit_is_at_its_minimum_with_its_criterion_and_its_covariance(best: Fitted) -> None:
    square = best.problem.square(best.z)
    assert best.chi2(best.noise) == pytest.approx(square.chi2, rel=1e-6)
    assert best.bic == pytest.approx(10 * np.log(best.samples) - 2 * best.log_likelihood)
    np.testing.assert_allclose(best.inverse @ square.curvature.dense(), np.eye(10), atol=1e-3)
    slope = whole_slope(best.problem, best.z)
    covariance = slope @ best.inverse @ slope.T
    for at, found in zip(best.problem.places, best.covariances, strict=True):
        np.testing.assert_allclose(found, covariance[np.ix_(at, at)])
    np.testing.assert_allclose(best.std**2, np.diag(covariance))
    assert best.effects == () and best.unlearned_noise == best.noise.still
    assert best.with_marginal_covariance() is best and best.continued() is best  # no frame, and at its end


def test_on_a_frame_a_wander_that_the_flights_bear_but_do_not_show_is_no_missing_effect(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flights, learned = (
        Floor(1e-10, (0.0, 0.0), (1e-2, 1e-2), 2e-5, (0.0,)),
        Floor(9e-11, (4e-11, 0.0), (1e-3, 1e-2), 2e-5, (1.5,)),
    )

    def unlearned(seen: Floor, noise: Floor, allowed: bool, moves: bool = True) -> Floor:
        monkeypatch.setattr(problem_module, "flights_allow", lambda *_: allowed)
        data = Some(site=Some(moves=moves), noise_of_flights=seen, shots=())
        fitted: Any = Some(problem=Some(data=data), noise=noise)
        found: Floor = Fitted.unlearned_noise.func(fitted)  # type: ignore[attr-defined]
        return found

    assert unlearned(flights, learned, True) == replace(learned, site=(0.0,))  # the frame as strong as was read
    assert unlearned(flights, learned, False) == unlearned(flights, replace(learned, rms_m=(0.0, 0.0)), True) == flights
    seen = replace(flights, rms_m=(1e-11, 0.0))
    assert unlearned(seen, learned, True) == seen
    assert unlearned(flights, learned, True, moves=False) == learned.still


def test_parameters_that_are_held_stay_and_the_others_give_way(best: Fitted) -> None:
    off = best.z.copy()
    off[2] += 3.0 * np.sqrt(best.inverse[2, 2])
    held = best.problem.search(off, held=[2], evaluations=25)
    assert held.parameters[2] == off[2] and held.converged
    # by the profile of a quadratic: nine more of chi^2, the others moved along the covariance
    assert held.square.chi2 - best.chi2(best.noise) == pytest.approx(9.0, rel=0.2)
    moved = best.inverse[:, 2] / best.inverse[2, 2] * (off[2] - best.z[2])
    unit = np.sqrt(np.diag(best.inverse))
    np.testing.assert_allclose((held.parameters - best.z) / unit, moved / unit, atol=0.35)
    free = best.problem.search(off, evaluations=25)
    np.testing.assert_allclose((free.parameters - best.z) / unit, 0.0, atol=0.2)


def test_the_likelier_of_two_fits_is_kept(best: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def fits(likelihoods: list[float]) -> float:
        asked.clear()
        values = iter(likelihoods)

        def once(problem: Problem, z: Any, **options: Any) -> Any:
            asked.append((z, options))
            return replace(best, log_likelihood=next(values))

        monkeypatch.setattr(Problem, "fit_once", once)
        return best.problem.fit(best.z + 1.0, evaluations=20, anew=True).log_likelihood

    assert fits([1.0, 2.0]) == 2.0 and fits([2.0, 1.0]) == 2.0
    assert [options["evaluations"] for _, options in asked] == [20, 10]
    assert asked[1][0] is best.z and asked[1][1]["anew"] and not asked[0][1].get("anew", False)


def test_a_contact_too_stiff_for_the_samples_is_softened_until_it_is_not(best: Fitted) -> None:
    problem, point = best.problem, best.point
    assert problem.with_softened_contact(point) is point
    stiff = replace(point, base=point.base * [1.0, 1.0, 1e6, 1.0])
    with pytest.raises(Infeasible, match="faster than any record can show"):
        problem.averaged(0, stiff)
    soft = problem.with_softened_contact(stiff)
    softened = round(np.log10(stiff.base[2] / soft.base[2]))
    assert soft.base[2:4] == pytest.approx(stiff.base[2:4] * [0.1**softened, 0.3**softened])
    assert not problem.shot_at(0, soft).too_fast
    one_less = replace(soft, base=soft.base * [1.0, 1.0, 10.0, 1 / 0.3])
    assert problem.shot_at(0, one_less).too_fast


@pytest.mark.parametrize(
    ("rms", "site", "still", "kept"),
    [(1.1, (), 6.0, False), (0.9, (), 6.0, True), (1.1, (), 5.0, True), (1.1, (0.0,), 6.0, True)],
)
def test_a_path_that_wanders_more_than_its_white_noise_must_be_likelier_than_white_noise_alone(
    rms: float, site: tuple[float, ...], still: float, kept: bool
) -> None:
    white = Some(log_likelihood=still)
    noise = Some(site=site, rms_m=(0.1, rms), white_m=1.0)
    fit: Any = Some(noise=noise, log_likelihood=5.0, from_white=lambda *, evaluations, cancelled: white)
    assert Fitted._or_white_noise(fit, None) is (fit if kept else white)


@pytest.mark.parametrize(
    ("begins", "rounds", "ends"),
    [
        (("converged", 0.0), [], "converged 0"),
        (("further", 0.0), [("further", 9.0), ("converged", 10.0)], "converged 10"),
        (("further", 0.0), [("further", 9.0), ("further", 9.01), ("converged", 99.0)], "further 9"),  # no more to gain
        (("further", 0.0), [("converged", -1.0), ("converged", 99.0)], "further 0"),  # an end, and a worse one
    ],
)
def test_a_search_goes_on_as_long_as_the_likelihood_grows(
    begins: tuple[str, float], rounds: list[tuple[str, float]], ends: str
) -> None:
    class Found(tuple):  # type: ignore[type-arg]
        converged = property(lambda self: self[0] == "converged")

    left = iter([Found(one) for one in rounds])

    def of(how: str, value: float) -> Any:
        fit = Some(converged=how == "converged", log_likelihood=value, z=None, words=f"{how} {value:g}")
        fit.problem = Some(search=lambda z, *, evaluations, cancelled: next(left), fitted=lambda found: of(*found))
        fit._or_white_noise = lambda cancelled: fit.words
        return fit

    assert Fitted.continued(of(*begins)) == ends  # type: ignore[comparison-overlap]


def test_whoever_stops_a_fit_is_asked_in_all_of_its_searches(best: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    search = Problem.search

    def noted(self: Problem, z: np.ndarray, **how: Any) -> Minimum:
        asked.append(how.get("cancelled"))
        return search(self, z, **how)

    monkeypatch.setattr(Problem, "search", noted)
    best.problem.fit(best.z, cancelled=calm)
    best.refitted(evaluations=2, cancelled=calm)
    best.from_white(evaluations=2, cancelled=calm)
    replace(best, converged=False).continued(calm)
    assert len(asked) >= 7 and all(one is calm for one in asked)
