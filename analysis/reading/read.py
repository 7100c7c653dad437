"""Read the numbers of one impact from its motion; a number that cannot be read is replaced by the reason."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.linalg import LinAlgError

from analysis.reading import pulse
from analysis.reading.both_flights import Flights, read_flights
from analysis.reading.bounces import Bounces, find_bounces
from analysis.reading.edges import Edge, edge_of_flight
from analysis.reading.flight import LONGEST_FLIGHT_S, MIN_SAMPLES, Flight
from analysis.reading.locate import CollisionSpan, find_collision
from analysis.reading.vibration_lines import without_lines
from analysis.shot import (
    AnalysisError,
    Disturbance,
    Impact,
    KineticCor,
    Motion,
    NotSeen,
    Quantity,
    Reading,
    VibrationSpectrum,
    reading_flags,
)

GUARD = 1.5  # gap between a flight's line and a contact's edge, in lengths of the force filter (1 / bandwidth)
RELEASE_CLEAR = 0.015  # least gap before the line of an outgoing flight, as a fraction of the contact time
SWAY_SHARE = 0.025  # fraction of the contact time, beyond the line, over which the floor's motion is unknown
FADED_SIGMAS = 3.0  # agreement required between the releases read from displacement and from force
EDGE_REACH = 0.4  # fraction of the contact time, from its edge, in which the force is fitted at most
FLOOR_SIGNIFICANT_M = 1e-9  # rms of floor motion above which it hides the end of a contact and moves the plate
FLOOR_TIMES = 1.4  # ratio of a std to that of white noise alone at which half of the variance is the floor's
VIBRATION_TOLERANCE = 4e-6  # fraction of a velocity above which vibration matters; a quiet table is below it


class NoImpact(Exception):
    """Raised if no collision can be read from a motion; the message gives the reason in one line."""


def read_impact(motion: Motion) -> Impact:
    """Read one collision.  Raises NoImpact if the record shows none."""
    return _read(motion, *_between_flights(motion))


def _between_flights(motion: Motion) -> tuple[CollisionSpan, Edge, Edge | None, Flights]:
    """Return the span of the collision, touch and release, and the flights before and after."""
    span = find_collision(motion)
    if span is None:
        raise NoImpact("no impact: the force never rises above its noise")
    touch, release = _edges(motion, span)
    flights = _read_flights(motion, span, touch, release)
    if flights is not None and flights.lines:  # read edges and flights again without the vibration lines
        touch, release = _edges(without_lines(motion, flights.lines), span)
        flights = _read_flights(motion, span, touch, release, flights)
    if flights is None:
        raise NoImpact("no free flight before the contact: the record starts too late")
    return span, touch, release, flights


def _read(motion: Motion, span: CollisionSpan, touch: Edge, release: Edge | None, flights: Flights) -> Impact:
    """Read all numbers between two flights."""
    motion = without_lines(motion, flights.lines)
    flight_in, flight_out, noise = flights.incoming, flights.outgoing, flights.floor
    v_in = _velocity(flight_in, touch, "before the touch")
    if v_in.value >= 0.0:
        raise NoImpact("the block does not move towards the plate before the contact")
    if release is not None and flights.floor.rms_m > max(FLOOR_SIGNIFICANT_M, flights.floor.white_std_m):
        release = _with_floor_uncertainty(release, span, flights, v_in.value, motion)
    if flight_out is None or release is None:
        return _unfinished(touch, v_in, "no_release", "the record ends within the contact")
    motion = pulse.with_short_holes_closed(motion, release.time_s - touch.time_s)
    turnaround = pulse.find_turnaround(motion, touch, release)
    if turnaround is None:
        return _unfinished(touch, v_in, "no_turn", "the block does not turn round")
    v_out = _velocity(flight_out, release, "after the release")
    quasi_static = _ratio(v_out, v_in, flights.velocity_covariance, "|v_out / v_in| of the two free flights")
    drag = (
        motion.moving_mass_kg * flight_in.acceleration_m_per_s2,
        motion.moving_mass_kg * flight_out.acceleration_m_per_s2,
    )
    impulse = pulse.read_impulse_ratio(motion, turnaround, touch, release, drag, noise)
    bounces = find_bounces(motion, touch, release, flight_in, noise)
    flags = _flags(span, flights, motion)
    if _disturbed(bounces):
        flags.append("bounces_disturbed")
    impact = Impact(
        touch_time_s=Quantity(touch.time_s, touch.std_s, "where the displacement leaves the incoming flight"),
        release_time_s=Quantity(
            release.time_s, release.std_s, "where the force has faded and the displacement joins the outgoing flight"
        ),
        turnaround_time_s=Quantity(turnaround, 1.0 / motion.sample_rate_hz / np.sqrt(12.0), "where v = 0"),
        velocity_in_m_per_s=v_in,
        velocity_out_m_per_s=v_out,
        cor_quasi_static=quasi_static,
        cor_impulse=impulse,
        cor_kinetic=_kinetic(bounces),
        force_peak_n=pulse.read_peak(motion, touch, release, noise),
        force_fwhm_s=pulse.read_fwhm(motion, touch, release, noise),
        contact_time_s=Quantity(
            release.time_s - touch.time_s, float(np.hypot(touch.std_s, release.std_s)), "first touch to last release"
        ),
        deflection_max_m=pulse.read_deflection(motion, turnaround, touch, v_in.value, noise),
        stiffness_slope_n_per_m=pulse.read_slope(motion, touch, release, flight_in, noise),
        bounce_onsets_s=tuple(e.time_s for e in bounces.onsets),
        bounce_peaks_s=tuple(e.time_s for e in bounces.peaks),
        bounce_releases_s=tuple(e.time_s for e in bounces.releases),
    )
    momentum = pulse.read_momentum(motion, touch, release, drag, (v_in, v_out), noise)
    flags += reading_flags(impact, momentum)
    return replace(impact, flags=tuple(flags), disturbance=_disturbance(flights, motion, (v_in, v_out)))


def read_frame_motion(motion: Motion) -> VibrationSpectrum | None:
    """Return the frame's vibration read from a motion; None if it is negligible or cannot be read."""
    try:
        found = _between_flights(motion)
        if not _frame_moves(found[-1]):  # no further reading is needed
            return None
        disturbance = _read(motion, *found).disturbance
    except (NoImpact, AnalysisError, LinAlgError):
        return None
    return disturbance.vibration if disturbance else None


