"""Tables of a shot's numbers for the report, lines of them for a terminal, and rows of the paper's numbers."""

import math
from collections.abc import Collection, Mapping, Sequence

from analysis.collision import Effect
from analysis.fitted import ReadingsModel, readings_model
from analysis.paper import PaperRow, Status
from analysis.shot import Disturbance, Fit, NotSeen, Quantity, Reading, Shot, display_unit, split_unit
from analysis.uncertainty import (
    COVERAGE_FACTOR,
    Budget,
    BudgetRow,
    Origin,
    QuantityBudget,
    collision_numbers,
    combined_uncertainties,
    number_with_key,
    with_combined_uncertainty,
    with_unit,
)
from app.words import DASH, Markup, by_severity, flag_words, joined, or_dash, table, tag

SMALL = 0.02  # contributions below this fraction of the combined uncertainty share one row


def numbers(shot: Shot, of: Budget | None) -> Markup:
    """Return the table of the numbers read from the motion, with the reason for each number that was not seen."""
    rows = []
    for number in collision_numbers(Origin.READ, Origin.DERIVED):
        entry, reading = of.of(number.key) if of is not None else None, number.find(shot)
        if entry is not None or number.origin is Origin.READ:
            rows.append([with_unit(number.words, number.shown_unit), *_cells(reading, entry, number.unit)])
    header = ["", "value ± standard uncertainty", "type A part", "type B", f"expanded, k = {COVERAGE_FACTOR:g}", "how"]
    return table(header, rows, "numbers")


def model_of_readings(model: ReadingsModel | None) -> Markup:
    """Return a sentence on which readings were taken from which fitted model."""
    if model is None:
        return tag("p", "All are read from the motion alone.")
    readings = ", ".join(number_with_key(key).words for key in model.readings)
    effects = f" with {', '.join(effect.words for effect in model.effects)}" if model.effects else ""
    return tag("p", f"From the fitted model {model.base}{effects}: {readings}. All others are from the motion alone.")


def fitted(fit: Fit | None, tried: Collection[Effect] = (), of: Budget | None = None) -> Markup:
    """Return the fitted model's parameters with their uncertainties and correlations, or say why there are none.

    ``tried`` are effects that no diagnosis found; a warning names those in the model.  ``of`` is the shot's budget;
    without one, as for a joint fit, ± is from the noise of the samples.
    """
    if fit is None:
        return tag("p", "No model was fitted.")
    if not fit.converged:
        return tag("p", f"The fit of model {fit.model} did not converge; its numbers are withheld.", class_="warning")
    short = fit.short_names
    rows = []
    for index, (name, value) in enumerate(fit.parameters.items()):
        words, unit = split_unit(short[name])
        correlations = (or_dash(r, ".2f") for r in fit.correlations[index])
        entry = of.of(name) if of is not None else None
        noise = f"{value.std:.2g}" if entry is not None else "all"
        stated = entry.quantity if entry is not None else value
        rows.append([with_unit(words, unit), str(stated), noise, *correlations])
    header = [
        "",
        "value ± standard uncertainty",
        "type A part",
        *(split_unit(name)[0] for name in short.values()),
    ]
    effects = f" with {', '.join(effect.words for effect in fit.effects)}" if fit.effects else ""
    said = (
        f"Model {fit.model}{effects}: reduced χ² {fit.reduced_chi2:.4g}, "
        f"noise {1e9 * fit.noise_std_m:.3g} nm per displacement sample. Columns on the right: correlations."
    )
    unnamed = ", ".join(effect.words for effect in fit.effects if effect in tried)
    warning = (
        tag("p", f"Added by the operator, not found by a diagnosis: {unnamed}.", class_="warning")
        if unnamed
        else Markup()
    )
    return joined(tag("p", said), warning, table(header, rows, "numbers"))


def budgets(of: Budget) -> Markup:
    """Return the uncertainty budgets of all numbers."""
    if not of.quantities:
        return tag("p", "No number has a budget.")
    return joined(*[_budget(entry) for entry in of.quantities])


