"""Which starts of an effect are tried besides the best: those elsewhere on its grid that explain enough."""

from collections.abc import Mapping

import numpy as np
import pytest

from analysis.collision.effects import named
from analysis.inference.fit.free_parameters import trial_effect
from analysis.inference.screen import columns
from analysis.inference.screen.screening import Score, distinct_starts


def _scores(name: str, *starts: tuple[float, Mapping[str, float]]) -> list[Score]:
    kind = trial_effect(named(name))
    return [Score(kind, (start, start), gain, 2) for gain, start in starts]


def _mode(frequency_hz: float) -> Mapping[str, float]:
    return {"mass_kg": 1e-4, "frequency_hz": frequency_hz, "damping_ratio": 0.01}


def test_a_second_peak_is_tried_and_the_neighbours_of_the_first_are_not() -> None:
    listed = _scores("block_mode", (100.0, _mode(500.0)), (90.0, _mode(555.0)), (40.0, _mode(700.0)))
    assert distinct_starts(listed) == [listed[0], listed[2]]  # 11 % away, and 40 %
    further = _scores("block_mode", (100.0, _mode(500.0)), (90.0, _mode(570.0)), (80.0, _mode(440.0)))
    assert distinct_starts(further) == further
    beside_the_second = _scores("block_mode", (100.0, _mode(500.0)), (90.0, _mode(700.0)), (80.0, _mode(690.0)))
    assert distinct_starts(beside_the_second) == beside_the_second[:2]


def test_what_explains_less_than_a_third_of_the_best_is_not_tried() -> None:
    listed = _scores("block_mode", (100.0, _mode(500.0)), (31.0, _mode(700.0)), (29.0, _mode(900.0)))
    assert distinct_starts(listed) == listed[:2]


def test_three_are_tried_at_most() -> None:
    listed = _scores("block_mode", *((100.0 - k, _mode(300.0 * 1.5**k)) for k in range(5)))
    assert distinct_starts(listed) == listed[:3]


@pytest.mark.parametrize(
    ("name", "amplitude", "scale"),
    [("viscoelastic_arm", "stiffness_n_per_m", "relaxation_time_s"), ("adhesion", "force_n", "range_m")],
)
def test_a_time_or_a_range_sets_starts_apart_as_a_frequency_does(name: str, amplitude: str, scale: str) -> None:
    starts = [{amplitude: 1.0, scale: size} for size in (1e-4, 1.05e-4, 2e-4)]
    listed = _scores(name, *zip((9.0, 8.0, 7.0), starts, strict=True))
    assert distinct_starts(listed) == [listed[0], listed[2]]


def test_where_nothing_but_the_amplitude_differs_the_best_is_enough() -> None:
    listed = _scores("viscous_drag", *((10.0 - k, {"coefficient_n_s_per_m": 1e-4 * 3**k}) for k in range(3)))
    assert distinct_starts(listed) == listed[:1]
    assert distinct_starts([]) == []


def test_a_start_that_leads_beyond_all_numbers_is_left_out_in_silence() -> None:
    wild = np.array([3.0, np.inf, np.inf, 5.0])
    one = columns._ShotProducts(
        wild, np.zeros(4), np.array([[1.0, np.inf, 0.0, 2.0]]), np.array([1.0, 0.0, np.inf, 2.0])
    )
    other = columns._ShotProducts(np.ones(4), np.ones(4), np.zeros((1, 4)), np.array([0.5, 0.0, -np.inf, 0.5]))
    starts = [{"force_n": float(k)} for k in range(4)]
    found = columns._sum_over_shots(starts, [one, other])  # a RuntimeWarning of the analysis is an error here
    assert found is not None
    assert found.starts == [starts[0], starts[3]]
    np.testing.assert_array_equal(found.power, [4.0 - 1.0 - 1.0, 6.0 - 1.0 - 4.0])
    np.testing.assert_array_equal(found.along, [1.5, 2.5])
