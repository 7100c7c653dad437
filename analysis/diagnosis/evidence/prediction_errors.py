"""Test a saved model's predictions, unchanged, on shots that it was not fitted to, against its base alone."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np

from analysis.collision import Effect, Infeasible, without_nuisances
from analysis.diagnosis.evidence.residual import errors
from analysis.diagnosis.findings.model_file import SavedModel
from analysis.diagnosis.findings.result import Errors, PredictedShot, PredictionTest
from analysis.drive import Repeatability, Table, force_noise, prediction_residual_n, rms
from analysis.drive import prepare as prepare_drive
from analysis.fitted import fit_jointly
from analysis.inference import OWN_NAMES, PLATE_NAMES, JointData, Point, Problem, averaged_shots, base_named, trials_of
from analysis.shot import (
    AnalysisError,
    Cancelled,
    Floats,
    Motion,
    Quantity,
    Shot,
    Stop,
    count_plates,
    motions_of,
    names_on_plate,
    stated_stiffness_n_per_m,
)
from levimass import base_model

Parameters = Mapping[str, Quantity]


def evaluate_predictions(shots: Sequence[Shot], model: SavedModel, stop: Stop | None = None) -> PredictionTest:
    """Return the errors of ``model`` and of its base in predicting the ``shots`` that have a motion.

    Every saved parameter is fixed.  Only a shot's speed, touch and offset (a drive's constant force), and its flights'
    bend where the model's shots had one each, are fitted to it.  The base has the parameters fitted to the shots of the
    model; where the file lacks these, the base is fitted to the tested shots themselves, which favours the base.
    Raises AnalysisError, Cancelled.
    """
    if not motions_of(shots):
        raise AnalysisError("no shot was fitted, so there is nothing to foretell")
    asked = stop or (lambda: False)
    base = model.base_parameters or fit_jointly(shots, model.base, (), asked).parameters
    one = _collision if base_model(model.base).collides else _driven
    told = []
    for shot in shots:
        if shot.motion is None:
            continue
        if asked():
            raise Cancelled
        name = shot.path or shot.name
        took_part = name in model.shots
        try:
            bare, whole = one(shot.motion, *_on_its_plate(shot.motion, model, base))
            told.append(PredictedShot(name, took_part, bare, whole))
        except (AnalysisError, Infeasible, np.linalg.LinAlgError) as error:
            told.append(PredictedShot(name, took_part, None, None, str(error)))
    bare, whole = _all(told, "error_base"), _all(told, "error_model")
    return PredictionTest(model.base, model.effects, bare, whole, tuple(told))


def _on_its_plate(motion: Motion, model: SavedModel, base: Parameters) -> tuple[SavedModel, Parameters]:
    """Return model and base with the parameters of the plate that a shot states, or of the first if it states none."""
    count, stated = count_plates(model.parameters), stated_stiffness_n_per_m(motion.plate)

    def apart(plate: int) -> float:
        named = names_on_plate(model.parameters, plate)[PLATE_NAMES[0]]
        return abs(math.log(model.parameters[named].value / stated)) if stated is not None else 0.0

    its = min(range(count), key=apart) if count > 1 else 0
    mine, of_base = (
        {plain: of[name] for plain, name in names_on_plate(of, its).items()} for of in (model.parameters, base)
    )
    return replace(model, parameters=mine), of_base


def _all(shots: Sequence[PredictedShot], which: str) -> Errors:
    """Return the errors of all shots together, with equal weight for every shot."""
    seen = [asdict(getattr(shot, which)) for shot in shots if getattr(shot, which) is not None]
    if not seen:
        raise AnalysisError(f"no shot could be predicted: {shots[0].problem}")
    mean = {key: float(np.mean([e[key] ** 2 for e in seen])) ** 0.5 for key in seen[0] if key != "reduced_chi2"}
    return Errors(**mean, reduced_chi2=float(np.mean([e["reduced_chi2"] for e in seen])))


def _driven(motion: Motion, model: SavedModel, base: Parameters) -> tuple[Errors, Errors]:
    table = Table.of(prepare_drive([motion]))
    trials: tuple[tuple[tuple[Effect, ...], Parameters], ...] = (((), base), (model.effects, model.parameters))
    left = [rms(prediction_residual_n(table, of, known)) for of, known in trials]
    noise = Repeatability(force_noise(motion), False)
    bare, whole = (force_errors(force_n, noise) for force_n in left)
    return bare, whole


def force_errors(force_n: float, repeatability: Repeatability) -> Errors:
    """Return the errors in force; an open-loop model's path drifts, so displacement and velocity are not compared."""
    return Errors(float("nan"), float("nan"), force_n, repeatability.chi2(force_n))


def _collision(motion: Motion, model: SavedModel, base: Parameters) -> tuple[Errors, Errors]:
    data = JointData(averaged_shots([motion]), base_named(model.base))
    noise = data.stated_noise
    start = data.shots[0].course.own
    # Nuisance effects that are fitted per shot are fitted under the base model as well.
    along = trials_of(effect for effect in model.effects if effect not in without_nuisances(model.effects))
    bare = _own_fitted(Problem(data, along, noise), base, start)
    effects = trials_of(model.effects)
    fixed = {kind.effect: kind.fixed_in(kind.starts[0]) for kind in effects}
    whole = _own_fitted(Problem(data, effects, noise, fixed=fixed), model.parameters, start)
    learned, _ = whole[0].learn_noise(whole[0].residual_m(whole[1]))
    own = len(OWN_NAMES) + sum(len(kind.own) for kind in along)
    out = [errors([motion], data.shots, problem.full(problem.unpack(z)), learned, own) for problem, z in (bare, whole)]
    return out[0], out[1]


def _own_fitted(problem: Problem, known: Parameters, start: Floats) -> tuple[Problem, Floats]:
    """Fit the shot's own parameters with all others fixed at ``known``; return the problem and the vector."""
    values = {}
    for kind in problem.effects:
        values[kind.effect] = dict(kind.starts[0])
        for free in kind.free_parameters:
            named = f"{kind.effect.key}.{free.name}"
            if free.own:
                continue
            if named not in known:
                raise AnalysisError(f"the model file has no parameter {named}")
            values[kind.effect][free.name] = known[named].value
    names = problem.data.base.names
    if missing := [name for name in names if name not in known]:
        raise AnalysisError(f"the model file has no parameter {missing[0]}")
    z = problem.pack(Point(np.array([known[name].value for name in names]), start[None, :], (values,)))
    return problem, problem.predict(z, evaluations=25, tolerance=1e-3).parameters
