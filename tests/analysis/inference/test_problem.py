"""A fit that took its own error for a path that wanders is led out of there; predictions keep what is known."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.inference.fit.least_squares import Minimum
from tests.analysis.diagnosis.shots import WHITE_M, base_fit, shots


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


@pytest.mark.parametrize(("stds", "near"), [(0.19, True), (0.21, False)])
def test_a_search_cut_off_is_an_end_within_a_fifth_of_a_standard_deviation(stds: float, near: bool) -> None:
    best = base_fit(shots({}))
    square = best.problem.square(best.z)
    inverse = square.covariance()
    assert inverse is not None
    birge = np.sqrt(square.chi2 / square.samples)
    away = stds * birge * inverse[0] / np.sqrt(inverse[0, 0])  # the first parameter so far off, the others followed
    cut_off = Minimum(best.z, replace(square, gradient=-square.curvature @ away), False)
    assert best.problem.fitted(cut_off).converged is near
    assert best.problem.fitted(replace(cut_off, converged=True)).converged
