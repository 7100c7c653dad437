"""The tone a verdict is shown in, and what is said of it beside a fit."""

from collections.abc import Iterable
from html import escape

from analysis.diagnosis.result import Verdict
from app.window.theme import Tone
from app.words.wording import effect_words


def told(words: str, effects: Iterable[str] = (), holds: bool = True) -> tuple[str, Tone]:
    """Return what is said of a verdict, and its tone, beside a fit with these effects; nothing said is neutral.

    ``holds``: whether it is of the model and the shots as they are now.
    """
    if not words:
        return "", Tone.NEUTRAL
    if not holds:
        return f"<s>{escape(words)}</s> outdated: diagnose again", Tone.NEUTRAL
    in_model = {effect_words(effect) for effect in effects}
    if in_model and in_model.issuperset(words.split(" + ")):
        return f"{words}: in the model", Tone.GOOD
    tones = {str(Verdict.ADEQUATE): Tone.GOOD, str(Verdict.UNEXPLAINED): Tone.BAD}
    return words, tones.get(words, Tone.WARNING)
