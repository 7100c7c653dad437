"""A shot and its fit: what follows from a fit follows it, whoever made the fit.

The model is imported where it is used: a shot's readings, and the window, do not wait for it.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from numpy.linalg import LinAlgError

from analysis.fitted.awaited_fit import TO_FOLLOW, can_be_fitted
from analysis.fitted.fit_time import SECONDS, FitTime
from analysis.fitted.given_up import waited_for
from analysis.shot.disturbance import Shaking
from analysis.shot.doubts import FIT_DOUBTS, doubts_of_fit
from analysis.shot.fit import Fit
from analysis.shot.motion import Motion
from analysis.shot.quantity import NotSeen
from analysis.shot.rate_error import fit_with_rate_error
from analysis.shot.shot import AnalysisError, Cancelled, Shot

_INNER = re.compile(r" with Collision\(.*\)", re.DOTALL)
PATIENCE = 2.0  # times the time of a fit, after which it is left alone: one step of it does not end
NOT_CONVERGED, FAILED = "fit_not_converged", "fit_failed"


def unfitted(shot: Shot, why: str) -> Shot:
    """Return a shot that awaits a fit which will not come, and why."""
    return replace(with_fit(shot, None), fit_problem=why)


def with_fit(shot: Shot, fit: Fit | None) -> Shot:
    """Return ``shot`` with this fit in place of the one it had; None says that a fit was tried and failed.

    The fit's flags, the contact's COR and the effects in the settings are the new fit's; nothing of the old one stays.
    """
    from analysis.fitted.kinetic_contact import fitted_contact_cor

    read = (*(shot.motion.flags if shot.motion else ()), *(shot.impact.flags if shot.impact else ()))
    gone = {FAILED, TO_FOLLOW, *FIT_DOUBTS, *(flags_of(shot.fit) if shot.fit else ())}.difference(read)
    kept = (flag for flag in shot.flags if flag not in gone)
    doubts = doubts_of_fit(shot.impact, fit) if fit and shot.impact else ()
    flags = tuple(dict.fromkeys((*kept, *(flags_of(fit) if fit else (FAILED,)), *doubts)))
    effects = fit.effects if fit else shot.settings.effects
    settings = replace(shot.settings, effects=effects)
    impact = shot.impact
    if impact is not None:
        contact = NotSeen("the fit failed") if fit is None else fitted_contact_cor(fit, _mass_kg(shot))
        impact = replace(impact, cor_kinetic=replace(impact.cor_kinetic, contact=contact))
    return replace(shot, fit=fit, readings_fit=None, impact=impact, flags=flags, settings=settings)


def read_with(shot: Shot, fit: Fit) -> Shot:
    """Return ``shot`` with those of its readings that rest on a model made again with ``fit``, a diagnosis's.

    That is one of this shot and others together; the shot's own fit stays what it was.  Raises Cancelled.
    """
    if shot.impact is None or shot.motion is None or shot.fit is None or fit.model == "driven":
        return shot
    from analysis.fitted.from_model import FLAG, with_model_readings
    from analysis.fitted.kinetic_contact import fitted_contact_cor

    kinetic = replace(shot.impact.cor_kinetic, contact=fitted_contact_cor(fit, _mass_kg(shot)))
    impact = replace(shot.impact, cor_kinetic=kinetic)
    if FLAG in impact.flags:  # a pulse is read from a fit of its shot alone
        again = fit_again(shot, fit.effects)
        impact = with_model_readings(impact, again.fit, shot.motion) if again.fit is not None else impact
    return replace(shot, impact=impact, readings_fit=fit)


def read_together(shots: Sequence[Shot], fit: Fit) -> list[Shot]:
    """Return ``shots`` with those of them that were fitted read with ``fit``, which is one of all these together."""
    plates = iter(part.plate_number for part in fit.shots)
    fitted = (shot.motion is not None and shot.fit is not None for shot in shots)
    return [read_with(shot, fit.on_plate(next(plates))) if it else shot for shot, it in zip(shots, fitted, strict=True)]


def fit_again(shot: Shot, effects: tuple[str, ...], cancelled: Callable[[], bool] | None = None) -> Shot:
    """Return ``shot`` fitted with its own base model and ``effects``; as it is where there is nothing to fit.

    Where the data do not carry the model the shot comes back without a fit and flagged, as from a first analysis.
    Raises Cancelled.
    """
    if not can_be_fitted(shot):
        return shot
    driven = shot.settings.model == "driven"
    shot = replace(shot, settings=replace(shot.settings, effects=effects))
    assert shot.motion is not None
    try:
        fit = fit_jointly(
            [shot.motion], shot.settings.model, effects, cancelled, [shaking_of(shot)], shot.settings.fit_seconds
        )
        fit = fit_with_rate_error(fit, shot.motion)
        fitted = with_fit(shot, fit)
        return replace(fitted, problem=None) if driven else _read_again(replace(fitted, fit_problem=None))
    except AnalysisError as error:
        failed = unfitted(shot, str(error))
        if driven:  # the fit is all there is
            return replace(failed, problem=shot.problem or str(error), fit_problem=shot.fit_problem)
        return failed


def _read_again(shot: Shot) -> Shot:
    """Return the shot with its pulse read from the fit, where derivatives of its record carry too little."""
    if shot.impact is None or shot.fit is None or shot.motion is None:
        return shot
    from analysis.fitted.from_model import with_model_readings

    impact = with_model_readings(shot.impact, shot.fit, shot.motion)
    return replace(shot, impact=impact, flags=tuple(dict.fromkeys((*shot.flags, *impact.flags))))


def shaking_of(shot: Shot) -> Shaking | None:
    """Return what shook the frame of a shot as far as its reading shows; None where that is too little to matter."""
    disturbance = shot.impact.disturbance if shot.impact else None
    return disturbance.shaking if disturbance else None


def fit_jointly(
    motions: Sequence[Motion],
    base: str,
    effects: tuple[str, ...],
    cancelled: Callable[[], bool] | None = None,
    shakings: Sequence[Shaking | None] = (),
    seconds: float = SECONDS,
) -> Fit:
    """Return one fit of all motions with this base model and effects.  Raises AnalysisError, Cancelled.

    ``shakings`` say what shook the frame of each, where that is known; ``seconds`` are those that each motion may cost.
    """
    left = FitTime(seconds * len(motions), cancelled)

    def fit() -> Fit:
        if base == "driven":
            from analysis.drive.driven_fit import fit_driven

            return fit_driven(motions, effects, left)
        from analysis.inference.fit.shot_fit import fit_shots

        return fit_shots(motions, model=base, effects=effects, cancelled=left, shakings=shakings)

    try:
        return waited_for(
            fit,
            PATIENCE * left.seconds,
            cancelled,
            left.words,
        )
    except Cancelled:
        if left.over:
            raise AnalysisError(left.words) from None
        raise
    except AnalysisError as error:
        raise AnalysisError(in_words(error)) from error
    except (LinAlgError, ValueError, IndexError, ZeroDivisionError) as error:  # of what no collision looks like
        raise AnalysisError(f"the model cannot be fitted to this motion ({error})") from error


def in_words(error: Exception) -> str:
    """Return why a fit failed, without every number of a trial, which nobody set."""
    return _INNER.sub("", str(error))


def flags_of(fit: Fit) -> tuple[str, ...]:
    """Return what a shot with this fit is flagged with."""
    return tuple(dict.fromkeys((*fit.flags, *(() if fit.converged else (NOT_CONVERGED,)))))


def _mass_kg(shot: Shot) -> float:
    return shot.motion.moving_mass_kg if shot.motion is not None else float("nan")
