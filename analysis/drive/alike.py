"""Which other law would do as well in the place of one that was found."""

import numpy as np

from analysis.drive.catalogue import LAWS
from analysis.drive.regress import Regression, regress
from analysis.drive.screen import screen
from analysis.drive.search import BIC_AGAINST_NEXT, falls
from analysis.drive.table import Table
from analysis.shot.shot import AnalysisError

MOST_FITTED = 2
WORTH_A_FIT = 3.0  # of what the law takes: a guess that takes less than a third is fitted to no avail


def look_alikes(table: Table, found: Regression, law: str) -> tuple[str, ...]:
    """Return the laws that, fitted in the place of ``law``, come within reach of the criterion; best first."""
    rest = tuple(name for name in found.laws if name != law)
    try:
        fewer = regress(table, rest, None, found.bent)
    except AnalysisError:
        return ()
    taken = float(fewer.residual_n @ fewer.residual_n) - float(found.residual_n @ found.residual_n)
    alike = []
    others = [name for name in LAWS if name not in (law, "position_ripple")]  # a wave is like nothing else
    guesses = screen(table, fewer, pairs=False, laws=others).singles
    for guess in guesses[:MOST_FITTED]:
        if guess.gain_n2 * WORTH_A_FIT < taken:
            break
        try:
            other = regress(table, (*rest, *guess.laws), None, {**found.bent, **guess.bent})
        except AnalysisError:
            continue
        if falls(found, other, found.independent_samples) < BIC_AGAINST_NEXT:
            alike.append(guess.laws[0])
    return tuple(np.unique(alike).tolist())
