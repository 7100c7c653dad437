"""Read the whole force pulse: peak, width without the bounces' spikes, impulses, slope, deflection."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from analysis.reading.edges import Edge
from analysis.reading.flight import Flight
from analysis.reading.floor_spectrum import FloorSpectrum
from analysis.shot import Floats, Motion, NotSeen, Quantity, Reading
from analysis.signal import derivative_filters, stretches

SMOOTH_HZ = (100.0, 250.0, 500.0)  # docs/physics.md: the smooth pulse is the force low-passed at 100-500 Hz
SLOPE_SPAN = (0.209, 0.975)  # fractions of the contact: 6 to 28 ms of 28.7, clear of bounces and release
FREQUENCIES = 8192  # length of the transform for a noise variance
SWAY_S = 1e-4  # spacing of the samples that represent the floor's motion
_TRAPEZOID = 1e-5  # relative error of an impulse computed as a sum over samples
NEAR_S = 0.3e-3  # flight before the touch from which the position at the touch is read
HOLE_SHARE = 0.02  # longest hole that is closed, as a fraction of the contact
FORGOTTEN = 4.0  # periods of its cutoff after which the end of a record no longer affects a low-pass
TURN_SHARE = 0.05  # fraction of the contact's samples to each side of the turn in a linear fit of velocity
TURN_SAMPLES = 9  # most samples to each side in that fit
TOP_FRACTION = 0.04  # fraction of the contact time to each side of the top in a parabolic fit


def with_short_holes_closed(motion: Motion, contact_s: float) -> Motion:
    """Return the motion with its force interpolated over holes of at most HOLE_SHARE of the contact.

    The force in a hole is unknown, but its impulse is m times the change of velocity.  The force is interpolated
    linearly across the hole, plus a constant that gives this impulse.
    """
    known = np.isfinite(motion.force_n) & np.isfinite(motion.velocity_m_per_s)
    if known.all() or not known.any():
        return motion
    force, step = motion.force_n.copy(), 1.0 / motion.sample_rate_hz
    for start, after in stretches(~known):
        before, missing = start - 1, after - start
        if start == 0 or after == known.size or missing * step > max(HOLE_SHARE * contact_s, 2.5 * step):
            continue
        inside = np.arange(start, after)
        line = np.interp(inside, [before, after], [force[before], force[after]])
        impulse = motion.moving_mass_kg * (motion.velocity_m_per_s[after] - motion.velocity_m_per_s[before])
        straight = 0.5 * (force[before] + force[after]) * (after - before) * step
        force[inside] = line + (impulse - straight) / (missing * step)
    return replace(motion, force_n=force)


def smooth_force(motion: Motion, cutoff_hz: float) -> Floats | None:
    """Return the force in N, low-passed without delay, (n,); None if holes, cutoff or record length prevent it.

    The gain is that of a second-order Butterworth filter applied forwards and backwards, 1 / (1 + (f / cutoff)^4).
    """
    seen = np.isfinite(motion.force_n)
    first, last = (int(i) for i in np.flatnonzero(seen)[[0, -1]])
    if not seen[first : last + 1].all() or cutoff_hz >= 0.45 * motion.sample_rate_hz or last - first < 64:
        return None
    out = np.full(motion.force_n.shape, np.nan)
    inside = motion.force_n[first : last + 1]
    pad = min(last - first, round(FORGOTTEN * motion.sample_rate_hz / cutoff_hz))
    # pad to a length with small factors: a transform of a large prime length is slow
    more = min(last - first - pad, next_fast_len(inside.size + 2 * pad, real=True) - inside.size - 2 * pad)
    # odd reflection about the ends, instead of periodic continuation
    longer = np.pad(inside, (pad, pad + more), mode="reflect", reflect_type="odd")
    frequency_hz = np.fft.rfftfreq(longer.size, 1.0 / motion.sample_rate_hz)
    passed = irfft(rfft(longer) / (1.0 + (frequency_hz / cutoff_hz) ** 4), longer.size)
    out[first : last + 1] = passed[pad : pad + inside.size]
    return out


def read_peak(motion: Motion, touch: Edge, release: Edge, noise: FloorSpectrum) -> Reading:
    """Return the peak force in N: the top of the pulse, past the bounces, by a local parabola."""
    span = release.time_s - touch.time_s
    index = np.flatnonzero(
        (motion.time_s > touch.time_s + SLOPE_SPAN[0] * span) & (motion.time_s < touch.time_s + SLOPE_SPAN[1] * span)
    )
    if index.size < 5 or not np.isfinite(motion.force_n[index]).all():
        return NotSeen("the contact is too short or interrupted")
    width = max(1, round(0.02 * span * motion.sample_rate_hz))
    rough = np.convolve(motion.force_n[index], np.ones(width) / width, mode="same")
    middle = motion.time_s[index[int(rough.argmax())]]
    around = index[np.abs(motion.time_s[index] - middle) <= max(TOP_FRACTION * span, 2.0 / motion.sample_rate_hz)]
    tau = motion.time_s[around] - middle
    inverse = np.linalg.pinv(np.vander(tau, 3, increasing=True))
    top, slope, curve = inverse @ motion.force_n[around]
    if curve >= 0.0:
        return NotSeen("the force has no single top")
    vertex = float(np.clip(-slope / (2 * curve), tau[0], tau[-1]))
    value = float(top + slope * vertex + curve * vertex**2)
    weights = np.array([1.0, vertex, vertex**2]) @ inverse
    how = f"parabola over ±{tau[-1] * 1e3:.1f} ms about {(middle + vertex) * 1e3:.2f} ms, {motion.bandwidth_hz:g} Hz"
    return Quantity(value, _with_mass(motion, value, _force_std(motion, weights, noise)), how)


def _force_std(motion: Motion, weights: Floats, noise: FloorSpectrum) -> float:
    """Return the std in N of a weighted sum of neighbouring forces, which share the force's filter.

    The force's noise rises with f^2 in amplitude, so smooth weights reduce it far more than that of independent
    samples.
    """
    taps = derivative_filters(motion.sample_rate_hz, motion.bandwidth_hz).acceleration
    response = np.fft.rfft(np.convolve(weights, taps), FREQUENCIES)
    frequency_hz = np.asarray(np.fft.rfftfreq(FREQUENCIES, 1.0 / motion.sample_rate_hz), dtype=np.float64)
    density = noise.psd(frequency_hz) * np.abs(response) ** 2
    return motion.moving_mass_kg * float(np.sqrt(np.trapezoid(density, frequency_hz)))


def read_fwhm(motion: Motion, touch: Edge, release: Edge, noise: FloorSpectrum) -> Reading:
    """Return the full width at half maximum in s of the smooth pulse; its std includes the choice of cut-off."""
    widths = [w for w in (_width(motion, touch, release, cutoff, noise) for cutoff in SMOOTH_HZ) if w is not None]
    if not widths:
        return NotSeen("the record leaves no room to smooth the pulse")
    chosen = widths[len(widths) // 2]
    choice = (max(w[0] for w in widths) - min(w[0] for w in widths)) / np.sqrt(12.0)
    how = f"force low-passed at {chosen[2]:g} Hz; uncertainty covers cut-offs of {SMOOTH_HZ[0]:g}-{SMOOTH_HZ[-1]:g} Hz"
    return Quantity(chosen[0], float(np.hypot(chosen[1], choice)), how)


def _width(
    motion: Motion, touch: Edge, release: Edge, cutoff_hz: float, noise: FloorSpectrum
) -> tuple[float, float, float] | None:
    force = smooth_force(motion, cutoff_hz)
    if force is None:
        return None
    pad = 0.5 * (release.time_s - touch.time_s)
    near = (motion.time_s >= touch.time_s - pad) & (motion.time_s <= release.time_s + pad)
    inside = np.flatnonzero(near & np.isfinite(force))
    force = force[inside]
    time = motion.time_s[inside]
    if inside.size < 16 or time[0] > touch.time_s or time[-1] < release.time_s:
        return None
    top = int(force.argmax())
    half = force[top] / 2.0
    below_left = np.flatnonzero(force[:top] < half)
    below_right = np.flatnonzero(force[top:] < half)
    if below_left.size == 0 or below_right.size == 0:
        return None
    left, right = int(below_left[-1]), top + int(below_right[0])
    up, down = force[left + 1] - force[left], force[right] - force[right - 1]
    begin = time[left] + (half - force[left]) / up / motion.sample_rate_hz
    finish = time[right - 1] + (half - force[right - 1]) / down / motion.sample_rate_hz
    f = np.geomspace(0.5, motion.bandwidth_hz, 400)
    density = noise.psd(f) * (2 * np.pi * f) ** 4 / (1.0 + (f / cutoff_hz) ** 4) ** 2  # Butterworth, both ways
    std = motion.moving_mass_kg * float(np.sqrt(np.trapezoid(density, f)))
    # the noise of both crossings, and that of the maximum, which shifts the half level of both
    per_n = np.array([1.0 / up, 1.0 / down, 0.5 / up - 0.5 / down]) / motion.sample_rate_hz
    return float(finish - begin), std * float(np.linalg.norm(per_n)), cutoff_hz


def read_impulse_ratio(
    motion: Motion, turnaround_s: float, touch: Edge, release: Edge, drag_n: tuple[float, float], noise: FloorSpectrum
) -> Reading:
    """Return the impulse of unloading over that of loading, split where v = 0 (docs/physics.md).

    The integrals extend beyond the contact by the force filter's ringing.  The impulses of the free flights' own forces
    ``drag_n`` (before, after) during this extension are subtracted.
    """
    margin = 6.0 / motion.bandwidth_hz  # duration of the filter's ringing beyond the edges
    begin, finish = touch.time_s - margin, release.time_s + margin
    if begin < motion.time_s[0] or finish > motion.time_s[-1]:
        return NotSeen("the record ends too close to the contact")
    # the linear fit at the turn leaves a small velocity there, which one Newton step removes
    speed, force = (np.interp(turnaround_s, motion.time_s, of) for of in (motion.velocity_m_per_s, motion.force_n))
    split = float(turnaround_s - motion.moving_mass_kg * speed / force)
    loading = _integral(motion.time_s, motion.force_n, begin, split) - drag_n[0] * margin
    unloading = _integral(motion.time_s, motion.force_n, split, finish) - drag_n[1] * margin
    if not (np.isfinite(loading) and np.isfinite(unloading)) or loading <= 0.0:
        return NotSeen("the force is interrupted within the contact")
    # an integral of the force is a difference of velocities, and the measured velocity at the split is zero
    ratio = unloading / loading
    white = _white_velocity_std(motion, noise) * float(np.linalg.norm([ratio, 1.0]))
    sways = noise.velocity_std_m_per_s((begin, finish), (ratio, 1.0), motion.bandwidth_hz)
    std = motion.moving_mass_kg / loading * float(np.hypot(white, sways))
    return Quantity(ratio, std, "∫F over unloading / ∫F over loading, split where v = 0")


def _white_velocity_std(motion: Motion, noise: FloorSpectrum) -> float:
    """Return the std in m/s of a velocity by white noise alone; the motion's stated std includes path wander."""
    return noise.white_std_m * derivative_filters(motion.sample_rate_hz, motion.bandwidth_hz).velocity_gain


