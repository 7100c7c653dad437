"""Cross-talk from its parts: which cable is which, the taps and what they leave, and two losses close together."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signal.cross_talk import CrossTalk, find_cross_talk, swapped_cables_span_hz, without_cross_talk
from analysis.signal.rest import LossResiduals, phase_jump
from analysis.signal.survey import Survey, survey

RATE_HZ, SAMPLES = 10e6, 400_000
REST_HZ, REST_COUNTS, MOVING_COUNTS = 2.73e6, 3000.0, 2000.0


def _surveyed(low_hz: float, high_hz: float) -> Survey:
    frequency = np.linspace(low_hz, high_hz, 101)
    seen = np.ones(101, bool)
    frequency[[0, -1]], seen[0] = 9e6, False  # one stretch without a beat, and one that was misread
    return Survey(0.0, 1000.0, 40.0, np.arange(101, dtype=np.int64), 512, frequency, seen, 0.0, 0.0)


@pytest.mark.parametrize(
    ("measurement_hz", "reference_hz", "swapped"),
    [
        (0.0, 30e3, True),
        (2e3, 30e3, True),
        (4e3, 30e3, False),  # both move
        (0.0, 21e3, False),  # 0.9 of it is what lies between the 5th and the 95th percentile
        (0.0, 23e3, True),
        (500e3, 30e3, False),
        (500e3, 0.0, False),
    ],
)
def test_cables_are_swapped_where_only_pd0_moves(measurement_hz: float, reference_hz: float, swapped: bool) -> None:
    moved = swapped_cables_span_hz(_surveyed(1e6, 1e6 + measurement_hz), _surveyed(2e6, 2e6 + reference_hz))
    assert (moved is not None) == swapped
    if moved is not None:
        assert moved == pytest.approx(0.9 * reference_hz, rel=0.03)


def _beats(noise: float = 3.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return PD0 and PD1, whose beat sweeps by 1 MHz."""
    random, at = np.random.default_rng(5), np.arange(SAMPLES) / RATE_HZ
    rest = REST_COUNTS * np.cos(2 * np.pi * REST_HZ * at) + 40.0
    sweep = 2 * np.pi * (1.2e6 * at + 0.5 * 1e6 / at[-1] * at**2)
    moving = MOVING_COUNTS * np.cos(sweep) - 70.0
    return rest + random.normal(0.0, noise, SAMPLES), moving + random.normal(0.0, noise, SAMPLES)


def _counts(values: NDArray[np.float64]) -> NDArray[np.int16]:
    return np.rint(values).astype(np.int16)


def _found(reference: NDArray[np.float64], moving: NDArray[np.float64]) -> CrossTalk | None:
    rest, beat = _counts(reference), _counts(moving)
    seen = [survey(column, RATE_HZ, 16, "a beat") for column in (rest, beat)]
    return find_cross_talk(rest, beat, seen[0], seen[1], RATE_HZ)


