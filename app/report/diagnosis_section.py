"""Report sections on a diagnosis (evidence, errors, detection limits) and on the test of a model's predictions."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.diagnosis import (
    Diagnosis,
    Errors,
    FoundEffect,
    LearnedLaw,
    PredictionTest,
    in_words,
    prediction_words,
    remark_on,
)
from analysis.shot import Quantity, Shot, describe_plates, describe_weights, fitted_shots, motions_of, split_unit
from analysis.uncertainty import diagnosis_band
from app.report.number_tables import fitted
from app.report.shot_figures import NOISE, figure
from app.report.svg_plot import Band, Line, Plot
from app.words import DASH, VERDICTS, Markup, counted, joined, or_dash, prefix_for, table, tag
from instrument.files import one_line

ERRORS = (
    ("displacement_rms_m", "displacement, rms", "m"),
    ("velocity_rms_m_per_s", "velocity, rms", "m/s"),
    ("force_rms_n", "force, rms", "N"),
    ("reduced_chi2", "reduced χ²", ""),
)
_UNKNOWN = Errors(*4 * (np.nan,))
MAX_DRAWN = 8  # most shots whose residuals are drawn


def diagnosis_section(diagnosis: Diagnosis, shots: Sequence[Shot], next_shots: str = "") -> Markup:
    """Return the section on a diagnosis of ``shots``; ``next_shots`` is the plan of the next shots in words."""
    said = in_words(diagnosis)
    parts = [
        tag("p", tag("b", f"Verdict: {VERDICTS[diagnosis.verdict].full}."), class_="verdict"),
        tag("p", said.sentence),
        tag("p", _basis(shots)),
    ]
    if diagnosis.effects:
        parts += [tag("h3", "Effects"), *map(_effect, diagnosis.effects, said.effects)]
    if diagnosis.laws:
        parts += [tag("h3", "Laws learned from the shots"), *[_law(law) for law in diagnosis.laws]]
    parts += [tag("h3", "Error before and after"), _errors(diagnosis), _residuals(diagnosis, shots)]
    if said.remainder:
        parts += [tag("h3", "Remaining residual"), tag("p", said.remainder)]
    if diagnosis.candidates:
        parts += [tag("h3", "All candidate effects, best first"), _candidates(diagnosis)]
    if said.blind_spots:
        parts += [tag("h3", "Detection limits"), tag("ul", [tag("li", b) for b in said.blind_spots])]
    if further := next_shots or said.separating_shot:
        parts += [tag("h3", "Shot that would distinguish the candidates"), tag("p", further)]
    parts += [tag("h3", "Model of all shots, before"), fitted(diagnosis.fit_before)]
    if diagnosis.fit_after is not diagnosis.fit_before:
        parts += [tag("h3", "Model of all shots, after"), fitted(diagnosis.fit_after)]
    return tag("section", tag("h2", "Diagnosis"), parts)


def _basis(shots: Sequence[Shot]) -> str:
    """Return how many shots the diagnosis is based on, and their weights and plates."""
    motions = motions_of(fitted_shots(shots))
    rig = "; ".join(filter(None, (describe_weights([m.moving_mass_kg for m in motions]), describe_plates(motions))))
    return f"Based on {counted(len(motions), 'shot')}{f': {rig}' if rig else ''}."


def _effect(found: FoundEffect, sentence: str) -> Markup:
    lines = [tag("p", tag("b", found.effect.words), ": ", _parameters(found.parameters)), tag("p", sentence)]
    if found.evidence:
        said = ", ".join(f"{name.replace('_', ' ')} {value:.4g}" for name, value in found.evidence.items())
        lines.append(tag("p", f"Evidence: {said}."))
    if found.indistinguishable_from:
        others = ", ".join(other.words for other in found.indistinguishable_from)
        lines.append(tag("p", f"These data cannot distinguish it from {others}."))
    return tag("div", lines, class_="whole")


def _law(law: LearnedLaw) -> Markup:
    """Return a learned law: formula, alternative forms, and the free curve with two standard uncertainties."""
    low, high = law.visited
    lines = [
        tag(
            "p",
            tag("b", f"force on the {law.where}"),
            f" as a function of {law.argument}: ",
            law.formula or "no closed form",
        ),
        tag("p", "; ".join(f"{name} = {q} {unit}".strip() for name, (q, unit) in law.parameters.items())),
        tag(
            "p",
            f"Range covered: {low:.4g} to {high:.4g} {law.curve_unit}. Not observable: {'; '.join(law.not_observable)}."
            + (f" Also: {'; '.join(law.same_by_gauge)}." if law.same_by_gauge else ""),
        ),
    ]
    if law.other_forms:
        others = ", ".join(f"{o.form} (ΔBIC {o.delta_bic:+.1f})" for o in law.other_forms)
        lines.append(tag("p", f"These data do not exclude {others}."))
    x, force = law.curve_argument, 1e3 * law.curve_force_n
    band = [Line(x, force + sign * 2e3 * law.curve_std_n, "residual") for sign in (-1, 1)]
    plot = Plot(f"{law.argument} ({law.curve_unit})", "force (mN)", (Line(x, force, "measured"), *band))
    legend = [("measured", "free curve"), ("residual", "two standard uncertainties")]
    return tag("div", lines, figure("The curve learned from the shots.", "", [plot], legend, 220), class_="whole")


def _errors(diagnosis: Diagnosis) -> Markup:
    columns: list[tuple[str, Errors]] = [("before", diagnosis.error_before), ("after", diagnosis.error_after)]
    if diagnosis.error_held_out_before is not None and diagnosis.error_held_out_after is not None:
        columns += [
            ("validation shot, before", diagnosis.error_held_out_before),
            ("validation shot, after", diagnosis.error_held_out_after),
        ]
    rows = error_rows(columns)
    note = 'Same samples and bandwidth; "before" is the best fit of the diagnosed model without the effects found.'
    return joined(table(["", *(name for name, _ in columns)], rows, "numbers"), tag("p", note, class_="faint"))


def error_rows(columns: Sequence[tuple[str, Errors]]) -> list[list[str]]:
    """Return a row for each kind of known error, with a column for each model; all columns share the row's unit."""
    rows = []
    for name, words, unit in ERRORS:
        values = [getattr(errors, name) for _, errors in columns]
        if np.isfinite(values).any():
            scale, shown_in = prefix_for(float(np.nanmax(np.abs(values))), unit) if unit else (1.0, "")
            cells = [or_dash(scale * value, ".4g") for value in values]
            rows.append([f"{words} ({shown_in})" if shown_in else words, *cells])
    return rows


