"""What the program's names of effects and parameters mean, in words; used on the screen and in files (no Qt)."""

import math
from collections.abc import Collection

from analysis.collision.effects import CATALOGUE, WIDER
from analysis.collision.laws.own import from_key
from analysis.drive.catalogue import LAWS
from analysis.shot.quantity import words_and_unit

_OTHER_WORDS = {"gain_error": "an error of the force's scale"}  # of no row of a catalogue
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
    row = CATALOGUE.get(name) or WIDER.get(name) or LAWS.get(name)
    return (row.words if row is not None else _OTHER_WORDS.get(name, "")) or name.replace("_", " ")


def short_effect_words(name: str) -> str:
    """Return an effect's name as a narrow cell wants it: what it is, not where it acts."""
    return effect_words(name) if "{" in name else name.replace("_", " ").replace("coulomb", "Coulomb")


def known_effect(name: str) -> bool:
    """Return whether a catalogue still has an effect of this name."""
    return name in CATALOGUE or name in WIDER or name in LAWS


def model_effect_words(name: str, tried: Collection[str]) -> str:
    """Return an effect in the model in words, "(tried)" behind one that a person put in and no diagnosis named."""
    return f"{effect_words(name)} (tried)" if name in tried else effect_words(name)


def correlation_words(correlation: float) -> str:
    """Return a correlation to two decimals, a dash where it is not known."""
    return f"{correlation:.2f}" if math.isfinite(correlation) else "\u2013"


def parameter_parts(name: str) -> tuple[str, str]:
    """Return ("coefficient", "N s²/m²") for "coefficient_n_s2_per_m2"; a name without a unit has the unit ""."""
    return words_and_unit(name)
