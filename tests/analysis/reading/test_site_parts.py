"""The floor's spectrum in parts: densities of known power, third-octaves, lines at their threshold, causes, advice."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from analysis.reading.site import (
    CENTRES_HZ,
    CRITERIA_M_PER_S,
    MachineLine,
    PlannedFlights,
    PlannedShot,
    SiteFloor,
    _criterion,
    _most_by_chance,
    _periodogram,
    _refined,
    _smoothed,
    _strongest_line,
    _third_octaves,
    likely_cause,
    read_site,
)

RATE_HZ = 1000.0
TIME_S = np.arange(2000) / RATE_HZ
F_HZ = np.arange(1, 1001) * 0.5


def white(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(TIME_S.size)


def test_a_periodogram_has_the_density_of_white_noise_and_the_power_of_a_sine() -> None:
    frequency, power = _periodogram(white(), RATE_HZ)
    assert frequency == pytest.approx(F_HZ)
    window = np.hanning(TIME_S.size + 1)[:-1] ** 2  # of power
    assert power.sum() * 0.5 == pytest.approx(window @ white() ** 2 / window.sum(), rel=0.01)
    _, power = _periodogram(0.3 * np.sin(2 * np.pi * 60.2 * TIME_S), RATE_HZ)
    assert power.sum() * 0.5 == pytest.approx(0.5 * 0.3**2, rel=1e-3)


def test_a_density_is_smoothed_over_a_tenth_of_its_frequency_on_each_side() -> None:
    power = np.random.default_rng(2).uniform(1.0, 2.0, 60)
    for k, value in enumerate(_smoothed(power)):
        half = max(1, round(0.1 * (k + 1)))
        assert value == pytest.approx(power[max(k - half, 0) : k + half + 1].mean())


def test_a_third_octave_of_an_even_density_has_its_width_whether_or_not_bins_lie_in_it() -> None:
    for frequency in (F_HZ, np.arange(1, 500) * 1.0):  # the lowest band may hold no bin of these
        rms, _ = _third_octaves(frequency, np.full(frequency.size, 3e-12), ())
        width = CENTRES_HZ * (10**0.05 - 10**-0.05)
        assert rms**2 == pytest.approx(3e-12 * width, rel=1e-9)
    rising = np.arange(1, 200) * 2.0
    rms, _ = _third_octaves(rising, 1e-12 * rising, ())  # between bins the line from one to the next
    assert rms[1] ** 2 == pytest.approx(1e-12 * CENTRES_HZ[1] * (10**0.05 - 10**-0.05) * CENTRES_HZ[1], rel=1e-9)


def test_a_line_counts_whole_in_its_own_band_and_chance_is_taken_off_the_rest_alone() -> None:
    calm = np.full(F_HZ.size, 1e-14)
    rms, least = _third_octaves(F_HZ, calm, ())
    loud, certain = _third_octaves(F_HZ, calm, ((20.0, 3e-6), (50.5, 1e-6)))
    at = [int(np.abs(CENTRES_HZ - hz).argmin()) for hz in (20.0, 50.0)]
    for before, after in ((rms, loud), (least, certain)):
        added = after**2 - before**2
        assert added[at] == pytest.approx([4.5e-12, 0.5e-12], rel=1e-6)
        assert np.abs(np.delete(added, at)).max() < 1e-24
    bins = [np.count_nonzero((c * 10**-0.05 <= F_HZ) & (c * 10**0.05 > F_HZ)) for c in CENTRES_HZ]
    assert (rms / least) ** 2 == pytest.approx([_most_by_chance(max(n, 1)) for n in bins])
    assert _most_by_chance(1) > _most_by_chance(5) > _most_by_chance(100) > 1.0


@pytest.mark.parametrize("bins", [1, 2, 3, 9])
def test_a_mean_of_bins_scatters_as_their_shares_of_one_hann_window_say(bins: int) -> None:
    """Relative variance of the mean of powers that are correlated by the window's own transform."""
    n = np.arange(4096)
    weights = np.sin(np.pi * (n + 0.5) / n.size) ** 4
    shared = [abs(np.sum(weights * np.exp(2j * np.pi * k * n / n.size)) / weights.sum()) ** 2 for k in range(bins)]
    variance = sum((bins if k == 0 else 2 * (bins - k)) * share for k, share in enumerate(shared)) / bins**2
    freedom = 2.0 / variance
    assert _most_by_chance(bins) == pytest.approx(chi2.isf(0.05 / 11, freedom) / freedom, rel=1e-3)


