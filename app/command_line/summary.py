"""The numbers of one shot as lines for a terminal."""

from collections.abc import Mapping, Sequence

from analysis.collision import Effect
from analysis.fitted import readings_model
from analysis.shot import Fit, Quantity, Shot
from analysis.uncertainty import Origin, combined_of, of_collision, stated
from app.words import by_weight, flag_words


def summary(shot: Shot) -> str:
    """Return one shot's numbers for a terminal, with their combined uncertainties where they have a budget."""
    lines, combined = [f"{shot.path or shot.name}"], combined_of(shot)
    if shot.problem:
        lines.append(f"  not analysed: {shot.problem}")
    if shot.impact is not None:
        for number in of_collision(Origin.READ):
            reading = stated(number.find(shot), number.key, combined)
            shown = reading.scaled(number.scale) if isinstance(reading, Quantity) else f"– ({reading.reason})"
            lines.append(f"  {number.title:<27}{shown} {number.shown_unit}".rstrip())
        model = readings_model(shot)
        if model is not None and shot.readings_fit is not None:
            words, again = _model_name(model.base, model.effects), ", ".join(model.readings)
            lines.append(f"  made again with model {words}, which the diagnosis found: {again}")
    if shot.fit is not None and shot.fit.converged:
        lines += fit_lines(shot.fit, combined)
    if shot.flags:
        lines += [f"  {flag}: {flag_words(flag)}" for flag in by_weight(shot.flags)]
    return "\n".join(lines)


def fit_lines(fit: Fit, combined: Mapping[str, float]) -> list[str]:
    """Return a fitted model's numbers for a terminal; those without a combined uncertainty say so."""
    lines = [f"  fit of model {_model_name(fit.model, fit.effects)}, reduced chi2 {fit.reduced_chi2:.3g}"]
    short = fit.short_names
    for name, quantity in fit.parameters.items():
        alone = "" if name in combined else "  (± from noise alone)"
        lines.append(f"    {short[name]:<32} {stated(quantity, name, combined)}{alone}")
    return lines


def _model_name(base: str, effects: Sequence[Effect]) -> str:
    return " + ".join((base, *(effect.name for effect in effects)))
