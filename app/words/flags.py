"""Names and explanations of a shot's flags, and the list of flags that cast no doubt on a number (no Qt)."""

from collections.abc import Iterable

FLAG_WORDS = {
    "clipped": "the beat is cut off, at the digitizer's rail or before it: lower the gain",
    "gap": "samples were lost; short gaps are bridged by the predicted motion",
    "samples_lost": "the digitizer lost samples and did not report it: found by jumps of both beats, bridged like gaps",
    "gap_unknown": "samples were lost, how many is not known: only the longest part is analysed",
    "truncated": "the data file is shorter than its metadata say",
    "longer_than_declared": "the data file is longer than its metadata say",
    "drop_out": "brief loss of light; bridged by the predicted motion",
    "fringe_doubtful": "after a gap or drop-out the position may be wrong by whole fringes; "
    "velocity and force are unaffected",
    "harmonics": "the beat is distorted (second or third harmonic above 1 %): detector or amplifier near its limit",
    "cross_talk_removed": "cross-talk of PD1 in PD0 (cables, amplifier) was removed",
    "cross_talk": "cross-talk of PD1 in PD0 could not be removed: separate their cables; no deflection is given",
    "leak_removed": "unshifted light reached PD1 (polarisation leak); its ripple was removed",
    "rest_drift": "the rest frequency drifted during the shot; followed by a smooth curve",
    "rest_unsteady": "the rest frequency was not smooth: subtract PD0 sample by sample (instantaneous)",
    "wander": "the optical path drifted; the uncertainties of velocity and force include it",
    "out_of_band": "the beat left the demodulation band: higher frequencies are not reliable",
    "rate_contradicted": "PD0 or the computer clock contradicts the stated sample rate: "
    "all velocities may be wrong by this ratio",
    "uneven_time": "the record's times were uneven and were interpolated to an even grid",
    "setup_corrected": "mass, wavelength, air or rest frequency were corrected after the shot was taken",
    "interrupted": "the capture was interrupted; the recorded part is analysed",
    "cut_short": "the capture ended before all requested samples arrived",
    "data_altered": "the data file is not the one that was recorded: its SHA-512 differs from that in the metadata",
    "trigger_lost": "the light switch's sample lies beyond the end of the file",
    "impulse_disagrees": "quasi-static COR and impulse ratio differ by more than three standard uncertainties",
    "bounces_disturbed": "an external force acts in the first flights: the kinetic COR is not given",
    "read_from_model": "peak, width, contact time and deflection are from the fitted model: the record is too coarse",
    "pulse_disagrees": "peak force and width do not match the impulse from mass and velocities",
    "no_release": "the record ends within the contact",
    "no_turn": "the block does not reverse during the presumed contact",
    "flight_cut": "an external force acts near the impact (a hand, a second impact): only the part before it is read",
    "goes_on": "an external force acts after the flight (a hand): only the first collision is read",
    "vibration": "the path vibrates: spectral lines were removed, the rest is included in the uncertainties",
    "knock": "the table was struck during a flight: that part was excluded, or is included in the uncertainties",
    "restitution_above_one": "restitution above one is not physical",
    "momentum_disagrees": "the impulse of the force is not m (v_out - v_in)",
    "fit_disagrees": "the model's velocities contradict those read, beyond their uncertainties",
    "chi2_far_from_one": "chi2 far from 1; uncertainties unreliable",
    "plate_shaken": "table vibration moves the plate before touch: not included in the fitted uncertainty",
    "plate_rings": "the plate was still oscillating at touch: not included in the fitted uncertainty; "
    "wait longer between shots",
    "knock_suspected": "motion explained by neither model nor floor: a knock or an unmodelled effect",
    "fit_not_converged": "the model's fit did not converge: its numbers are withheld",
    "mass_disagrees": "force and motion contradict the stated mass: the fitted one is used",
    "fit_to_follow": "readings are final; the fit is still running",
    "fit_failed": "the model could not be fitted: its numbers are withheld",
    "noise_not_known": "the free flight is too short to estimate the noise",
}

# flags whose cause is already accounted for in the numbers and their uncertainties
MILD_FLAGS = (
    "wander",
    "vibration",
    "knock",
    "leak_removed",
    "cross_talk_removed",
    "rest_drift",
    "goes_on",
    "read_from_model",
    "setup_corrected",
    "fit_to_follow",
)
_NAMES = {
    "wander": "path drift",
    "goes_on": "moved afterwards",
    "no_turn": "no reversal",
    "leak_removed": "leakage removed",
    "cross_talk": "cross-talk left",
    "cross_talk_removed": "cross-talk removed",
    "drop_out": "light dropout",
    "rest_drift": "rest frequency drift",
    "plate_shaken": "plate swinging",
    "knock_suspected": "knock or unmodelled effect",
    "impulse_disagrees": "impulse ratio differs",
    "longer_than_declared": "file too long",
    "restitution_above_one": "restitution above 1",
}


def flag_words(flag: str) -> str:
    """Return a flag's meaning and remedy in one line."""
    return FLAG_WORDS.get(flag, flag.replace("_", " "))


def flag_name(flag: str) -> str:
    """Return a flag's name of two or three words."""
    return _NAMES.get(flag, flag.replace("_", " "))


def by_severity(flags: Iterable[str]) -> list[str]:
    """Return the flags, with those that cast doubt on a number first."""
    return sorted(flags, key=lambda flag: flag in MILD_FLAGS)


def flags_in_short(flags: Iterable[str]) -> str:
    """Return the most serious flag and the number of others, like "clipped + 2"; "" for none."""
    ordered = by_severity(flags)
    more = f" + {len(ordered) - 1}" if len(ordered) > 1 else ""
    return flag_name(ordered[0]) + more if ordered else ""
