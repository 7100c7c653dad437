"""Competing models: an effect's nearest look-alikes, fitted in its place.

To first order two effects may look different that are the same along a bent path: a soft support is a second plate mode
at a frequency of its own.  So the nearest are fitted, beginning where they imitate the effect best.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from analysis.collision import Effect
from analysis.diagnosis.search.forward_selection import Trail, better, without
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.diagnosis.verdict.identifiability import Separation, separation
from analysis.diagnosis.verdict.residual import Residual, residual_of
from analysis.inference import Fitted, Linearised, TrialEffect, refit
from analysis.shot import Cancelled, Stop

Separations = Mapping[Effect, Separation]
Start = tuple[Mapping[str, float], ...]  # an effect's values a shot

_FITTED = 2  # look-alikes of an effect at most
_ALIKE = 0.6  # of an effect's size is left beside a look-alike that is worth a fit
_ONE_LINE = 0.03  # of the frequency
_STRONGER = 10.0
_RINGS = 2  # hidden states of what swings by itself
_HOPELESS = 150.0  # of the criterion behind the best after a short search


def separations_of(best: Fitted, linearised: Linearised, trail: Trail) -> Separations:
    """Return how far each effect that the start lacks is from everything else in the catalogue."""
    return {one: separation(best, linearised, one, trail.catalogue, trail.stop) for one in trail.added(best)}


def with_look_alikes_tried(
    best: Fitted, linearised: Linearised, trail: Trail, predicts: Callable[[Fitted], bool]
) -> tuple[Fitted, Linearised, Separations]:
    """Fit every effect's nearest look-alikes in its place, and return the best fit then, with its separations.

    One that takes the place must predict the held-out shots (``predicts``), as the effect did.
    """
    separations = separations_of(best, linearised, trail)
    likeliest = best
    for effect, separation_of_it in separations.items():
        fewer = without(best, effect, trail)
        if fewer is None:
            continue
        frequency_hz = best.point.values[0][effect].get("frequency_hz")
        near = _nearest(effect, separation_of_it, trail.catalogue)
        known = {kind.effect: _known(trail, fewer, kind, frequency_hz) for kind in near}
        new = [kind for kind in near if known[kind.effect] is None]
        fitted = [one for one in known.values() if one is not None]
        if new:
            beside = trail.linearised(fewer)
            instead = partial(fitted_instead, best, beside, separation_of_it, frequency_hz, trail.stop)
            fitted += [one for kind in new if (one := instead(kind)) is not None]
        for one in fitted:
            trail.keep(one)
            if better(one, likeliest):
                likeliest = one
    if likeliest is best or not predicts(likeliest):
        return best, linearised, separations
    likeliest = likeliest.fitted_on(evaluations=60, cancelled=trail.stop)
    trail.keep(likeliest)
    linearised = trail.linearised(likeliest)
    return likeliest, linearised, separations_of(likeliest, linearised, trail)


def alternative_without_misfit(
    best: Fitted, linearised: Linearised, residual: Residual, trail: Trail, predicts: Callable[[Fitted], bool]
) -> tuple[Fitted, Linearised, Residual]:
    """Return a fit with as many effects, nearly as likely, whose residual is noise; the best if there is none."""
    near = [
        other
        for key, other in trail.fits.items()
        if len(key) == len(best.effects)
        and len(set(key) - set(best.effects)) == 1
        and other.converged
        and other.bic < best.bic + CRITERIA.nearly
    ]
    for other in sorted(near, key=lambda fitted: fitted.bic)[:_FITTED]:
        trail.go_on()
        of_other = trail.linearised(other)
        left = residual_of(other, of_other)
        if not left.significant and predicts(other):
            return other, of_other, left
    return best, linearised, residual


def _nearest(effect: Effect, distances: Separation, catalogue: Sequence[TrialEffect]) -> list[TrialEffect]:
    """Return the effects that do most of what one does, nearest first, and those that ring at the same place.

    A simpler look-alike is tried wherever it stands: noise learnt beside the effect may hold them apart.  What rings
    long is a line so narrow that to first order it differs even from a line one hundredth away.
    """
    close = [other for other, distance in distances.from_other.items() if distance < _ALIKE * distances.snr]
    close.sort(key=lambda other: (distances.from_other[other], other.key))
    twins = effect.look_alikes  # to first order the true effect may be only the third nearest
    near = [other for place, other in enumerate(close) if place < _FITTED or other.name in twins]
    wherever = (other for other in distances.from_other if other not in near)
    near += [one for one in wherever if _ring_alike(effect, one) or effect.has_simpler_look_alike(one)]
    return [kind for other in near for kind in catalogue if kind.effect == other]


def _ring_alike(one: Effect, two: Effect) -> bool:
    return one.hidden == two.hidden == _RINGS and one.acts == two.acts


def _known(trail: Trail, fewer: Fitted, kind: TrialEffect, frequency_hz: float | None) -> Fitted | None:
    """Return the fit of ``fewer`` and ``kind`` if there is one that converged: for a line, at that frequency."""
    known = trail.of((*fewer.effects, kind.effect))
    if known is None:
        return None
    values = known.point.values[0][kind.effect]
    if frequency_hz is None or "frequency_hz" not in values:
        return known if known.converged else None
    return known if _close(values, frequency_hz) else None


def fitted_instead(
    best: Fitted, at: Linearised, far: Separation, frequency_hz: float | None, stop: Stop, kind: TrialEffect
) -> Fitted | None:
    """Return the fit with ``kind`` in place of an effect that ``at`` lacks; None where there is no trajectory.

    It starts from the fit without the effect, since the base gives way to each in its own manner: one line at the
    frequency of the other, anything else where it imitates the effect best.
    """
    if stop():
        raise Cancelled
    starts = [far.starts[kind.effect]]
    if frequency_hz is not None and "frequency_hz" in starts[0][0]:
        starts = _of_one_line(at, kind, starts[0], frequency_hz)
    trials = [trial for start in starts if (trial := refit(at, kind, start, stop, least_bic=best.bic)) is not None]
    trial = min(trials, key=lambda fitted: fitted.bic, default=None)
    if trial is None or trial.bic > best.bic + _HOPELESS:
        return trial
    # In a building the wandering noise keeps its shape in a fit: begin with that of the best fit, since the shape
    # learnt without the effect has absorbed what the effect explains.
    problem = trial.problem.with_noise(best.noise) if best.noise.site else trial.problem
    return problem.fit(trial.z, evaluations=16, cancelled=stop)


def _of_one_line(at: Linearised, kind: TrialEffect, start: Start, frequency_hz: float) -> list[Start]:
    """Return starts of a line at the frequency of another; no further off than a line is wide, or it ends on a lobe.

    What rings and bends the base with it is found more surely from a mode that is too strong than from a weak one.
    """
    near = [score.start for score in at.scores(kind) if _close(score.start[0], frequency_hz)]
    nearest = min(near, key=lambda one: abs(one[0]["frequency_hz"] - frequency_hz), default=start)
    if not kind.effect.hidden:
        return [nearest]
    strong = tuple(kind.times({**values, "frequency_hz": frequency_hz}, _STRONGER) for values in nearest)
    return [nearest, strong]


def _close(values: Mapping[str, float], frequency_hz: float) -> bool:
    return abs(values["frequency_hz"] / frequency_hz - 1) < _ONE_LINE
