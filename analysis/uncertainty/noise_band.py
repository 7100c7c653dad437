"""What noise and a path that moves by itself leave of a motion once the true model is taken off, sample by sample."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.result import Diagnosis, Verdict
from analysis.fitted.fitted_shot import shaking_of
from analysis.shot.disturbance import Shaking
from analysis.shot.motion import Motion
from analysis.shot.shot import Shot
from analysis.signal.filters import derivative_filters, derivative_gains

Floats = NDArray[np.float64]
WANDERS = 1.1  # times the white noise: a fit's noise beyond it has a floor that it learned
_POINTS = 256  # over a record: enough for what is slow, and what is not keeps its power anyway


@dataclass(frozen=True, slots=True)
class NoiseBand:
    """Standard deviations of what stays when the true model is taken off a motion; arrays of shape (n,)."""

    displacement_m: Floats
    velocity_m_per_s: Floats
    force_n: Floats


def band_of(shot: Shot) -> NoiseBand:
    """Return what stays of a shot's motion where its model lacks nothing; the shot must have a motion.

    A path that wanders without a building that moves it (air, laser) leaves in the displacement what the fit weighed.
    """
    motion, fit = shot.motion, shot.fit
    assert motion is not None
    left_m = fit.shots[0].sway_std_m if fit is not None and fit.shots else None
    band = noise_band(motion, shaking_of(shot), left_m)
    white_m = float(np.nanmedian(motion.displacement_std_m))
    if fit is None or shaking_of(shot) is not None or not fit.noise_std_m > WANDERS * white_m:
        return band
    return replace(band, displacement_m=np.full_like(motion.displacement_m, fit.noise_std_m))


def judged_band(shot: Shot, diagnosis: Diagnosis | None) -> tuple[NoiseBand, str]:
    """Return the band that the verdict on a shot was judged by, and what it is in words; None: of the shot alone."""
    band = band_of(shot)
    if diagnosis is None:
        return band, "noise, wander and building"
    displacement_m, words = diagnosed_band(diagnosis, shot)
    return replace(band, displacement_m=displacement_m), words


def noise_band(motion: Motion, shaking: Shaking | None, left_m: Floats | None = None) -> NoiseBand:
    """Return the noise of the samples and what shook the path, each through the motion's own filters.

    ``left_m``, shape (n,), is the std of what a fit that weighed the building leaves of it in the displacement; without
    it the fit is taken to choose place and speed alone.

    The uncertainties a Motion states take the path for a random walk, as no more is known when it is made.  A building
    moves its floor ever less from octave to octave: with the spectrum that the flights showed (``shaking``) the force
    keeps a sixth of the band on a floor of VC-D, and the displacement has one at all.  Without, the motion's own hold.
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
    return NoiseBand(
        np.hypot(white_m, _rms(shaking, _left(shaking, span_s, 2)) if left_m is None else left_m),
        np.hypot(white_m * gains[0], _rms(shaking, first**2 * _left(shaking, span_s, 1))),
        motion.moving_mass_kg * np.hypot(white_m * gains[1], _rms(shaking, second**2)),
    )


def diagnosed_band(diagnosis: Diagnosis, shot: Shot) -> tuple[Floats, str]:
    """Return what stays of a diagnosed shot's displacement where nothing is missing, in m, and what it is in words.

    A diagnosis that explains its shots learns from the whole of all of them how far the path wanders: that is sharper
    than what some milliseconds of flight show.  Where it took the building's spectrum instead, or left something over
    that a wandering path might pass for, the flights' own word holds, as for a single shot.
    """
    motion = shot.motion
    assert motion is not None
    learned_m, white_m = diagnosis.fit_after.noise_std_m, float(np.nanmedian(motion.displacement_std_m))
    explained = diagnosis.verdict not in (Verdict.PARTLY_EXPLAINED, Verdict.UNEXPLAINED)
    if explained and learned_m > WANDERS * white_m:
        return np.full_like(motion.displacement_m, learned_m), "noise as all shots show it"
    return band_of(shot).displacement_m, "noise and building"


def _rms(shaking: Shaking, gain: Floats) -> float:
    return float(np.sqrt(shaking.power_m2 @ gain))


def _left(shaking: Shaking, span_s: float, terms: int) -> Floats:
    """Return what stays of each sine's power once a polynomial of ``terms`` terms is taken off, shape (f,).

    The fit chooses every shot's own place and speed, and so takes the slowest part of the floor off.
    """
    at = np.linspace(-1.0, 1.0, _POINTS)
    basis = np.linalg.qr(np.vander(at, terms))[0]
    sines = np.exp(1j * np.pi * span_s * shaking.frequency_hz[:, None] * at)
    return np.asarray(np.mean(np.abs(sines - (sines @ basis) @ basis.T) ** 2, axis=1))
