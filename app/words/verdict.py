"""Words and tones of verdicts.

A verdict is data: the conclusion and the effects found.  Its words are made here, and never parsed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analysis.collision import Effect
from analysis.diagnosis import Verdict
from app.words.physics_words import short_effect_words

OUTDATED = "This verdict is about another model or other shots: diagnose again"


@dataclass(frozen=True, slots=True)
class VerdictWords:
    """The words of a conclusion, brief and in full, and its tone; ``names``: the effects found replace it."""

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


def verdict_words(conclusion: Verdict, found: Sequence[Effect], *, short: bool = False) -> str:
    """Return the effects and laws that were found, by their names, else the conclusion, such as "adequate".

    ``short``: the short name of the first, and the number of others.
    """
    said = VERDICTS[conclusion]
    if not said.names or not found:
        return said.brief
    if not short:
        return " + ".join(effect.words for effect in found)
    return short_effect_words(found[0]) + (f" + {len(found) - 1}" if found[1:] else "")
