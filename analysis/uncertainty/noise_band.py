"""Standard deviations of a motion about its true model, per sample: white noise, slow noise and frame vibration."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import toeplitz

from analysis.diagnosis import Diagnosis, Verdict
from analysis.fitted import vibration_of
from analysis.shot import Fit, Floats, Motion, Shot, VibrationSpectrum, Wander
from analysis.signal import derivative_filters, derivative_gains

WANDER_RATIO = 1.1  # times the white noise, above which a fit's noise includes slow noise that it estimated
_POINTS = 256  # points over a record at which a polynomial is fitted to slow sines; fast sines are not affected


@dataclass(frozen=True, slots=True)
class NoiseBand:
    """Standard deviations of a motion about its true model; arrays have shape (n,)."""

    displacement_m: Floats
    velocity_m_per_s: Floats
    force_n: Floats


def noise_band_of_shot(shot: Shot) -> NoiseBand:
    """Return the noise band of a shot's motion about a complete model; the shot must have a motion.

    If the path has slow noise other than vibration (air, laser), the displacement's band is the noise of the fit.
    """
    motion, fit = shot.motion, shot.fit
    assert motion is not None
    residual_vibration_m = fit.shots[0].sway_std_m if fit is not None and fit.shots else None
    band = noise_band_of_motion(motion, vibration_of(shot), residual_vibration_m, path_wander(shot))
    white_m = float(np.nanmedian(motion.displacement_std_m))
    if fit is None or vibration_of(shot) is not None or not fit.noise_std_m > WANDER_RATIO * white_m:
        return band
    return replace(band, displacement_m=np.full_like(motion.displacement_m, fit.noise_std_m))


def path_wander(shot: Shot) -> Wander:
    """Return the slow noise in a shot's path other than vibration; () without a converged fit."""
    return shot.fit.wander if shot.fit is not None and shot.fit.converged else ()


def verdict_band(shot: Shot, diagnosis: Diagnosis | None) -> tuple[NoiseBand, str]:
    """Return the band that decided a shot's verdict, and its name; without a diagnosis the shot's own band."""
    band = noise_band_of_shot(shot)
    if diagnosis is None:
        return band, "noise, path drift and floor vibration"
    displacement_m, words = diagnosis_band(diagnosis, shot)
    return replace(band, displacement_m=displacement_m), words


def noise_band_of_motion(
    motion: Motion, vibration: VibrationSpectrum | None, residual_vibration_m: Floats | None = None, wander: Wander = ()
) -> NoiseBand:
    """Return the noise band from sample noise, vibration and slow noise, each through the motion's filters.

    ``residual_vibration_m``, shape (n,), is the std of the vibration in the residual of a fit that includes vibration;
    without it the fit is assumed to absorb only a constant and a slope.  ``wander`` is other slow noise (air, laser),
    as the fit estimated it: (rms in m, correlation time in s) of each term.

    A Motion's stated uncertainties treat the path as a random walk, as its spectrum is unknown when the Motion is made.
    A building's spectrum falls with frequency.  With the spectrum from the flights (``vibration``) the force's band is
    a sixth as wide on a VC-D floor, and the displacement's band includes vibration.  Without it the motion's own stds
    are returned.
    """
    if vibration is None:
        return NoiseBand(motion.displacement_std_m, motion.velocity_std_m_per_s, motion.force_std_n)
    rate_hz, bandwidth_hz = motion.sample_rate_hz, motion.bandwidth_hz
    gains = derivative_gains(np.isfinite(motion.displacement_m), rate_hz, bandwidth_hz)
    filters = derivative_filters(float(rate_hz), float(bandwidth_hz))
    turn = 2j * np.pi * vibration.frequency_hz / rate_hz
    steps = np.arange(-filters.half, filters.half + 1)
    first, second = (np.abs(np.exp(turn[:, None] * steps) @ taps) for taps in (filters.velocity, filters.acceleration))
    span_s = float(motion.time_s[-1] - motion.time_s[0])
    white_m = motion.displacement_std_m
    wander_m, wander_m_per_s, wander_m_per_s2 = (
        _wander_std(wander, taps, rate_hz) for taps in (np.ones(1), filters.velocity, filters.acceleration)
    )
    rms_m = (
        _filtered_rms(vibration, _share_after_fit(vibration, span_s, 2))
        if residual_vibration_m is None
        else residual_vibration_m
    )
    rms_m_per_s = _filtered_rms(vibration, first**2 * _share_after_fit(vibration, span_s, 1))
    return NoiseBand(
        np.sqrt(white_m**2 + rms_m**2 + wander_m**2),
        np.sqrt((white_m * gains[0]) ** 2 + rms_m_per_s**2 + wander_m_per_s**2),
        motion.moving_mass_kg
        * np.sqrt((white_m * gains[1]) ** 2 + _filtered_rms(vibration, second**2) ** 2 + wander_m_per_s2**2),
    )


