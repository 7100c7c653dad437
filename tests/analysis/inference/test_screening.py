"""Which starts of an effect are tried besides the best: those elsewhere on its grid that explain enough."""

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.inference.fit.problem import Linearised
from analysis.inference.model.free_parameters import trial_effect
from analysis.inference.screen import columns, screening
from analysis.inference.screen.screening import Score, all_scores, distinct_starts, opposite, scores
from analysis.shot import Cancelled
from tests.analysis.diagnosis.shots import KINDS, base_fit, shots


def _scores(name: str, *starts: tuple[float, Mapping[str, float]]) -> list[Score]:
    kind = trial_effect(effect_named(name))
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
    one = (wild, np.zeros(4), np.array([[1.0, np.inf, 0.0, 2.0]]), np.array([1.0, 0.0, np.inf, 2.0]))
    other = (np.ones(4), np.ones(4), np.zeros((1, 4)), np.array([0.5, 0.0, -np.inf, 0.5]))
    starts = [{"force_n": float(k)} for k in range(4)]
    found = columns._sum_over_shots(starts, [one, other])  # a RuntimeWarning of the analysis is an error here
    assert found is not None
    assert found.starts == [starts[0], starts[3]]
    np.testing.assert_array_equal(found.power, [4.0 - 1.0 - 1.0, 6.0 - 1.0 - 4.0])
    np.testing.assert_array_equal(found.along, [1.5, 2.5])


def linear(name: str, along: float, power: float, start: float, whole: float = 0.0) -> Score:
    kind = trial_effect(effect_named(name))
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
    assert score.start[0][trial_effect(effect_named(name)).amplitude[0]] == pytest.approx(amplitude)
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
    found = screening._between(listed, trial_effect(effect_named("block_mode")))
    places = sorted({one["frequency_hz"] for one in found})
    factors = np.exp(np.linspace(-0.03, 0.03, 13))
    np.testing.assert_allclose(places, sorted([*500.0 * factors, *700.0 * factors]))
    assert {one["damping_ratio"] for one in found} == {0.003, 0.015, 0.06} and len(found) == 2 * 13 * 3
    assert {one["mass_kg"] for one in found} == {2e-5}  # as strong as it begins
    (single,) = _scores("support_compliance", (9.0, {"compliance_m_per_n": 1.0, "frequency_hz": 300.0}))
    alone = screening._between([single], trial_effect(effect_named("support_compliance")))
    assert len(alone) == 13 and set(alone[0]) == {"compliance_m_per_n", "frequency_hz"}


def test_a_start_is_turned_round_where_the_effect_may_act_either_way() -> None:
    tilt, friction = trial_effect(effect_named("tilt")), trial_effect(effect_named("coulomb_friction"))
    turned = opposite(Score(tilt, ({"angle_rad": 1e-4}, {"angle_rad": 2e-4}), 9.0, 1))
    assert turned == Score(tilt, ({"angle_rad": -1e-4}, {"angle_rad": -2e-4}), 9.0, 1)
    assert opposite(Score(tilt, ({"angle_rad": -0.4},), 9.0, 1)) is not None
    assert opposite(Score(tilt, ({"angle_rad": -0.6},), 9.0, 1)) is None  # beyond the largest
    assert opposite(Score(friction, ({"force_n": 1e-5},), 9.0, 1)) is None


@pytest.fixture(scope="module")
def at() -> Linearised:
    """Return a base fit of three shots whose frame vibrated and whose plates swung, linearised."""
    line = {"amplitude_m_per_s": 4e-7, "frequency_hz": 333.0, "phase_rad": 0.3}
    return base_fit(shots({"frame_vibration": line}, count=3)).linearise()


def explained(at: Linearised, bare: Sequence[np.ndarray]) -> tuple[float, np.ndarray]:
    """Return the fall of chi^2 by columns of each shot's own beside all parameters, and their amplitudes."""
    kept = at.problem.data.shots
    white = [shot.whitened(at.noise, one) for shot, one in zip(kept, bare, strict=True)]
    rows, width = sum(map(len, white)), white[0].shape[1]
    tangents, own = np.zeros((rows, at.tangents.size)), np.zeros((rows, width * len(white)))
    for block, places, part in zip(at.tangents.blocks, at.tangents.places, at.tangents.parts(tangents), strict=True):
        part[:, places] = block
    for index, (one, part) in enumerate(zip(white, at.tangents.parts(own), strict=True)):
        part[:, index * width : (index + 1) * width] = one
    columns = np.hstack([tangents, own])
    scale = np.linalg.norm(columns, axis=0)
    left = [
        at.whole - some @ np.linalg.lstsq(some, at.whole, rcond=1e-13)[0]
        for some in (tangents / scale[: at.tangents.size], columns / scale)
    ]
    found = np.linalg.lstsq(columns / scale, at.whole, rcond=1e-13)[0] / scale
    return float(left[0] @ left[0] - left[1] @ left[1]), found[at.tangents.size :]


