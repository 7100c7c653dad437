"""What a shot's flags are called and mean, and which of them are no cause for alarm (no Qt)."""

from collections.abc import Iterable

from analysis.signal.quality import MEANINGS

FLAG_WORDS = {
    "setup_corrected": "mass, wavelength, air or rest frequency were corrected after the shot was taken",
    "interrupted": "the capture was cut off before it was closed; analysed as far as it got",
    "cut_short": "the capture ended before all samples asked for came",
    "data_altered": "the data file is not the one that was recorded: its SHA-512 differs from that in the metadata",
    "trigger_lost": "the light switch's sample lies beyond the end of the file",
    "impulse_disagrees": "quasi-static COR and impulse ratio differ by more than three standard uncertainties",
    "bounces_disturbed": "something else moves the block in its first flights: the kinetic COR is not given",
    "read_from_model": "peak, width, contact time and deflection are the fitted model's: derivatives carry too little",
    "pulse_disagrees": "peak and width of the force as read do not make the impulse that mass and velocities do",
    "no_release": "the record ends within the contact",
    "no_turn": "the block does not turn round in what was taken for the contact",
    "flight_cut": "something else moves the block near the impact (a hand, a second blow): read up to it only",
    "goes_on": "something moves the block after the flight (a hand): the first collision is read",
    "vibration": "the path vibrates: its spectral lines were removed, the rest is contained in the uncertainties",
    "knock": "something struck the table in a flight: that stretch was left out, or is contained in the uncertainties",
    "restitution_above_one": "a restitution above one: the plate cannot give back more than it took",
    "momentum_disagrees": "the impulse of the force is not m (v_out - v_in)",
    "fit_disagrees": "the model's velocities contradict those read, beyond their uncertainties",
    "chi2_far_from_one": "the model leaves far more, or far less, than the noise: its uncertainties do not hold",
    "plate_shaken": "the table shakes the plate before it is touched: the fitted ± do not contain that",
    "knock_suspected": "the shot moves as neither model nor site would: a knock, or what the model lacks",
    "fit_not_converged": "the model's fit did not converge: its numbers are withheld",
    "mass_disagrees": "force and motion contradict the stated mass: the fitted one is used",
    "fit_to_follow": "the readings stand; the model is still being fitted, and its numbers come by themselves",
    "fit_failed": "the model could not be fitted: its numbers are withheld",
    "noise_not_known": "too little quiet flight to learn the noise from",
}

# Seen and dealt with: what each of them does stands in the numbers and their uncertainties already.
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
    "knock_suspected": "knock or lacking law",
    "impulse_disagrees": "impulse ratio differs",
    "longer_than_declared": "file too long",
    "restitution_above_one": "restitution above 1",
}


def flag_words(flag: str) -> str:
    """Return what a flag means and what to do, in one line."""
    return MEANINGS.get(flag) or FLAG_WORDS.get(flag, flag.replace("_", " "))


def flag_name(flag: str) -> str:
    """Return a flag in two or three words."""
    return _NAMES.get(flag, flag.replace("_", " "))


def by_weight(flags: Iterable[str]) -> list[str]:
    """Return flags, those that cast doubt on a number before the mild ones, each as they came."""
    return sorted(flags, key=lambda flag: flag in MILD_FLAGS)


def flags_in_short(flags: Iterable[str]) -> str:
    """Return the weightiest flag and how many there are besides: "clipped + 2"; "" for none."""
    ordered = by_weight(flags)
    more = f" + {len(ordered) - 1}" if len(ordered) > 1 else ""
    return flag_name(ordered[0]) + more if ordered else ""
