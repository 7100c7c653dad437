"""Numbers as rows of text: units, small sources together, differences from the paper, and a session's shared part."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.paper.paper import PaperRow, Status
from analysis.shot.impact import Disturbance, VibrationLine
from analysis.shot.quantity import NotSeen, Quantity
from analysis.uncertainty.gum_budget import BudgetRow, QuantityBudget, budget
from app.report.number_tables import (
    _budget,
    disturbance_section,
    fitted,
    model_of_readings,
    numbers,
    paper_cells,
    scaled,
    shown_number,
    summary,
)
from app.report.session_section import shared_stds
from app.report.shot_figures import beat_hz, contact_span_ms, deflection_of, grid_ms, time_zero
from tests.app.synthetic import TOUCH_S, bare_shot, shot


def _row(**other: object) -> PaperRow:
    plain = PaperRow(
        key="force_peak", section="simulation", what="peak force", where="Fig. 5", unit="N", paper=0.5,
        printed=0.5123456789, simulated=0.51, recorded=NotSeen("none"), status=Status.AGREES,
    )  # fmt: skip
    return replace(plain, **other)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("difference", "words"),
    [
        (4.9e-7, "none"),
        (-4.9e-7, "none"),
        (5.1e-7, "+1 ppm"),
        (-4.94e-4, "-494 ppm"),
        (5.06e-4, "+0.051 %"),
        (-0.123, "-12 %"),
        (2.0, "+2e+02 %"),
        (2.01, "×3.0"),
        (98.0, "×99.0"),
        (99.5, "×100"),
    ],
)
def test_a_difference_is_in_ppm_per_cent_or_a_factor(difference: float, words: str) -> None:
    assert shown_number(_row(), difference, relative=True) == words
    assert shown_number(_row(), None, relative=True) == ""


@pytest.mark.parametrize(
    ("key", "unit", "value", "shown", "named"),
    [
        ("x", "s", 0.0287, "28.7", " (ms)"),
        ("x", "m", 2.3e-3, "2.3", " (mm)"),
        ("x", "kg", 17.85e-3, "17.85", " (g)"),
        ("x", "Pa", 131e9, "131", " (GPa)"),
        ("x", "1", 0.98, "0.98", ""),
        ("x", "N", 0.5123456789, "0.5123457", " (N)"),
        ("x", "kg/m3", 8510.0, "8510", " (kg/m³)"),
        ("wavelength", "m", 632.8e-9, "632.8", " (nm)"),
        ("record_length", "s", 0.166, "0.166", " (s)"),
        ("input.step_s", "s", 1e-8, "10", " (ns)"),
    ],
)
def test_a_number_of_the_paper_is_in_its_readable_unit(key, unit, value, shown, named) -> None:
    row = _row(key=key, unit=unit, paper=value, printed=None, simulated=value, recorded=Quantity(value, value / 100))
    what, said, printed, simulated, recomputed, recorded, _ = paper_cells(row)
    assert (what, said, printed, simulated, recomputed) == (f"peak force{named}", shown, "", shown, "")
    assert float(recorded.split(" ±")[0]) == pytest.approx(float(shown), rel=0.01)


def test_a_row_of_the_paper_says_how_far_it_is_off_before_and_after() -> None:
    status = Status.TRACED
    cells = paper_cells(_row(status=status, error_before=0.1, error_after=1e-4, paper_words="about half"))
    assert cells[1] == "about half" and cells[-1] == f"+10 % → +100 ppm {status.value}"
    assert paper_cells(_row(status=status, error_before=0.1, error_after=0.1))[-1] == f"+10 % {status.value}"
    assert paper_cells(_row(status=status, error_before=0.1))[-1] == f"+10 % → – {status.value}"
    assert paper_cells(_row(status=Status.INPUT, error_before=0.1))[-1] == Status.INPUT.value
    assert paper_cells(_row(paper=None))[1] == "–"


def test_a_budget_joins_the_sources_below_two_per_cent() -> None:
    def row(source: str, std: float | None, kind: str = "B", sensitivity: float = -2.0) -> BudgetRow:
        return BudgetRow(source, kind, std, "m", sensitivity, f"how {source}")

    sources = (row("large", 5e-4, "A"), row("kept", 2.2e-5), row("one", 1e-5), row("two", 1e-5), row("unknown", None))
    entry = QuantityBudget("k", "the number", "m", 2e-3, sources)
    page = _budget(entry)
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", part) for part in re.findall(r"<tr>(.*?)</tr>", page)[1:]]
    assert rows == [
        ["large", "A", "0.0005 m", "-2000", "1", "how large"],
        ["kept", "B", "2.2e-05 m", "-2000", "0.044", "how kept"],
        ["unknown", "B", "not known", "-2000", "", "how unknown"],
        ["2 more", "", "", "", "0.028", "one, two"],
    ]
    both = math.hypot(1.0, 0.044, 0.02, 0.02)
    assert f"type A 1, type B {math.hypot(0.044, 0.02, 0.02):.3g}, expanded {2 * both:.3g} (k = 2)" in page
    assert "the number: 2.0 ± 1.0 mm " in page and "contribution (mm)" in page


def test_a_reading_is_told_with_its_unit_and_what_was_not_seen_with_its_reason() -> None:
    assert scaled(Quantity(2.5e-3, 1e-5), "m") == "2.500 ± 0.010"
    assert scaled(NotSeen("no flight"), "s") == "\u2013" == scaled(Quantity(math.nan, 1.0), "s")
    page = numbers(shot(), None)
    assert "0.5119 ± 0.0012" in page and "not measured: the second flight is shorter" in page
    assert "No model was fitted." in fitted(None) and "motion alone" in model_of_readings(None)
    lost = replace(shot().fit, converged=False)
    assert "did not converge; its numbers are withheld" in fitted(lost) and "<table" not in fitted(lost)


def test_a_summary_has_the_numbers_and_what_casts_doubt_on_them() -> None:
    said = summary(replace(shot(), flags=("vibration", "clipped"), problem="odd"))
    first, second, *others = said.splitlines()
    assert (first, second) == ("shot-1", "  not analysed: odd")
    assert others[-2].startswith("  clipped: ") and others[-1].startswith("  vibration: ")
    assert any(line.startswith("  fit of model paper, reduced chi2 ") for line in others)
    assert any("– (the second flight is shorter" in line for line in others)
    assert summary(bare_shot("alone")) == "alone"


def test_a_disturbance_is_told_in_readable_units() -> None:
    line = VibrationLine(Quantity(24.9, 0.05), Quantity(3e-8, 1e-9), 1.25)
    found = Disturbance((line,), 2e-9, 3e-6, ((0.001, 0.0025),), {"velocity_in_m_per_s": 0.25})
    page = disturbance_section(found)
    for said in (
        "2 nm and 3 µm/s rms",
        "struck: 1.0 to 2.5 ms",
        "25 % for",
        f"{Quantity(24.9, 0.05)}",
        "30.0 ± 1.0",
        "1.250",
    ):
        assert said in page
    quiet = disturbance_section(Disturbance((), 2e-9, 3e-6))
    assert "<table" not in quiet and "struck" not in quiet and "Share" not in quiet


def test_what_all_shots_share_is_the_median_of_their_type_b() -> None:
    shots = [shot("a"), shot("b", 0.30, seed=2), shot("c", 0.35, seed=3), bare_shot("none")]
    each = [{entry.key: entry.std_b for entry in budget(one).quantities} for one in shots[:3]]
    shared = shared_stds(shots)
    assert shared.keys() == each[0].keys()
    for key, std in shared.items():
        assert std == pytest.approx(sorted(one[key] for one in each)[1], rel=1e-12)


def test_figures_count_from_first_touch_else_from_the_trigger_else_from_the_start() -> None:
    whole = shot()
    assert time_zero(whole) == (TOUCH_S, "time from first touch")
    assert time_zero(replace(whole, impact=None, trigger_time_s=0.02)) == (0.02, "time from the light switch")
    assert time_zero(replace(whole, impact=None, trigger_time_s=None)) == (0.0, "time from the first sample")
    assert grid_ms(whole) == pytest.approx((-1e3 * TOUCH_S, 0.01))
    peaks = 2.4 * 2.6767
    assert contact_span_ms(whole) == pytest.approx((-0.12 * peaks, peaks))
    early = replace(whole, impact=replace(whole.impact, bounce_peaks_s=(TOUCH_S + 1e-4,)))
    assert contact_span_ms(early) == pytest.approx((-0.24, 2.0))
    many = (*whole.impact.bounce_peaks_s, TOUCH_S + 0.02)  # a fourth does not count
    assert contact_span_ms(replace(whole, impact=replace(whole.impact, bounce_peaks_s=many)))[1] == pytest.approx(peaks)
    assert contact_span_ms(replace(whole, impact=None)) == (-1.0, 8.0)
    assert beat_hz(np.array([-0.25, 0.25]), 2.73e6, 632.8e-9) == pytest.approx(
        2.73e6 + np.array([1, -1]) * 0.5 / 632.8e-9
    )


def test_the_deflection_is_the_way_from_first_touch_into_the_plate_and_its_slope_is_in_newtons_per_metre() -> None:
    whole = shot()
    motion, overlay = whole.motion, whole.fit.shots[0].overlay
    found = deflection_of(whole, overlay)
    x, y = found.measured
    release = whole.impact.release_time_s.value
    inside = (motion.time_s > TOUCH_S - 1e-3) & (motion.time_s < release + 1e-3)
    assert y == pytest.approx(motion.force_n[inside]) and x.max() == pytest.approx(2.386, abs=1e-3)
    assert x[np.argmin(abs(motion.time_s[inside] - TOUCH_S))] == pytest.approx(0.0, abs=1e-3)
    assert np.ptp(found.simulated[0] - x) < 0.02  # the model's, from the same touch
    ends, level = found.slope
    assert ends == pytest.approx([0.0, x.max()])
    assert (level[1] - level[0]) / (1e-3 * ends[1]) == pytest.approx(214.3)
    deep = x > x.max() / 2
    assert np.interp(x[deep].mean(), ends, level) == pytest.approx(y[deep].mean())
    assert deflection_of(whole, None).simulated is None
    without = replace(whole, impact=replace(whole.impact, release_time_s=NotSeen("ends before")))
    assert deflection_of(without, None).measured[0].size == np.count_nonzero(
        (motion.time_s > TOUCH_S - 1e-3) & (motion.time_s < TOUCH_S + 0.031)
    )
    assert deflection_of(replace(whole, impact=None), None) is None
