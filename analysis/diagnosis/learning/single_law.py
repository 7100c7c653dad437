"""One law in place of all effects, tried as soon as the catalogue's likeliest effects leave a residual.

A third effect, restarts and look-alikes take longer than one law, and explain nothing where the true law is outside the
catalogue.  A law that may be an effect of the catalogue does not replace effects; the catalogue search then continues.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

from analysis.diagnosis.evidence.identifiability import separation
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.learning.curve_fit import Learned
from analysis.diagnosis.learning.law_learning import (
    Discovery,
    curves_may_beat,
    forms_may_beat,
    learn_law,
    refine_contenders,
    rough_curves,
)
from analysis.diagnosis.learning.two_laws import two_curves
from analysis.diagnosis.search.time_limit import Limit
from analysis.inference import Fitted, TrialEffect
from analysis.shot import Progress, Stop

_SAME = 0.05  # of a law's size: an effect that differs by less, to first order, may be the law itself
_STEP = "one law in the place of effects"  # step of a diagnosis, listed if there was no time for it
_HALF = 0.5  # progress shown for this step, since all other steps may still follow


@dataclass(frozen=True)
class SingleLaw:
    """The single law that ``start`` lacks, learned when first needed; the validation shots ``held`` test it in turn.

    A single shot, without another to hold out, shows no law.
    """

    start: Fitted
    held: tuple[int, ...]
    tell: Progress = field(repr=False)
    stop: Stop = field(repr=False)
    limit: Limit = field(repr=False)

    @cached_property
    def rough(self) -> Sequence[Learned]:
        """Get a free curve for every argument after a few steps, the likeliest first."""
        if not self.held:
            return []
        return self.limit.within(_STEP, lambda: rough_curves(self.start, self._tell_half, self.limit), [])

    @cached_property
    def curves(self) -> Sequence[Learned]:
        """Get the free curves that the law may have, the likeliest first."""
        return (
            self.limit.within(_STEP, lambda: refine_contenders(self.start, self.rough, self.limit), [])
            if self.rough
            else []
        )

    @cached_property
    def found(self) -> Discovery | None:
        """Get the law, or None where the shots show none."""

        def learned() -> Discovery | None:
            return learn_law(self.start, self.held, self._tell_half, self.limit, curves=self.curves)

        return self.limit.within(_STEP, learned, None) if self.curves else None

    def flight_law_may_beat(self, beat: float) -> bool:
        """Return whether one law that acts in flight may come below the BIC ``beat``, judged by one step of its curve.

        Cost: about 0.2 s.
        """
        if not self.held:
            return False
        curves = partial(rough_curves, self.start, self._tell_half, self.limit, steps=1, where="block")
        none: list[Learned] = []
        return curves_may_beat(beat, self.limit.within(_STEP, curves, none), self.start)

    def _one_may_beat(self, beat: float) -> bool:
        """Return whether a closed form of one curve may come below a BIC; curves far above it are not continued."""
        return curves_may_beat(beat, self.rough, self.start) and forms_may_beat(beat, self.curves, self.start)

    def _tell_half(self, what: str, _fraction: float) -> None:
        self.tell(what, _HALF)

    def one_or_two_laws_may_beat(self, beat: float) -> bool:
        """Return whether this law, or two laws in its place, may come below the BIC ``beat``."""
        if self._one_may_beat(beat):
            return True
        led_nowhere = curves_may_beat(beat, self.rough, self.start) and not self.curves
        if led_nowhere or not self.rough:
            return False
        none: list[Learned] = []
        two = self.limit.within(_STEP, lambda: two_curves(self.start, self.limit, beat=beat), none)
        return forms_may_beat(beat, two, self.start)

    def replaces_effects(self, best: Fitted, catalogue: Sequence[TrialEffect]) -> bool:
        """Return whether the law explains all, is likelier than ``best``, and is no effect of the ``catalogue``."""
        beat = best.bic - CRITERIA.law_fall
        if not self._one_may_beat(beat):
            return False
        law = self.found
        if law is None or not law.explains or law.fitted.bic > beat:
            return False
        apart = separation(law.fitted, law.fitted.linearise(), law.laws[0].effect, catalogue, self.stop)
        return not apart.too_close(_SAME * apart.snr)
