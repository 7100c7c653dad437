"""What ``--model`` names: a base model, or a file that holds one with the effects accepted into it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from analysis.shot.analysis_settings import AnalysisChoices
from analysis.shot.setting import settings_of

if TYPE_CHECKING:
    from analysis.diagnosis.model_file import SavedModel

MODELS = next(tuple(name for name, _ in s.choices) for s in settings_of(AnalysisChoices) if s.key == "model")


def is_model_file(model: str) -> bool:
    """Return whether ``--model`` names a file rather than a base model."""
    return model.endswith(".toml") or "/" in model


def known_model(model: str | None) -> SavedModel | None:
    """Return the model of a model file, or None where ``model`` is a name.  Raises RecordingError."""
    if model is None or not is_model_file(model):
        return None
    from app.session.model_in_use import load_model  # not for the sake of a usage error

    return load_model(Path(model))
