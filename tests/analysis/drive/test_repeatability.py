"""Cycles of one record and records of one input: found where they are, and by how much they differ."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.drive.regression import regress
from analysis.drive.repeatability import Repeatability, _cycle_lag, _record_pairs, folds, repeatability_of
from analysis.drive.stretch import Table, prepare
from analysis.shot.motion import Motion
from analysis.signal.record import motion_from_displacement
from tests.analysis.drive.slider import Drive, Floats


def cycle(seed: int, length: int) -> Floats:
    """Return one cycle of a motion that returns to where it began."""
    steps = np.random.default_rng(seed).standard_normal(length)
    return np.asarray(np.cumsum(steps - steps.mean()))


@pytest.mark.parametrize(("times", "lag"), [(5.0, 160), (1.4, 160), (1.3, None), (0.5, None)])
def test_a_motion_has_a_cycle_where_a_quarter_of_it_is_seen_again(times: float, lag: int | None) -> None:
    place = np.tile(cycle(1, 160), 6)[: round(times * 160)]
    if times == 1.4:  # a hundred samples at least
        place, lag = np.tile(cycle(1, 480), 2)[: round(times * 480)], 480
    assert _cycle_lag(place) == lag


@pytest.mark.parametrize(("noise", "repeats"), [(0.5, True), (1.0, False)])
def test_passes_of_a_cycle_are_alike_to_a_hundredth_of_the_motion(noise: float, repeats: bool) -> None:
    place = np.tile(cycle(2, 90), 8)
    spread = (
        0.01 * np.std(place) * noise * np.random.default_rng(3).standard_normal(place.size)
    )  # twice in a difference
    assert _cycle_lag(place + spread) == (90 if repeats else None)


def test_samples_that_are_not_known_take_no_part_in_a_cycle() -> None:
    place = np.tile(cycle(4, 70), 7)
    place[[3, 5, 40, 200]] = np.nan
    assert _cycle_lag(place) == 70
    place[95:] = np.nan
    assert _cycle_lag(place) is None


def test_a_fold_is_a_sixth_of_the_cycle_or_of_each_record() -> None:
    table = Table.of(prepare([Drive(waves=((0.05, 0.5), (0.02, 1.0)), seconds=12.0, encoder_m=1e-6).motion()]))
    phase = np.mod(table.time_s - table.time_s[0], 2.0) / 2.0
    inside = np.abs(np.mod(6.0 * phase + 0.5, 1.0) - 0.5) > 0.05
    assert inside.mean() > 0.8
    np.testing.assert_array_equal(folds(table, 6)[inside], np.floor(6.0 * phase)[inside])
    apart = Table.of(prepare([Drive(seconds=s, encoder_m=1e-6).motion() for s in (7.0, 9.0)]))
    found = folds(apart, 5)
    for record in (0, 1):
        of, time_s = found[apart.record == record], apart.time_s[apart.record == record]
        assert np.array_equal(np.unique(of), np.arange(5)) and np.all(np.diff(of) >= 0)
        borders = time_s[1:][np.diff(of) > 0] - time_s[0]
        np.testing.assert_allclose(borders, np.arange(1, 5) / 5 * np.ptp(time_s), atol=0.05)


def again(motion: Motion, factor: float, force: Floats, rate: float = 1.0) -> Motion:
    return motion_from_displacement(
        motion.time_s / rate + 7.0, factor * motion.displacement_m, None, force, moving_mass_kg=None
    )


def pairs(*motions: Motion) -> list[Any]:
    return list(_record_pairs(Table.of(prepare(motions))))


def test_records_of_one_motion_or_of_one_force_belong_together() -> None:
    motion = Drive(seconds=9.0, encoder_m=1e-6, noise_n=0.1).motion()
    other = motion.force_n + 40.0 * np.sin(9.0 * motion.time_s)
    assert len(pairs(motion, again(motion, 1.005, other))) == 1
    assert pairs(motion, again(motion, 1.02, other)) == []
    assert len(pairs(motion, again(motion, 1.02, motion.force_n))) == 1
    for rate in (0.999, 1.001):
        assert pairs(motion, again(motion, 1.0, motion.force_n, rate)) == []
    assert len(pairs(motion, again(motion, 1.0, other), again(motion, 1.001, other))) == 3
    ((early, late, cycle_s),) = pairs(motion, again(motion, 1.0, other))
    table = Table.of(prepare([motion, again(motion, 1.0, other)]))
    assert set(table.record[early]) == {0} and set(table.record[late]) == {1}
    np.testing.assert_allclose(table.time_s[late] - table.time_s[early], 7.0, atol=1e-9)
    assert early.size == np.sum(table.record == 0)
    assert cycle_s is None


@pytest.mark.parametrize(
    ("size", "common", "enough"), [(1000, 251, True), (1000, 249, False), (300, 101, True), (300, 99, False)]
)
def test_records_belong_together_where_a_quarter_of_them_and_a_hundred_samples_are_common(
    size: int, common: int, enough: bool
) -> None:
    """The second record's compared samples begin as late after its first as those that are common end the first's."""
    numbers = np.concatenate([np.arange(size), np.arange(2 * size) + size - common])
    record = np.repeat([0, 1], [size, 2 * size])
    place = np.random.default_rng(1).standard_normal(4 * size)[numbers]
    stretches = [
        SimpleNamespace(record=k, sample_rate_hz=50.0, time_s=np.array([begin])) for k, begin in ((0, 3.0), (1, 9.0))
    ]
    stretches.append(SimpleNamespace(record=1, sample_rate_hz=50.0, time_s=np.array([11.0])))
    table: Any = SimpleNamespace(
        stretches=stretches, record=record, time_s=np.where(record == 0, 3.0, 9.0) + numbers / 50.0,
        displacement_m=place, force=lambda: np.arange(numbers.size, dtype=float),
    )  # fmt: skip
    found = list(_record_pairs(table))
    assert len(found) == enough
    for early, late, _ in found:
        np.testing.assert_array_equal(early, np.arange(size - common, size))
        np.testing.assert_array_equal(late, np.arange(size, size + common))


def test_what_mass_and_drag_make_of_passes_that_differ_is_no_scatter() -> None:
    one, two = (Drive(seconds=9.0, encoder_m=1e-6, noise_n=0.5, seed=seed).motion() for seed in (1, 2))
    table = Table.of(prepare([one, again(two, 1.008, 1.008 * two.force_n + 30.0)]))
    found = regress(table)
    white = regress(Table.of(table.stretches[:1])).rms_n
    seen = repeatability_of(table, found, 0.01)
    assert seen.repeats and seen.cycle_s is None
    assert seen.force_n == pytest.approx(white, rel=0.15)
    assert repeatability_of(Table.of(table.stretches[:1]), found, 0.3) == Repeatability(0.3, False)
