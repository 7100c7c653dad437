"""Forward selection of effects: score all, fit the best jointly from several starts, keep those that pay."""

import contextlib
import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

from analysis.collision import CATALOGUE, WIDER_EFFECTS, Effect, Infeasible
from analysis.compiled import side_by_side
from analysis.diagnosis.findings.criteria import CRITERIA, may_beat
from analysis.diagnosis.search.time_limit import Limit
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
    trial_effect,
    with_both_effects,
)
from analysis.shot import Cancelled, Stop

Result = TypeVar("Result")
REFITTED = 5
EXTRA_CANDIDATES = 3  # further ones, where the residual is far above noise
WORTH_FINISHING = 40.0  # BIC behind the best after a short search, up to which a longer search is worth its time
WORTH_FITTING = 8.0  # score gain; with less, a fit never lowers the BIC by as much as required
UNLEARNED_NOISE_CANDIDATES = 3  # further ones: the best scores under noise that has not absorbed what the model lacks
RESTARTS = 2  # other first effects from which the search restarts if a residual remains
RESTARTS_IN_WANDERING_NOISE = 4  # the same if the noise wanders: it absorbs most of what either of two effects explains
RESTART_CANDIDATES = 3  # fitted per step of a restart: once the first effect is right, the right next one scores best
EXPLAINED = 1.1  # chi^2 per sample under noise that was not learned: clean sets 0.91 to 1.05, a wrong minimum 22
CLOSE = 500.0  # BIC between two fits; with more, one of them may be in a wrong minimum
_REPEAT_BIC = 30.0  # a fit without an effect is repeated if it is worse, and the full fit has gained, by this much BIC


@dataclass
class Trail:
    """The record of a search from ``start``: first score of every effect of ``catalogue``, best fit of every set."""

    start: Fitted
    catalogue: Sequence[TrialEffect]
    stop: Stop
    scores: dict[Effect, Score] = field(default_factory=dict)
    fits: dict[frozenset[Effect], Fitted] = field(default_factory=dict)
    elsewhere: dict[frozenset[Effect], list[Fitted]] = field(default_factory=dict)  # at other frequencies or ranges
    last: Linearised | None = None  # of the last round
    # for each fit made by removing an effect: the BIC of the fit from which it was removed
    removed_from_bic: dict[frozenset[Effect], float] = field(default_factory=dict)
    limit: Limit | None = None
    beat: float = math.inf  # stop when this BIC of a rival search can no longer be beaten
    compared: bool = False  # whether there was time to compare the effects of the catalogue

    def __post_init__(self) -> None:
        self.keep(self.start)

    def raise_if_cancelled(self) -> None:
        """Raise Cancelled if asked to stop."""
        if self.stop():
            raise Cancelled

    def within(self, what: str, work: Callable[[], Result], otherwise: Result) -> Result:
        """Return the result of ``work``; if time runs out first, note ``what`` as left out and return ``otherwise``."""
        if self.limit is None:
            return work()
        stop, self.stop = self.stop, self.limit
        try:
            return self.limit.within(what, work, otherwise)
        finally:
            self.stop = stop

    def added(self, fitted: Fitted) -> list[Effect]:
        """Return the effects of a fit that the start lacks."""
        return [effect for effect in fitted.effects if effect not in self.start.effects]

    def least_fall(self, floor: Floor | None = None) -> float:
        """Return by how much the best effect of the catalogue must lower the BIC to join, under the noise ``floor``."""
        # Under wandering noise one parameter gains by chance three times what it gains under white noise.
        return CRITERIA.fall(len(self.catalogue), wandering=floor is not None and bool(floor.wander))

    def pays(self, fitted: Fitted, fewer: Fitted) -> bool:
        """Return whether a fit lowers the BIC of ``fewer``, which has fewer effects, by as much as required."""
        return fewer.bic - fitted.bic >= self.least_fall(fitted.noise)

    @property
    def nothing_pays(self) -> bool:
        """Get whether no fit of the search lowers the BIC of the start by as much as required."""
        return not any(self.pays(fitted, self.start) for fitted in self.fits.values())

    def keep(self, fitted: Fitted) -> None:
        """Keep a fit unless a better one of the same effects is known."""
        key = frozenset(fitted.effects)
        if key not in self.fits or fitted.bic < self.fits[key].bic:
            self.fits[key] = fitted

    def linearised(self, fitted: Fitted) -> Linearised:
        """Return a fit linearised; trajectories of the last linearised fit are reused where still valid."""
        if self.last is not None and self.last.problem is fitted.problem and self.last.z is fitted.z:
            return self.last
        return fitted.linearise(near=self.last)

    def alone(self) -> list[Fitted]:
        """Return the fits with exactly one effect more than the start, the likeliest first."""
        single = len(self.start.effects) + 1
        found = [fitted for key, fitted in self.fits.items() if len(key) == single and len(self.added(fitted)) == 1]
        return sorted(found, key=lambda fitted: fitted.bic)

    def of(self, effects: Iterable[Effect]) -> Fitted | None:
        """Return the best fit of these effects, if there is one."""
        return self.fits.get(frozenset(effects))

    def begun_at(self, start: Fitted) -> "Trail":
        """Return the empty record of the same search from another start."""
        return Trail(start, self.catalogue, self.stop, limit=self.limit, beat=self.beat)