def read_momentum(
    motion: Motion,
    touch: Edge,
    release: Edge,
    drag_n: tuple[float, float],
    velocities: tuple[Quantity, Quantity],
    noise: FloorSpectrum,
) -> tuple[Quantity, Quantity] | None:
    """Return the impulse of the whole pulse and m (v_out - v_in), in N s; None if the force is interrupted."""
    margin = 6.0 / motion.bandwidth_hz
    begin, finish = touch.time_s - margin, release.time_s + margin
    if begin < motion.time_s[0] or finish > motion.time_s[-1]:
        return None
    mass = motion.moving_mass_kg
    impulse = _integral(motion.time_s, motion.force_n, begin, finish) - margin * (drag_n[0] + drag_n[1])
    if not np.isfinite(impulse):
        return None
    white = float(np.sqrt(2.0)) * _white_velocity_std(motion, noise)
    sways = noise.velocity_std_m_per_s((begin, finish), (-1.0, 1.0), motion.bandwidth_hz)
    grid = _TRAPEZOID * abs(impulse)
    into, out = velocities
    change = Quantity(mass * (out.value - into.value), mass * float(np.hypot(into.std, out.std)))
    return Quantity(impulse, float(np.hypot(mass * np.hypot(white, sways), grid))), change


def read_slope(motion: Motion, touch: Edge, release: Edge, flight: Flight, noise: FloorSpectrum) -> Reading:
    """Return dF/dy in N/m over the smooth part of the contact (Fig. 6, Eq. 11).

    It is less than k_p because of the plate's inertia and the contact spring in series.  The end of the contact is
    uncertain if the floor moves; the slope's change by an earlier end is part of its uncertainty.
    """
    slope = _slope(motion, touch, release, flight, noise)
    earlier = _slope(motion, touch, Edge(release.time_s - release.std_s, 0.0), flight, noise)
    if not isinstance(slope, Quantity) or not isinstance(earlier, Quantity):
        return slope
    return replace(slope, std=float(np.hypot(slope.std, slope.value - earlier.value)))


