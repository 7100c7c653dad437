"""One shot of the diagnosis: what it refuses, and an attraction against the simulated bench."""

import numpy as np
import pytest

from analysis.collision.parameters import Infeasible
from analysis.inference.fit.base import PLATE_NAMES
from instrument.bench.mechanics import Bodies
from instrument.bench.observation import run_shot
from tests.analysis.inference.shown import shown

TIME_S = np.arange(6000) * 1e-5
OWN = np.array([-0.265, 0.0101234, 3e-6])
BASE = np.array([221.4, 1.984e-4, 1e4, 0.4])


def test_impossible_parameters_are_refused() -> None:
    with pytest.raises(Infeasible):
        shown(TIME_S, BASE * [1, -1, 1, 1], OWN, {})
    heavy = {"block_mode": {"mass_kg": 1.0, "frequency_hz": 100.0, "damping_ratio": 0.01}}
    with pytest.raises(Infeasible):
        shown(TIME_S, BASE, OWN, heavy)
    nothing = {"second_plate_mode": {"mass_kg": 0.0, "frequency_hz": 900.0, "damping_ratio": 0.01}}
    with pytest.raises(Infeasible):
        shown(TIME_S, BASE, OWN, nothing)


@pytest.mark.parametrize("reach_m", [1e-5, 1e-4])
def test_an_attraction_is_met_as_the_bench_meets_it(reach_m: float) -> None:
    adhesion, bodies, far_m = {"force_n": 5e-3, "range_m": reach_m}, Bodies(), 3e-3
    truth = run_shot(OWN[0], {"adhesion": adhesion}, bodies, far_m, TIME_S[-1] + 1e-4)
    base = np.array([getattr(bodies, name) for name in PLATE_NAMES])
    # "Velocity in" is that of the free flight, the touch the instant it would lead to.
    own = np.array([OWN[0], far_m / -OWN[0], 0.0])
    run = shown(TIME_S, base, own, {"adhesion": adhesion})
    np.testing.assert_allclose(run.displacement_m, truth.block_m(TIME_S), atol=2e-11)


def test_a_clock_that_began_long_ago_makes_no_oscillation_faster() -> None:
    late = TIME_S + 1e4
    run = shown(late, BASE, OWN + np.array([0.0, 1e4, 0.0]), {})
    np.testing.assert_allclose(run.displacement_m, shown(TIME_S, BASE, OWN, {}).displacement_m, atol=1e-11)
    longest = 1e5 / np.sqrt(1e4 * (1 / 0.01785 + 1 / 1.984e-4) + 221.4 / 1.984e-4)
    for share, followed in ((0.97, True), (1.03, False)):
        time_s = np.arange(0.0, share * longest, 3e-4)
        if followed:
            assert np.isfinite(shown(time_s, BASE, OWN, {}).displacement_m).all()
        else:
            with pytest.raises(Infeasible, match="the contact would swing faster"):
                shown(time_s, BASE, OWN, {})