def _residuals(diagnosis: Diagnosis, shots: Sequence[Shot]) -> Markup:
    """Return figures of each shot's residual before and after; nothing if both are the same fit."""
    before, after = diagnosis.fit_before.shots, diagnosis.fit_after.shots
    used = fitted_shots(shots)
    if diagnosis.fit_after is diagnosis.fit_before or not before or len(before) != len(after):
        return Markup()
    plots = []
    for number, (one, other) in enumerate(zip(before[:MAX_DRAWN], after[:MAX_DRAWN], strict=True)):
        shot = used[number] if len(used) == len(before) else None
        name = shot.name if shot is not None else f"shot {number + 1}"
        lines = []
        for part, kind in ((one, "simulated"), (other, "residual")):
            at = 1e3 * (part.overlay.time_s - part.touch_time_s.value)
            lines.append(Line(at, 1e9 * part.residual_m, kind))
        bands: tuple[Band, ...] = ()
        if shot is not None and shot.motion is not None:
            noise_m, _ = diagnosis_band(diagnosis, shot)
            bands = (Band(lines[1].x, 2e9 * noise_m),)
        label = f"{one_line(name, 18)} (nm)"
        plots.append(Plot("time from first touch (ms)", label, tuple(lines), bands, zero_line=True))
    legend = [("simulated", "before"), ("residual", "after"), NOISE]
    return figure("Residual of displacement, before and after.", "", plots, legend, 165)


def _candidates(diagnosis: Diagnosis) -> Markup:
    rows = []
    for c in diagnosis.candidates:
        gain = DASH if c.delta_bic is None else f"{c.delta_bic:.4g}"
        rows.append([c.effect.words, f"{c.score:.4g}", gain, _parameters(c.parameters), remark_on(c)])
    return table(["effect", "score", "ΔBIC", "size", "remark"], rows, "candidates")


def _parameters(parameters: Mapping[str, Quantity]) -> str:
    parts = []
    for name, value in parameters.items():
        words, unit = split_unit(name)
        parts.append(f"{words} {value} {unit}".rstrip())
    return ", ".join(parts)


def prediction_section(prediction: PredictionTest) -> Markup:
    """Return the section on the test of a model file: summary sentence, errors of all shots and of each shot."""
    effects = " + ".join(effect.words for effect in prediction.effects) or "no effect"
    columns: list[tuple[str, Errors]] = [("base model", prediction.error_base), ("saved model", prediction.error_model)]
    each = [("", error or _UNKNOWN) for shot in prediction.shots for error in (shot.error_base, shot.error_model)]
    rows = error_rows([*columns, *each])  # in one call, so that all have the same units
    shots = []
    for place, shot in enumerate(prediction.shots):
        remark = shot.problem or ("used to fit the model: no test" if shot.took_part else "")
        shots.append([shot.name, *rows[0][3 + 2 * place : 5 + 2 * place], remark])
    which = rows[0][0]
    said = (
        f"Model {prediction.model} with {effects}, as saved; only the parameters of each shot (speed, touch and "
        "offset; a drive\u2019s constant force) were fitted."
    )
    sentence = prediction_words(prediction)
    body = joined(
        tag("p", tag("b", f"{sentence[0].upper()}{sentence[1:]}.")),
        tag("p", said),
        table(["", *(name for name, _ in columns)], [row[:3] for row in rows], "numbers"),
        table(["shot", f"base model: {which}", "saved model", "remarks"], shots, "numbers"),
    )
    return tag("section", tag("h2", "Test of model predictions"), body)
