"""Save, load and test model files, report parameters that drifted from them, and read and save the user's own laws."""

import math
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.collision import Effect, LawError, UserLaw, law_from_table, without_nuisances
from analysis.diagnosis import Diagnosis, ModelFileError, SavedModel, drift, from_text, saved, to_text
from analysis.fitted import FIT_SECONDS, fit_jointly, run_with_time_limit
from analysis.shot import (
    AnalysisError,
    Fit,
    Progress,
    Shot,
    Stop,
    fitted_shots,
    motions_of,
    split_unit,
    why_no_joint_fit,
)
from app.report import shared_stds
from app.session.verdict_basis import ModelEffects
from app.words import counted, model_in_words
from instrument.files import RecordingError, read_laws, read_toml_text, write_law, write_text_atomic

if TYPE_CHECKING:
    from analysis.diagnosis import PredictionTest

DRIFT_SIGMAS = 4.0  # least significant deviation, in joint standard uncertainties


def save_model(
    path: Path,
    shots: Sequence[Shot],
    accepted: ModelEffects,
    diagnosis: Diagnosis | None,
    *,
    progress: Progress,
    cancelled: Stop,
) -> str:
    """Save the model of a joint fit to these shots; return a message.

    If the ``diagnosis`` of exactly these shots ended with these effects, its fit is used; else the shots are fitted.
    Raises AnalysisError if the fit does not converge, RecordingError if the file cannot be written.
    """
    progress("fitting the shots jointly", 0.2)
    fitted = fitted_shots(shots)
    if not fitted:
        raise AnalysisError("no shot is fitted, so there is no model to save")
    if why := why_no_joint_fit(fitted):
        raise AnalysisError(why)
    base = fitted[0].settings.model
    effects = accepted.of(base)
    if diagnosis is not None and set(without_nuisances(diagnosis.fit_after.effects)) == set(without_nuisances(effects)):
        fit = diagnosis.fit_after
    else:
        diagnosis = None
        fit = fit_jointly(fitted, base, effects, cancelled)
    if not fit.converged:
        raise AnalysisError("the joint fit did not converge: misfit exceeds noise, run Diagnose first")
    named = {finding.effect for finding in diagnosis.findings} if diagnosis is not None else set()
    model = write_model(path, fit, fitted, diagnosis, set(accepted.tried) - named)
    return f"Model {model_words(model)} saved as {path}"


def write_model(
    path: Path, fit: Fit, shots: Sequence[Shot], diagnosis: Diagnosis | None, tried: Collection[Effect]
) -> SavedModel:
    """Write the model file of a fit to these shots; return the model.  Raises RecordingError."""
    names = [shot.path or shot.name for shot in shots if shot.fit is not None]
    model = saved(fit, names, diagnosis, tried)
    shared = shared_stds(shots)
    combined = {name: math.hypot(q.std, shared[name]) for name, q in fit.parameters.items() if name in shared}
    write_text_atomic(path, to_text(model, combined), sync=True)
    return model


def load_model(path: Path) -> SavedModel:
    """Read a model file.  Raises RecordingError, one line with file and cause."""
    try:
        return from_text(read_toml_text(path))
    except ModelFileError as error:
        raise RecordingError(path, str(error)) from None


def model_words(model: SavedModel) -> str:
    """Return "paper model + quadratic drag on the block, from 5 shots"; effects found by no diagnosis get "(tried)"."""
    return f"{model_in_words(model.base, model.effects, model.tried)}, from {counted(len(model.shots), 'shot')}"


def predictions_of(path: Path, shots: Sequence[Shot], progress: Progress, cancelled: Stop) -> str:
    """Return in words how much better a saved model, not refitted, predicts these shots than its base model.

    Raises RecordingError if the file is no model, AnalysisError if no shot can be predicted, and Cancelled.
    """
    from analysis.diagnosis import prediction_words

    progress("predicting", 0.0)
    model = load_model(path)
    of_base = [shot for shot in shots if shot.motion is not None and shot.settings.model == model.base]
    if not of_base:
        raise AnalysisError(f"none of these shots has the model file's base model, {model.base}")
    prediction = predicted(of_base, model, cancelled)
    took_part = sum(shot.took_part for shot in prediction.shots)
    warning = f" ({took_part} used to fit the model: no test)" if took_part else ""
    return f"{model_words(model)}: {prediction_words(prediction)}{warning}"


def predicted(shots: Sequence[Shot], model: SavedModel, cancelled: Stop | None = None) -> "PredictionTest":
    """Return the errors of a saved model's predictions, without refitting it, of these shots.

    Raises Cancelled, and AnalysisError if the prediction fails or exceeds its time limit.
    """
    from analysis.diagnosis import evaluate_predictions  # slow to import

    seconds = FIT_SECONDS * (1 + len(motions_of(shots)))
    return run_with_time_limit(lambda: evaluate_predictions(shots, model, cancelled), seconds, cancelled)


def significant_drift(known: SavedModel, fit: Fit) -> dict[str, float]:
    """Return the parameters that differ significantly from a model file's, in joint standard uncertainties."""
    return {name: deviation for name, deviation in drift(known, fit).items() if abs(deviation) > DRIFT_SIGMAS}


def drift_words(known: SavedModel, fit: Fit) -> str:
    """Return the fitted parameters that differ significantly from a model file's, largest first; "" for none."""
    if fit.model != known.base or not fit.converged:
        return ""
    ordered = sorted(significant_drift(known, fit).items(), key=lambda item: -abs(item[1]))
    return ", ".join(f"{_named(name, known.effects)} {deviation:+.1f} σ" for name, deviation in ordered)


def _named(name: str, effects: Iterable[Effect]) -> str:
    key, dot, parameter = name.rpartition(".")
    words = split_unit(parameter)[0]
    of = next((effect.words for effect in effects if effect.key == key), key)
    return f"{of}: {words}" if dot else words


class OwnLaws:
    """The user's own laws in a folder, read at each use because files may change while the window is open."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder  # None: no laws can be read or saved

    def read(self) -> tuple[tuple[UserLaw, ...], tuple[str, ...]]:
        """Return the laws, and one line for each file that is not a valid law."""
        laws, problems = read_laws(self.folder) if self.folder is not None else ([], [])
        return tuple(laws), tuple(problems)

    def keep(self, table: dict[str, Any]) -> UserLaw:
        """Save the law described by a table.  Raises RecordingError or LawError, one line each."""
        law = law_from_table(table)
        if self.folder is None:
            raise LawError("there is no folder for laws here")
        write_law(law, self.folder)
        return law
