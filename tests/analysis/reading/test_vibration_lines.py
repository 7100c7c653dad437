"""Steady sines in both flights: subtracted, written as waves about the middle, found and fitted above a floor."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.reading import vibration_lines
from analysis.reading.flight import Bins
from analysis.reading.floor_spectrum import FlightObservation, Octaves, waves_of
from analysis.reading.vibration_lines import (
    Wave,
    _columns,
    _frequencies,
    _is_steady,
    _strongest_line,
    add_line,
    design_matrix,
    frequency_derivative,
    line_of,
    refined,
    wave_of,
    without_lines,
)
from analysis.shot.impact import VibrationLine
from analysis.shot.quantity import Quantity
from tests.analysis.synthetic_collision import MASS_KG, Synthetic, motion_from

EACH, STEP_S = 50, 1e-5
BIN_S = EACH * STEP_S
TIME_S = np.concatenate([np.arange(0.0, 0.015, BIN_S), np.arange(0.043, 0.068, BIN_S)])
INTO = TIME_S < 0.02
WHITE_M = 2e-11
POLYNOMIALS = np.stack([INTO, INTO * TIME_S, ~INTO, ~INTO * (TIME_S - 0.05)], axis=1).astype(np.float64)
OCTAVES = Octaves.of(TIME_S, BIN_S)
WAVES = np.hstack(waves_of(TIME_S - 0.5 * (TIME_S[0] + TIME_S[-1]), EACH, STEP_S, OCTAVES.frequency_hz))


def bins_of(value_m: Any) -> Bins:
    return Bins(TIME_S, value_m, INTO, EACH, STEP_S, WHITE_M)


def seen(value_m: Any) -> FlightObservation:
    return FlightObservation(value_m, WHITE_M, (), OCTAVES, WAVES)


def tone(frequency_hz: float, amplitude_m: float, phase_rad: float) -> Any:
    """Return the means over bins of a sine, sample by sample."""
    sample = (np.arange(EACH) - 0.5 * (EACH - 1)) * STEP_S
    return amplitude_m * np.sin(2 * np.pi * frequency_hz * (TIME_S[:, None] + sample) + phase_rad).mean(axis=1)


def noise(seed: int) -> Any:
    return WHITE_M * np.random.default_rng(seed).standard_normal(TIME_S.size)


def line(frequency_hz: float, amplitude_m: float, phase_rad: float) -> VibrationLine:
    return VibrationLine(Quantity(frequency_hz, 0.0), Quantity(amplitude_m, 0.0), phase_rad)


def test_lines_are_subtracted_from_displacement_velocity_acceleration_and_force() -> None:
    rig = Synthetic(rate_hz=1e5, bandwidth_hz=1e4)
    time = np.arange(0.0, 0.01, 1e-5)
    lines = (line(310.0, 2e-8, 0.7), line(1000.0, 1e-8, 2.0))
    shaken = sum(
        one.amplitude_m.value * np.sin(2 * np.pi * one.frequency_hz.value * time + one.phase_rad) for one in lines
    )
    still, moved = motion_from(time, -0.2 * time, rig), motion_from(time, -0.2 * time + shaken, rig)
    left = without_lines(moved, lines)
    inner = slice(150, -150)
    assert left.displacement_m == pytest.approx(still.displacement_m, abs=1e-17)
    assert left.velocity_m_per_s[inner] == pytest.approx(still.velocity_m_per_s[inner], abs=2e-8)
    largest = np.abs(moved.acceleration_m_per_s2[inner]).max()
    assert np.abs(left.acceleration_m_per_s2[inner]).max() < 1e-3 * largest
    assert np.abs(left.force_n[inner]).max() < 1e-3 * MASS_KG * largest
    assert without_lines(moved, ()) is moved


def test_a_wave_and_a_line_say_the_same_sine() -> None:
    bins = bins_of(noise(1))
    wave = wave_of(bins, line(140.0, 3e-9, 1.2))
    angle = 2 * np.pi * 140.0 * (TIME_S - bins.middle_s)
    assert wave.cosine_m * np.cos(angle) + wave.sine_m * np.sin(angle) == pytest.approx(
        3e-9 * np.sin(2 * np.pi * 140.0 * TIME_S + 1.2), abs=1e-20
    )
    covariance = np.diag([4e-20, 9e-20, 25e-20])
    back = line_of(Wave(140.0, 0.0, 5e-9), covariance, 1e-9, bins.middle_s)
    assert (back.amplitude_m.value, back.amplitude_m.std) == pytest.approx((5e-9, 3e-10))
    assert (back.frequency_hz.value, back.frequency_hz.std) == pytest.approx((140.0, 0.5))
    again = line_of(wave, covariance, 1e-9, bins.middle_s)
    assert (again.amplitude_m.value, again.phase_rad) == pytest.approx((3e-9, 1.2), rel=1e-9)
    along = np.array([wave.cosine_m, wave.sine_m]) / 3e-9
    assert again.amplitude_m.std == pytest.approx(np.hypot(2e-10 * along[0], 3e-10 * along[1]), rel=1e-9)


def test_the_columns_of_a_wave_are_its_means_over_bins_and_its_derivative_by_frequency() -> None:
    bins, wave = bins_of(noise(1)), Wave(210.0, 2e-9, -1e-9)
    sample = (np.arange(EACH) - 0.5 * (EACH - 1)) * STEP_S

    def angle(frequency_hz: float) -> Any:
        return 2 * np.pi * frequency_hz * (TIME_S[:, None] + sample - bins.middle_s)

    cosine, sine, bend = _columns(bins, wave).T
    assert cosine == pytest.approx(np.cos(angle(210.0)).mean(axis=1), abs=1e-12)
    assert sine == pytest.approx(np.sin(angle(210.0)).mean(axis=1), abs=1e-12)
    by_hz = [
        wave.cosine_m * np.cos(angle(f)).mean(axis=1) + wave.sine_m * np.sin(angle(f)).mean(axis=1)
        for f in (210.001, 209.999)
    ]
    derivative, size = frequency_derivative(bins, wave)
    assert derivative[:, 0] == pytest.approx((by_hz[0] - by_hz[1]) / 0.002, abs=0.01 * size)
    assert np.abs(bend).max() == pytest.approx(1.0) and bend * size == pytest.approx(derivative[:, 0])
    assert design_matrix(bins, [wave, wave], POLYNOMIALS).shape == (TIME_S.size, 10)


@pytest.mark.parametrize("frequency_hz", [95.0, 333.0, 610.0])
def test_a_line_is_found_and_fitted_with_a_true_uncertainty(frequency_hz: float) -> None:
    pulls = []
    for seed in range(12):
        value = tone(frequency_hz, 1e-9, 0.4) + noise(seed)
        bins, observation = bins_of(value), seen(value)
        estimate = observation.estimate_floor(POLYNOMIALS)
        found = add_line(bins, observation, [], POLYNOMIALS, estimate)
        assert found is not None
        (wave,), after = found
        assert after.worth > estimate.worth + 16.0
        design = design_matrix(bins, [wave], POLYNOMIALS)
        _, covariance = observation.solve(*after.mixture(), design)
        got = line_of(wave, covariance[4:, 4:], frequency_derivative(bins, wave)[1], bins.middle_s)
        pulls.append(
            [
                (got.frequency_hz.value - frequency_hz) / got.frequency_hz.std,
                (got.amplitude_m.value - 1e-9) / got.amplitude_m.std,
            ]
        )
        assert got.frequency_hz.std < 1.0 and got.amplitude_m.std < 5e-11
    rms = np.sqrt(np.mean(np.square(pulls), axis=0))
    assert np.all((rms > 0.5) & (rms < 1.6)), rms


@pytest.mark.parametrize("flights", [1, 2])
def test_the_strongest_sine_is_found_with_its_size_in_one_flight_or_both(flights: int) -> None:
    kept = INTO | (flights == 2)
    value = tone(333.0, 1e-9, 0.4) + noise(2)
    bins = Bins(TIME_S[kept], value[kept], INTO[kept], EACH, STEP_S, WHITE_M)
    octaves = Octaves.of(bins.time_s, BIN_S)
    waves = np.hstack(waves_of(bins.time_s - bins.middle_s, EACH, STEP_S, octaves.frequency_hz))
    observation = FlightObservation(value[kept], WHITE_M, (), octaves, waves)
    columns = POLYNOMIALS[kept][:, : 2 * flights]
    at = np.array([0.0, *np.full(octaves.centre_hz.size, -40.0), 0.0])
    wave = strongest(bins, observation, at, columns)
    assert wave is not None
    assert wave.frequency_hz == pytest.approx(333.0, abs=0.2 * bins.resolution_hz)
    assert np.hypot(wave.cosine_m, wave.sine_m) == pytest.approx(1e-9, rel=0.2)
    true = tone(333.0, 1e-9, 0.4)[kept]
    cosine, sine, _ = _columns(bins, wave).T
    assert np.std(true - wave.cosine_m * cosine - wave.sine_m * sine) < 0.4 * np.std(true)
    found = add_line(bins, observation, [], columns, observation.estimate_floor(columns))
    assert found is not None and len(found[0]) == 1
    quiet = FlightObservation(noise(3)[kept], WHITE_M, (), octaves, waves)
    assert strongest(bins, quiet, at, columns) is None


def test_two_lines_are_refined_together_from_a_fifth_of_the_resolution_away() -> None:
    value = tone(160.0, 1e-9, 0.4) + tone(420.0, 5e-10, 2.0) + noise(3)
    bins, observation = bins_of(value), seen(value)
    at = np.array([0.0, *np.full(observation.unknowns - 2, -40.0), 0.0])
    off = 0.2 * bins.resolution_hz
    found = refined(bins, observation, [Wave(160.0 + off, 1e-9, 0.0), Wave(420.0 - off, 0.0, 1e-9)], POLYNOMIALS, at)
    for wave, (frequency, amplitude) in zip(found, ((160.0, 1e-9), (420.0, 5e-10)), strict=True):
        assert wave.frequency_hz == pytest.approx(frequency, abs=0.7)
        assert np.hypot(wave.cosine_m, wave.sine_m) == pytest.approx(amplitude, rel=0.05)


def test_without_a_line_none_is_found_nor_where_it_rings_after_the_impact_alone() -> None:
    for value in (noise(4), ~INTO * tone(333.0, 1e-9, 0.4) + noise(5)):
        bins, observation = bins_of(value), seen(value)
        assert add_line(bins, observation, [], POLYNOMIALS, observation.estimate_floor(POLYNOMIALS)) is None


@pytest.mark.parametrize("apart", [0.01, 1.0])
def test_no_line_is_added_that_the_last_refinement_moves_onto_another(
    apart: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    value = tone(333.0, 1e-9, 0.4) + tone(610.0, 1e-9, 1.0) + noise(7)
    bins, observation = bins_of(value), seen(value)
    first = add_line(bins, observation, [], POLYNOMIALS, observation.estimate_floor(POLYNOMIALS))
    assert first is not None
    calls: list[int] = []

    def met_at_last(*given: Any) -> list[Wave]:
        calls.append(len(given[2]))
        one, other = refined(*given)
        moved = replace(other, frequency_hz=one.frequency_hz + apart * bins.resolution_hz)
        return [one, moved if len(calls) % 2 == 0 else other]

    monkeypatch.setattr(vibration_lines, "refined", met_at_last)
    second = add_line(bins, observation, first[0], POLYNOMIALS, first[1])
    assert calls == [2, 2] or apart < 0.7
    assert (second is not None) is (apart > 0.7)


def test_a_wave_is_steady_that_is_the_same_in_both_flights_and_apart_from_every_other() -> None:
    value = tone(333.0, 1e-9, 0.4) + noise(6)
    bins, observation = bins_of(value), seen(value)
    at = np.array([0.0, *np.full(observation.unknowns - 2, -40.0), 0.0])
    (wave,) = refined(bins, observation, [Wave(333.0, 1e-9, 0.0)], POLYNOMIALS, at)
    assert _is_steady(bins, observation, [wave], POLYNOMIALS, at)
    for apart, steady in ((0.65, False), (0.75, True)):
        other = Wave(333.0 + apart * bins.resolution_hz, 1e-15, 1e-15)
        assert _is_steady(bins, observation, [other, wave], POLYNOMIALS, at) is steady
    for louder, steady in ((1.1, True), (1.4, False)):  # in the flight after the contact
        changed = np.where(INTO, 1.0, louder) * tone(333.0, 1e-10, 0.4) + noise(6)
        bins, observation = bins_of(changed), seen(changed)
        (wave,) = refined(bins, observation, [Wave(333.0, 1e-10, 0.0)], POLYNOMIALS, at)
        assert _is_steady(bins, observation, [wave], POLYNOMIALS, at) is steady


def strongest(bins: Bins, observation: FlightObservation, at: Any, design: Any) -> Wave | None:
    frequency_hz = _frequencies(bins)
    waves = observation.padded(np.hstack(bins.waves(frequency_hz)))
    return _strongest_line(observation.likelihood(design).at(at), frequency_hz, waves, bins.std_m)
