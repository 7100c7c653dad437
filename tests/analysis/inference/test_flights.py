"""The noise of quiet flights against numpy and scipy: spectra, the likeliest levels, which flights count."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import lfilter

from analysis.inference.noise import flights
from analysis.inference.noise.flights import (
    Spectrum,
    _density,
    _flight,
    _power_not_above,
    _two_levels,
    _wandering,
    flights_allow,
    likeliest_noise,
    spectrum_of,
)
from analysis.inference.noise.floor import Floor
from analysis.inference.noise.site import STILL_FRAME

SPACING_S = 5e-5


def test_a_spectrum_is_that_of_the_tapered_flight_without_its_parabola() -> None:
    random = np.random.default_rng(1)
    at, values = np.arange(60), random.standard_normal(60)
    bent = values + 1e3 - 40.0 * at + 0.7 * at**2
    left = values - np.polyval(np.polyfit(at, values, 2), at)
    taper = np.sin(np.pi * (at + 0.5) / 60) ** 2
    angle, power = spectrum_of(bent)
    np.testing.assert_allclose(angle, 2 * np.pi * np.arange(3, 30) / 60)
    by_hand = [abs(np.sum(left * taper * np.exp(-1j * a * at))) ** 2 / np.sum(taper**2) for a in angle]
    np.testing.assert_allclose(power, by_hand, rtol=1e-6)


def test_above_a_frequency_a_spectrum_is_that_of_second_differences() -> None:
    values, above = np.random.default_rng(2).standard_normal(62), 0.5
    second = values[2:] - 2 * values[1:-1] + values[:-2]
    at = np.arange(60)
    taper = np.sin(np.pi * (at + 0.5) / 60) ** 2
    angle, power = spectrum_of(values, above, np.array([1.5]))
    every = 2 * np.pi * np.arange(1, 30) / 60
    np.testing.assert_allclose(angle, [a for a in every if a >= above and abs(a - 1.5) > 2 * 2 * np.pi / 60])
    near = [np.ones(60), *(f(1.5 * at) * slope for f in (np.cos, np.sin) for slope in (1.0, at - 29.5))]
    left = second - np.transpose(near) @ np.linalg.lstsq(np.transpose(near), second, rcond=None)[0]
    transform = [abs(np.sum(left * taper * np.exp(-1j * a * at))) ** 2 for a in angle]
    np.testing.assert_allclose(power, transform / np.sum(taper**2) / (2 - 2 * np.cos(angle)) ** 2, rtol=1e-9)


def test_the_density_of_a_part_that_wanders_is_the_transform_of_its_covariance() -> None:
    noise = Floor(2.0, (3.0, 0.0), (4e-4, 1e-2), SPACING_S)
    lag = np.arange(-2000, 2001)
    for angle in (0.05, 0.6, 3.0):
        covariance = 9.0 * np.exp(-np.abs(lag) * SPACING_S / 4e-4)
        exact = 4.0 + float(np.sum(covariance * np.cos(angle * lag)))
        assert _density(noise, np.array([angle]))[0] == pytest.approx(exact, rel=1e-9)


def whittle(power: np.ndarray, model: np.ndarray) -> float:
    return float(np.sum(np.log(model) + power / model))


@pytest.mark.parametrize("share", [0.0, 1e-3, 0.3, 30.0])
def test_two_levels_are_where_the_whittle_likelihood_is_greatest(share: float) -> None:
    angle = np.linspace(0.01, 3.1, 400)
    shape = _wandering(angle, 1.0, 0.97)
    power = np.random.default_rng(3).exponential(2.0 * (1.0 + share * shape))
    a, b = _two_levels(power, shape)
    found = minimize(
        lambda z: whittle(power, math.exp(z[0]) + math.exp(z[1]) * shape), [0.5, -1.0], method="Nelder-Mead",
        options={"xatol": 1e-8, "fatol": 1e-10, "maxiter": 4000},
    )  # fmt: skip
    assert whittle(power, a + b * shape) == pytest.approx(found.fun, abs=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_a_wandering_part_must_pay_and_of_those_as_likely_the_slowest_is_taken(seed: int) -> None:
    angle = np.pi * np.arange(1, 500) / 500
    memory = math.exp(-SPACING_S / 3e-3)
    true = 1e-20 * (1.0 + 0.05 * (seed % 3) * _wandering(angle, 1.0, memory))
    power = np.random.default_rng(seed).exponential(true)
    found = likeliest_noise([(angle[:200], power[:200]), (angle[200:], power[200:])], SPACING_S)
    flat = 0.5 * whittle(power, np.full(power.size, power.mean()))
    tried = []
    for tau_s in np.geomspace(1e-3, 30e-3, 7):
        shape = _wandering(angle, 1.0, math.exp(-SPACING_S / tau_s))
        a, b = _two_levels(power, shape)
        tried.append((0.5 * whittle(power, a + b * shape), tau_s, a, b))
    least = min(tried)[0]
    if flat - least < 4.0:
        assert found.rms_m == (0.0, 0.0) and found.white_m == pytest.approx(math.sqrt(power.mean()))
    else:
        _, tau_s, a, b = max((one for one in tried if one[0] < least + 1.0), key=lambda one: one[1])
        assert found.tau_s[0] == pytest.approx(tau_s) and found.rms_m == (pytest.approx(math.sqrt(b)), 0.0)
        assert found.white_m == pytest.approx(math.sqrt(a), rel=1e-6)


def test_white_noise_is_a_tenth_of_the_density_at_the_highest_frequency_at_least() -> None:
    angle = np.pi * np.arange(1, 500) / 500
    memory = math.exp(-SPACING_S / 1e-3)
    power = np.random.default_rng(7).exponential(1e-20 * _wandering(angle, 1.0, memory))
    found = likeliest_noise([(angle, power)], SPACING_S)
    top = float(_density(found, np.array([np.pi]))[0])
    assert found.white_m**2 == pytest.approx(0.1 * (top - found.white_m**2), rel=0.15)


@pytest.mark.parametrize(("times", "quiet"), [(0.97, True), (1.03, False)])
def test_a_flight_is_as_quiet_as_another_within_three_standard_errors(times: float, quiet: bool) -> None:
    part, of_noise = np.arange(60) < 50, np.arange(80) < 20
    limit = 1 + 3 * math.sqrt(2 / 50 + 2 / 20)
    ratio = np.where(part, times * limit, 1e9)
    assert _power_not_above(ratio, part, of_noise) is quiet
    few = np.where(part, times * (1 + 3 * math.sqrt(2 / 50 + 2 / 4)), 1e9)
    assert _power_not_above(few, part, of_noise[:0]) is quiet  # known from four bins at least
    assert _power_not_above(ratio, np.zeros(60, dtype=bool), of_noise)


def test_the_longest_part_of_a_flight_without_a_gap_is_read_in_whole_blocks() -> None:
    valid = np.ones(30, dtype=bool)
    valid[[4, 12]] = False
    shot: Any = SimpleNamespace(factor=3, valid=valid, displacement_m=np.arange(30.0), weight=2.0)
    assert _flight(shot, slice(4, 75)).tolist() == [k / 2 for k in range(13, 25)]
    assert _flight(shot, slice(4, 65)).tolist() == [k / 2 for k in range(13, 21)]
    assert _flight(shot, slice(7, 35)).tolist() == [k / 2 for k in range(5, 11)]
    assert _flight(shot, slice(12, 15)).size == 0


def test_with_a_frame_its_random_motion_and_its_lines_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, float, list[float]]] = []

    def spectrum(values: np.ndarray, above: float, lines: np.ndarray) -> Any:
        asked.append((values.size, above, lines.tolist()))
        return np.array([1.0, 2.0]), np.array([1e-20, 1e-20])

    monkeypatch.setattr(flights, "spectrum_of", spectrum)
    vibration = SimpleNamespace(
        frequency_hz=np.array([1.0, 30.0, 55.0, 90.0]), random=np.array([True, True, False, False])
    )
    site: Any = SimpleNamespace(vibration=vibration, bands=3)
    course = SimpleNamespace(quiet_in=slice(0, 24), quiet_out=slice(30, 53))  # one sample too few
    shot: Any = SimpleNamespace(
        spacing_s=1e-3, course=course, factor=1, valid=np.ones(60, dtype=bool), displacement_m=np.zeros(60), weight=1.0
    )
    noise, trusted = flights.noise_of_flights([shot], site)
    assert asked == [(24, pytest.approx(0.06 * np.pi), [pytest.approx(0.11 * np.pi), pytest.approx(0.18 * np.pi)])]
    assert trusted and noise.site == (0.0, 0.0, 0.0) and noise.white_m == pytest.approx(1e-10)
    alone, _ = flights.noise_of_flights([shot])
    assert alone.site == () and asked[-1] == (24, 0.0, [])
    short = SimpleNamespace(**{**vars(shot), "course": replace_course(course)})
    short.displacement_m = 1e-9 * np.random.default_rng(1).standard_normal(60)
    noise, trusted = flights.noise_of_flights([short], site)  # type: ignore[list-item]
    assert not trusted and noise.site == (0.0, 0.0, 0.0) and noise.white_m == pytest.approx(1e-9, rel=0.5)


def replace_course(course: Any) -> Any:
    return SimpleNamespace(quiet_in=slice(0, 23), quiet_out=course.quiet_out)


def test_a_floor_in_its_parts() -> None:
    noise = Floor(3.0, (4.0, 12.0), (1e-3, 1e-2), SPACING_S, (0.5,))
    assert noise.std_m == 13.0 and noise.wander == ((4.0, 1e-3), (12.0, 1e-2)) and noise.coloured
    assert noise.still == Floor(3.0, (0.0, 0.0), (1e-3, 1e-2), SPACING_S)
    assert not noise.still.coloured and replace(noise.still, site=(0.0,)).coloured
    assert replace(noise, site=()).coloured
    assert replace(noise, rms_m=(0.0, 2.0)).wander == ((2.0, 1e-2),)
    white, q0, phi0, p0, q1, phi1, p1 = noise.kalman
    assert (white, p0, p1) == (9.0, 16.0, 144.0)
    assert (phi0, phi1) == (pytest.approx(math.exp(-0.05)), pytest.approx(math.exp(-0.005)))
    assert (q0 + phi0**2 * p0, q1 + phi1**2 * p1) == (pytest.approx(16.0), pytest.approx(144.0))  # it stays as it is


def test_a_strong_line_is_taken_out_of_a_short_flight_although_its_frequency_is_not_quite_known() -> None:
    """A transformer's 32 nm in flights of 12 ms whose noise is 40 pm; a hundredth of a bin is what a reading leaves."""
    at, line, above = np.arange(238), 0.093, 0.1187
    beside = []
    for seed in range(60):
        random = np.random.default_rng(seed)
        off = 0.02 * random.standard_normal() * 2 * np.pi / 238
        loud = 3.2e-8 * np.cos((line + off) * at + 1.0) + 4e-11 * random.standard_normal(238)
        angle, power = spectrum_of(loud, above, np.array([line]))
        beside.append(np.mean(power[angle < 0.35]))
    assert float(np.mean(beside)) == pytest.approx(1.6e-21, rel=0.15)


