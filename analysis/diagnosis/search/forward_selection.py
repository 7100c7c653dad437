"""Forward selection of effects: score all, fit the best jointly from several starts, keep those that pay."""

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

from analysis.collision import Effect, Infeasible
from analysis.compiled import side_by_side
from analysis.diagnosis.limit import Limit
from analysis.diagnosis.search.wider_effects import narrower, widened
from analysis.diagnosis.verdict.criteria import CRITERIA, may_reach
from analysis.inference import (
    Fitted,
    Floor,
    Linearised,
    Point,
    Score,
    TrialEffect,
    distinct_starts,
    opposite,
    refit,
    with_both_effects,
)
from analysis.shot import Cancelled, Stop

Result = TypeVar("Result")
REFITTED = 5
STRONGER = 3  # more, where the residual is far above noise
WORTH_FINISHING = 40.0  # of the criterion behind the best after a short search: worth a longer one
WORTH_FITTING = 8.0  # of gain; a fit that promises less never makes the fall that is required
UNLEARNED = 3  # more, of those that do best under a noise that has not absorbed what the model lacks
OTHER_FIRSTS = 2  # first effects to begin with where those that were found leave a residual ...
FIRSTS_IN_WANDER = 4  # ... or a noise that wanders: it takes up most of what either of two effects does alone
NARROW = 3  # of those that score best are fitted in such a search, where the right one leads
EXPLAINED = 1.1  # chi^2 per sample under a noise that was not learnt: clean sets 0.91 to 1.05, a wrong valley 22
CLOSE = 500.0  # of the criterion, to another fit: further off, one of them may be in a wrong valley
_ANEW = 30.0  # of the criterion, by which a fit is worse without an effect, or better than when that was last asked


@dataclass
class Trail:
    """A search from ``start`` through ``catalogue``: every effect's first score, and every best fit on the way."""

    start: Fitted
    catalogue: Sequence[TrialEffect]
    stop: Stop
    scores: dict[Effect, Score] = field(default_factory=dict)
    fits: dict[frozenset[Effect], Fitted] = field(default_factory=dict)
    elsewhere: dict[frozenset[Effect], list[Fitted]] = field(default_factory=dict)  # at other frequencies or ranges
    last: Linearised | None = None  # of the last round
    # of each fit made from one with an effect more: the criterion of that one
    asked: dict[frozenset[Effect], float] = field(default_factory=dict)
    widens: bool = True  # try the wider of two effects where the narrow one was found
    limit: Limit | None = None
    beat: float = math.inf  # the criterion of a likelier search: what cannot come below it is not followed
    compared: bool = False  # whether there was time to compare the effects of the catalogue

    def __post_init__(self) -> None:
        self.keep(self.start)

    def go_on(self) -> None:
        """Raise Cancelled if asked to stop."""
        if self.stop():
            raise Cancelled

    def within(self, what: str, work: Callable[[], Result], otherwise: Result) -> Result:
        """Return the result of ``work``; where the time is over before it ends ``otherwise``, and note ``what``."""
        if self.limit is None:
            return work()
        stop, self.stop = self.stop, self.limit
        try:
            return self.limit.within(what, work, otherwise)
        finally:
            self.stop = stop

    def added(self, fitted: Fitted) -> list[Effect]:
        """Return the effects that a fit has and the start has not."""
        return [effect for effect in fitted.effects if effect not in self.start.effects]

    def least_fall(self, floor: Floor | None = None) -> float:
        """Return by how much the best of the catalogue must lower the criterion to join, with the noise ``floor``."""
        # With a path that wanders one number gains by chance three times what it gains with white noise.
        return CRITERIA.fall(len(self.catalogue), wandering=floor is not None and bool(floor.wander))

    def pays(self, fitted: Fitted, fewer: Fitted) -> bool:
        """Return whether a fit explains enough more than ``fewer``, which has fewer effects."""
        return fewer.bic - fitted.bic >= self.least_fall(fitted.noise)

    @property
    def nothing_pays(self) -> bool:
        """Get whether no fit on the way explains enough more than the start."""
        return not any(self.pays(fitted, self.start) for fitted in self.fits.values())

    def keep(self, fitted: Fitted) -> None:
        """Keep a fit unless a better one of the same effects is there."""
        key = frozenset(fitted.effects)
        if key not in self.fits or fitted.bic < self.fits[key].bic:
            self.fits[key] = fitted

    def linearised(self, fitted: Fitted) -> Linearised:
        """Return a fit linearised, with the trajectories of the last one where those serve."""
        if self.last is not None and self.last.problem is fitted.problem and self.last.z is fitted.z:
            return self.last
        return fitted.linearise(near=self.last)

    def alone(self) -> list[Fitted]:
        """Return the fits with one effect more than the start, the likeliest first."""
        single = len(self.start.effects) + 1
        found = [fitted for key, fitted in self.fits.items() if len(key) == single and len(self.added(fitted)) == 1]
        return sorted(found, key=lambda fitted: fitted.bic)

    def of(self, effects: Iterable[Effect]) -> Fitted | None:
        """Return the best fit of these effects, if there is one."""
        return self.fits.get(frozenset(effects))