def test_a_wave_of_the_sensor_gains_what_cosine_and_sine_of_each_shot_explain(at: Linearised) -> None:
    found = screening.scores(at, KINDS["frame_vibration"])
    best = found[0]
    assert [one.gain for one in found] == sorted((one.gain for one in found), reverse=True) and len(found) == 8
    omega = best.unit
    assert best.start[0]["frequency_hz"] == pytest.approx(333.0, rel=0.03) and best.freedom == 2 + 3
    assert omega == pytest.approx(2 * np.pi * best.start[0]["frequency_hz"])
    turns = [omega * shot.centre_s for shot in at.problem.data.shots]
    gain, numbers = explained(at, [np.stack([np.cos(turn), np.sin(turn)], axis=1) for turn in turns])
    assert best.gain == pytest.approx(gain, rel=1e-6) and gain > 100.0
    size = omega * np.sqrt(np.mean(np.sum(numbers.reshape(3, 2) ** 2, axis=1)))
    for start, (cosine, sine) in zip(best.start, numbers.reshape(3, 2), strict=True):
        assert start["amplitude_m_per_s"] == pytest.approx(size)
        assert np.exp(1j * start["phase_rad"]) == pytest.approx((-cosine + 1j * sine) / np.hypot(cosine, sine))


def test_amplitudes_of_each_shot_are_those_that_explain_most(at: Linearised) -> None:
    (score,) = screening.scores(at, KINDS["plate_motion"])
    kind = KINDS["plate_motion"]
    units = kind.starts[0]
    alone = [{**dict.fromkeys(units, 0.0), name: units[name]} for name in kind.amplitude]
    bare = columns.own_columns(at, kind, alone)
    assert bare is not None and len(kind.amplitude) == 2 and score.freedom == 6
    gain, numbers = explained(at, bare)
    assert score.gain == pytest.approx(gain, rel=1e-5) and score.unit == units[kind.amplitude[0]]
    for start, mine in zip(score.start, numbers.reshape(3, 2), strict=True):
        for name, number in zip(kind.amplitude, mine, strict=True):
            assert start[name] == pytest.approx(units[name] * number, rel=1e-3)


def test_a_phase_of_each_shot_is_that_of_two_quadratures_of_one_size(at: Linearised) -> None:
    kind = KINDS["cyclic_error"]
    found = scores(at, kind)
    assert sorted(one.start[0]["order"] for one in found) == [1.0, 2.0] and found[0].gain >= found[1].gain
    for score in found:
        begin = next(start for start in kind.starts if start["order"] == score.start[0]["order"])
        bare = columns.own_columns(at, kind, [{**begin, "phase_rad": turn} for turn in (0.0, np.pi / 2)])
        assert bare is not None
        gain, numbers = explained(at, bare)
        assert score.gain == pytest.approx(gain, rel=1e-5)
        size = begin["amplitude_m"] * np.sqrt(np.mean(np.sum(numbers.reshape(3, 2) ** 2, axis=1)))
        for start, (plain, quarter) in zip(score.start, numbers.reshape(3, 2), strict=True):
            assert start["amplitude_m"] == pytest.approx(size, rel=1e-3)
            towards = (plain + 1j * quarter) / np.hypot(plain, quarter)
            assert np.exp(1j * start["phase_rad"]) == pytest.approx(towards, abs=1e-3)


def test_all_effects_are_scored_in_the_order_given_until_someone_stops(at: Linearised) -> None:
    kinds = [KINDS[name] for name in ("viscous_drag", "cyclic_error", "coulomb_friction", "frame_vibration")]
    found = all_scores(at, kinds, lambda: False)
    assert [listed[0].kind.effect.name for listed in found] == [kind.effect.name for kind in kinds]
    assert found == [scores(at, kind) for kind in kinds]
    with pytest.raises(Cancelled):
        all_scores(at, kinds, lambda: True)


def test_lines_between_the_points_of_a_grid_are_searched_where_one_could_pay(at: Linearised) -> None:
    kind = KINDS["block_mode"]
    eager, plain = (scores(at, kind, to_join=join) for join in (0.0, 1e9))
    assert [one.gain for one in eager] == sorted((one.gain for one in eager), reverse=True)
    slowest = at.problem.data.band_hz[0]
    assert len(eager) > len(plain) >= sum(start["frequency_hz"] > slowest for start in kind.starts)
    assert eager[0].gain >= plain[0].gain
    beside = {one.start[0]["frequency_hz"] for one in eager} - {start["frequency_hz"] for start in kind.starts}
    assert min(abs(np.log(f / 333.0)) for f in beside) < 0.01
