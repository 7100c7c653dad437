"""What is searched is what a record shows; what is reported is what is."""

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.parameters import PAPER, Infeasible
from analysis.inference.fit.problem import Problem
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import base_named
from analysis.inference.model.effective_parameters import Point, to_effective, to_physical
from analysis.inference.model.samples import averaged_shots
from tests.analysis.diagnosis.shots import KINDS, shots
from tests.analysis.inference.shown import whole_slope

DELAY, SUPPORT = effect_named("demodulation_lag"), effect_named("support_compliance")
OWN = np.array([[-0.15, 0.0101, 1e-3], [-0.27, 0.0102, 2e-3]])
LAG, CLAMP = {"time_s": 7e-6}, {"compliance_m_per_n": 2e-4, "frequency_hz": 2200.0}


def point(compliance_m_per_n: float = 2e-4) -> Point:
    clamp = {**CLAMP, "compliance_m_per_n": compliance_m_per_n}
    return Point(PAPER.vector[:4].copy(), OWN, ({DELAY: LAG, SUPPORT: clamp},) * 2)


def flat(one: Point) -> np.ndarray:
    clamp = one.values[0][SUPPORT]
    values = [one.values[0][DELAY]["time_s"], clamp["compliance_m_per_n"], clamp["frequency_hz"]]
    return np.array([*one.base, *one.own.ravel(), *values])


def test_a_plate_on_a_soft_clamp_is_seen_softer_and_its_mode_faster() -> None:
    seen = to_effective(point())
    stiffness = PAPER.plate_stiffness_n_per_m
    assert seen.base[0] == pytest.approx(1 / (1 / stiffness + 2e-4), rel=1e-12)  # springs in series
    assert seen.values[1][SUPPORT]["frequency_hz"] == pytest.approx(2200 * (1 + 2e-4 * stiffness) ** 0.5)
    assert seen.own[:, 1] == pytest.approx(OWN[:, 1] + 7e-6, abs=1e-15)
    assert flat(to_physical(seen)) == pytest.approx(flat(point()), rel=1e-12)


def test_a_clamp_softer_than_what_is_seen_is_no_place_for_a_search() -> None:
    seen = to_effective(point())
    for share, left in ((0.91, False), (0.89, True)):
        soft = {**seen.values[0][SUPPORT], "compliance_m_per_n": share / seen.base[0]}
        one = Point(seen.base, seen.own[:1], ({**seen.values[0], SUPPORT: soft},))
        if left:
            assert to_physical(one).base[0] == pytest.approx(seen.base[0] / (1 - share), rel=1e-9)
        else:
            with pytest.raises(Infeasible, match="clamp"):
                to_physical(one)


def test_a_point_has_an_effect_more_with_values_for_each_shot() -> None:
    more = point().with_effect(effect_named("tilt"), [{"angle_rad": 1.0}, {"angle_rad": 2.0}])
    assert more.base is not more.own and more.base.tolist() == point().base.tolist() and more.own is OWN
    assert [values[effect_named("tilt")]["angle_rad"] for values in more.values] == [1.0, 2.0]
    assert [values[DELAY] for values in more.values] == [LAG] * 2
    bare = Point(PAPER.vector[:4].copy(), OWN, ({}, {}))
    assert to_effective(bare).own.tolist() == OWN.tolist() == to_physical(bare).own.tolist()


def test_the_slope_is_that_of_the_parameters() -> None:
    data = JointData(averaged_shots(shots({}, count=2)), base_named("paper"))
    problem = Problem(data, (KINDS["demodulation_lag"], KINDS["support_compliance"]), data.white_noise)
    z = problem.pack(point())
    slope = whole_slope(problem, z)
    for column in range(problem.size):
        step = np.zeros(z.size)
        step[column] = 1e-6 * max(abs(z[column]), 1.0)
        up, down = (flat(problem.unpack(z + sign * step)) for sign in (1, -1))
        assert slope[:, column] == pytest.approx((up - down) / (2 * step[column]), rel=1e-5, abs=1e-8)