def scaled(reading: Reading, unit: str) -> str:
    """Return a reading as text in the unit in which it is shown; a dash if it was not seen."""
    if not isinstance(reading, Quantity) or not math.isfinite(reading.value):
        return DASH
    return str(reading.scaled(display_unit(unit)[0]))


def _cells(reading: Reading, entry: QuantityBudget | None, unit: str) -> list[str]:
    if isinstance(reading, NotSeen):
        return [DASH, "", "", "", f"not measured: {reading.reason}"]
    if entry is None:
        return [scaled(reading, unit), "", "", "", reading.how]
    factor, _ = display_unit(unit)
    parts = [f"{factor * part:.2g}" for part in (entry.std_a, entry.std_b, entry.expanded)]
    return [scaled(entry.quantity, unit), *parts, reading.how]


def _budget(entry: QuantityBudget) -> Markup:
    """Return the budget of one number; negligible sources share the last row."""
    factor, unit = display_unit(entry.unit)
    counts = [row for row in entry.rows if row.std is None or row.contribution > SMALL * entry.std]
    small = [row for row in entry.rows if row not in counts]
    rows = [_source(row, factor) for row in counts]
    if small:
        together = math.hypot(*(row.contribution for row in small))
        names = ", ".join(dict.fromkeys(row.source for row in small))
        rows.append([f"{len(small)} more", "", "", "", f"{factor * together:.2g}", names])
    parts = [f"{factor * part:.3g}" for part in (entry.std_a, entry.std_b, entry.expanded)]
    said = f"type A {parts[0]}, type B {parts[1]}, expanded {parts[2]} (k = {COVERAGE_FACTOR:g})"
    caption = tag(
        "h5", f"{entry.words}: {scaled(entry.quantity, entry.unit)} {unit} ", tag("span", said, class_="faint")
    )
    header = ["source", "type", "u(x)", "sensitivity", with_unit("contribution", unit), "how"]
    return tag("div", caption, table(header, rows, "budget"), class_="whole")


def _source(row: BudgetRow, factor: float) -> list[str]:
    unit = "" if row.unit == "1" else f" {row.unit}"
    std = "not known" if row.std is None else f"{row.std:.3g}{unit}"
    contribution = "" if row.std is None else f"{factor * row.contribution:.3g}"
    return [row.source, row.kind, std, f"{factor * row.sensitivity:.4g}", contribution, row.how]


def disturbance_section(disturbance: Disturbance) -> Markup:
    """Return the vibration of the optical path and its treatment: floor, spectral lines, knocks."""
    floor = (
        f"Site vibration of {1e9 * disturbance.floor_rms_m:.3g} nm and "
        f"{1e6 * disturbance.floor_rms_m_per_s:.3g} µm/s rms is included in the uncertainties."
    )
    parts = [tag("p", floor)]
    if disturbance.lines:
        rows = [
            [str(line.frequency_hz), str(line.amplitude_m.scaled(1e9)), f"{line.phase_rad:.3f}"]
            for line in disturbance.lines
        ]
        parts += [
            tag("p", "Spectral lines present in both flights were removed before the numbers were read:"),
            table(["frequency (Hz)", "amplitude (nm)", "phase at the first sample (rad)"], rows, "numbers"),
        ]
    knocks = ", ".join(f"{1e3 * begin:.1f} to {1e3 * end:.1f} ms" for begin, end in disturbance.knocks_s)
    if knocks:
        parts.append(tag("p", f"Excluded because the table was struck: {knocks} of the record."))
    shares = [f"{100 * share:.0f} % for {number_with_key(name).words}" for name, share in disturbance.shares.items()]
    if shares:
        parts.append(tag("p", f"Share of the variance due to table vibration: {', '.join(shares)}."))
    return joined(*parts)


