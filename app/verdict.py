"""A verdict as short as a table cell wants it, and the tone it is shown in."""

from collections.abc import Iterable

from analysis.diagnosis.result import Diagnosis, Verdict
from app.theme import Tone
from app.wording import effect_words


def verdict_words(diagnosis: Diagnosis) -> str:
    """Return "adequate", "unexplained", or the effects that were found."""
    if diagnosis.verdict is Verdict.EFFECT_FOUND:
        return " + ".join(effect_words(effect.name) for effect in diagnosis.effects)
    return str(diagnosis.verdict)


def told(words: str, effects: Iterable[str] = ()) -> tuple[str, Tone]:
    """Return what is said of a verdict, and its tone, beside a fit with these effects; nothing said is neutral."""
    if not words:
        return "", Tone.NEUTRAL
    in_model = {effect_words(effect) for effect in effects}
    if in_model and in_model.issuperset(words.split(" + ")):
        return f"{words}: in the model", Tone.GOOD
    tones = {str(Verdict.ADEQUATE): Tone.GOOD, str(Verdict.UNEXPLAINED): Tone.BAD}
    return words, tones.get(words, Tone.WARNING)
