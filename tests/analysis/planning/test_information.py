"""The information of planned shots over random cases: it adds up, and added mass counts."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.inference.fit.problem import Fitted
from analysis.planning.next_shot import NextShot, contact_s, effort
from analysis.planning.precision import _spread
from analysis.planning.predictions import (
    Information,
    blank_shot,
    information_of,
    predict,
    present_information,
)
from tests.analysis.diagnosis.shots import base_fit, shots

FEW = settings(max_examples=8, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
SPEED, ADDED = st.floats(0.08, 0.6), st.sampled_from([0.0, 0.02, 0.05, 0.1])


@pytest.fixture(scope="module")
def fitted() -> Fitted:
    return base_fit(shots({}, count=2))


def shot_of(speed: float, added: float) -> NextShot:
    return NextShot(speed, added, 0.01, 0.02)


@FEW
@given(speed=SPEED, added=ADDED)
def test_two_equal_shots_add_twice_the_information(fitted: Fitted, speed: float, added: float) -> None:
    one = information_of(fitted, predict(fitted, blank_shot(shot_of(speed, added), fitted)), fitted.noise)
    two = one + one
    for name in ("curvature", "gradient", "chi2", "penalty"):
        np.testing.assert_allclose(getattr(two, name), 2.0 * np.asarray(getattr(one, name)), rtol=1e-12)
    known = present_information(fitted, fitted.noise).curvature
    for count in (1, 2, 3):
        assert _spread(known * (1 + count), None) == pytest.approx(_spread(known, None) / np.sqrt(1 + count))
    rows = np.eye(len(known))
    assert all(_spread(known + two.curvature, row) <= _spread(known + one.curvature, row) * (1 + 1e-9) for row in rows)


@FEW
@given(speed=SPEED)
def test_twice_the_shots_reduce_each_uncertainty_by_the_root_of_two(fitted: Fitted, speed: float) -> None:
    shown = predict(fitted, blank_shot(shot_of(speed, 0.0), fitted))
    information = information_of(fitted, shown, fitted.noise).curvature
    known = present_information(fitted, fitted.noise).curvature + information
    for row in np.eye(len(known)):
        assert _spread(2.0 * known, row) == pytest.approx(_spread(known, row) / np.sqrt(2.0), rel=1e-6)


@FEW
@given(speed=SPEED, added=st.floats(0.005, 0.2))
def test_added_mass_counts(fitted: Fitted, speed: float, added: float) -> None:
    samples = fitted.problem.data.shots
    bare, laden = shot_of(speed, 0.0), shot_of(speed, added)
    mass = samples[0].moving_mass_kg
    assert blank_shot(laden, fitted).moving_mass_kg == pytest.approx(mass + added, rel=1e-12)
    ratio = contact_s(laden, samples) / contact_s(bare, samples)
    assert ratio == pytest.approx(np.sqrt((mass + added) / mass), rel=1e-12)
    assert effort((laden,), 0.0) == effort((bare,), 0.0) + 0.5 == effort((laden, laden), 0.0) - 1.0
    heavy = predict(fitted, blank_shot(laden, fitted)).displacement_m
    light = predict(fitted, replace(blank_shot(laden, fitted), moving_mass_kg=mass)).displacement_m
    assert np.max(np.abs(heavy - light)) > 1e-6, "a heavier block goes deeper"


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**31), units=st.tuples(*[st.floats(-7.0, 7.0)] * 3))
def test_what_a_rival_leaves_over_is_the_same_in_any_units(seed: int, units: tuple[float, ...]) -> None:
    random = np.random.default_rng(seed)
    columns, left = random.normal(size=(40, 3)), random.normal(size=40)
    columns[:, 2] += columns[:, 0]  # parameters that depend on each other
    residual = left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    scaled = columns * 10.0 ** np.array(units)
    known = Information(scaled.T @ scaled, scaled.T @ left, float(left @ left), penalty=3.0)
    assert known.least == pytest.approx(float(residual @ residual) + 3.0, rel=1e-6)