def restart_from_other_effects(best: Fitted, trail: Trail, most: int = RESTARTS) -> Fitted:
    """Restart the search from ``most`` other first effects: two correlated effects can imitate a third."""
    firsts = [fitted for fitted in trail.alone() if not set(fitted.effects) <= set(best.effects)][:most]
    ends = [
        add_effects(converge(first, trail, from_white=True), trail, CRITERIA.most_effects - 1, RESTART_CANDIDATES)
        for first in firsts
    ]
    return min([best, *ends], key=lambda fitted: fitted.bic)


def best_untried_pair(trail: Trail) -> Fitted | None:
    """Return the best fit of two effects that were fitted separately but not yet jointly, or None.

    A third effect that imitates both may be found first; neither of the two then pays given the third.
    """
    firsts = [fitted for fitted in trail.alone() if trail.pays(fitted, trail.start)][: RESTART_CANDIDATES + 1]

    def together(two: tuple[Fitted, Fitted]) -> Fitted | None:
        one, other = two
        if contained_effects(one.effects) & {*other.effects} or contained_effects(other.effects) & {*one.effects}:
            return None
        return with_both_effects(one, other, trail.start, trail.stop)

    new = [(a, b) for a, b in itertools.combinations(firsts, 2) if trail.of({*a.effects, *b.effects}) is None]
    fits = [fitted for fitted in side_by_side(together, new) if fitted is not None]
    best = min(fits, key=lambda fitted: fitted.bic, default=None)
    return None if best is None else converge(best, trail)


def add_effects(
    here: Fitted, trail: Trail, most: int = CRITERIA.most_effects, width: int = REFITTED + EXTRA_CANDIDATES
) -> Fitted:
    """Add at most ``most`` effects to ``here``, one at a time, each the best of at most ``width`` candidates."""
    for left in range(most - 1, -1, -1):
        first = len(here.effects) == len(trail.start.effects)
        what = "effects of the catalogue" if first else "a further effect of the catalogue"
        best = trail.within(what, partial(add_best_effect, here, trail, first=first, width=width), None)
        # Either of two true effects alone leaves wandering noise; the threshold for such noise is applied at the end.
        if best is None or here.bic - best.bic < trail.least_fall():
            break
        here = replace_by_wider(_polished_first(best, trail) if first else converge(prune(best, trail), trail), trail)
        if not may_beat(trail.beat, here.bic, trail.start.bic, left):
            break
    return here


def nearly_as_likely(first: Fitted, trail: Trail) -> list[Fitted]:
    """Return a fit of one effect, and the fits of a few other single effects that are nearly as likely.

    Its look-alikes are left out: no later step changes their order, and they are fitted in its place at the end.
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
    return [first, *near][:RESTART_CANDIDATES]


def _polished_first(best: Fitted, trail: Trail) -> Fitted:
    """Return the fit of the likeliest first effect, after bringing each contender to its minimum.

    Noise learned in a wrong minimum absorbs less of an effect that has more parameters: a fast viscoelastic arm seems
    far likelier than the plate damping that it imitates.  A simpler look-alike may thus be further behind than others.
    """
    (effect,) = trail.added(best)
    near = nearly_as_likely(best, trail)
    simpler = [
        one
        for one in trail.alone()
        for other in trail.added(one)
        if one not in near and one.bic < best.bic + CLOSE and effect.has_simpler_look_alike(other)
    ]
    ends = side_by_side(lambda fitted: converge(fitted, trail, from_white=True), [*near, *simpler])
    return min(ends, key=lambda fitted: fitted.bic)


def contained_effects(effects: Iterable[Effect]) -> set[Effect]:
    """Return the effects that these contain, which therefore cannot join in addition to them."""
    return {CATALOGUE[effect.widens] for effect in effects if effect.widens}


def replace_by_wider(here: Fitted, trail: Trail) -> Fitted:
    """Return the fit with each effect replaced by its wider variant where that pays.

    A wider variant has the effect's parameters and one more: a frame that shakes the plate as well as the optics.
    """
    for effect in trail.added(here):
        for trial in wider_fits(here, effect, trail.stop):
            trail.keep(trial)
            if trail.pays(trial, here):
                here = converge(trial, trail)
    return here


def wider_fits(here: Fitted, effect: Effect, stop: Stop) -> list[Fitted]:
    """Return the fits with one effect replaced by each of its wider variants, started at its parameters."""
    found, before, effective = [], here.problem, here.effective
    base = before.data.base
    rows = [row for row in WIDER_EFFECTS.values() if row.widens == effect.key and base.allows(row)]
    for row in rows:
        kind = trial_effect(row)
        effects = (kind if one.effect == effect else one for one in before.effects)
        problem = before.with_effects(effects, before.without_effect(effect).fixed)
        values = tuple(
            {key: given for key, given in of.items() if key != effect} | {row: {**kind.starts[0], **of[effect]}}
            for of in effective.values
        )
        z = problem.pack_effective(Point(effective.base, effective.own, values))
        with contextlib.suppress(Infeasible):
            found.append(problem.fit(z, cancelled=stop))
    return found


def better(fitted: Fitted, other: Fitted) -> bool:
    """Return whether a fit has a lower BIC than another by more than the scatter of a search's end."""
    return fitted.bic < other.bic - CRITERIA.same_end