def _slope(motion: Motion, touch: Edge, release: Edge, flight: Flight, noise: FloorSpectrum) -> Reading:
    span = release.time_s - touch.time_s
    low, high = (touch.time_s + f * span for f in SLOPE_SPAN)
    seen = motion.valid & np.isfinite(motion.force_n)
    index = np.flatnonzero((motion.time_s >= low) & (motion.time_s <= high) & seen)
    if index.size < 8:
        return NotSeen("too few samples inside the contact")
    deflection = flight.position_m(np.array([touch.time_s]))[0] - motion.displacement_m[index]
    force = motion.force_n[index]
    centred = deflection - deflection.mean()
    if np.ptp(motion.displacement_m[index]) == 0.0:
        return NotSeen("the deflection is the same all through the contact")
    slope = float(centred @ force / (centred @ centred))
    residual = force - force.mean() - slope * centred
    std = _slope_white(motion, index, (centred, residual), slope, noise)
    std = float(np.hypot(std, _slope_sway(motion, motion.time_s[index], centred, slope, noise)))
    how = f"least squares of F on deflection, {(low - touch.time_s) * 1e3:.1f} to {(high - touch.time_s) * 1e3:.1f} ms"
    return Quantity(slope, _with_mass(motion, slope, std), how + " after touch")


