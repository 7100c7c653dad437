"""Demodulate a recording: the phases of both beats, and from them displacement, velocity and force with their noise."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.shot import (
    RATE_CONTRADICTED,
    AnalysisError,
    AnalysisSettings,
    BeatQuality,
    ChannelsSwapped,
    Floats,
    Motion,
    Progress,
    Quantity,
    Recording,
    Role,
    Stop,
    rate_error,
    wavelength_in_air_m,
)
from analysis.signal.bridge import join_stretches
from analysis.signal.cross_talk import CROSS_TALK_LEFT as CROSS_TALK
from analysis.signal.cross_talk import (
    CROSS_TALK_REMOVED,
    LEFT_ABOVE,
    find_cross_talk,
    swapped_cables_span_hz,
    without_cross_talk,
)
from analysis.signal.demodulation_plan import demodulation_plans
from analysis.signal.filters import FLAT_SHARE, MAX_BANDWIDTH_SHARE, derivative_gains, derivatives, stretches
from analysis.signal.losses import SAMPLES_LOST, find_losses, has_phase_jumps, phase_jump_samples
from analysis.signal.noise import random_walk_growth
from analysis.signal.phase_errors import find_leak, folded_harmonic, leak_phase
from analysis.signal.rest import RestPhase, fit_rest_phase
from analysis.signal.survey import Survey, survey
from analysis.signal.track import Grid, Track, read_tracks

HARMONICS_ABOVE = 0.01  # relative to the beat; a harmonic folded onto the beat disturbs the phase by as much (rad)
_UNSTEADY_SIGMA = 3.0
_RETRY_RATIO = 0.8  # a wider band is preferred only if it misses less than this share of the samples missed so far
_CLIPPED = 1e-4  # share of the samples at a rail above which a beat counts as clipped
_REST_JOIN_SAMPLES = 2000


def demodulate(
    recording: Recording,
    settings: AnalysisSettings,
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Motion:
    """Return the motion of a recording; docs/physics.md, "from beats to force", gives equations and signs.

    Raises AnalysisError, in one line, if the recording yields no motion: no rate, too short, flat, saturated, only
    noise, no rest frequency, a beat too near its image.  Raises Cancelled when ``cancelled()`` returns True.
    """
    _check(recording, settings)
    try:
        wavelength_m = wavelength_in_air_m(recording.setup)
    except ValueError as problem:
        raise AnalysisError(str(problem)) from None
    surveys = _surveys(recording)
    cleaned = _with_cross_talk_removed(recording, *surveys)
    if cleaned is not None:
        return demodulate(cleaned, settings, progress, cancelled)
    grid, tracks = _read_beats(recording, settings, *surveys, progress, cancelled)
    mended = _with_losses(recording, grid, tracks)
    if mended is not None:
        return demodulate(mended, settings, progress, cancelled)
    return _motion(recording, settings, wavelength_m, grid, tracks)


def _surveys(recording: Recording) -> tuple[Survey, Survey | None]:
    """Return the surveys of PD1 and of PD0 (None without PD0).  Raises ChannelsSwapped."""
    rate, bits = recording.sample_rate_hz, recording.setup.digitizer_bits
    moving = survey(recording.counts_of(Role.MEASUREMENT), rate, bits, "measurement channel")
    if recording.column(Role.REFERENCE) is None:
        return moving, None
    rest = survey(recording.counts_of(Role.REFERENCE), rate, bits, "reference channel")
    moved = swapped_cables_span_hz(moving, rest)
    if moved is not None:
        raise ChannelsSwapped(
            f"PD0's beat moves by {1e-3 * moved:.0f} kHz and PD1's stands still: their cables are swapped, or the "
            "roles of the channels"
        )
    return moving, rest


def _with_cross_talk_removed(recording: Recording, moving: Survey, rest: Survey | None) -> Recording | None:
    """Return the recording with PD1's cross-talk removed from PD0, and flagged; None if there is too little of it."""
    if rest is None or {CROSS_TALK_REMOVED, CROSS_TALK}.intersection(recording.flags):
        return None
    pd0, pd1 = recording.counts_of(Role.REFERENCE), recording.counts_of(Role.MEASUREMENT)
    found = find_cross_talk(pd0, pd1, rest, moving, recording.sample_rate_hz)
    if found is None:
        return None
    counts = recording.counts.copy()
    counts[:, recording.column(Role.REFERENCE)] = without_cross_talk(pd0, pd1, found)
    counts.flags.writeable = False
    flags = (CROSS_TALK_REMOVED, *((CROSS_TALK,) if found.left > LEFT_ABOVE else ()))
    return replace(recording, counts=counts, flags=(*recording.flags, *flags))


