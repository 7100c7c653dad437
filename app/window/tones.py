"""The tone of flags and of verdicts, and the line in which they are shown."""

from collections.abc import Iterable
from html import escape

from analysis.collision import Effect
from app.session import Entry
from app.window.theme import MARKS, Tone
from app.words import MILD_FLAGS, VERDICTS, flag_words


def flag_tone(flag: str) -> Tone:
    """Return the tone of a flag; one that only widens an uncertainty is no warning."""
    return Tone.NEUTRAL if flag in MILD_FLAGS else Tone.WARNING


def flag_line(flag: str) -> str:
    """Return a flag's mark and meaning."""
    return f"{MARKS[flag_tone(flag)]} {flag_words(flag)}"


def verdict_line(entry: Entry | None, effects: Iterable[Effect] = (), holds: bool = True) -> tuple[str, Tone]:
    """Return an entry's verdict in words, and its tone, for a fit with these effects; "" without a verdict.

    ``holds``: whether the verdict is about the present model and shots.
    """
    if entry is None or not entry.verdict:
        return "", Tone.NEUTRAL
    if not holds:
        return f"<s>{escape(entry.verdict)}</s> outdated: diagnose again", Tone.NEUTRAL
    of = entry.verdict_of
    if of is None or of.conclusion is None:  # from a file of an earlier version
        return entry.verdict, Tone.WARNING
    words = VERDICTS[of.conclusion]
    if words.names and of.found and set(of.found) <= set(effects):
        return f"{entry.verdict}: in the model", Tone.GOOD
    return entry.verdict, Tone(words.tone)
