"""A model file put to the test on the shots of a session."""

from collections.abc import Sequence
from pathlib import Path

from analysis.fitted.fit_time import SECONDS
from analysis.fitted.given_up import waited_for
from analysis.shot.shot import AnalysisError, Progress, Shot, Stop
from app.session.model_in_use import load_model, model_words


def put_to_test(path: Path, shots: Sequence[Shot], progress: Progress, cancelled: Stop) -> str:
    """Return in words how much better the file's model foretells these shots than its base, unchanged.

    Raises RecordingError where the file is no model, AnalysisError where nothing can be foretold, Cancelled.
    """
    from analysis.diagnosis.verdict.foretold import foretell  # and all of the diagnosis: not at every start

    progress("foretelling", 0.0)
    model = load_model(path)
    seen = [(shot.motion, shot) for shot in shots if shot.motion is not None and shot.settings.model == model.base]
    if not seen:
        raise AnalysisError(f"none of these shots is of the file's base model, {model.base}")
    motions, names = [motion for motion, _ in seen], [shot.path or shot.name for _, shot in seen]
    told = waited_for(lambda: foretell(motions, names, model, cancelled), SECONDS * (1 + len(seen)), cancelled)
    partook = sum(shot.took_part for shot in told.shots)
    warned = f" ({partook} of them took part in the model's fit: no test)" if partook else ""
    return f"{model_words(model)}: {told.sentence}{warned}"
