"""Where a contact begins and ends: exact departures from flight, least squares by other means, and a true ±."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from analysis.reading import edges
from analysis.reading.edges import (
    Edge,
    _average_of_models,
    _costs_of_one,
    _costs_of_two,
    _explained,
    _force_terms,
    _grams_of_each,
    _later,
    _likelihood_mean,
    _line_degree,
    edge_of_flight,
    edge_of_line,
    edges_of_short_flight,
)
from analysis.reading.flight import Flight, fit_flight
from analysis.shot.motion import Motion
from tests.analysis.synthetic_collision import Synthetic, motion_from

Floats = NDArray[np.float64]
RATE_HZ, NOISE_M = 1e5, 1e-10
RIG = Synthetic(rate_hz=RATE_HZ, noise_m=NOISE_M)


def least_of(design: Floats, wanted: Floats, free: list[bool]) -> float:
    """Return what columns leave of the squares, coefficients >= 0 but for the free."""
    low = np.where(free, -np.inf, 0.0)
    solution = lsq_linear(design, wanted, (low, np.full(low.size, np.inf)), method="bvls", tol=1e-14)
    return float(np.sum((wanted - design @ solution.x) ** 2))


@pytest.mark.parametrize("free", [[False] * 4, [True, *[False] * 5], [True, False, False]])
def test_what_columns_explain_is_what_bounded_least_squares_leaves_out(free: list[bool]) -> None:
    random = np.random.default_rng(len(free) + sum(free))
    for _ in range(20):
        design, wanted = random.standard_normal((12, len(free) + 2)), random.standard_normal(12)
        index = random.permutation(len(free) + 2)[: len(free)]
        got = _explained(design.T @ design, design.T @ wanted, index, np.array(free))
        assert got == pytest.approx(wanted @ wanted - least_of(design[:, index], wanted, free), rel=1e-6)


def test_two_columns_that_are_the_same_explain_as_much_as_one() -> None:
    column, wanted = np.array([1.0, 2.0, 3.0]), np.array([1.0, 1.0, 2.0])
    design = np.stack([column, column, -column], axis=1)
    got = _explained(design.T @ design, design.T @ wanted, np.arange(3), np.zeros(3, np.bool_))
    assert got == pytest.approx((column @ wanted) ** 2 / (column @ column), rel=1e-12)


@pytest.mark.parametrize("terms", [2, 3])
@pytest.mark.parametrize("tension", [False, True])
def test_the_costs_of_an_edge_are_those_of_every_trial_with_and_without_its_step(terms: int, tension: bool) -> None:
    random = np.random.default_rng(terms)
    flat, wanted = random.standard_normal((15, terms * 5)), random.standard_normal(15)
    costs = np.empty((5, 2))
    grams = _grams_of_each(flat, terms)
    _costs_of_one(grams, flat.T @ wanted, float(wanted @ wanted), tension, costs)
    free = [tension] + [False] * (terms - 1)
    for k, trial in enumerate(np.split(flat, 5, axis=1)):
        assert grams[k] == pytest.approx(trial.T @ trial)
        best = [least_of(trial, wanted, free), least_of(trial[:, 1:], wanted, free[1:])]
        assert costs[k] == pytest.approx(best, rel=1e-6)


@pytest.mark.parametrize("terms", [2, 3])
def test_the_costs_of_two_edges_are_those_of_every_pair_the_releases_step_free(terms: int) -> None:
    random = np.random.default_rng(5)
    flat, wanted = random.standard_normal((20, 3 * 6)), random.standard_normal(20)
    costs = np.empty((3, 3))
    _costs_of_two(flat.T @ flat, flat.T @ wanted, float(wanted @ wanted), terms, costs)
    sides = [side[:, :terms] for side in np.split(flat, 6, axis=1)]
    for i in range(3):
        for j in range(3):
            both = np.hstack([sides[i], sides[3 + j]])
            assert costs[i, j] == pytest.approx(least_of(both, wanted, [True] + [False] * (2 * terms - 1)), rel=1e-6)


def test_two_models_together_are_as_likely_as_the_sum_of_both_by_their_odds() -> None:
    full, plain, least = np.array([3.0, 900.0, 4.0]), np.array([5.0, 4.0, 900.0]), 2.5
    sum_of_both = np.exp(-0.5 * full / least) + 3.0 * np.exp(-0.5 * plain / least)
    assert np.exp(-0.5 * _average_of_models(full, plain, least, np.log(3.0)) / least) == pytest.approx(
        sum_of_both, rel=1e-9
    )


def test_terms_of_a_spring_are_those_of_cosine_and_sine_from_the_edge_on() -> None:
    u = np.linspace(-1e-3, 2e-3, 31)[:, None]
    omega = 500.0  # a radian at the end
    since = np.maximum(u, 0.0)
    step, slope = np.moveaxis(_force_terms(u, omega), -1, 0)
    assert step == pytest.approx(2 * (1 - np.cos(omega * since)) / (omega * 2e-3) ** 2, abs=1e-4)
    assert slope == pytest.approx(6 * (omega * since - np.sin(omega * since)) / (omega * 2e-3) ** 3, abs=1e-4)
    for bends in (1, -1):
        terms = _force_terms(u, 0.0, bends)
        part = since / 2e-3
        assert terms == pytest.approx(np.stack([part**2, part**3, bends * part**4], axis=-1), abs=1e-12)


def test_an_instant_is_the_mean_over_its_likelihood_and_as_sure_as_that_is_wide() -> None:
    trials = np.linspace(-6.0, 8.0, 141)
    for spread in (1.0, 2.0):
        edge = _likelihood_mean(trials, 7.0 + ((trials - 1.3) / 0.5) ** 2, spread)
        assert edge.time_s == pytest.approx(1.3, abs=1e-6)
        assert edge.std_s == pytest.approx(np.hypot(0.5 * spread, 0.1 / np.sqrt(12)), rel=1e-4)
    either = _likelihood_mean(np.array([-3.0, -1.0, 1.0, 3.0]), np.array([0.0, 900.0, 900.0, 0.0]), 1.0)
    assert either == Edge(0.0, pytest.approx(np.sqrt(9.0 + 4.0 / 12.0)))


def test_an_edge_that_is_less_sure_has_both_uncertainties_and_its_time() -> None:
    assert Edge(1.5, 3e-6).with_added_uncertainty(4e-6) == Edge(1.5, pytest.approx(5e-6))


@pytest.mark.parametrize(("gain", "degree"), [(8.0, 1), (10.0, 2)])
def test_a_flight_is_curved_where_chi2_gains_nine_by_it(gain: float, degree: int) -> None:
    """Orthogonal to line and parabola stands what is noise; the parabola's share of it is chosen."""
    u = np.linspace(-1e-3, 0.0, 40)
    basis, _ = np.linalg.qr(np.vander(u / 1e-3, 4, increasing=True))
    rest = np.random.default_rng(1).standard_normal(40)
    rest -= basis @ (basis.T @ rest)
    curve = basis[:, 2] * np.sqrt(gain * (rest @ rest) / 37)
    assert _line_degree(u, 1e-9 * (rest + curve) - 0.2 * u) == degree


