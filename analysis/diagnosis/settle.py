"""What stands of the effects that a search found: after held-out shots, size, look-alikes and what is left."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from analysis.diagnosis.compare import Fitted
from analysis.diagnosis.explore import Trail, another_way
from analysis.diagnosis.gates import Told, paying, without_the_faint
from analysis.diagnosis.held_out import foretell
from analysis.diagnosis.knobs import Kind
from analysis.diagnosis.remainder import Remainder, judge
from analysis.diagnosis.rivals import Separations, apart, challenged, unmissed
from analysis.diagnosis.screen import Projector
from analysis.shot import Progress

_BETTER = 1.0  # of the criterion, for another way to be followed


@dataclass(frozen=True, slots=True)
class Settled:
    """The fit that stands, its projector, its effects' separations, what it leaves over, what is foretold with it.

    ``passed`` is the fit of which the held-out shots were foretold.
    """

    best: Fitted
    at: Projector
    far: Separations
    rest: Remainder
    told: Told | None
    passed: Fitted


def settle(
    before: Fitted,
    best: Fitted,
    trail: Trail,
    held: tuple[int, ...],
    catalogue: Sequence[Kind],
    tell: Progress,
    stop: Callable[[], bool],
) -> Settled:
    """Return what stands of ``best``, or of what another way leads to where that leaves something unexplained."""
    stands = _settled(before, best, trail, held, catalogue, tell, stop)
    if not stands.rest.significant or stands.best is before:
        return stands
    tell("looking for another way", 0.75)
    other = another_way(before, stands.best, catalogue, trail, stop)
    if other.bic > stands.best.bic - _BETTER:
        return stands
    again = _settled(before, other, trail, held, catalogue, lambda _what, _fraction: None, stop)
    better = again.best.bic < stands.best.bic - _BETTER or (not again.rest.significant and again.best is not before)
    return again if better else stands


def _settled(
    before: Fitted,
    best: Fitted,
    trail: Trail,
    held: tuple[int, ...],
    catalogue: Sequence[Kind],
    tell: Progress,
    stop: Callable[[], bool],
) -> Settled:
    tell("foretelling a held-out shot", 0.55)
    passed, told = paying(before, best, held, trail, stop)

    def foretells(other: Fitted) -> bool:
        if told is None:
            return True
        of_other = foretell(other, held, passed.floor, stop)
        return of_other is not None and of_other.beats(told[0])

    tell("testing what is left", 0.7)
    best, at = without_the_faint(before, passed, trail, stop)
    best, at, far = challenged(before, best, at, catalogue, trail, foretells, stop)
    rest = judge(best, at)
    if rest.significant and best is not before:
        clean, there, left = unmissed(best, at, rest, trail, foretells, stop)
        if clean is not best:
            return Settled(clean, there, apart(before, clean, there, catalogue, stop), left, told, passed)
    return Settled(best, at, far, rest, told, passed)
