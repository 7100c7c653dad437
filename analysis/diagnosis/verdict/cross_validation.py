"""Cross-validation: how well a model predicts a shot that took no part in its fit."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from analysis.collision import Infeasible
from analysis.compiled import side_by_side
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.inference import Fitted, Floor, JointData, Problem
from analysis.shot import Floats, Stop

_TRAINED = 25  # evaluations at most, from where all shots together put the shared parameters


def _beside_noise(difference: Floats) -> float:
    return float(difference @ difference)


@dataclass(frozen=True, slots=True)
class Prediction:
    """Held-out shots as the others predict them: displacements on the motions' grids.

    ``surprise`` is -2 ln of how likely the others made what was measured, up to a constant, of all held-out shots;
    ``rms_m`` is how far they lie from it (averaged samples, a frame's most likely motion taken off), ``left`` the same
    in units of the noise, shape (n,).
    ``squared`` is chi^2 of such a difference beside the noise and what the other shots leave open together.
    """

    displacement_m: tuple[Floats, ...]
    surprise: float
    rms_m: float
    left: Floats
    squared: Callable[[Floats], float] = _beside_noise

    def beats(self, other: "Prediction") -> bool:
        """Return whether this predicts better: more likely, and not further off."""
        return self.surprise < other.surprise and self.rms_m < CRITERIA.further_off * other.rms_m

    def earns_a_name(self, before: "Prediction") -> bool:
        """Return whether this predicts better than the model ``before`` by more than chance scatters that.

        Where the noise is what it is taken for, two predictions that differ by d differ in surprise by |d|^2 with a
        standard deviation of 2 |d|, d beside all that ``before`` leaves open: what that may be anyhow scatters nothing.
        """
        scatter = 2.0 * math.sqrt(max(before.squared(self.left - before.left), 0.0))
        return self.beats(before) and before.surprise - self.surprise > scatter


def choose(data: JointData, *, in_turn: bool = True) -> tuple[int, ...]:
    """Return the shots to hold out, one at a time: of two the slower, of more the slowest, a middle one, the fastest.

    Not ``in_turn``: the middle one alone.  Its prediction is an interpolation, at which a wrong model may be good: that
    serves where nothing is decided.
    """
    speeds = [abs(shot.course.velocity_in_m_per_s) for shot in data.shots]
    order = [int(i) for i in np.argsort(speeds)]
    if len(order) < 2:
        return ()
    if len(order) == 2:
        return (order[0],)
    middle = order[len(order) // 2]
    return tuple(sorted((order[0], middle, order[-1]))) if in_turn else (middle,)


def predict(fitted: Fitted, held: tuple[int, ...], floor: Floor, stop: Stop) -> Prediction | None:
    """Predict each held-out shot from a fit of the shared parameters to all others; None where one fails.

    Only its start is fitted to the shot itself, and a plate that no other shot was taken on.  ``floor`` whitens it:
    give the same one to predictions that are compared.
    """
    each = side_by_side(lambda shot: _predict(fitted, shot, floor, stop), held)
    told = [one for one in each if one is not None]
    if len(told) < len(held):
        return None
    edges = np.cumsum([0, *(one.left.size for one in told)])

    def squared(difference: Floats) -> float:
        parts = [difference[begin:end] for begin, end in pairwise(edges)]
        return sum(one.squared(part) for one, part in zip(told, parts, strict=True))

    return Prediction(
        tuple(shown for one in told for shown in one.displacement_m),
        sum(one.surprise for one in told),
        float(np.sqrt(sum(one.left.size * one.rms_m**2 for one in told) / edges[-1])),
        np.concatenate([one.left for one in told]),
        squared,
    )


def _predict(fitted: Fitted, held: int, floor: Floor, stop: Stop) -> Prediction | None:
    """Foretell one shot, begun where the fit of all shots' derivatives say that it will end without it."""
    some, begin, _ = _of(fitted, [i for i in range(len(fitted.problem.data.shots)) if i != held])
    one, z, own = _of(fitted, [held])
    one = one.with_noise(floor)
    own = [*(place for place in some.unseen if place not in one.unseen), *own]
    try:
        trained_z, covariance = _trained(fitted, held, some, begin, stop)
        learnt = dict(zip(one.shared, some.shared, strict=True))
        shared = [place for place in learnt if place not in own]
        learnt_at = [learnt[place] for place in shared]
        there = z.copy()
        there[shared] = trained_z[learnt_at]
        there[own] += one.square(z).followed(there - z, own)
        found = one.predict(there, shared, evaluations=10, tolerance=1e-2)
        end = found.square
        assert end.residual is not None and end.pull is not None
        known = None if covariance is None else covariance[np.ix_(learnt_at, learnt_at)]
        left_open = _Open.of(end.curvature, shared, known)
        shown = one.full(one.unpack(found.parameters))[0]
        measured = fitted.problem.data.shots[held]
        off = measured.displacement_m - measured.averaged(shown)
        off = measured.without_frame_motion(floor, off)[measured.valid]
        paid = sum(shot >= 0 for _, _, shot in one.free_parameters) * np.log(end.samples)
        return Prediction(
            (shown,),
            left_open.chi2(end.chi2, end.gradient) + left_open.log_volume + float(paid),
            float(np.sqrt(np.mean(off**2))),
            end.residual,
            partial(_beside, left_open, end.pull),
        )
    except (Infeasible, np.linalg.LinAlgError):
        return None


def _trained(fitted: Fitted, held: int, others: Problem, begin: Floats, stop: Stop) -> tuple[Floats, Floats | None]:
    """Return the parameters that the ``others`` than one shot lead to, and their covariance where they have one.

    Kept with the fit, as a shot is predicted again under other noises.
    """
    learnt = fitted.trained.get(held)
    if learnt is None:
        found = others.search(begin, evaluations=_TRAINED, cancelled=stop)
        seen = np.ones(others.size, dtype=np.bool_)
        seen[others.unseen] = False
        learnt = found.parameters, found.square.covariance(seen)
        if not stop():  # what was cut off is no end
            fitted.trained[held] = learnt
    return learnt


def _of(fitted: Fitted, shots: list[int]) -> tuple[Problem, Floats, list[int]]:
    """Return the problem of some shots alone, where a fit of all has it, and where it holds what is each shot's own.

    What is known of those shots there is taken along.
    """
    whole = fitted.problem
    data = replace(
        whole.data,
        shots=tuple(whole.data.shots[i] for i in shots),
        like_kg=whole.coordinates.block_mass_kg,
    )
    some = replace(whole, data=data)
    own = [place for place, (_, shot) in enumerate(some.names) if shot >= 0]
    at = {name: place for place, name in enumerate(whole.names)}
    places = [at[name, shots[shot] if shot >= 0 else shot] for name, shot in some.names]
    lines = whole.derivatives(fitted.z)
    some.remember(fitted.z[places], [lines[i] for i in shots])
    return some, fitted.z[places], own


@dataclass(frozen=True, slots=True)
class _Open:
    """What the other shots leave open of a held-out one, integrated out of its likelihood.

    What they do not know of the shared parameters makes the shot less predictable, not the model wrong: the likelihood
    is that of the linearised model with these parameters integrated out (MacKay, "Information Theory, Inference, and
    Learning Algorithms", ch. 28).  A parameter of the shot's own costs what the Bayesian information criterion asks.
    """

    root: Floats  # of the shared parameters' covariance, taken to all parameters with the shot's own giving way
    both: Floats  # the same covariance beside what the held-out shot itself says, whitened
    log_volume: float

    @classmethod
    def of(cls, curvature: Floats, shared: list[int], covariance: Floats | None) -> "_Open":
        """Return what is open where the shared parameters are known to ``covariance``, None: as if exactly."""
        size = len(curvature)
        if covariance is None:
            return cls(np.zeros((size, 0)), np.eye(0), 0.0)
        own = np.setdiff1d(np.arange(size), shared)
        giving_way = np.eye(size)[:, shared]
        giving_way[own] = -np.linalg.pinv(curvature[own][:, own], hermitian=True) @ curvature[own][:, shared]
        scale = np.sqrt(np.diag(covariance))
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        root = giving_way @ (scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
        both = np.eye(root.shape[1]) + root.T @ curvature @ root
        return cls(root, both, float(np.linalg.slogdet(both)[1]))

    def chi2(self, plain: float, gradient: Floats) -> float:
        """Return chi^2 beside all that is open of a difference of ``plain`` chi^2; ``gradient`` are its products."""
        along = self.root.T @ gradient
        return float(plain - along @ np.linalg.solve(self.both, along))


def _beside(left_open: _Open, pull: Callable[[Floats], Floats], difference: Floats) -> float:
    return left_open.chi2(float(difference @ difference), pull(difference))