@pytest.mark.parametrize(("took", "later"), [(1.0, False), (1.09, False), (1.11, True), (3.0, True)])
def test_a_departure_slower_than_a_plate_without_mass_makes_it_is_a_later_contact(took: float, later: bool) -> None:
    depth_m, omega, noise_m = 1e-3, 150.0, 1e-10
    longest_s = np.cbrt(6 * 3e-3) / omega  # (omega u)^3 / 6 = 0.3 % of the way
    u = np.linspace(-1e-4, 5.0 * longest_s, 6000)
    departure = np.where(u > 0, 3e-3 * depth_m * (u / (took * longest_s)) ** 3, 0.0)
    for sign in (1.0, -1.0):
        got = _later(u, sign * departure, noise_m, depth_m, omega)
        assert got == pytest.approx((took - 0.7) * longest_s if later else 0.0, abs=0.003 * longest_s)
    assert _later(u, departure, noise_m, depth_m, 0.0) == 0.0
    assert _later(u, 0.0 * departure, noise_m, depth_m, omega) == 0.0
    noisy_m = 0.7e-6  # six of it lie beyond the departure that is waited for otherwise
    longest_s = np.cbrt(6 * 6 * noisy_m / depth_m) / omega
    took_s = took * np.cbrt(6 * 6 * noisy_m / depth_m) / omega
    got = _later(u, departure, noisy_m, depth_m, omega)
    assert got == pytest.approx(took_s - 0.7 * longest_s if later else 0.0, abs=0.003 * longest_s)


