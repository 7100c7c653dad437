"""Alternatives and detection limits: every effect tried, with its curve, and the sizes that could not be detected."""

from collections.abc import Sequence

import numpy as np

from analysis.collision import Effect
from analysis.compiled import side_by_side
from analysis.diagnosis.evidence.identifiability import least_seen
from analysis.diagnosis.findings.result import BlindSpot, Candidate, Standing
from analysis.diagnosis.search.forward_selection import Trail
from analysis.inference import Fitted, Linearised, Score, TrialEffect, effect_parameters
from analysis.shot import Floats, Quantity

POINTS = 800  # of a curve: two per pixel of a plot a third of a screen wide
MAX_SHOTS = 12  # that have curves: as many as a page draws


def candidates(best: Fitted, trail: Trail) -> tuple[Candidate, ...]:
    """Return every effect tried, each added alone to the model before, the best first."""
    before = trail.start
    at = trail.linearised(before)

    def candidate(scored: tuple[Effect, Score]) -> Candidate:
        effect, score = scored
        fitted = trail.of((*before.effects, effect))
        if fitted is not None and fitted.log_likelihood < before.log_likelihood:
            fitted = None  # at zero strength it would be as likely: the search did not converge
        parameters: dict[str, Quantity] = effect_parameters(fitted)[effect] if fitted else {}
        delta = fitted.bic - before.bic if fitted else None
        if effect in best.effects:
            standing = Standing.IN_MODEL
        elif fitted is None:
            standing = Standing.SCORED_ONLY
        else:
            pays = delta is not None and delta <= -trail.least_fall()
            standing = Standing.BEHIND_ANOTHER if pays else Standing.DOES_NOT_PAY
        curves = curve_of_fit(fitted, before) if fitted is not None else curve_to_first_order(at, score)
        return Candidate(effect, float(score.gain), delta, parameters, standing, explains_m=curves)

    out = side_by_side(candidate, trail.scores.items())
    return tuple(sorted(out, key=lambda c: (c.delta_bic if c.delta_bic is not None else 0.0, -c.score)))


def blind_spots(at: Linearised, catalogue: Sequence[TrialEffect], best: Fitted) -> tuple[BlindSpot, ...]:
    """Return the detection limits: effects that are not in ``best``, with the size that would stand out by 5 sigma."""
    return tuple(
        BlindSpot(kind.effect, kind.amplitude[0], least_seen(at, kind))
        for kind in catalogue
        if kind.effect not in best.effects and len(kind.starts) <= 12
    )


def curve_of_fit(fitted: Fitted, before: Fitted) -> tuple[Floats, ...]:
    """Return the change of the model's displacement (m) in a joint fit with a candidate, as ``averaged_to`` means."""
    pairs = zip(before.residual_m[:MAX_SHOTS], fitted.residual_m, strict=False)
    return tuple(averaged_to(POINTS, left_before - left_after) for left_before, left_after in pairs)


def curve_to_first_order(at: Linearised, score: Score) -> tuple[Floats, ...] | None:
    """Return the displacement (m, ``averaged_to`` means) that a scored candidate would explain; None without a path.

    ``at`` is the linearised fit before.  The candidate has the strength of a linear step; the parameters of that fit
    move, also to first order, to their best values given the candidate.
    """
    columns = at.contribution_of(score.kind, score.start)
    if columns is None:
        return None
    left = at.whole - at.problem.whitened([column[:, None] for column in columns])[:, 0]
    moved = at.tangents.solve(left)
    own = zip(columns, at.lines, at.tangents.places, strict=True)
    curves = [column + derivatives @ moved[places] for column, (_, derivatives), places in own]
    return tuple(averaged_to(POINTS, curve) for curve in curves[:MAX_SHOTS])


def averaged_to(points: int, values: Floats) -> Floats:
    """Return means over ``points`` equal parts of a record, or the values themselves where they are fewer: float32."""
    if values.size <= points:
        return values.astype(np.float32)
    edges = np.linspace(0, values.size, points + 1).astype(np.intp)
    return np.asarray(np.add.reduceat(values, edges[:-1]) / np.diff(edges), dtype=np.float32)
