"""Each number of an impact from its parts: intervals, flags on both sides of their gates, uncertainties that add."""

from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.reading import read
from analysis.reading.both_flights import Flights
from analysis.reading.bounces import Bounces
from analysis.reading.edges import Edge
from analysis.reading.flight import Flight
from analysis.reading.floor_spectrum import FloorSpectrum, Octaves
from analysis.reading.locate import CollisionSpan, find_collision
from analysis.reading.read import (
    NoImpact,
    _edges,
    _flags,
    _frame_moves,
    _intervals,
    _kinetic,
    _read_flights,
    _threshold_edge,
    _unfinished,
    _velocity,
    _vibration_matters,
    _with_floor_uncertainty,
    read_impact,
)
from analysis.shot.impact import KineticCor, VibrationLine
from analysis.shot.motion import Motion
from analysis.shot.quantity import NotSeen, Quantity
from tests.analysis.synthetic_collision import Synthetic, motion_from, motion_of

RIG = Synthetic(rate_hz=1e4, bandwidth_hz=1e3)
TIME_S = np.arange(0.0, 0.1, 1 / RIG.rate_hz)
SPAN = CollisionSpan(400, 550, 700, 1e-3, 0, 999, False, False, True)
OCTAVES = Octaves.of(TIME_S[::5], 5 / RIG.rate_hz)


def floor_of(speed_m_per_s: float) -> FloorSpectrum:
    return FloorSpectrum(OCTAVES, np.full(OCTAVES.centre_hz.size, speed_m_per_s**2), 1e-10, RIG.rate_hz)


def flights_of(**changes: Any) -> Flights:
    """Return flights with an uncertainty of white noise alone."""
    into = Flight(0.0399, np.array([0.0, -0.2, 0.1]), 1e-16 * np.eye(3), 1e-10, 0, 399)
    out = Flight(0.0701, np.array([0.0, 0.19, -0.3]), 1e-16 * np.eye(3), 1e-10, 701, 999)
    quiet = Flights(into, out, 0.0, (), floor_of(0.0), (), (1e-8, 1e-8), np.zeros(0))
    return replace(quiet, **changes)


def still() -> Motion:
    return motion_from(TIME_S, -0.2 * TIME_S, RIG)


def line(frequency_hz: float, amplitude_m: float) -> VibrationLine:
    return VibrationLine(Quantity(frequency_hz, 0.0), Quantity(amplitude_m, 0.0), 0.0)


@pytest.mark.parametrize("shared", [True, False])
def test_a_ratio_of_intervals_scatters_by_its_instants_the_shared_one_in_both(shared: bool) -> None:
    at, stds = np.array([1.0, 2.5, 3.0, 3.9]), np.array([3e-4, 5e-4, 4e-4, 2e-4])
    edges = [Edge(float(a), float(s)) for a, s in zip(at, stds, strict=True)]
    drawn = at + stds * np.random.default_rng(1).standard_normal((40_000, 4))
    a, b, c, d = drawn.T
    if shared:
        edges[2], c = edges[1], b
    ratio = _intervals(*edges, "peak to peak")
    assert ratio.value == pytest.approx((3.9 - edges[2].time_s) / 1.5)
    assert ratio.std == pytest.approx(float(np.std((d - c) / (b - a))), rel=0.02)
    assert ratio.how == f"T2/T1, peak to peak: {(3.9 - edges[2].time_s) * 1e3:.4g} ms / 1500 ms"


def edges_at(*times_s: float) -> tuple[Edge, ...]:
    return tuple(Edge(time, 1e-6) for time in times_s)


