"""Report figures of one shot: motion over time, residual, first contact, force against deflection, gap."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from analysis.shot import Floats, Motion, Overlay, Quantity, Shot
from analysis.uncertainty import noise_band_of_shot
from app.report.svg_plot import WIDTH, Band, Line, NoteMark, Plot, draw
from app.words import Markup, tag

MEASURED, SIMULATED = ("measured", "measured"), ("simulated", "simulated")  # (class in the style sheet, label)
_velocity, _force = attrgetter("velocity_m_per_s"), attrgetter("force_n")  # of a motion or an overlay
RESIDUAL, NOISE = ("residual", "measured \u2212 simulated"), ("band", "noise and floor vibration, \u00b12 \u03c3")


@dataclass(frozen=True, slots=True)
class _ShotTimeAxes:
    """A shot with the time axes of its figures, in ms from ``time_zero``."""

    shot: Shot
    motion: Motion
    time_ms: Floats
    time_label: str
    overlay: Overlay | None
    overlay_ms: Floats

    @property
    def marks(self) -> tuple[float, ...]:
        impact = self.shot.impact
        if impact is None:
            return ()
        zero = time_zero(self.shot)[0]
        instants = (impact.touch_time_s, impact.release_time_s)
        return tuple(1e3 * (t.value - zero) for t in instants if isinstance(t, Quantity) and math.isfinite(t.value))

    def remarks(self, plot: str, per_y: float = 1.0) -> tuple[NoteMark, ...]:
        """Return the operator's notes on a plot over time; ``per_y`` is the scale of the drawn values."""
        zero = time_zero(self.shot)[0]
        noted = (note for note in self.shot.plot_notes if note.plot == plot)
        return tuple(NoteMark(1e3 * (note.x - zero), per_y * note.y, note.text) for note in noted)


def figures(shot: Shot) -> list[Markup]:
    """Return the figures of a shot that its data allow, as HTML; none without a motion."""
    motion = shot.motion
    if motion is None:
        return []
    zero, label = time_zero(shot)
    overlay = shot.fit.shots[0].overlay if shot.fit is not None and shot.fit.converged and shot.fit.shots else None
    overlay_ms = 1e3 * (overlay.time_s - zero) if overlay is not None else np.empty(0)
    course = _ShotTimeAxes(shot, motion, 1e3 * (motion.time_s - zero), f"{label} (ms)", overlay, overlay_ms)
    made = [_whole(course), _residuals(course)]
    if shot.impact is not None:
        made += [_first_contact(course), _deflection(course), _gap(course)]
    return [figure for figure in made if figure is not None]


def figure(title: str, words: str, plots: list[Plot], legend: list[tuple[str, str]], height: int) -> Markup:
    """Return a figure of stacked plots with caption and legend."""
    keys = [tag("span", text, class_=f"key {kind}") for kind, text in legend]
    drawn = [draw(plot, width=WIDTH, height=height) for plot in plots]
    return tag("figure", drawn, tag("figcaption", tag("b", title), f" {words} ", keys))


def beat_hz(velocity_m_per_s: Floats, rest_hz: float, wavelength_m: float) -> Floats:
    """Return the beat frequency of the measurement photodiode, f_rest - 2 v / lambda (Eq. 1 and 2), shape (n,)."""
    return rest_hz - 2.0 * velocity_m_per_s / wavelength_m


def _whole(course: _ShotTimeAxes) -> Markup:
    rest, wavelength_m = course.motion.rest_frequency_hz, course.motion.wavelength_m
    plots = [_over_time(course, "velocity (m/s)", _velocity), _over_time(course, "force (N)", _force)]
    words = "Velocity and force over the whole shot."
    if isinstance(rest, Quantity) and wavelength_m is not None:
        words = "Beat frequency of the measurement photodiode, velocity and force over the whole shot."
        rest_hz = rest.value

        def beat_mhz(of: Motion | Overlay) -> Floats:
            return 1e-6 * beat_hz(of.velocity_m_per_s, rest_hz, wavelength_m)

        plots.insert(0, _over_time(course, "beat (MHz)", beat_mhz))
    words += " Vertical lines: first touch and release." if course.marks else ""
    return figure("The shot.", words, plots, _legend(course), 178)


def _residuals(course: _ShotTimeAxes) -> Markup | None:
    shot, over, motion = course.shot, course.overlay, course.motion
    if over is None or shot.fit is None:
        return None
    noise = noise_band_of_shot(shot)
    rows = (
        ("displacement", "nm", 1e9, shot.fit.shots[0].residual_m, noise.displacement_m),
        ("velocity", "µm/s", 1e6, motion.velocity_m_per_s - over.velocity_m_per_s, noise.velocity_m_per_s),
        ("force", "mN", 1e3, motion.force_n - over.force_n, noise.force_n),
    )
    plots = []
    for kind, unit, scale, residual, std in rows:
        line = Line(course.time_ms, scale * residual, RESIDUAL[0])
        band = Band(course.time_ms, 2.0 * scale * std)
        remarks = course.remarks(f"residual of {kind}", scale)
        label = f"{kind} ({unit})"
        plots.append(
            Plot(course.time_label, label, (line,), (band,), (), course.marks, zero_line=True, remarks=remarks)
        )
    words = "Within the band the residual is noise and vibration; outside it the model is incomplete."
    return figure("Residual.", words, plots, [RESIDUAL, NOISE], 165)


