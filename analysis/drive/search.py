"""Which laws join the model of a drive: one at a time or two together, each for what it foretells."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.drive.catalogue import LAWS
from analysis.drive.regress import BentValues, Regression, design, regress, rms
from analysis.drive.repeat import folds
from analysis.drive.screen import Guess, screen
from analysis.drive.table import Mask, Table
from analysis.shot.shot import AnalysisError

Floats = NDArray[np.float64]
BIC_AGAINST_BASE, BIC_AGAINST_NEXT = 10.0, 6.0  # docs/how-a-diagnosis-decides.md
PAYS = 0.02  # the share of the foretold force error that a law must take away
SAME_LAW = 0.35  # of a law's force: what may lie between the law of one half and that of the other
MOST_LAWS = 5
FOLDS = 6
TRIED_SINGLES, TRIED_PAIRS = 3, 3  # of what was screened, fitted


@dataclass(frozen=True, slots=True)
class Ground:
    """What a search stands on: the samples that are fitted, those that are foretold, and the parts of the cycle."""

    table: Table
    kept: Mask
    held: Mask
    fold: NDArray[np.int64]

    @classmethod
    def of(cls, table: Table) -> "Ground":
        """Return the ground of a table: the earlier half of each record is fitted, the later foretold."""
        kept = np.zeros(table.time_s.size, dtype=np.bool_)
        for record in np.unique(table.record):
            of = table.record == record
            middle = 0.5 * (float(table.time_s[of].min()) + float(table.time_s[of].max()))
            kept |= of & (table.time_s < middle)
        return cls(table, kept, ~kept, folds(table, FOLDS))


@dataclass(frozen=True, slots=True)
class Trial:
    """Laws added to a model: their fit on the kept half, what the criterion (BIC) falls by, what it foretells."""

    added: tuple[str, ...]
    found: Regression
    delta_bic: float
    held_out_n: float
    crossed_n: float  # foretold for parts of the cycle that took no part


@dataclass(frozen=True, slots=True)
class Pay:
    """What a law is worth in the model that holds it: the criterion and the foretold error without it."""

    delta_bic: float
    without_n: float


@dataclass(frozen=True, slots=True)
class Explored:
    """Where the search ended, what each of its laws pays, and every trial of its first round.

    ``coinciding`` are laws that are no candidates in this motion.
    """

    found: Regression
    pays: Mapping[str, Pay]
    trials: tuple[Trial, ...]
    coinciding: tuple[str, ...]


def explore(ground: Ground, accepted: Sequence[str] = (), tell: Callable[[float], None] = lambda _: None) -> Explored:
    """Return the model that foretells best; ``accepted`` laws are in it whatever they pay.  Raises Cancelled."""
    found = accept(ground.table, accepted, ground.kept)
    first: tuple[Trial, ...] = ()
    coinciding: tuple[str, ...] = ()
    begun = False
    while len(found.laws) < MOST_LAWS + len(accepted):
        screening = screen(ground.table, found)
        singles = screening.singles[:TRIED_SINGLES] if begun else screening.singles
        room = len(found.laws) + 1 < MOST_LAWS + len(accepted)
        guesses = [*singles, *(screening.pairs[:TRIED_PAIRS] if room else ())]
        trials = attempt(ground, found, guesses)
        if not begun:
            begun = True
            first, coinciding = trials, screening.coinciding
        best = _best(ground, found, trials)
        if best is None:
            break
        found = best.found
        tell(len(found.laws) / (MOST_LAWS + len(accepted)))
    found, pays = _pruned(ground, found, accepted)
    return Explored(found, pays, first, coinciding)


def accept(table: Table, laws: Sequence[str], mask: Mask | None = None) -> Regression:
    """Return the fit of base and ``laws``, those that lean on each other begun together.  Raises AnalysisError."""
    if unknown := [law for law in laws if law not in LAWS]:
        raise AnalysisError(f"no effect of a drive is called {unknown[0]!r}; there are {', '.join(LAWS)}")
    found = regress(table, (), mask)
    while missing := [law for law in laws if law not in found.laws]:
        screening = screen(table, found, pairs=len(missing) > 1, laws=missing)
        guesses = [g for g in (*screening.pairs, *screening.singles) if set(g.laws) <= set(missing)]
        if not guesses:
            named = missing[0].replace("_", " ")
            raise AnalysisError(f"{named}: this motion does not tell it from the rest of the model")
        guess = max(guesses, key=lambda g: g.gain_n2)
        found = regress(table, (*found.laws, *guess.laws), mask, {**found.bent, **guess.bent})
    return found


def attempt(ground: Ground, found: Regression, guesses: Sequence[Guess]) -> tuple[Trial, ...]:
    """Return the fits of the guesses beside what was found, best first, less those the motion does not tell apart."""
    fits = []
    for guess in guesses:
        with contextlib.suppress(AnalysisError):
            laws = (*found.laws, *guess.laws)
            fits.append((guess, regress(ground.table, laws, ground.kept, {**found.bent, **guess.bent})))
    if not fits:
        return ()
    count = min((new for _, new in fits), key=lambda new: new.rms_n).independent_samples  # one for all: they compete
    trials = [
        Trial(
            guess.laws, new, falls(found, new, count), new.foretold_n(ground.held), crossed(ground, new.laws, new.bent)
        )
        for guess, new in fits
    ]
    return tuple(sorted(trials, key=lambda trial: trial.delta_bic))


def falls(before: Regression, after: Regression, count: float) -> float:
    """Return what the Bayesian information criterion changes by, over ``count`` independent samples."""
    more = after.values.size - before.values.size
    return count * 2.0 * float(np.log(after.rms_n / before.rms_n)) + more * float(np.log(max(count, 2.0)))


def crossed(ground: Ground, laws: Sequence[str], bent: BentValues) -> float:
    """Return the force error where each part of the cycle is foretold from the others; what is bent stays."""
    columns = design(ground.table, laws, bent)
    target = ground.table.force(bent["drive_delay"][0] if "drive_delay" in bent else 0.0)
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left = np.empty(target.size)
    for fold in np.unique(ground.fold):
        out = ground.fold == fold
        values = np.linalg.lstsq(columns[~out] / scale, target[~out], rcond=1e-10)[0] / scale
        left[out] = target[out] - columns[out] @ values
    return rms(left)


def stable(ground: Ground, found: Regression, law: str) -> bool:
    """Return whether the later half gives the same force of this law, by itself, as the earlier half."""
    try:
        other = regress(ground.table, found.laws, ground.held, found.bent)
    except AnalysisError:
        return False
    one, two = (force_of(ground.table, fit, law) for fit in (found, other))
    return rms(one - two) <= SAME_LAW * rms(one)


def force_of(table: Table, found: Regression, law: str) -> Floats:
    """Return the force that a law has in a fit, shape (m,)."""
    row = LAWS[law]
    if row.force is None:
        (time_s,) = found.bent[law]
        return table.force() - table.force(time_s)
    values = np.array([found.quantity(f"{law}.{name}").value for name in row.linear])
    return np.asarray(table.columns(row, found.bent.get(law, ())) @ values)


def _best(ground: Ground, found: Regression, trials: Sequence[Trial]) -> Trial | None:
    """Return the trial that wins a round: every one of its laws pays, and is the same in both halves."""
    held, across = found.foretold_n(ground.held), crossed(ground, found.laws, found.bent)
    singles = [trial for trial in trials if len(trial.added) == 1]
    alone = min(singles, key=lambda t: t.delta_bic, default=None)
    price = BIC_AGAINST_BASE + 2.0 * float(np.log(max(2, len(trials))))
    for trial in trials:
        share = (1.0 - PAYS) ** len(trial.added)
        if trial.delta_bic > -price or trial.held_out_n > share * held or trial.crossed_n > share * across:
            continue
        if len(trial.added) == 2 and alone is not None:
            by_itself = min((t for t in singles if t.added[0] in trial.added), key=lambda t: t.delta_bic, default=alone)
            if trial.delta_bic > by_itself.delta_bic - BIC_AGAINST_NEXT:
                continue
            if trial.held_out_n > (1.0 - PAYS) * by_itself.held_out_n:
                continue
        if all(stable(ground, trial.found, law) for law in trial.added):
            return trial
    return None


def _pruned(ground: Ground, found: Regression, accepted: Sequence[str]) -> tuple[Regression, dict[str, Pay]]:
    """Return the model without the laws that no longer pay beside those that came after them."""
    pays = {}
    for law in [name for name in found.laws if name not in accepted]:
        rest = tuple(name for name in found.laws if name != law)
        fewer = regress(ground.table, rest, ground.kept, found.bent)
        pays[law] = Pay(-falls(found, fewer, found.independent_samples), fewer.foretold_n(ground.held))
        told = pays[law].without_n > found.foretold_n(ground.held) / (1.0 - PAYS)
        if pays[law].delta_bic > -BIC_AGAINST_NEXT or not told:
            return _pruned(ground, fewer, accepted)
    return found, pays
