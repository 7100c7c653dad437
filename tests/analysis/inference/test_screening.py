"""Which starts of an effect are tried besides the best: those elsewhere on its grid that explain enough."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import named
from analysis.inference.fit.free_parameters import trial_effect
from analysis.inference.screen import columns, screening
from analysis.inference.screen.screening import Score, distinct_starts, opposite


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


def linear(name: str, along: float, power: float, start: float, whole: float = 0.0) -> Score:
    kind = trial_effect(named(name))
    problem: Any = SimpleNamespace(data=SimpleNamespace(shots=[1, 2]))
    products = columns.ColumnProducts(
        [{kind.amplitude[0]: start, "frequency_hz": 7.0}], *(np.array([one]) for one in (whole or power, power, along))
    )
    at: Any = SimpleNamespace(problem=problem)
    (score,) = screening._linear(at, kind, products, 3)
    assert (score.kind, score.freedom, score.unit) == (kind, 3, start)
    assert score.start == ({kind.amplitude[0]: score.start[0][kind.amplitude[0]], "frequency_hz": 7.0},) * 2
    return score


@pytest.mark.parametrize(
    ("name", "along", "amplitude", "gain"),
    [
        # a column of square 8 with 24 along the residual: three times as much, 24^2 / 8 of chi^2
        ("bearing_gradient", 24.0, 6.0, 72.0),
        ("bearing_gradient", -24.0, -6.0, 72.0),
        ("viscous_drag", 24.0, 6.0, 72.0),
        ("viscous_drag", -24.0, 0.0, 0.0),  # a drag never drives
        ("tilt", 24.0, 0.5, 72.0),  # gained by the linear step, begun within its bounds
        ("second_plate_mode", 24.0, 2.0 / 3.0, 72.0),  # a third of the mass
        ("second_plate_mode", -24.0, 2e9, 0.0),
        ("demodulation_lag", 24.0, 2.0 * 3.0**0.5, 72.0),  # grows with its square
        ("demodulation_lag", -24.0, 2e-7, 0.0),
    ],
)
def test_a_linear_step_gives_an_amplitude_and_what_it_gains(
    name: str, along: float, amplitude: float, gain: float
) -> None:
    score = linear(name, along, 8.0, 2.0)
    assert score.start[0][trial_effect(named(name)).amplitude[0]] == pytest.approx(amplitude)
    assert score.gain == pytest.approx(gain, abs=1e-6)
    assert score.worth(100) == pytest.approx(score.gain - 3 * np.log(100))


def test_a_column_that_the_fit_spans_gains_nothing() -> None:
    assert linear("bearing_gradient", 24.0, 8.0, 2.0, whole=0.99 * 8e10).gain == pytest.approx(72.0)
    spanned = linear("bearing_gradient", 24.0, 8.0, 2.0, whole=1.01 * 8e10)
    assert (spanned.gain, spanned.power, spanned.start[0]["stiffness_n_per_m"]) == (0.0, 0.0, 0.0)


def test_lines_are_looked_for_between_the_points_about_the_two_best_peaks() -> None:
    listed = _scores(
        "block_mode", (50.0, _mode(700.0)), (100.0, _mode(500.0)), (90.0, _mode(552.0)), (40.0, _mode(900.0))
    )
    found = screening._between(listed, trial_effect(named("block_mode")))
    places = sorted({one["frequency_hz"] for one in found})
    factors = np.exp(np.linspace(-0.03, 0.03, 13))
    np.testing.assert_allclose(places, sorted([*500.0 * factors, *700.0 * factors]))
    assert {one["damping_ratio"] for one in found} == {0.003, 0.015, 0.06} and len(found) == 2 * 13 * 3
    assert {one["mass_kg"] for one in found} == {2e-5}  # as strong as it begins
    (single,) = _scores("support_compliance", (9.0, {"compliance_m_per_n": 1.0, "frequency_hz": 300.0}))
    alone = screening._between([single], trial_effect(named("support_compliance")))
    assert len(alone) == 13 and set(alone[0]) == {"compliance_m_per_n", "frequency_hz"}


def test_a_start_is_turned_round_where_the_effect_may_act_either_way() -> None:
    tilt, friction = trial_effect(named("tilt")), trial_effect(named("coulomb_friction"))
    turned = opposite(Score(tilt, ({"angle_rad": 1e-4}, {"angle_rad": 2e-4}), 9.0, 1))
    assert turned == Score(tilt, ({"angle_rad": -1e-4}, {"angle_rad": -2e-4}), 9.0, 1)
    assert opposite(Score(tilt, ({"angle_rad": -0.4},), 9.0, 1)) is not None
    assert opposite(Score(tilt, ({"angle_rad": -0.6},), 9.0, 1)) is None  # beyond the largest
    assert opposite(Score(friction, ({"force_n": 1e-5},), 9.0, 1)) is None