PAPER_SECTIONS = {
    "input": "Parameters of the paper's rig and simulation",
    "simulation": "The simulation",
    "measurement": "The measurement",
    "plate": "The plate",
    "instrument": "The instrument",
}
SCALES = {"s": (1e3, "ms"), "m": (1e3, "mm"), "kg": (1e3, "g"), "Pa": (1e-9, "GPa"), "1": (1.0, "")}
OWN_SCALES = {"wavelength": (1e9, "nm"), "record_length": (1.0, "s"), "input.step_s": (1e9, "ns")}


def paper_cells(row: PaperRow) -> tuple[str, ...]:
    """Return a row as text: name, paper, as printed, simulated, recomputed, recording, difference with status."""
    said = row.paper_words or shown_number(row, row.paper) or DASH
    unit = readable_unit(row)[1].replace("m3", "m³")
    recorded = str(row.recorded.scaled(readable_unit(row)[0])) if isinstance(row.recorded, Quantity) else ""
    if row.status in (Status.INPUT, Status.ADDED):
        difference = row.status.value
    else:
        before, after = (shown_number(row, error, relative=True) for error in (row.error_before, row.error_after))
        change = before if row.error_before == row.error_after else f"{before} → {after or '–'}"
        difference = f"{change} {row.status.value}"
    numbers = (shown_number(row, value) for value in (row.printed, row.simulated, row.recomputed))
    return with_unit(row.what, unit), said, *numbers, recorded, difference


def shown_number(row: PaperRow, value: float | None, *, relative: bool = False) -> str:
    """Return a number of a row in its readable unit, or a relative difference as %, ppm or factor; "" for None."""
    if value is None:
        return ""
    if relative:
        if value > 2.0:
            return f"×{value + 1.0:.{0 if value > 99.0 else 1}f}"
        if abs(value) < 5e-7:
            return "none"
        return f"{value * 1e6:+.0f} ppm" if abs(value) < 5e-4 else f"{value * 100.0:+.2g} %"
    return f"{value * readable_unit(row)[0]:.7g}"


def readable_unit(row: PaperRow) -> tuple[float, str]:
    """Return the factor from SI units to the readable unit, and the readable unit."""
    return OWN_SCALES.get(row.key) or SCALES.get(row.unit, (1.0, row.unit))


def summary(shot: Shot) -> str:
    """Return one shot's numbers for a terminal, with combined uncertainties for numbers that have a budget."""
    lines, combined = [f"{shot.path or shot.name}"], combined_uncertainties(shot)
    if shot.problem:
        lines.append(f"  not analysed: {shot.problem}")
    if shot.impact is not None:
        for number in collision_numbers(Origin.READ):
            reading = with_combined_uncertainty(number.find(shot), number.key, combined)
            shown = reading.scaled(number.scale) if isinstance(reading, Quantity) else f"– ({reading.reason})"
            lines.append(f"  {number.title:<27}{shown} {number.shown_unit}".rstrip())
        model = readings_model(shot)
        if model is not None and shot.readings_fit is not None:
            words, again = _model_name(model.base, model.effects), ", ".join(model.readings)
            lines.append(f"  readings from model {words}, which the diagnosis found: {again}")
    if shot.fit is not None and shot.fit.converged:
        lines += fit_lines(shot.fit, combined)
    if shot.flags:
        lines += [f"  {flag}: {flag_words(flag)}" for flag in by_severity(shot.flags)]
    return "\n".join(lines)


def fit_lines(fit: Fit, combined: Mapping[str, float]) -> list[str]:
    """Return a fitted model's parameters for a terminal; those with only a noise uncertainty say so."""
    lines = [f"  fit of model {_model_name(fit.model, fit.effects)}, reduced chi2 {fit.reduced_chi2:.3g}"]
    short = fit.short_names
    for name, quantity in fit.parameters.items():
        alone = "" if name in combined else "  (± from noise alone)"
        lines.append(f"    {short[name]:<32} {with_combined_uncertainty(quantity, name, combined)}{alone}")
    return lines


def _model_name(base: str, effects: Sequence[Effect]) -> str:
    return " + ".join((base, *(effect.name for effect in effects)))
