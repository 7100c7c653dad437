"""What stands of the effects that a search found: after held-out shots, size, look-alikes and what is left."""

from dataclasses import dataclass

from analysis.diagnosis.compare import Fitted
from analysis.diagnosis.explore import Trail, another_way, better
from analysis.diagnosis.gates import Told, paying, without_the_faint
from analysis.diagnosis.held_out import foretell
from analysis.diagnosis.projector import Projector
from analysis.diagnosis.remainder import Remainder, judge
from analysis.diagnosis.rivals import Separations, apart, challenged, unmissed
from analysis.shot import Progress


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


def settle(best: Fitted, trail: Trail, held: tuple[int, ...], tell: Progress) -> Settled:
    """Return what stands of ``best``, or of what another way leads to where that leaves something unexplained."""
    stands = _settled(best, trail, held, tell)
    if not stands.rest.significant:
        return stands
    tell("looking for another way", 0.75)
    other = another_way(stands.best, trail)
    if not better(other, stands.best):
        return stands
    again = _settled(other, trail, held, lambda _what, _fraction: None)
    calmer = not again.rest.significant and again.best is not trail.start
    return again if calmer or better(again.best, stands.best) else stands


def _settled(best: Fitted, trail: Trail, held: tuple[int, ...], tell: Progress) -> Settled:
    tell("foretelling a held-out shot", 0.55)
    passed, told = paying(best, held, trail)

    def foretells(other: Fitted) -> bool:
        if told is None:
            return True
        of_other = foretell(other, held, passed.floor, trail.stop)
        return of_other is not None and of_other.beats(told[0])

    tell("testing what is left", 0.7)
    best, at = without_the_faint(passed, trail)
    best, at, far = challenged(best, at, trail, foretells)
    rest = judge(best, at)
    if rest.significant and best is not trail.start:
        clean, there, left = unmissed(best, at, rest, trail, foretells)
        if clean is not best:
            return Settled(clean, there, apart(clean, there, trail), left, told, passed)
    return Settled(best, at, far, rest, told, passed)
