"""Search for the laws of a drive: one or two are added at a time if they improve the prediction of held-out samples."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.drive.catalogue import LAWS, laws_named
from analysis.drive.law_screening import CandidateLaws, screen_laws
from analysis.drive.regression import NonlinearValues, Regression, delay_of, design, least_squares, regress, rms
from analysis.drive.repeatability import folds
from analysis.drive.stretch import Mask, Table
from analysis.shot import AnalysisError, Floats

BIC_AGAINST_BASE, BIC_AGAINST_NEXT = 10.0, 6.0  # docs/how-a-diagnosis-decides.md
PAYS = 0.02  # share by which each added law must reduce the force error of prediction
SAME_LAW = 0.35  # relative difference of a law's force allowed between the halves of the records
MAX_LAWS = 5
FOLDS = 6
TRIED_SINGLES, TRIED_PAIRS = 3, 3  # number of screened candidates that are fitted
MAX_ALIKE_FITTED = 2
WORTH_A_FIT = 3.0  # a look-alike is fitted if screening predicts at least the law's reduction over this


@dataclass(frozen=True, slots=True)
class Split:
    """A table split into fitted samples ``kept``, held-out samples ``held``, and folds for cross-validation."""

    table: Table
    kept: Mask
    held: Mask
    fold: NDArray[np.int64]

    @classmethod
    def of(cls, table: Table) -> "Split":
        """Split a table: the earlier half of each record is fitted, the later half is predicted."""
        kept = np.zeros(table.time_s.size, dtype=np.bool_)
        for record in np.unique(table.record):
            of = table.record == record
            middle = 0.5 * (float(table.time_s[of].min()) + float(table.time_s[of].max()))
            kept |= of & (table.time_s < middle)
        return cls(table, kept, ~kept, folds(table, FOLDS))


@dataclass(frozen=True, slots=True)
class Trial:
    """Laws added to a model: the fit to the earlier half, its change of BIC, and its rms force errors of prediction."""

    added: tuple[str, ...]
    found: Regression
    delta_bic: float
    validation_n: float  # on the later half
    cross_validated_n: float  # for held-out parts of the cycle


@dataclass(frozen=True, slots=True)
class Merit:
    """A law's contribution to its model: the change of BIC, and the error of prediction without the law."""

    delta_bic: float
    without_it_n: float


@dataclass(frozen=True, slots=True)
class LawSearch:
    """The result of a search: the model, the merit of each of its laws, and every trial of the first round.

    ``unidentifiable`` are laws that depend linearly on the base model in this motion.
    """

    found: Regression
    merits: Mapping[str, Merit]
    trials: tuple[Trial, ...]
    unidentifiable: tuple[str, ...]


def search_laws(
    split: Split, accepted: Sequence[str] = (), tell: Callable[[float], None] = lambda _: None
) -> LawSearch:
    """Search for the model that predicts best; ``accepted`` laws always stay in it.  Raises Cancelled."""
    found = fit_accepted(split.table, accepted, split.kept)
    most = MAX_LAWS + len(accepted)
    first: tuple[tuple[Trial, ...], tuple[str, ...]] | None = None
    while len(found.laws) < most:
        screened = screen_laws(split.table, found)
        singles = screened.singles if first is None else screened.singles[:TRIED_SINGLES]
        pairs = screened.pairs[:TRIED_PAIRS] if len(found.laws) + 1 < most else ()
        trials = fit_candidates(split, found, [*singles, *pairs])
        first = first or (trials, screened.unidentifiable)
        best = _best(split, found, trials)
        if best is None:
            break
        found = best.found
        tell(len(found.laws) / most)
    found, merits = _without_useless(split, found, accepted)
    return LawSearch(found, merits, *(first or ((), ())))


def fit_accepted(table: Table, laws: Sequence[str], mask: Mask | None = None) -> Regression:
    """Return the fit of base and ``laws``, which are added in order of their screening.  Raises AnalysisError."""
    laws_named(laws)  # raises for an unknown law
    found = regress(table, (), mask)
    while missing := [law for law in laws if law not in found.laws]:
        screened = screen_laws(table, found, pairs=len(missing) > 1, laws=missing)
        candidates = [g for g in (*screened.pairs, *screened.singles) if set(g.laws) <= set(missing)]
        if not candidates:
            named = missing[0].replace("_", " ")
            raise AnalysisError(f"{named}: cannot be distinguished from the rest of the model in this motion")
        candidate = max(candidates, key=lambda g: g.gain_n2)
        found = regress(table, (*found.laws, *candidate.laws), mask, {**found.nonlinear, **candidate.nonlinear})
    return found


def fit_candidates(split: Split, found: Regression, candidates: Sequence[CandidateLaws]) -> tuple[Trial, ...]:
    """Return the fit with each candidate added, best first; those that depend linearly on the model are omitted."""
    fits = []
    for candidate in candidates:
        with contextlib.suppress(AnalysisError):
            laws = (*found.laws, *candidate.laws)
            fits.append((candidate, regress(split.table, laws, split.kept, {**found.nonlinear, **candidate.nonlinear})))
    if not fits:
        return ()
    count = min((new for _, new in fits), key=lambda new: new.rms_n).independent_samples  # common to all trials
    trials = [
        Trial(
            added=candidate.laws,
            found=new,
            delta_bic=bic_change(found, new, count),
            validation_n=new.rms_of(split.held),
            cross_validated_n=cross_validated_n(split, new.laws, new.nonlinear),
        )
        for candidate, new in fits
    ]
    return tuple(sorted(trials, key=lambda trial: trial.delta_bic))