def test_the_criteria_are_those_of_the_curves_in_um_per_s() -> None:
    assert [round(1e6 * level, 6) for level in CRITERIA_M_PER_S.values()] == [
        0.78, 1.56, 3.12, 6.25, 12.5, 25.0, 50.0, 100.0, 200.0, 400.0, 800.0,
    ]  # fmt: skip
    assert list(CRITERIA_M_PER_S)[:7] == [f"VC-{letter}" for letter in "GFEDCBA"]


def test_a_criterion_is_the_strictest_that_no_band_from_8_to_80_hz_exceeds() -> None:
    inside = (CENTRES_HZ > 7.9) & (CENTRES_HZ < 81.0)
    names = list(CRITERIA_M_PER_S)
    for name, level in CRITERIA_M_PER_S.items():
        stricter = names[names.index(name) + 1] if name != names[-1] else ""
        for times, expected in ((0.999, name), (1.001, stricter)):
            bands = np.full(CENTRES_HZ.size, 1e-9)
            bands[np.flatnonzero(inside)[-1]] = times * level
            assert _criterion(bands) == expected
    assert _criterion(np.where(inside, 1e-9, 1.0)) == "VC-G"


@pytest.mark.parametrize("frequency_hz", [9.3, 61.37, 250.0])
def test_a_line_is_found_near_and_refined_to_its_frequency_and_shape(frequency_hz: float) -> None:
    sine = 0.4 * np.sin(2 * np.pi * frequency_hz * TIME_S + 0.8)
    found = _strongest_line(sine + 0.02 * white(), RATE_HZ)
    assert found == pytest.approx(frequency_hz, abs=0.1)
    frequency, wave = _refined(sine, TIME_S, frequency_hz + 0.08)
    assert frequency == pytest.approx(frequency_hz, abs=1e-6)
    assert wave == pytest.approx(sine, abs=1e-6)


@pytest.mark.parametrize(("frequency_hz", "times"), [(60.0, 25.0), (10.0, 12.0)])
def test_a_line_has_25_times_the_power_about_it_and_that_of_a_hand_12_times(frequency_hz: float, times: float) -> None:
    """In the middle of a bin a sine's power is 3/4 of what its square gives times the time over four."""
    noise = 0.01 * white(3)
    _, power = _periodogram(noise, RATE_HZ)
    at = round(frequency_hz / 0.5) - 1
    sides = power[at - 9 : at - 2], power[at + 3 : at + 10]
    about = max(float(np.median(side)) for side in sides) / np.log(2.0)
    _, unit = _periodogram(np.sin(2 * np.pi * frequency_hz * TIME_S), RATE_HZ)
    for share, seen in ((0.6, False), (1.6, True)):
        size = np.sqrt(share * times * about / unit[at])
        found = _strongest_line(noise + size * np.sin(2 * np.pi * frequency_hz * TIME_S), RATE_HZ)
        assert (found is not None) is seen
    assert _strongest_line(np.sin(2 * np.pi * 1.0 * TIME_S) + noise, RATE_HZ) is None  # too slow to tell
    assert _strongest_line(np.sin(2 * np.pi * 420.0 * TIME_S) + noise, RATE_HZ) is None  # or too near to half the rate


