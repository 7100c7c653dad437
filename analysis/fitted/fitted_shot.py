"""Fit a shot, and keep its readings, flags and settings consistent with its fit.

The model is imported where it is used, so that a shot's readings and the window do not wait for the import.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.linalg import LinAlgError

from analysis.collision import Effect
from analysis.fitted.fit_time import FIT_SECONDS, FitTime, run_with_time_limit
from analysis.shot import (
    FIT_FLAGS,
    NOT_CONVERGED,
    AnalysisError,
    Cancelled,
    Fit,
    NotSeen,
    Quantity,
    Shot,
    VibrationSpectrum,
    fit_flags,
    fit_with_rate_error,
    motions_of,
)
from levimass import base_model

PATIENCE = 2.0  # a fit is abandoned after this multiple of its time limit, because one of its steps does not end
FAILED, FIT_TO_FOLLOW = "fit_failed", "fit_to_follow"
READ_FROM_MODEL = "read_from_model"  # the pulse's readings come from the fitted model
PULSE = ("force_peak_n", "force_fwhm_s", "contact_time_s", "deflection_max_m")
CONTACT = "cor_kinetic.contact"


def fit_pending(shot: Shot) -> bool:
    """Return whether a shot has its readings but not yet its fit."""
    return FIT_TO_FOLLOW in shot.flags


def can_be_fitted(shot: Shot) -> bool:
    """Return whether a fit is wanted and the shot has the data that its model needs."""
    return shot.motion is not None and shot.settings.fit and (shot.impact is not None or not shot.settings.collides)


def with_fit_pending(shot: Shot) -> Shot:
    """Return a shot that was read, flagged as awaiting its fit if it can be fitted."""
    if not can_be_fitted(shot):
        return shot
    impact = shot.impact
    if impact is not None:
        contact = NotSeen("the fit is still to come")
        impact = replace(impact, cor_kinetic=replace(impact.cor_kinetic, contact=contact))
    return replace(shot, impact=impact, flags=tuple(dict.fromkeys((*shot.flags, FIT_TO_FOLLOW))))


def unfitted(shot: Shot, why: str, *, stopped: bool = False) -> Shot:
    """Return the shot marked as one whose fit failed, or was stopped, with the reason."""
    return replace(with_fit(shot, None), fit_problem=why, fit_stopped=stopped)


def with_fit(shot: Shot, fit: Fit | None) -> Shot:
    """Return ``shot`` with its fit replaced by ``fit``; None: a fit was tried and failed.

    Flags, the contact's COR and the effects in the settings are replaced by those of the new fit.
    """
    from analysis.fitted.readings_from_fit import fitted_contact_cor

    read = (*(shot.motion.flags if shot.motion else ()), *(shot.impact.flags if shot.impact else ()))
    gone = {FAILED, FIT_TO_FOLLOW, *FIT_FLAGS, *(flags_of(shot.fit) if shot.fit else ())}.difference(read)
    kept = (flag for flag in shot.flags if flag not in gone)
    doubtful = fit_flags(shot.impact, fit) if fit and shot.impact else ()
    flags = tuple(dict.fromkeys((*kept, *(flags_of(fit) if fit else (FAILED,)), *doubtful)))
    effects = fit.effects if fit else shot.settings.effects
    settings = replace(shot.settings, effects=effects)
    impact = shot.impact
    if impact is not None:
        contact = NotSeen("the fit failed") if fit is None else fitted_contact_cor(fit, _mass_kg(shot))
        impact = replace(impact, cor_kinetic=replace(impact.cor_kinetic, contact=contact))
    return replace(shot, fit=fit, readings_fit=None, fit_stopped=False, impact=impact, flags=flags, settings=settings)


def read_with(shot: Shot, fit: Fit) -> Shot:
    """Return ``shot`` with its model readings recomputed from ``fit``, the joint fit of a diagnosis.

    The shot's own fit is unchanged.  Raises Cancelled.
    """
    if shot.impact is None or shot.motion is None or shot.fit is None:
        return shot
    from analysis.fitted.readings_from_fit import fitted_contact_cor, with_model_readings

    kinetic = replace(shot.impact.cor_kinetic, contact=fitted_contact_cor(fit, _mass_kg(shot)))
    impact = replace(shot.impact, cor_kinetic=kinetic)
    if READ_FROM_MODEL in impact.flags:  # the pulse is read from a fit of this shot alone
        again = fit_shot(shot, fit.effects)
        impact = with_model_readings(impact, again.fit, shot.motion) if again.fit is not None else impact
    return replace(shot, impact=impact, readings_fit=fit)


def read_together(shots: Sequence[Shot], fit: Fit) -> list[Shot]:
    """Return ``shots`` with the model readings of the fitted ones recomputed from ``fit``, their joint fit."""
    plates = iter(part.plate_number for part in fit.shots)
    fitted = (shot.motion is not None and shot.fit is not None for shot in shots)
    return [read_with(shot, fit.on_plate(next(plates))) if it else shot for shot, it in zip(shots, fitted, strict=True)]


def fit_shot(shot: Shot, effects: tuple[Effect, ...], cancelled: Callable[[], bool] | None = None) -> Shot:
    """Return ``shot`` fitted with its own base model and ``effects``; unchanged if it cannot be fitted.

    If the fit fails, the shot is returned without a fit and flagged.  Raises Cancelled.
    """
    if not can_be_fitted(shot):
        return shot
    shot = replace(shot, settings=replace(shot.settings, effects=effects))
    assert shot.motion is not None
    try:
        fit = fit_jointly([shot], shot.settings.model, effects, cancelled, shot.settings.fit_seconds)
        fit = fit_with_rate_error(fit, shot.motion)
        return _with_pulse_from_fit(replace(with_fit(shot, fit), problem=None, fit_problem=None))
    except AnalysisError as error:
        failed = unfitted(shot, str(error))
        if shot.impact is None:  # a driven slider has a fit but no readings
            return replace(failed, problem=shot.problem or str(error), fit_problem=shot.fit_problem)
        return failed


def _with_pulse_from_fit(shot: Shot) -> Shot:
    """Return the shot with its pulse read from the fit, if its record is too coarse for derivatives."""
    if shot.impact is None or shot.fit is None or shot.motion is None:
        return shot
    from analysis.fitted.readings_from_fit import with_model_readings

    impact = with_model_readings(shot.impact, shot.fit, shot.motion)
    return replace(shot, impact=impact, flags=tuple(dict.fromkeys((*shot.flags, *impact.flags))))


def vibration_of(shot: Shot) -> VibrationSpectrum | None:
    """Return the vibration of a shot's frame from its readings; None if it is negligible."""
    disturbance = shot.impact.disturbance if shot.impact else None
    return disturbance.vibration if disturbance else None


