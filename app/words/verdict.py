"""A verdict as short as a table cell wants it."""

from analysis.diagnosis.result import Diagnosis, Verdict
from app.words.physics_words import EFFECT_WORDS
from app.words.wording import effect_words

_NAMES = {words: name.replace("_", " ").replace("coulomb", "Coulomb") for name, words in EFFECT_WORDS.items()}

OUTDATED = "This verdict is of another model or other shots than now: diagnose again"


def verdict_words(diagnosis: Diagnosis) -> str:
    """Return the effects and laws that were found, else the verdict itself, such as "adequate"."""
    found = [effect_words(one.name) for one in diagnosis.findings]
    if diagnosis.verdict in (Verdict.ADEQUATE, Verdict.UNEXPLAINED) or not found:
        return str(diagnosis.verdict).replace("_", " ")
    return " + ".join(found)


def verdict_in_short(words: str) -> str:
    """Return a verdict's words as a narrow cell wants them: the first effect by its name, and how many besides."""
    first, *others = words.split(" + ")
    return _NAMES.get(first, first) + (f" + {len(others)}" if others else "")
