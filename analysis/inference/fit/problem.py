"""A fitting problem: base model, effects, shots and noise.  All fits, predictions and scores are computed from it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Effect
from analysis.inference.fit.least_squares import Minimum, StopEarly, minimise
from analysis.inference.joint.weighted_model import ModelAtVector, WeightedModel
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.free_parameters import TrialEffect
from analysis.inference.model.samples import Samples
from analysis.inference.noise.estimate import LikelyStrengths, learn, likely_strengths
from analysis.inference.noise.flights import flights_allow
from analysis.inference.noise.floor import Floor, LikeliestFloor
from analysis.inference.screen import screening
from analysis.inference.screen.columns import contribution_of
from analysis.inference.screen.projector import Projector
from analysis.inference.screen.screening import Score
from analysis.shot import Floats, Stop

_ROUNDS, _A_ROUND, _MIN_GAIN = 8, 25, 0.05  # of ``continued``: rounds, evaluations per round, least gain of ln L
_NEAR = 0.04  # expected fall of chi^2 of a converged fit: parameters are within a fifth of a std of the minimum
COMPARABLE = 0.1  # expected fall of chi^2 at which a search ends before the noise is re-estimated or fits are compared


@dataclass(frozen=True)
class Problem(WeightedModel):
    """A base model with effects over some shots, weighted by a noise; methods fit it and predict from it.

    Vectors ``z`` have the layout of ``SearchVector``.
    """

    def with_start_noise(self, z: Floats) -> "Problem":
        """Return the problem with the noise for the start of a search from ``z``; unchanged without frame motion.

        On a moving frame the noise is estimated from the residual, with the wandering shape of the flights' noise.
        """
        if not self.data.site.moves:
            return self
        return self.with_noise(self.learn_noise(self.residual_m(z), self.data.noise_of_flights)[0])

    def learn_noise(
        self, residual_m: Sequence[Floats], start: Floor | None = None, *, anew: bool = False
    ) -> LikeliestFloor:
        """Return the likeliest noise of residuals (m, one for each shot).

        On a moving frame the wandering parts keep their shape in ``start`` unless ``anew`` re-estimates it.
        """
        return learn(residual_m, self.data.shots, self.data.site, start=start, anew=anew)

    def search(
        self,
        z: Floats,
        *,
        held: Sequence[int] = (),
        evaluations: int = 25,
        tolerance: float = 1e-2,
        stop_early: StopEarly | None = None,
        cancelled: Stop | None = None,
    ) -> Minimum:
        """Minimise chi^2 from ``z`` until its expected further fall is below ``tolerance``; ``held`` are fixed.

        It also ends if ``stop_early`` returns True (see ``minimise``).  Infeasible if the start has no trajectory.
        """
        return minimise(
            self.square,
            z,
            bounds=self._held(z, [*self.unseen, *held]),
            evaluations=evaluations,
            tolerance=tolerance,
            residual=self.whitened_residual,
            stop_early=stop_early,
            cancelled=cancelled,
        )

    def predict(self, z: Floats, known: Sequence[int] | None = None, *, evaluations: int, tolerance: float) -> Minimum:
        """Predict the shots from parameters determined by other shots: only per-shot parameters are fitted.

        ``known`` are the indices in ``z`` of the fixed parameters (None: all shared ones).
        """
        bounds = self._held(z, self.shared if known is None else known)
        return minimise(self.square, z, bounds=bounds, evaluations=evaluations, tolerance=tolerance)

    def _held(self, z: Floats, places: Sequence[int]) -> tuple[Floats, Floats]:
        """Return bounds of the vector that fix the parameters at ``places`` to their values in ``z``."""
        low, high = self.bounds
        low[places] = high[places] = z[places]
        return low, high

    def fit(self, z: Floats, *, evaluations: int = 25, anew: bool = False, cancelled: Stop | None = None) -> "Fitted":
        """Fit from ``z`` under the problem's noise, then under the noise estimated from the residual."""
        first = self.fit_once(z, evaluations=evaluations, tolerance=COMPARABLE, cancelled=cancelled)
        again = max(8, evaluations // 2)
        final = first.problem.fit_once(first.z, evaluations=again, anew=anew, cancelled=cancelled)
        return final if final.log_likelihood >= first.log_likelihood else first

    def fit_once(
        self,
        z: Floats,
        *,
        evaluations: int = 25,
        tolerance: float = 1e-2,
        stop_early: StopEarly | None = None,
        anew: bool = False,
        cancelled: Stop | None = None,
    ) -> "Fitted":
        """Search from ``z`` under the problem's noise, and estimate the noise from the final residual."""
        found = self.search(z, evaluations=evaluations, tolerance=tolerance, stop_early=stop_early, cancelled=cancelled)
        return self.fitted(found, anew=anew)

    def fitted(self, found: Minimum, *, anew: bool = False) -> "Fitted":
        """Return the fit at the end of a search: noise estimated from the residual, likelihood, covariance."""
        left = self.residual_m(found.parameters)
        # The likelihood of wandering parts has several maxima; a search started at another fit's maximum stays there.
        noise, value = self.learn_noise(left, self.noise if self.noise.site else None, anew=anew)
        inverse = found.square.curvature.inverse()
        converged = found.converged
        if inverse is None:
            inverse = np.full((self.size, self.size), np.nan)
        else:
            gradient = found.square.gradient
            still_to_fall = float(gradient @ inverse @ gradient)
            converged = converged or still_to_fall < _NEAR * found.square.chi2 / found.square.samples
        return Fitted(self.with_noise(noise), found.parameters, value, left, inverse, converged)

    def linearise(self, z: Floats, near: Projector | None = None) -> "Linearised":
        """Return the problem linearised at ``z``; still valid results of the linearisation ``near`` it are reused."""
        return Linearised.of(self, z, near)


@dataclass(frozen=True)
class Linearised(Projector):
    """A problem linearised at ``z``; methods score further effects on its residual."""

    problem: Problem

    def scores(self, kind: TrialEffect) -> list[Score]:
        """Return the scores of one effect, one for each start, best first."""
        return screening.scores(self, kind)

    def screen(self, kinds: Sequence[TrialEffect], stop: Stop, *, to_join: float | None = None) -> list[list[Score]]:
        """Return the scores of every effect that has any, in the order of ``kinds``; raises Cancelled.

        ``to_join`` is the fall of the criterion required of an added effect.
        """
        return screening.all_scores(self, kinds, stop, to_join=to_join)

    def contribution_of(self, kind: TrialEffect, starts: Sequence[Mapping[str, float]]) -> list[Floats] | None:
        """Return the displacement that an effect with these per-shot values adds; None if there is no trajectory."""
        return contribution_of(self, kind, starts)


@dataclass(frozen=True)
class Fitted(ModelAtVector):
    """A problem at its minimum ``z``, with the likeliest noise given the averaged residual ``residual_m`` of each shot.

    ``inverse``, shape (p, p), is (J^T J)^-1 in search coordinates, with derivatives J whitened as in the search.
    ``held_out_cache`` caches, by the shot left out, the parameters estimated from the other shots and their covariance.
    """

    problem: Problem
    log_likelihood: float
    residual_m: tuple[Floats, ...]
    inverse: Floats
    converged: bool
    held_out_cache: dict[int, tuple[Floats, Floats | None]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Get the effects."""
        return tuple(kind.effect for kind in self.problem.effects)

    @cached_property
    def covariances(self) -> Floats:
        """Get the covariance of the parameters of each shot, in the order of its ``places``, shape (shots, q, q)."""
        slopes, places = self.problem.slopes(self.z), self.problem.places
        inverses = self.inverse[places[:, :, None], places[:, None, :]]
        return np.asarray(slopes @ inverses @ slopes.transpose(0, 2, 1))

    @property
    def std(self) -> Floats:
        """Get the standard deviations of the parameters, in the vector's order."""
        out = np.empty(self.problem.size)
        out[self.problem.places] = np.sqrt(np.maximum(np.einsum("ijj->ij", self.covariances), 0.0))
        return out

    @property
    def samples(self) -> int:
        """Get the number of valid averaged samples."""
        return sum(int(shot.valid.sum()) for shot in self.problem.data.shots)

    def with_shots(self, added: Sequence[Samples]) -> tuple[Problem, Floats]:
        """Return the problem over the fit's shots and ``added`` ones, and the vector from which its fit starts.

        Each added shot starts at its course; its per-shot parameters have typical values of the present shots.  Its
        ``weight`` is relative to the same noise as theirs.
        """
        before, point, typical = self.problem, self.point, self._typical_values()
        data = replace(before.data, shots=(*before.data.shots, *added))
        problem = Problem(data, before.effects, before.noise, fixed=before.fixed)
        own = np.concatenate([point.own, [shot.course.own for shot in added]])
        return problem, problem.pack(Point(point.base, own, (*point.values, *(typical for _ in added))))

    def _typical_values(self) -> dict[Effect, Mapping[str, float]]:
        """Return the effects' values of a typical shot: those of the shot in which they have their median size.

        All values of an effect come from one shot: a plate's position and velocity are correlated, and separate means
        of both would describe a swing of the plate that no shot had.
        """
        out: dict[Effect, Mapping[str, float]] = {}
        for kind in self.problem.effects:
            first = next((free.name for free in kind.own), None)
            every = (one[kind.effect] for one in self.point.values)
            by_size = sorted(every, key=lambda values: abs(values[first]) if first else 0.0)
            out[kind.effect] = by_size[len(by_size) // 2]
        return out

    def whitened(self, noise: Floor | None = None) -> list[Floats]:
        """Return the residual at the valid samples, shot by shot, whitened by ``noise`` (None: the fit's own)."""
        both = zip(self.residual_m, self.problem.data.shots, strict=True)
        return [shot.whitened(noise or self.noise, left[:, None])[:, 0] for left, shot in both]

    def chi2(self, noise: Floor) -> float:
        """Return the sum of squares of the residual whitened by ``noise``."""
        return sum(float(left @ left) for left in self.whitened(noise))

    @property
    def bic(self) -> float:
        """Get the Bayesian information criterion (Schwarz 1978): k ln n - 2 ln L; smaller is better."""
        return self.problem.size * math.log(self.samples) - 2 * self.log_likelihood

    @cached_property
    def unlearned_noise(self) -> Floor:
        """Get a noise that absorbs no missing effect: on a moving frame that of the flights, else the white part.

        The flights show too little of a slow wander above the frame's frequencies to be sure of it.  A wander learned
        from the whole shots counts as noise where they do not contradict it; one that absorbs an effect is larger.
        """
        data = self.problem.data
        if not data.site.moves:
            return self.noise.still
        flights = data.noise_of_flights
        if flights.wander or not self.noise.wander or not flights_allow(self.noise, data.shots, data.site):
            return flights
        return replace(self.noise, site=flights.site)

    @property
    def wanders_only_in_contact(self) -> bool:
        """Get whether the noise estimated from whole shots wanders while that of their flights does not."""
        data = self.problem.data
        return not data.site.moves and bool(self.noise.wander) and not data.noise_of_flights.wander

    def linearise(self, near: Projector | None = None) -> Linearised:
        """Return the problem linearised at the minimum; ``near`` as in ``Problem.linearise``."""
        return self.problem.linearise(self.z, near)

    def refitted(self, *, evaluations: int = 25, anew: bool = False, cancelled: Stop | None = None) -> "Fitted":
        """Continue the fit from the minimum with ``Problem.fit``."""
        return self.problem.fit(self.z, evaluations=evaluations, anew=anew, cancelled=cancelled)

    def from_white(self, *, evaluations: int = 25, cancelled: Stop | None = None) -> "Fitted":
        """Continue the fit as ``refitted``, starting under white noise alone."""
        white = self.problem.with_noise(self.noise.still)
        return white.fit(self.z, evaluations=evaluations, cancelled=cancelled)

    def continued(self, cancelled: Stop | None = None) -> "Fitted":
        """Continue the search of a fit that had not converged, as long as the likelihood grows.

        With a law the minimum lies in a long curved valley: a point whose chi^2 is a thousandth larger may be ten
        standard deviations away.
        """
        best = self
        for _ in range(_ROUNDS):
            if best.converged:
                break
            found = best.problem.search(best.z, evaluations=_A_ROUND, cancelled=cancelled)
            further = best.problem.fitted(found)
            if further.log_likelihood < best.log_likelihood + _MIN_GAIN and not further.converged:
                break
            best = further if further.log_likelihood >= best.log_likelihood else best
            if found.converged:
                break
        return best._or_white_noise(cancelled)

    def _or_white_noise(self, cancelled: Stop | None) -> "Fitted":
        """Return the likelier of this fit and one started under white noise: wander can absorb a missing effect."""
        if self.noise.site or max(self.noise.rms_m) < self.noise.white_m:
            return self
        still = self.from_white(evaluations=_A_ROUND, cancelled=cancelled)
        return still if still.log_likelihood > self.log_likelihood else self

    def with_marginal_covariance(self) -> "Fitted":
        """Return a fit on a moving frame with its covariance averaged over all likely strengths of the frame's bands.

        At the likeliest strengths alone the covariance is a third too small, since slow bands have only a few periods
        in a shot.  A fit without frame motion is returned unchanged.
        """
        free = np.ones(self.problem.size, dtype=np.bool_)
        free[self.problem.unseen] = False
        likely = self.likely_strengths(free)
        return self if likely is None else self.averaged_over(likely, free)

    def likely_strengths(self, free: NDArray[np.bool_]) -> LikelyStrengths | None:
        """Return the likely strengths of the frame's bands, parameters marginalised where ``free``, shape (p,).

        None without frame motion, or if the free parameters are not determined.
        """
        problem, data = self.problem, self.problem.data
        if not self.noise.site:
            return None
        tangents = problem.arrow([line for _, line in problem.derivatives(self.z)])
        tangents = tangents.without(np.flatnonzero(~free))
        try:
            return likely_strengths(self.residual_m, tangents, data.shots, data.site, self.noise)
        except np.linalg.LinAlgError:  # two parameters have the same effect
            return None

    def averaged_over(self, likely: LikelyStrengths, free: NDArray[np.bool_]) -> "Fitted":
        """Return this fit with its covariance averaged over likely strengths, zero where not ``free``, shape (p,).

        Unchanged if some of these strengths leave a parameter undetermined.
        """
        try:
            return replace(self, inverse=np.where(np.outer(free, free), likely.covariance(), 0.0))
        except np.linalg.LinAlgError:
            return self
