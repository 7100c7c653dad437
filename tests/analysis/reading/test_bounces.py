"""The short flights between the first contacts: whether the block moves freely in them."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.reading import bounces
from analysis.reading.bounces import (
    _first_maximum,
    _flight_edges,
    _free,
    _is_flight,
    _is_straight,
    _local_force,
    _refined_peak,
    _straightened,
    _with_grazing_uncertainty,
    find_bounces,
)
from analysis.reading.edges import Edge
from analysis.reading.flight import Flight
from analysis.reading.floor_spectrum import FloorSpectrum, Octaves
from analysis.shot.motion import Motion
from tests.analysis.synthetic_collision import CONTACT_N_PER_M, MASS_KG, Synthetic, motion_from, motion_of

RIG = Synthetic(noise_m=0.1e-9)
RELEASE, ONSET = Edge(1.0e-3, 1e-6), Edge(1.8e-3, 1e-6)


@pytest.mark.parametrize(("bend_m", "straight"), [(0.0, True), (2e-9, False)])
def test_a_flight_whose_displacement_bends_by_more_than_the_noise_is_not_free(bend_m: float, straight: bool) -> None:
    time_s = np.arange(0.0, 3e-3, 1.0 / RIG.rate_hz)
    tau = (time_s - RELEASE.time_s) / (ONSET.time_s - RELEASE.time_s)
    displacement_m = 0.1 * time_s + bend_m * np.sin(np.pi * tau)
    displacement_m += np.random.default_rng(1).normal(0.0, RIG.noise_m, time_s.size)
    motion = motion_from(time_s, displacement_m, RIG)
    assert _is_straight(motion, (RELEASE, ONSET), RIG.noise_m) is straight


@pytest.mark.parametrize(("edge", "sample", "straight"), [(0, 1, True), (0, 2, False), (1, -1, True), (1, -2, False)])
def test_the_first_and_the_last_sample_of_a_flight_may_be_the_contacts(edge: int, sample: int, straight: bool) -> None:
    time_s = np.arange(0.0, 3e-3, 1e-5)
    ends = Edge(1.0e-3 + 1e-6, 1e-6), Edge(1.8e-3 - 1e-6, 1e-6)
    pushed = 0.1 * time_s
    at = round(ends[edge].time_s * 1e5) + sample
    pushed[slice(None, at + 1) if edge == 0 else slice(at, None)] += 1e-7
    assert _is_straight(motion_from(time_s, pushed, RIG), ends, RIG.noise_m) is straight
    few = Edge(1.0e-3, 1e-6), Edge(1.045e-3, 1e-6)  # of three samples nothing is said
    assert _is_straight(motion_from(time_s, 1e3 * time_s**2, RIG), few, RIG.noise_m)


def test_what_the_flight_is_braked_by_is_taken_off_the_displacement() -> None:
    time = np.arange(0.0, 0.02, 1e-5)
    flight = Flight(0.01, np.array([0.0, -0.2, 0.3]), np.zeros((3, 3)), 0.0, 0, 999)
    motion = motion_from(time, -0.2 * (time - 0.01) + 0.3 * (time - 0.01) ** 2, RIG)
    assert _straightened(motion, flight).displacement_m == pytest.approx(-0.2 * (time - 0.01), abs=1e-15)


def test_a_flight_lasts_five_samples_and_three_of_its_uncertainty_and_begins_after_the_one_before() -> None:
    step, onsets, before = 1e-5, [Edge(1.0e-3, 0.0)], [Edge(1.1e-3, 0.0)]

    def flies(release_s: float, lasts_s: float, std_s: float = 0.0) -> bool:
        return _is_flight((Edge(release_s, 3 * std_s), Edge(release_s + lasts_s, 4 * std_s)), before, onsets, step)

    assert flies(1.2e-3, 5.1e-5) and not flies(1.2e-3, 4.9e-5)
    assert flies(1.2e-3, 15.1e-4, 1e-4) and not flies(1.2e-3, 14.9e-4, 1e-4)  # 3 of hypot(3, 4)
    assert flies(1.101e-3, 1e-3) and not flies(1.099e-3, 1e-3)
    before.clear()
    assert flies(1.011e-3, 1e-3) and not flies(1.009e-3, 1e-3)


def test_a_force_is_a_parabola_over_the_fewest_samples_that_keep_its_noise_at_a_hundredth_of_the_peak() -> None:
    time = np.arange(0.0, 3e-3, 1e-5)
    motion = _with_force(np.full(time.size, 0.5), 0.0)
    motion = replace(motion, displacement_m=0.5 * 20.0 * (time - 1e-3) ** 2)

    def unit(support: int) -> float:
        at = (np.arange(support) - support // 2) * 1e-5
        return MASS_KG * 2.0 * float(np.linalg.norm(np.linalg.pinv(np.vander(at, 3))[0]))

    for narrower, support in ((5, 7), (9, 11), (15, 21)):
        noise_m = 0.01 * 0.5 / np.sqrt(unit(narrower) * unit(support))
        force, std = _local_force(motion, np.arange(50, 100), noise_m)
        assert force == pytest.approx(20.0 * MASS_KG, rel=1e-6)
        assert std == pytest.approx(noise_m * unit(support), rel=1e-6)
        drawn = noise_m * np.random.default_rng(1).standard_normal(20_000)
        noisy = replace(_with_force(np.full(20_000, 0.5), 0.0), displacement_m=drawn)
        assert np.std(_local_force(noisy, np.arange(100, 19_900), noise_m)[0]) == pytest.approx(std, rel=0.05)


def test_a_flight_of_a_third_of_the_first_contact_is_less_sure_by_a_twenty_fifth_of_it() -> None:
    edges = Edge(1.0, 3e-3), Edge(1.36, 4e-3)
    assert _with_grazing_uncertainty(edges, 1.0) is edges
    release, onset = _with_grazing_uncertainty((edges[0], Edge(1.34, 4e-3)), 1.0)
    assert (release.time_s, onset.time_s) == (1.0, 1.34)
    assert [release.std_s, onset.std_s] == pytest.approx([np.hypot(3e-3, 0.04), np.hypot(4e-3, 0.04)])


def _with_force(force: np.ndarray, std: float) -> Motion:
    time = np.arange(force.size) * 1e-5
    return replace(motion_from(time, 0.0 * time, RIG), force_n=force, force_std_n=np.full(force.size, std))


def test_the_first_maximum_of_a_force_is_that_which_it_falls_from_by_six_of_its_noise_or_a_fiftieth() -> None:
    force = np.interp(np.arange(60), [0, 10, 15, 30, 50, 59], [0.0, 1.0, 0.9, 2.0, 0.0, 0.0])
    index = np.arange(60)
    assert _first_maximum(_with_force(force, 0.01), index) == pytest.approx(10e-5)
    assert _first_maximum(_with_force(force, 0.1 / 6.1), index) == pytest.approx(10e-5)
    assert _first_maximum(_with_force(force, 0.1 / 5.9), index) == pytest.approx(30e-5)
    shallow = np.where((index > 10) & (index < 20), 0.985, np.where(index < 20, force, 2.0 - 0.1 * np.abs(index - 30)))
    assert _first_maximum(_with_force(shallow, 1e-6), index) == pytest.approx(30e-5)
    assert _first_maximum(_with_force(force, 0.01), index[:5]) is None
    assert _first_maximum(_with_force(force[::-1].copy(), 0.01), index[20:]) is not None
    assert _first_maximum(_with_force(2.0 - 0.1 * np.arange(60), 1e-3), index) is None
    assert _first_maximum(_with_force(force, 0.01), index[:4]) is None


@pytest.mark.parametrize("noise_m", [1e-11, 2e-10])
def test_a_peak_of_force_is_found_to_its_uncertainty_by_the_displacement_about_it(noise_m: float) -> None:
    """A spring's half-sine from its touch on: its largest force lies at a quarter of the period."""
    rate = float(np.sqrt(CONTACT_N_PER_M / MASS_KG)) * 5.0
    top_s, off, stds = 1e-3 + np.pi / 2 / rate, [], []
    time = np.arange(0.0, 1e-3 + np.pi / rate + 1e-3, 1e-5)
    u = np.clip(time - 1e-3, 0.0, np.pi / rate)
    x = -0.2 * np.minimum(time - 1e-3, 0.0) - 0.2 * np.sin(rate * u) / rate + 0.2 * np.maximum(time - 1e-3 - u, 0.0)
    x[time < 1e-3] = -0.2 * (time[time < 1e-3] - 1e-3)
    for seed in range(30):
        noisy = motion_from(time, x + np.random.default_rng(seed).normal(0.0, noise_m, time.size), RIG)
        peak = _refined_peak(noisy, 1e-3, top_s + 1.5e-5, 1e-3 + np.pi / rate, noise_m)
        assert peak is not None
        off.append(peak.time_s - top_s)
        stds.append(peak.std_s)
    assert np.sqrt(np.mean(np.square(off))) < 1.5 * np.median(stds) < 3e-5
    quiet, loud = (_refined_peak(motion_from(time, x, RIG), 1e-3, top_s, 1.0, n) for n in (1e-12, 3e-8))
    assert quiet is not None and loud is not None and loud.std_s > 3.0 * quiet.std_s
    assert quiet.std_s > 0.0005 * (top_s - 1e-3)
    assert _refined_peak(motion_from(time, x, RIG), 1e-3, 1e-3 + 3e-5, 1e-3 + 4e-5, noise_m) is None