def _slope_white(
    motion: Motion, index: NDArray[np.intp], fitted: tuple[Floats, Floats], slope: float, noise: FloorSpectrum
) -> float:
    """Return the std in N/m of the slope from the displacement's white noise, which enters force and deflection.

    To first order a displacement error s changes the slope by (m c s'' + (slope c - r) s) / (c c), with the centred
    deflection c and the residual r of the force (``fitted``, at the samples ``index``).  The residual itself is not
    noise: it contains ripples of plate and contact.
    """
    centred, residual = (np.bincount(index - index[0], values) for values in fitted)
    taps = derivative_filters(motion.sample_rate_hz, motion.bandwidth_hz).acceleration
    size = centred.size + taps.size - 1
    whole = next_fast_len(size, real=True)
    felt = motion.moving_mass_kg * irfft(rfft(centred, whole) * rfft(taps, whole), whole)[:size]
    reach = taps.size // 2
    felt[reach : reach + centred.size] += slope * centred - residual
    return noise.white_std_m * float(np.linalg.norm(felt)) / float(centred @ centred)


def _slope_sway(motion: Motion, time_s: Floats, centred_m: Floats, slope: float, noise: FloorSpectrum) -> float:
    """Return the std in N/m of the slope by motion s of the floor or of the optical path.

    If the floor moves, F lacks m s'', and the plate's deflection is measured correctly.  If the path moves, s is in the
    deflection as well.  The flights do not distinguish the two, so the larger error is used at every frequency.
    """
    every = max(1, round(SWAY_S * motion.sample_rate_hz))
    time, weight = time_s[::every] - time_s[0], centred_m[::every] / float(centred_m[::every] @ centred_m[::every])
    f = np.geomspace(0.5, 0.25 / SWAY_S, 120)
    seen = np.abs(np.exp(-2j * np.pi * f[:, None] * time) @ weight) ** 2
    sways = noise.psd(f) - 2.0 * noise.white_std_m**2 / noise.sample_rate_hz
    of_floor = motion.moving_mass_kg * (2 * np.pi * f) ** 2
    density = sways * seen * np.maximum(of_floor, np.abs(slope - of_floor)) ** 2
    return float(np.sqrt(np.trapezoid(density, f)))


