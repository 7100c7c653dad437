"""The floor in flights as a covariance written out: coefficients, prior, and the mixture that is left."""

import numpy as np
import pytest

from analysis.reading.floor_spectrum import FlightObservation, Octaves, _prior, waves_of

BIN_S, WHITE_M = 5e-4, 2e-11
TIME_S = np.concatenate([np.arange(0.0, 0.0118, BIN_S), np.arange(0.0412, 0.0595, BIN_S)])
INTO = TIME_S < 0.03
DESIGN = np.stack(
    [np.where(side, (TIME_S - zero) ** k, 0.0) for side, zero in ((INTO, 0.012), (~INTO, 0.041)) for k in range(3)],
    axis=1,
)
OCTAVES = Octaves.of(TIME_S, BIN_S)
WAVES = np.hstack(waves_of(TIME_S - TIME_S.mean(), 50, BIN_S / 50, OCTAVES.frequency_hz))
RANDOM = np.random.default_rng(4)
COUNT = OCTAVES.centre_hz.size


def observed(value_m: np.ndarray, drags: tuple[int, ...] = (2, 5)) -> FlightObservation:
    return FlightObservation(value_m, WHITE_M, drags, OCTAVES, WAVES)


def by_hand(value_m: np.ndarray, at: np.ndarray, drags: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return coefficients and covariance: white noise, octaves of 3 um/s, accelerations of 1 mm/s^2 at strength one."""
    power = np.exp(at[1:-1]) * 9e-12 @ OCTAVES.power_m2
    covariance = WHITE_M**2 * np.eye(TIME_S.size) + (WAVES * np.tile(power, 2)) @ WAVES.T
    known = np.zeros(6)
    known[list(drags)] = 1.0 / ((0.5e-3) ** 2 * (np.exp(at[-1]) + 1e-8))  # the coefficient is half of it
    scale = np.abs(DESIGN).max(axis=0)
    normal = (DESIGN / scale).T @ np.linalg.solve(covariance, DESIGN / scale) + np.diag(known / scale**2)
    inverse = np.linalg.inv(normal)
    best = inverse @ (DESIGN / scale).T @ np.linalg.solve(covariance, value_m)
    return best / scale, inverse / np.outer(scale, scale)


@pytest.mark.parametrize("drags", [(2, 5), (5,), ()])
@pytest.mark.parametrize("level", [-12.0, -4.0])
def test_coefficients_are_those_of_least_squares_under_floor_white_noise_and_what_is_known_of_drags(
    drags: tuple[int, ...], level: float
) -> None:
    at = np.array([0.0, *(level + RANDOM.standard_normal(COUNT)), -1.0])
    value = WHITE_M * 30.0 * RANDOM.standard_normal(TIME_S.size)
    solution, covariance = observed(value, drags).solve(np.ones(1), at[None], DESIGN)
    best, spread = by_hand(value, at, drags)
    std = np.sqrt(np.diag(spread))
    assert (solution - best) / std == pytest.approx(np.zeros(6), abs=1e-3)
    assert covariance / np.outer(std, std) == pytest.approx(spread / np.outer(std, std), abs=1e-3)


def test_a_mixture_has_the_mean_of_its_parts_and_their_spread_besides() -> None:
    value = WHITE_M * 30.0 * RANDOM.standard_normal(TIME_S.size)
    points = np.stack([np.array([0.0, *np.full(COUNT, level), 0.0]) for level in (-12.0, -2.0)])
    weights = np.array([0.3, 0.7])
    solution, covariance = observed(value).solve(weights, points, DESIGN)
    parts = [by_hand(value, at, (2, 5)) for at in points]
    mean = 0.3 * parts[0][0] + 0.7 * parts[1][0]
    apart = 0.3 * 0.7 * np.outer(parts[0][0] - parts[1][0], parts[0][0] - parts[1][0])
    whole = 0.3 * parts[0][1] + 0.7 * parts[1][1] + apart
    std = np.sqrt(np.diag(whole))
    assert (solution - mean) / std == pytest.approx(np.zeros(6), abs=1e-3)
    assert covariance / np.outer(std, std) == pytest.approx(whole / np.outer(std, std), abs=1e-3)


def test_octaves_differ_from_their_neighbours_by_a_factor_of_a_few_before_anything_is_seen() -> None:
    at = np.array([1e-6, 0.3, 0.9, -0.6, 2.0, 1.0, -3.0])  # white noise, five octaves, the drags
    square = 1.0 + (-0.6 / 6.0) ** 2 + (-3.0 / 2.0) ** 2
    square += (0.6 / 0.6) ** 2 + (1.5 / 0.6) ** 2 + (2.6 / 3.0) ** 2 + (1.0 / 3.0) ** 2
    assert at @ _prior(5) @ at == pytest.approx(square)
    assert observed(TIME_S).powers(np.array([0.0, 0.0, np.log(4.0), 9.0])) == pytest.approx(np.array([9e-12, 36e-12]))
    assert observed(TIME_S).unknowns == COUNT + 2


@pytest.mark.parametrize(("shaken_m_per_s", "still"), [(0.0, True), (2e-5, False)])
def test_a_motionless_floor_is_one_of_the_likely_ones_where_nothing_shakes(shaken_m_per_s: float, still: bool) -> None:
    random = np.random.default_rng(8)
    size = shaken_m_per_s * np.sqrt(OCTAVES.power_m2.sum(axis=0))
    sines = WAVES @ (np.tile(size, 2) * random.standard_normal(2 * size.size))
    seen = observed(sines + WHITE_M * random.standard_normal(TIME_S.size))
    found = seen.estimate_floor(DESIGN)
    weights, all_points = found.mixture()
    assert weights.sum() == pytest.approx(1.0) and len(weights) == len(all_points) == 20 + still
    likelihood = seen.likelihood(DESIGN)
    curve = likelihood.curvature(likelihood.at(found.best))
    points = all_points[:20]
    assert points.mean(axis=0) == pytest.approx(found.best, abs=1e-9) and np.all(points[:, 0] == 0.0)
    spread = (points - found.best)[:, 1:]
    level, turn = np.linalg.eigh(curve[1:, 1:])
    unit = spread @ (turn * np.sqrt(level))
    assert unit.T @ unit / 20.0 == pytest.approx(np.eye(COUNT + 1), abs=1e-6)
    assert weights[:20] == pytest.approx(weights[0])
    assert found.worth == pytest.approx(likelihood.at(found.best).profile)
    if still:
        assert all_points[-1][1:-1] == pytest.approx(np.full(COUNT, -50.0)) and weights[-1] > 0.3
        assert all_points[-1][-1] == found.best[-1]
    else:
        speed = np.sqrt(seen.powers(found.best))[4:]
        assert np.median(speed) == pytest.approx(shaken_m_per_s, rel=0.5)
    again = seen.estimate_floor(DESIGN, (found.best,))
    assert again.worth == pytest.approx(found.worth, abs=0.02)