def explore(
    start: Fitted,
    catalogue: Sequence[TrialEffect],
    stop: Stop,
    *,
    most: int = CRITERIA.most_effects,
    widens: bool = True,
    limit: Limit | None = None,
    beat: float = math.inf,
) -> tuple[Fitted, Trail]:
    """Return the best fit with at most ``most`` effects more than ``start`` has, and what was tried."""
    trail = Trail(start, catalogue, stop, widens=widens, limit=limit, beat=beat)
    return climb(start, trail, most), trail


def another_way(best: Fitted, trail: Trail, most: int = OTHER_FIRSTS) -> Fitted:
    """Restart the search from ``most`` other first effects: two that depend on each other may look like a third."""
    firsts = [fitted for fitted in trail.alone() if not set(fitted.effects) <= set(best.effects)][:most]
    ends = [climb(polish(first, trail, from_white=True), trail, CRITERIA.most_effects - 1, NARROW) for first in firsts]
    return min([best, *ends], key=lambda fitted: fitted.bic)


def paired(trail: Trail) -> Fitted | None:
    """Return the best fit of two effects that were fitted alone and not yet together, or None.

    A third that looks like both may be found first, and neither pays beside it.
    """
    firsts = [fitted for fitted in trail.alone() if trail.pays(fitted, trail.start)][: NARROW + 1]

    def together(two: tuple[Fitted, Fitted]) -> Fitted | None:
        one, other = two
        if narrower(one.effects) & {*other.effects} or narrower(other.effects) & {*one.effects}:
            return None
        return with_both_effects(one, other, trail.start, trail.stop)

    new = [(a, b) for a, b in itertools.combinations(firsts, 2) if trail.of({*a.effects, *b.effects}) is None]
    fits = [fitted for fitted in side_by_side(together, new) if fitted is not None]
    best = min(fits, key=lambda fitted: fitted.bic, default=None)
    return None if best is None else polish(best, trail)


def climb(here: Fitted, trail: Trail, most: int = CRITERIA.most_effects, width: int = REFITTED + STRONGER) -> Fitted:
    """Return the best fit with at most ``most`` effects more than ``here``, one at a time, of ``width`` at most."""
    for left in range(most - 1, -1, -1):
        first = len(here.effects) == len(trail.start.effects)
        what = "effects of the catalogue" if first else "a further effect of the catalogue"
        best = trail.within(what, partial(extend, here, trail, first=first, width=width), None)
        # Each of two effects alone leaves a noise that wanders; what that requires is tested at the end.
        if best is None or here.bic - best.bic < trail.least_fall():
            break
        here = wider(_polished_first(best, trail) if first else polish(prune(best, trail), trail), trail)
        if not may_reach(trail.beat, here.bic, trail.start.bic, left):
            break
    return here


