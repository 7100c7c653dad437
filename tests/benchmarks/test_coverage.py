"""The coverage benchmark's own reckoning: truth, bound, tables."""

import numpy as np
import pytest

from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import simulate_shot
from instrument.bench.site import site_named
from tests.benchmarks.coverage_shots import CONDITIONS, SITES, Case, bound, truth
from tests.benchmarks.coverage_table import BEGIN, END, excused, faults, into_page, tables


def test_truth_is_the_reference_solution_where_nothing_shakes():
    rig = Bench()
    true = truth(simulate_shot(rig, 0, 0.265, 0.06), rig.bodies, 0.265)
    assert true["velocity_out_m_per_s"] == pytest.approx(0.261702343, abs=1e-9)
    assert true["contact_time_s"] == pytest.approx(28.70771255e-3, abs=1e-9)
    assert true["deflection_max_m"] == pytest.approx(2.388512e-3, abs=1e-9)
    assert true["force_peak_n"] == pytest.approx(0.511915, abs=1e-6)
    assert true["stiffness_slope_n_per_m"] == pytest.approx(214.33, abs=0.02)
    assert true["force_fwhm_s"] == pytest.approx(19.1e-3, abs=0.1e-3)
    assert true["cor_kinetic.force_peaks"] == pytest.approx(0.9059 / 1.6086, abs=1e-3)
    assert true["cor_kinetic.onsets"] == pytest.approx(0.78330 / 1.56574, abs=1e-5)
    assert true["cor_kinetic.flights"] == pytest.approx(0.18685 / 1.11256, abs=1e-4)


def test_the_bound_follows_the_site_and_is_reached_by_weighted_least_squares():
    sites = (site_named(name) for name in ("VC-A", "VC-C", "quiet"))
    least = [bound(Bench(site=site), simulate_shot(Bench(), 0, 0.265, 0.06)) for site in sites]
    values = [b["cor_quasi_static"] for b in least]
    assert values[0] == pytest.approx(4 * values[1], rel=0.1) and values[2] < 1e-3 * values[1]


def test_a_flight_that_may_be_bent_is_known_less_where_little_shakes():
    rig, played = Bench(site=site_named("VC-G")), simulate_shot(Bench(), 0, 0.265, 0.06)
    straight, hardly, bent = (bound(rig, played, bend)["velocity_in_m_per_s"] for bend in (0.0, 1e-9, 1e-3))
    assert hardly == pytest.approx(straight, rel=1e-6) and 1.2 * straight < bent < 3 * straight
    loud = Bench(site=site_named("VC-A"))
    of_loud = [bound(loud, played, bend)["velocity_in_m_per_s"] for bend in (0.0, 1e-3)]
    assert of_loud[1] / of_loud[0] < bent / straight


def test_v_in_in_space_scatters_by_the_bound():
    rig = Bench(site=site_named("VC-C"), floor_m=0.0)
    least = bound(rig, simulate_shot(rig, 0, 0.265, 0.06))["velocity_in_m_per_s"]
    off = []
    for index in range(60):  # a straight line is not the best estimator: no better than the bound, not ten times worse
        run = simulate_shot(rig, index, 0.265, 0.06).trajectory
        time_s = np.linspace(0.0, run.touch_time_s - 1e-5, 100)
        off.append(np.polyfit(time_s, run.block_m(time_s), 1)[0] + 0.265)
    assert 0.8 * least < np.std(off) < 3 * least


def _outcome(index, value, std, true, flags=()):
    at = {"site": SITES[index % 7], "condition": CONDITIONS[index // 7 % 6]}
    read = {"velocity_in_m_per_s": [value, std, true], "force_peak_n": None}
    return {"index": index, **at, "read": read, "flags": list(flags), "bound": {"velocity_in_m_per_s": 0.5}}


def test_tables_count_what_is_off_and_what_is_said_of_it(tmp_path):
    said = [
        _outcome(14, 9.0, 1.0, 1.0, ["knock"]),
        _outcome(14, 9.0, 1.0, 1.0, ["vibration"]),
        _outcome(0, 1.0, 1.0, 1.5),
    ]
    assert [excused(outcome, "velocity_in_m_per_s") for outcome in said] == [True, False, False]
    assert excused(said[0], "fit.plate_mass_kg") and not excused(said[2], "fit.plate_mass_kg")
    assert len(faults(said)) == 1 and "8.0 sigma" in faults(said)[0]
    text = tables(said, 1)
    assert "100.0 %, 50.0 %" in text and "33 % (3)" in text and "2.00, 0 %" in text
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    into_page(page, text)
    assert page.read_text() == f"before\n{BEGIN}\n{text}\n{END}\nafter\n"


def test_the_scatter_of_plain_shots_is_told_with_what_it_has_by_chance():
    random = np.random.default_rng(5)
    plain = [_outcome(42 * k, 1.0 + off, 1.0, 1.0) for k, off in enumerate(random.normal(size=400))]
    knocked = [_outcome(42 * k + 14, 9.0, 1.0, 1.0) for k in range(400)]  # are none of them
    row = next(line for line in tables([*plain, *knocked], 1).splitlines() if "±" in line and "velocity" in line)
    assert CONDITIONS[42 // 7 % 6] == "plain" and "**" not in row
    told, std = map(float, row.split("|")[2].split("±"))
    assert told == pytest.approx(1.0, abs=0.1) and std == pytest.approx(1.0 / np.sqrt(800), abs=0.01)
    timid = [_outcome(42 * k, 1.0 + off, 3.0, 1.0) for k, off in enumerate(random.normal(size=400))]
    assert "**0.3" in tables(timid, 1)


def test_conditions_and_sites_are_all_drawn():
    drawn = {(Case(1, i).site, Case(1, i).condition) for i in range(42)}
    assert len(drawn) == len(SITES) * len(CONDITIONS)