def departing(edge_s: float, step: float, slope: float, *, sign: int, seed: int, noise_m: float = NOISE_M) -> Any:
    """Return a flight from or to ``edge_s`` beside a force per mass of ``step`` + ``slope`` u, 10 ms to each side."""
    time = np.arange(0.0, 0.02, 1 / RATE_HZ)
    u = np.maximum(sign * (time - edge_s), 0.0)
    x = -0.2 * time + step * u**2 / 2 + slope * u**3 / 6
    return motion_from(time, x + np.random.default_rng(seed).normal(0.0, noise_m, time.size), RIG)


# step in m/s^2, that of a dashpot, and direction: a touch pushes, a release ends in a push or in a pull
ENDS = [(2.0, 1), (-2.0, -1), (2.0, -1)]


def scatter(read: Callable[[Motion, float], Edge | None], step: float, sign: int) -> tuple[Floats, Floats]:
    """Return the errors of an edge in s, read from 60 motions, and its standard deviations."""
    off, stds = [], []
    for seed in range(60):
        edge_s = 0.01 + 1e-5 * float(np.random.default_rng(seed).uniform())
        edge = read(departing(edge_s, step, 2500.0, sign=sign, seed=seed), edge_s)
        assert edge is not None
        off.append(edge.time_s - edge_s)
        stds.append(edge.std_s)
    return np.array(off), np.array(stds)


@pytest.mark.parametrize(("step", "sign"), ENDS[:2])
def test_an_edge_at_the_end_of_a_flight_scatters_as_its_uncertainty_says(step: float, sign: int) -> None:
    def read(motion: Motion, edge_s: float) -> Edge | None:
        coarse = round((edge_s + sign * 1e-4) * RATE_HZ)
        flight = (0, coarse - 1) if sign > 0 else (coarse + 1, 1999)
        return edge_of_flight(motion, flight, coarse, until=coarse + sign * 700, depth_m=2e-3, guard_s=3e-4)

    off, stds = scatter(read, step, sign)
    assert abs(np.mean(off)) < 0.7 * np.median(stds)
    assert 0.6 < np.sqrt(np.mean((off / stds) ** 2)) < 1.3
    assert np.median(stds) < 2e-6


@pytest.mark.parametrize(("step", "sign"), ENDS)
@pytest.mark.parametrize("bend", [0, 2])
def test_an_edge_that_leaves_a_known_line_scatters_as_its_uncertainty_says(step: float, sign: int, bend: int) -> None:
    def read(motion: Motion, edge_s: float) -> Edge | None:
        near = round(edge_s * RATE_HZ) - sign * 30
        ends = (near - 200, near) if sign > 0 else (near, near + 200)
        line = fit_flight(motion, *ends, nearest=near, curved=bend > 0)
        assert line is not None
        return edge_of_line(motion, line, until=near + sign * 150, bend=bend)

    off, stds = scatter(read, step, sign)
    assert abs(np.mean(off)) < 0.8 * np.median(stds)
    assert 0.6 < np.sqrt(np.mean((off / stds) ** 2)) < 1.2
    assert np.median(stds) < 2e-6