def test_the_kinetic_restitution_is_of_onsets_flights_and_peaks() -> None:
    whole = Bounces(edges_at(0.0, 1.6, 2.4), edges_at(0.4, 2.0), edges_at(0.1, 1.7, 2.5))
    kinetic = _kinetic(whole)
    values = [reading.value for reading in (kinetic.onsets, kinetic.flights, kinetic.force_peaks)]  # type: ignore[union-attr]
    assert values == pytest.approx([0.5, 0.4 / 1.2, 0.5])
    fewer = _kinetic(replace(whole, onsets=whole.onsets[:2], peaks=whole.peaks[:2]))
    assert fewer == KineticCor(
        NotSeen("2 force peaks resolved, three are needed"),
        *(2 * [NotSeen("2 contacts resolved, three are needed")]),
    )
    assert _kinetic(Bounces(edges_at(0.0), (), ())).onsets == NotSeen("1 contact resolved, three are needed")
    without_peaks = _kinetic(replace(whole, peaks=whole.peaks[:1]))
    assert without_peaks.onsets == kinetic.onsets and isinstance(without_peaks.force_peaks, NotSeen)


@pytest.mark.parametrize("name", ["onsets", "peaks"])
def test_bounces_of_which_the_second_lasts_longer_than_the_first_are_something_else(name: str) -> None:
    whole = Bounces(edges_at(0.0, 1.6, 2.4), edges_at(0.4, 2.0), edges_at(0.1, 1.7, 2.5))
    for third, disturbed in ((3.1, False), (3.31, True)):
        bounces = replace(whole, **{name: edges_at(0.1, 1.7, third)})
        found = _kinetic(bounces)
        assert all(isinstance(one, NotSeen) for one in (found.onsets, found.flights, found.force_peaks)) is disturbed
    assert isinstance(_kinetic(replace(whole, disturbed=True)).onsets, NotSeen)


def test_a_cut_flight_is_flagged_where_it_is_shorter_than_40_ms_and_what_goes_on_after_it_where_not() -> None:
    motion, calm = still(), flights_of()
    assert _flags(SPAN, calm, motion) == []
    assert _flags(replace(SPAN, disturbed_before=True, flight_first=1), calm, motion) == ["flight_cut"]
    assert _flags(replace(SPAN, disturbed_before=True, flight_first=0), calm, motion) == []
    assert _flags(replace(SPAN, disturbed_after=True, flight_last=1099), calm, motion) == ["flight_cut"]
    assert _flags(replace(SPAN, disturbed_after=True, flight_last=1100), calm, motion) == ["goes_on"]
    assert _flags(SPAN, replace(calm, knocks_s=((0.01, 0.02),)), motion) == ["knock"]
    assert _flags(SPAN, replace(calm, unremovable_knock=True), motion) == ["knock"]
    assert _flags(SPAN, replace(calm, lines=(line(50.0, 1e-6),), unremovable_knock=True), motion) == [
        "vibration",
        "knock",
    ]


def test_vibration_matters_that_moves_with_4_ppm_of_the_velocity_or_makes_half_of_a_variance() -> None:
    least = 4e-6 * 0.19  # of the slower flight
    for times, matters in ((0.95, False), (1.02, True)):
        shaken = flights_of(lines=(line(100.0, times * least / (2 * np.pi * 100.0)),))
        assert _vibration_matters(shaken) is matters
    assert _vibration_matters(flights_of(lines=(line(9.0, 1e-12), line(100.0, 1e-8))))
    for std, plain, matters in (
        (1.01 * 4e-6 * 0.2, 1e-8, True),
        (0.9 * least, 1e-8, False),
        (1e-5, 1e-5 / 1.39, False),
        (1e-5, 1e-5 / 1.41, True),
    ):
        into = replace(flights_of().incoming, covariance=np.diag([0.0, std**2, 0.0]))
        assert _vibration_matters(flights_of(incoming=into, plain=(plain, 1e-8))) is matters
        assert _vibration_matters(flights_of(incoming=into, plain=(plain, 1e-8), outgoing=None)) is matters
    out = replace(flights_of().incoming, covariance=np.diag([0.0, 1e-12, 0.0]))
    assert _vibration_matters(flights_of(outgoing=out)) and not _vibration_matters(flights_of(outgoing=None))


def test_a_frame_moves_where_it_has_lines_or_more_than_a_nanometre() -> None:
    rms = floor_of(1e-6).rms_m
    assert not _frame_moves(flights_of(floor=floor_of(0.95e-6 * 1e-9 / rms)))
    assert _frame_moves(flights_of(floor=floor_of(1.05e-6 * 1e-9 / rms)))
    assert _frame_moves(flights_of(lines=(line(50.0, 1e-12),)))