def converge(fitted: Fitted, trail: Trail, *, from_white: bool = False) -> Fitted:
    """Continue a fit to its minimum: the residual of a short search could pass for one more effect.

    ``from_white``: also restart from white noise, since noise learned in a wrong minimum may keep it there; on a moving
    frame the noise of the flights may do so too.  That happens where the first effect explains what the start
    had left to the noise, hardly ever later, and never where noise that was not learned explains the residual.
    """
    better = fitted.refitted(evaluations=60, anew=True, cancelled=trail.stop)
    if from_white and better.bic < trail.start.bic - CLOSE and _may_hide_something(better):
        white = better.from_white(evaluations=60, cancelled=trail.stop)
        white = white.refitted(evaluations=60, anew=True, cancelled=trail.stop)
        better = min(better, white, key=lambda one: one.bic)
    if better.log_likelihood < fitted.log_likelihood - (0.5 if better.converged else 0.0):
        return fitted
    trail.fits[frozenset(better.effects)] = better
    return better


def _may_hide_something(fitted: Fitted) -> bool:
    """Return whether the learned noise has absorbed a residual that noise that was not learned does not explain."""
    return fitted.noise.coloured and fitted.chi2(fitted.unlearned_noise) > EXPLAINED * fitted.samples


def add_best_effect(
    here: Fitted, trail: Trail, *, first: bool = False, width: int = REFITTED + EXTRA_CANDIDATES
) -> Fitted | None:
    """Return the best fit with one more effect, out of the ``width`` best scores; None where no effect scored."""
    at = trail.linearised(here)
    trail.last = at
    there = {*here.effects, *contained_effects(here.effects)}
    free = [kind for kind in trail.catalogue if kind.effect not in there]
    ranked = _ranked(at, free, trail)
    if first:
        trail.scores.update({listed[0].kind.effect: listed[0] for listed in ranked})
    far_above_noise = float(at.left @ at.left) > 1.5 * at.left.size or not here.converged
    tried = _starts_worth_fitting(ranked, width, first=first, far_above_noise=far_above_noise)
    if first and here.noise.site:
        # Frame motion that was computed with the base model may reverse the apparent sign of an effect.
        turned = (opposite(score) for score in tried if score.gain > WORTH_FITTING)
        tried += [score for score in turned if score is not None]
    if here.noise.coloured:
        tried += _absorbed_by_noise(_ranked(at.under(here.unlearned_noise), free, trail), tried)
    short = _refitted(at, tried, trail.stop)
    if not first:
        short += _with_single_effects(here, tried, trail)
    fits = _continued(short, 2 if far_above_noise else 1, trail.stop)
    for fitted in fits:
        trail.keep(fitted)
    trail.compared |= first
    return min(fits, key=lambda fitted: fitted.bic, default=None)


def _starts_worth_fitting(
    ranked: Sequence[list[Score]], width: int, *, first: bool, far_above_noise: bool
) -> list[Score]:
    """Return the starts from which the best of at most ``width`` ranked effects are fitted, two for the best two.

    The first round compares effects; later rounds only look for further ones.
    """
    compared = (REFITTED if ranked and ranked[0][0].gain > WORTH_FITTING else 2) if first else 0
    most = min(width, REFITTED + EXTRA_CANDIDATES if far_above_noise else REFITTED)
    return [
        score
        for place, listed in enumerate(ranked[:most])
        if far_above_noise or place < compared or listed[0].gain > WORTH_FITTING
        for score in distinct_starts(listed)[: 1 if place >= 2 else 2]
    ]