@pytest.mark.parametrize("lasts", [12, 60])  # samples: fitted whole, or with a line of its own
def test_a_flight_between_two_contacts_is_found_with_both_its_edges(lasts: int) -> None:
    off, stds = [], []
    for seed in range(25):
        shift = 1e-5 * float(np.random.default_rng(seed).uniform())
        release_s, onset_s = 1e-3 + shift, 1e-3 + shift + lasts * 1e-5
        time = np.arange(0.0, 2.5e-3, 1e-5)
        before, after = np.maximum(release_s - time, 0.0), np.maximum(time - onset_s, 0.0)
        x = 0.1 * time + 3e4 * before**3 / 6 + 5.0 * after**2 / 2 + 3e4 * after**3 / 6
        motion = motion_from(time, x + np.random.default_rng(seed).normal(0.0, RIG.noise_m, time.size), RIG)
        first, last = round(release_s * 1e5) - 1, round(onset_s * 1e5) + 1
        for level in (RIG.noise_m, 1.5 * RIG.noise_m):
            edges = _flight_edges(motion, first, last, RIG.noise_m, level)
            assert edges is not None
            if level == RIG.noise_m:
                off.append([edges[0].time_s - release_s, edges[1].time_s - onset_s])
                stds.append([edge.std_s for edge in edges])
    rms = np.sqrt(np.mean(np.square(np.array(off) / stds), axis=0))
    assert np.all((rms > 0.3) & (rms < 1.6)), rms
    assert np.all(np.median(stds, axis=0) < 2.5e-5)