def _edges(motion: Motion, span: CollisionSpan) -> tuple[Edge, Edge | None]:
    """Return touch and release, read from the force if the displacement does not show them clearly."""
    reach = round(EDGE_REACH * (span.last - span.first))
    way = motion.displacement_m[min(span.first, span.turn) : span.turn + 1]
    if not np.isfinite(way).any():
        return _threshold_edge(motion, span.first), None
    lasts = max(float(motion.time_s[span.last] - motion.time_s[span.first]), 1.0 / motion.sample_rate_hz)
    depth = float(np.nanmax(way) - np.nanmin(way))
    flight = (span.flight_first, max(span.first - 1, span.flight_first))
    guard = GUARD / motion.bandwidth_hz
    touch = edge_of_flight(
        motion, flight, span.first, until=span.first + reach, depth_m=depth, guard_s=min(guard, 0.1 * lasts)
    )
    touch = touch or _threshold_edge(motion, span.first)
    if not span.finished:
        return touch, None
    faded = _force_release(motion, span)
    flight = (min(span.last + 1, span.flight_last), span.flight_last)
    guard = max(guard, 2.0 * faded.std_s, RELEASE_CLEAR * lasts)
    near = min(span.last, span.flight_last)
    seen = edge_of_flight(motion, flight, near, until=span.last - reach, depth_m=depth, guard_s=guard)
    if seen is None or seen.std_s > faded.std_s:
        return touch, faded
    apart = abs(seen.time_s - faded.time_s)
    # floor motion departs from the flight's line without a force; an adhesion holds the block with little force
    return touch, seen if apart < FADED_SIGMAS * faded.std_s else faded.with_added_uncertainty(0.5 * apart)


def _force_release(motion: Motion, span: CollisionSpan) -> Edge:
    """Return the release read from the force."""
    return Edge(float(motion.time_s[span.last]), span.last_std_s)


