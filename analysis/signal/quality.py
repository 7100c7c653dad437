"""What the operator has: light, noise floors against the bound, and every flag in words."""

from dataclasses import dataclass

import numpy as np

from analysis.shot.motion import BeatQuality, Motion
from analysis.signal.filters import derivative_filters

MEANINGS = {
    "clipped": "the beat is cut off, at the digitizer's rail or before it: lower the gain",
    "gap": "samples were lost; short gaps are bridged by the predicted motion",
    "samples_lost": "the digitizer lost samples without a word: found by the jumps of both beats, bridged like gaps",
    "gap_unknown": "samples were lost, how many is not known: only the longest part is analysed",
    "truncated": "the data file is shorter than its metadata say",
    "longer_than_declared": "the data file is longer than its metadata say",
    "drop_out": "the light failed for a moment; bridged by the predicted motion",
    "fringe_doubtful": "after a gap or drop-out the position may be off by whole fringes; velocity and force hold",
    "harmonics": "the beat is distorted (second or third harmonic above 1 %): detector or amplifier near its limit",
    "cross_talk_removed": "PD1's beat stands in PD0 (cables, amplifier): it was taken off",
    "cross_talk": "PD1's beat stands in PD0 and could not be taken off: part their cables; no deflection is given",
    "leak_removed": "unshifted light reached PD1 (polarisation leak); its ripple was removed",
    "rest_drift": "the rest frequency drifted during the shot; followed by a smooth curve",
    "rest_unsteady": "the rest frequency was not smooth: subtract PD0 sample by sample (instantaneous)",
    "wander": "the optical path drifted by itself; contained in the uncertainties of velocity and force",
    "out_of_band": "the beat left the band it was read through: frequencies beyond it are not to be trusted",
    "rate_contradicted": "PD0 or the computer's clock contradicts the sample rate: all speeds may be wrong by that",
    "uneven_time": "the record's times were uneven and were interpolated to an even grid",
}


@dataclass(frozen=True, slots=True)
class Quality:
    """The state of a shot's signals; floors are standard deviations of one sample in quiet flight.

    ``*_bound_*`` is what the measured signal-to-noise ratio allows at best (Cramer-Rao) through the same filters; NaN
    for a motion record without beats.
    """

    measurement: BeatQuality | None
    reference: BeatQuality | None
    displacement_floor_m: float
    displacement_bound_m: float
    velocity_floor_m_per_s: float
    velocity_bound_m_per_s: float
    force_floor_n: float
    force_bound_n: float
    flags: tuple[tuple[str, str], ...]  # (flag, what it means)

    @property
    def times_bound(self) -> float:
        """Get the velocity's noise floor relative to the bound."""
        return self.velocity_floor_m_per_s / self.velocity_bound_m_per_s


def assess(motion: Motion, input_rate_hz: float, instantaneous: bool = False) -> Quality:
    """Return the quality of a shot sampled at ``input_rate_hz``; ``instantaneous`` as its rest was taken off.

    Phase noise of a beat in white noise: S = 2 / (SNR input_rate) rad^2/Hz, one-sided, with SNR = A^2 / (2 sigma^2);
    displacement is lambda / (4 pi) of the phase.
    """
    bound = float("nan")
    if motion.measurement is not None and motion.wavelength_m is not None:
        density = 2.0 / (10 ** (motion.measurement.snr_db / 10) * input_rate_hz)
        if instantaneous and motion.reference is not None:
            density += 2.0 / (10 ** (motion.reference.snr_db / 10) * input_rate_hz)
        bound = motion.wavelength_m / (4 * np.pi) * float(np.sqrt(0.5 * density * motion.sample_rate_hz))
    filters = derivative_filters(motion.sample_rate_hz, motion.bandwidth_hz)
    return Quality(
        motion.measurement,
        motion.reference,
        _middle(motion.displacement_std_m),
        bound,
        _middle(motion.velocity_std_m_per_s),
        bound * filters.velocity_gain,
        _middle(motion.force_std_n),
        bound * filters.acceleration_gain * motion.moving_mass_kg,
        tuple((flag, MEANINGS.get(flag, flag.replace("_", " "))) for flag in motion.flags),
    )


def _middle(std: np.ndarray) -> float:
    known = std[np.isfinite(std)]
    return float(np.median(known)) if known.size else float("nan")
