"""Plan the shots that separate competing models: all sequences to first order, promising ones by refitting.

T-optimal design (Atkinson and Fedorov, Biometrika 62 (1975) 57) for models that may be nested: for every member that
may be true, the worth of a sequence of shots is the distance of the nearest rival, fitted to the present shots and to
the member's predictions of the new ones.  As the true member is unknown, the worth of a sequence is its smallest over
the members that any sequence can separate.  A member that no sequence separates from a rival does not count; if no
member counts, no shot of the rig decides.  Two members that no shot separates from each other are treated as one, which
may still be separated from a third.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from math import inf
from typing import Any

from analysis.collision import Effect
from analysis.diagnosis import CRITERIA, EQUIVALENT_EFFECTS
from analysis.planning.distances import (
    Distances,
    Pair,
    Shots,
    nearest,
    promising,
    refitted,
    screen_shots,
    search_rivals_again,
)
from analysis.planning.model_comparison import ModelComparison
from analysis.planning.next_shot import (
    MAX_SHOTS,
    NextShot,
    Reach,
    effort,
    in_order,
    mass_without_weights_kg,
    next_shots,
    shots_in_words,
)
from analysis.shot import Cancelled, Progress, Stop

SURE = 1.5  # noise norms above the required separation, since the separation reached scatters by one
_KEPT = 8  # shots that are combined into sequences of several
_REFITTED = 3  # sequences refitted per length
_SCREENING = 0.6  # share of the time, for the progress shown

Found = Mapping[Shots, Mapping[int, float]]
Tell = Callable[[float], None]  # takes the fraction done


@dataclass(frozen=True, slots=True)
class Plan:
    """The shots to take next; empty where no shot of the rig separates the members.

    ``expected`` gives, for every effect that may be the true one, the separation in noise norms after all shots,
    ``after_first`` after the first alone; ``best`` is the largest separation of any member by any sequence tried.
    ``inseparable`` are the members that no sequence separates from all rivals.  ``inseparable_from`` gives, for a
    member that is separated from some rivals, those that no shot separates from it; ``expected`` leaves them out.
    """

    shots: Shots
    members: tuple[Effect, ...]
    now: float
    expected: Mapping[Effect, float]
    after_first: Mapping[Effect, float]
    best: float
    inseparable: tuple[Effect, ...]
    inseparable_from: Mapping[Effect, tuple[Effect, ...]] = field(default_factory=dict)

    @property
    def settles(self) -> bool:
        """Get whether the shots would separate the members."""
        return bool(self.shots)

    @property
    def separation(self) -> float:
        """Get the smallest expected separation over the separable members."""
        separable = [value for effect, value in self.expected.items() if effect not in self.inseparable]
        return min(separable, default=max(self.expected.values(), default=0.0))

    @property
    def words(self) -> str:
        """Get the plan in a sentence for the operator."""
        *others, last = (effect.short_words for effect in self.members)
        listed = f"{', '.join(others)} and {last}" if others else last
        if not self.settles:
            most = f"the best would reach {self.best:.2g} noise norms"
            return f"No shot of this rig tells {listed} apart: {most}{_because(self.members)}."
        open_ones = [effect.short_words for effect in self.expected if effect in self.inseparable]
        but = f"; were it {' or '.join(open_ones)}, no shot would" if open_ones else ""
        apart = f"{self.separation:.2g} noise norms (now {self.now:.2g})"
        return f"{shots_in_words(self.shots)} would tell {listed} apart by {apart}{but}{self._ones}."

    @property
    def _ones(self) -> str:
        """Get the inseparable pairs in words, each with the reason where it is known."""
        never = self.inseparable_from
        pairs = dict.fromkeys(frozenset({one, other}) for one, others in never.items() for other in others)
        named = [(" and ".join(e.short_words for e in self.members if e in pair), _because(pair)) for pair in pairs]
        return "".join(f"; {both} stay one{why}" for both, why in named)

    def to_json(self) -> dict[str, Any]:
        return {
            "shots": [shot.to_json() for shot in self.shots],
            "between": [effect.key for effect in self.members],
            "expected_if": {effect.key: value for effect, value in self.expected.items()},
            "best_separation": self.best,
            "inseparable": [effect.key for effect in self.inseparable],
            "one_with": {one.key: [other.key for other in others] for one, others in self.inseparable_from.items()},
            "words": self.words,
        }


def plan(
    comparison: ModelComparison,
    reach: Reach | None = None,
    *,
    most: int = MAX_SHOTS,
    progress: Progress = lambda _what, _fraction: None,
    stop: Stop = lambda: False,
) -> Plan:
    """Return the cheapest sequence of at most ``most`` shots that separates the members.  Raises Cancelled."""
    shots = comparison.members[0].fitted.problem.data.shots

    def screening(done: float) -> None:
        progress("predicting the next shots", _SCREENING * done)

    distances = screen_shots(comparison, next_shots(shots, reach or Reach()), screening, stop)
    on_the_block = shots[-1].moving_mass_kg - mass_without_weights_kg(shots)

    def refitting(done: float) -> None:
        progress("refitting the rivals", _SCREENING + (1 - _SCREENING) * done)

    def choose(pairs: Distances) -> tuple[Shots | None, dict[Shots, dict[Pair, float]]]:
        return _chosen(comparison, pairs, most, on_the_block, refitting, stop)

    left, never, chosen, found = _separable(distances, most, choose)
    effects = [member.effect for member in comparison.members]
    of = _most_of({shots: nearest(values) for shots, values in found.items()})

    def by_effect(values: Mapping[int, float]) -> dict[Effect, float]:
        return {effects[member]: value for member, value in sorted(values.items())}

    if chosen is None:
        first = expected = by_effect(of)
    else:
        first = expected = by_effect(nearest(found[chosen]))
        if len(chosen) > 1:
            first = by_effect(nearest(refitted(comparison, chosen[:1], left, stop)))
    inseparable_from = _inseparable_from(effects, never) if chosen is not None and left is not distances else {}
    likely = [effects[member] for member in distances.members]
    return Plan(
        shots=chosen or (),
        members=tuple(effects),
        now=comparison.separation_from(inseparable_from.get(effects[0], ())),
        expected=expected,
        after_first=first,
        best=max(of.values(), default=0.0),
        inseparable=tuple(effect for effect in likely if by_effect(of).get(effect, 0.0) < CRITERIA.separation),
        inseparable_from=inseparable_from,
    )


def _separable(
    distances: Distances,
    most: int,
    choose: Callable[[Distances], tuple[Shots | None, dict[Shots, dict[Pair, float]]]],
) -> tuple[Distances, frozenset[Pair], Shots | None, dict[Shots, dict[Pair, float]]]:
    """Choose a sequence, setting aside pairs that no sequence separates until one separates all others.

    Returns the distances of the pairs that count, the pairs set aside, the sequence, and every sequence's distances.
    """
    never = distances.inseparable_pairs(most)
    count = len(distances.present_information)
    while True:
        left = distances.without(never) if len(never) < count else distances
        chosen, found = choose(left)
        if chosen is not None or left is distances:
            break
        largest = {
            pair: max((values[pair] for values in found.values()), default=0.0) for pair in left.present_information
        }
        more = {pair for pair, value in largest.items() if value < CRITERIA.separation}
        # Either each pair is separated by some sequence and no sequence separates all, or all pairs were just tried.
        if not more or (not never and len(more) == count):
            break
        never |= more
    return left, never, chosen, found


def _inseparable_from(effects: Sequence[Effect], pairs: Collection[Pair]) -> dict[Effect, tuple[Effect, ...]]:
    ones = sorted({a for a, _ in pairs})
    return {effects[a]: tuple(effects[b] for one, b in sorted(pairs) if one == a) for a in ones}


def _chosen(
    comparison: ModelComparison, distances: Distances, most: int, on_the_block_kg: float, tell: Tell, stop: Stop
) -> tuple[Shots | None, dict[Shots, dict[Pair, float]]]:
    """Return the sequence to take (None where none separates) and the distances of every sequence refitted."""
    found: dict[Shots, dict[Pair, float]] = {}
    searched: set[Shots] = set()
    chosen: Shots | None = None

    def of_members() -> Found:
        return {shots: nearest(values) for shots, values in found.items()}

    def sure(shots: Shots) -> bool:
        return _worth(of_members(), nearest(found[shots])) >= CRITERIA.separation + SURE

    for length in range(1, most + 1):
        listed = _ranked(distances, length, on_the_block_kg)
        likely = [one for one in listed if promising(max(distances.nearest(one).values()))]
        for sequence in likely[:_REFITTED] or (listed[:1] if length == most else ()):
            if stop():
                raise Cancelled
            tell((length - 1) / most)
            found[sequence] = refitted(comparison, sequence, distances, stop)
            if sure(sequence):  # sequences that are sure to first order come in order of effort
                break
        chosen = _best(of_members(), on_the_block_kg)
        while chosen is not None and chosen not in searched and (sure(chosen) or length == most):
            searched.add(chosen)
            found[chosen] = search_rivals_again(comparison, chosen, found[chosen], distances, stop)
            chosen = _best(of_members(), on_the_block_kg)
        if chosen is not None and sure(chosen):
            break
    return chosen, found


def _ranked(distances: Distances, length: int, on_the_block_kg: float) -> list[Shots]:
    """Return the sequences of one length, best first by first-order worth.

    Sequences of several shots combine the shots with the largest first-order separation of any member alone.
    """
    alone: dict[NextShot, dict[int, float]] = {shot: distances.nearest((shot,)) for shot in distances.each}
    sequences: list[Shots] = [(shot,) for shot in alone]
    if length > 1:
        kept: dict[NextShot, None] = {}
        for member in distances.members:
            best = sorted((-values[member], place, shot) for place, (shot, values) in enumerate(alone.items()))
            kept.update(dict.fromkeys(shot for *_, shot in best[: _KEPT // len(distances.members) + 1]))
        sequences = [in_order(some, on_the_block_kg) for some in combinations_with_replacement(kept, length)]
    apart = {sequence: distances.nearest(sequence) for sequence in sequences}

    def order(sequence: Shots) -> tuple[float, float]:
        worth = _worth(apart, apart[sequence])
        return (effort(sequence, on_the_block_kg) if worth >= CRITERIA.separation + SURE else inf, -worth)

    return sorted(sequences, key=order)


def _most_of(found: Found) -> dict[int, float]:
    """Return the largest separation of every member by any of these sequences."""
    out: dict[int, float] = {}
    for values in found.values():
        for member, value in values.items():
            out[member] = max(out.get(member, 0.0), value)
    return out


def _worth(found: Found, values: Mapping[int, float]) -> float:
    """Return the smallest separation among members that some sequence separates; the largest where none does."""
    can = [member for member, most in _most_of(found).items() if most >= CRITERIA.separation]
    return min((values[m] for m in can), default=max(values.values()))


def _best(found: Found, on_the_block_kg: float) -> Shots | None:
    """Return the cheapest sequence that surely separates, else the best that separates at all, else None."""
    worth = {sequence: _worth(found, values) for sequence, values in found.items()}
    sure = [one for one in worth if worth[one] >= CRITERIA.separation + SURE]
    if sure:
        return min(sure, key=lambda one: (effort(one, on_the_block_kg), -worth[one]))
    best = max(worth, key=worth.__getitem__, default=None)
    return best if best is not None and worth[best] >= CRITERIA.separation else None


def _because(effects: Iterable[Effect]) -> str:
    names = {effect.name for effect in effects}
    same = [words for pair, words in EQUIVALENT_EFFECTS.items() if pair <= names]
    return f" ({'; '.join(same)})" if same else ""
