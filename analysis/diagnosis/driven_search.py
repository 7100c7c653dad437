"""Search for the laws of a drive: one or two are added at a time if they improve the prediction of held-out samples."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.drive import (
    LAWS,
    CandidateLaws,
    Regression,
    Table,
    equations,
    fit_accepted,
    folds,
    least_squares,
    regress,
    rms,
    screen_laws,
)
from analysis.shot import AnalysisError, Floats

FOLDS = 6
TRIED_SINGLES, TRIED_PAIRS = 3, 3  # number of screened candidates that are fitted
MAX_ALIKE_FITTED = 2
WORTH_A_FIT = 3.0  # a look-alike is fitted if screening predicts at least the law's reduction over this


@dataclass(frozen=True, slots=True)
class Trial:
    """Laws added to a model: the fit to the earlier half, its change of BIC, and its rms force errors of prediction."""

    added: tuple[str, ...]
    found: Regression
    delta_bic: float
    validation_n: float  # on the later half
    cross_validated_n: float  # for held-out parts of the cycle


@dataclass(frozen=True, slots=True)
class LawSearch:
    """The result of a search: the model, the evidence of each of its laws, and every trial of the first round.

    ``unidentifiable`` are laws that depend linearly on the base model in this motion.
    """

    found: Regression
    evidence: Mapping[str, Mapping[str, float]]
    trials: tuple[Trial, ...]
    unidentifiable: tuple[str, ...]


def search_laws(
    table: Table, accepted: Sequence[str] = (), tell: Callable[[float], None] = lambda _: None
) -> LawSearch:
    """Search for the model that predicts best; ``accepted`` laws always stay in it.  Raises Cancelled."""
    fold = folds(table, FOLDS)
    now = _trial(table, fold, fit_accepted(table, accepted, table.earlier))
    most = CRITERIA.drive_laws + len(accepted)
    first: tuple[tuple[Trial, ...], tuple[str, ...]] | None = None
    while len(now.found.laws) < most:
        screened = screen_laws(table, now.found)
        singles = screened.singles if first is None else screened.singles[:TRIED_SINGLES]
        pairs = screened.pairs[:TRIED_PAIRS] if len(now.found.laws) + 1 < most else ()
        trials = _fit_candidates(table, fold, now.found, [*singles, *pairs])
        first = first or (trials, screened.unidentifiable)
        best = best_trial(table, now, trials)
        if best is None:
            break
        now = best
        tell(len(now.found.laws) / most)
    return LawSearch(*without_useless(table, now.found, accepted), *(first or ((), ())))


def _trial(
    table: Table, fold: NDArray[np.int64], found: Regression, added: tuple[str, ...] = (), delta_bic: float = 0.0
) -> Trial:
    return Trial(added, found, delta_bic, found.rms_of(~table.earlier), cross_validated_n(table, fold, found))


def _fit_candidates(
    table: Table, fold: NDArray[np.int64], found: Regression, candidates: Sequence[CandidateLaws]
) -> tuple[Trial, ...]:
    """Return the fit with each candidate added, best first; those that depend linearly on the model are omitted."""
    fits = []
    for candidate in candidates:
        with contextlib.suppress(AnalysisError):
            fits.append((candidate.laws, candidate.added_to(found, table)))
    if not fits:
        return ()
    count = min((new for _, new in fits), key=lambda new: new.rms_n).independent_samples  # common to all trials
    trials = [_trial(table, fold, new, added, bic_change(found, new, count)) for added, new in fits]
    return tuple(sorted(trials, key=lambda trial: trial.delta_bic))


def bic_change(before: Regression, after: Regression, count: float) -> float:
    """Return the change of the Bayesian information criterion, with ``count`` independent samples."""
    more = after.values.size - before.values.size
    return count * 2.0 * float(np.log(after.rms_n / before.rms_n)) + more * float(np.log(max(count, 2.0)))


def cross_validated_n(table: Table, fold: NDArray[np.int64], found: Regression) -> float:
    """Return the rms force error in N when each part of the cycle is predicted from the others.

    Nonlinear parameters stay fixed.
    """
    columns, target = equations(table, found.laws, found.nonlinear)
    left = np.empty(target.size)
    for one in np.unique(fold):
        out = fold == one
        left[out] = target[out] - columns[out] @ least_squares(columns[~out], target[~out])
    return rms(left)


def same_in_both_halves(table: Table, found: Regression, law: str) -> bool:
    """Return whether fits to the later and to the earlier half give nearly the same force of this law."""
    try:
        other = regress(table, found.laws, ~table.earlier, found.nonlinear)
    except AnalysisError:
        return False
    one, two = (law_force(table, fit, law) for fit in (found, other))
    return rms(one - two) <= CRITERIA.drive_same * rms(one)


def law_force(table: Table, found: Regression, law: str) -> Floats:
    """Return the force of a law in a fit, shape (m,)."""
    row = LAWS[law]
    at = row.values_in(found.nonlinear)
    if row.force is None:
        return table.force() - table.force(*at)
    return np.asarray(table.columns(row, at) @ np.array([found.quantity(name).value for name in row.linear_names]))


def best_trial(table: Table, now: Trial, trials: Sequence[Trial]) -> Trial | None:
    """Return the best trial whose laws improve BIC and predictions and are the same in both halves, or None."""
    singles = [trial for trial in trials if len(trial.added) == 1]
    alone = min(singles, key=lambda t: t.delta_bic, default=None)
    fall, less = CRITERIA.fall(max(2, len(trials))), 1.0 - CRITERIA.drive_gain
    for trial in trials:
        share = less ** len(trial.added)
        predicts = trial.validation_n <= share * now.validation_n
        predicts &= trial.cross_validated_n <= share * now.cross_validated_n
        if trial.delta_bic > -fall or not predicts:
            continue
        if len(trial.added) == 2 and alone is not None:
            by_itself = min((t for t in singles if t.added[0] in trial.added), key=lambda t: t.delta_bic, default=alone)
            if trial.delta_bic > by_itself.delta_bic - CRITERIA.least_lead:
                continue
            if trial.validation_n > less * by_itself.validation_n:
                continue
        if all(same_in_both_halves(table, trial.found, law) for law in trial.added):
            return trial
    return None


def without_useless(
    table: Table, found: Regression, accepted: Sequence[str]
) -> tuple[Regression, dict[str, dict[str, float]]]:
    """Return the model without laws made redundant by later ones, and the evidence of the remaining laws."""
    evidence = {}
    for law in [name for name in found.laws if name not in accepted]:
        fewer = _without(table, found, law)
        delta_bic = -bic_change(found, fewer, found.independent_samples)
        without_it_n = fewer.rms_of(~table.earlier)
        predicts = without_it_n > found.rms_of(~table.earlier) / (1.0 - CRITERIA.drive_gain)
        if delta_bic > -CRITERIA.least_lead or not predicts:
            return without_useless(table, fewer, accepted)
        evidence[law] = {"delta_bic": delta_bic, "held_out_force_rms_without_it_n": without_it_n}
    return found, evidence


def _without(table: Table, found: Regression, law: str) -> Regression:
    return regress(table, tuple(name for name in found.laws if name != law), found.mask, found.nonlinear)


def look_alikes(table: Table, found: Regression, law: str) -> tuple[str, ...]:
    """Return the laws that fit nearly as well as ``law`` in its place, by BIC; best first."""
    try:
        fewer = _without(table, found, law)
    except AnalysisError:
        return ()
    taken = float(fewer.residual_n @ fewer.residual_n) - float(found.residual_n @ found.residual_n)
    alike = []
    others = [name for name in LAWS if name not in (law, "position_ripple")]  # no other law resembles a ripple
    for candidate in screen_laws(table, fewer, pairs=False, laws=others).singles[:MAX_ALIKE_FITTED]:
        if candidate.gain_n2 * WORTH_A_FIT < taken:
            break
        with contextlib.suppress(AnalysisError):
            other = candidate.added_to(fewer, table)
            if bic_change(found, other, found.independent_samples) < CRITERIA.least_lead:
                alike.append(candidate.laws[0])
    return tuple(alike)
