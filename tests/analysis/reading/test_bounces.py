"""The short flights between the first contacts: whether the block moves freely in them."""

import numpy as np
import pytest

from analysis.reading.bounces import _is_straight
from analysis.reading.edges import Edge
from tests.analysis.synthetic_collision import Synthetic, motion_from

RIG = Synthetic(noise_m=0.1e-9)
RELEASE, ONSET = Edge(1.0e-3, 1e-6), Edge(1.8e-3, 1e-6)


@pytest.mark.parametrize(("bend_m", "straight"), [(0.0, True), (2e-9, False)])
def test_a_flight_whose_displacement_bends_by_more_than_the_noise_is_not_free(bend_m: float, straight: bool) -> None:
    time_s = np.arange(0.0, 3e-3, 1.0 / RIG.rate_hz)
    tau = (time_s - RELEASE.time_s) / (ONSET.time_s - RELEASE.time_s)
    displacement_m = 0.1 * time_s + bend_m * np.sin(np.pi * tau)
    displacement_m += np.random.default_rng(1).normal(0.0, RIG.noise_m, time_s.size)
    motion = motion_from(time_s, displacement_m, RIG)
    assert _is_straight(motion, (RELEASE, ONSET), RIG.noise_m) is straight
