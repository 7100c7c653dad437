"""A verdict as short as a table cell wants it, and the tone it is shown in."""

from analysis.diagnosis.result import Diagnosis, Verdict
from app.theme import Tone
from app.wording import effect_words


def verdict_words(diagnosis: Diagnosis) -> str:
    """Return "adequate", "unexplained", or the effects that were found."""
    if diagnosis.verdict is Verdict.EFFECT_FOUND:
        return " + ".join(effect_words(effect.name) for effect in diagnosis.effects)
    return str(diagnosis.verdict)


def tone_of(words: str) -> Tone:
    """Return the tone of a verdict's words; nothing said is neutral."""
    if not words:
        return Tone.NEUTRAL
    tones = {str(Verdict.ADEQUATE): Tone.GOOD, str(Verdict.UNEXPLAINED): Tone.BAD}
    return tones.get(words, Tone.WARNING)
