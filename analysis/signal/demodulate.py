"""From a recording to its motion: both beats read in one pass, phase to displacement, and what it is worth."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.shot.air import wavelength_in_air_m
from analysis.shot.motion import BeatQuality, Motion
from analysis.shot.quantity import Quantity, Reading
from analysis.shot.recording import Recording, Role
from analysis.shot.shot import AnalysisError, AnalysisSettings, Progress, Stop
from analysis.signal.cross_talk import LEFT as CROSS_TALK
from analysis.signal.cross_talk import LEFT_ABOVE, CrossTalk, find_cross_talk, swapped, taken_off
from analysis.signal.cross_talk import REMOVED as CROSS_TALK_REMOVED
from analysis.signal.filters import FLAT_SHARE, MAX_BANDWIDTH_SHARE, derivative_gains, derivatives, stretches
from analysis.signal.fold import folded_harmonic
from analysis.signal.joining import joined
from analysis.signal.leak import find_leak, leak_phase
from analysis.signal.losses import FLAG as SAMPLES_LOST
from analysis.signal.losses import find_losses, kinks, suspicious
from analysis.signal.plan import plans
from analysis.signal.rest import Rest, smooth
from analysis.signal.stated_rate import FLAG as RATE_CONTRADICTED
from analysis.signal.stated_rate import rate_error
from analysis.signal.survey import survey
from analysis.signal.track import Grid, Track, Wanted, read_tracks
from analysis.signal.wander import wander

Floats = NDArray[np.float64]
HARMONICS_ABOVE = 0.01  # of the beat's amplitude: where one folds onto the beat it bends the phase by as much
_UNSTEADY_SIGMA = 3.0
_WORTH_ANOTHER = 0.8  # of the samples missed so far: a wider band must do this well to be preferred
_CLIPPED = 1e-4  # of the samples at a rail: a beat that is cut off
_REST_REACH = 2000


def demodulate(
    recording: Recording,
    settings: AnalysisSettings,
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Motion:
    """Return the motion of a recording; docs/physics.md, "from beats to force" gives equations and signs.

    Raises AnalysisError, in one line, where the recording holds no motion: no rate, too short, flat, saturated, only
    noise, no rest frequency, a beat that cannot be told from its image; Cancelled when ``cancelled()`` says so.
    """
    _check(recording, settings)
    try:
        wavelength_m = wavelength_in_air_m(recording.setup)
    except ValueError as problem:
        raise AnalysisError(str(problem)) from None
    rate = recording.sample_rate_hz
    column = recording.column(Role.MEASUREMENT)
    assert column is not None
    reference_column = recording.column(Role.REFERENCE)
    bits = recording.setup.digitizer_bits
    seen = survey(recording.counts[:, column], rate, bits, "measurement channel")
    seen_reference = None
    if reference_column is not None:
        seen_reference = survey(recording.counts[:, reference_column], rate, bits, "reference channel")
        moved = swapped(seen, seen_reference)
        if moved is not None:
            raise AnalysisError(
                f"PD0's beat moves by {1e-3 * moved:.0f} kHz and PD1's stands still: their cables are swapped, or the "
                "roles of the channels"
            )
        mixed = find_cross_talk(
            recording.counts[:, reference_column], recording.counts[:, column], seen_reference, seen, rate
        )
        if mixed is not None and not {CROSS_TALK_REMOVED, CROSS_TALK}.intersection(recording.flags):
            return demodulate(_freed(recording, mixed, reference_column, column), settings, progress, cancelled)
    best: tuple[int, Grid, list[Track]] | None = None
    for plan in plans(seen, seen_reference, recording, settings):
        grid = Grid.of(recording, plan.step)
        wanted = [Wanted(plan.tuning, plan.guide, column, seen)]
        if seen_reference is not None and reference_column is not None:
            assert plan.rest_tuning is not None and plan.rest_guide is not None
            wanted.append(Wanted(plan.rest_tuning, plan.rest_guide, reference_column, seen_reference))
        tracks = read_tracks(recording, wanted, grid, progress, cancelled)
        missed = _missed(tracks[0], grid)
        better = best is None or missed < _WORTH_ANOTHER * best[0]
        if better:
            best = (missed, grid, tracks)
        if missed == 0 or not better:  # what a wider band does not mend is not the band's fault
            break
    assert best is not None
    _, grid, tracks = best
    if len(tracks) > 1 and not {SAMPLES_LOST, CROSS_TALK}.intersection(recording.flags):
        # A beat that is cut off has harmonics, which folded on to it jump about as a loss does.
        whole = tracks[0].wanted.survey.clipped_fraction <= _CLIPPED
        kinked = [grid.stored_sample(at, tracks[0].wanted.tuning) for at in kinks(tracks[0])] if whole else []
        told = bool(kinked) or suspicious(tracks[1])
        lost = find_losses(recording, _mean_hz(tracks[1], grid), kinked) if told else ()
        if lost:
            gaps = tuple(sorted((*recording.gaps, *lost), key=lambda gap: gap.sample_start))
            mended = replace(recording, gaps=gaps, flags=(*recording.flags, SAMPLES_LOST))
            return demodulate(mended, settings, progress, cancelled)
    return _motion(recording, settings, wavelength_m, grid, tracks)


def _freed(recording: Recording, found: CrossTalk, reference: int, moving: int) -> Recording:
    """Return a recording whose PD0 is free from PD1's beat, and which says so, and where something is left of it."""
    counts = recording.counts.copy()
    counts[:, reference] = taken_off(counts[:, reference], counts[:, moving], found)
    counts.flags.writeable = False
    flags = (CROSS_TALK_REMOVED, *((CROSS_TALK,) if found.left > LEFT_ABOVE else ()))
    return replace(recording, counts=counts, flags=(*recording.flags, *flags))