def test_a_release_is_less_sure_by_the_time_in_which_a_half_sine_hides_in_the_floor() -> None:
    floor, speed = floor_of(1e-5), 0.2
    release = _with_floor_uncertainty(Edge(0.07, 1e-9), SPAN, flights_of(floor=floor), -speed, still())
    hidden_m = floor.difference_std_m(0.025 * 0.03, 3)
    # v / omega (omega u - sin omega u) is as deep as that
    omega = np.pi / 0.03
    u = np.linspace(1e-6, 2e-3, 200_000)
    lost_s = float(np.interp(hidden_m, speed / omega * (omega * u - np.sin(omega * u)), u))
    assert release == Edge(0.07, pytest.approx(0.5 * lost_s, rel=0.01))
    # where the force tells it better, it is the force's
    faded = replace(SPAN, last=705, last_std_s=0.4 * lost_s)
    release = _with_floor_uncertainty(Edge(0.07, 1e-9), faded, flights_of(floor=floor), -speed, still())
    assert release == Edge(pytest.approx(0.0705), 0.4 * lost_s)


def test_an_edge_at_the_forces_threshold_is_as_unsure_as_its_filter_and_a_sample_are_long() -> None:
    edge = _threshold_edge(still(), 123)
    assert edge == Edge(TIME_S[123], pytest.approx(np.hypot(0.25 / 1e3, 0.5 / 1e4)))


def test_a_velocity_is_that_at_the_instant_with_what_it_was_read_from() -> None:
    quantity = _velocity(flights_of().incoming, Edge(0.0419, 0.0), "before the touch")
    assert quantity.value == pytest.approx(-0.2 + 0.2 * 0.002)
    assert quantity.std == pytest.approx(1e-8 * np.hypot(1.0, 0.004))
    assert quantity.how == "parabola through 400 samples of free flight, at the instant just before the touch"
    straight = Flight(0.0, np.array([0.0, -0.2]), np.eye(2), 0.0, 5, 5)
    assert _velocity(straight, Edge(0.1, 0.0), "").how.startswith("straight line through 1 samples")


def test_what_was_not_finished_is_said_of_every_number_but_the_touch_and_the_velocity() -> None:
    into = Quantity(-0.2, 1e-8)
    impact = _unfinished(Edge(0.04, 2e-6), into, "no_turn", "the block does not turn round")
    unseen = NotSeen("the block does not turn round")
    assert (impact.touch_time_s, impact.velocity_in_m_per_s) == (
        Quantity(0.04, 2e-6, "where the displacement leaves the incoming flight"), into,
    )  # fmt: skip
    others = {field.name for field in fields(impact)} - {"touch_time_s", "velocity_in_m_per_s", "cor_kinetic"}
    others = {name for name in others if isinstance(getattr(impact, name), Quantity | NotSeen)}
    assert len(others) == 10
    assert all(getattr(impact, name) == unseen for name in others)
    assert impact.cor_kinetic == KineticCor(unseen, unseen, unseen, unseen) and impact.flags == ("no_turn",)


def test_flights_are_read_up_to_the_edges_and_no_longer_than_40_ms_or_400_samples() -> None:
    seen: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(read, "read_flights", lambda *of: seen.append(of[1:]) or SimpleNamespace())
        motion = still()
        fast = replace(motion, sample_rate_hz=2e4, time_s=0.5 * TIME_S)
        long = replace(SPAN, flight_last=9999)
        _read_flights(motion, SPAN, Edge(0.04005, 1e-5), Edge(0.06995, 1e-5))
        _read_flights(motion, replace(SPAN, flight_first=100), Edge(0.04005, 2e-4), Edge(0.06995, 3e-4))
        _read_flights(motion, replace(SPAN, first=600), Edge(0.06005, 1e-5), None)
        _read_flights(fast, long, Edge(0.045, 0.0), Edge(0.02, 0.0))
        _read_flights(motion, replace(SPAN, flight_last=708), Edge(0.04005, 1e-5), Edge(0.06995, 9.0))
        assert _read_flights(motion, replace(SPAN, flight_first=398), Edge(0.04005, 0.0), None) is None
        _read_flights(motion, replace(SPAN, flight_first=397), Edge(0.04005, 0.0), None)
        _read_flights(motion, replace(SPAN, flight_last=704), Edge(0.04005, 0.0), Edge(0.06995, 0.0))
        _read_flights(motion, replace(SPAN, flight_last=703), Edge(0.04005, 0.0), Edge(0.06995, 0.0))
    assert [one[:2] for one in seen] == [
        ((0, 400), (701, 999)),
        ((100, 396), (707, 999)),
        ((200, 600), None),
        ((99, 899), (401, 1201)),
        ((0, 400), (703, 708)),
        ((397, 400), None),
        ((0, 400), (701, 704)),
        ((0, 400), None),
    ]