def test_a_wander_is_found_beside_lines() -> None:
    """Else a faint line that a reading takes to be there hides the wander, and clean shots seem to lack an effect."""
    memory = np.exp(-SPACING_S / 1e-3)

    def spectra(seed: int, lines: tuple[float, ...]) -> list[Spectrum]:
        random = np.random.default_rng(seed)
        out = []
        for size in (238, 306) * 3:
            kicks = 4.5e-11 * np.sqrt(1 - memory**2) * random.standard_normal(size)
            wander = lfilter([1.0], [1.0, -memory], kicks)
            out.append(spectrum_of(wander + 4e-11 * random.standard_normal(size), 0.1187, np.array(lines)))
        return out

    def found(*lines: float) -> int:
        return sum(likeliest_noise(spectra(seed, lines), SPACING_S).rms_m[0] > 0.0 for seed in range(40))

    assert found(0.093, 0.225) >= 38  # 27 where four bins were left out beside each


@pytest.mark.parametrize("seed", range(4))
def test_flights_allow_a_wander_that_they_do_not_contradict(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wander may be too faint for them to show; one that has absorbed a missing effect is larger than they bear."""
    angle = np.pi * np.arange(20, 250) / 250
    faint = Floor(1e-10, (4e-11, 0.0), (1e-3, 1e-2), SPACING_S)
    both = replace(faint, rms_m=(4e-11, 3e-11), tau_s=(1e-3, 2e-3))
    power = np.random.default_rng(seed).exponential(_density(faint, angle))
    shots: Any = [SimpleNamespace(spacing_s=SPACING_S)]
    white = Floor(1e-10, (0.0, 0.0), (1e-2, 1e-2), SPACING_S)
    monkeypatch.setattr(flights, "_spectra_of_flights", lambda shots, site: ([(angle, power)], []))
    allowed = [
        flights_allow(one, shots, STILL_FRAME) for one in (white, faint, both, replace(faint, rms_m=(4e-10, 0.0)))
    ]
    assert allowed == [True, True, True, False]
    monkeypatch.setattr(flights, "_spectra_of_flights", lambda shots, site: ([], []))
    assert not flights_allow(white, shots, STILL_FRAME)


def test_the_density_of_two_parts_is_the_sum_of_both() -> None:
    angle = np.array([0.05, 0.6, 3.0])
    one, other = (Floor(2.0, (rms, 0.0), (tau_s, 1e-2), SPACING_S) for rms, tau_s in ((3.0, 4e-4), (5.0, 2e-3)))
    both = Floor(2.0, (3.0, 5.0), (4e-4, 2e-3), SPACING_S)
    np.testing.assert_allclose(_density(both, angle) + 4.0, _density(one, angle) + _density(other, angle), rtol=1e-12)
