"""Identifiability: the part of an effect that no other can imitate, in units of the noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.collision import Effect
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.inference import Fitted, Linearised, Point, TrialEffect, to_physical
from analysis.shot import Stop


@dataclass(frozen=True, slots=True)
class Separation:
    """The size ``snr`` of an effect given all other parameters, and its separation from every other effect.

    The separation ``from_other`` is SNR sqrt(1 - cos^2); ``starts`` are per-shot values of an effect's best imitation.
    """

    snr: float
    from_other: dict[Effect, float]
    starts: dict[Effect, tuple[Mapping[str, float], ...]]

    def too_close(self, remainder: float = 0.0) -> tuple[Effect, ...]:
        """Return the effects that are indistinguishable from this one, closest first.

        An unexplained residual, of size ``remainder`` in units of the noise, may hide a difference of that size.
        """
        near = sorted(self.from_other.items(), key=lambda item: item[1])
        return tuple(other for other, distance in near if distance < CRITERIA.separation + remainder)


def isolated_effect(fitted: Fitted, at: Linearised, effect: Effect) -> Linearised:
    """Return a linearised fit with ``left`` replaced by the part of one effect that no other parameter can absorb."""
    problem = fitted.problem
    own = [problem.offset + k for k, (of, _, _) in enumerate(problem.free_parameters) if of == effect]
    basis = at.tangents.without(own).span()
    point = fitted.point
    kind = next(k for k in problem.effects if k.effect == effect)
    shots = problem.data.shots
    effective = fitted.effective
    nothing = tuple({**v, effect: _nothing(kind, v[effect])} for v in effective.values)
    without = to_physical(Point(effective.base, effective.own, nothing))
    rows = [(problem.coarse(i, point) - problem.coarse(i, without))[:, None] for i in range(len(shots))]
    done = at.problem.whitened(rows)[:, 0]
    return replace(at, basis=basis, left=basis.projected(done))


def snr(fitted: Fitted, at: Linearised, effect: Effect) -> float:
    """Return the size of the part of one effect that no other parameter can absorb, in units of the noise."""
    return float(np.linalg.norm(isolated_effect(fitted, at, effect).left))


def missed_without(fitted: Fitted, fewer: Fitted | None) -> float:
    """Return by how much the residual grows without an effect, in units of the noise.

    This is not to first order: other parameters may cancel nearly all of a large effect along a curved valley.
    Infinite where there is no fit without the effect.
    """
    if fewer is None:
        return float("inf")
    return float(np.sqrt(max(0.0, fewer.chi2(fitted.noise) - fitted.chi2(fitted.noise))))


def separation(
    fitted: Fitted, at: Linearised, effect: Effect, catalogue: Sequence[TrialEffect], stop: Stop = lambda: False
) -> Separation:
    """Return the separation of one effect of a fit from all others in the catalogue (signs kept physical).

    Raises Cancelled.
    """
    alone = isolated_effect(fitted, at, effect)
    whole = float(alone.left @ alone.left)
    others = [k for k in catalogue if k.effect not in fitted.effects]
    distance = {kind.effect: float(np.sqrt(whole)) for kind in others}
    starts: dict[Effect, tuple[Mapping[str, float], ...]] = {}
    for listed in alone.screen(others, stop):
        other = listed[0].kind.effect
        distance[other] = float(np.sqrt(max(0.0, whole - listed[0].gain)))
        starts[other] = listed[0].start
    return Separation(float(np.sqrt(whole)), distance, starts)


def _nothing(kind: TrialEffect, values: Mapping[str, float]) -> dict[str, float]:
    """Return an effect's values with zero strength."""
    if kind.inverse:
        return {**values, kind.amplitude[0]: 1e9}
    return {**values, **dict.fromkeys(kind.amplitude, 0.0)}


def least_seen(at: Linearised, kind: TrialEffect) -> float | None:
    """Return the first amplitude at which an effect would just stand out; None where none would."""
    listed = replace(at, left=np.zeros_like(at.left)).scores(kind)
    best = max(listed, key=lambda score: score.power, default=None)
    if best is None or best.power <= 0:
        return None
    size, norms = best.unit, CRITERIA.stands_out
    return float(norms * size / np.sqrt(best.power)) if not kind.inverse else float(size * np.sqrt(best.power) / norms)
