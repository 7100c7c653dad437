"""Wider variants of effects, tried where the narrow one was found: a frame that shakes the plate and the optics.

A wider effect has the narrow one's parameters and one more.  It is fitted in its place, starting at its parameters.
"""

from collections.abc import Iterable

from analysis.collision import CATALOGUE, WIDER, Effect, Infeasible
from analysis.inference import Fitted, Point, TrialEffect, trial_effect
from analysis.shot import Stop


def contained_effects(effects: Iterable[Effect]) -> set[Effect]:
    """Return the effects that these contain, which therefore cannot join in addition to them."""
    return {CATALOGUE[effect.widens] for effect in effects if effect.widens}


def wider_fits(here: Fitted, effect: Effect, stop: Stop) -> list[Fitted]:
    """Return the fits with one effect replaced by each of its wider variants, started at its parameters."""
    rows = [row for row in WIDER.values() if row.widens == effect.key]
    if here.problem.data.base.one_body:
        rows = [row for row in rows if row.one_body]
    found = [_fitted(here, effect, trial_effect(row), stop) for row in rows]
    return [fitted for fitted in found if fitted is not None]


def _fitted(here: Fitted, narrow: Effect, kind: TrialEffect, stop: Stop) -> Fitted | None:
    effects = (kind if one.effect == narrow else one for one in here.problem.effects)
    problem = here.problem.with_effects(effects, here.problem.without_effect(narrow).fixed)
    effective = here.effective
    values = tuple(
        {key: given for key, given in of.items() if key != narrow} | {kind.effect: {**kind.starts[0], **of[narrow]}}
        for of in effective.values
    )
    try:
        return problem.fit(problem.pack_effective(Point(effective.base, effective.own, values)), cancelled=stop)
    except Infeasible:
        return None
