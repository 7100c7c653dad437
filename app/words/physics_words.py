"""What the program's names of effects, parameters and flags mean, in words; used on the screen and in files (no Qt)."""

from analysis.laws.own import from_key
from analysis.signal.quality import MEANINGS
from analysis.units import parts

EFFECT_WORDS = {
    "coulomb_friction": "Coulomb friction on the block",
    "viscous_drag": "viscous drag on the block",
    "quadratic_drag": "quadratic drag on the block",
    "tilt": "a tilt of the guideway",
    "bearing_gradient": "a gradient of the bearing",
    "block_mode": "a mode inside the block",
    "cubic_stiffness": "a cubic stiffness of the plate",
    "plate_damping": "a damping of the plate",
    "viscoelastic_arm": "a viscoelastic arm",
    "second_plate_mode": "a second mode of the plate",
    "support_compliance": "a support that gives",
    "plate_motion": "a plate already swinging at first touch",
    "contact_exponent": "a contact that stiffens with overlap",
    "nonlinear_contact_damping": "a contact damping that grows with overlap",
    "adhesion": "adhesion at release",
    "sensor_drift": "a drift of the measured velocity",
    "demodulation_lag": "a lag of the optics' clock",
    "frame_vibration": "a vibration of the frame",
    "cyclic_error": "a cyclic error of the interferometer",
    "directional_viscous_drag": "a viscous drag that differs between both ways",
    "stribeck_friction": "a friction that changes towards rest",
    "presliding_friction": "a friction that builds up over a distance",
    "lugre_friction": "friction of bristles (LuGre)",
    "position_ripple": "a ripple along the travel",
    "place_dependent_friction": "a friction that differs from place to place",
    "load_dependent_friction": "a friction that grows with the load",
    "quadratic_stiffness": "a spring that is stiffer on one side",
    "drive_delay": "a delay between force and motion",
    "gain_error": "an error of the force's scale",
}

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
    "vibration": "the path shakes: its lines were taken off, the rest stands in the uncertainties",
    "knock": "something struck the table in a flight: that stretch was left out, or stands in the uncertainties",
    "restitution_above_one": "a restitution above one: the plate cannot give back more than it took",
    "momentum_disagrees": "the impulse of the force is not m (v_out - v_in)",
    "fit_disagrees": "the model's velocities contradict those read, beyond their uncertainties",
    "chi2_far_from_one": "the model leaves far more, or far less, than the noise: its uncertainties do not hold",
    "plate_shaken": "the table shakes the plate before it is touched: the ± of the fitted parameters do not hold that",
    "fit_not_converged": "the model's fit did not converge: its numbers are withheld",
    "mass_disagrees": "force and motion contradict the stated mass: the fitted one is used",
    "fit_failed": "the model could not be fitted: its numbers are withheld",
    "noise_not_known": "too little quiet flight to learn the noise from",
}


def effect_words(name: str) -> str:
    """Return an effect's name as a person says it."""
    if "{" in name:
        return from_key(name).words
    return EFFECT_WORDS.get(name, name.replace("_", " "))


def flag_words(flag: str) -> str:
    """Return what a flag means and what to do, in one line."""
    return MEANINGS.get(flag) or FLAG_WORDS.get(flag, flag.replace("_", " "))


def parameter_parts(name: str) -> tuple[str, str]:
    """Return ("coefficient", "N s²/m²") for "coefficient_n_s2_per_m2"; a name without a unit has the unit ""."""
    return parts(name)
