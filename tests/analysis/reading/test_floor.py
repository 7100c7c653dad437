"""The floor learned from two flights: likelihood and gradient, and velocities that are as sure as they say."""

import numpy as np
from numpy.typing import NDArray

from analysis.reading.floor_spectrum import FlightObservation, Octaves, waves_of

Floats = NDArray[np.float64]
BIN_S, WHITE_M = 5e-4, 2e-11
TIME_S = np.concatenate([np.arange(0.0, 0.0118, BIN_S), np.arange(0.0412, 0.0595, BIN_S)])
INTO = TIME_S < 0.03
DESIGN = np.stack(
    [np.where(side, (TIME_S - zero) ** k, 0.0) for side, zero in ((INTO, 0.012), (~INTO, 0.041)) for k in range(3)],
    axis=1,
)
OCTAVES = Octaves.of(TIME_S, BIN_S)
WAVES = np.hstack(waves_of(TIME_S - TIME_S.mean(), 50, BIN_S / 50, OCTAVES.frequency_hz))


def observation(value_m: Floats) -> FlightObservation:
    return FlightObservation(value_m, WHITE_M, (2, 5), OCTAVES, WAVES)


def solved(seen: FlightObservation) -> tuple[Floats, Floats]:
    return seen.solve(*seen.estimate_floor(DESIGN).mixture(), DESIGN)


def building_m(level_m_per_s: float, random: np.random.Generator) -> Floats:
    """Return a floor at a vibration criterion: the same velocity in every third of an octave from 8 to 80 Hz."""
    third = 8.0 * 2.0 ** (np.arange(-6, 15) / 3)
    frequency = np.concatenate([f * 2.0 ** (random.uniform(-0.5, 0.5, 8) / 3) for f in third])
    speed = level_m_per_s * np.minimum(1.0, frequency / 8.0) * np.minimum(1.0, (80.0 / frequency) ** 2)
    size = speed / (2 * np.pi * frequency) / np.sqrt(8)
    real, imaginary = random.normal(0.0, 1.0, (2, frequency.size)) * size
    angle = 2 * np.pi * TIME_S[:, None] * frequency
    return np.asarray(np.cos(angle) @ real + np.sin(angle) @ imaginary)


def test_the_velocities_of_flights_in_a_building_are_as_sure_as_stated() -> None:
    random = np.random.default_rng(11)
    pulls, shares = [], []
    for level in (50e-6, 12.5e-6, 3.1e-6, 0.8e-6):
        for _ in range(10):
            seen = observation(building_m(level, random) + WHITE_M * random.standard_normal(TIME_S.size))
            solution, covariance = solved(seen)
            pulls.append(solution[[1, 4]] / np.sqrt(np.diag(covariance)[[1, 4]]))
            shares.append(float(np.sqrt(covariance[1, 1])) / level)
    # 80 pulls: their rms is known to 8 %; an estimate of a spectrum from so little stays on the safe side of one
    assert 0.65 < float(np.sqrt(np.mean(np.square(pulls)))) < 1.25
    assert float(np.abs(pulls).max()) < 4.5
    assert np.ptp(np.log(np.median(np.reshape(shares, (4, 10)), axis=1))) < 0.8  # alike at every level


def test_where_nothing_shakes_white_noise_alone_decides() -> None:
    random = np.random.default_rng(3)
    plain = float(np.sqrt(np.linalg.inv(DESIGN[:, [0, 1]].T @ DESIGN[:, [0, 1]] + np.eye(2) * 1e-12)[1, 1])) * WHITE_M
    for _ in range(5):
        seen = observation(WHITE_M * random.standard_normal(TIME_S.size))
        _, covariance = solved(seen)
        assert plain < np.sqrt(covariance[1, 1]) < 6.0 * plain  # a parabola's is four times a line's


def test_a_flight_that_is_plainly_braked_is_believed() -> None:
    random = np.random.default_rng(5)
    braked = DESIGN @ np.array([0.0, 0.0, 0.25, 0.0, 0.0, -0.25])  # half a metre a second squared
    seen = observation(braked + building_m(0.8e-6, random) + WHITE_M * random.standard_normal(TIME_S.size))
    solution, covariance = solved(seen)
    assert solution[2] == np.clip(solution[2], 0.245, 0.255)
    assert abs(solution[1]) < 5.0 * np.sqrt(covariance[1, 1])
