"""Names and explanations of a shot's flags, and which of them cast no doubt on a number (no Qt)."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Flag:
    """A flag's meaning and remedy in one line, and its ``name`` of two or three words if its key is not one.

    ``mild``: its cause is already accounted for in the numbers and their uncertainties.
    """

    words: str
    name: str = ""
    mild: bool = False


# fmt: off
FLAGS = {
    "clipped": Flag("the beat is cut off, at the digitizer's rail or before it: lower the gain"),
    "gap": Flag("samples were lost; short gaps are bridged by the predicted motion"),
    "samples_lost": Flag("the digitizer lost samples and did not report it: found by jumps of both beats, bridged "
        "like gaps"),
    "gap_unknown": Flag("samples were lost, how many is not known: only the longest part is analysed"),
    "truncated": Flag("the data file is shorter than its metadata say"),
    "longer_than_declared": Flag("the data file is longer than its metadata say", name="file too long"),
    "drop_out": Flag("brief loss of light; bridged by the predicted motion", name="light dropout"),
    "fringe_doubtful": Flag("after a gap or drop-out the position may be wrong by whole fringes; velocity and force "
        "are unaffected"),
    "harmonics": Flag("the beat is distorted (second or third harmonic above 1 %): detector or amplifier near its "
        "limit"),
    "cross_talk_removed": Flag("cross-talk of PD1 in PD0 (cables, amplifier) was removed",
        name="cross-talk removed", mild=True),
    "cross_talk": Flag("cross-talk of PD1 in PD0 could not be removed: separate their cables; no deflection is given",
        name="cross-talk left"),
    "leak_removed": Flag("unshifted light reached PD1 (polarisation leak); its ripple was removed",
        name="leakage removed", mild=True),
    "rest_drift": Flag("the rest frequency drifted during the shot; followed by a smooth curve",
        name="rest frequency drift", mild=True),
    "rest_unsteady": Flag("the rest frequency was not smooth: subtract PD0 sample by sample (instantaneous)"),
    "wander": Flag("the optical path drifted; the uncertainties of velocity and force include it",
        name="path drift", mild=True),
    "out_of_band": Flag("the beat left the demodulation band: higher frequencies are not reliable"),
    "rate_contradicted": Flag("PD0 or the computer clock contradicts the stated sample rate: all velocities may be "
        "wrong by this ratio"),
    "uneven_time": Flag("the record's times were uneven and were interpolated to an even grid"),
    "setup_corrected": Flag("mass, wavelength, air or rest frequency were corrected after the shot was taken",
        mild=True),
    "interrupted": Flag("the capture was interrupted; the recorded part is analysed"),
    "cut_short": Flag("the capture ended before all requested samples arrived"),
    "data_altered": Flag("the data file is not the one that was recorded: its SHA-512 differs from that in the "
        "metadata"),
    "trigger_lost": Flag("the light switch's sample lies beyond the end of the file"),
    "impulse_disagrees": Flag("quasi-static COR and impulse ratio differ by more than three standard uncertainties",
        name="impulse ratio differs"),
    "bounces_disturbed": Flag("an external force acts in the first flights: the kinetic COR is not given"),
    "read_from_model": Flag("peak, width, contact time and deflection are from the fitted model: the record is too "
        "coarse", mild=True),
    "pulse_disagrees": Flag("peak force and width do not match the impulse from mass and velocities"),
    "no_release": Flag("the record ends within the contact"),
    "no_turn": Flag("the block does not reverse during the presumed contact", name="no reversal"),
    "flight_cut": Flag("an external force acts near the impact (a hand, a second impact): only the part before it is "
        "read"),
    "goes_on": Flag("an external force acts after the flight (a hand): only the first collision is read",
        name="moved afterwards", mild=True),
    "vibration": Flag("the path vibrates: spectral lines were removed, the rest is included in the uncertainties",
        mild=True),
    "knock": Flag("the table was struck during a flight: that part was excluded, or is included in the uncertainties",
        mild=True),
    "restitution_above_one": Flag("restitution above one is not physical", name="restitution above 1"),
    "momentum_disagrees": Flag("the impulse of the force is not m (v_out - v_in)"),
    "fit_disagrees": Flag("the model's velocities contradict those read, beyond their uncertainties"),
    "chi2_far_from_one": Flag("chi2 far from 1; uncertainties unreliable"),
    "plate_shaken": Flag("table vibration moves the plate before touch: not included in the fitted uncertainty",
        name="plate swinging"),
    "plate_rings": Flag("the plate was still oscillating at touch: not included in the fitted uncertainty; wait "
        "longer between shots"),
    "contact_disagrees": Flag("contact time contradicts that of the model, which describes the shot: touch or release "
        "was not found where it was", name="contact differs"),
    "frame_moves_far": Flag("the table moves so far that what it does to the plate is not sure: fitted numbers may be "
        "off by many of their uncertainties", name="table moves far"),
    "knock_suspected": Flag("motion explained by neither model nor floor: a knock or an unmodelled effect",
        name="knock or unmodelled effect"),
    "fit_not_converged": Flag("the model's fit did not converge: its numbers are withheld"),
    "mass_disagrees": Flag("force and motion contradict the stated mass: the fitted one is used"),
    "fit_to_follow": Flag("readings are final; the fit is still running", mild=True),
    "fit_failed": Flag("the model could not be fitted: its numbers are withheld"),
    "noise_not_known": Flag("the free flight is too short to estimate the noise"),
}
# fmt: on
MILD_FLAGS = tuple(flag for flag, row in FLAGS.items() if row.mild)


def flag_words(flag: str) -> str:
    """Return a flag's meaning and remedy in one line."""
    return FLAGS[flag].words if flag in FLAGS else flag.replace("_", " ")


def flag_name(flag: str) -> str:
    """Return a flag's name of two or three words."""
    return (flag in FLAGS and FLAGS[flag].name) or flag.replace("_", " ")


def by_severity(flags: Iterable[str]) -> list[str]:
    """Return the flags, with those that cast doubt on a number first."""
    return sorted(flags, key=lambda flag: flag in MILD_FLAGS)


def flags_in_short(flags: Iterable[str]) -> str:
    """Return the most serious flag and the number of others, like "clipped + 2"; "" for none."""
    ordered = by_severity(flags)
    more = f" + {len(ordered) - 1}" if len(ordered) > 1 else ""
    return flag_name(ordered[0]) + more if ordered else ""
