"""A verdict as short as a table cell wants it."""

from analysis.diagnosis.result import Diagnosis, Verdict
from app.words.physics_words import EFFECT_WORDS
from app.words.wording import effect_words

_NAMES = {words: name.replace("_", " ").replace("coulomb", "Coulomb") for name, words in EFFECT_WORDS.items()}


def verdict_words(diagnosis: Diagnosis) -> str:
    """Return "adequate", "unexplained", or the effects that were found."""
    if diagnosis.verdict in (Verdict.EFFECT_FOUND, Verdict.PARTLY_EXPLAINED):
        return " + ".join(effect_words(effect.name) for effect in diagnosis.effects)
    return str(diagnosis.verdict)


def verdict_in_short(words: str) -> str:
    """Return a verdict's words as a narrow cell wants them: the first effect by its name, and how many besides."""
    first, *others = words.split(" + ")
    return _NAMES.get(first, first) + (f" + {len(others)}" if others else "")
