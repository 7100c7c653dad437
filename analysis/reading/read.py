"""From motion to the numbers of one impact; what cannot be read says why."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.linalg import LinAlgError

from analysis.reading import pulse
from analysis.reading.bounces import Bounces, find_bounces
from analysis.reading.edges import Edge, edge_of_flight
from analysis.reading.flights import FEWEST_SAMPLES, LONGEST_FLIGHT_S, Flight
from analysis.reading.lines import without_lines
from analysis.reading.locate import Span, find_collision
from analysis.reading.quiet import Quiet, read_flights
from analysis.shot.disturbance import Disturbance, Shaking
from analysis.shot.doubts import doubts_of_reading
from analysis.shot.impact import Impact, KineticCor
from analysis.shot.motion import Motion
from analysis.shot.quantity import NotSeen, Quantity, Reading
from analysis.shot.shot import AnalysisError

GUARD = 1.5  # of the force filter's reach, kept clear of the line that an edge leaves
RELEASE_GUARD = 0.05  # of the contact
SWAY_SHARE = 0.025  # ... beyond the line, over which a floor is not followed
RELEASE_CLEAR = 0.015  # ... and once the release is known
EDGE_REACH = 0.4  # of the contact, into which its force is followed from its edge at most
SWAYS_M = 1e-9  # rms of a floor that hides the end of a contact, and shakes the plate
FLOOR_TIMES = 1.4  # white noise: half of the variance is the floor's
MATTERS = 4e-6  # of a velocity: what a quiet laboratory's table does is below it
AGREEMENT_SIGMAS = 3.0  # quasi-static COR and impulse ratio must agree within this


class NoImpact(Exception):
    """Why no collision can be read from a motion, in one line."""


def read_impact(motion: Motion) -> Impact:
    """Read one collision.  Raises NoImpact where the record shows none."""
    return _read(motion, *_between_flights(motion))


def _between_flights(motion: Motion) -> tuple[Span, Edge, Edge | None, Quiet]:
    """Return where the collision is, touch and release, and what the flights beside them are like."""
    span = find_collision(motion)
    if span is None:
        raise NoImpact("no impact: the force never rises above its noise")
    touch, release = _edges(motion, span)
    quiet = _flights(motion, span, touch, release)
    if quiet is not None and quiet.lines:  # edges are read anew without the lines, and the flights up to them
        touch, release = _edges(without_lines(motion, quiet.lines), span)
        quiet = _flights(motion, span, touch, release, quiet)
    if quiet is None:
        raise NoImpact("no free flight before the contact: the record starts too late")
    return span, touch, release, quiet


def _read(motion: Motion, span: Span, touch: Edge, release: Edge | None, quiet: Quiet) -> Impact:
    """Read all numbers between two flights."""
    motion = without_lines(motion, quiet.lines)
    flight_in, flight_out, noise = quiet.incoming, quiet.outgoing, quiet.floor
    v_in = _velocity(flight_in, touch, "before the touch")
    if v_in.value >= 0.0:
        raise NoImpact("the block does not move towards the plate before the contact")
    if release is not None and quiet.floor.rms_m > max(SWAYS_M, quiet.floor.white_std_m):
        release = _swayed(release, span, quiet, v_in.value, motion)
    if flight_out is None or release is None:
        return _unfinished(touch, v_in, "no_release", "the record ends within the contact")
    motion = pulse.with_short_holes_closed(motion, release.time_s - touch.time_s)
    turnaround = pulse.find_turnaround(motion, touch, release)
    if turnaround is None:
        return _unfinished(touch, v_in, "no_turn", "the block does not turn round")
    v_out = _velocity(flight_out, release, "after the release")
    quasi_static = _ratio(v_out, v_in, quiet.velocity_covariance, "|v_out / v_in| of the two free flights")
    drag = (
        motion.moving_mass_kg * flight_in.acceleration_m_per_s2,
        motion.moving_mass_kg * flight_out.acceleration_m_per_s2,
    )
    impulse = pulse.read_impulse_ratio(motion, turnaround, touch, release, drag, noise)
    bounces = find_bounces(motion, touch, release, flight_in, noise)
    flags = _flags(span, quiet, motion)
    if _disturbed(bounces):
        flags.append("bounces_disturbed")
    if not _agree(quasi_static, impulse):
        flags.append("impulse_disagrees")
    impact = Impact(
        touch_time_s=Quantity(touch.time_s, touch.std_s, "where the displacement leaves the incoming flight"),
        release_time_s=Quantity(release.time_s, release.std_s, "where the displacement joins the outgoing flight"),
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
    flags += doubts_of_reading(impact, momentum)
    return replace(impact, flags=tuple(flags), disturbance=_disturbance(quiet, motion, impact))


def shaking_in(motion: Motion) -> Shaking | None:
    """Return what shook the frame as far as a motion shows; None where that is too little to matter, or unread."""
    try:
        found = _between_flights(motion)
        if not _sways(found[-1]):  # whatever else the collision shows
            return None
        disturbance = _read(motion, *found).disturbance
    except (NoImpact, AnalysisError, LinAlgError):
        return None
    return disturbance.shaking if disturbance else None


def _edges(motion: Motion, span: Span) -> tuple[Edge, Edge | None]:
    """Return touch and release, by the force's threshold where the displacement does not show them clearly."""
    reach = round(EDGE_REACH * (span.last - span.first))
    way = motion.displacement_m[min(span.first, span.turn) : span.turn + 1]
    if not np.isfinite(way).any():
        return _coarse(motion, span.first), None
    lasts = max(float(motion.time_s[span.last] - motion.time_s[span.first]), 1.0 / motion.sample_rate_hz)
    depth = float(np.nanmax(way) - np.nanmin(way))
    flight = (span.flight_first, max(span.first - 1, span.flight_first))
    guard = GUARD / motion.bandwidth_hz
    touch = edge_of_flight(
        motion, flight, span.first, until=span.first + reach, depth_m=depth, guard_s=min(guard, 0.1 * lasts)
    )
    touch = touch or _coarse(motion, span.first)
    if not span.finished:
        return touch, None
    flight = (min(span.last + 1, span.flight_last), span.flight_last)
    # the force fades out and is lost in its noise well before the release: the second time its place is known
    release: Edge | None = None
    sample, guard = span.last, max(guard, RELEASE_GUARD * lasts)
    for _ in range(2):
        found = edge_of_flight(motion, flight, sample, until=span.last - reach, depth_m=depth, guard_s=guard)
        if found is None:
            break
        moved = 0.0 if release is None else abs(found.time_s - release.time_s)
        release = Edge(found.time_s, float(np.hypot(found.std_s, moved)))
        guard = max(2.0 * found.std_s, RELEASE_CLEAR * lasts)
        sample = min(int(np.searchsorted(motion.time_s, found.time_s)), flight[1])
    return touch, release or _coarse(motion, span.last)


