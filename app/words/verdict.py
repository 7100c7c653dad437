"""Every verdict in words: in a cell, in full, as a heading; and the tone in which it is shown.

A verdict is data: what was concluded, and the names of what was found.  Words are made of it here, and nothing is
read back from them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analysis.diagnosis.result import Verdict
from app.words.physics_words import effect_words, short_effect_words

OUTDATED = "This verdict is of another model or other shots than now: diagnose again"


@dataclass(frozen=True, slots=True)
class VerdictWords:
    """How a conclusion is said: in two words, in a report; its tone; ``names``: what was found is said in its place."""

    brief: str
    full: str
    tone: str  # of app.window.theme.Tone
    names: bool = True


VERDICTS: Mapping[Verdict, VerdictWords] = {
    Verdict.ADEQUATE: VerdictWords(
        "adequate", "adequate: no missing effect within the detection limits", "good", False
    ),
    Verdict.EFFECT_FOUND: VerdictWords("effect found", "effect found", "warning"),
    Verdict.LAW_LEARNED: VerdictWords("law learned", "law learned: a force that is not in the catalogue", "warning"),
    Verdict.PARTLY_EXPLAINED: VerdictWords(
        "partly explained", "partly explained: predictions improve, a significant residual remains", "warning"
    ),
    Verdict.UNEXPLAINED: VerdictWords("unexplained", "unexplained: a significant residual remains", "bad", names=False),
}


def verdict_words(conclusion: Verdict, found: Sequence[str], *, short: bool = False) -> str:
    """Return the effects and laws that were found, by their names, else the conclusion, such as "adequate".

    ``short``: the first by its short name, and how many besides.
    """
    said = VERDICTS[conclusion]
    if not said.names or not found:
        return said.brief
    if not short:
        return " + ".join(map(effect_words, found))
    return short_effect_words(found[0]) + (f" + {len(found) - 1}" if found[1:] else "")
