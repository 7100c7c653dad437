"""What is said of a verdict beside a fit, and its tone."""

from collections.abc import Iterable
from html import escape

from app.session.session import Entry
from app.window.theme import Tone
from app.words.verdict import VERDICTS


def told(entry: Entry | None, effects: Iterable[str] = (), holds: bool = True) -> tuple[str, Tone]:
    """Return what is said of an entry's verdict, and its tone, beside a fit with these effects; "" is neutral.

    ``holds``: whether it is of the model and the shots as they are now.
    """
    if entry is None or not entry.verdict:
        return "", Tone.NEUTRAL
    if not holds:
        return f"<s>{escape(entry.verdict)}</s> outdated: diagnose again", Tone.NEUTRAL
    of = entry.verdict_of
    if of is None or of.conclusion is None:  # kept by an earlier version, without what it was made of
        return entry.verdict, Tone.WARNING
    said = VERDICTS[of.conclusion]
    if said.names and of.found and set(of.found) <= set(effects):
        return f"{entry.verdict}: in the model", Tone.GOOD
    return entry.verdict, Tone(said.tone)