def _read_flights(
    motion: Motion, span: CollisionSpan, touch: Edge, release: Edge | None, before: Flights | None = None
) -> Flights | None:
    """Fit the flights up to the edges, over the stretch free of other forces and at most LONGEST_FLIGHT_S."""
    longest = max(round(LONGEST_FLIGHT_S * motion.sample_rate_hz), MIN_SAMPLES)
    guard = 1 + round(2.0 * touch.std_s * motion.sample_rate_hz)
    last = int(np.searchsorted(motion.time_s, touch.time_s)) - guard
    into = (max(span.flight_first, last - longest), last)
    if into[1] - into[0] < 3:
        return None
    out = None
    if release is not None:
        guard = 1 + min(round(2.0 * release.std_s * motion.sample_rate_hz), (span.flight_last - span.last) // 4)
        first = int(np.searchsorted(motion.time_s, release.time_s)) + guard
        out = (first, min(span.flight_last, first + longest))
        out = out if out[1] - out[0] >= 3 else None
    return read_flights(motion, into, out, before)


def _flags(span: CollisionSpan, flights: Flights, motion: Motion) -> list[str]:
    """Return the flags of the flights: cut short by another force, vibration, knocks."""
    flags = []
    longest = LONGEST_FLIGHT_S * motion.sample_rate_hz
    short_before = span.disturbed_before and span.first - span.flight_first < longest
    if short_before or (span.disturbed_after and span.flight_last - span.last < longest):
        flags.append("flight_cut")
    elif span.disturbed_after:
        flags.append("goes_on")
    if _vibration_matters(flights):
        flags.append("vibration")
    if flights.knocks_s or flights.unremovable_knock:
        flags.append("knock")
    return flags


def _vibration_matters(flights: Flights) -> bool:
    """Return whether vibration matters for a velocity: either the subtracted lines or the floor's motion."""
    for flight, plain in zip((flights.incoming, flights.outgoing), flights.plain, strict=True):
        if flight is None:
            continue
        value, std = flight.velocity(flight.time_zero_s)
        least = VIBRATION_TOLERANCE * abs(value)
        if any(2 * np.pi * line.frequency_hz.value * line.amplitude_m.value > least for line in flights.lines):
            return True
        if std > max(least, FLOOR_TIMES * plain):
            return True
    return False


def _with_floor_uncertainty(
    release: Edge, span: CollisionSpan, flights: Flights, velocity_in: float, motion: Motion
) -> Edge:
    """Return the release with the uncertainty from the floor's motion beyond the flight's line.

    The displacement under a half-sine force departs from the flight as v omega^2 u^3 / 6.  The force is not visible
    while that is below the floor's motion.  If the force determines the release better, its reading is returned.
    """
    lasts = max(float(motion.time_s[span.last] - motion.time_s[span.first]), 1.0 / motion.sample_rate_hz)
    omega = np.pi / lasts
    lost = float(np.cbrt(6.0 * flights.floor.difference_std_m(SWAY_SHARE * lasts, 3) / (abs(velocity_in) * omega**2)))
    return _force_release(motion, span) if 0.5 * lost > span.last_std_s else release.with_added_uncertainty(0.5 * lost)


def _disturbance(flights: Flights, motion: Motion, velocities: tuple[Quantity, Quantity]) -> Disturbance:
    """Return the disturbance of the displacement, and its share of the variance of each number."""
    return Disturbance(
        lines=flights.lines,
        floor_rms_m=flights.floor.rms_m,
        floor_rms_m_per_s=flights.floor.velocity_std_m_per_s((0.0,), (1.0,), motion.bandwidth_hz),
        knocks_s=flights.knocks_s,
        shares=_shares(flights, velocities),
        vibration=flights.floor.vibration.with_lines(flights.lines) if _frame_moves(flights) else None,
    )


def _frame_moves(flights: Flights) -> bool:
    """Return whether the frame's motion is so large that a fit has to include it."""
    return bool(flights.lines) or flights.floor.rms_m > FLOOR_SIGNIFICANT_M


def _shares(flights: Flights, velocities: tuple[Quantity, Quantity]) -> Mapping[str, float]:
    of_both = zip(("velocity_in_m_per_s", "velocity_out_m_per_s"), flights.plain, velocities, strict=True)
    return {
        name: float(np.clip(1.0 - (std / velocity.std) ** 2, 0.0, 1.0))
        for name, std, velocity in of_both
        if velocity.std > 0.0
    }


def _threshold_edge(motion: Motion, sample: int) -> Edge:
    """Return an edge at the force's threshold, with an uncertainty set by the length of the force filter."""
    return Edge(float(motion.time_s[sample]), float(np.hypot(0.25 / motion.bandwidth_hz, 0.5 / motion.sample_rate_hz)))


def _velocity(flight: Flight, edge: Edge, where: str) -> Quantity:
    value, std = flight.velocity(edge.time_s)
    order = "straight line" if flight.coefficients.size == 2 else "parabola"
    samples = flight.last - flight.first + 1
    return Quantity(value, std, f"{order} through {samples} samples of free flight, at the instant just {where}")


def _ratio(out: Quantity, into: Quantity, covariance: float, how: str) -> Quantity:
    value = abs(out.value / into.value)
    square = (out.std / out.value) ** 2 + (into.std / into.value) ** 2
    square -= 2.0 * covariance / (out.value * into.value)
    return Quantity(value, value * float(np.sqrt(max(square, 0.0))), how)


def _disturbed(bounces: Bounces) -> bool:
    """Return whether the bounces are disturbed: a flight is curved, or the second bounce is longer than the first."""
    on = [edge.time_s for edge in bounces.onsets]
    top = [edge.time_s for edge in bounces.peaks]
    return bounces.disturbed or any(len(t) >= 3 and t[2] - t[1] >= t[1] - t[0] for t in (on, top))


def _kinetic(bounces: Bounces) -> KineticCor:
    """Return T2 / T1 in three ways (docs/physics.md), or which bounce is missing."""
    contacts = len(bounces.onsets)
    if _disturbed(bounces):
        ringing = NotSeen("the flights between the bounces are not straight: something else moves the block")
        return KineticCor(ringing, ringing, ringing)
    missing = NotSeen(f"{contacts} contact{'s' if contacts != 1 else ''} resolved, three are needed")
    on, off, top = bounces.onsets, bounces.releases, bounces.peaks
    onsets: Reading = missing
    flights: Reading = missing
    peaks: Reading = NotSeen(f"{len(top)} force peaks resolved, three are needed")
    if contacts >= 3:
        onsets = _intervals(on[0], on[1], on[1], on[2], "contact onset to onset")
        flights = _intervals(off[0], on[1], off[1], on[2], "free flight to free flight")
    if len(top) >= 3:
        peaks = _intervals(top[0], top[1], top[1], top[2], "force peak to force peak")
    return KineticCor(force_peaks=peaks, onsets=onsets, flights=flights)


def _intervals(a: Edge, b: Edge, c: Edge, d: Edge, how: str) -> Quantity:
    first, second = b.time_s - a.time_s, d.time_s - c.time_s
    ratio = second / first
    if b is c:  # the middle instant changes both intervals, with opposite signs
        parts = [a.std_s * ratio / first, b.std_s * (1 + ratio) / first, d.std_s / first]
    else:
        parts = [a.std_s * ratio / first, b.std_s * ratio / first, c.std_s / first, d.std_s / first]
    how = f"T2/T1, {how}: {second * 1e3:.4g} ms / {first * 1e3:.4g} ms"
    return Quantity(ratio, float(np.linalg.norm(parts)), how)


def _unfinished(touch: Edge, v_in: Quantity, flag: str, why: str) -> Impact:
    unseen = NotSeen(why)
    return Impact(
        touch_time_s=Quantity(touch.time_s, touch.std_s, "where the displacement leaves the incoming flight"),
        release_time_s=unseen,
        turnaround_time_s=unseen,
        velocity_in_m_per_s=v_in,
        velocity_out_m_per_s=unseen,
        cor_quasi_static=unseen,
        cor_impulse=unseen,
        cor_kinetic=KineticCor(unseen, unseen, unseen, unseen),
        force_peak_n=unseen,
        force_fwhm_s=unseen,
        contact_time_s=unseen,
        deflection_max_m=unseen,
        stiffness_slope_n_per_m=unseen,
        flags=(flag,),
    )