def test_an_edge_is_found_by_its_displacement_or_else_by_the_forces_threshold() -> None:
    motion = motion_of(Synthetic())
    span = CollisionSpan(1000, 2437, 3871, 1e-4, 0, 5999, False, False, True)
    touch, release = _edges(motion, span)
    assert release is not None
    assert abs(touch.time_s - 0.010003) < 4 * touch.std_s < 4e-6
    assert abs(release.time_s - 0.010003 - 28.70771255e-3) < 4 * release.std_s < 4e-4
    assert _edges(motion, replace(span, finished=False)) == (touch, None)
    dark = motion_from(motion.time_s, np.where(np.arange(6000) < 2500, np.nan, motion.displacement_m), Synthetic())
    assert _edges(dark, span) == (_threshold_edge(dark, 1000), None)
    before = replace(span, flight_first=999)  # no flight to leave
    assert _edges(motion, before) == (_threshold_edge(motion, 1000), release)


@pytest.mark.parametrize(
    ("later_s", "std_s", "taken"),
    [
        (2.5e-4, 9e-5, "displacement"),
        (3.5e-4, 9e-5, "force, apart"),
        (2.5e-4, 1.1e-4, "force"),
        (3.5e-4, 1.1e-4, "force"),
    ],
)
def test_a_release_is_the_displacements_where_the_force_tells_about_the_same_and_not_better(
    later_s: float, std_s: float, taken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = motion_of(Synthetic(), 0)
    span = find_collision(motion)
    assert span is not None
    span = replace(span, last_std_s=1e-4)
    faded = Edge(float(motion.time_s[span.last]), 1e-4)
    seen = Edge(faded.time_s + later_s, std_s)
    monkeypatch.setattr(
        read, "edge_of_flight", lambda motion, flight, coarse, **_: seen if coarse >= span.last else None
    )
    wide = Edge(faded.time_s, pytest.approx(np.hypot(1e-4, 0.5 * later_s)))
    assert _edges(motion, span)[1] == {"displacement": seen, "force": faded, "force, apart": wide}[taken]
    monkeypatch.setattr(read, "edge_of_flight", lambda *of, **_: None)
    assert _edges(motion, span)[1] == faded


def test_a_contact_time_is_as_unsure_as_both_its_ends_and_a_turn_as_a_sample() -> None:
    impact = read_impact(motion_of(Synthetic()))
    touch, release, lasts, turn = (
        getattr(impact, name) for name in ("touch_time_s", "release_time_s", "contact_time_s", "turnaround_time_s")
    )
    assert lasts.value == pytest.approx(release.value - touch.value, rel=1e-12)
    assert lasts.std == pytest.approx(np.hypot(touch.std, release.std), rel=1e-9)
    assert turn.std == pytest.approx(1e-5 / np.sqrt(12.0), rel=1e-9)
    assert impact.disturbance is not None and impact.disturbance.vibration is None
    whole = len(impact.bounce_onsets_s), len(impact.bounce_peaks_s), len(impact.bounce_releases_s)
    assert whole == (3, 3, 2)
    with pytest.raises(NoImpact):
        read_impact(motion_from(TIME_S, 0.2 * TIME_S, RIG))
