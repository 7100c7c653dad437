"""The noise model learnt from quiet flight: what the shorter flight cannot show."""

import numpy as np
import pytest

from analysis.inference.noise import noise

SPACING_S = 1e-5
WHITE_M, FLOOR_M, MEMORY_S = 1e-10, 3e-10, 0.03


def _flight(samples: int, seed: int, floor_m: float = FLOOR_M) -> np.ndarray:
    random = np.random.default_rng(seed)
    phi = np.exp(-SPACING_S / MEMORY_S)
    steps = floor_m * np.sqrt(1 - phi * phi) * random.standard_normal(samples)
    wander = np.empty(samples)
    state = floor_m * random.standard_normal()
    for i in range(samples):
        wander[i] = state = phi * state + steps[i]
    return wander + WHITE_M * random.standard_normal(samples)


def test_a_floor_that_only_the_longer_flight_shows_is_learnt_from_it():
    incoming, outgoing = _flight(300, 1), _flight(11000, 2)
    assert noise.estimate(incoming, np.empty(0), SPACING_S).floor_std_m == 0.0
    found = noise.estimate(incoming, outgoing, SPACING_S)
    assert found.floor_std_m == pytest.approx(FLOOR_M, rel=0.5)
    assert found.white_std_m == pytest.approx(WHITE_M, rel=0.05)


def test_what_rings_in_the_outgoing_flight_is_no_floor():
    ringing = _flight(11000, 3, 0.0) + 1e-9 * np.sin(2 * np.pi * 700 * SPACING_S * np.arange(11000))
    found = noise.estimate(_flight(300, 4, 0.0), ringing, SPACING_S)
    assert found.floor_std_m == 0.0
    assert found.white_std_m == pytest.approx(WHITE_M, rel=0.2)