def _first_contact(course: _ShotTimeAxes) -> Markup:
    span = contact_span_ms(course.shot)
    plots = [_over_time(course, "velocity (m/s)", _velocity, span), _over_time(course, "force (N)", _force, span)]
    return figure("First contact.", "Bounces at the beginning of the contact.", plots, _legend(course), 190)


@dataclass(frozen=True, slots=True)
class Deflection:
    """Force in N against deflection in mm of the plate from first touch on, positive into the plate."""

    measured: tuple[Floats, Floats]  # (deflection, force), (n,) each; NaN where not measured
    simulated: tuple[Floats, Floats] | None
    slope: tuple[Floats, Floats] | None  # end points of the line fitted above half the greatest deflection


def deflection_of(shot: Shot, overlay: Overlay | None) -> Deflection | None:
    """Return the contact of a shot and of its fitted model; None if no touch was seen."""
    motion, impact = shot.motion, shot.impact
    if motion is None or impact is None or not isinstance(touch := impact.touch_time_s, Quantity):
        return None
    release = impact.release_time_s
    until = release.value if isinstance(release, Quantity) else touch.value + 0.03
    at_touch = float(np.interp(touch.value, motion.time_s, motion.displacement_m))

    def contact(course: Motion | Overlay) -> tuple[Floats, Floats]:
        chosen = (course.time_s > touch.value - 1e-3) & (course.time_s < until + 1e-3)
        return 1e3 * (at_touch - course.displacement_m[chosen]), course.force_n[chosen]

    x, y = contact(motion)
    if len(x) < 2:
        return None
    line, slope = None, impact.stiffness_slope_n_per_m
    if isinstance(slope, Quantity) and math.isfinite(slope.value) and np.isfinite(x).any():
        deep = x > 0.5 * float(np.nanmax(x))
        ends = np.array([0.0, float(np.nanmax(x))])
        line = ends, float(np.nanmean(y[deep])) + 1e-3 * slope.value * (ends - float(np.nanmean(x[deep])))
    return Deflection((x, y), contact(overlay) if overlay is not None else None, line)


def _deflection(course: _ShotTimeAxes) -> Markup | None:
    shot, found = course.shot, deflection_of(course.shot, course.overlay)
    if found is None or shot.impact is None:
        return None
    drawn = ((found.simulated, SIMULATED[0]), (found.measured, MEASURED[0]), (found.slope, "slope"))
    lines = [Line(*points, kind) for points, kind in drawn if points is not None]
    legend = _legend(course)
    if found.slope is not None:
        legend.append(("slope", f"slope, {shot.impact.stiffness_slope_n_per_m} N/m"))
    noted = (note for note in shot.plot_notes if note.plot == "force vs deflection")
    remarks = tuple(NoteMark(1e3 * note.x, note.y, note.text) for note in noted)
    plot = Plot("deflection of the plate from first touch (mm)", "force (N)", tuple(lines), remarks=remarks)
    return figure("Force against deflection.", "Its slope is close to the stiffness.", [plot], legend, 300)


def _gap(course: _ShotTimeAxes) -> Markup | None:
    if course.overlay is None:
        return None
    lines = (Line(course.overlay_ms, 1e6 * course.overlay.gap_m, SIMULATED[0]),)
    span = contact_span_ms(course.shot)
    remarks = course.remarks("gap", 1e6)
    plot = Plot(course.time_label, "gap (µm)", lines, (), (), (), span, zero_line=True, remarks=remarks)
    words = "Distance between block and plate in the fitted model; below zero they overlap."
    return figure("Gap.", words, [plot], [SIMULATED], 190)


def _over_time(
    course: _ShotTimeAxes,
    label: str,
    values: Callable[[Motion | Overlay], Floats],
    span: tuple[float, float] | None = None,
) -> Plot:
    """Return a plot of the measured motion and, behind it, the simulated one; ``values`` picks what is drawn."""
    lines = [Line(course.time_ms, values(course.motion), MEASURED[0])]
    if course.overlay is not None:
        lines.insert(0, Line(course.overlay_ms, values(course.overlay), SIMULATED[0]))
    remarks = course.remarks(label.partition(" (")[0])
    return Plot(course.time_label, label, tuple(lines), (), (), course.marks, span, remarks=remarks)


def _legend(course: _ShotTimeAxes) -> list[tuple[str, str]]:
    return [MEASURED, SIMULATED] if course.overlay is not None else [MEASURED]


def time_zero(shot: Shot) -> tuple[float, str]:
    """Return the plots' time origin in s and its name: first touch, else the trigger, else the first sample."""
    touch = shot.impact.touch_time_s if shot.impact is not None else None
    if isinstance(touch, Quantity) and math.isfinite(touch.value):
        return touch.value, "time from first touch"
    if shot.trigger_time_s is not None:
        return shot.trigger_time_s, "time from the light switch"
    return 0.0, "time from the first sample"


def grid_ms(shot: Shot) -> tuple[float, float]:
    """Return the time of a motion's first sample relative to ``time_zero``, and the time step, both in ms."""
    assert shot.motion is not None
    return 1e3 * (float(shot.motion.time_s[0]) - time_zero(shot)[0]), 1e3 / shot.motion.sample_rate_hz


def contact_span_ms(shot: Shot) -> tuple[float, float]:
    """Return begin and end of the first bounces, with a margin, in ms from ``time_zero``."""
    zero, _ = time_zero(shot)
    if shot.impact is None or not shot.impact.bounce_peaks_s:
        return -1.0, 8.0
    peaks = [1e3 * (t - zero) for t in shot.impact.bounce_peaks_s[:3]]
    reach = max(2.0, 2.4 * max(peaks))
    return -0.12 * reach, reach
