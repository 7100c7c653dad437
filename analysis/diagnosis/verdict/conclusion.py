"""Conclude the verdict of a diagnosis, for collisions and drives."""

from collections.abc import Collection

from analysis.diagnosis.result import FoundEffect, LearnedLaw, Verdict
from analysis.diagnosis.verdict.residual import Residual


def leaves_something(residual: Residual, *, nothing_pays: bool) -> bool:
    """Return whether a residual must be explained: it exceeds noise, and is no faint trace that no effect explains.

    ``nothing_pays``: the fit has no effect, and none that was tried explains enough to join.
    """
    return residual.significant and not (nothing_pays and residual.faint)


def conclude(
    *,
    explained: bool,
    effects: Collection[FoundEffect],
    laws: Collection[LearnedLaw] = (),
    predicts_better: bool = False,
) -> Verdict:
    """Return the verdict on a model with these ``effects`` and ``laws``, all of which passed their gates.

    ``explained``: the residual of the model with them is consistent with noise (of a drive: with its repeatability).
    ``predicts_better``: effects that did not pass every gate predict the validation shots better than the model alone.
    """
    if explained:
        if laws:
            return Verdict.LAW_LEARNED
        return Verdict.EFFECT_FOUND if effects else Verdict.ADEQUATE
    return Verdict.PARTLY_EXPLAINED if effects or laws or predicts_better else Verdict.UNEXPLAINED
