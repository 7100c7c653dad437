"""``levimass --replay PATH... --plan [PARAMETER]``: plan the next shots from those analysed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from analysis.diagnosis import Diagnosis
from analysis.planning import Reach, plan_next, plan_precision, plan_sentence, refit_diagnosed, with_words
from analysis.planning import shots as shots_words
from analysis.shot import AnalysisError, Shot
from app.command_line.outputs import own_fault, say
from levimass import is_drive

NOTHING_OPEN = "the diagnosis leaves nothing open that another shot would have to decide"


@dataclass(frozen=True, slots=True)
class PlannedShots:
    """The next shots in words, and as in the result file (None: nothing is open)."""

    words: str
    result: dict[str, Any] | None


def plan_shots(
    shots: Sequence[Shot], diagnosis: Diagnosis | None, parameter: str, reach: Reach | None = None
) -> PlannedShots | None:
    """Return the shots that decide what a diagnosis left open, or that halve the ± of ``parameter`` ("": none).

    ``reach`` is what the rig can do; None: the planning's defaults.  Returns None, and says so in one line on standard
    error, where there is nothing to plan from.
    """
    motions = [shot.motion for shot in shots if shot.motion is not None and shot.fit is not None]
    if diagnosis is None:
        say("nothing planned: there is no diagnosis to plan from")
        return None
    if is_drive(diagnosis.fit_after.model):
        say("nothing planned: a drive strikes no plate, so there is no collision to plan")
        return None
    try:
        if parameter:
            fitted = refit_diagnosed(diagnosis.fit_after, motions, lambda: False)
            sharper = plan_precision(fitted, parameter, reach=reach)
            words = f"{shots_words(sharper.shots)} would make {sharper.words}."
            return PlannedShots(words, {**sharper.to_json(), "words": words})
        further = plan_next(motions, diagnosis, reach=reach).plan
    except AnalysisError as error:
        say(f"nothing planned: {error}")
        return None
    except Exception as error:  # the shots keep their numbers
        say(f"nothing planned: {own_fault(error)}")
        return None
    if further is None:
        return PlannedShots(NOTHING_OPEN, None)
    return PlannedShots(plan_sentence(further), with_words(further))