def _read_beats(
    recording: Recording,
    settings: AnalysisSettings,
    moving: Survey,
    rest: Survey | None,
    progress: Progress | None,
    cancelled: Stop | None,
) -> tuple[Grid, list[Track]]:
    """Read the beats with the first plan that misses no sample of the moving beat, or else that which misses fewest."""
    best: tuple[int, Grid, list[Track]] | None = None
    for step, beats in demodulation_plans(moving, rest, recording, settings):
        grid = Grid.of(recording, step)
        tracks = read_tracks(recording, beats, grid, progress, cancelled)
        missed = _missed(tracks[0], grid)
        if best is not None and missed >= _RETRY_RATIO * best[0]:
            break  # if a wider band does not help, the band is not the cause
        best = (missed, grid, tracks)
        if missed == 0:
            break
    assert best is not None
    return best[1:]


def _with_losses(recording: Recording, grid: Grid, tracks: list[Track]) -> Recording | None:
    """Return the recording with unreported sample losses, found from both beats, added to its gaps; None if none."""
    if len(tracks) < 2 or {SAMPLES_LOST, CROSS_TALK}.intersection(recording.flags):
        return None
    # A clipped beat has harmonics; one that folds onto the beat makes its phase jump as a loss would.
    whole = tracks[0].spec.survey.clipped_fraction <= _CLIPPED
    pd1_jumps = [grid.stored_sample(at, tracks[0].spec.tuning) for at in phase_jump_samples(tracks[0])] if whole else []
    if not pd1_jumps and not has_phase_jumps(tracks[1]):
        return None
    lost = find_losses(recording, _mean_hz(tracks[1], grid), pd1_jumps)
    if not lost:
        return None
    gaps = tuple(sorted((*recording.gaps, *lost), key=lambda gap: gap.sample_start))
    return replace(recording, gaps=gaps, flags=(*recording.flags, SAMPLES_LOST))


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
    """Return the number of motion samples at which the beat faded or left its band-pass."""
    return int(np.count_nonzero(track.hole) + _outside_band(track, grid, track.phase_cycles.size - 1))


def _outside_band(track: Track, grid: Grid, steps: int) -> int:
    """Return the number of motion steps, among the first ``steps``, at which the beat lay outside its band-pass."""
    return int(np.count_nonzero(np.abs(track.offset_hz(grid)[:steps]) > track.spec.tuning.half_width_hz))


def _mean_hz(track: Track, grid: Grid) -> float:
    """Return a beat's frequency from its median phase step, which jumps do not affect."""
    return float(track.oscillator_hz + np.nanmedian(np.diff(track.phase_cycles)) * grid.rate_hz)


