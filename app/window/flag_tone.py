"""The tone a flag is shown in: what only widens an uncertainty is no alarm."""

from app.window.theme import MARKS, Tone
from app.words.flag_words import MILD_FLAGS, flag_words


def flag_tone(flag: str) -> Tone:
    """Return the tone of a flag."""
    return Tone.NEUTRAL if flag in MILD_FLAGS else Tone.WARNING


def flag_line(flag: str) -> str:
    """Return a flag's mark and meaning."""
    return f"{MARKS[flag_tone(flag)]} {flag_words(flag)}"