def test_a_contact_begins_with_a_push_and_may_end_with_a_pull() -> None:
    """A pull at the touch is none; the same step, seen backwards, is a release."""
    for sign in (1, -1):
        motion = departing(0.01, -2.0, 0.0, sign=sign, seed=3)
        flight = (0, 1000 + 9 * sign) if sign > 0 else (1000 + 9 * sign, 1999)
        edge = edge_of_flight(motion, flight, 1000 + 10 * sign, until=1000 + 710 * sign, depth_m=2e-3, guard_s=3e-4)
        assert (edge is None) is (sign > 0)


def test_where_nothing_departs_there_is_no_edge() -> None:
    motion = departing(0.01, 0.0, 0.0, sign=1, seed=1)
    assert edge_of_flight(motion, (0, 999), 1000, until=1500, depth_m=2e-3, guard_s=1e-4) is None
    line = Flight(0.0, np.array([0.0, -0.2]), np.zeros((2, 2)), NOISE_M, 0, 900)
    assert edge_of_line(motion, line, until=1500, bend=0) is None
    few = departing(0.01, 0.0, 2500.0, sign=1, seed=1)  # of the flight seven samples lie before the guard, or eight
    assert edge_of_flight(few, (983, 999), 1000, until=1500, depth_m=2e-3, guard_s=1e-4) is None
    assert edge_of_flight(few, (981, 999), 1000, until=1500, depth_m=2e-3, guard_s=1e-4) is not None


def short_flight(
    release_s: float, onset_s: float, seed: int, bends: float = 0.0, shaken_m_per_s2: float = 0.0
) -> tuple[Floats, Floats]:
    time = np.arange(30) / RATE_HZ
    before, after = np.maximum(release_s - time, 0.0), np.maximum(time - onset_s, 0.0)
    x = -0.2 + 0.1 * time - 1.0 * before**2 / 2 + 6e4 * before**3 / 6 + 10.0 * after**2 / 2 + 3e4 * after**3 / 6
    x += bends * (before**4 - after**4) / 24 + shaken_m_per_s2 * time**2 / 2
    return time, x + np.random.default_rng(seed).normal(0.0, NOISE_M, time.size)


# of the slopes of force: at the ends of the record a third of what they do; and of the flight itself, by the floor
@pytest.mark.parametrize(("bends", "shaken_m_per_s2"), [(0.0, 0.0), (8e8, 0.0), (0.0, -0.3)])
def test_both_edges_of_a_short_flight_scatter_as_their_uncertainties_say(bends: float, shaken_m_per_s2: float) -> None:
    pulls, widest, bend = [], [], 2 if shaken_m_per_s2 else 1
    for seed in range(40):
        shift = 1e-5 * float(np.random.default_rng(seed).uniform())
        true = 1.0e-4 + shift, 1.8e-4 + shift
        flight = short_flight(*true, seed, bends, shaken_m_per_s2)
        both = edges_of_short_flight(*flight, NOISE_M, (2e-5, 1.5e-4), (1.4e-4, 2.7e-4), bend=bend)
        assert both is not None
        widest.append(max(edge.std_s for edge in both))
        pulls.append([(edge.time_s - at) / edge.std_s for edge, at in zip(both, true, strict=True)])
    rms = np.sqrt(np.mean(np.square(pulls), axis=0))
    assert np.all((rms > 0.5) & (rms < 1.4)), rms
    assert np.median(widest) < (2e-5 if shaken_m_per_s2 else 1.5e-5)


def test_a_short_flight_whose_edge_lies_beyond_its_range_is_refused() -> None:
    time, x = short_flight(1.0e-4, 1.8e-4, 1)
    assert edges_of_short_flight(time, x, NOISE_M, (2e-5, 1.5e-4), (1.4e-4, 2.7e-4), bend=1) is not None
    assert edges_of_short_flight(time, x, NOISE_M, (1.2e-4, 1.5e-4), (1.4e-4, 2.7e-4), bend=1) is None
    assert edges_of_short_flight(time, x, NOISE_M, (2e-5, 1.5e-4), (1.4e-4, 1.6e-4), bend=1) is None
    assert edges_of_short_flight(time[:7], x[:7], NOISE_M, (2e-5, 4e-5), (3e-5, 6e-5), bend=1) is None
    louder = edges_of_short_flight(time, x, 0.1 * NOISE_M, (2e-5, 1.5e-4), (1.4e-4, 2.7e-4), bend=1)
    plain = edges_of_short_flight(time, x, NOISE_M, (2e-5, 1.5e-4), (1.4e-4, 2.7e-4), bend=1)
    assert louder is not None and plain is not None  # noise ten times the stated one is seen in what is left over
    assert [edge.std_s for edge in louder] == pytest.approx([edge.std_s for edge in plain], rel=0.6)


