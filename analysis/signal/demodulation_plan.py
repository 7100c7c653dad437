"""Plan a recording's demodulation (oscillators, bandwidth, decimation): narrow bands first, wider ones if needed."""

from collections.abc import Iterator

import numpy as np

from analysis.shot import AnalysisError, AnalysisSettings, Recording, Role
from analysis.signal.survey import Survey
from analysis.signal.track import BeatSpec
from analysis.signal.tuning import Tuning, fixed_schedule, following_schedule, tune

FOLLOWED_HZ = (130e3, 400e3)  # largest distance of beat from following oscillator, in the first and second plan
NARROW_HZ = 40e3  # the same for a beat so near zero that a wider band would include its image
SPAN_MARGIN_HZ = 60e3  # beyond the surveyed frequencies, if one oscillator serves the whole recording
PHASE_RATE_HZ = 0.45e6  # if there is enough light: short windows, so that a fault spoils little
PHASE_VARIANCE = 0.025  # rad^2 of one phase above which a cycle may slip; less light needs longer windows
OSCILLATOR_SPACING_HZ = 40e3
REST_HALF_WIDTH_HZ = 50e3
_ROUND_HZ = 20e3
_DIM_DB = 6.0


DemodulationPlan = tuple[int, list[BeatSpec]]  # recorded samples per motion sample; the moving beat, the rest beat


def demodulation_plans(
    seen: Survey, reference: Survey | None, recording: Recording, settings: AnalysisSettings
) -> Iterator[DemodulationPlan]:
    """Yield the plans to try, the cheapest and least noisy first.  Raises AnalysisError if no plan is possible.

    The oscillator follows the surveyed beat in two plans, the second with a wider band; the third plan has one fixed
    band for all surveyed frequencies.  A narrow plan is yielded only if these are impossible.
    """
    made = False
    problem: AnalysisError | None = None
    widths: tuple[float | None, ...] = (*FOLLOWED_HZ, None, NARROW_HZ)
    for width in widths:
        if width == NARROW_HZ and made:
            break
        try:
            yield _plan(width, seen, reference, recording, settings)
            made = True
        except AnalysisError as failure:
            problem = problem or failure
    if not made and problem is not None:
        raise problem


def _plan(
    width_hz: float | None, seen: Survey, reference: Survey | None, recording: Recording, settings: AnalysisSettings
) -> DemodulationPlan:
    rate, motion_rate = recording.sample_rate_hz, settings.motion_rate_hz
    low, high = _rounded(seen.low_hz, seen.high_hz)
    together = reference is not None and settings.rest == "instantaneous"
    if together and reference is not None:  # the same window for both beats, so that their samples coincide
        low, high = _rounded(min(seen.low_hz, reference.low_hz), max(seen.high_hz, reference.high_hz))
    if width_hz is None:
        half_width = 0.5 * (high - low) + SPAN_MARGIN_HZ + 0.5 * motion_rate
        centre = 0.5 * (low + high)
        tuning = _tune(rate, centre, centre, half_width, settings, seen.snr_db)
        schedule = fixed_schedule(tuning, centre)
    else:
        tuning = _tune(rate, low, high, width_hz + 0.5 * motion_rate, settings, seen.snr_db)
        frequency = seen.frequency_hz[seen.seen]
        if seen.snr_db < _DIM_DB and frequency.size > 2:
            ends = np.concatenate((frequency[:1], frequency, frequency[-1:]))
            frequency = np.median(np.stack((ends[:-2], ends[1:-1], ends[2:])), axis=0)
        centre_sample = seen.sample[seen.seen] + seen.stretch // 2
        schedule = following_schedule(tuning, centre_sample, frequency, recording.samples, OSCILLATOR_SPACING_HZ)
    step = tuning.decimation * max(2, round(tuning.phase_rate_hz / motion_rate))
    column, reference_column = recording.column(Role.MEASUREMENT), recording.column(Role.REFERENCE)
    assert column is not None
    beats = [BeatSpec(tuning, schedule, column, seen)]
    if reference is not None and reference_column is not None:
        rest_hz = float(np.median(reference.frequency_hz[reference.seen]))
        if not together:
            spread = 0.5 * float(np.ptp(reference.frequency_hz[reference.seen]))
            half_width = _ROUND_HZ * np.ceil((REST_HALF_WIDTH_HZ + min(spread, 1e5) + 0.5 * motion_rate) / _ROUND_HZ)
            tuning = tune(rate, *_rounded(rest_hz, rest_hz), half_width, 2.0 * rate / step, step)
        beats.append(BeatSpec(tuning, fixed_schedule(tuning, rest_hz), reference_column, reference))
    return step, beats


def _rounded(low_hz: float, high_hz: float) -> tuple[float, float]:
    """Return a band rounded outwards, so that similar recordings share one filter design."""
    return float(_ROUND_HZ * np.floor(low_hz / _ROUND_HZ)), float(_ROUND_HZ * np.ceil(high_hz / _ROUND_HZ))


def _tune(
    rate_hz: float, low_hz: float, high_hz: float, half_width_hz: float, settings: AnalysisSettings, snr_db: float
) -> Tuning:
    """Return the tuning with the shortest window that is safe from cycle slips at this signal-to-noise ratio."""
    floor = 3.0 * settings.motion_rate_hz
    wanted = max(floor, PHASE_RATE_HZ)
    whole = round(rate_hz / settings.motion_rate_hz)
    tuning = _divided(rate_hz, low_hz, high_hz, half_width_hz, wanted, whole)
    snr = 10 ** (snr_db / 10)
    for _ in range(4):
        variance = 1.0 / (snr * tuning.effective_samples)
        if variance <= PHASE_VARIANCE or wanted <= floor:
            break
        wanted = max(floor, 0.8 * wanted * PHASE_VARIANCE / variance)
        half_width_hz = min(half_width_hz, max(wanted / 2.4, 0.6 * half_width_hz))
        tuning = _divided(rate_hz, low_hz, high_hz, half_width_hz, wanted, whole)
    return tuning


def _divided(
    rate_hz: float, low_hz: float, high_hz: float, half_width_hz: float, phase_rate_hz: float, whole: int
) -> Tuning:
    """Return a tuning whose decimation divides ``whole`` (exact motion rate), unless that costs over three times."""
    free = tune(rate_hz, low_hz, high_hz, half_width_hz, phase_rate_hz)
    if whole % free.decimation == 0 or whole < 2:
        return free
    exact = tune(rate_hz, low_hz, high_hz, half_width_hz, phase_rate_hz, whole)
    return exact if 3 * exact.decimation >= free.decimation else free
