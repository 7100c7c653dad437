"""Separation of competing models that further shots would reach: to first order, and by refitting the rivals."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, count
from math import inf, sqrt

from analysis.collision import Infeasible
from analysis.compiled import side_by_side
from analysis.diagnosis import CRITERIA, per_shot_cost
from analysis.inference import Samples, trial_effect
from analysis.planning.model_comparison import ComparedModel, ModelComparison, rivals
from analysis.planning.next_shot import NextShot
from analysis.planning.predictions import (
    NEAR,
    Information,
    blank_shot,
    fit_as_if_taken,
    information_of,
    predict,
    present_information,
    refitted_chi2,
    shot_penalty,
)
from analysis.shot import Cancelled, Stop

Pair = tuple[int, int]  # the member that is true, its rival
Shots = tuple[NextShot, ...]
Pairs = Mapping[Pair, float]
_PROMISING = 0.8  # of the required separation, to first order: below it a sequence is not refitted
_KEPT = 3  # shots per pair that are combined into sequences
_FAR = 3.0  # times the nearest rival's distance, to first order: more distant rivals are not refitted


@dataclass(frozen=True, slots=True)
class Distances:
    """First-order information of the present shots and of possible ones on every pair of true member and rival.

    ``own_misfit`` is the misfit of every member to the present shots.
    """

    present_information: Mapping[Pair, Information]
    each: Mapping[NextShot, Mapping[Pair, Information]]
    own_misfit: Mapping[int, float]

    @property
    def members(self) -> tuple[int, ...]:
        """Get the members that may be the true model and have a rival here."""
        return tuple(dict.fromkeys(true for true, _ in self.present_information))

    def pair_distances(self, shots: Shots) -> dict[Pair, float]:
        """Return the distance of every pair after these shots, in noise norms."""
        out = {}
        for pair, every in self.present_information.items():
            for shot in shots:
                every = every + self.each[shot][pair]
            out[pair] = _norms(every.least - self.own_misfit[pair[0]])
        return out

    def penalty(self, pair: Pair, shots: Shots) -> float:
        """Return a rival's penalty after these shots, as chi^2."""
        return self.present_information[pair].penalty + sum(self.each[shot][pair].penalty for shot in shots)

    def nearest(self, shots: Shots) -> dict[int, float]:
        """Return the distance of the nearest rival after these shots, for every member that may be true."""
        return nearest(self.pair_distances(shots))

    def without(self, pairs: Collection[Pair]) -> "Distances":
        """Return the distances of the other pairs."""
        kept = {pair: known for pair, known in self.present_information.items() if pair not in pairs}
        return replace(self, present_information=kept)

    def inseparable_pairs(self, most: int) -> frozenset[Pair]:
        """Return the pairs that no ``most`` shots separate, to first order."""
        alone = {shot: self.pair_distances((shot,)) for shot in self.each}
        sequences = {(shot,) * most: None for shot in alone}
        for pair in self.present_information:
            best = sorted(alone, key=lambda shot: -alone[shot][pair])[:_KEPT]
            sequences.update(dict.fromkeys(combinations_with_replacement(best, most)))
        reached = [self.pair_distances(sequence) for sequence in sequences]
        largest = {pair: max((r[pair] for r in reached), default=0.0) for pair in self.present_information}
        return frozenset(pair for pair, distance in largest.items() if not promising(distance))


def screen_shots(
    comparison: ModelComparison, shots: Sequence[NextShot], tell: Callable[[float], None], stop: Stop
) -> Distances:
    """Return the information of each of ``shots`` for which every member has a solution.  Raises Cancelled.

    Cost: for every shot one solution per member and one with derivatives per pair, 1 to 11 ms each.
    """
    members, floor = comparison.members, comparison.floor
    true = [k for k, member in enumerate(members) if member in comparison.likely]
    pairs = tuple((a, b) for a in true for b in range(len(members)) if a != b)
    known = {b: present_information(members[b].fitted, floor) for b in {b for _, b in pairs}}
    known = {b: replace(of_b, penalty=members[b].penalty) for b, of_b in known.items()}
    done = count(1)

    charged = {m.effect: per_shot_cost(m.fitted, m.effect) for m in members if comparison.has_penalty(m.effect)}

    def of_pair(rival: ComparedModel, shown: Samples) -> Information:
        information, numbers = information_of(rival.fitted, shown, floor), charged.get(rival.effect)
        if numbers is None:
            return information
        return replace(information, penalty=shot_penalty(rival.fitted, rival.effect, numbers.prior_width, shown, floor))

    def of_shot(shot: NextShot) -> dict[Pair, Information] | None:
        if stop():
            raise Cancelled
        try:
            (empty,) = _blank(comparison, (shot,))
            shown = {a: predict(members[a].fitted, empty) for a in true}
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


def _blank(comparison: ModelComparison, shots: Shots) -> list[Samples]:
    """Return samples of shots not yet taken; they are the same under every member."""
    return [blank_shot(shot, comparison.members[0].fitted) for shot in shots]


def refitted(comparison: ModelComparison, shots: Shots, distances: Distances, stop: Stop) -> dict[Pair, float]:
    """Return ``Distances.pair_distances`` with the rivals refitted, except those far away to first order.

    Raises Cancelled.
    """
    empty = _blank(comparison, shots)
    first = distances.pair_distances(shots)
    least = nearest(first)
    shown = {true: [predict(comparison.members[true].fitted, one) for one in empty] for true in least}

    def of_pair(pair: Pair) -> float:
        if stop():
            raise Cancelled
        true, rival = pair
        if first[pair] > _FAR * least[true]:
            return first[pair]
        try:
            chi2 = refitted_chi2(comparison.members[rival].fitted, shown[true], comparison.floor, stop)
        except Infeasible:
            return inf
        return _norms(chi2 + distances.penalty(pair, shots) - distances.own_misfit[true])

    pairs = list(first)
    return dict(zip(pairs, side_by_side(of_pair, pairs), strict=True))


def search_rivals_again(
    comparison: ModelComparison, shots: Shots, known: Pairs, distances: Distances, stop: Stop
) -> dict[Pair, float]:
    """Return the distances ``known``, after a new search of rivals that start on a grid (of frequencies, times).

    The line that fits the present shots best need not be the best for further ones.  Raises Cancelled.  Cost: that of a
    comparison, some seconds.
    """
    places = {member.effect: place for place, member in enumerate(comparison.members)}
    grids = {effect for effect in places if len(trial_effect(effect).starts) > 1}
    empty = _blank(comparison, shots)
    out = dict(known)
    for true, value in nearest(known).items():
        member = comparison.members[true]
        others = [effect for effect, place in places.items() if effect in grids and (true, place) in known]
        if not others or value < CRITERIA.separation:
            continue
        best = fit_as_if_taken(member.fitted, [predict(member.fitted, one) for one in empty], comparison.floor)
        for rival in rivals(best, member.effect, others, stop, NEAR):
            pair = (true, places[rival.effect])
            out[pair] = min(out[pair], _norms(rival.chi2 - distances.own_misfit[true]))
    return out


def _norms(chi2: float) -> float:
    """Return a distance in noise norms; 0 where the rival fits even better than the true member."""
    return sqrt(max(0.0, chi2))


def promising(distance: float) -> bool:
    """Return whether a first-order distance is near the required separation or above it, so that refitting pays."""
    return distance > _PROMISING * CRITERIA.separation


def nearest(distances: Pairs) -> dict[int, float]:
    out: dict[int, float] = {}
    for (true, _), value in distances.items():
        out[true] = min(out.get(true, inf), value)
    return out
