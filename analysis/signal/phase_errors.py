"""Errors of the moving beat's phase: the polarisation leak (unshifted light that reaches PD1), and folded harmonics.

In the frame that rotates with PD0's phase the moving beat describes a circle, and the leak is the offset of the
circle's centre from zero.  While the block moves fast the leak's ripple lies far outside the motion's band.  Near the
turnaround the ripple lies within the band and disturbs the displacement by up to lambda / (4 pi) times leak / beat.

A distorted beat near a third of the sample rate has a second harmonic that folds onto the beat; near a quarter the
third harmonic does.  The folded harmonic disturbs the phase, but its own phase is known: relative to the beat it turns
``order + 1`` times as fast as the beat, in the opposite direction, and so appears as a ripple of the beat's amplitude.
"""

from dataclasses import dataclass

import numpy as np

from analysis.shot import Floats, Recording
from analysis.signal.beat import BeatReader
from analysis.signal.filters import decimator_taps, stretches
from analysis.signal.rest import RestPhase
from analysis.signal.track import BeatSpec, Grid, Track

LONGEST_S = 12e-3  # of flight from which the circle's centre is estimated
SHORTEST_S = 0.5e-3
FAST_HZ = 40e3  # Doppler shift above which the phase turns often enough for the mean to be the circle's centre
REMOVED_ABOVE = 5e-4  # relative to the beat; a smaller leak disturbs the displacement by less than 25 pm
_LEAK_SIGMA = 6.0  # significance above which a leak is removed
_NEAREST_SHARE = 0.03  # of the motion rate: a slower ripple of a harmonic looks like a change of light
_FARTHEST_SHARE = 0.3  # of the motion rate: a faster ripple is averaged away
_FEWEST = 100  # motion samples
_FOLDED_SIGMA = 5.0  # significance above which a harmonic counts


@dataclass(frozen=True, slots=True)
class Leak:
    """A leak: amplitude ratio to the beat, its standard deviation, and phase relative to PD0 in cycles."""

    ratio: float
    std: float
    cycles: float


def find_leak(
    recording: Recording, rest: RestPhase, rest_spec: BeatSpec, track: Track, grid: Grid, doppler_hz: Floats
) -> Leak | None:
    """Return the leak in the moving beat ``track``; None if it is too small or the block never moves fast enough.

    ``doppler_hz`` (n,), on the motion's grid, shows where the block flies fast.  There PD1 is read again at the rest
    frequency and averaged in the frame rotating with PD0's phase, under a Hann window.
    """
    fast = (np.abs(doppler_hz) > FAST_HZ) & ~track.hole[: doppler_hz.size]
    runs = stretches(fast)
    if not runs:
        return None
    first, last = max(runs, key=lambda run: run[1] - run[0])
    start = (first + 6) * grid.step
    stop = min((last + 6) * grid.step, start + int(LONGEST_S * grid.input_rate_hz))
    for piece_start, piece_stop, true_start in grid.pieces:
        begin = max(start, true_start)
        end = min(stop, true_start + piece_stop - piece_start)
        if end - begin >= SHORTEST_S * grid.input_rate_hz:
            break
    else:
        return None
    tuning = rest_spec.tuning
    reader = BeatReader(tuning, rest_spec.schedule, track.spec.column, track.spec.survey.offset_counts, begin)
    index, phase, power = reader.feed(
        recording.counts[begin - true_start + piece_start : end - true_start + piece_start]
    )
    if phase.size < 64:
        return None
    sample = (index + np.arange(phase.size)) * float(tuning.decimation) + tuning.delay_samples
    time_s: Floats = np.asarray(sample / tuning.sample_rate_hz, np.float64)
    turned = 2 * np.sqrt(power.astype(np.float64)) * np.exp(2j * np.pi * (phase - rest.phase_at(time_s)))
    window = np.hanning(phase.size + 2)[1:-1]
    centre = complex(np.sum(window * turned) / window.sum())
    amplitude = track.spec.survey.amplitude_counts
    snr = 10 ** (track.spec.survey.snr_db / 10)
    std = float(np.sqrt(1.5 / (snr * tuning.effective_samples * phase.size)))
    ratio = abs(centre) / amplitude
    if ratio < max(REMOVED_ABOVE, _LEAK_SIGMA * std):
        return None
    return Leak(ratio, std, float(np.angle(centre) / (2 * np.pi)))


