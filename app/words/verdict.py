"""A verdict as short as a table cell wants it."""

from analysis.diagnosis.result import Diagnosis, Verdict
from app.words.wording import effect_words


def verdict_words(diagnosis: Diagnosis) -> str:
    """Return "adequate", "unexplained", or the effects that were found."""
    if diagnosis.verdict in (Verdict.EFFECT_FOUND, Verdict.PARTLY_EXPLAINED):
        return " + ".join(effect_words(effect.name) for effect in diagnosis.effects)
    return str(diagnosis.verdict)
