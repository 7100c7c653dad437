"""The floor of the site: criterion, lines and their causes, and what the next shot could be read to."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.reading import site
from analysis.reading.site import (
    CENTRES_HZ,
    MachineLine,
    PlannedFlights,
    PlannedShot,
    _covariance,
    _most_by_chance,
    _periodogram,
    likely_cause,
    read_site,
)
from instrument.bench.frame import frame_of
from instrument.bench.site import Line, Site, site_named

RATE = 2500.0
TIME = np.arange(round(2 * RATE)) / RATE


def _velocity(site, seed=1):
    white = 2e-8 * np.diff(np.random.default_rng(seed).standard_normal(TIME.size + 1))
    return frame_of(site, seed).motion(TIME)[1] + white


@pytest.mark.parametrize("name", ["VC-A", "VC-F"])
def test_a_site_is_known_by_its_curve(name):
    plain = Site(third_octave_m_per_s=site_named(name).third_octave_m_per_s)
    floors = [read_site(_velocity(plain, seed), RATE) for seed in range(3)]
    band = (CENTRES_HZ > 7.9) & (CENTRES_HZ < 81)
    rms = np.sqrt(np.mean([floor.third_octave_m_per_s**2 for floor in floors], axis=0))
    assert rms[band] == pytest.approx(plain.third_octave_m_per_s, rel=0.5)  # 4 seeds of some bins each
    assert not any(floor.lines for floor in floors[:3])


@pytest.mark.parametrize("seconds", [1, pytest.param(4, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["VC-B", "VC-D", "VC-G"])
def test_a_site_on_a_curve_is_told_by_it_though_some_band_lies_above(name, seconds):
    level = site_named(name).third_octave_m_per_s
    time_s = np.arange(round(seconds * RATE)) / RATE
    told = []
    for seed in range(8):
        moved = frame_of(Site(third_octave_m_per_s=level), 40 + seed).motion(time_s)[1]
        floor = read_site(moved + 2e-8 * np.random.default_rng(seed).standard_normal(time_s.size), RATE)
        told.append(floor.criterion)
        assert floor.third_octave_m_per_s.max() > level  # as every such record shows
    assert told.count(name) >= 7


def test_lines_are_found_named_and_taken_off_the_floor():
    quiet = Site(third_octave_m_per_s=1e-6)
    shaken = Site(third_octave_m_per_s=1e-6, lines=(Line(24.9, 80e-9), Line(100.0, 20e-9), Line(296.0, 10e-9)))
    without, floor = read_site(_velocity(quiet), RATE), read_site(_velocity(shaken), RATE)
    assert [line.frequency_hz for line in floor.lines] == pytest.approx([24.9, 100.0, 296.0], abs=0.04)
    assert [line.amplitude_m for line in floor.lines] == pytest.approx([80e-9, 20e-9, 10e-9], rel=0.1)
    assert "pump" in floor.lines[0].cause and "twice the mains" in floor.lines[1].cause
    ratio = np.sqrt(floor.density_m2_per_hz / without.density_m2_per_hz)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1) and ratio.max() < 3
    assert floor.criterion == "VC-C" and without.criterion == "VC-F"


def test_the_pump_costs_what_is_gained_without_it():
    floor = read_site(_velocity(Site(third_octave_m_per_s=1e-6, lines=(Line(24.9, 300e-9),))), RATE)
    without = read_site(_velocity(Site(third_octave_m_per_s=1e-6)), RATE)
    (pump,) = floor.lines
    assert pump.cost == pytest.approx(floor.cor_std / without.cor_std, rel=0.2) and pump.cost > 1.2
    assert floor.advice == (
        f"A motor or pump (4 poles on 50 Hz) at 24.9 Hz costs you a factor {pump.cost:.1f} "
        "in the uncertainty of the restitution",
    )
    assert without.advice == ()


def test_the_expectation_is_what_weighted_lines_through_flights_scatter_by():
    site, planned = Site(third_octave_m_per_s=12.5e-6), PlannedShot(before_s=0.012, after_s=0.018)
    expected = np.mean([read_site(_velocity(site, seed), RATE, planned).cor_std for seed in range(4)])
    step = 5e-4
    time_s = np.arange(0, 0.06, step)
    into, out = time_s < 0.012, time_s > 0.012 + 0.0287
    off = []
    for seed in range(60):  # least squares without weights: not better than the expectation, not three times worse
        x = frame_of(site, 100 + seed).motion(time_s)[0]
        off.append((np.polyfit(time_s[out], x[out], 1)[0] + 0.9876 * np.polyfit(time_s[into], x[into], 1)[0]) / 0.265)
    assert 0.6 * expected < np.std(off) < 3 * expected


def test_the_tremor_of_a_hand_is_named_and_belongs_to_neither_site_nor_shot():
    site = Site(third_octave_m_per_s=3e-6)
    held = _velocity(site) + 85e-6 * np.sin(2 * np.pi * 9.0 * TIME)
    floor, free = read_site(held, RATE), read_site(_velocity(site), RATE)
    (hand,) = floor.lines
    assert "hand" in hand.cause and hand.cost == 1.0 and floor.advice == ()
    assert floor.criterion == free.criterion and floor.cor_std == pytest.approx(free.cor_std, rel=0.3)


def test_twice_the_floor_is_twice_the_uncertainty():
    one, two = (read_site(size * _velocity(Site(third_octave_m_per_s=3e-6)), RATE) for size in (1.0, 2.0))
    assert two.cor_std == pytest.approx(2 * one.cor_std, rel=1e-6)
    more, _ = PlannedFlights.on(one, PlannedShot()).cor_stds((MachineLine(24.9, 1e-6, ""),))
    assert more > one.cor_std


def test_a_line_costs_what_the_expectation_without_it_lacks(monkeypatch):
    made = []
    covariance = site._covariance
    monkeypatch.setattr(site, "_covariance", lambda *of: made.append(1) or covariance(*of))
    tones = sum(size * np.sin(2 * np.pi * hz * TIME) for hz, size in ((24.9, 2e-5), (50.0, 2e-5), (9.1, 2e-5)))
    floor = read_site(_velocity(Site(third_octave_m_per_s=4e-7)) + tones, RATE)
    assert len(made) == 1  # one floor, one covariance, though a line each is left out
    assert len(floor.lines) >= 3
    stay = [line for line in floor.lines if not 7.0 <= line.frequency_hz <= 12.5]
    flights = PlannedFlights.on(floor, PlannedShot())
    assert floor.cor_std == flights.cor_stds(stay)[0] == pytest.approx(_written_out(flights, stay), rel=1e-9)
    for line in floor.lines:
        without = _written_out(flights, [other for other in stay if other is not line])
        assert line.cost == pytest.approx(floor.cor_std / without, rel=1e-9)


def test_a_wave_is_that_of_least_squares_through_the_window():
    time_s = np.arange(400) * 1e-3
    values = np.sin(2 * np.pi * 24.9 * time_s) + 0.3 * np.random.default_rng(5).standard_normal(400)
    frequency_hz, wave = site._refined(values, time_s, 25.0)
    angle, window = (
        2 * np.pi * frequency_hz * (time_s - time_s.mean()),
        np.sin(np.pi * (np.arange(400) + 0.5) / 400) ** 2,
    )
    columns = np.stack((np.cos(angle), np.sin(angle)), 1)
    best = np.linalg.lstsq(columns * window[:, None], values * window, rcond=None)[0]
    assert wave == pytest.approx(columns @ best, rel=1e-9, abs=1e-9)


def _written_out(flights, lines):
    """Return u(COR) by generalised least squares with every line as a part of the covariance."""
    matrix = flights.covariance_m2.copy()
    for line in lines:
        angle = 2 * np.pi * line.frequency_hz * flights.time_s
        wave = np.stack((np.cos(angle), np.sin(angle)))
        bend = np.pi / flights.span_s * (flights.time_s - 0.5 * flights.span_s) * wave
        matrix += line.amplitude_m**2 / 2 * (wave.T @ wave + bend.T @ bend)
    found = np.linalg.inv(flights.design.T @ np.linalg.solve(matrix, flights.design))
    ratio = np.array([0.0, flights.planned.restitution, 0.0, 1.0]) / flights.planned.speed_m_per_s
    return float(np.sqrt(ratio @ found @ ratio))


@pytest.mark.parametrize(
    ("frequency", "word"),
    [(50.01, "mains (50"), (100.0, "transformer"), (150.0, "3 x 50"), (24.8, "4 poles on 50"), (60.0, "mains (60"),
     (29.2, "4 poles on 60"), (9.0, "hand"), (3.0, "building"), (296.0, "fan")],
)  # fmt: skip
def test_likely_causes(frequency, word):
    assert word in likely_cause(frequency, 0.05)


@pytest.mark.parametrize("order", [5, 10, 20])
def test_mains_a_hundredth_of_a_hertz_off_are_known_by_their_multiples_too(order):
    """A multiple is as many times as far off; a machine half a hertz away is no multiple."""
    assert f"{order} x 50 Hz" in likely_cause(order * 49.99, 0.02)
    assert "fan" in likely_cause(order * 50.0 + 0.5, 0.02)


@pytest.mark.parametrize(("frequency", "counts"), [(5.0, False), (6.0, False), (20.0, True), (140.0, False)])
def test_a_site_is_rated_by_what_moves_it_between_8_and_80_hz_alone(frequency, counts):
    quiet = _velocity(Site(third_octave_m_per_s=1e-6))
    shaken = quiet + 30e-6 * np.sin(2 * np.pi * frequency * TIME)
    floor, without = read_site(shaken, RATE), read_site(quiet, RATE)
    assert (floor.criterion != without.criterion) is counts
    assert floor.third_octave_m_per_s.max() > 20e-6  # though it is shown


def test_too_little_is_no_floor():
    assert read_site(np.zeros(100), RATE) is None
    assert read_site(np.full(TIME.size, np.nan), RATE) is None


@pytest.fixture(scope="module")
def powers():
    """Return the powers of 30,000 records of white noise of unit density a sample, (30,000, 32)."""
    return np.array([_periodogram(row, 1.0)[1] for row in np.random.default_rng(3).standard_normal((30_000, 64))])


@pytest.mark.parametrize("bins", [1, 2, 5, 12])
def test_a_band_of_so_many_bins_shows_more_by_chance_as_seldom_as_is_said(powers, bins):
    """Of 30,000 bands one in two hundred and twenty stands above."""
    band = powers[:, 6 : 6 + bins].mean(axis=1) / 2.0  # a white density of 1 a sample is 2 one-sided
    assert band.mean() == pytest.approx(1.0, abs=0.03)
    expected = 30_000 * 0.05 / 11  # bands of the criteria, 5 % for all of them
    assert np.count_nonzero(band > _most_by_chance(bins)) == pytest.approx(expected, rel=0.35)


@pytest.mark.parametrize("turns", [0.05, 0.3, 0.5, 0.8])  # of the motion in a step
def test_a_mean_over_a_step_keeps_what_does_not_average_out(turns: float) -> None:
    """The variance of means over a step, and how two of them vary together, against the motion itself."""
    step_s, rms_m, lags = 5e-3, 2e-9, 4
    frequency = np.arange(1.0, 400.0)
    density = np.where(frequency == round(turns / step_s), rms_m**2, 0.0)
    floor: Any = SimpleNamespace(frequency_hz=frequency, density_m2_per_hz=density)
    time_s = np.arange(1000) / 1000 * step_s
    phases = np.linspace(0.0, 2 * np.pi, 360, endpoint=False)
    moved = [
        np.sqrt(2) * rms_m * np.sin(2 * np.pi * round(turns / step_s) * (time_s + k * step_s) + phases[:, None])
        for k in range(lags)
    ]
    means = np.array([one.mean(axis=1) for one in moved])
    assert _covariance(floor, step_s, lags) == pytest.approx((means[0] * means).mean(axis=1), rel=0.01, abs=1e-22)