def _absorbed_by_noise(ranked_without: Sequence[list[Score]], tried: Sequence[Score]) -> list[Score]:
    """Return the best starts ranked under noise that was not learned from the residual, of effects not yet tried.

    Noise that was learned from the residual may have absorbed an effect.
    """
    effects = {score.kind.effect for score in tried}
    best = (listed[0] for listed in ranked_without[:UNLEARNED_NOISE_CANDIDATES])
    return [score for score in best if score.kind.effect not in effects]


def _with_single_effects(here: Fitted, tried: Sequence[Score], trail: Trail) -> list[Fitted | None]:
    """Return the fits of ``here`` jointly with those effects of ``tried`` that pay alone, started at their own fits."""
    known = [trail.of((*trail.start.effects, effect)) for effect in dict.fromkeys(score.kind.effect for score in tried)]
    alone = [fitted for fitted in known if fitted is not None and trail.pays(fitted, trail.start)]
    return side_by_side(lambda fitted: with_both_effects(here, fitted, trail.start, trail.stop), alone)


def _continued(short: Sequence[Fitted | None], least: int, stop: Stop) -> list[Fitted]:
    """Return short fits, the likeliest first; at least ``least`` and those nearly as likely are continued."""
    quick = sorted((trial for trial in short if trial is not None), key=lambda trial: trial.bic)

    def continued(place: int) -> Fitted:
        near = quick[place].bic < quick[0].bic + WORTH_FINISHING and place < REFITTED
        return quick[place].refitted(evaluations=16, cancelled=stop) if near or place < least else quick[place]

    return side_by_side(continued, range(len(quick)))


def _refitted(at: Linearised, tried: Sequence[Score], stop: Stop) -> list[Fitted | None]:
    """Return short fits from these starts, in order; each stops early where it is far behind the best before it.

    The first runs alone, the others in pairs, so that one core gives the same result as two.
    """
    out: list[Fitted | None] = []
    while len(out) < len(tried):
        least = min((trial.bic for trial in out if trial is not None), default=math.inf)

        def fit(score: Score, least: float = least) -> Fitted | None:
            return refit(at, score.kind, score.start, stop, least_bic=least)

        out += side_by_side(fit, tried[len(out) : len(out) + (2 if out else 1)])
    return out


def _ranked(at: Linearised, free: Sequence[TrialEffect], trail: Trail) -> list[list[Score]]:
    """Return the scores of every effect that has any, ranked by gain less the BIC's price of its parameters."""
    listed = at.screen(free, trail.stop, to_join=CRITERIA.least_fall)
    return sorted(listed, key=lambda one: -one[0].worth(at.left.size))


def without(fitted: Fitted, effect: Effect, trail: Trail) -> Fitted | None:
    """Return the fit with one effect removed: the known one, or the better of it and one made now.

    A fit made before the other effects were found may have stopped in another minimum.
    """
    left = frozenset(fitted.effects) - {effect}
    known = trail.of(left)
    sure = not left or trail.removed_from_bic.get(left, math.inf) < fitted.bic + _REPEAT_BIC
    if known is not None and (sure or (known.converged and known.bic < fitted.bic + _REPEAT_BIC)):
        return known
    trail.removed_from_bic[left] = fitted.bic
    trial = without_effect(fitted, effect, trail.stop)
    if trial is None:
        return known
    trail.keep(trial)
    return trail.of(left)


def without_effect(fitted: Fitted, effect: Effect, stop: Stop) -> Fitted | None:
    """Return the fit with one effect removed, started at its other parameters; None where nothing can be fitted."""
    problem = fitted.problem.without_effect(effect)
    effective = fitted.effective
    values = tuple({key: value for key, value in v.items() if key != effect} for v in effective.values)
    z = problem.pack_effective(Point(effective.base, effective.own, values))
    try:
        return problem.fit(z, anew=True, cancelled=stop)
    except Infeasible:
        return None


def prune(fitted: Fitted, trail: Trail) -> Fitted:
    """Remove effects that a later one has made unnecessary."""
    while True:
        removable = trail.added(fitted)
        if len(removable) < 2:
            return fitted
        fewer = side_by_side(partial(without, fitted, trail=trail), removable)
        best = min((f for f in fewer if f is not None), key=lambda f: f.bic, default=None)
        if best is None or trail.pays(fitted, best):
            return fitted
        fitted = best