def _motion(
    recording: Recording, settings: AnalysisSettings, wavelength_m: float, grid: Grid, tracks: list[Track]
) -> Motion:
    track, rate = tracks[0], grid.rate_hz
    count = _known_samples(track)
    time_s = grid.time_s(track.spec.tuning)[:count]
    moving = track.phase_cycles[:count] + track.oscillator_hz * (time_s - _delay_s(track))
    folded = folded_harmonic(moving, track.amplitude_counts[:count], time_s, recording.sample_rate_hz, rate)
    flags = list(recording.flags)
    rest = _rest(recording, settings, grid, tracks, time_s, flags)
    moving = _without_leak(recording, moving, rest, grid, tracks, flags)
    displacement = -0.5 * wavelength_m * (moving - rest.cycles)
    contradicted = rate_error(recording, rest.frequency_hz if rest.smooth is not None else None)
    if contradicted:
        flags.append(RATE_CONTRADICTED)
    std = np.asarray(0.5 * wavelength_m * np.hypot(track.std_cycles[:count], rest.std_cycles))
    hole = track.hole[:count]
    flags += _gap_flags(grid, tracks, hole)
    displacement, doubtful = join_stretches(displacement, track.breaks, 0.5 * wavelength_m)
    if doubtful:
        flags.append("fringe_doubtful")
    valid = np.isfinite(displacement) & ~hole
    displacement -= _start(displacement[valid])
    velocity, acceleration, velocity_std, acceleration_std, walk = _derived(
        displacement, std, rate, settings.bandwidth_hz
    )
    if walk > 0.0:
        flags.append("wander")
    mass = recording.setup.moving_mass_kg
    for array in (displacement, velocity, acceleration, std, velocity_std, acceleration_std):
        array[~valid] = np.nan
    flags += _beat_flags(recording, grid, tracks, folded, count)
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
        rest_frequency_hz=rest.frequency_hz,
        trigger_time_s=recording.trigger_time_s,
        rate_error=contradicted,
        reference=_quality(recording, tracks[1], grid) if len(tracks) > 1 else None,
        measurement=_quality(recording, track, grid),
        flags=tuple(dict.fromkeys(flags)),
    )


def _known_samples(track: Track) -> int:
    """Return the number of motion samples up to the last known phase.  Raises AnalysisError."""
    known = np.flatnonzero(np.isfinite(track.phase_cycles))
    if known.size < 3:
        raise AnalysisError("too short: no stretch without lost samples is long enough for the filters")
    return int(known[-1]) + 1


def _without_leak(
    recording: Recording, moving: Floats, rest: "_RestBeat", grid: Grid, tracks: list[Track], flags: list[str]
) -> Floats:
    """Return the moving beat's phase in cycles, corrected for a polarisation leak, which is flagged."""
    if rest.smooth is None:
        return moving
    track = tracks[0]
    doppler = np.gradient(rest.cycles - moving) * grid.rate_hz
    leak = find_leak(recording, rest.smooth, tracks[1].spec, track, grid, doppler)
    if leak is None:
        return moving
    flags.append("leak_removed")
    return np.asarray(moving - leak_phase(leak, moving, rest.cycles, track, grid))


def _derived(
    displacement: Floats, std: Floats, rate_hz: float, bandwidth_hz: float
) -> tuple[Floats, Floats, Floats, Floats, float]:
    """Return velocity, acceleration, their stds, and the growth of the path's random walk in m/s^0.5."""
    velocity, acceleration = derivatives(displacement, rate_hz, bandwidth_hz)
    finite = np.isfinite(displacement)
    gains = derivative_gains(finite, rate_hz, bandwidth_hz)
    velocity_std, acceleration_std = std * gains[0], std * gains[1]
    walk = random_walk_growth(displacement, std, acceleration, acceleration_std, rate_hz)
    if walk > 0.0:
        gains = derivative_gains(finite, rate_hz, bandwidth_hz, walk=True)
        velocity_std = np.hypot(velocity_std, walk * gains[0])
        acceleration_std = np.hypot(acceleration_std, walk * gains[1])
    return velocity, acceleration, velocity_std, acceleration_std, walk


def _gap_flags(grid: Grid, tracks: list[Track], hole: NDArray[np.bool_]) -> list[str]:
    flags = ["gap"] if len(grid.pieces) > 1 else []
    if any(track.doubtful for track in tracks):
        flags.append("fringe_doubtful")
    if len(grid.pieces) == 1 and hole.any():
        flags.append("drop_out")
    return flags