def nearly_as_likely(first: Fitted, trail: Trail) -> list[Fitted]:
    """Return a fit of one effect, and those of one other that are nearly as likely, a few at most.

    Not its look-alikes, whose order nothing on the way changes: they are fitted in its place at the end.
    """
    if first is trail.start:
        return [first]
    alike = {name for effect in trail.added(first) for name in effect.look_alikes}
    near = [
        one
        for one in trail.alone()
        if one is not first
        and one.bic < first.bic + CRITERIA.nearly
        and not any(effect.name in alike for effect in trail.added(one))
    ]
    return [first, *near][:NARROW]


def _polished_first(best: Fitted, trail: Trail) -> Fitted:
    """Return the likeliest first effect, each that may be it brought to its minimum.

    Noise learnt in a wrong valley takes less of what an effect with more parameters explains: a quick arm seems far
    likelier than the damping of the plate that it imitates, so a simpler look-alike may be further behind than others.
    """
    (effect,) = trail.added(best)
    near = nearly_as_likely(best, trail)
    simpler = [
        one
        for one in trail.alone()
        for other in trail.added(one)
        if one not in near and one.bic < best.bic + CLOSE and effect.has_simpler_look_alike(other)
    ]
    ends = side_by_side(lambda fitted: polish(fitted, trail, from_white=True), [*near, *simpler])
    return min(ends, key=lambda fitted: fitted.bic)


def wider(here: Fitted, trail: Trail) -> Fitted:
    """Return the fit with the wider effect in the place of each that has one, where that pays."""
    for effect in trail.added(here) if trail.widens else []:
        for trial in widened(here, effect, trail.stop):
            trail.keep(trial)
            if trail.pays(trial, here):
                here = polish(trial, trail)
    return here


def better(fitted: Fitted, other: Fitted) -> bool:
    """Return whether a fit is more likely than another by more than where a search happens to stop."""
    return fitted.bic < other.bic - CRITERIA.same_end


def polish(fitted: Fitted, trail: Trail, *, from_white: bool = False) -> Fitted:
    """Return the fit brought to its minimum: what a short search leaves would call for one more effect.

    ``from_white``: also search anew from white noise, since noise learnt in a wrong valley may hold the search there,
    on a moving frame also the noise that the flights show.  That happens where the first effect of a search takes what
    the start had left to the noise, hardly ever later, and never where a noise that was not learnt explains all.
    """
    better = fitted.fitted_on(evaluations=60, anew=True, cancelled=trail.stop)
    if from_white and better.bic < trail.start.bic - CLOSE and _may_hide_something(better):
        white = better.from_white(evaluations=60, cancelled=trail.stop)
        white = white.fitted_on(evaluations=60, anew=True, cancelled=trail.stop)
        better = min(better, white, key=lambda one: one.bic)
    if better.log_likelihood < fitted.log_likelihood - (0.5 if better.converged else 0.0):
        return fitted
    trail.fits[frozenset(better.effects)] = better
    return better


def _may_hide_something(fitted: Fitted) -> bool:
    """Return whether the learnt noise has taken up what a noise that was not learnt does not explain."""
    return fitted.noise.coloured and fitted.chi2(fitted.unlearned_noise) > EXPLAINED * fitted.samples