def test_a_line_of_one_degree_more_and_a_shorter_departure_tell_the_systematic_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[Any] = []
    times = {(2, 200.0): 1.0, (3, 200.0): 1.02, (2, 200.0 / 3.0): 0.95, (0, 200.0): 1.0}

    def edge_in(
        motion: Any, window: Any, departure: Any, levels: Any, sign: int, bend: int, *, quadratic_force: bool = False
    ) -> Any:
        seen.append((bend, levels[1], quadratic_force))
        return Edge(times[bend, levels[1]], 1e-3)

    monkeypatch.setattr(edges, "_edge_in", edge_in)
    anything: Any = None
    levels = 1.0, 200.0, 0.0
    for bend, quadratic_force, apart, tried in (
        (2, False, 0.05, [(2, 200.0), (3, 200.0), (2, 200.0 / 3.0)]),
        (2, True, 0.02, [(2, 200.0), (3, 200.0)]),
        (0, False, 0.0, [(0, 200.0)]),
    ):
        seen.clear()
        found = edges._edge_with_error(anything, anything, anything, levels, 1, bend, quadratic_force=quadratic_force)
        assert found is not None and found[0] == Edge(1.0, 1e-3)
        assert found[1] == pytest.approx(apart)
        assert seen == [(*one, quadratic_force) for one in tried]
    monkeypatch.setattr(edges, "_edge_in", lambda *of, **how: None)
    assert edges._edge_with_error(anything, anything, anything, levels, 1, 2) is None


