"""What the program's names of effects and parameters mean, in words; used on the screen and in files (no Qt)."""

from collections.abc import Collection

from analysis.laws.own import from_key
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
    "frame_vibration_with_plate": "a vibration of the frame and the plate on it",
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
