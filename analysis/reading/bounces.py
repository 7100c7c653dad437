"""Find the first bounces: the early contacts and the short flights between them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebval, chebvander
from numpy.typing import NDArray

from analysis.reading.edges import Edge, edge_of_line, edges_of_short_flight
from analysis.reading.flight import Flight, fit_flight
from analysis.reading.floor_spectrum import FloorSpectrum
from analysis.shot import Floats, Motion
from analysis.signal import MIN_NOISE_M, stretches, white_noise

SUPPORTS = (5, 7, 9, 11, 15, 21)  # possible lengths of a local parabola in samples
FLIGHT_SIGMAS = 4.0  # force over its noise, below which the block counts as free
FLIGHT_FRACTION = 0.03  # force over the first contact's, below which the block counts as free
NOISY = 1.5  # factor on that threshold above which a force within a flight is a contact, however short
EARLY_FRACTION = 0.4  # initial fraction of the whole contact that is searched for bounces
STRAIGHT_SIGMAS = 4.0  # largest rms about a flight's line, in units of the record's white noise
SHORTEST_FLIGHT = 5  # samples
CURVATURE_LAG = 0.5  # spacing, over a flight's duration, of the second difference that estimates the floor's curvature
CURVED_RATIO = 1.4  # std of a flight's end off its line, over the white noise, above which a parabola is fitted
LONG_FLIGHT = 24  # samples, after trimming
LINE_TRIM = 0.12  # fraction of a long flight left out at each end of its line: the contact may begin before it shows
EDGE_REACH_SAMPLES = 40  # most samples of contact, beyond a long flight, used for its edge
EDGE_SAMPLES = 10  # samples of contact on either side of a short flight that are fitted with it
GRAZING_DURATION = 0.35  # duration, over the first contact's, below which a flight may be a contact of little force
GRAZING_STD = 0.04  # the resulting uncertainty of both its ends, over the first contact's duration
# degree of the polynomial through the displacement about a force peak: systematic error of the peak's time in units of
# the rise before it; rms over 120 simulated shots, each with different bodies (the first three bounces)
PEAK_DEGREES = {4: 0.04, 5: 0.016, 6: 0.004, 7: 0.0012, 8: 0.0005}
PEAK_REACH = 1.3  # extent of the polynomial beyond the peak, in units of the rise before it


@dataclass(frozen=True, slots=True)
class Bounces:
    """Onsets and force peaks of the first contacts, and the releases between them; all in s with uncertainties."""

    onsets: tuple[Edge, ...]
    releases: tuple[Edge, ...]
    peaks: tuple[Edge, ...]
    disturbed: bool = False  # a flight is not straight: another force moves the block, and edges are unreliable


def find_bounces(motion: Motion, touch: Edge, release: Edge, flight_in: Flight, floor: FloorSpectrum) -> Bounces:
    """Find the flights inside the early contact, and between them the contacts with their force peaks.

    A flight is a stretch of zero force.  Its edges are then found to a fraction of a sample from the displacement's
    departure from the flight's straight line.
    """
    motion = _straightened(motion, flight_in)
    time = motion.time_s
    end = touch.time_s + EARLY_FRACTION * (release.time_s - touch.time_s)
    inside = np.flatnonzero((time >= touch.time_s) & (time <= end))
    onsets, releases = [touch], list[Edge]()
    quiet = motion.displacement_m[flight_in.first : flight_in.last + 1]
    noise = max(white_noise(np.diff(quiet[np.isfinite(quiet)], 3)), MIN_NOISE_M)
    disturbed = False
    if inside.size >= 2 * SUPPORTS[0] and motion.valid[inside].all():
        force, std = _local_force(motion, inside, noise)
        head = force[: max(4, force.size // 6)]
        free = _free(np.abs(force), max(FLIGHT_SIGMAS * std, FLIGHT_FRACTION * float(head.max())))
        for first, stop in stretches(free):
            last = stop - 1
            if stop - first < SHORTEST_FLIGHT or stop == free.size:
                continue
            if time[inside[first]] - onsets[-1].time_s < 3.0 / motion.sample_rate_hz:
                continue  # the force has not risen yet
            lasts = (last - first) / motion.sample_rate_hz
            bent = float(np.hypot(noise, floor.difference_std_m(CURVATURE_LAG * lasts, 2)))
            level = float(np.hypot(noise, floor.end_std_m(lasts, 1)))
            edges = _flight_edges(motion, int(inside[first]), int(inside[last]), noise, level)
            if edges is not None and _is_flight(edges, releases, onsets, 1.0 / motion.sample_rate_hz):
                disturbed = disturbed or not _is_straight(motion, edges, bent)
                edges = _with_grazing_uncertainty(edges, (releases[0] if releases else edges[0]).time_s - touch.time_s)
                releases.append(edges[0])
                onsets.append(edges[1])
    return Bounces(tuple(onsets), tuple(releases), _peaks(motion, onsets, releases, end, noise), disturbed)


def _free(force: Floats, limit: float) -> NDArray[np.bool_]:
    """Return where an absolute force (n,) is below a limit; short noise excursions within a flight count as below."""
    free = force < limit
    for first, stop in stretches(~free):
        flown = free[max(first - SHORTEST_FLIGHT, 0) : first].sum() + free[stop : stop + SHORTEST_FLIGHT].sum()
        noise = stop - first < SHORTEST_FLIGHT and float(force[first:stop].max()) < NOISY * limit
        if noise and flown == 2 * SHORTEST_FLIGHT:
            free[first:stop] = True
    return free


def _straightened(motion: Motion, flight: Flight) -> Motion:
    """Subtract the incoming flight's own acceleration from the displacement: drag curves short flights as well."""
    bend = 0.5 * flight.acceleration_m_per_s2 * (motion.time_s - flight.time_zero_s) ** 2
    return replace(motion, displacement_m=motion.displacement_m - bend)


