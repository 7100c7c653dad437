"""Predict shots not yet taken from a fitted model, and the information on another model that they would add."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.collision import Effect, Infeasible
from analysis.inference import OWN_NAMES, Fitted, Floor, Point, Samples, on_site
from analysis.planning.next_shot import NextShot, contact_s, mass_without_weights_kg, on_the_rig
from analysis.shot import Floats, Stop

_EVALUATIONS = 15
NEAR = 0.3  # fall of chi^2 at which a search for a plan may end: a distance of five norms is then known to 1/30


def blank_shot(shot: NextShot, fitted: Fitted) -> Samples:
    """Return samples of a shot not yet taken, with zero displacement, and with the sampling and noise of a fit's."""
    data, point = fitted.problem.data, fitted.point
    shots = data.shots
    like = on_the_rig(shots)[0]
    touching_s = contact_s(shot, shots)
    rate_hz = like.factor / like.spacing_s
    count = int((shot.before_s + touching_s + shot.after_s) * rate_hz) // like.factor * like.factor
    time_s = np.arange(count) / rate_hz
    averaged = count // like.factor
    empty = Samples(
        time_s=time_s,
        used=np.ones(count, dtype=np.bool_),
        factor=like.factor,
        centre_s=time_s.reshape(averaged, like.factor).mean(axis=1),
        displacement_m=np.zeros(averaged),
        valid=np.ones(averaged, dtype=np.bool_),
        spacing_s=like.spacing_s,
        moving_mass_kg=mass_without_weights_kg(shots) + shot.added_mass_kg,
        wavelength_m=like.wavelength_m,
        course=replace(
            like.course,
            touch_time_s=shot.before_s,
            touch_position_m=0.0,
            velocity_in_m_per_s=-shot.speed_m_per_s,
            turnaround_time_s=shot.before_s + touching_s / 2,
            rate_rad_per_s=float(np.pi / touching_s),
            release_time_s=shot.before_s + touching_s,
        ),
        white_m=like.white_m,
        plate_number=like.plate_number,
    )
    at = Point(point.base, np.array([[-shot.speed_m_per_s, shot.before_s, 0.0]]), point.values[:1])
    return on_site([empty], data.site, data.base, at)[0]


def predict(fitted: Fitted, shot: Samples) -> Samples:
    """Return the samples of a shot as a fit predicts them, without noise.  Raises Infeasible."""
    problem, z = fitted.with_shots([shot])
    last = len(problem.data.shots) - 1
    shown = problem.averaged(last, problem.unpack(z))
    if not np.all(np.isfinite(shown)):
        raise Infeasible("the trajectory is not finite")
    return replace(shot, displacement_m=shown)


def fit_as_if_taken(fitted: Fitted, added: Sequence[Samples], floor: Floor) -> Fitted:
    """Return a fit as it would be after shots that agree exactly with its predictions, under the noise ``floor``."""
    problem, z = fitted.with_shots(added)
    problem = problem.with_noise(floor)
    return replace(problem.fit_once(z, evaluations=1), problem=problem)


@dataclass(frozen=True, slots=True)
class Information:
    """A shot's information on a model's shared parameters to first order, its own start eliminated.

    ``curvature``, shape (p, p), and ``gradient``, shape (p,), are those of half the sum of squares ``chi2``;
    ``penalty``, as chi^2, is for the effects with parameters fitted per shot.
    """

    curvature: Floats
    gradient: Floats
    chi2: float
    penalty: float = 0.0

    def __add__(self, other: "Information") -> "Information":
        return Information(
            self.curvature + other.curvature,
            self.gradient + other.gradient,
            self.chi2 + other.chi2,
            self.penalty + other.penalty,
        )

    @property
    def least(self) -> float:
        """Get the minimum of the sum of squares over the shared parameters, to first order, with the penalty."""
        scale = np.sqrt(np.maximum(np.diag(self.curvature), 1e-300))
        scaled = self.curvature / np.outer(scale, scale)
        step = np.linalg.lstsq(scaled, self.gradient / scale, rcond=1e-13)[0]
        return max(0.0, self.chi2 - float(self.gradient / scale @ step)) + self.penalty


def information_of(rival: Fitted, shot: Samples, floor: Floor) -> Information:
    """Return the information of a predicted shot on a rival's shared parameters.  Raises Infeasible.

    Cost: one shot with derivatives, 1 to 11 ms.
    """
    problem, z = rival.with_shots([shot])
    last = len(problem.data.shots) - 1
    here, columns = problem.of_shot(last, z)
    rows = shot.whitened(floor, np.column_stack([here - shot.displacement_m, columns]))
    if not np.all(np.isfinite(rows)):
        raise Infeasible("the trajectory is not finite")
    return information_without(rows[:, 1:], rows[:, 0], len(problem.shared))


def shot_penalty(rival: Fitted, effect: Effect, scatter: Floats, shot: Samples, floor: Floor) -> float:
    """Return the penalty, as chi^2, of an effect whose per-shot parameters must fit a predicted shot by chance.

    It is ln det(1 + S F): the gain in knowledge of the parameters over their ``scatter`` (S), where F is the shot's
    information on them with its own start eliminated.  Raises Infeasible.
    """
    problem, z = rival.with_shots([shot])
    last = len(problem.data.shots) - 1
    named = [problem.names[place] for place in problem.places[last]]
    numbers = [k for k, (name, index) in enumerate(named) if index == last and name.rpartition(".")[0] == effect.key]
    start = [k for k, (name, index) in enumerate(named) if index == last and name in OWN_NAMES]
    rows = shot.whitened(floor, problem.of_shot(last, z)[1][:, [*numbers, *start]])
    if not np.all(np.isfinite(rows)):
        raise Infeasible("the trajectory is not finite")
    of_numbers = information_without(rows, np.zeros(len(rows)), len(numbers)).curvature
    return float(np.linalg.slogdet(np.eye(len(numbers)) + of_numbers * np.outer(scatter, scatter))[1])


def present_information(fitted: Fitted, floor: Floor) -> Information:
    """Return the information of the present shots on a fit's shared parameters."""
    problem = fitted.problem.with_noise(floor)
    square = problem.square(fitted.z)
    curvature, gradient, fall = square.curvature.without_own(square.gradient)
    return Information(curvature, gradient, square.chi2 - fall)


def information_without(jacobian: Floats, left: Floats, shared: int) -> Information:
    """Return the information of whitened rows, derivatives and residual, on the first ``shared`` columns alone."""
    own = jacobian[:, shared:]
    own = own[:, np.any(own != 0.0, axis=0)]
    basis = np.linalg.qr(own / np.linalg.norm(own, axis=0))[0]
    columns = jacobian[:, :shared] - basis @ (basis.T @ jacobian[:, :shared])
    rest = left - basis @ (basis.T @ left)
    return Information(columns.T @ columns, columns.T @ rest, float(rest @ rest))


def refitted_chi2(rival: Fitted, added: Sequence[Samples], floor: Floor, stop: Stop) -> float:
    """Return chi^2 of a rival fitted jointly to the present shots and to predicted ones.

    Raises Infeasible where it has no solution for them.  Cost: some ten evaluations of all shots.
    """
    problem, z = rival.with_shots(added)
    found = problem.with_noise(floor).search(z, evaluations=_EVALUATIONS, tolerance=NEAR, cancelled=stop)
    return found.square.chi2