def test_bounces_are_looked_for_in_the_first_two_fifths_of_a_contact_and_on_a_still_or_moving_floor() -> None:
    rig = Synthetic()
    motion = motion_of(rig)
    touch, release = Edge(rig.touch_s, 1e-7), Edge(rig.touch_s + 28.7077e-3, 1e-6)
    flight = Flight(rig.touch_s, np.array([0.0, -0.265]), np.zeros((2, 2)), rig.noise_m, 0, 999)
    octaves = Octaves.of(motion.time_s[::50], 5e-4)

    def floor(speed_m_per_s: float) -> FloorSpectrum:
        return FloorSpectrum(octaves, np.full(octaves.centre_hz.size, speed_m_per_s**2), rig.noise_m, 1e5)

    still = find_bounces(motion, touch, release, flight, floor(0.0))
    assert still.onsets[0] is touch and not still.disturbed
    assert np.array([e.time_s for e in still.onsets]) - rig.touch_s == pytest.approx(
        [0.0, 1.56573968e-3, 2.34904083e-3], abs=25e-6
    )
    early = find_bounces(motion, touch, Edge(rig.touch_s + 2.0e-3 / 0.4, 1e-6), flight, floor(0.0))
    assert [len(early.onsets), len(early.releases)] == [2, 1]
    moving = find_bounces(motion, touch, release, flight, floor(1e-4))
    assert moving.onsets[1].std_s > 1.4 * still.onsets[1].std_s
    holed = replace(motion, valid=np.arange(motion.time_s.size) != 1050)
    assert find_bounces(holed, touch, release, flight, floor(0.0)).onsets == (touch,)


