"""What the report's figures draw: which curve, in which unit, from which instant on."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.effects import effects_named
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.recording import Air, Setup
from analysis.shot.shot import PlotNote
from analysis.uncertainty import noise_band_of_shot
from app.report import diagnosis_section as of_diagnosis
from app.report import session_section as of_session
from app.report import shot_figures
from app.report.diagnosis_section import diagnosis_section
from app.report.provenance import analysed_with, program_words, taken_with
from app.report.session_section import session_section
from tests.app.synthetic import RATE_HZ, TOUCH_S, diagnosis, learned_law, shot

ONE = shot()
MOTION, OVERLAY = ONE.motion, ONE.fit.shots[0].overlay
SINCE_TOUCH_MS = 1e3 * (MOTION.time_s - TOUCH_S)


@pytest.fixture
def drawn(monkeypatch):
    """The plots of each figure by its title, with its words and legend."""
    found: dict[str, tuple] = {}

    def figure(title, words, plots, legend, height):
        found[title] = (plots, words, legend)
        return ""
        return None

    for module in (shot_figures, of_diagnosis, of_session):
        monkeypatch.setattr(module, "figure", figure)
    return found


def _same(line, x, y, kind) -> None:
    assert line.kind == kind
    assert np.allclose(line.x, x, rtol=0.0, atol=1e-9) and np.array_equal(line.y, y)


def test_the_whole_shot_is_drawn_over_its_model_from_first_touch_on(drawn) -> None:
    shot_figures.figures(ONE)
    (beat, velocity, force), words, legend = drawn["The shot."]
    assert words.startswith("Beat frequency") and words.endswith("first touch and release.")
    rest_mhz = MOTION.rest_frequency_hz.value
    for line, speed in zip(beat.lines, (OVERLAY.velocity_m_per_s, MOTION.velocity_m_per_s), strict=True):
        assert line.y == pytest.approx(1e-6 * (rest_mhz - 2.0 * speed / 632.82e-9), rel=1e-12)
    for plot, name in ((velocity, "velocity_m_per_s"), (force, "force_n")):
        _same(plot.lines[0], SINCE_TOUCH_MS, getattr(OVERLAY, name), "simulated")
        _same(plot.lines[1], SINCE_TOUCH_MS, getattr(MOTION, name), "measured")
        assert plot.marks == pytest.approx((0.0, 28.7077)) and plot.x_span is None
        assert plot.x_label == "time from first touch (ms)"
    assert [plot.y_label for plot in (beat, velocity, force)] == ["beat (MHz)", "velocity (m/s)", "force (N)"]
    assert legend == [("measured", "measured"), ("simulated", "simulated")]


def test_without_a_model_or_an_optics_less_is_drawn(drawn) -> None:
    bare = replace(ONE, fit=None, motion=replace(MOTION, rest_frequency_hz=NotSeen("no optics")))
    shot_figures.figures(bare)
    plots, words, legend = drawn["The shot."]
    assert [plot.y_label for plot in plots] == ["velocity (m/s)", "force (N)"] and words.startswith("Velocity and")
    assert legend == [("measured", "measured")] and [len(plot.lines) for plot in plots] == [1, 1]
    assert set(drawn) == {"The shot.", "First contact.", "Force against deflection."}
    drawn.clear()
    shot_figures.figures(replace(ONE, impact=None, fit=replace(ONE.fit, converged=False)))
    assert set(drawn) == {"The shot."} and not drawn["The shot."][0][0].marks
    assert "Upright" not in drawn["The shot."][1] and drawn["The shot."][0][0].x_label.startswith("time from the light")
    assert shot_figures.figures(replace(ONE, motion=None)) == []


def test_residuals_have_their_unit_and_a_band_of_two_standard_deviations(drawn) -> None:
    note = PlotNote("residual of force", TOUCH_S + 2e-3, 0.25, "here")
    noted = replace(ONE, plot_notes=(note, replace(note, plot="gap", y=3e-6)))
    shot_figures.figures(noted)
    plots, *_ = drawn["Residual."]
    noise = noise_band_of_shot(ONE)
    expected = (
        ("displacement (nm)", 1e9, ONE.fit.shots[0].residual_m, noise.displacement_m),
        ("velocity (µm/s)", 1e6, MOTION.velocity_m_per_s - OVERLAY.velocity_m_per_s, noise.velocity_m_per_s),
        ("force (mN)", 1e3, MOTION.force_n - OVERLAY.force_n, noise.force_n),
    )
    for plot, (label, scale, residual, std) in zip(plots, expected, strict=True):
        (line,), (band,) = plot.lines, plot.bands
        assert plot.y_label == label and plot.zero_line and plot.marks == pytest.approx((0.0, 28.7077))
        assert line.y == pytest.approx(scale * residual, rel=1e-12, abs=0.0)
        assert band.half == pytest.approx(2.0 * scale * std, rel=1e-12, abs=0.0)
        assert np.allclose(band.x, SINCE_TOUCH_MS, rtol=0.0, atol=1e-9)
    assert [plot.remarks for plot in plots[:2]] == [(), ()]
    (remark,) = plots[2].remarks
    assert (remark.x, remark.y, remark.text) == (pytest.approx(2.0), pytest.approx(250.0), "here")
    ((gap,), _, _) = drawn["Gap."]
    assert gap.lines[0].y == pytest.approx(1e6 * OVERLAY.gap_m, rel=1e-12) and gap.remarks[0].y == pytest.approx(3.0)
    assert gap.zero_line and gap.x_span == shot_figures.contact_span_ms(ONE)


def test_the_first_contact_is_the_bounces_and_the_deflection_has_its_slope(drawn) -> None:
    note = PlotNote("force vs deflection", 1.5e-3, 0.3, "bend")
    shot_figures.figures(replace(ONE, plot_notes=(note,)))
    plots, _, legend = drawn["First contact."]
    assert [plot.x_span for plot in plots] == 2 * [shot_figures.contact_span_ms(ONE)]
    assert [plot.y_label for plot in plots] == ["velocity (m/s)", "force (N)"]
    assert [plot.lines[1].y is not None for plot in plots] == [True, True]
    (plot,), _, legend = drawn["Force against deflection."]
    assert [line.kind for line in plot.lines] == ["simulated", "measured", "slope"]
    assert legend[-1][1] == f"slope, {ONE.impact.stiffness_slope_n_per_m} N/m" and len(legend) == 3
    assert (plot.remarks[0].x, plot.remarks[0].y) == (pytest.approx(1.5), 0.3)
    x, y = plot.lines[2].x, plot.lines[2].y
    assert (y[1] - y[0]) / (x[1] - x[0]) == pytest.approx(0.2143, rel=1e-9)


def test_a_learned_law_is_drawn_with_two_standard_uncertainties(drawn) -> None:
    law = learned_law()
    diagnosis_section(replace(diagnosis(ONE), laws=(law,)), [ONE])
    ((plot,), _, legend) = drawn["The curve learned from the shots."]
    middle, low, high = plot.lines
    _same(middle, law.curve_argument, 1e3 * law.curve_force_n, "measured")
    for line, sign in ((low, -1), (high, 1)):
        _same(line, law.curve_argument, 1e3 * law.curve_force_n + sign * 2e3 * law.curve_std_n, "residual")
    assert (plot.x_label, plot.y_label) == ("place (m)", "force (mN)") and len(legend) == 2


def test_a_diagnosis_draws_its_first_eight_shots_before_and_after(drawn) -> None:
    shots = [replace(ONE, name=f"a rather long name {n}") for n in range(9)]
    part = ONE.fit.shots[0]
    after = replace(ONE.fit, shots=9 * (part,))
    before = replace(ONE.fit, shots=9 * (replace(part, residual_m=3.0 * part.residual_m),))
    diagnosis_section(replace(diagnosis(ONE), fit_before=before, fit_after=after), shots)
    plots, _, legend = drawn["Residual of displacement, before and after."]
    assert len(plots) == 8 and len(legend) == 3
    for plot in plots:
        _same(plot.lines[0], SINCE_TOUCH_MS, 1e9 * (3.0 * part.residual_m), "simulated")
        _same(plot.lines[1], SINCE_TOUCH_MS, 1e9 * part.residual_m, "residual")
        (band,) = plot.bands
        assert band.half[1000] == pytest.approx(2e9 * noise_band_of_shot(ONE).displacement_m[1000], rel=0.5)
        assert band.half.min() > 0.0 and plot.zero_line
    drawn.clear()
    diagnosis_section(replace(diagnosis(ONE), fit_before=before, fit_after=after), shots[:3])
    assert [len(plot.bands) for plot in drawn["Residual of displacement, before and after."][0]] == 8 * [0]


def test_all_shots_are_drawn_from_first_touch_on(drawn) -> None:
    late = replace(ONE.impact, touch_time_s=Quantity(TOUCH_S + 5e-3, 1e-6))
    shots = [ONE, replace(shot("two", 0.3, seed=3), impact=late)]
    session_section(shots)
    (velocity, force, contact), _, legend = drawn["Overlay."]
    assert legend == [("series-0", "shot-1"), ("series-1", "two")]
    for plot, name in ((velocity, "velocity_m_per_s"), (force, "force_n"), (contact, "force_n")):
        _same(plot.lines[0], SINCE_TOUCH_MS, getattr(MOTION, name), "series-0")
        _same(plot.lines[1], SINCE_TOUCH_MS - 5.0, getattr(shots[1].motion, name), "series-1")
    whole = (-65.0, 1e3 * ((MOTION.time_s.size - 1) / RATE_HZ - TOUCH_S))
    assert velocity.x_span == pytest.approx(whole) and force.x_span == pytest.approx(whole)
    spans = [shot_figures.contact_span_ms(one) for one in shots]
    assert contact.x_span == (min(low for low, _ in spans), max(high for _, high in spans))
    many = [replace(ONE, name=f"shot {n}") for n in range(9)]
    session_section(many)
    plots, _, legend = drawn["Overlay."]
    assert legend == [] and [line.kind for line in plots[0].lines[-2:]] == ["series-7", "series-0"]
    session_section(many[:8])
    assert len(drawn["Overlay."][2]) == 8


def _cells(markup) -> dict[str, str]:
    rows = str(markup).split("<tr><th")[1:]
    return {row.split(">")[1].split("<")[0]: row.split("<td>")[1].split("</td>")[0] for row in rows}


def test_the_analysis_is_told_with_its_settings_signals_and_times() -> None:
    told = replace(
        ONE,
        seconds={"load": 0.0123, "fit": 1.5},
        motion=replace(MOTION, measurement=replace(MOTION.measurement, clipped_fraction=0.00123)),
    )
    said = _cells(analysed_with(told))
    assert said["wavelength in air"] == "632.820000 nm" and said["rest frequency"].startswith("2.73")
    assert said["rest frequency"].endswith("MHz") and said["motion"] == "14000 samples at 100000 Hz"
    assert said["displacement known up to"] == "40000 Hz"
    assert said["reference beat"] == "2.730000 MHz, 0.4 V, 41.0 dB"
    assert said["measurement beat"] == "2.730000 MHz, 0.4 V, 38.0 dB, 0.12 % of the samples clipped"
    assert said["time spent"] == "load 12 ms, fit 1500 ms"
    assert _cells(analysed_with(ONE))["time spent"] == "not measured"
    dark = replace(ONE, motion=replace(MOTION, wavelength_m=None, rest_frequency_hz=NotSeen("no PD0"), reference=None))
    said = _cells(analysed_with(dark))
    assert said["wavelength in air"] == "none: no optics" and said["rest frequency"] == "not measured: no PD0"
    assert "reference beat" not in said and "measurement beat" in said
    assert "motion" not in _cells(analysed_with(replace(ONE, motion=None)))
    settings = replace(ONE.settings, effects=effects_named(("quadratic_drag",)))
    assert "quadratic" in _cells(analysed_with(replace(ONE, settings=settings)))["effects"]


def test_a_rig_that_states_little_is_told_with_what_was_assumed() -> None:
    said = _cells(taken_with(replace(ONE, setup=None, sample_rate_hz=None, samples=None, trigger_time_s=None)))
    assert said == {"started": ONE.started_at, "moving mass": "17.85 g"}
    assert "moving mass" not in _cells(taken_with(replace(ONE, setup=None, motion=None)))
    assert _cells(taken_with(replace(ONE, started_at=None)))["started"] == "not stated"
    air = Air(20.0, 1e5, 50.0)
    for setup, assumed in (
        (Setup(1e-3, air=air), True),
        (Setup(1e-3, air=air, wavelength_vacuum_m=633e-9), False),
        (Setup(1e-3, wavelength_vacuum_m=633e-9), True),
        (Setup(1e-3, wavelength_air_m=633e-9), False),
    ):
        assert ("wavelength in air" in _cells(taken_with(replace(ONE, setup=setup)))) is assumed
    many = _cells(taken_with(replace(ONE, setup=Setup(1e-3, extra={f"key {n}": n for n in range(50)}))))
    assert many["key 39"] == "39" and "key 40" not in many


def test_the_program_is_told_with_the_packages_that_its_numbers_are_from() -> None:
    assert [f" {name} " in program_words() for name in ("numpy", "scipy", "numba")] == [True, True, True]
    assert program_words().startswith("levimass ") and ", Python 3" in program_words()
