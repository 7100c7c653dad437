"""What the program's names of effects and parameters mean, in words; used on the screen and in files (no Qt)."""

from collections.abc import Collection

from analysis.collision.laws.own import from_key
from analysis.shot.units import parts

EFFECT_WORDS = {
    "coulomb_friction": "Coulomb friction on the block",
    "viscous_drag": "viscous drag on the block",
    "quadratic_drag": "quadratic drag on the block",
    "tilt": "a tilt of the guideway",
    "bearing_gradient": "a gradient of the bearing",
    "block_mode": "an internal mode of the block",
    "cubic_stiffness": "a cubic stiffness of the plate",
    "plate_damping": "damping of the plate",
    "viscoelastic_arm": "a viscoelastic arm",
    "second_plate_mode": "a second mode of the plate",
    "support_compliance": "a compliant support",
    "plate_motion": "a plate already swinging at first touch",
    "contact_exponent": "a contact that stiffens with overlap",
    "nonlinear_contact_damping": "a contact damping that grows with overlap",
    "adhesion": "adhesion at release",
    "sensor_drift": "a drift of the measured velocity",
    "demodulation_lag": "a lag of the demodulation",
    "frame_vibration": "a vibration of the frame",
    "frame_vibration_with_plate": "a vibration of the frame and the plate on it",
    "cyclic_error": "a cyclic error of the interferometer",
    "directional_viscous_drag": "direction-dependent viscous drag",
    "stribeck_friction": "Stribeck friction",
    "presliding_friction": "presliding friction",
    "lugre_friction": "LuGre friction",
    "position_ripple": "a ripple along the travel",
    "place_dependent_friction": "position-dependent friction",
    "load_dependent_friction": "load-dependent friction",
    "quadratic_stiffness": "an asymmetric spring",
    "drive_delay": "a delay between force and motion",
    "gain_error": "an error of the force's scale",
}


BASE_WORDS = {
    "paper": "paper model",
    "clamped": "clamped plate",
    "no_tension": "paper model without tension",
    "contact": "one body on a contact",
    "driven": "driven slider",
}


def model_in_words(base: str, effects: Collection[str], tried: Collection[str] = ()) -> str:
    """Return "paper model, no added effects" or "paper model + quadratic drag on the block"."""
    words = BASE_WORDS.get(base, base)
    if not effects:
        return f"{words}, no added effects"
    return " + ".join((words, *(model_effect_words(name, tried) for name in effects)))


def repeatability_words(repeats: bool, what: str) -> str:
    """Return what a drive's residual is held against, ``what`` being the analysis's own words for it."""
    if not repeats:
        return what
    return "the record-to-record repeatability" if "record" in what else "the cycle-to-cycle repeatability"


def effect_words(name: str) -> str:
    """Return an effect's name as a person says it."""
    if "{" in name:
        return from_key(name).words
    return EFFECT_WORDS.get(name, name.replace("_", " "))


def model_effect_words(name: str, tried: Collection[str]) -> str:
    """Return an effect in the model in words, "(tried)" behind one that a person put in and no diagnosis named."""
    return f"{effect_words(name)} (tried)" if name in tried else effect_words(name)


def parameter_parts(name: str) -> tuple[str, str]:
    """Return ("coefficient", "N s²/m²") for "coefficient_n_s2_per_m2"; a name without a unit has the unit ""."""
    return parts(name)
