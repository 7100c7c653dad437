"""Competing models: fit an effect's nearest look-alikes in its place.

Two effects that differ to first order may coincide along a curved valley of the likelihood: a soft support equals a
second plate mode of some frequency.  The nearest are therefore fitted, starting where they imitate the effect best.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from analysis.collision import Effect, Infeasible
from analysis.diagnosis.evidence.identifiability import Separation, separation
from analysis.diagnosis.evidence.residual import Residual, residual_of
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.search.forward_selection import Trail, better, without
from analysis.diagnosis.search.scale_maxima import Start, apart
from analysis.inference import Fitted, Linearised, TrialEffect, distinct_starts, refit
from analysis.shot import Cancelled, Stop

Separations = Mapping[Effect, Separation]

_FITTED = 2  # look-alikes fitted per effect, at most
_SCORED = 2  # maximum number of starts by score: a slow viscoelastic arm is another maximum than a fast one
_ALIKE = 0.6  # a look-alike is fitted if less than this share of the effect's size remains given it
_ONE_LINE = 0.03  # relative difference of frequency below which two lines count as one
_STRONGER = 10.0
_RINGS = 2  # hidden states of an effect that oscillates freely
_ANEW = 60  # evaluations of a fit repeated from white noise
_HOPELESS = 150.0  # BIC behind the best after a short search: further search is useless


def separations_of(best: Fitted, linearised: Linearised, trail: Trail) -> Separations:
    """Return the separation of each added effect from all other effects of the catalogue."""
    return {one: separation(best, linearised, one, trail.catalogue, trail.stop) for one in trail.added(best)}


def with_look_alikes_tried(
    best: Fitted, linearised: Linearised, trail: Trail, predicts: Callable[[Fitted], bool]
) -> tuple[Fitted, Linearised, Separations]:
    """Fit every effect's nearest look-alikes in its place; return the best fit, linearised, and its separations.

    A look-alike that replaces the effect must predict the validation shots (``predicts``), as the effect did.
    """
    separations = separations_of(best, linearised, trail)
    likeliest = best
    for effect, separation_of_it in separations.items():
        for other, one in _fits_of_look_alikes(best, effect, separation_of_it, trail).items():
            if effect.has_simpler_look_alike(other):
                one = _without_wander(best, one, trail.stop)
            trail.keep(one)
            if better(one, likeliest):
                likeliest = one
    if likeliest is best or not predicts(likeliest):
        return best, linearised, separations
    likeliest = likeliest.refitted(evaluations=60, cancelled=trail.stop)
    trail.keep(likeliest)
    linearised = trail.linearised(likeliest)
    return likeliest, linearised, separations_of(likeliest, linearised, trail)


def _fits_of_look_alikes(best: Fitted, effect: Effect, far: Separation, trail: Trail) -> dict[Effect, Fitted]:
    """Return the fits with each of an effect's nearest look-alikes in its place, known ones before new ones."""
    fewer = without(best, effect, trail)
    if fewer is None:
        return {}
    frequency_hz = best.point.values[0][effect].get("frequency_hz")
    near = _nearest(effect, far, trail.catalogue)
    known = {kind.effect: _known(trail, fewer, kind, frequency_hz) for kind in near}
    new = [kind for kind in near if known[kind.effect] is None]
    fitted = {of: one for of, one in known.items() if one is not None}
    if new:
        beside, also = trail.linearised(fewer), _with_scales_of(best, fewer, trail)
        instead = partial(fitted_instead, best, beside, far, frequency_hz, trail.stop, also=also)
        fitted |= {kind.effect: one for kind in new if (one := instead(kind)) is not None}
    return fitted


def alternative_without_misfit(
    best: Fitted, linearised: Linearised, residual: Residual, trail: Trail, predicts: Callable[[Fitted], bool]
) -> tuple[Fitted, Linearised, Residual]:
    """Return a fit with as many effects, nearly as likely, whose residual is noise; ``best`` if there is none."""
    near = [
        other
        for key, other in trail.fits.items()
        if len(key) == len(best.effects)
        and len(set(key) - set(best.effects)) == 1
        and other.converged
        and other.bic < best.bic + CRITERIA.nearly
    ]
    for other in sorted(near, key=lambda fitted: fitted.bic)[:_FITTED]:
        trail.raise_if_cancelled()
        of_other = trail.linearised(other)
        left = residual_of(other, of_other)
        if not left.significant and predicts(other):
            return other, of_other, left
    return best, linearised, residual