def _beat_flags(recording: Recording, grid: Grid, tracks: list[Track], folded: float, count: int) -> list[str]:
    flags = []
    if max(track.spec.survey.clipped_fraction for track in tracks) > _CLIPPED:
        flags.append("clipped")
    if max(folded, *(track.spec.survey.harmonics for track in tracks)) > HARMONICS_ABOVE:
        flags.append("harmonics")
    if _outside_band(tracks[0], grid, count - 1) > 0:
        flags.append("out_of_band")
    if any(gap.samples_lost is None for gap in recording.bridgeable_gaps):
        flags.append("gap_unknown")
    return flags


def _start(displacement: Floats) -> float:
    """Return the displacement to define as zero: the value at the first sample of a parabola through the first 64."""
    first = displacement[:64]
    if first.size < 8:
        raise AnalysisError("no light: the beat is nowhere strong enough to be read")
    return float(np.polynomial.Polynomial.fit(np.arange(first.size), first, 2)(0.0))


@dataclass(frozen=True, slots=True)
class _RestBeat:
    """The rest beat's phase in cycles at the motion's times (n,), its standard deviation, frequency, and smooth fit."""

    cycles: Floats
    std_cycles: Floats | float
    frequency_hz: Quantity
    smooth: RestPhase | None  # None without PD0


def _rest(
    recording: Recording, settings: AnalysisSettings, grid: Grid, tracks: list[Track], time_s: Floats, flags: list[str]
) -> _RestBeat:
    if len(tracks) == 1:
        given = recording.setup.rest_frequency_hz
        assert given is not None
        return _RestBeat(given * time_s, 0.0, Quantity(given, 0.0, "given"), None)
    track = tracks[1]
    own_time = grid.time_s(track.spec.tuning)
    std = float(np.nanmedian(track.std_cycles))
    phase, doubtful = join_stretches(track.phase_cycles, track.breaks, 1.0, degree=1, reach=_REST_JOIN_SAMPLES)
    if doubtful:
        flags.append("fringe_doubtful")
    rest = fit_rest_phase(own_time, np.where(track.hole, np.nan, phase), std, track.oscillator_hz)
    if rest.degree > 1:
        flags.append("rest_drift")
    if rest.unsteady_cycles > _UNSTEADY_SIGMA * std:
        flags.append("rest_unsteady")
    delayed = track.oscillator_hz * (time_s - _delay_s(track))
    if settings.rest == "instantaneous":
        own = phase[: time_s.size]  # read through the moving beat's window, so at the same times
        own = np.where(np.isfinite(own), own, rest.phase_at(time_s))
        return _RestBeat(own + delayed, track.std_cycles[: time_s.size], rest.frequency_hz, rest)
    return _RestBeat(rest.phase_at(time_s) + delayed, 0.0, rest.frequency_hz, rest)


def _delay_s(track: Track) -> float:
    """Return the time in s from a window's first sample, where the oscillator's phase is counted, to its centre."""
    tuning = track.spec.tuning
    return tuning.delay_samples / tuning.sample_rate_hz


def _quality(recording: Recording, track: Track, grid: Grid) -> BeatQuality:
    known = stretches(np.isfinite(track.phase_cycles))
    start, stop = max(known, key=lambda piece: piece[1] - piece[0])
    quiet = slice(start, min(stop, start + max(16, (stop - start) // 32)))
    slope = np.polyfit(np.arange(quiet.stop - quiet.start), track.phase_cycles[quiet], 1)[0]
    return BeatQuality(
        frequency_hz=float(track.oscillator_hz + slope * grid.rate_hz),
        amplitude_v=track.spec.survey.amplitude_counts * abs(recording.channels[track.spec.column].volts_per_count),
        snr_db=track.spec.survey.snr_db,
        clipped_fraction=track.spec.survey.clipped_fraction,
    )
