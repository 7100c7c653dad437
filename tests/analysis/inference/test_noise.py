"""The noise learnt from quiet flights: white level, what wanders, and what is none of either."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.inference.fit.samples import Samples, take
from analysis.inference.noise.flights import noise_of_flights
from tests.analysis.collision.simulated import shot

WHITE_M, FLOOR_M, MEMORY_S = 1e-10, 3e-10, 0.03


def with_flights(incoming: int, outgoing: int, seed: int, floor_m: float = FLOOR_M) -> Samples:
    """Return a shot of which so many samples on either side are undisturbed flight, the rest is nothing at all."""
    samples = replace(take(shot(samples=12000, seed=seed)), factor=1, spacing_s=1e-5)
    count = incoming + outgoing + 100
    random = np.random.default_rng(seed)
    phi = np.exp(-samples.spacing_s / MEMORY_S)
    steps = floor_m * np.sqrt(1 - phi * phi) * random.standard_normal(count)
    wander = np.empty(count)
    state = floor_m * random.standard_normal()
    for i in range(count):
        wander[i] = state = phi * state + steps[i]
    x = wander + WHITE_M * random.standard_normal(count)
    course = replace(samples.course, quiet_in=slice(0, incoming), quiet_out=slice(incoming + 100, count))
    return replace(samples, displacement_m=x, valid=np.ones(count, np.bool_), course=course, weight=1.0)


def test_a_floor_that_only_the_longer_flight_shows_is_learnt_from_it() -> None:
    short, trusted = noise_of_flights([with_flights(300, 0, 1)])
    assert trusted and short.rms_m[0] == 0.0
    found, _ = noise_of_flights([with_flights(300, 11000, 1)])
    assert found.rms_m[0] == pytest.approx(FLOOR_M, rel=0.5)
    assert found.white_m == pytest.approx(WHITE_M, rel=0.05)


def test_what_rings_in_the_outgoing_flight_is_no_floor() -> None:
    quiet = with_flights(300, 11000, 4, 0.0)
    ringing = 1e-9 * np.sin(2 * np.pi * 700 * quiet.spacing_s * np.arange(quiet.valid.size))
    ringing[:400] = 0.0
    found, _ = noise_of_flights([replace(quiet, displacement_m=quiet.displacement_m + ringing)])
    assert found.rms_m[0] == 0.0
    assert found.white_m == pytest.approx(WHITE_M, rel=0.2)


def test_too_little_flight_is_not_trusted() -> None:
    found, trusted = noise_of_flights([with_flights(20, 10, 5, 0.0)])
    assert not trusted
    assert found.white_m == pytest.approx(WHITE_M, rel=0.5)
