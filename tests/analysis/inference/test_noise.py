"""The noise learned from quiet flights: white level, what wanders, and what is none of either."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from analysis.inference.model.samples import Samples, averaged_shot
from analysis.inference.noise.flights import Spectrum, likeliest_noise, noise_of_flights, spectrum_of
from tests.analysis.collision.simulated import shot

WHITE_M, FLOOR_M, MEMORY_S = 1e-10, 3e-10, 0.03
SPACING_S = 5e-5


def with_flights(incoming: int, outgoing: int, seed: int, floor_m: float = FLOOR_M) -> Samples:
    """Return a shot of which so many samples on either side are undisturbed flight, the rest is nothing at all."""
    samples = replace(averaged_shot(shot(samples=12000, seed=seed)), factor=1, spacing_s=1e-5)
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


def test_a_floor_that_only_the_longer_flight_shows_is_learned_from_it() -> None:
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


@pytest.mark.parametrize("seed", range(3))
def test_what_is_louder_after_the_contact_is_not_taken_for_noise(seed: int) -> None:
    quiet = with_flights(3000, 3000, seed, 0.0)
    loud = quiet.displacement_m.copy()
    loud[3100:] *= 3.0
    found, _ = noise_of_flights([replace(quiet, displacement_m=loud)])
    assert found.white_m == pytest.approx(WHITE_M, rel=0.1) and found.rms_m == (0.0, 0.0)
    quieter = quiet.displacement_m.copy()
    quieter[:3000] *= 3.0  # the incoming flight is what an effect has not touched yet
    found, _ = noise_of_flights([replace(quiet, displacement_m=quieter)])
    assert 1.5 * WHITE_M < found.white_m < 3.3 * WHITE_M


def test_too_little_flight_is_not_trusted() -> None:
    found, trusted = noise_of_flights([with_flights(20, 10, 5, 0.0)])
    assert not trusted
    assert found.white_m == pytest.approx(WHITE_M, rel=0.5)


def _flights_of(seed: int, rms_m: float, tau_s: float) -> list[Spectrum]:
    """Return the spectra of three flights of white noise, 0.1 nm, with an Ornstein-Uhlenbeck part."""
    random, memory = np.random.default_rng(seed), math.exp(-SPACING_S / tau_s)
    out = []
    for _ in range(3):
        walk = lfilter([math.sqrt(1 - memory**2) * rms_m], [1.0, -memory], random.normal(0.0, 1.0, 2400))[400:]
        out.append(spectrum_of(1e-10 * random.normal(0.0, 1.0, 2000) + walk))
    return out


def test_white_noise_is_seldom_given_a_part_that_wanders_and_a_part_that_does_is_found() -> None:
    calm = [likeliest_noise(_flights_of(seed, 0.0, 5e-3), SPACING_S) for seed in range(60)]
    assert sum(noise.rms_m[0] > 0.0 for noise in calm) <= 3
    white = np.array([noise.white_m for noise in calm if noise.rms_m[0] == 0.0])
    assert float(np.median(white)) == pytest.approx(1e-10, rel=0.01)
    moved = [likeliest_noise(_flights_of(seed, 3e-10, 5e-3), SPACING_S) for seed in range(20)]
    assert all(noise.rms_m[0] > 0.0 for noise in moved)
    # of the correlation times that are as likely the longest: how fast it wanders is known, how far it errs upwards
    fast = [noise.rms_m[0] / math.sqrt(noise.tau_s[0]) for noise in moved]
    assert float(np.median(fast)) == pytest.approx(3e-10 / math.sqrt(5e-3), rel=0.1)
    assert float(np.median([noise.rms_m[0] for noise in moved])) > 2.7e-10
    assert float(np.median([noise.white_m for noise in moved])) == pytest.approx(1e-10, rel=0.03)


def test_known_lines_are_left_out_of_a_flights_noise_and_what_is_slower_than_a_frame_too() -> None:
    random = np.random.default_rng(4)
    values, at = random.normal(0.0, 1e-10, 1500), np.arange(1500)
    above, lines = 0.2, np.array([0.7, 1.9])
    _, calm = spectrum_of(values, above, lines)
    loud = values + 3e-9 * np.cos(lines[0] * at) + 3e-9 * np.cos(lines[1] * at + 1.0) + 3e-8 * np.cos(0.01 * at)
    angle, power = spectrum_of(loud, above, lines)
    assert angle.min() >= above and np.abs(angle[:, None] - lines).min() > 2.0 * 2 * np.pi / 1498
    assert np.mean(power) == pytest.approx(np.mean(calm), rel=0.05)
    assert np.mean(calm) == pytest.approx(1e-20, rel=0.12)


def test_a_place_that_is_never_another_one_has_the_least_noise() -> None:
    """A place that is counted in coarse steps may stay the same all through a flight, which then has no power."""
    still = [spectrum_of(np.zeros(400)), spectrum_of(np.zeros(300))]
    noise = likeliest_noise(still, SPACING_S)
    assert 0.0 < noise.white_m <= 1e-15 and noise.rms_m == (0.0, 0.0)