def extend(here: Fitted, trail: Trail, *, first: bool = False, width: int = REFITTED + STRONGER) -> Fitted | None:
    """Return the best fit with one effect more of the ``width`` that score best, or None where nothing scored."""
    at = trail.linearised(here)
    trail.last = at
    there = {*here.effects, *narrower(here.effects)}
    free = [kind for kind in trail.catalogue if kind.effect not in there]
    ranked = _ranked(at, free, trail)
    if first:
        trail.scores.update({listed[0].kind.effect: listed[0] for listed in ranked})
    strong = float(at.left @ at.left) > 1.5 * at.left.size or not here.converged
    # The first round compares, later ones only look for more.
    compared = (REFITTED if ranked and ranked[0][0].gain > WORTH_FITTING else 2) if first else 0
    tried = [
        score
        for place, listed in enumerate(ranked[: min(width, REFITTED + STRONGER if strong else REFITTED)])
        if strong or place < compared or listed[0].gain > WORTH_FITTING
        for score in distinct_starts(listed)[: 1 if place >= 2 else 2]
    ]
    if first and here.noise.site:
        # The frame's motion as the base model has it may turn round what an effect seems to do.
        turned = (opposite(score) for score in tried if score.gain > WORTH_FITTING)
        tried += [score for score in turned if score is not None]
    if here.noise.coloured:
        # The noise was learnt from the residual and may have absorbed an effect.
        scored = {score.kind.effect for score in tried}
        other = _ranked(at.under(here.unlearned_noise), free, trail)[:UNLEARNED]
        tried += [listed[0] for listed in other if listed[0].kind.effect not in scored]
    refitted = _refitted(at, tried, trail.stop)
    known = {score.kind.effect: trail.of((*trail.start.effects, score.kind.effect)) for score in tried if not first}
    alone = [fitted for fitted in known.values() if fitted is not None and trail.pays(fitted, trail.start)]
    refitted += side_by_side(lambda fitted: with_both_effects(here, fitted, trail.start, trail.stop), alone)
    quick = sorted((trial for trial in refitted if trial is not None), key=lambda trial: trial.bic)

    def finished(place: int) -> Fitted:
        trial = quick[place]
        near = trial.bic < quick[0].bic + WORTH_FINISHING and place < REFITTED
        if near or place < 1 or (strong and place < 2):
            return trial.fitted_on(evaluations=16, cancelled=trail.stop)
        return trial

    best: Fitted | None = None
    for trial in side_by_side(finished, range(len(quick))):
        trail.keep(trial)
        if best is None or trial.bic < best.bic:
            best = trial
    trail.compared = trail.compared or first
    return best


def _refitted(at: Linearised, tried: Sequence[Score], stop: Stop) -> list[Fitted | None]:
    """Return the short fits from these starts, in order; a hopeless one ends at what those before it have reached.

    The first by itself, the others in pairs: the same on one core as on two.
    """
    out: list[Fitted | None] = []
    while len(out) < len(tried):
        least = min((trial.bic for trial in out if trial is not None), default=math.inf)

        def fit(score: Score, least: float = least) -> Fitted | None:
            return refit(at, score.kind, score.start, stop, least_bic=least)

        out += side_by_side(fit, tried[len(out) : len(out) + (2 if out else 1)])
    return out


def _ranked(at: Linearised, free: Sequence[TrialEffect], trail: Trail) -> list[list[Score]]:
    """Return the scores of every effect that has any, the one most worth its parameters first."""
    listed = at.screen(free, trail.stop, to_join=CRITERIA.least_fall)
    return sorted(listed, key=lambda one: -one[0].worth(at.left.size))


def without(fitted: Fitted, effect: Effect, trail: Trail) -> Fitted | None:
    """Return the fit with one effect taken out: the one on the trail, or the better of it and one made now.

    A fit made before the other effects were found may have stopped in another valley.
    """
    left = frozenset(fitted.effects) - {effect}
    known = trail.of(left)
    sure = not left or trail.asked.get(left, math.inf) < fitted.bic + _ANEW
    if known is not None and (sure or (known.converged and known.bic < fitted.bic + _ANEW)):
        return known
    trail.asked[left] = fitted.bic
    trial = without_effect(fitted, effect, trail.stop)
    if trial is None:
        return known
    trail.keep(trial)
    return trail.of(left)


def without_effect(fitted: Fitted, effect: Effect, stop: Stop) -> Fitted | None:
    """Return the fit with one effect taken out, begun at the parameters it has; None where nothing can be fitted."""
    problem = fitted.problem.without_effect(effect)
    effective = fitted.effective
    values = tuple({key: value for key, value in v.items() if key != effect} for v in effective.values)
    z = problem.pack_effective(Point(effective.base, effective.own, values))
    try:
        return problem.fit(z, anew=True, cancelled=stop)
    except Infeasible:
        return None


def prune(fitted: Fitted, trail: Trail) -> Fitted:
    """Take out effects that a later one has made needless."""
    while True:
        removable = trail.added(fitted)
        if len(removable) < 2:
            return fitted
        fewer = side_by_side(partial(without, fitted, trail=trail), removable)
        best = min((f for f in fewer if f is not None), key=lambda f: f.bic, default=None)
        if best is None or trail.pays(fitted, best):
            return fitted
        fitted = best