def _is_flight(edges: tuple[Edge, Edge], releases: list[Edge], onsets: list[Edge], step_s: float) -> bool:
    """Return whether a stretch is a flight, not a zero crossing of force: long enough, and after the one before."""
    release, onset = edges
    lasts = onset.time_s - release.time_s
    return (
        lasts > SHORTEST_FLIGHT * step_s
        and lasts > 3.0 * float(np.hypot(release.std_s, onset.std_s))
        and release.time_s > onsets[-1].time_s + step_s
        and (not releases or release.time_s > releases[-1].time_s)
    )


def _is_straight(motion: Motion, edges: tuple[Edge, Edge], noise_std_m: float) -> bool:
    step = 1.0 / motion.sample_rate_hz
    inner = (motion.time_s > edges[0].time_s + step) & (motion.time_s < edges[1].time_s - step)
    if inner.sum() < 4:
        return True
    x = motion.displacement_m[inner]
    tau = motion.time_s[inner] - motion.time_s[inner][0]
    residual = x - np.polyval(np.polyfit(tau, x, 1), tau)
    return float(np.sqrt(residual @ residual / (x.size - 2))) < STRAIGHT_SIGMAS * noise_std_m


def _local_force(motion: Motion, index: NDArray[np.intp], noise_std_m: float) -> tuple[Floats, float]:
    """Return the force by a parabola over the fewest samples that keep the noise small, (n,), and its std, both in N.

    Unlike a sharp low-pass, a parabola does not ring, so the force in a flight of a few samples remains zero.
    """
    step = 1.0 / motion.sample_rate_hz
    peak = float(np.nanmax(motion.force_n))
    for support in SUPPORTS:
        half = support // 2
        u = np.arange(-half, half + 1) * step
        weights = 2.0 * np.linalg.pinv(np.vander(u, 3, increasing=True))[2]
        std = motion.moving_mass_kg * noise_std_m * float(np.linalg.norm(weights))
        if std < 0.01 * peak:
            break
    low, high = max(index[0] - half, 0), min(index[-1] + half + 1, motion.time_s.size)
    acceleration = np.convolve(motion.displacement_m[low:high], weights[::-1], mode="same")
    return motion.moving_mass_kg * acceleration[index - low], std