def test_a_step_of_the_spectrum_is_no_line() -> None:
    spectrum = np.fft.rfft(white(4))
    spectrum[: spectrum.size // 4] *= 0.05
    assert _strongest_line(np.fft.irfft(spectrum), RATE_HZ) is None


def test_a_record_of_a_second_is_read_and_a_shorter_one_is_not() -> None:
    assert read_site(white()[:999], RATE_HZ) is None
    floor = read_site(1e-6 * white()[:1000] + 0.1 * TIME_S[:1000] + 3.0, RATE_HZ)
    assert floor is not None and floor.seconds == 1.0  # what drifts is no vibration
    velocity = floor.density_m2_per_hz * (2 * np.pi * floor.frequency_hz) ** 2
    assert velocity[50:-30].mean() == pytest.approx(2e-12 / RATE_HZ, rel=0.1)
    assert not any(a.flags.writeable for a in (floor.third_octave_m_per_s, floor.frequency_hz, floor.density_m2_per_hz))


def test_lines_are_sorted_by_frequency_with_the_displacement_they_make() -> None:
    velocity = 1e-8 * white() + sum(
        2e-6 * np.sin(2 * np.pi * hz * TIME_S) for hz in (210.0, 30.0, 17.0, 90.0, 120.0, 150.0, 180.0, 70.0, 240.0)
    )
    floor = read_site(velocity, RATE_HZ)
    assert floor is not None
    assert [line.frequency_hz for line in floor.lines] == pytest.approx(
        [17, 30, 70, 90, 120, 150, 180, 210, 240], abs=0.05
    )
    assert [line.amplitude_m * 2 * np.pi * line.frequency_hz for line in floor.lines] == pytest.approx(
        9 * [2e-6], rel=0.02
    )


@pytest.mark.parametrize(
    ("frequency_hz", "resolution_hz", "word"),
    [
        (50.059, 0.01, "the mains (50 Hz)"), (50.061, 0.01, "fan"), (50.35, 0.3, "the mains (50 Hz)"),
        (100.069, 0.0, "twice the mains"), (100.071, 0.0, "fan"), (240.08, 0.0, "4 x 60"), (120.0, 0.0, "twice"),
        (46.6, 0.0, "2 poles on 50"), (46.4, 0.0, "fan"), (56.0, 0.0, "2 poles on 60"), (23.3, 0.0, "4 poles on 50"),
        (16.6, 0.0, "6 poles on 50"), (19.0, 0.0, "6 poles on 60"), (20.2, 0.1, "fan"), (20.04, 0.0, "6 poles on 60"),
        (7.0, 0.0, "hand"), (12.5, 0.0, "hand"), (6.9, 0.0, "building"), (12.6, 0.0, "fan"),
    ],
)  # fmt: skip
def test_a_cause_has_its_place_and_its_width(frequency_hz: float, resolution_hz: float, word: str) -> None:
    assert word in likely_cause(frequency_hz, resolution_hz)


def test_costly_lines_are_advised_worst_first() -> None:
    empty = np.zeros(0)
    lines = tuple(MachineLine(f, 1e-9, f"cause {c}", c) for f, c in ((10.0, 1.19), (20.0, 1.2), (30.04, 2.0)))
    floor = SiteFloor(1.0, empty, empty, empty, empty, lines, "VC-G", 1e-6)
    assert floor.advice == (
        "Cause 2.0 at 30.0 Hz costs you a factor 2.0 in the uncertainty of the restitution",
        "Cause 1.2 at 20.0 Hz costs you a factor 1.2 in the uncertainty of the restitution",
    )


def test_planned_flights_lie_on_either_side_of_the_contact_at_steps_that_stay_few() -> None:
    floor = read_site(1e-6 * white(), RATE_HZ)
    assert floor is not None
    planned = PlannedShot(before_s=0.012, after_s=0.018)
    flights = PlannedFlights.on(floor, planned)
    assert flights.span_s == pytest.approx(0.012 + 0.0287 + 0.018)
    steps = np.diff(flights.time_s)
    assert np.sort(steps)[:-1] == pytest.approx(5e-4) and steps.max() == pytest.approx(0.029, abs=6e-4)
    assert flights.time_s[0] == pytest.approx(2.5e-4)
    into = flights.time_s < 0.012
    out = ~into
    expected = np.stack([into, into * (flights.time_s - 0.012), out, out * (flights.time_s - 0.0407)], axis=1)
    assert flights.design == pytest.approx(expected, abs=1e-12)
    long = PlannedFlights.on(floor, replace(planned, before_s=0.1, after_s=0.1))
    assert 150 <= long.time_s.size <= 161 and np.diff(long.time_s).min() == pytest.approx(0.2 / 160)
    whole = flights.covariance_m2
    assert whole == pytest.approx(whole.T) and np.linalg.eigvalsh(whole).min() > 0.0
    twice, _ = PlannedFlights.on(floor, replace(planned, speed_m_per_s=0.53)).cor_stds(())
    assert twice == pytest.approx(0.5 * flights.cor_stds(())[0])
