"""A fit that took its own error for a path that wanders is led out of there."""

import numpy as np

from analysis.inference.fit.hypothesis_fit import finish, lead_on, search, square_of
from analysis.inference.fit.least_squares import Minimum
from tests.analysis.diagnosis.shots import WHITE_M, base_fit, shots


def test_a_fit_that_allows_for_its_own_error_is_led_on() -> None:
    best = base_fit(shots({}))
    hypothesis = best.hypothesis
    off = best.z.copy()
    off[hypothesis.data.count] += 2e-5  # of the speed of the first shot: it strays by hundreds of nm
    there = finish(hypothesis, Minimum(off, square_of(hypothesis, best.floor, off), True, 1), best.floor)
    assert max(there.floor.rms_m) > 10 * WHITE_M
    led = lead_on(there)
    assert led.log_likelihood > there.log_likelihood
    assert abs(led.log_likelihood - best.log_likelihood) < 0.5
    assert max(led.floor.rms_m) < WHITE_M


def test_what_is_at_its_end_stays_there() -> None:
    best = base_fit(shots({}))
    again = search(best.hypothesis, best.z, best.floor)
    assert np.allclose(lead_on(best).z, again.parameters, rtol=1e-6, atol=1e-9)