@pytest.mark.parametrize(("sign", "depth_m"), [(1, 2e-4), (1, 1e-8), (1, 1e-2), (-1, 2e-4)])
def test_an_edge_is_fitted_over_a_millisecond_of_flight_to_so_deep_a_departure(
    sign: int, depth_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A quadratic force is tried first at a touch, to a departure ten times as deep."""
    tried: list[Any] = []
    monkeypatch.setattr(edges, "_edge_with_error", lambda motion, *of, **how: tried.append((of, how)) or None)
    motion = departing(0.01, sign * 2.0, 2500.0, sign=sign, seed=1, noise_m=1e-12)
    ends = (0, 999) if sign > 0 else (1001, 1999)
    assert edge_of_flight(motion, ends, 1000, until=1000 + sign * 300, depth_m=depth_m, guard_s=2e-4) is None
    std = NOISE_M  # as stated, more than is seen
    most = max(12 * std, min(200 * std, 3e-5 * depth_m)) if sign > 0 else 200 * std
    levels = [(10.0 * most, True), (most, False)] if sign > 0 else [(most, False)]
    assert len(tried) == len(levels)
    for ((window, departure, (noise, deep, omega), way, bend), how), (level, quadratic_force) in zip(
        tried, levels, strict=True
    ):
        assert window.tolist() == list(range(1000 - sign * 120, 1000 + sign * 301, sign))
        assert np.abs(departure[:100]).max() < 1e-11 and abs(departure[-1]) > 1e-8
        assert (noise, deep, way, bend) == (std, pytest.approx(level), sign, 1)
        assert omega == pytest.approx(0.2 / depth_m, rel=1e-3) and how.get("quadratic_force", False) is quadratic_force


def test_what_is_late_apart_and_random_adds_in_an_edge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edges, "_edge_with_error", lambda *of, **how: (Edge(0.0101, 2e-6), 3e-6))
    monkeypatch.setattr(edges, "_later", lambda u, *of: 6e-6 + 0.0 * float(u[0]))
    motion = departing(0.01, 2.0, 2500.0, sign=1, seed=1)
    edge = edge_of_flight(motion, (0, 999), 1000, until=1500, depth_m=2e-3, guard_s=1e-4)
    assert edge == Edge(0.0101, pytest.approx(7e-6))
    backwards = edge_of_flight(motion, (1001, 1999), 1000, until=500, depth_m=2e-3, guard_s=1e-4)
    assert backwards == Edge(0.0101, pytest.approx(np.hypot(2e-6, 3e-6)))
    seen: list[float] = []
    monkeypatch.setattr(edges, "_later", lambda u, *of: seen.append(float(u[0])) or 0.0)
    edge_of_flight(motion, (0, 999), 1000, until=1500, depth_m=2e-3, guard_s=1e-4)
    assert seen == [pytest.approx(-1.1e-3 - 1e-4)]  # times count from the edge that was found


def test_a_slow_record_gives_64_samples_to_the_line_of_its_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    windows: list[Any] = []
    monkeypatch.setattr(edges, "_edge_with_error", lambda motion, window, *of, **how: windows.append(window) or None)
    time = np.arange(0.0, 1.0, 2e-3)
    slow = motion_from(time, -0.2 * time + 1e-9 * np.sin(time * 1e5), Synthetic(rate_hz=500.0, bandwidth_hz=100.0))
    edge_of_flight(slow, (0, 299), 300, until=320, depth_m=1e-3, guard_s=6e-3)
    edge_of_flight(slow, (270, 299), 300, until=320, depth_m=1e-3, guard_s=0.0)
    edge_of_flight(slow, (0, 299), 300, until=9999, depth_m=1e-3, guard_s=6e-3)
    assert [(window[0], window[-1]) for window in windows[::2]] == [(300 - 64 - 3, 320), (270, 320), (233, 499)]
    held = replace(slow, valid=np.arange(500) != 290)
    edge_of_flight(held, (0, 299), 300, until=320, depth_m=1e-3, guard_s=6e-3)
    assert 290 not in windows[-1] and 289 in windows[-1]


@pytest.mark.parametrize("bend", [1, 2])
@pytest.mark.parametrize(("tension", "louder"), [(False, 1.0), (True, 1.0), (False, 3.0)])
def test_an_instant_is_weighed_over_both_models_and_every_line_by_bounded_least_squares(
    bend: int, tension: bool, louder: float
) -> None:
    """Trial by trial: a line, a slope of force, and a step of three times less credit, in more noise than is said."""
    random = np.random.default_rng(bend)
    u = np.linspace(-6e-4, 2e-4, 41)
    since = np.maximum(u - 1.3e-5, 0.0)
    x = 2e-9 * u / 6e-4 + 2.0 * since**2 / 2 + 2500.0 * since**3 / 6 + louder * NOISE_M * random.standard_normal(41)
    found = edges._least_squares_edge(u, x, NOISE_M, (-1.5e-4, 1.5e-4), (bend, 0.0, 0), tension=tension)
    assert found is not None
    trials = np.linspace(-1.5e-4, 1.5e-4, 301)
    line = np.vander(u / 6e-4, bend + 1)
    costs = []
    for trial in trials:
        after = np.maximum(u - trial, 0.0) / 2e-4
        both = np.column_stack([after**2, after**3, line])
        free = [tension, False] + [True] * (bend + 1)
        costs.append([least_of(both, x / NOISE_M, free), least_of(both[:, 1:], x / NOISE_M, free[1:])])
    least = max(1.0, np.min(costs) / (41 - bend - 4))
    assert least > 4.0 or louder == 1.0
    likely = np.array(costs) / least
    cost = -2.0 * np.logaddexp(-0.5 * likely[:, 0], np.log(3.0) - 0.5 * likely[:, 1])
    weight = np.exp(-0.5 * (cost - cost.min()))
    mean = weight @ trials / weight.sum()
    std = np.sqrt(weight @ (trials - mean) ** 2 / weight.sum())
    assert found.time_s == pytest.approx(mean, abs=0.1 * std)
    assert found.std_s == pytest.approx(std, rel=0.1)