def _check(recording: Recording, settings: AnalysisSettings) -> None:
    if not (np.isfinite(recording.sample_rate_hz) and recording.sample_rate_hz > 0):
        raise AnalysisError(f"sample rate of {recording.sample_rate_hz:g} Hz: must be above zero")
    if recording.samples == 0:
        raise AnalysisError("no samples")
    if recording.column(Role.MEASUREMENT) is None:
        raise AnalysisError("no measurement channel (PD1)")
    if recording.column(Role.REFERENCE) is None and not recording.setup.rest_frequency_hz:
        raise AnalysisError("no rest frequency: neither a reference channel (PD0) nor rest_frequency_hz is given")
    if not recording.setup.moving_mass_kg > 0:
        raise AnalysisError(f"moving mass of {recording.setup.moving_mass_kg:g} kg: must be above zero")
    if settings.rest not in ("smoothed", "instantaneous"):
        raise AnalysisError(f"rest {settings.rest!r}: must be 'smoothed' or 'instantaneous'")
    if not 0 < settings.motion_rate_hz <= recording.sample_rate_hz / 4:
        raise AnalysisError(
            f"motion rate of {settings.motion_rate_hz:g} Hz: samples at {recording.sample_rate_hz:g} Hz "
            f"give at most {recording.sample_rate_hz / 4:g} Hz"
        )
    if not 0 < settings.bandwidth_hz <= 0.95 * MAX_BANDWIDTH_SHARE * settings.motion_rate_hz:
        raise AnalysisError(
            f"bandwidth of {settings.bandwidth_hz:g} Hz: a motion rate of {settings.motion_rate_hz:g} Hz carries "
            f"at most {0.95 * MAX_BANDWIDTH_SHARE * settings.motion_rate_hz:g} Hz"
        )


def _missed(track: Track, grid: Grid) -> int:
    """Return how many motion samples show a beat that faded or left the band it was read through."""
    outside = np.count_nonzero(np.abs(track.offset_hz(grid)) > track.wanted.tuning.half_width_hz)
    return int(np.count_nonzero(track.hole) + outside)