def _flight_edges(motion: Motion, first: int, last: int, noise_m: float, level_m: float) -> tuple[Edge, Edge] | None:
    """Return the release before and the onset after the flight about samples ``first`` to ``last``.

    For a long flight a line is fitted first, then each edge as the departure from that line.  If the floor curves the
    flight, a parabola is fitted jointly with each edge.  A short flight is fitted with both edges and its line or
    parabola at once.  ``level_m`` is the std by noise and floor of a flight's end off its straight line.
    """
    trim = round(LINE_TRIM * (last - first))
    curved = level_m > CURVED_RATIO * noise_m
    if last - first - 2 * trim >= LONG_FLIGHT:
        line = fit_flight(motion, first + trim, last - trim, nearest=(first + last) // 2, curved=curved)
        if line is None:
            return None
        if not curved:
            line = replace(line, noise_std_m=level_m)
        reach = trim + EDGE_REACH_SAMPLES
        release = edge_of_line(motion, line, until=line.first - reach, bend=2 if curved else 0)
        onset = edge_of_line(motion, line, until=line.last + reach, bend=2 if curved else 0)
        return None if release is None or onset is None else (release, onset)
    low, high = max(first - EDGE_SAMPLES, 0), min(last + EDGE_SAMPLES + 1, motion.time_s.size)
    time = motion.time_s[low:high]
    step = 1.0 / motion.sample_rate_hz
    room = max(6, round(0.45 * (last - first))) * step
    release_range = (time[0] + 2 * step, motion.time_s[first] + room)
    onset_range = (motion.time_s[last] - room, time[-1] - 2 * step)
    x = motion.displacement_m[low:high]
    bend, std_m = (2, noise_m) if curved else (1, level_m)
    return edges_of_short_flight(time, x, std_m, release_range, onset_range, bend=bend)


def _with_grazing_uncertainty(edges: tuple[Edge, Edge], first_contact_s: float) -> tuple[Edge, Edge]:
    """Return the edges of a flight, with a larger uncertainty if it may be a contact that never ended.

    The force of a contact grows quadratically about its minimum.  For a sixth of the first contact's duration it stays
    below FLIGHT_FRACTION, as in a flight.
    """
    release, onset = edges
    if onset.time_s - release.time_s > GRAZING_DURATION * first_contact_s:
        return edges
    unsure = GRAZING_STD * first_contact_s
    return release.with_added_uncertainty(unsure), onset.with_added_uncertainty(unsure)


def _peaks(
    motion: Motion, onsets: list[Edge], releases: list[Edge], end_s: float, noise_std_m: float
) -> tuple[Edge, ...]:
    """Return the first force maximum after each of the first three onsets, up to the first that cannot be read."""
    peaks: list[Edge] = []
    for number, onset in enumerate(onsets[:3]):
        until = releases[number].time_s if number < len(releases) else end_s
        index = np.flatnonzero((motion.time_s > onset.time_s) & (motion.time_s < until))
        coarse = _first_maximum(motion, index)
        peak = None if coarse is None else _refined_peak(motion, onset.time_s, coarse, until, noise_std_m)
        if peak is None:
            break
        peaks.append(peak)
    return tuple(peaks)


def _first_maximum(motion: Motion, index: NDArray[np.intp]) -> float | None:
    """Return the time in s of the first maximum of the filtered force that is clearly above the force after it."""
    if index.size < 5:
        return None
    force, std = motion.force_n[index], float(np.nanmedian(motion.force_std_n[index]))
    best = 0
    for k in range(1, force.size):
        if force[k] > force[best]:
            best = k
        elif force[best] - force[k] > max(6.0 * std, 0.02 * force[best]):
            return float(motion.time_s[index[best]]) if best else None
    return None


def _refined_peak(motion: Motion, onset_s: float, coarse_s: float, until_s: float, noise_std_m: float) -> Edge | None:
    """Return the instant of largest acceleration by a polynomial through the displacement about it.

    A steep onset on one side shifts the peak of the low-passed force by tens of microseconds.  The degree in
    PEAK_DEGREES with the least total of noise and systematic error is used.  The noise of a higher degree is taken to
    be at least that of a lower one: in much noise it has spurious steep tops, whose first-order noise is too small.
    """
    rise = coarse_s - onset_s
    step = 1.0 / motion.sample_rate_hz
    window = (motion.time_s >= onset_s + 0.25 * step) & (motion.time_s <= min(coarse_s + PEAK_REACH * rise, until_s))
    u = (motion.time_s[window] - coarse_s) / rise
    best, std = None, 0.0
    for degree, off in PEAK_DEGREES.items():
        if u.size < degree + 3:
            continue
        inverse = np.linalg.pinv(chebvander(u, degree))
        series = inverse @ motion.displacement_m[window]
        grid = np.linspace(max(u[0], -0.8), min(u[-1], 0.8 * PEAK_REACH), 2001)
        force = chebval(grid, chebder(series, 2))
        top = int(force.argmax())
        if top in (0, grid.size - 1):
            continue
        jerk = noise_std_m * float(np.linalg.norm(chebval(grid[top], chebder(inverse, 3))))
        snap = float(chebval(grid[top], chebder(series, 4)))
        std = max(std, jerk / max(abs(snap), 1e-300))
        found = Edge(float(coarse_s + rise * grid[top]), rise * float(np.hypot(std, off)))
        best = found if best is None or found.std_s < best.std_s else best
    return best
