"""From motion to the numbers of one impact; what cannot be read says why."""

import numpy as np

from analysis.impact import Impact, KineticCor
from analysis.motion import Motion
from analysis.noise import Noise, estimate
from analysis.quantity import NotSeen, Quantity, Reading
from analysis.reading import pulse
from analysis.reading.bounces import Bounces, find_bounces
from analysis.reading.edges import Edge, edge_of_flight
from analysis.reading.flights import ContactSpan, Flight, find_contact, fit_flight

RELEASE_GUARD = 0.04  # of the contact, kept clear before the outgoing flight is first fitted
EDGE_REACH = 0.4  # of the contact, into which its force is followed from its edge at most
AGREEMENT_SIGMAS = 3.0  # quasi-static COR and impulse ratio must agree within this


class NoImpact(Exception):
    """Why no collision can be read from a motion, in one line."""


def read_impact(motion: Motion) -> Impact:
    """Read one collision.  Raises NoImpact where the record shows none."""
    span = find_contact(motion)
    if span is None:
        raise NoImpact("no impact: the force never rises above its noise")
    flight_in, touch = _side(motion, span, incoming=True)
    flight_out, release = _side(motion, span, incoming=False)
    if flight_in is None or touch is None:
        raise NoImpact("no free flight before the contact: the record starts too late")
    noise = _learn_noise(motion, flight_in, flight_out)
    flight_in = _weighed(motion, flight_in, flight_in.last + 1, noise)
    v_in = _velocity(flight_in, touch, "before the touch")
    if v_in.value >= 0.0:
        raise NoImpact("the block does not move towards the plate before the contact")
    if flight_out is None or release is None:
        return _unfinished(motion, touch, v_in)
    turnaround = pulse.find_turnaround(motion, touch, release)
    if turnaround is None:
        return _unfinished(motion, touch, v_in, "the block does not turn round")
    flight_out = _weighed(motion, flight_out, flight_out.first - 1, noise)
    v_out = _velocity(flight_out, release, "after the release")
    quasi_static = _ratio(v_out, v_in, "|v_out / v_in| of the two free flights")
    drag = (
        motion.moving_mass_kg * flight_in.acceleration_m_per_s2,
        motion.moving_mass_kg * flight_out.acceleration_m_per_s2,
    )
    impulse = pulse.read_impulse_ratio(motion, turnaround, touch, release, drag)
    bounces = find_bounces(motion, touch, release, flight_in)
    touch_position = float(flight_in.position_m(np.array([touch.time_s]))[0])
    peak = pulse.read_peak(motion, touch, release, noise)
    flags = ["bounces_disturbed"] if _disturbed(bounces) else []
    if not _agree(quasi_static, impulse):
        flags.append("impulse_disagrees")
    return Impact(
        touch_time_s=Quantity(touch.time_s, touch.std_s, "where the displacement leaves the incoming flight"),
        release_time_s=Quantity(release.time_s, release.std_s, "where the displacement joins the outgoing flight"),
        turnaround_time_s=Quantity(turnaround, 1.0 / motion.sample_rate_hz / np.sqrt(12.0), "where v = 0"),
        velocity_in_m_per_s=v_in,
        velocity_out_m_per_s=v_out,
        cor_quasi_static=quasi_static,
        cor_impulse=impulse,
        cor_kinetic=_kinetic(bounces),
        force_peak_n=peak,
        force_fwhm_s=pulse.read_fwhm(motion, touch, release),
        contact_time_s=Quantity(
            release.time_s - touch.time_s, float(np.hypot(touch.std_s, release.std_s)), "first touch to last release"
        ),
        deflection_max_m=pulse.read_deflection(motion, turnaround, touch, abs(v_in.value), touch_position),
        stiffness_slope_n_per_m=pulse.read_slope(motion, touch, release, touch_position),
        bounce_onsets_s=tuple(e.time_s for e in bounces.onsets),
        bounce_peaks_s=tuple(e.time_s for e in bounces.peaks),
        bounce_releases_s=tuple(e.time_s for e in bounces.releases),
        flags=tuple(flags),
    )


def _side(motion: Motion, span: ContactSpan, *, incoming: bool) -> tuple[Flight | None, Edge | None]:
    """Return the flight on one side of the contact and the contact's edge there, refined twice."""
    guard = max(3, round(1.0 / motion.bandwidth_hz * motion.sample_rate_hz))
    if not incoming:  # the force fades out: it drops below its threshold well before the release
        guard += round(RELEASE_GUARD * (span.last - span.first))
    reach = round(EDGE_REACH * (span.last - span.first))
    until = span.first + reach if incoming else span.last - reach
    edge_sample = span.first if incoming else span.last
    edge: Edge | None = None
    flight: Flight | None = None
    for _ in range(2):  # the second time with the edge known, the flight is fitted right up to it
        if incoming:
            flight = fit_flight(motion, 0, edge_sample - guard, nearest=edge_sample)
        else:
            flight = fit_flight(motion, edge_sample + guard, motion.time_s.size - 1, nearest=edge_sample)
        if flight is None:
            return None, None
        edge = edge_of_flight(motion, flight, until=until) or _coarse(motion, edge_sample)
        edge_sample = int(np.searchsorted(motion.time_s, edge.time_s))
        guard = max(3, round(1.0 / motion.bandwidth_hz * motion.sample_rate_hz))
    return flight, edge


def _learn_noise(motion: Motion, flight_in: Flight, flight_out: Flight | None) -> Noise:
    """Return the noise that the flights themselves show."""
    incoming, outgoing = (
        motion.displacement_m[f.first : f.last + 1] if f is not None else np.empty(0) for f in (flight_in, flight_out)
    )
    interval_s = 1.0 / motion.sample_rate_hz
    return estimate(incoming[np.isfinite(incoming)], outgoing[np.isfinite(outgoing)], interval_s)


def _weighed(motion: Motion, flight: Flight, nearest: int, noise: Noise) -> Flight:
    """Return the flight fitted again, weighed by its noise where that is known."""
    if not noise.trusted:
        return flight
    return fit_flight(motion, flight.first, flight.last, nearest=nearest, noise=noise) or flight


def _coarse(motion: Motion, sample: int) -> Edge:
    """Fall back on the force's threshold, and say so by its uncertainty: the force filter's own reach."""
    return Edge(float(motion.time_s[sample]), float(np.hypot(0.25 / motion.bandwidth_hz, 0.5 / motion.sample_rate_hz)))


def _velocity(flight: Flight, edge: Edge, where: str) -> Quantity:
    value, std = flight.velocity(edge.time_s)
    order = "straight line" if flight.coefficients.size == 2 else "parabola"
    samples = flight.last - flight.first + 1
    return Quantity(value, std, f"{order} through {samples} samples of free flight, at the instant just {where}")


def _ratio(out: Quantity, into: Quantity, how: str) -> Quantity:
    value = abs(out.value / into.value)
    return Quantity(value, value * float(np.hypot(out.std / out.value, into.std / into.value)), how)


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


def _unfinished(motion: Motion, touch: Edge, v_in: Quantity, why: str = "the record ends within the contact") -> Impact:
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
        flags=("no_release",),
    )
