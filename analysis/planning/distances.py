"""How far the rivals of a member stay off after shots not yet taken: to first order, and fitted anew."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, count
from math import inf, sqrt

from analysis.collision.parameters import Infeasible
from analysis.compiled.side_by_side import side_by_side
from analysis.diagnosis.verdict.coincidence import unforetold
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.inference.fit.free_parameters import trials_named
from analysis.inference.fit.samples import Samples
from analysis.planning.contest import Contest, Member, rivals
from analysis.planning.foreseen import (
    NEAR,
    Informs,
    as_if_taken,
    at_hand,
    blank,
    coincidence_with,
    foretold,
    informs,
    refitted_chi2,
)
from analysis.planning.next_shot import NextShot
from analysis.shot.shot import Cancelled, Stop

Pair = tuple[int, int]  # the member that is true, its rival
Shots = tuple[NextShot, ...]
Pairs = Mapping[Pair, float]
_HOPEFUL = 0.8  # of what is asked, to first order: less is not fitted anew
_KEPT = 3  # shots for each pair that go on into sequences
_FAR = 3.0  # times the nearest rival to first order: one so far off is not fitted anew


@dataclass(frozen=True, slots=True)
class Distances:
    """What shots at hand and shots to choose from say to first order of every rival, were a member true.

    ``own_misfit`` is what every member itself leaves of the shots at hand.
    """

    at_hand: Mapping[Pair, Informs]
    each: Mapping[NextShot, Mapping[Pair, Informs]]
    own_misfit: Mapping[int, float]

    @property
    def members(self) -> tuple[int, ...]:
        """Get the members that may be true and have a rival here."""
        return tuple(dict.fromkeys(true for true, _ in self.at_hand))

    def of_pairs(self, shots: Shots) -> dict[Pair, float]:
        """Return the distance of every rival after these shots, in noise norms."""
        out = {}
        for pair, every in self.at_hand.items():
            for shot in shots:
                every = every + self.each[shot][pair]
            out[pair] = sqrt(max(0.0, every.least - self.own_misfit[pair[0]]))
        return out

    def coincidence(self, pair: Pair, shots: Shots) -> float:
        """Return what it costs a rival after these shots that nothing foretells its numbers, as chi^2."""
        return self.at_hand[pair].coincidence + sum(self.each[shot][pair].coincidence for shot in shots)

    def nearest(self, shots: Shots) -> dict[int, float]:
        """Return, for every member that may be true, the distance of its nearest rival after these shots."""
        return nearest(self.of_pairs(shots))

    def without(self, pairs: Collection[Pair]) -> "Distances":
        """Return the distances of the other pairs."""
        return replace(self, at_hand={pair: known for pair, known in self.at_hand.items() if pair not in pairs})

    def never(self, most: int) -> frozenset[Pair]:
        """Return the pairs that no ``most`` shots part, to first order: a rival that does all that the member does."""
        alone = {shot: self.of_pairs((shot,)) for shot in self.each}
        sequences = {(shot,) * most: None for shot in alone}
        for pair in self.at_hand:
            best = sorted(alone, key=lambda shot: -alone[shot][pair])[:_KEPT]
            sequences.update(dict.fromkeys(combinations_with_replacement(best, most)))
        reached = [self.of_pairs(sequence) for sequence in sequences]
        return frozenset(pair for pair in self.at_hand if not hopeful(max((r[pair] for r in reached), default=0.0)))


def screened(contest: Contest, shots: Sequence[NextShot], tell: Callable[[float], None], stop: Stop) -> Distances:
    """Return what each of ``shots`` says; those for which a member has no motion are left out.  Raises Cancelled.

    Cost: for every shot one motion a member and one with derivatives a pair, 1 to 11 ms each.
    """
    members, floor = contest.members, contest.floor
    true = [k for k, member in enumerate(members) if member in contest.likely]
    pairs = tuple((a, b) for a in true for b in range(len(members)) if a != b)
    known = {b: at_hand(members[b].fitted, floor) for b in {b for _, b in pairs}}
    known = {b: replace(of_b, coincidence=members[b].coincidence) for b, of_b in known.items()}
    done = count(1)

    charged = {m.effect: unforetold(m.fitted, m.effect) for m in members if contest.charges(m.effect)}

    def of_pair(rival: Member, shown: Samples) -> Informs:
        told, numbers = informs(rival.fitted, shown, floor), charged.get(rival.effect)
        if numbers is None:
            return told
        return replace(told, coincidence=coincidence_with(rival.fitted, rival.effect, numbers.scatter, shown, floor))

    def of_shot(shot: NextShot) -> dict[Pair, Informs] | None:
        if stop():
            raise Cancelled
        try:
            empty = blank(shot, members[0].fitted)
            shown = {a: foretold(members[a].fitted, empty) for a in true}
            return {(a, b): of_pair(members[b], shown[a]) for a, b in pairs}
        except Infeasible:
            return None
        finally:
            tell(next(done) / len(shots))

    found = zip(shots, side_by_side(of_shot, shots), strict=True)
    return Distances(
        {pair: known[pair[1]] for pair in pairs},
        {shot: out for shot, out in found if out is not None},
        {a: members[a].misfit for a in true},
    )


def refitted(contest: Contest, shots: Shots, distances: Distances, stop: Stop) -> dict[Pair, float]:
    """Return what ``Distances.of_pairs`` does, rivals fitted anew; those far off by first order are left at that.

    Raises Cancelled.
    """
    empty = [blank(shot, contest.members[0].fitted) for shot in shots]
    first = distances.of_pairs(shots)
    least = nearest(first)
    shown = {true: [foretold(contest.members[true].fitted, one) for one in empty] for true in least}

    def of_pair(pair: Pair) -> float:
        if stop():
            raise Cancelled
        true, rival = pair
        if first[pair] > _FAR * least[true]:
            return first[pair]
        try:
            chi2 = refitted_chi2(contest.members[rival].fitted, shown[true], contest.floor, stop)
        except Infeasible:
            return inf
        return sqrt(max(0.0, chi2 + distances.coincidence(pair, shots) - distances.own_misfit[true]))

    pairs = list(first)
    return dict(zip(pairs, side_by_side(of_pair, pairs), strict=True))


def searched_anew(contest: Contest, shots: Shots, known: Pairs, distances: Distances, stop: Stop) -> dict[Pair, float]:
    """Return what ``refitted`` gave with the rivals that have a grid (lines, times, ranges) searched for from nothing.

    A line that was the best in the shots at hand need not be the best in those to come.  Raises Cancelled.  Cost: that
    of a contest, some seconds.
    """
    places = {member.effect: place for place, member in enumerate(contest.members)}
    grids = {name for name in places if len(trials_named([name])[0].starts) > 1}
    empty = [blank(shot, contest.members[0].fitted) for shot in shots]
    out = dict(known)
    for true, value in nearest(known).items():
        member = contest.members[true]
        others = [name for name, place in places.items() if name in grids and (true, place) in known]
        if not others or value < CRITERIA.separation:
            continue
        best = as_if_taken(member.fitted, [foretold(member.fitted, one) for one in empty], contest.floor)
        for rival in rivals(best, member.effect, others, stop, NEAR):
            pair = (true, places[rival.effect])
            out[pair] = min(out[pair], sqrt(max(0.0, rival.chi2 - distances.own_misfit[true])))
    return out


def hopeful(distance: float) -> bool:
    """Return whether a distance to first order is near enough to what is asked for rivals to be fitted anew."""
    return distance > _HOPEFUL * CRITERIA.separation


def nearest(distances: Pairs) -> dict[int, float]:
    """Return the least distance of any rival, for every member."""
    out: dict[int, float] = {}
    for (true, _), value in distances.items():
        out[true] = min(out.get(true, inf), value)
    return out
