"""A search vector: what each entry stands for, its bounds and slopes."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.inference.fit.problem import Problem
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import base_named
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.samples import averaged_shots
from tests.analysis.collision.simulated import shot
from tests.analysis.diagnosis.shots import KINDS, base_fit, shots
from tests.analysis.inference.shown import whole_slope


def test_the_slope_of_a_search_vector_is_that_of_the_parameters_it_stands_for() -> None:
    """With shared effects and ones of every shot, searched by size and by logarithm."""
    best = base_fit(shots({}, count=2))
    kinds = (KINDS["viscous_drag"], KINDS["plate_motion"], KINDS["block_mode"])
    problem = Problem(best.problem.data, kinds, best.noise)
    drag, swing, mode = (kind.effect for kind in kinds)
    values = tuple(
        {
            drag: {"coefficient_n_s_per_m": 2e-4},
            swing: {"velocity_m_per_s": v, "displacement_m": 1e-8},
            mode: {"mass_kg": 1e-5, "frequency_hz": 700.0, "damping_ratio": 0.02},
        }
        for v in (1e-6, -3e-6)
    )
    there = Point(best.point.base, best.point.own, values)
    z = problem.pack(there)
    assert problem.names[problem.offset :] == (
        ("viscous_drag.coefficient_n_s_per_m", -1), ("block_mode.mass_kg", -1), ("block_mode.frequency_hz", -1),
        ("block_mode.damping_ratio", -1), ("plate_motion.velocity_m_per_s", 0), ("plate_motion.displacement_m", 0),
        ("plate_motion.velocity_m_per_s", 1), ("plate_motion.displacement_m", 1),
    )  # fmt: skip
    assert problem.shared == [0, 1, 2, 3, 10, 11, 12, 13] and problem.offset == 10 and problem.size == 18
    assert [place.tolist() for place in problem.places] == [
        [*problem.shared, 4, 5, 6, 14, 15], [*problem.shared, 7, 8, 9, 16, 17],
    ]  # fmt: skip
    flat = problem.flat(there)
    np.testing.assert_allclose(problem.flat(problem.unpack(z)), flat, rtol=1e-9)
    assert flat[10:].tolist() == [2e-4, 1e-5, 700.0, 0.02, 1e-6, 1e-8, -3e-6, 1e-8]
    slope = whole_slope(problem, z)
    for k in range(problem.size):
        step = np.zeros(z.size)
        step[k] = 1e-5 * max(1.0, abs(z[k]))
        sides = [problem.flat(problem.unpack(z + sign * step)) for sign in (1.0, -1.0)]
        numeric = (sides[0] - sides[1]) / (2 * step[k])
        np.testing.assert_allclose(slope[:, k] / np.abs(flat), numeric / np.abs(flat), rtol=1e-4, atol=1e-5)
    low, high = problem.bounds
    assert low[3] == 0.0 and np.isinf(low[[0, 1, 2, 4]]).all() and np.isinf(high[:10]).all()
    slowest, fastest = problem.data.band_hz  # a line may lie a little below those that are looked for
    assert (low[12], high[12]) == pytest.approx((np.log(0.8 * slowest), np.log(fastest)))
    assert low[10] == 0.0 and high[13] == pytest.approx(np.log(0.6))
    assert problem.unseen == []


def test_shots_on_several_plates_share_the_contact_and_what_is_chosen_is_no_entry() -> None:
    """Of three plates one is not seen; a vector for some of the shots means what it does for all of them."""
    two = averaged_shots([shot(seed=1), shot(seed=2)])
    taken = (two[0], replace(two[1], plate_number=2, moving_mass_kg=0.03))
    base = base_named("paper").on_plates(3)
    kind = KINDS["cyclic_error"]
    problem = Problem(
        JointData(taken, base), (kind,), JointData(two, base).stated_noise, fixed={kind.effect: {"order": 2.0}}
    )
    assert problem.unseen == [4, 5] and problem.offset == 8 + 6 and problem.size == 14 + 3
    assert problem.names[14:] == (
        ("cyclic_error.amplitude_m", -1), ("cyclic_error.phase_rad", 0), ("cyclic_error.phase_rad", 1)
    )  # fmt: skip
    assert problem.bounds[0][3] == 0.0 and np.isinf(problem.bounds[0][[0, 1, 2, 4, 5, 6, 7]]).all()
    values = tuple({kind.effect: {"amplitude_m": 1e-9, "order": 2.0, "phase_rad": turn}} for turn in (0.3, 0.4))
    there = Point(np.array([200.0, 2e-4, 1e4, 0.4, 300.0, 3e-4, 400.0, 4e-4]), np.full((2, 3), -0.1), values)
    back = problem.unpack(problem.pack(there))
    np.testing.assert_allclose(problem.flat(back), problem.flat(there), rtol=1e-9)
    assert [one[kind.effect]["order"] for one in back.values] == [2.0, 2.0]
    alone = Problem(JointData(taken[1:], base, reference_mass_kg=taken[0].moving_mass_kg), (), problem.noise)
    np.testing.assert_allclose(
        alone.pack(Point(there.base, there.own[1:], ({},)))[:8], problem.pack(there)[:8], rtol=1e-12
    )
    assert alone.unseen == [0, 1, 4, 5]
    one = JointData(two, base_named("contact"))
    assert Problem(one, (), one.stated_noise).bounds[0][1] == 0.0 and not Problem(one, (), one.stated_noise).unseen
