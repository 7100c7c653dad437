"""Which of a shot's readings rest on a model, and on which: the others are read from the motion alone."""

from dataclasses import dataclass
from typing import Any

from analysis.shot.quantity import Quantity
from analysis.shot.shot import Shot

PULSE = ("force_peak_n", "force_fwhm_s", "contact_time_s", "deflection_max_m")
CONTACT = "cor_kinetic.contact"


@dataclass(frozen=True, slots=True)
class ReadingsModel:
    """The model that ``readings``, by their names in the result, are taken from: a base and its effects."""

    base: str
    effects: tuple[str, ...]
    readings: tuple[str, ...]


def readings_model(shot: Shot) -> ReadingsModel | None:
    """Return the model that some of the shot's readings rest on; None where all are the motion's own."""
    fit = shot.readings_fit or shot.fit
    if fit is None or shot.impact is None:
        return None
    from analysis.fitted import from_model  # and all of the fit: not at every start

    readings = PULSE if from_model.FLAG in shot.impact.flags else ()
    if isinstance(shot.impact.cor_kinetic.contact, Quantity):
        readings = (*readings, CONTACT)
    return ReadingsModel(fit.model, fit.effects, readings) if readings else None


def to_result(model: ReadingsModel | None) -> dict[str, Any] | None:
    """Return the result file's entry."""
    if model is None:
        return None
    return {"base": model.base, "effects": list(model.effects), "readings": list(model.readings)}
