"""Block averages of a motion: the same on any grid, with the noise of a mean, and only about the contact."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.parameters import PAPER
from analysis.inference.model.samples import averaged_shot, averaged_shots
from analysis.inference.noise.floor import white_floor
from tests.analysis.collision.simulated import shot


def test_a_block_is_the_mean_of_its_samples_and_valid_where_all_are() -> None:
    motion = shot(samples=6003)
    valid = motion.valid.copy()
    valid[[17, 3000]] = False
    place = motion.displacement_m.copy()
    place[3011] = np.nan
    std = np.where(np.arange(6003) < 3000, 3.0, 4.0) * 1e-10
    motion = replace(motion, valid=valid, displacement_m=place, displacement_std_m=std, wavelength_m=5e-7)
    found = averaged_shot(motion, 30e3)  # of 100 kHz: three samples a block, to the nearest
    assert found.factor == 3 and found.spacing_s == pytest.approx(3e-5)
    blocks = found.displacement_m.size
    assert blocks == 2001 == found.valid.size == found.centre_s.size and found.used.size == 6003
    course = found.course
    near = np.abs(motion.time_s - 0.5 * (course.touch_time_s + course.release_time_s)) < (
        0.5 * (course.release_time_s - course.touch_time_s) + 5.0 * course.contact_time_s
    )
    expected = valid & np.isfinite(place) & near
    np.testing.assert_array_equal(found.used, expected)
    for block in range(0, blocks, 7):
        some = slice(3 * block, 3 * block + 3)
        assert found.valid[block] == expected[some].all()
        assert found.centre_s[block] == pytest.approx(motion.time_s[some].mean())
        mean = place[some].mean() if expected[some].all() else 0.0
        assert found.displacement_m[block] == pytest.approx(mean, abs=1e-18)
    assert not found.valid[[5, 1000, 1003]].any()
    assert found.length_s == pytest.approx(found.valid.sum() * 3e-5)
    assert found.white_m == pytest.approx(math.sqrt(np.mean(std[expected] ** 2) / 3))
    assert (found.moving_mass_kg, found.wavelength_m) == (motion.moving_mass_kg, 5e-7)
    columns = np.random.default_rng(1).standard_normal((6003, 2))
    np.testing.assert_allclose(found.averaged(columns)[4], columns[12:15].mean(axis=0))
    unknown = averaged_shot(replace(motion, displacement_std_m=np.where(expected, np.nan, std)))
    assert math.isnan(unknown.white_m) and unknown.factor == 5


def test_five_contact_times_of_flight_on_either_side_are_fitted() -> None:
    stiff = replace(PAPER, plate_stiffness_n_per_m=100.0 * PAPER.plate_stiffness_n_per_m, plate_mass_kg=1e-5)
    motion = shot(stiff, samples=9000, touch_s=0.03)
    found = averaged_shot(motion)
    course = found.course
    begin, end = course.touch_time_s - 5 * course.contact_time_s, course.release_time_s + 5 * course.contact_time_s
    assert motion.time_s[0] < begin and end < motion.time_s[-1]
    np.testing.assert_array_equal(found.used, (motion.time_s > begin) & (motion.time_s < end))


def test_shots_weigh_by_their_noise_and_must_be_sampled_alike() -> None:
    motions = [replace(shot(seed=k), displacement_std_m=np.full(6000, noise)) for k, noise in ((1, 1e-10), (2, 7e-10))]
    found = averaged_shots(motions)
    assert [one.weight for one in found] == pytest.approx([0.2, 1.4])
    silent = [motions[0], replace(motions[1], displacement_std_m=np.zeros(6000))]
    assert [one.weight for one in averaged_shots(silent)] == [1.0, 1.0]
    for factor, alike in ((1.009, True), (1.011, False)):
        other = [motions[0], replace(motions[1], sample_rate_hz=motions[1].sample_rate_hz / factor)]
        if alike:
            assert averaged_shots(other)[1].spacing_s == pytest.approx(factor * found[0].spacing_s)
        else:
            with pytest.raises(ValueError, match="sampled at different rates"):
                averaged_shots(other)


def test_what_a_frame_may_have_added_counts_where_a_noise_holds_it() -> None:
    bare = averaged_shot(shot())
    valid = bare.valid.copy()
    valid[:5] = False
    sway: Any = SimpleNamespace(
        whiten=lambda rows, floor: rows + 7.0,
        plate_displacement_m=lambda plate: np.full(valid.size, sum(plate)),
        likely=lambda left, floor: np.full(valid.sum(), 3.0),
    )
    still = replace(bare, valid=valid, weight=2.0)
    moved = replace(still, sway=sway)
    plain = white_floor(0.5, bare.spacing_s)
    framed = replace(plain, site=(0.0,))
    columns = np.random.default_rng(1).standard_normal((valid.size, 2))
    white = columns[valid]  # half a metre of noise, twice as much in this shot
    for one, floor, expected in ((still, framed, white), (moved, plain, white), (moved, framed, white + 7.0)):
        np.testing.assert_allclose(one.whitened(floor, columns), expected)
        likely = 3.0 if expected is not white else 0.0
        np.testing.assert_allclose(one.without_frame_motion(floor, columns[:, 0]), columns[:, 0] - likely * valid)
    swung = replace(moved, plate=(1.0, 2.0))
    model = bare.displacement_m - 0.25
    for one, expected in ((moved, 0.25), (swung, 3.25), (replace(still, plate=(1.0, 2.0)), 0.25)):
        np.testing.assert_allclose(one.left_m(model), expected)
