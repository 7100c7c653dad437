"""One law instead of effects: asked as soon as the catalogue's likeliest leave something, before other ways are tried.

Such ways (a third effect, another first one, look-alikes) cost more than the law does, and where the truth is off the
catalogue they end in nothing.  A law that may be a row of the catalogue changes no name: the long way is gone then.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from analysis.diagnosis.learning.law_learning import Discovery, learn_law
from analysis.diagnosis.limit import Limit
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.identifiability import separation
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.hypothesis_fit import Fitted
from analysis.inference.screen.projector import projector
from analysis.shot.shot import Progress, Stop

_A_ROW = 0.05  # of a law's size: a row so near, to first order and between samples, may be the law itself
_HALF = 0.5  # of a diagnosis: the rest of the long way may follow


@dataclass(frozen=True)
class LawAlone:
    """The one law that ``start`` lacks, learned when it is first asked for; ``held`` are foretold in turn."""

    start: Fitted
    held: tuple[int, ...]
    tell: Progress = field(repr=False)
    stop: Stop = field(repr=False)
    limit: Limit = field(repr=False)

    @cached_property
    def found(self) -> Discovery | None:
        """Get the law, or None where the shots show none."""

        def learned() -> Discovery | None:
            return learn_law(self.start, self.held, lambda what, _fraction: self.tell(what, _HALF), self.limit)

        return self.limit.within("one law in the place of effects", learned, None)

    def explains_instead(self, best: Fitted, catalogue: Sequence[TrialEffect]) -> bool:
        """Return whether the law explains all where ``best`` does not, and is none of the ``catalogue``'s rows."""
        law = self.found
        if law is None or not law.explains or law.fitted.bic > best.bic - CRITERIA.law_fall:
            return False
        apart = separation(law.fitted, projector(law.fitted), law.laws[0].name, catalogue, self.stop)
        return not apart.too_close(_A_ROW * apart.snr)

    def ahead_of(self, named: Fitted) -> bool:
        """Return whether the shots tell the law from ``named`` effects, which stand where they do not."""
        law = self.found
        return law is not None and law.fitted.bic < named.bic - CRITERIA.form_excluded
