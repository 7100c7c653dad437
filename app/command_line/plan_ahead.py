"""``--replay PATH... --plan [PARAMETER]``: which shots to take next, from those at hand."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from analysis.diagnosis.result import Diagnosis
from analysis.planning.model_comparison import refit_diagnosed
from analysis.planning.next_shot import Reach
from analysis.planning.plan_words import plan_sentence, with_words
from analysis.planning.plan_words import shots as shots_words
from analysis.planning.precision import plan_precision
from analysis.planning.shot_log import plan_next
from analysis.shot.shot import AnalysisError, Shot

NOTHING_OPEN = "the diagnosis leaves nothing open that another shot would have to decide"


@dataclass(frozen=True, slots=True)
class Ahead:
    """What to take next, in words and as the result file has it (None: nothing is open)."""

    words: str
    result: dict[str, Any] | None


def plan_ahead(
    shots: Sequence[Shot], diagnosis: Diagnosis | None, parameter: str, reach: Reach | None = None
) -> Ahead | None:
    """Return the shots that decide what a diagnosis left open, or that make ``parameter`` ("": none) twice as sure.

    ``reach`` is what the rig can do; None: what the planning takes for usual.
    None, and one line on standard error, where there is nothing to plan from.
    """
    motions = [shot.motion for shot in shots if shot.motion is not None and shot.fit is not None]
    if diagnosis is None:
        print("levimass: nothing planned: there is no diagnosis to plan from", file=sys.stderr)
        return None
    if diagnosis.fit_after.model == "driven":
        print("levimass: nothing planned: a drive strikes no plate, so no shot of it can be set", file=sys.stderr)
        return None
    try:
        if parameter:
            fitted = refit_diagnosed(diagnosis.fit_after, motions, lambda: False)
            sharper = plan_precision(fitted, parameter, reach=reach)
            words = f"{shots_words(sharper.shots)} would make {sharper.words}."
            return Ahead(words, {**sharper.to_json(), "words": words})
        further = plan_next(motions, diagnosis, reach=reach).plan
    except AnalysisError as error:
        print(f"levimass: nothing planned: {error}", file=sys.stderr)
        return None
    except Exception as error:  # a fault of the program's own must not cost the shots their numbers
        cause = " ".join(str(error).split())
        print(f"levimass: nothing planned: a fault of the program: {type(error).__name__}: {cause}", file=sys.stderr)
        return None
    if further is None:
        return Ahead(NOTHING_OPEN, None)
    return Ahead(plan_sentence(further), with_words(further))
