"""Information of shots: against dense least squares of all parameters at once; the samples of a shot not yet taken."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.effects import effect_named
from analysis.inference.fit.problem import Fitted
from analysis.planning import predictions
from analysis.planning.next_shot import NextShot, contact_s
from analysis.planning.predictions import (
    blank_shot,
    fit_as_if_taken,
    information_of,
    information_without,
    predict,
    present_information,
    refitted_chi2,
    shot_penalty,
)
from tests.analysis.diagnosis.shots import base_fit, calm, shots

SHOT = NextShot(0.25, 0.03, 0.0101, 0.0203)


@pytest.fixture(scope="module")
def fitted() -> Fitted:
    return base_fit(shots({}, count=2))


def test_what_is_known_of_some_parameters_is_what_the_others_leave() -> None:
    random = np.random.default_rng(5)
    rows, left = random.standard_normal((30, 6)) * [1, 1, 1, 1e5, 1e-5, 1], random.standard_normal(30)
    rows[:, 5] = 0.0  # of another shot
    of = information_without(rows, left, 3)
    left_over = left - rows[:, 3:5] @ np.linalg.lstsq(rows[:, 3:5], left, rcond=None)[0]
    assert of.chi2 == pytest.approx(np.sum(left_over**2)) and of.penalty == 0.0
    every = rows[:, :5]
    covariance = np.linalg.inv(every.T @ every)[:3, :3]
    np.testing.assert_allclose(of.curvature, np.linalg.inv(covariance), rtol=1e-6)
    best = np.linalg.lstsq(every, left, rcond=None)[0]
    assert of.least == pytest.approx(np.sum((left - every @ best) ** 2), rel=1e-8)
    np.testing.assert_allclose(of.gradient, of.curvature @ best[:3], atol=1e-9)


def test_the_present_shots_know_the_shared_parameters_as_well_as_their_fit(fitted: Fitted) -> None:
    shared = fitted.problem.shared
    known = present_information(fitted, fitted.noise)
    np.testing.assert_allclose(np.linalg.inv(known.curvature), fitted.inverse[np.ix_(shared, shared)], rtol=1e-5)
    assert known.chi2 == pytest.approx(fitted.problem.with_noise(fitted.noise).square(fitted.z).chi2, rel=1e-6)
    assert known.least <= known.chi2


def test_a_shot_not_yet_taken_is_sampled_like_the_present_ones(fitted: Fitted) -> None:
    like = fitted.problem.data.shots[0]
    empty = blank_shot(SHOT, fitted)
    lasts = contact_s(SHOT, fitted.problem.data.shots)
    rate_hz = like.factor / like.spacing_s
    assert empty.time_s.size == pytest.approx((0.0101 + lasts + 0.0203) * rate_hz, abs=like.factor)
    assert empty.time_s.size % like.factor == 0 and empty.factor == like.factor and empty.spacing_s == like.spacing_s
    assert empty.used.all() and empty.valid.all() and not empty.displacement_m.any()
    np.testing.assert_allclose(np.diff(empty.time_s), 1.0 / rate_hz)
    blocks = [empty.time_s[begin : begin + like.factor].mean() for begin in range(0, empty.time_s.size, like.factor)]
    np.testing.assert_allclose(empty.centre_s, blocks)
    assert empty.moving_mass_kg == pytest.approx(like.moving_mass_kg + 0.03) and empty.white_m == like.white_m
    course = empty.course
    assert (course.touch_time_s, course.velocity_in_m_per_s) == (0.0101, -0.25)
    assert course.release_time_s - course.touch_time_s == pytest.approx(lasts)
    assert course.turnaround_time_s == pytest.approx(0.0101 + lasts / 2)
    assert course.rate_rad_per_s == pytest.approx(np.pi / lasts)
    problem, z = fitted.with_shots([empty])
    added = problem.unpack(z).own[-1]
    np.testing.assert_allclose(added, [-0.25, 0.0101, 0.0], atol=1e-15)
    np.testing.assert_allclose(problem.unpack(z).own[:-1], fitted.point.own)
    np.testing.assert_allclose(problem.unpack(z).base, fitted.point.base)
    before = predict(fitted, empty)
    flight = empty.centre_s < 0.0099
    steady = np.polyfit(empty.centre_s[flight], before.displacement_m[flight], 1)
    assert steady[0] == pytest.approx(-0.25) and steady[1] == pytest.approx(0.25 * 0.0101)


def test_shots_as_predicted_change_nothing_but_what_is_known(fitted: Fitted) -> None:
    shown = predict(fitted, blank_shot(SHOT, fitted))
    information = information_of(fitted, shown, fitted.noise)
    assert information.chi2 < 1e-12 and np.abs(information.gradient).max() < 1e-6 * np.abs(information.curvature).max()
    both = fit_as_if_taken(fitted, [shown], fitted.noise)
    known = present_information(fitted, fitted.noise).curvature + information.curvature
    shared = both.problem.shared
    np.testing.assert_allclose(both.inverse[np.ix_(shared, shared)], np.linalg.inv(known), rtol=2e-3)
    before = present_information(fitted, fitted.noise).least
    assert refitted_chi2(fitted, [shown], fitted.noise, calm) == pytest.approx(before, abs=0.31)
    off = SimpleNamespace(displacement_m=shown.displacement_m + 1e-9 * np.sin(3e3 * shown.centre_s))
    moved = predictions.replace(shown, displacement_m=off.displacement_m)
    to_first_order = information_of(fitted, moved, fitted.noise)
    square = (present_information(fitted, fitted.noise) + to_first_order).least
    assert square > before + 100.0
    assert refitted_chi2(fitted, [moved], fitted.noise, calm) == pytest.approx(square, rel=1e-3)


def test_a_motion_that_is_not_finite_is_refused(fitted: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = predict(fitted, blank_shot(SHOT, fitted))
    lost = predictions.replace(shown, displacement_m=np.full(shown.displacement_m.size, np.nan))
    with pytest.raises(Infeasible, match="not finite"):
        information_of(fitted, lost, fitted.noise)
    kind = type(fitted.problem)
    monkeypatch.setattr(kind, "averaged", lambda *_: np.full(shown.displacement_m.size, np.inf))
    with pytest.raises(Infeasible, match="not finite"):
        predict(fitted, shown)


def test_the_values_of_a_typical_shot_are_all_of_the_one_of_median_size() -> None:
    effect = effect_named("plate_motion")
    kind = SimpleNamespace(effect=effect, own=[SimpleNamespace(name="velocity_m_per_s")])
    sizes = [(-9.0, 1.0), (2.0, 7.0), (-3.0, 5.0), (1.0, 2.0), (4.0, 3.0)]
    values = tuple({effect: {"velocity_m_per_s": v, "displacement_m": y}} for v, y in sizes)
    given: Any = SimpleNamespace(problem=SimpleNamespace(effects=[kind]), point=SimpleNamespace(values=values))
    assert Fitted._typical_values(given) == {effect: {"velocity_m_per_s": -3.0, "displacement_m": 5.0}}


def test_the_penalty_is_by_how_much_the_shot_knows_its_own_values_better_than_they_scatter() -> None:
    random = np.random.default_rng(2)
    rows = random.standard_normal((50, 7))
    named_columns = [
        ("k_p", -1), ("plate_motion.v", 0), ("plate_motion.v", 2), ("other.v", 2), ("plate_motion.d", 2),
        ("velocity_in_m_per_s", 2), ("touch_time_s", 2),
    ]  # fmt: skip
    names_of_start = {name for name in predictions.OWN_NAMES}
    columns = [k for k, (name, index) in enumerate(named_columns) if index == 2 and name in names_of_start]
    problem = SimpleNamespace(
        data=SimpleNamespace(shots=[0, 1, 2]), names=named_columns, places=[[], [], list(range(7))],
        of_shot=lambda shot, z: (None, rows if shot == 2 else rows * np.nan),
    )  # fmt: skip
    shot: Any = SimpleNamespace(whitened=lambda floor, columns: columns / floor)
    effect: Any = SimpleNamespace(key="plate_motion")
    rival: Any = SimpleNamespace(with_shots=lambda _: (problem, None))
    floor: Any = 0.5
    scatter = np.array([3.0, 0.2])
    found = shot_penalty(rival, effect, scatter, shot, floor)
    numbers, start = 2.0 * rows[:, [2, 4]], 2.0 * rows[:, columns]
    left = numbers - start @ np.linalg.lstsq(start, numbers, rcond=None)[0]
    spread = np.diag(scatter**2)
    assert len(columns) == 2
    assert found == pytest.approx(np.log(np.linalg.det(np.eye(2) + spread @ left.T @ left)), rel=1e-9)