def bic_change(before: Regression, after: Regression, count: float) -> float:
    """Return the change of the Bayesian information criterion, with ``count`` independent samples."""
    more = after.values.size - before.values.size
    return count * 2.0 * float(np.log(after.rms_n / before.rms_n)) + more * float(np.log(max(count, 2.0)))


def cross_validated_n(split: Split, laws: Sequence[str], nonlinear: NonlinearValues) -> float:
    """Return the rms force error in N when each part of the cycle is predicted from the others.

    Nonlinear parameters stay fixed.
    """
    columns = design(split.table, laws, nonlinear)
    target = split.table.force(delay_of(nonlinear))
    left = np.empty(target.size)
    for fold in np.unique(split.fold):
        out = split.fold == fold
        left[out] = target[out] - columns[out] @ least_squares(columns[~out], target[~out])
    return rms(left)


def same_in_both_halves(split: Split, found: Regression, law: str) -> bool:
    """Return whether fits to the later and to the earlier half give nearly the same force of this law."""
    try:
        other = regress(split.table, found.laws, split.held, found.nonlinear)
    except AnalysisError:
        return False
    one, two = (law_force(split.table, fit, law) for fit in (found, other))
    return rms(one - two) <= SAME_LAW * rms(one)


def law_force(table: Table, found: Regression, law: str) -> Floats:
    """Return the force of a law in a fit, shape (m,)."""
    row = LAWS[law]
    if row.force is None:
        (time_s,) = found.nonlinear[law]
        return table.force() - table.force(time_s)
    values = np.array([found.quantity(f"{law}.{name}").value for name in row.linear])
    return np.asarray(table.columns(row, found.nonlinear.get(law, ())) @ values)


def _best(split: Split, found: Regression, trials: Sequence[Trial]) -> Trial | None:
    """Return the best trial whose laws improve BIC and predictions and are the same in both halves, or None."""
    held, across = found.rms_of(split.held), cross_validated_n(split, found.laws, found.nonlinear)
    singles = [trial for trial in trials if len(trial.added) == 1]
    alone = min(singles, key=lambda t: t.delta_bic, default=None)
    price = BIC_AGAINST_BASE + 2.0 * float(np.log(max(2, len(trials))))
    for trial in trials:
        share = (1.0 - PAYS) ** len(trial.added)
        if trial.delta_bic > -price or trial.validation_n > share * held or trial.cross_validated_n > share * across:
            continue
        if len(trial.added) == 2 and alone is not None:
            by_itself = min((t for t in singles if t.added[0] in trial.added), key=lambda t: t.delta_bic, default=alone)
            if trial.delta_bic > by_itself.delta_bic - BIC_AGAINST_NEXT:
                continue
            if trial.validation_n > (1.0 - PAYS) * by_itself.validation_n:
                continue
        if all(same_in_both_halves(split, trial.found, law) for law in trial.added):
            return trial
    return None


def _without_useless(split: Split, found: Regression, accepted: Sequence[str]) -> tuple[Regression, dict[str, Merit]]:
    """Return the model without laws made redundant by later ones, and the merits of the remaining laws."""
    merits = {}
    for law in [name for name in found.laws if name not in accepted]:
        rest = tuple(name for name in found.laws if name != law)
        fewer = regress(split.table, rest, split.kept, found.nonlinear)
        merits[law] = Merit(-bic_change(found, fewer, found.independent_samples), fewer.rms_of(split.held))
        predicts = merits[law].without_it_n > found.rms_of(split.held) / (1.0 - PAYS)
        if merits[law].delta_bic > -BIC_AGAINST_NEXT or not predicts:
            return _without_useless(split, fewer, accepted)
    return found, merits


def look_alikes(table: Table, found: Regression, law: str) -> tuple[str, ...]:
    """Return the laws that fit nearly as well as ``law`` in its place, by BIC; best first."""
    rest = tuple(name for name in found.laws if name != law)
    try:
        fewer = regress(table, rest, None, found.nonlinear)
    except AnalysisError:
        return ()
    taken = float(fewer.residual_n @ fewer.residual_n) - float(found.residual_n @ found.residual_n)
    alike = []
    others = [name for name in LAWS if name not in (law, "position_ripple")]  # no other law resembles a ripple
    for candidate in screen_laws(table, fewer, pairs=False, laws=others).singles[:MAX_ALIKE_FITTED]:
        if candidate.gain_n2 * WORTH_A_FIT < taken:
            break
        try:
            other = regress(table, (*rest, *candidate.laws), None, {**found.nonlinear, **candidate.nonlinear})
        except AnalysisError:
            continue
        if bic_change(found, other, found.independent_samples) < BIC_AGAINST_NEXT:
            alike.append(candidate.laws[0])
    return tuple(alike)