def read_deflection(motion: Motion, turnaround_s: float, touch: Edge, velocity: float, noise: FloorSpectrum) -> Reading:
    """Return the largest distance in m that the block goes beyond its first touch.

    The block's position at the touch is read from the end of the flight, not from the whole flight's line.  Floor
    motion then shifts that position and the turning point alike, so only its motion between the two is an error.
    """
    near = (motion.time_s < touch.time_s) & (motion.time_s > touch.time_s - NEAR_S - 4.0 / motion.sample_rate_hz)
    near &= motion.valid
    if near.sum() < 2:
        return NotSeen("the moment before the touch is missing from the record")
    touch_position = float(np.mean(motion.displacement_m[near] - velocity * (motion.time_s[near] - touch.time_s)))
    index = np.flatnonzero(np.abs(motion.time_s - turnaround_s) <= max(2e-4, 2.5 / motion.sample_rate_hz))
    index = index[motion.valid[index]]
    if index.size < 4:
        return NotSeen("the turning point is missing from the record")
    tau = motion.time_s[index] - turnaround_s
    (bottom, slope, curve), *_ = np.linalg.lstsq(
        np.vander(tau, 3, increasing=True), motion.displacement_m[index], rcond=None
    )
    lowest = bottom - slope**2 / (4 * curve) if curve > 0 else bottom
    sway = noise.difference_std_m(turnaround_s - touch.time_s)
    std = float(np.hypot(touch.std_s * abs(velocity), np.hypot(noise.white_std_m, sway)))
    return Quantity(float(touch_position - lowest), std, "from the first touch to the turning point")


def find_turnaround(motion: Motion, touch: Edge, release: Edge) -> float | None:
    """Return the time in s at which the velocity passes through zero between touch and release, or None."""
    inside = np.flatnonzero((motion.time_s > touch.time_s) & (motion.time_s < release.time_s))
    velocity = motion.velocity_m_per_s[inside]
    crossing = np.flatnonzero((velocity[:-1] < 0.0) & (velocity[1:] >= 0.0))
    if crossing.size == 0:
        return None
    few = min(max(round(TURN_SHARE * inside.size), 1), TURN_SAMPLES)
    near = inside[max(crossing[0] + 1 - few, 0) : crossing[0] + 1 + few]  # a linear fit over these reduces the noise
    slope, offset = np.polyfit(motion.time_s[near] - motion.time_s[near[0]], motion.velocity_m_per_s[near], 1)
    return float(motion.time_s[near[0]] - offset / slope)


def _with_mass(motion: Motion, value: float, std: float) -> float:
    """Return the standard uncertainty including that of the moving mass, which scales every force."""
    return float(np.hypot(std, value * motion.moving_mass_u_kg / motion.moving_mass_kg))


def _integral(time_s: Floats, values: Floats, begin: float, finish: float) -> float:
    """Trapezoidal integral between two instants that need not be samples."""
    inside = (time_s > begin) & (time_s < finish)
    grid = np.concatenate([[begin], time_s[inside], [finish]])
    return float(np.trapezoid(np.interp(grid, time_s, values), grid))