def _nearest(effect: Effect, distances: Separation, catalogue: Sequence[TrialEffect]) -> list[TrialEffect]:
    """Return the nearest look-alikes of an effect, nearest first, then free oscillations that act at the same place.

    A simpler look-alike is tried at any separation: noise learned jointly with the effect may separate them.  A long
    oscillation is a line so narrow that, to first order, it differs even from one whose frequency is 1 % higher.
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
    """Return the known fit of ``fewer`` with ``kind``: a converged one, or for a line one at that frequency."""
    known = trail.of((*fewer.effects, kind.effect))
    if known is None:
        return None
    values = known.point.values[0][kind.effect]
    if frequency_hz is None or "frequency_hz" not in values:
        return known if known.converged else None
    return known if _close(values, frequency_hz) else None


def _without_wander(best: Fitted, one: Fitted, stop: Stop) -> Fitted:
    """Return a fit whose noise wanders only in contact, repeated from white noise if ``best`` has noise without wander.

    Wandering noise absorbs the misfit that would lead the search to its minimum.  The search for the true effect, of
    80,000 norms and simpler than its look-alike, ended 0.4 % off under a wander of 1 nm, so the look-alike was named.
    """
    if not one.wanders_only_in_contact or best.noise.wander:
        return one
    again = one.from_white(evaluations=_ANEW, cancelled=stop)
    return again if again.bic < one.bic else one


def _with_scales_of(best: Fitted, fewer: Fitted, trail: Trail) -> Linearised | None:
    """Return ``fewer`` linearised, with effects whose range or frequency differs from that in ``best`` set as there.

    Without the effect that is to be replaced, the others may end at another maximum, beside which a look-alike fits
    badly (plate damping beside an adhesion whose range was a third too large: BIC 87 too high).  None if no range or
    frequency differs, or there is no trajectory.
    """
    lost = [effect for effect in trail.added(fewer) if apart(fewer, best, effect)]
    if not lost:
        return None
    effective, likelier = fewer.effective, best.effective.values
    for effect in lost:
        effective = effective.with_effect(effect, [of[effect] for of in likelier])
    try:
        return fewer.problem.linearise(fewer.problem.pack_effective(effective))
    except Infeasible:
        return None


def fitted_instead(
    best: Fitted,
    at: Linearised,
    far: Separation,
    frequency_hz: float | None,
    stop: Stop,
    kind: TrialEffect,
    *,
    also: Linearised | None = None,
) -> Fitted | None:
    """Return the fit with ``kind`` in place of an effect that ``at`` lacks; None where there is no trajectory.

    The fit starts from the one without the effect, since base parameters respond to each effect differently, and from
    ``also``, the same with other values.  A line starts at the frequency of the line that it replaces, any other effect
    where it imitates the replaced one best.  An effect with several start times or ranges in the catalogue also starts
    where it scores best.
    """
    if stop():
        raise Cancelled
    starts = [far.starts[kind.effect]]
    is_line = "frequency_hz" in starts[0][0]
    if is_line and frequency_hz is not None:
        starts = _of_one_line(at, kind, starts[0], frequency_hz)
    elif not is_line and len(kind.starts) > 1:
        starts += [score.start for score in distinct_starts(at.scores(kind))[:_SCORED]]
    fits = [at] if also is None else [at, also]
    trials = [refit(fit, kind, start, stop, least_bic=best.bic) for fit in fits for start in starts]
    trial = min((trial for trial in trials if trial is not None), key=lambda fitted: fitted.bic, default=None)
    if trial is None or trial.bic > best.bic + _HOPELESS:
        return trial
    # With frame motion a fit keeps the shape of the wandering noise.  Start with that of the best fit, since the
    # shape learned without the effect has absorbed what the effect explains.
    problem = trial.problem.with_noise(best.noise) if best.noise.site else trial.problem
    return problem.fit(trial.z, evaluations=16, cancelled=stop)


def _of_one_line(at: Linearised, kind: TrialEffect, start: Start, frequency_hz: float) -> list[Start]:
    """Return starts of a line within its width of another's frequency; from further off, a fit ends on a side lobe.

    An oscillation that also changes the base parameters is found more reliably from a mode too strong than too weak.
    """
    near = [score.start for score in at.scores(kind) if _close(score.start[0], frequency_hz)]
    nearest = min(near, key=lambda one: abs(one[0]["frequency_hz"] - frequency_hz), default=start)
    if not kind.effect.hidden:
        return [nearest]
    strong = tuple(kind.times({**values, "frequency_hz": frequency_hz}, _STRONGER) for values in nearest)
    return [nearest, strong]


def _close(values: Mapping[str, float], frequency_hz: float) -> bool:
    return abs(values["frequency_hz"] / frequency_hz - 1) < _ONE_LINE