def diagnosis_band(diagnosis: Diagnosis, shot: Shot) -> tuple[Floats, str]:
    """Return the noise band of a diagnosed shot's displacement in m, and its name in words.

    A diagnosis that explains its shots estimates slow noise and frame motion from all samples of all shots, better
    than a few milliseconds of flight can.  If it does not explain its residual, the band of the single shot is used.
    """
    motion = shot.motion
    assert motion is not None
    learned_m, white_m = diagnosis.fit_after.noise_std_m, float(np.nanmedian(motion.displacement_std_m))
    explained = diagnosis.verdict not in (Verdict.PARTLY_EXPLAINED, Verdict.UNEXPLAINED)
    sway_m = _frame_motion_std_m(diagnosis.fit_after, shot)
    if explained and sway_m is not None:
        return np.hypot(learned_m, sway_m), "noise and floor vibration, from all shots"
    if explained and learned_m > WANDER_RATIO * white_m:
        return np.full_like(motion.displacement_m, learned_m), "noise, from all shots"
    return noise_band_of_shot(shot).displacement_m, "noise and floor vibration"


def _frame_motion_std_m(fit: Fit, shot: Shot) -> Floats | None:
    """Return the std of the frame motion in a shot's residual of a joint fit, shape (n,); None if there is none.

    The shot's part is found by its impact speed, which is known to micrometres per second and never repeats exactly
    in shots pushed by hand.
    """
    if shot.motion is None or shot.fit is None or not shot.fit.shots:
        return None
    speed, samples = shot.fit.shots[0].velocity_in_m_per_s.value, shot.motion.displacement_m.shape
    part = min(fit.shots, key=lambda one: abs(one.velocity_in_m_per_s.value - speed), default=None)
    return part.sway_std_m if part is not None and part.residual_m.shape == samples else None


def _wander_std(wander: Wander, taps: Floats, rate_hz: float) -> float:
    """Return the std of slow noise after a filter; its terms are Ornstein-Uhlenbeck processes (``Floor``)."""
    apart_s = np.arange(taps.size) / rate_hz
    power = sum(rms_m**2 * float(taps @ toeplitz(np.exp(-apart_s / memory_s)) @ taps) for rms_m, memory_s in wander)
    return float(np.sqrt(power))


def _filtered_rms(vibration: VibrationSpectrum, gain: Floats) -> float:
    return float(np.sqrt(vibration.power_m2 @ gain))


def _share_after_fit(vibration: VibrationSpectrum, span_s: float, terms: int) -> Floats:
    """Return the share of each sine's power that remains after a polynomial fit with ``terms`` terms, shape (f,).

    The fit adjusts the offset and speed of every shot, and so absorbs the slowest part of the vibration.
    """
    at = np.linspace(-1.0, 1.0, _POINTS)
    basis = np.linalg.qr(np.vander(at, terms))[0]
    sines = np.exp(1j * np.pi * span_s * vibration.frequency_hz[:, None] * at)
    return np.asarray(np.mean(np.abs(sines - (sines @ basis) @ basis.T) ** 2, axis=1))
