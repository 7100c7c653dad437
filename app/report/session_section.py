"""Report section on several shots together: table, overlay from first touch, means, repeatability, trends."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.shot import Quantity, Shot, display_unit
from analysis.uncertainty import (
    Origin,
    Series,
    Summary,
    Trend,
    budget,
    collision_numbers,
    combined_uncertainties,
    series,
    with_combined_uncertainty,
    with_unit,
)
from app.report.number_tables import scaled
from app.report.shot_figures import contact_span_ms, figure, grid_ms, time_zero
from app.report.svg_plot import Dot, Line, Plot, draw
from app.words import Markup, by_severity, flag_name, joined, or_dash, table, tag

COLOURS = 8  # number of colours in the style sheet, series-0 to series-7, which then repeat
NAMED = 8  # most curves in a legend


def session_section(shots: Sequence[Shot]) -> Markup:
    """Return the section with table, overlay and trends of all shots."""
    found = series(shots)
    parts = [tag("h2", f"All {len(shots)} shots"), _overview(shots)]
    seen = [shot for shot in shots if shot.motion is not None and shot.impact is not None]
    if len(seen) > 1:
        parts.append(_overlay(seen))
    if found.summaries and len(found.shots) > 1:
        parts += [tag("h3", "Across the shots"), _summaries(found, shots)]
        plots = [_trend(summary) for summary in found.summaries if len(summary.shots) > 1]
        if plots:
            said = (
                "Against impact velocity. Bars: each shot's standard uncertainty from noise alone, without what all "
                "shots share. Line: weighted fit, where the shots differ in speed."
            )
            caption = tag("figcaption", tag("b", "Trends. "), said)
            parts.append(tag("figure", tag("div", plots, class_="grid2"), caption))
    return tag("section", parts)


def _overview(shots: Sequence[Shot]) -> Markup:
    listed = [number for number in collision_numbers(Origin.READ) if number.listed]
    rows = []
    for place, shot in enumerate(shots, 1):
        combined = combined_uncertainties(shot)
        readings = [with_combined_uncertainty(number.find(shot), number.key, combined) for number in listed]
        cells = [scaled(reading, number.unit) for reading, number in zip(readings, listed, strict=True)]
        failed = f"failed: {shot.problem}" if shot.problem else ""
        said = "; ".join(
            part for part in (failed, ", ".join(map(flag_name, by_severity(shot.flags))), shot.note) if part
        )
        rows.append([tag("a", shot.name, href=f"#shot-{place}"), shot.started_at or "", *cells, said])
    header = ["shot", "started", *(number.head for number in listed), "remarks"]
    note = "± is the combined standard uncertainty; its sources are in each shot's budget."
    return joined(table(header, rows, "overview"), tag("p", note, class_="faint"))


def _overlay(shots: Sequence[Shot]) -> Markup:
    spans = np.array([contact_span_ms(shot) for shot in shots])
    whole = (
        min(grid_ms(s)[0] for s in shots),
        max(1e3 * (float(s.motion.time_s[-1]) - time_zero(s)[0]) for s in shots if s.motion),
    )
    zoom = (float(spans[:, 0].min()), float(spans[:, 1].max()))
    plots = []
    for label, name, span in (
        ("velocity (m/s)", "velocity_m_per_s", whole),
        ("force (N)", "force_n", whole),
        ("force (N)", "force_n", zoom),
    ):
        lines = []
        for index, shot in enumerate(shots):
            assert shot.motion is not None
            at = 1e3 * (shot.motion.time_s - time_zero(shot)[0])
            lines.append(Line(at, getattr(shot.motion, name), f"series-{index % COLOURS}"))
        plots.append(Plot("time from first touch (ms)", label, tuple(lines), x_span=span))
    legend = [(f"series-{i}", shot.name) for i, shot in enumerate(shots)] if len(shots) <= NAMED else []
    return figure("Overlay.", "All shots, time from first touch; bottom: first contact.", plots, legend, 190)


def _summaries(found: Series, shots: Sequence[Shot]) -> Markup:
    shared = shared_stds(shots)
    rows = []
    for s in found.summaries:
        factor, unit = display_unit(s.unit)
        name = with_unit(s.words, unit)
        if isinstance(s.trend, Trend):
            slope = f"{s.trend.slope.scaled(factor)}"
            beyond = f"{s.trend.significance:.1f}"
        else:
            slope, beyond = f"\u2013 ({s.trend.reason})", ""
        noise = f"{factor * s.mean.std:.2g}" if isinstance(s.mean, Quantity) else ""
        both = s.mean
        if isinstance(s.mean, Quantity):
            both = replace(s.mean, std=math.hypot(s.mean.std, shared.get(s.key, 0.0)))
        sizes = [or_dash(factor * s.scatter, ".2g"), or_dash(factor * s.repeatability, ".2g")]
        rows.append([name, str(len(s.shots)), scaled(both, s.unit), noise, *sizes, slope, beyond])
    header = ["", "shots", "mean", "± from noise and scatter", "scatter", "repeatability", "slope per m/s", "slope / u"]
    note = (
        "The mean's ± is the combined standard uncertainty, with mass, wavelength, air and clock that all shots share. "
        "Scatter: standard deviation between the shots. Repeatability: the part of it that the shots' own "
        "uncertainties do not account for."
    )
    return joined(table(header, rows, "numbers"), tag("p", note, class_="faint"))


def shared_stds(shots: Sequence[Shot]) -> dict[str, float]:
    """Return each number's type B uncertainty, which all shots share, as the median over the shots, by key."""
    found: dict[str, list[float]] = {}
    for shot in shots:
        if shot.impact is not None:
            for quantity in budget(shot).quantities:
                found.setdefault(quantity.key, []).append(quantity.std_b)
    return {key: float(np.median(stds)) for key, stds in found.items()}


def _trend(summary: Summary) -> Markup:
    factor, unit = display_unit(summary.unit)
    dots = []
    columns = (summary.shots, summary.speeds_m_per_s, summary.values, summary.stds)
    for name, at, value, std in zip(*columns, strict=True):
        words = f"{name}: {Quantity(factor * value, factor * std)} {unit}"
        dots.append(Dot(float(at), float(factor * value), float(factor * std), words))
    lines: tuple[Line, ...] = ()
    if isinstance(summary.trend, Trend):
        ends = np.array([summary.speeds_m_per_s.min(), summary.speeds_m_per_s.max()])
        lines = (Line(ends, factor * np.array([summary.trend.at(v) for v in ends]), "slope"),)
    label = with_unit(summary.words, unit)
    return draw(Plot("impact velocity (m/s)", label, lines, dots=tuple(dots)), width=376, height=230)