def _mean_hz(track: Track, grid: Grid) -> float:
    """Return a beat's usual frequency: jumps of its phase do not count."""
    return float(track.oscillator_hz + np.nanmedian(np.diff(track.phase_cycles)) * grid.rate_hz)


def _motion(
    recording: Recording, settings: AnalysisSettings, wavelength_m: float, grid: Grid, tracks: list[Track]
) -> Motion:
    track = tracks[0]
    known = np.isfinite(track.phase_cycles)
    if known.sum() < 3:
        raise AnalysisError("too short: no stretch without lost samples is long enough for the filters")
    count = int(np.flatnonzero(known)[-1]) + 1
    time_s = grid.time_s(track.wanted.tuning)[:count]
    flags = list(recording.flags)

    moving = track.phase_cycles[:count] + track.oscillator_hz * (time_s - _delay_s(track))
    folded = folded_harmonic(moving, track.amplitude_counts[:count], time_s, recording.sample_rate_hz, grid.rate_hz)
    rest_cycles, rest_std, rest, smoothed = _rest(recording, settings, grid, tracks, time_s, flags)
    if smoothed is not None:
        doppler = np.gradient(rest_cycles - moving) * grid.rate_hz
        column = track.wanted.column
        leak = find_leak(recording, column, smoothed, tracks[1].wanted, track, grid, doppler)
        if leak is not None:
            moving = moving - leak_phase(leak, moving, rest_cycles, track, grid)
            flags.append("leak_removed")
    displacement = -0.5 * wavelength_m * (moving - rest_cycles)
    off = rate_error(recording, rest if len(tracks) > 1 and isinstance(rest, Quantity) else None)
    if off:
        flags.append(RATE_CONTRADICTED)
    std = 0.5 * wavelength_m * np.hypot(track.std_cycles[:count], rest_std)

    hole = track.hole[:count].copy()
    if len(grid.pieces) > 1:
        flags.append("gap")
    if track.doubtful or (len(tracks) > 1 and tracks[1].doubtful):
        flags.append("fringe_doubtful")
    if len(grid.pieces) == 1 and hole.any():
        flags.append("drop_out")
    if track.breaks:
        displacement, doubtful = joined(displacement, track.breaks, 0.5 * wavelength_m)
        if doubtful:
            flags.append("fringe_doubtful")
    valid = np.isfinite(displacement) & ~hole
    displacement -= _start(displacement[valid])
    rate = grid.rate_hz
    velocity, acceleration = derivatives(displacement, rate, settings.bandwidth_hz)
    velocity_gain, acceleration_gain = derivative_gains(np.isfinite(displacement), rate, settings.bandwidth_hz)
    velocity_std, acceleration_std = std * velocity_gain, std * acceleration_gain
    walk = wander(displacement, std, acceleration, acceleration_std, rate)
    if walk > 0.0:
        flags.append("wander")
        walk_gains = derivative_gains(np.isfinite(displacement), rate, settings.bandwidth_hz, walk=True)
        velocity_std = np.hypot(velocity_std, walk * walk_gains[0])
        acceleration_std = np.hypot(acceleration_std, walk * walk_gains[1])
    mass = recording.setup.moving_mass_kg
    for array in (displacement, velocity, acceleration, std, velocity_std, acceleration_std):
        array[~valid] = np.nan
    if max(t.wanted.survey.clipped_fraction for t in tracks) > _CLIPPED:
        flags.append("clipped")
    if max(folded, *(t.wanted.survey.harmonics for t in tracks)) > HARMONICS_ABOVE:
        flags.append("harmonics")
    if np.count_nonzero(np.abs(track.offset_hz(grid)[: count - 1]) > track.wanted.tuning.half_width_hz) > 0:
        flags.append("out_of_band")
    if any(gap.samples_lost is None for gap in recording.bridgeable_gaps):
        flags.append("gap_unknown")
    return Motion(
        time_s=time_s,
        displacement_m=displacement,
        velocity_m_per_s=velocity,
        acceleration_m_per_s2=acceleration,
        force_n=mass * acceleration,
        displacement_std_m=std,
        velocity_std_m_per_s=velocity_std,
        acceleration_std_m_per_s2=acceleration_std,
        force_std_n=mass * acceleration_std,
        valid=valid,
        sample_rate_hz=rate,
        bandwidth_hz=settings.bandwidth_hz,
        displacement_band_hz=FLAT_SHARE * rate,
        moving_mass_kg=mass,
        moving_mass_u_kg=recording.setup.moving_mass_u_kg,
        plate=recording.setup.plate,
        wavelength_m=wavelength_m,
        rest_frequency_hz=rest,
        trigger_time_s=recording.trigger_time_s,
        rate_error=off,
        displacement_wander_m_per_sqrt_s=walk,
        reference=_quality(recording, Role.REFERENCE, tracks[1], grid) if len(tracks) > 1 else None,
        measurement=_quality(recording, Role.MEASUREMENT, track, grid),
        flags=tuple(dict.fromkeys(flags)),
    )


