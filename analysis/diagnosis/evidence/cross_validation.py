"""Cross-validation: how well a model predicts validation shots, which are held out of its fit."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from analysis.collision import Infeasible
from analysis.compiled import side_by_side
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.inference import Fitted, Floor, JointData, Problem
from analysis.shot import Floats, Stop

_TRAINED = 25  # evaluations at most, started from the shared parameters of the fit of all shots


@dataclass(frozen=True, slots=True)
class Prediction:
    """Validation shots as predicted from the others: displacements on the motions' grids.

    ``minus_2_ln_likelihood`` is that of the measured shots under their predictions, up to a constant, summed over
    these shots.  ``rms_m`` is the prediction error (averaged samples, the frame's most likely motion subtracted);
    ``left`` is the error in units of the noise, shape (n,).  ``squared`` returns chi^2 of a difference in these units,
    given the noise and the uncertainty that the other shots leave.
    """

    displacement_m: tuple[Floats, ...]
    minus_2_ln_likelihood: float
    rms_m: float
    left: Floats
    squared: Callable[[Floats], float]

    def predicts_better(self, other: "Prediction") -> bool:
        """Return whether this prediction is better: likelier, and with no larger rms error (``further_off``)."""
        return (
            self.minus_2_ln_likelihood < other.minus_2_ln_likelihood and self.rms_m < CRITERIA.further_off * other.rms_m
        )

    def predicts_significantly_better(self, before: "Prediction") -> bool:
        """Return whether this predicts better than ``before`` by more than the chance scatter of the difference.

        If the noise is as assumed, two predictions that differ by d differ in -2 ln L by |d|^2 with a standard
        deviation of 2 |d|.  Here |d| is taken given all uncertainty of ``before``, within which d adds no scatter.
        """
        scatter = 2.0 * math.sqrt(max(before.squared(self.left - before.left), 0.0))
        return self.predicts_better(before) and before.minus_2_ln_likelihood - self.minus_2_ln_likelihood > scatter


Predictions = tuple[Prediction, Prediction]  # of the validation shots: by the model before, by the model after


def choose(data: JointData, *, in_turn: bool = True) -> tuple[int, ...]:
    """Return the validation shots, held out one at a time: slowest, a middle one, fastest; of two shots the slower.

    Not ``in_turn``: the middle one alone.  Its prediction is an interpolation, in which a wrong model may do well; that
    is sufficient where nothing is decided.
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
    """Predict each validation shot from a fit of the shared parameters to all others; None where one fails.

    Only its start, and a plate that no other shot used, are fitted to the shot itself.  ``floor`` whitens the shot:
    pass the same one to predictions that are compared.
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
        sum(one.minus_2_ln_likelihood for one in told),
        float(np.sqrt(sum(one.left.size * one.rms_m**2 for one in told) / edges[-1])),
        np.concatenate([one.left for one in told]),
        squared,
    )


def _predict(fitted: Fitted, held: int, floor: Floor, stop: Stop) -> Prediction | None:
    """Predict one shot, starting where the derivatives of the fit of all shots put the fit without this shot."""
    some, begin, _ = _of(fitted, [i for i in range(len(fitted.problem.data.shots)) if i != held])
    one, z, own = _of(fitted, [held])
    one = one.with_noise(floor)
    own = [*(place for place in some.unseen if place not in one.unseen), *own]
    try:
        trained_z, covariance = _trained(fitted, held, some, begin, stop)
        learned = dict(zip(one.shared, some.shared, strict=True))
        shared = [place for place in learned if place not in own]
        learned_at = [learned[place] for place in shared]
        there = z.copy()
        there[shared] = trained_z[learned_at]
        there[own] += one.square(z).followed(there - z, own)
        found = one.predict(there, shared, evaluations=10, tolerance=1e-2)
        end = found.square
        residual, pull = end.residual, end.pull
        assert residual is not None and pull is not None
        known = None if covariance is None else covariance[np.ix_(learned_at, learned_at)]
        uncertainty = _PredictionUncertainty.of(end.curvature.dense(), shared, known)
        shown = one.full(one.unpack(found.parameters))[0]
        measured = fitted.problem.data.shots[held]
        off = measured.displacement_m - measured.averaged(shown)
        off = measured.without_frame_motion(floor, off)[measured.valid]
        paid = sum(shot >= 0 for _, _, shot in one.free_parameters) * np.log(end.samples)
        return Prediction(
            (shown,),
            uncertainty.chi2(end.chi2, end.gradient) + uncertainty.log_volume + float(paid),
            float(np.sqrt(np.mean(off**2))),
            residual,
            lambda difference: uncertainty.chi2(float(difference @ difference), pull(difference)),
        )
    except (Infeasible, np.linalg.LinAlgError):
        return None


def _trained(fitted: Fitted, held: int, others: Problem, begin: Floats, stop: Stop) -> tuple[Floats, Floats | None]:
    """Return the parameters fitted to all shots but one (``others``), and their covariance where it exists.

    They are kept with the fit, as the shot may be predicted again under other noises.
    """
    learned = fitted.held_out_cache.get(held)
    if learned is None:
        found = others.search(begin, evaluations=_TRAINED, cancelled=stop)
        seen = np.ones(others.size, dtype=np.bool_)
        seen[others.unseen] = False
        learned = found.parameters, found.square.curvature.inverse(seen)
        if not stop():  # an interrupted fit is not kept
            fitted.held_out_cache[held] = learned
    return learned


def _of(fitted: Fitted, shots: list[int]) -> tuple[Problem, Floats, list[int]]:
    """Return the problem of some shots, its vector in a fit of all shots, and the indices of per-shot parameters.

    The derivatives of those shots at that vector are copied.
    """
    whole = fitted.problem
    data = replace(
        whole.data,
        shots=tuple(whole.data.shots[i] for i in shots),
        reference_mass_kg=whole.coordinates.block_mass_kg,
    )
    some = replace(whole, data=data)
    own = [place for place, (_, shot) in enumerate(some.names) if shot >= 0]
    at = {name: place for place, name in enumerate(whole.names)}
    places = [at[name, shots[shot] if shot >= 0 else shot] for name, shot in some.names]
    lines = whole.derivatives(fitted.z)
    some.remember(fitted.z[places], [lines[i] for i in shots])
    return some, fitted.z[places], own


@dataclass(frozen=True, slots=True)
class _PredictionUncertainty:
    """The uncertainty that the other shots leave in a validation shot, integrated out of its likelihood.

    Uncertain shared parameters make the shot less predictable, not the model wrong.  The likelihood is therefore that
    of the linearised model with these parameters integrated out (MacKay, "Information Theory, Inference, and Learning
    Algorithms", ch. 28).  A parameter of the shot's own costs its price in the Bayesian information criterion.
    """

    root: Floats  # of the shared parameters' covariance, extended to all parameters, per-shot ones readjusted
    both: Floats  # the same covariance combined with the validation shot's own information, whitened
    log_volume: float

    @classmethod
    def of(cls, curvature: Floats, shared: list[int], covariance: Floats | None) -> "_PredictionUncertainty":
        """Return the uncertainty for a ``covariance`` of the shared parameters; None: as if known exactly."""
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
        """Return chi^2 of a difference given this uncertainty, from its ``plain`` chi^2 and its ``gradient``."""
        along = self.root.T @ gradient
        return float(plain - along @ np.linalg.solve(self.both, along))