def _flights(
    motion: Motion, span: Span, touch: Edge, release: Edge | None, before: Quiet | None = None
) -> Quiet | None:
    """Read the flights up to the edges, as far as nothing else happens and no farther than drifts allow."""
    longest = max(round(LONGEST_FLIGHT_S * motion.sample_rate_hz), FEWEST_SAMPLES)
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


def _flags(span: Span, quiet: Quiet, motion: Motion) -> list[str]:
    """Return what the flights say of the place and of the hand."""
    flags = []
    longest = LONGEST_FLIGHT_S * motion.sample_rate_hz
    short_before = span.disturbed_before and span.first - span.flight_first < longest
    if short_before or (span.disturbed_after and span.flight_last - span.last < longest):
        flags.append("flight_cut")
    elif span.disturbed_after:
        flags.append("goes_on")
    if _shakes(quiet):
        flags.append("vibration")
    if quiet.knocks_s or quiet.knocks_kept:
        flags.append("knock")
    return flags


def _shakes(quiet: Quiet) -> bool:
    """Tell whether what shakes the path matters to a velocity: by what was taken off, or by what could not be."""
    for flight, plain in zip((quiet.incoming, quiet.outgoing), quiet.plain, strict=True):
        if flight is None:
            continue
        value, std = flight.velocity(flight.time_zero_s)
        least = MATTERS * abs(value)
        if any(2 * np.pi * line.frequency_hz.value * line.amplitude_m.value > least for line in quiet.lines):
            return True
        if std > max(least, FLOOR_TIMES * plain):
            return True
    return False


def _swayed(release: Edge, span: Span, quiet: Quiet, velocity_in: float, motion: Motion) -> Edge:
    """Return the release with what a floor costs that sways more than the line beside it follows.

    A force that fades out like a half-sine's leaves the flight with the cube of the time, v omega^2 u^3 / 6: it is
    lost as long as that stays below what the floor does beyond the line.
    """
    lasts = max(float(motion.time_s[span.last] - motion.time_s[span.first]), 1.0 / motion.sample_rate_hz)
    omega = np.pi / lasts
    lost = float(np.cbrt(6.0 * quiet.floor.bend_std_m(SWAY_SHARE * lasts) / (abs(velocity_in) * omega**2)))
    return Edge(release.time_s, float(np.hypot(release.std_s, 0.5 * lost)))


def _disturbance(quiet: Quiet, motion: Motion, impact: Impact) -> Disturbance:
    """Return what moved the path, and which part of each number's variance is its doing."""
    return Disturbance(
        lines=quiet.lines,
        floor_rms_m=quiet.floor.rms_m,
        floor_rms_m_per_s=quiet.floor.velocity_rms_m_per_s(motion.bandwidth_hz),
        knocks_s=quiet.knocks_s,
        shares=_shares(quiet, impact),
        shaking=quiet.floor.shaking.with_lines(quiet.lines) if _sways(quiet) else None,
    )


def _sways(quiet: Quiet) -> bool:
    """Return whether the frame moves so far that a fit has to know of it."""
    return bool(quiet.lines) or quiet.floor.rms_m > SWAYS_M


def _shares(quiet: Quiet, impact: Impact) -> Mapping[str, float]:
    shares = {}
    plain = {"velocity_in_m_per_s": quiet.plain[0], "velocity_out_m_per_s": quiet.plain[1]}
    for name, std in plain.items():
        reading = getattr(impact, name)
        if isinstance(reading, Quantity) and reading.std > 0.0:
            shares[name] = float(np.clip(1.0 - (std / reading.std) ** 2, 0.0, 1.0))
    return shares


def _coarse(motion: Motion, sample: int) -> Edge:
    """Fall back on the force's threshold, and say so by its uncertainty: the force filter's own reach."""
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


def _agree(one: Quantity, other: Reading) -> bool:
    if not isinstance(other, Quantity):
        return True
    return abs(one.value - other.value) <= AGREEMENT_SIGMAS * float(np.hypot(one.std, other.std))


def _disturbed(bounces: Bounces) -> bool:
    """Tell bounces from a block that rings: a flight bent, or a second bounce that lasts longer than the first."""
    on = [edge.time_s for edge in bounces.onsets]
    top = [edge.time_s for edge in bounces.peaks]
    return bounces.disturbed or any(len(t) >= 3 and t[2] - t[1] >= t[1] - t[0] for t in (on, top))


def _kinetic(bounces: Bounces) -> KineticCor:
    """Return T2 / T1 three ways (docs/physics.md); a bounce that is not there is said, not guessed."""
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
    if b is c:  # the middle instant moves both intervals, in opposite senses
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
