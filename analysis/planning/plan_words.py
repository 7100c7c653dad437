"""A plan in words for the operator."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from analysis.collision import Effect
from analysis.diagnosis import ONE_WITH_TWO_READINGS
from analysis.planning.next_shot import NextShot

if TYPE_CHECKING:
    from analysis.planning.plan import Plan

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six")


def plan_sentence(plan: Plan) -> str:
    *others, last = (effect.short_words for effect in plan.members)
    listed = f"{', '.join(others)} and {last}" if others else last
    if not plan.settles:
        most = f"the best would reach {plan.best:.2g} noise norms"
        return f"No shot of this rig tells {listed} apart: {most}{_because(plan.members)}."
    open_ones = [effect.short_words for effect in plan.expected if effect in plan.inseparable]
    but = f"; were it {' or '.join(open_ones)}, no shot would" if open_ones else ""
    same = "".join(f"; {pair} stay one{why}" for pair, why in _ones(plan))
    apart = f"{plan.separation:.2g} noise norms (now {plan.now:.2g})"
    return f"{shots(plan.shots)} would tell {listed} apart by {apart}{but}{same}."


def with_words(plan: Plan) -> dict[str, Any]:
    """Return the plan as the result file has it, with its sentence."""
    return {**plan.to_json(), "words": plan_sentence(plan)}


def shots(sequence: Sequence[NextShot]) -> str:
    """Return shots in words, equal ones counted together."""
    counted: dict[str, int] = {}
    for shot in sequence:
        counted[shot.words] = counted.get(shot.words, 0) + 1
    parts = [f"{_NUMBERS[n] if n < len(_NUMBERS) else n} shot{'s' if n > 1 else ''} at {w}" for w, n in counted.items()]
    text = " and ".join(parts)
    return text[:1].upper() + text[1:]


def _ones(plan: Plan) -> list[tuple[str, str]]:
    """Return the inseparable pairs in words, each with the reason where it is known."""
    never = plan.inseparable_from
    pairs = dict.fromkeys(frozenset({one, other}) for one, others in never.items() for other in others)
    return [(" and ".join(e.short_words for e in plan.members if e in pair), _because(pair)) for pair in pairs]


def _because(effects: Iterable[Effect]) -> str:
    names = {effect.name for effect in effects}
    same = [words for pair, words in ONE_WITH_TWO_READINGS.items() if pair <= names]
    return f" ({'; '.join(same)})" if same else ""
