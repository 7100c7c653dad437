"""One law in the place of all effects, tried as soon as the catalogue's likeliest effects leave a residual.

A third effect, other first effects and look-alikes take longer than one law, and explain nothing where the truth is off
the catalogue.  A law that may be an effect of the catalogue does not replace it: the catalogue is searched on then.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from analysis.diagnosis.learning.law_learning import Discovery, learn_law
from analysis.diagnosis.limit import Limit
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.identifiability import separation
from analysis.inference import Fitted, TrialEffect
from analysis.shot import Progress, Stop

_SAME = 0.05  # of a law's size: an effect that differs by less, to first order, may be the law itself
_HALF = 0.5  # of a diagnosis, as its progress shows it: the rest may follow


@dataclass(frozen=True)
class SingleLaw:
    """The one law that ``start`` lacks, learned when it is first needed; the shots ``held`` are predicted in turn."""

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

    def replaces_effects(self, best: Fitted, catalogue: Sequence[TrialEffect]) -> bool:
        """Return whether the law explains all where ``best`` does not, and is no effect of the ``catalogue``."""
        law = self.found
        if law is None or not law.explains or law.fitted.bic > best.bic - CRITERIA.law_fall:
            return False
        apart = separation(law.fitted, law.fitted.linearise(), law.laws[0].effect, catalogue, self.stop)
        return not apart.too_close(_SAME * apart.snr)

    def is_likelier_than(self, named: Fitted) -> bool:
        """Return whether the law is likelier than ``named`` effects by more than the shots leave open."""
        law = self.found
        return law is not None and law.fitted.bic < named.bic - CRITERIA.form_excluded