def leak_phase(leak: Leak, moving_cycles: Floats, rest_cycles: Floats, track: Track, grid: Grid) -> Floats:
    """Return the phase in cycles, shape (n,), that a leak adds to the moving beat, to second order in the ratio.

    Both given phases are full phases (a cosine's) at the same times.  Band-pass and decimator attenuate the ripple like
    a tone at the Doppler frequency.
    """
    doppler = np.abs(np.gradient(moving_cycles - rest_cycles) * grid.rate_hz)
    ratio = leak.ratio * _response(track.spec.tuning.window, doppler / grid.input_rate_hz)
    factor = grid.step // track.spec.tuning.decimation
    taps = decimator_taps(factor, track.spec.tuning.spread)
    phase_rate = track.spec.tuning.phase_rate_hz
    once, twice = _response(taps, doppler / phase_rate), _response(taps, 2 * doppler / phase_rate)
    added = np.zeros(moving_cycles.shape)
    for _ in range(2):
        angle = 2 * np.pi * (leak.cycles + rest_cycles - (moving_cycles - added))
        added = (once * ratio * np.sin(angle) - twice * 0.5 * ratio**2 * np.sin(2 * angle)) / (2 * np.pi)
    return np.asarray(np.where(np.isfinite(added), added, 0.0))


def _response(taps: Floats, frequency: Floats) -> Floats:
    """Return the response of symmetric taps of unit sum at frequencies in cycles per sample, from a fine grid."""
    size = 1 << int(np.ceil(np.log2(32 * taps.size)))
    position = np.arange(size // 2 + 1) / size
    gain = np.fft.rfft(taps, size) * np.exp(2j * np.pi * position * 0.5 * (taps.size - 1))
    wrapped = np.abs(frequency - np.rint(frequency))
    return np.asarray(np.interp(wrapped, position, gain.real))


def folded_harmonic(
    phase_cycles: Floats, amplitude_counts: Floats, time_s: Floats, sample_rate_hz: float, rate_hz: float
) -> float:
    """Return the amplitude of a 2nd or 3rd harmonic folded onto the beat, relative to the beat; 0 if none is found.

    ``phase_cycles`` (n,) is the beat's full phase at ``time_s``, the motion samples at ``rate_hz``; NaN if unknown.
    Second differences of the amplitude are fitted with those of the ripple, so that slow changes of light do not count.
    """
    middle = amplitude_counts[1:-1]
    bend = amplitude_counts[2:] - 2 * middle + amplitude_counts[:-2]
    strongest = 0.0
    for order in (2, 3):
        ripple_hz = np.abs((order + 1) * np.gradient(phase_cycles)[1:-1] * rate_hz - sample_rate_hz)
        use = (ripple_hz > _NEAREST_SHARE * rate_hz) & (ripple_hz < _FARTHEST_SHARE * rate_hz)
        use &= np.isfinite(bend)
        if np.count_nonzero(use) < _FEWEST:
            continue
        wave = np.exp(2j * np.pi * ((order + 1) * phase_cycles - sample_rate_hz * time_s))
        shape = (wave[2:] - 2 * wave[1:-1] + wave[:-2])[use]
        size = float(np.sum(np.abs(shape) ** 2))
        level = float(np.median(middle[use]))
        found = 2 * abs(complex(np.sum(bend[use] * shape.conj()))) / (size * level)
        chance = 2 * float(np.std(bend[use])) / (np.sqrt(size) * level)
        if found > _FOLDED_SIGMA * chance:
            strongest = max(strongest, found)
    return strongest