def fit_jointly(
    shots: Sequence[Shot],
    base: str,
    effects: tuple[Effect, ...],
    cancelled: Callable[[], bool] | None = None,
    seconds: float = FIT_SECONDS,
) -> Fit:
    """Return one fit of all shots that have a motion, with this base model and effects.

    The vibration of each shot's frame is that of its readings; ``seconds`` is the time limit per shot.  Raises
    AnalysisError, Cancelled.
    """
    motions = motions_of(shots)
    vibrations = [vibration_of(shot) for shot in shots if shot.motion is not None]
    left = FitTime(seconds * len(motions), cancelled)

    def fit() -> Fit:
        if not base_model(base).collides:
            from analysis.drive import fit_driven

            return fit_driven(motions, effects, left)
        from analysis.inference import fit_shots

        return fit_shots(motions, model=base, effects=effects, cancelled=left, vibrations=vibrations)

    try:
        return run_with_time_limit(fit, PATIENCE * left.seconds, cancelled, left.words)
    except Cancelled:
        if left.over:
            raise AnalysisError(left.words) from None
        raise
    except (LinAlgError, ValueError, IndexError, ZeroDivisionError) as error:  # the motion resembles no collision
        raise AnalysisError(f"the model cannot be fitted to this motion ({error})") from error


def flags_of(fit: Fit) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*fit.flags, *(() if fit.converged else (NOT_CONVERGED,)))))


def _mass_kg(shot: Shot) -> float:
    return shot.motion.moving_mass_kg if shot.motion is not None else float("nan")


@dataclass(frozen=True, slots=True)
class ReadingsModel:
    """The model (base and effects) that gives ``readings``, which are listed by their names in the result."""

    base: str
    effects: tuple[Effect, ...]
    readings: tuple[str, ...]


def readings_model(shot: Shot) -> ReadingsModel | None:
    """Return the model that gives some of the shot's readings; None if all come from the motion alone."""
    fit = shot.readings_fit or shot.fit
    if fit is None or shot.impact is None:
        return None
    readings = PULSE if READ_FROM_MODEL in shot.impact.flags else ()
    if isinstance(shot.impact.cor_kinetic.contact, Quantity):
        readings = (*readings, CONTACT)
    return ReadingsModel(fit.model, fit.effects, readings) if readings else None


def readings_model_result(model: ReadingsModel | None) -> dict[str, Any] | None:
    if model is None:
        return None
    return {"base": model.base, "effects": [effect.key for effect in model.effects], "readings": list(model.readings)}