def _start(displacement: Floats) -> float:
    """Return the displacement that is called zero: the first sample's, on a parabola through the first 64."""
    first = displacement[:64]
    if first.size < 8:
        raise AnalysisError("no light: the beat is nowhere strong enough to be read")
    return float(np.polynomial.Polynomial.fit(np.arange(first.size), first, 2)(0.0))


def _rest(
    recording: Recording, settings: AnalysisSettings, grid: Grid, tracks: list[Track], time_s: Floats, flags: list[str]
) -> tuple[Floats, Floats | float, Reading, Rest | None]:
    """Return (rest phase in cycles at ``time_s``, its standard deviation, the rest frequency, the smooth fit)."""
    if len(tracks) == 1:
        given = recording.setup.rest_frequency_hz
        assert given is not None
        return given * time_s, 0.0, Quantity(given, 0.0, "given"), None
    track = tracks[1]
    own_time = grid.time_s(track.wanted.tuning)
    std = float(np.nanmedian(track.std_cycles))
    phase, doubtful = joined(track.phase_cycles, track.breaks, 1.0, degree=1, reach=_REST_REACH)
    if doubtful:
        flags.append("fringe_doubtful")
    rest: Rest = smooth(own_time, np.where(track.hole, np.nan, phase), std, track.oscillator_hz)
    if rest.degree > 1:
        flags.append("rest_drift")
    if rest.unsteady_cycles > _UNSTEADY_SIGMA * std:
        flags.append("rest_unsteady")
    delayed = track.oscillator_hz * (time_s - _delay_s(track))
    if settings.rest == "instantaneous":
        own = phase[: time_s.size]  # read through the same window as the moving beat, so at the same times
        own = np.where(np.isfinite(own), own, rest.phase_at(time_s))
        return own + delayed, track.std_cycles[: time_s.size], rest.frequency_hz, rest
    return rest.phase_at(time_s) + delayed, 0.0, rest.frequency_hz, rest


def _delay_s(track: Track) -> float:
    """Return the time from a window's first sample, where its oscillator is counted, to its centre, in s."""
    tuning = track.wanted.tuning
    return tuning.delay_samples / tuning.sample_rate_hz


def _quality(recording: Recording, role: Role, track: Track, grid: Grid) -> BeatQuality:
    column = recording.column(role)
    assert column is not None
    known = stretches(np.isfinite(track.phase_cycles))
    start, stop = max(known, key=lambda piece: piece[1] - piece[0])
    quiet = slice(start, min(stop, start + max(16, (stop - start) // 32)))
    slope = np.polyfit(np.arange(quiet.stop - quiet.start), track.phase_cycles[quiet], 1)[0]
    return BeatQuality(
        frequency_hz=float(track.oscillator_hz + slope * grid.rate_hz),
        amplitude_v=track.wanted.survey.amplitude_counts * abs(recording.channels[column].volts_per_count),
        snr_db=track.wanted.survey.snr_db,
        clipped_fraction=track.wanted.survey.clipped_fraction,
    )
