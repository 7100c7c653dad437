"""Texts for models, effects, verdicts, units and counts in the window, reports and files (no Qt)."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analysis.collision import Effect
from analysis.diagnosis import Verdict
from levimass import base_model

if TYPE_CHECKING:
    from analysis.drive import Repeatability

DASH = "–"
PREFIXES = ((1e-12, "p"), (1e-9, "n"), (1e-6, "µ"), (1e-3, "m"), (1.0, ""), (1e3, "k"), (1e6, "M"))


def base_words(base: str) -> str:
    """Return the name of a base model in words."""
    return base_model(base).words


def model_in_words(base: str, effects: Collection[Effect], tried: Collection[Effect] = ()) -> str:
    """Return "paper model + quadratic drag on the block (tried)"; no diagnosis found the ``tried`` effects."""
    words = base_words(base)
    if not effects:
        return f"{words}, no added effects"
    return " + ".join((words, *(effect.words + (" (tried)" if effect in tried else "") for effect in effects)))


def repeatability_words(of: "Repeatability") -> str:
    """Return the name of the reference for a drive's residual."""
    if not of.repeats:
        return "the noise of the force in this band"
    return "the record-to-record repeatability" if of.cycle_s is None else "the cycle-to-cycle repeatability"


def or_dash(value: float, form: str) -> str:
    """Return a number in a format such as ".2f", or a dash if it is not finite."""
    return f"{value:{form}}" if math.isfinite(value) else DASH


def prefix_for(size: float, unit: str) -> tuple[float, str]:
    """Return (factor, prefixed unit) that brings ``size`` in ``unit`` between 1 and 1000: (1e9, "nm") for 3e-8 m."""
    if not math.isfinite(size) or size == 0.0:
        return 1.0, unit
    least = [(scale, prefix) for scale, prefix in PREFIXES if abs(size) >= 0.9995 * scale]
    scale, prefix = least[-1] if least else PREFIXES[0]
    return 1.0 / scale, f"{prefix}{unit}"


OUTDATED = "The model or the shots have changed since this verdict: run Diagnose again"


@dataclass(frozen=True, slots=True)
class VerdictWords:
    """Texts of a verdict, brief and full, and its tone; ``names``: the brief text is replaced by the effects found."""

    brief: str
    full: str
    tone: str  # value of app.window.controls.theme.Tone
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
    """Return the names of the effects and laws found, else the verdict, such as "adequate".

    ``short``: only the short name of the first, and the number of others.
    """
    said = VERDICTS[conclusion]
    if not said.names or not found:
        return said.brief
    if not short:
        return " + ".join(effect.words for effect in found)
    first = found[0].short_words.replace("coulomb", "Coulomb")
    return first + (f" + {len(found) - 1}" if found[1:] else "")


def counted(count: int, what: str) -> str:
    """Return a count with its noun, like "1 shot" or "2 shots"."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def listed(names: Sequence[str], most: int) -> str:
    """Return the first ``most`` names and the number of others, like "a, b and 3 more"."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")
