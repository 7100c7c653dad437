"""The report on a shot or a session: a self-contained, printable HTML page with the command that repeats it."""

from collections.abc import Collection, Sequence
from datetime import UTC, datetime

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis, PredictionTest
from analysis.fitted import readings_model
from analysis.shot import PLOT_UNITS, Shot
from analysis.uncertainty import budget
from app.report import provenance
from app.report.diagnosis_section import diagnosis_section, prediction_section
from app.report.number_tables import budgets, disturbance_section, fitted, model_of_readings, numbers
from app.report.session_section import session_section
from app.report.shot_figures import figures
from app.report.svg_plot import style_sheet
from app.words import Markup, by_severity, flag_words, joined, table, tag

MAX_DRAWN = 24  # most shots with figures; more would make the file too large for a browser
NO_LOADING = "default-src 'none'; style-src 'unsafe-inline'"


def report_of(
    shots: Sequence[Shot],
    diagnosis: Diagnosis | None = None,
    *,
    made_at: datetime | None = None,
    prediction: PredictionTest | None = None,
    tried: Collection[Effect] = (),
    next_shots: str = "",
) -> str:
    """Return the report as HTML.

    For several shots an overlay and trends precede the sections on the single shots.  ``made_at`` defaults to now;
    ``tried`` are effects in the model that no diagnosis found; ``next_shots`` is the plan of the next shots in words.
    Figures are inline SVG and the style sheet is included; the page loads nothing and runs no script.
    """
    made = (made_at or datetime.now(UTC)).astimezone(UTC).strftime("%Y-%m-%d %H:%M UTC")
    heading = shots[0].name if len(shots) == 1 else f"Session of {len(shots)} shots"
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=NO_LOADING),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", f"{heading} \u2013 Levimass report"),
        tag("style", Markup(style_sheet())),
    )
    body = [tag("header", tag("h1", heading), tag("p", f"Levimass report, made {made}", class_="faint"))]
    if not shots:
        body.append(tag("p", "This report contains no shots.", class_="warning"))
    if len(shots) > 1:
        body.append(session_section(shots))
    if diagnosis is not None:
        body.append(diagnosis_section(diagnosis, shots, next_shots))
    if prediction is not None:
        body.append(prediction_section(prediction))
    drawn = len(shots) <= MAX_DRAWN
    if not drawn:
        said = f"Figures and budgets of single shots are left out beyond {MAX_DRAWN} shots; a report of one has them."
        body.append(tag("p", said, class_="warning"))
    for number, shot in enumerate(shots, 1):
        body.append(_shot(shot, shots, number, drawn, tried, single=len(shots) == 1))
    body.append(_program())
    return "<!DOCTYPE html>\n" + tag("html", head, tag("body", body), lang="en") + "\n"


def _shot(
    shot: Shot,
    others: Sequence[Shot],
    number: int,
    drawn: bool,
    tried: Collection[Effect],
    *,
    single: bool,
) -> Markup:
    heading = Markup() if single else tag("h2", shot.name)
    parts: list[Markup] = [heading, _remarks(shot)]
    of = budget(shot, others=others) if shot.impact is not None else None
    if shot.impact is not None:
        parts += [tag("h3", "Numbers"), numbers(shot, of), model_of_readings(readings_model(shot))]
        if shot.impact.disturbance is not None:
            parts += [tag("h3", "Vibration of the path"), disturbance_section(shot.impact.disturbance)]
    if shot.motion is not None:
        parts += [tag("h3", "Model"), fitted(shot.fit, tried, of)]
    if drawn and shot.motion is not None:
        parts += [tag("h3", "Figures"), *figures(shot)]
    if drawn and of is not None:
        parts += [tag("h3", "Uncertainty budget"), budgets(of)]
    parts += [
        tag("h3", "Taken with"), provenance.taken_with(shot),
        tag("h3", "Analysed with"), provenance.analysed_with(shot),
        tag("h3", "How to reproduce"), provenance.repeated_by(shot, tried),
    ]  # fmt: skip
    return tag("section", parts, id=f"shot-{number}", class_="shot")


def _remarks(shot: Shot) -> Markup:
    parts = []
    if shot.problem:
        parts.append(tag("p", f"Not analysed: {shot.problem}", class_="warning"))
    if shot.flags:
        parts.append(table([], [[flag, flag_words(flag)] for flag in by_severity(shot.flags)], "flags"))
    if shot.note:
        parts.append(tag("p", tag("b", "Note: "), shot.note, class_="note"))
    if shot.plot_notes:
        rows = []
        for note in shot.plot_notes:
            x_unit, y_unit = PLOT_UNITS[note.plot]  # a time is from the recording's first sample
            rows.append([note.plot, f"{note.x:.6g} {x_unit}", f"{note.y:.4g} {y_unit}", note.text])
        parts.append(table(["note on the plot", "at", "value", "text"], rows, "overview"))
    return joined(*parts)


def _program() -> Markup:
    said = (
        f"{provenance.program_words()}. ± is the standard uncertainty, type A from this measurement's own values, "
        "type B from elsewhere; numbers are in the units stated, with a decimal point. Right is positive: the block "
        "approaches with v < 0 and leaves with v > 0."
    )
    return tag("footer", tag("p", said))
