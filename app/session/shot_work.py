"""Long work on shots as functions that can run in a subprocess: fit, diagnose, export, report, predict.

Slow imports are inside the functions that need them, so that the window starts quickly.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis, SavedModel
from analysis.fitted import SECONDS, fit_again, run_in_time
from analysis.shot import AnalysisError, Progress, Shot, Stop
from app.session.model_in_use import load_model, model_words
from app.words import counted
from instrument.files import write_text_atomic

if TYPE_CHECKING:
    from analysis.diagnosis import PredictionTest


def refit_shot(shot: Shot, effects: tuple[Effect, ...], *, progress: Progress, cancelled: Stop) -> Shot:
    """Return the shot refitted with these effects."""
    return fit_again(shot, effects, cancelled)


def diagnose_shots(
    shots: Sequence[Shot],
    accepted: Sequence[Effect],
    laws: Sequence[Effect],
    seconds: float,
    **watched: Any,  # progress and cancelled
) -> Diagnosis:
    """Diagnose these shots jointly; after ``seconds`` the alternative searches are omitted."""
    from analysis.diagnosis import diagnose  # slow to import

    return diagnose(shots, accepted=accepted, laws=laws, seconds=seconds, **watched)


def write_report(
    path: Path,
    shots: Sequence[Shot],
    diagnosis: Diagnosis | None,
    tried: Sequence[Effect],
    *,
    progress: Progress,
    cancelled: Stop,
) -> str:
    """Write the report as PDF or HTML, by the path's ending; return a message."""
    text = report_text(shots, diagnosis, tried, progress=progress, cancelled=cancelled)
    if path.suffix.lower() == ".pdf":
        from app.report import write_pdf  # only this needs Qt

        write_pdf(text, path)
    else:
        write_text_atomic(path, text, sync=True)
    return f"Report of {counted(len(shots), 'shot')} saved as {path}"


def report_text(
    shots: Sequence[Shot], diagnosis: Diagnosis | None, tried: Sequence[Effect], *, progress: Progress, cancelled: Stop
) -> str:
    """Return the report as HTML; ``tried`` are effects in the model that no diagnosis found."""
    from app.report import report_of

    progress("drawing the report", 0.2)
    return report_of(shots, diagnosis, tried=tried)


def write_hdf5(shots: Sequence[Shot], folder: Path, *, progress: Progress, cancelled: Stop) -> str:
    """Write the motion of each shot as HDF5; return a message."""
    from app.report import export_hdf5

    progress("writing HDF5", 0.1)
    folder.mkdir(parents=True, exist_ok=True)
    written = export_hdf5(shots, folder)
    return f"{counted(len(written), 'shot')} exported to {folder} as HDF5"


def write_csv(
    shots: Sequence[Shot], diagnosis: Diagnosis | None, folder: Path, *, progress: Progress, cancelled: Stop
) -> str:
    """Write these shots and the laws learned by a diagnosis as CSV; return a message."""
    from app.report import export, export_laws

    progress("writing CSV", 0.1)
    written = export(shots, folder)
    if diagnosis is not None:
        written += export_laws(diagnosis, folder)
    return f"{counted(len(shots), 'shot')} exported to {folder} ({counted(len(written), 'file')})"


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

    seen = [(shot.motion, shot.path or shot.name) for shot in shots if shot.motion is not None]
    motions, names = [motion for motion, _ in seen], [name for _, name in seen]
    seconds = SECONDS * (1 + len(seen))
    return run_in_time(lambda: evaluate_predictions(motions, names, model, cancelled), seconds, cancelled)
