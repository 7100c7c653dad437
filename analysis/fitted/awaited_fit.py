"""Between a shot's readings, which are there first, and its fit: the flag that tells them apart."""

from dataclasses import replace

from analysis.shot.quantity import NotSeen
from analysis.shot.shot import Shot

TO_FOLLOW = "fit_to_follow"


def awaits_fit(shot: Shot) -> bool:
    """Return whether a shot's readings stand and its fit is still to come."""
    return TO_FOLLOW in shot.flags


def can_be_fitted(shot: Shot) -> bool:
    """Return whether a shot holds what its model is fitted to, and a fit is wanted."""
    driven = shot.settings.model == "driven"  # a slider under a known force strikes nothing
    return shot.motion is not None and shot.settings.fit and (shot.impact is not None or driven)


def with_fit_to_follow(shot: Shot) -> Shot:
    """Return a shot that was read, flagged to await its fit where there is something to fit."""
    if not can_be_fitted(shot):
        return shot
    impact = shot.impact
    if impact is not None:
        contact = NotSeen("the fit is still to come")
        impact = replace(impact, cor_kinetic=replace(impact.cor_kinetic, contact=contact))
    return replace(shot, impact=impact, flags=tuple(dict.fromkeys((*shot.flags, TO_FOLLOW))))
