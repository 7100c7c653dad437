"""A sway's splines follow it round every kink of the contact, or fits find stiffness in what they miss."""

import numpy as np
import pytest

from analysis.collision.parameters import PAPER
from analysis.inference.noise.noise import white
from analysis.inference.noise.sway import Grid, responses, unit_sines
from analysis.inference.noise.sway_knots import knots_of
from analysis.pipeline import analyse
from analysis.shot.disturbance import Shaking
from instrument.bench.bench import Bench
from instrument.bench.mechanics import Bodies
from instrument.bench.simulate import record_shot
from instrument.bench.site import site_named

TOUCH_S = 0.012
TIME_S = np.arange(6000) * 1e-5


def _shaking(speed_m_per_s: float) -> Shaking:
    frequency = np.arange(4.0, 250.0, 6.0)
    power = (speed_m_per_s / (2 * np.pi * frequency)) ** 2
    return Shaking(frequency, power, np.ones(frequency.size, dtype=np.bool_))


@pytest.mark.parametrize("speed_m_per_s", [1e-5, 1e-6])
@pytest.mark.parametrize("missed_m", [1e-10, 1e-12])
def test_no_sample_of_the_sway_is_missed_by_more_than_was_asked(speed_m_per_s: float, missed_m: float) -> None:
    shaking = _shaking(speed_m_per_s)
    knots_s = knots_of(TIME_S, PAPER, TOUCH_S, shaking, missed_m)
    grid = Grid.of(white(1.0), knots_s, TIME_S, np.ones(TIME_S.size, dtype=np.bool_))
    sines, _ = unit_sines(grid, shaking.frequency_hz, PAPER, TOUCH_S)
    exact, _ = responses(PAPER, TIME_S - TOUCH_S, 2 * np.pi * shaking.frequency_hz)
    left = grid.columns @ sines - np.hstack([exact.real, exact.imag])
    missed = np.sqrt(left**2 @ np.tile(shaking.power_m2, 2))
    assert missed.max() < 2.0 * missed_m  # probes stand for the sines
    assert knots_s.size < 600


def test_more_knots_only_where_they_are_needed() -> None:
    few, many = (knots_of(TIME_S, PAPER, TOUCH_S, _shaking(1e-5), missed_m) for missed_m in (1e-10, 1e-12))
    assert few.size < 0.7 * many.size
    flown = many < TOUCH_S - 1e-3
    assert np.diff(many[flown]).mean() > 10 * np.diff(many[~flown]).min()


@pytest.mark.parametrize("seed", [3, 11])
def test_the_plates_stiffness_is_not_what_a_sway_left_over(seed: int) -> None:
    shot = analyse(record_shot(Bench(site=site_named("VC-A"), seed=seed), 0, 0.36, 10e6, 0.06)[0])
    assert shot.fit is not None and shot.fit.converged
    found = shot.fit.parameters["plate_stiffness_n_per_m"]
    assert abs(found.value - Bodies().plate_stiffness_n_per_m) < 3.5 * found.std
