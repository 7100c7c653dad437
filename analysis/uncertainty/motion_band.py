"""The band in which a motion lies about its true model, by noise and vibration, sample by sample."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import toeplitz

from analysis.diagnosis import Diagnosis, Verdict
from analysis.fitted import shaking_of
from analysis.shot import Fit, Floats, Motion, Shaking, Shot, Wander
from analysis.signal import derivative_filters, derivative_gains

WANDERS = 1.1  # times the white noise, beyond which a fit's noise includes slow noise that it estimated
_POINTS = 256  # over a record, for the effect of a polynomial on slow sines; fast ones are not affected


@dataclass(frozen=True, slots=True)
class NoiseBand:
    """Standard deviations of a motion about its true model; arrays of shape (n,)."""

    displacement_m: Floats
    velocity_m_per_s: Floats
    force_n: Floats


def band_of(shot: Shot) -> NoiseBand:
    """Return the band of a shot's motion about a complete model; the shot must have a motion.

    Where the path wanders without vibration (air, laser) the displacement's band is the noise that the fit estimated.
    """
    motion, fit = shot.motion, shot.fit
    assert motion is not None
    left_m = fit.shots[0].sway_std_m if fit is not None and fit.shots else None
    band = noise_band(motion, shaking_of(shot), left_m, wander_of(shot))
    white_m = float(np.nanmedian(motion.displacement_std_m))
    if fit is None or shaking_of(shot) is not None or not fit.noise_std_m > WANDERS * white_m:
        return band
    return replace(band, displacement_m=np.full_like(motion.displacement_m, fit.noise_std_m))


def wander_of(shot: Shot) -> Wander:
    """Return what wanders in a shot's path besides vibration, nothing where no fit has told."""
    return shot.fit.wander if shot.fit is not None and shot.fit.converged else ()


def judged_band(shot: Shot, diagnosis: Diagnosis | None) -> tuple[NoiseBand, str]:
    """Return the band by which the verdict on a shot was judged, and its name; without a diagnosis the shot's own."""
    band = band_of(shot)
    if diagnosis is None:
        return band, "noise, wander and building"
    displacement_m, words = diagnosed_band(diagnosis, shot)
    return replace(band, displacement_m=displacement_m), words


def noise_band(motion: Motion, shaking: Shaking | None, left_m: Floats | None = None, wander: Wander = ()) -> NoiseBand:
    """Return the noise of the samples and of the path's vibration, each through the motion's own filters.

    ``left_m``, shape (n,), is the std of the vibration in the residual of a fit that includes it; without, the fit is
    taken to absorb only a constant and a slope.  ``wander`` is what wanders besides (air, laser), as the fit found it:
    (rms in m, memory in s) of each part.

    A Motion's stated uncertainties treat the path as a random walk, as its spectrum is not known when it is made.  A
    building's spectrum falls from octave to octave: with the spectrum from the flights (``shaking``) the force's band
    is a sixth as wide on a floor of VC-D, and the displacement has one at all.  Without it the motion's own stds are
    used.
    """
    if shaking is None:
        return NoiseBand(motion.displacement_std_m, motion.velocity_std_m_per_s, motion.force_std_n)
    rate_hz, bandwidth_hz = motion.sample_rate_hz, motion.bandwidth_hz
    gains = derivative_gains(np.isfinite(motion.displacement_m), rate_hz, bandwidth_hz)
    filters = derivative_filters(float(rate_hz), float(bandwidth_hz))
    turn = 2j * np.pi * shaking.frequency_hz / rate_hz
    steps = np.arange(-filters.half, filters.half + 1)
    first, second = (np.abs(np.exp(turn[:, None] * steps) @ taps) for taps in (filters.velocity, filters.acceleration))
    span_s = float(motion.time_s[-1] - motion.time_s[0])
    white_m = motion.displacement_std_m
    wander_m, wander_m_per_s, wander_m_per_s2 = (
        _wandering(wander, taps, rate_hz) for taps in (np.ones(1), filters.velocity, filters.acceleration)
    )
    rms_m = _rms(shaking, _left(shaking, span_s, 2)) if left_m is None else left_m
    rms_m_per_s = _rms(shaking, first**2 * _left(shaking, span_s, 1))
    return NoiseBand(
        np.sqrt(white_m**2 + rms_m**2 + wander_m**2),
        np.sqrt((white_m * gains[0]) ** 2 + rms_m_per_s**2 + wander_m_per_s**2),
        motion.moving_mass_kg * np.sqrt((white_m * gains[1]) ** 2 + _rms(shaking, second**2) ** 2 + wander_m_per_s2**2),
    )


def diagnosed_band(diagnosis: Diagnosis, shot: Shot) -> tuple[Floats, str]:
    """Return the band of a diagnosed shot's displacement in m, and its name in words.

    A diagnosis that explains its shots estimates the path's wander and the frame's motion from all samples of all
    shots, better than some milliseconds of flight do.  Where its residual is not explained, the band is that of a
    single shot.
    """
    motion = shot.motion
    assert motion is not None
    learned_m, white_m = diagnosis.fit_after.noise_std_m, float(np.nanmedian(motion.displacement_std_m))
    explained = diagnosis.verdict not in (Verdict.PARTLY_EXPLAINED, Verdict.UNEXPLAINED)
    sway_m = _frame_in(diagnosis.fit_after, shot)
    if explained and sway_m is not None:
        return np.hypot(learned_m, sway_m), "noise and building as all shots show them"
    if explained and learned_m > WANDERS * white_m:
        return np.full_like(motion.displacement_m, learned_m), "noise as all shots show it"
    return band_of(shot).displacement_m, "noise and building"


def _frame_in(fit: Fit, shot: Shot) -> Floats | None:
    """Return the std of the frame's motion in a shot's residual of a joint fit, shape (n,); None where there is none.

    The shot's part is that with its speed: the hand never gives the same twice, to the micrometre per second it is
    known to.
    """
    if shot.motion is None or shot.fit is None or not shot.fit.shots:
        return None
    speed, samples = shot.fit.shots[0].velocity_in_m_per_s.value, shot.motion.displacement_m.shape
    part = min(fit.shots, key=lambda one: abs(one.velocity_in_m_per_s.value - speed), default=None)
    return part.sway_std_m if part is not None and part.residual_m.shape == samples else None


def _wandering(wander: Wander, taps: Floats, rate_hz: float) -> float:
    """Return the std of what wanders behind a filter; its parts forget exponentially (Floor)."""
    apart_s = np.arange(taps.size) / rate_hz
    power = sum(rms_m**2 * float(taps @ toeplitz(np.exp(-apart_s / memory_s)) @ taps) for rms_m, memory_s in wander)
    return float(np.sqrt(power))


def _rms(shaking: Shaking, gain: Floats) -> float:
    return float(np.sqrt(shaking.power_m2 @ gain))


def _left(shaking: Shaking, span_s: float, terms: int) -> Floats:
    """Return the share of each sine's power that is left by a polynomial of ``terms`` terms, shape (f,).

    The fit adjusts every shot's own offset and speed, and so absorbs the slowest part of the vibration.
    """
    at = np.linspace(-1.0, 1.0, _POINTS)
    basis = np.linalg.qr(np.vander(at, terms))[0]
    sines = np.exp(1j * np.pi * span_s * shaking.frequency_hz[:, None] * at)
    return np.asarray(np.mean(np.abs(sines - (sines @ basis) @ basis.T) ** 2, axis=1))