def test_taps_take_away_what_each_of_them_says() -> None:
    random = np.random.default_rng(1)
    moving = np.rint(random.normal(50.0, 900.0, 5000))
    clean = np.rint(random.normal(0.0, 500.0, 5000))
    taps = np.array([0.25, -0.5, 0.125])
    beat = moving - moving[:: 5000 // 4096].mean()
    coupled = clean[1:-1] + taps[0] * beat[2:] + taps[1] * beat[1:-1] + taps[2] * beat[:-2]
    given = np.concatenate([[0.0], coupled, [0.0]])
    back = without_cross_talk(_counts(given), _counts(moving), CrossTalk(taps, 0.1, 0.0))
    assert back.dtype == np.int16 and np.abs(back[1:-1] - clean[1:-1]).max() <= 1
    loud = without_cross_talk(
        np.full(4, 32000, np.int16), np.array([0, 4000, -4000, 0], np.int16), CrossTalk(taps, 0.1, 0)
    )
    assert loud[1] == 32767  # and not the smallest of its kind


@pytest.mark.parametrize("lag", [-1, 0, 1])
@pytest.mark.parametrize("share", [0.04, -0.2])
def test_a_share_of_pd1_within_a_sample_is_found_with_its_size_and_taken_away(lag: int, share: float) -> None:
    rest, moving = _beats()
    coupled = rest + share * np.roll(moving, lag)
    found = _found(coupled, moving)
    assert found is not None
    assert found.ratio == pytest.approx(abs(share) * MOVING_COUNTS / REST_COUNTS, rel=0.02) and found.left < 1e-3
    clean = without_cross_talk(_counts(coupled), _counts(moving), found)
    left = (clean - rest)[2:-2]
    assert left.std() < 0.01 * abs(share) * MOVING_COUNTS + 0.5


def test_cross_talk_below_a_hundredth_of_pd0_is_left_alone() -> None:
    rest, moving = _beats()
    small = REST_COUNTS / MOVING_COUNTS
    assert _found(rest + 0.0094 * small * moving, moving) is None
    assert _found(rest + 0.0106 * small * moving, moving) is not None


def test_a_share_that_comes_and_goes_leaves_something() -> None:
    rest, moving = _beats()
    comes = 1.0 + np.sin(np.linspace(0.0, 40.0, SAMPLES))
    found = _found(rest + 0.1 * comes * moving, moving)
    assert found is not None and 0.04 < found.left < 0.07  # 0.1 of 2/3, of which the mean is taken away


def test_a_beat_that_lies_at_pd0s_all_the_time_cannot_be_told_from_it() -> None:
    rest, _ = _beats()
    at = np.arange(SAMPLES) / RATE_HZ
    near = MOVING_COUNTS * np.cos(2 * np.pi * (REST_HZ + 30e3) * at)
    assert _found(rest + 0.1 * near, near) is None
    apart = MOVING_COUNTS * np.cos(2 * np.pi * (REST_HZ + 90e3) * at)
    found = _found(rest + 0.1 * apart, apart)
    assert found is not None and found.ratio == pytest.approx(0.1 * MOVING_COUNTS / REST_COUNTS, rel=0.03)


def test_too_few_blocks_say_nothing() -> None:
    rest, moving = _beats()
    coupled, seen = rest + 0.1 * moving, survey(_counts(moving), RATE_HZ, 16, "PD1")
    few = np.zeros(seen.seen.size, bool)
    few[10:17] = True
    still = survey(_counts(coupled), RATE_HZ, 16, "PD0")
    arrays = _counts(coupled), _counts(moving)
    assert find_cross_talk(*arrays, still, replace(seen, seen=few & seen.seen), RATE_HZ) is None
    few[17] = True
    assert find_cross_talk(*arrays, still, replace(seen, seen=few & seen.seen), RATE_HZ) is not None


TURNS = 0.1234
NEAR, GUARD, LONG = 300, 100, 600


def _lossy(first: int, apart: int, lost: int, again: int) -> NDArray[np.float64]:
    """Return a tone that lacks ``lost`` samples from the place ``first`` on, and ``again`` from ``apart`` later on."""
    phase = np.arange(LONG, dtype=np.float64)
    phase[first:] += lost
    phase[first + apart :] += again
    noise = np.random.default_rng(3).normal(0.0, 2.0, LONG)
    return 500.0 * np.cos(2 * np.pi * (TURNS * phase + 0.2)) + 30.0 + noise


@pytest.mark.parametrize(("apart", "lost", "again"), [(7, 3, 5), (20, 1, 6), (31, 9, 12)])
def test_two_losses_are_told_by_their_places_and_the_size_of_the_first(apart: int, lost: int, again: int) -> None:
    first = NEAR - 12
    tones = LossResiduals.of(_lossy(first, apart, lost, again), NEAR, GUARD, TURNS)
    left, place, distance, count = tones.two_losses(TURNS)
    assert (count, distance) == (lost, apart) and place == first - (NEAR - GUARD)
    assert left < tones.limit
    whole = TURNS * (lost + again)
    assert tones.jump - whole == pytest.approx(round(tones.jump - whole), abs=6.0 * tones.sigma + 1e-3)
    assert tones.x.size == 2 * GUARD and tones.before.size == tones.after.size == 2 * GUARD + 1
    assert tones.limit == pytest.approx(2 * GUARD * (2.0 * 4.0 + 1.0), rel=0.15)


def test_the_noise_of_a_jump_is_that_of_two_phases() -> None:
    jumps, sigmas = [], []
    for seed in range(200):
        noise = np.random.default_rng(seed).normal(0.0, 25.0, LONG)
        x = 500.0 * np.cos(2 * np.pi * (TURNS * np.arange(LONG) + 0.2)) + noise
        tones = LossResiduals.of(x, NEAR, GUARD, TURNS)
        jumps.append(tones.jump)
        sigmas.append(tones.sigma)
    assert np.std(jumps) == pytest.approx(np.mean(sigmas), rel=0.15) and abs(np.mean(jumps)) < 3 * np.mean(sigmas) / 14


def test_a_jump_is_the_later_phase_minus_the_earlier_one() -> None:
    def tone(cycles: float) -> NDArray[np.float64]:
        return np.array([2.0 * np.cos(2 * np.pi * cycles), -2.0 * np.sin(2 * np.pi * cycles), 9.0])

    assert phase_jump([tone(0.1), tone(0.35)]) == pytest.approx(0.25)
    assert phase_jump([tone(0.35), tone(0.1)]) == pytest.approx(-0.25)