@pytest.mark.parametrize(("lasts", "level", "curved"), [(31, 1.0, None), (32, 1.39, False), (32, 1.41, True)])
def test_a_flight_of_24_samples_has_a_line_of_its_own_which_a_floor_bends(
    lasts: int, level: float, curved: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """24 without an eighth at each end; a shorter one is fitted whole, with ten samples of contact on either side."""
    seen: list[Any] = []
    line = Flight(0.0, np.zeros(2), np.zeros((2, 2)), RIG.noise_m, 104, 100 + lasts - 4)
    edge = Edge(1.0, 1.0)
    monkeypatch.setattr(bounces, "fit_flight", lambda motion, *of, **how: seen.append((of, how)) or line)
    monkeypatch.setattr(bounces, "edge_of_line", lambda motion, of, **how: seen.append((of.noise_std_m, how)) or edge)
    monkeypatch.setattr(bounces, "edges_of_short_flight", lambda *of, bend: seen.append((*of, bend)) or (edge, edge))
    time = np.arange(0.0, 3e-3, 1e-5)
    noise_m = RIG.noise_m
    motion = motion_from(time, -0.2 * time, RIG)
    assert _flight_edges(motion, 100, 100 + lasts, noise_m, level * noise_m) == (edge, edge)
    if curved is None:
        ((at, x, std, release, onset, bend),) = seen
        assert (
            at == pytest.approx(time[90:142]) and x == pytest.approx(motion.displacement_m[90:142]) and std == noise_m
        )
        assert release == pytest.approx((92e-5, 114e-5)) and onset == pytest.approx((117e-5, 139e-5))
        assert bend == 1
        seen.clear()
        _flight_edges(motion, 5, 12, noise_m, noise_m)  # of a few samples a little more is searched
        assert seen[0][0] == pytest.approx(time[:23])
        assert seen[0][3] == pytest.approx((2e-5, 11e-5)) and seen[0][4] == pytest.approx((6e-5, 20e-5))
        for floor_m, line in ((1.39 * noise_m, (1.39 * noise_m, 1)), (1.41 * noise_m, (noise_m, 2))):
            seen.clear()
            _flight_edges(motion, 100, 100 + lasts, noise_m, floor_m)
            assert (seen[0][2], seen[0][5]) == line
        return
    ends = {"nearest": 116, "curved": curved}
    std, bend = (noise_m, 2) if curved else (level * noise_m, 0)
    assert seen == [
        ((104, 128), ends),
        (pytest.approx(std), {"until": 104 - 44, "bend": bend}),
        (pytest.approx(std), {"until": 128 + 44, "bend": bend}),
    ]
    monkeypatch.setattr(bounces, "fit_flight", lambda motion, *of, **how: None)
    assert _flight_edges(motion, 100, 100 + lasts, noise_m, level * noise_m) is None


def test_a_floor_is_asked_how_far_it_bends_a_flight_and_how_far_its_end_lies_off() -> None:
    rig, asked = Synthetic(), list[Any]()
    motion = motion_of(rig)
    floor: Any = SimpleNamespace(
        difference_std_m=lambda lag, order: asked.append((lag, order)) or 0.0,
        end_std_m=lambda lasts, degree: asked.append((lasts, degree)) or 0.0,
    )
    flight = Flight(rig.touch_s, np.array([0.0, -0.265]), np.zeros((2, 2)), rig.noise_m, 0, 999)
    found = find_bounces(motion, Edge(rig.touch_s, 1e-7), Edge(rig.touch_s + 28.7077e-3, 1e-6), flight, floor)
    (half, second), (whole, first) = asked[:2]
    assert (second, first) == (2, 1) and half == pytest.approx(0.5 * whole)
    assert whole == pytest.approx(found.onsets[1].time_s - found.releases[0].time_s, abs=6e-5)


def test_a_sample_of_noise_parts_no_flight_and_a_contact_does_however_short() -> None:
    force = np.concatenate([np.full(20, 5.0), np.full(60, 0.5), np.full(20, 5.0)])
    whole = (force < 1.0).tolist()
    for samples, height, parted in ((1, 1.4, False), (1, 1.6, True), (4, 1.4, False), (5, 1.4, True)):
        struck = force.copy()
        struck[40 : 40 + samples] = height
        expected = [free and not (parted and 40 <= k < 40 + samples) for k, free in enumerate(whole)]
        assert _free(struck, 1.0).tolist() == expected
    for near, parted in ((4, True), (5, False)):  # at the end of a flight it may be the contact's
        struck = force.copy()
        struck[79 - near] = 1.2
        assert _free(struck, 1.0)[79 - near] != parted
