"""Which next shots tell competing models apart: every sequence to first order, the promising ones by refitting.

T-optimal design (Atkinson and Fedorov, Biometrika 62 (1975) 57) for models that may be nested: for every member that
may be true, a sequence of shots is worth the distance of the nearest rival, fitted anew to the shots at hand and to
what the member foretells of the new ones.  What is true is not known: a sequence counts by the worst of the members
that any sequence can separate.  A member that none can, because a rival does all it does, is left out of that; where
none is left, no shot of the rig decides.  Two that no shot parts do not keep those from a third: they are one with two
readings, which is parted from the third.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from math import inf
from typing import Any

from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.planning.contest import Contest
from analysis.planning.distances import (
    Distances,
    Pair,
    Pairs,
    Shots,
    hopeful,
    nearest,
    refitted,
    screened,
    searched_anew,
)
from analysis.planning.next_shot import MOST_SHOTS, NextShot, Reach, as_found_kg, effort, in_order, next_shots
from analysis.shot.shot import Cancelled, Progress, Stop

SURE = 1.5  # noise norms above what is asked: what is reached scatters by one
_KEPT = 8  # shots that go on into sequences of several
_REFITTED = 3  # sequences of one length
_SCREENING = 0.6  # of the time

Found = Mapping[Shots, Mapping[int, float]]
Tell = Callable[[float], None]  # a fraction done


@dataclass(frozen=True, slots=True)
class Plan:
    """The shots to take next; empty where none of the rig separates what competes.

    ``expected`` gives, for every effect that may be the true one, the separation in noise norms after all of them,
    ``after_first`` after the first alone; ``best`` is the most that any sequence tried would reach, of the member it
    serves best.  ``inseparable`` are the members that a rival could still stand for after any of them.  ``one_with``
    gives for a member that is parted from others those that no shot parts from it: what is expected leaves them out.
    """

    shots: Shots
    members: tuple[str, ...]
    now: float
    expected: Mapping[str, float]
    after_first: Mapping[str, float]
    best: float
    inseparable: tuple[str, ...]
    one_with: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def settles(self) -> bool:
        """Get whether the shots would separate what competes."""
        return bool(self.shots)

    @property
    def separation(self) -> float:
        """Get the separation that the shots promise, whichever separable member is the true one."""
        told = [value for name, value in self.expected.items() if name not in self.inseparable]
        return min(told, default=max(self.expected.values(), default=0.0))

    def to_json(self) -> dict[str, Any]:
        """Return the plan as the result file has it (docs/formats.md)."""
        return {
            "shots": [shot.to_json() for shot in self.shots],
            "between": list(self.members),
            "expected_if": dict(self.expected),
            "best_separation": self.best,
            "inseparable": list(self.inseparable),
            "one_with": {name: list(others) for name, others in self.one_with.items()},
        }


def plan(
    contest: Contest,
    reach: Reach | None = None,
    *,
    most: int = MOST_SHOTS,
    progress: Progress = lambda _what, _fraction: None,
    stop: Stop = lambda: False,
) -> Plan:
    """Return the cheapest sequence of at most ``most`` shots that separates what competes.  Raises Cancelled."""
    shots = contest.members[0].fitted.hypothesis.data.shots

    def screening(done: float) -> None:
        progress("foretelling the next shots", _SCREENING * done)

    distances = screened(contest, next_shots(shots, reach or Reach()), screening, stop)
    on_the_block = shots[-1].moving_mass_kg - as_found_kg(shots)

    def refitting(done: float) -> None:
        progress("refitting the rivals", _SCREENING + (1 - _SCREENING) * done)

    never = distances.never(most)
    while True:
        left = distances.without(never) if len(never) < len(distances.at_hand) else distances
        chosen, found = _chosen(contest, left, most, on_the_block, refitting, stop)
        if chosen is not None or left is distances:
            break
        most_of = {pair: max((values[pair] for values in found.values()), default=0.0) for pair in left.at_hand}
        more = {pair for pair, value in most_of.items() if value < CRITERIA.separation}
        # Each is parted by some sequence and no sequence parts them all, or none is and all were just tried.
        if not more or (not never and len(more) == len(distances.at_hand)):
            break
        never |= more
    names = [member.effect for member in contest.members]
    of = _most_of({shots: nearest(values) for shots, values in found.items()})

    def named(values: Mapping[int, float]) -> dict[str, float]:
        return {names[member]: value for member, value in sorted(values.items())}

    if chosen is None:
        first = expected = named(of)
    else:
        chosen = in_order(chosen, on_the_block)
        expected = named(nearest(_found(found, chosen)))
        first = expected
        if len(chosen) > 1:
            first = named(nearest(refitted(contest, chosen[:1], left, stop)))
    one_with = _one_with(names, never) if chosen is not None and left is not distances else {}
    likely = [names[member] for member in distances.members]
    return Plan(
        shots=chosen or (),
        members=tuple(names),
        now=contest.reached_from(one_with.get(names[0], ())),
        expected=expected,
        after_first=first,
        best=max(of.values(), default=0.0),
        inseparable=tuple(name for name in likely if named(of).get(name, 0.0) < CRITERIA.separation),
        one_with=one_with,
    )


def _one_with(names: Sequence[str], never: Collection[Pair]) -> dict[str, tuple[str, ...]]:
    return {names[a]: tuple(names[b] for one, b in sorted(never) if one == a) for a in sorted({a for a, _ in never})}


def _chosen(
    contest: Contest, distances: Distances, most: int, on_the_block_kg: float, tell: Tell, stop: Stop
) -> tuple[Shots | None, dict[Shots, dict[Pair, float]]]:
    """Return the sequence to take, None where none tried separates, and what every one that was refitted brings."""
    found: dict[Shots, dict[Pair, float]] = {}
    searched: set[Shots] = set()
    chosen: Shots | None = None

    def of_members() -> Found:
        return {shots: nearest(values) for shots, values in found.items()}

    def sure(shots: Shots) -> bool:
        return _worth(of_members(), nearest(found[shots])) >= CRITERIA.separation + SURE

    for length in range(1, most + 1):
        listed = _ranked(distances, length, on_the_block_kg)
        promising = [one for one in listed if hopeful(max(distances.nearest(one).values()))]
        for sequence in promising[:_REFITTED] or (listed[:1] if length == most else ()):
            if stop():
                raise Cancelled
            tell((length - 1) / most)
            found[sequence] = refitted(contest, sequence, distances, stop)
            if sure(sequence):  # they come in the order of their effort
                break
        chosen = _best(of_members(), on_the_block_kg)
        while chosen is not None and chosen not in searched and (sure(chosen) or length == most):
            searched.add(chosen)
            found[chosen] = searched_anew(contest, chosen, found[chosen], distances, stop)
            chosen = _best(of_members(), on_the_block_kg)
        if chosen is not None and sure(chosen):
            break
    return chosen, found


def _ranked(distances: Distances, length: int, on_the_block_kg: float) -> list[Shots]:
    """Return sequences of one length, best first: to first order, by the worst of the members that can be separated.

    Of several shots those are tried that do well alone, for any member.
    """
    alone: dict[NextShot, dict[int, float]] = {shot: distances.nearest((shot,)) for shot in distances.each}
    sequences: list[Shots] = [(shot,) for shot in alone]
    if length > 1:
        kept: dict[NextShot, None] = {}
        for member in distances.members:
            best = sorted((-values[member], place, shot) for place, (shot, values) in enumerate(alone.items()))
            kept.update(dict.fromkeys(shot for *_, shot in best[: _KEPT // len(distances.members) + 1]))
        sequences = list(combinations_with_replacement(kept, length))
    apart = {sequence: distances.nearest(sequence) for sequence in sequences}

    def order(sequence: Shots) -> tuple[float, float]:
        worth = _worth(apart, apart[sequence])
        return (effort(sequence, on_the_block_kg) if worth >= CRITERIA.separation + SURE else inf, -worth)

    return sorted(sequences, key=order)


def _most_of(found: Found) -> dict[int, float]:
    """Return the most that any of these sequences brings every member."""
    out: dict[int, float] = {}
    for values in found.values():
        for member, value in values.items():
            out[member] = max(out.get(member, 0.0), value)
    return out


def _worth(found: Found, values: Mapping[int, float]) -> float:
    """Return the least separation among the members that some sequence separates; the largest where none does."""
    can = [member for member, most in _most_of(found).items() if most >= CRITERIA.separation]
    return min((values[m] for m in can), default=max(values.values()))


def _best(found: Found, on_the_block_kg: float) -> Shots | None:
    """Return the cheapest sequence that surely separates, else the best that does at all, else None."""
    worth = {sequence: _worth(found, values) for sequence, values in found.items()}
    sure = [one for one in worth if worth[one] >= CRITERIA.separation + SURE]
    if sure:
        return min(sure, key=lambda one: (effort(one, on_the_block_kg), -worth[one]))
    best = max(worth, key=worth.__getitem__, default=None)
    return best if best is not None and worth[best] >= CRITERIA.separation else None


def _found(found: Mapping[Shots, Pairs], shots: Sequence[NextShot]) -> Pairs:
    return next(values for one, values in found.items() if sorted(one, key=repr) == sorted(shots, key=repr))
