"""Which scale moves each number by which power, what its budget says in rows and files, and what repeats."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.shot.motion import BeatQuality
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.recording import Plate, Setup
from analysis.shot.sample_rate_error import fit_with_rate_error, with_rate_error
from analysis.uncertainty.budget_sources import InstrumentUncertainty, ShotSources
from analysis.uncertainty.gum_budget import (
    COLUMNS,
    Budget,
    BudgetRow,
    QuantityBudget,
    budget,
    budget_result,
    budget_rows,
    combined_uncertainties,
    with_combined_uncertainty,
)
from analysis.uncertainty.measurement_equations import between_onsets, between_peaks, first_flights
from tests.analysis.shots import ONSETS, PEAKS, RELEASES, at_speed, paper_impact, shot_of
from tests.analysis.synthetic_collision import Synthetic, motion_from

NOISES = ("beat noise", "repeatability", "m_p* of the fit", "k_N of the fit")
QUIET = dict.fromkeys(
    (
        "mass_u_kg", "wavelength_vacuum_relative", "air_temperature_u_k", "air_pressure_u_pa", "air_humidity_u_percent",
        "room_temperature_u_k", "room_pressure_u_pa", "room_humidity_u_percent", "alignment_limit_rad",
        "timebase_limit", "rest_frequency_u_hz", "instant_limit_s",
    ),
    0.0,
)  # fmt: skip
SETUP = Setup(moving_mass_kg=17.85e-3, wavelength_vacuum_m=632.991354e-9)
# the powers of mass, clock and length that each number scales with
POWERS = {
    "velocity_in_m_per_s": (0, -1, 1),
    "velocity_out_m_per_s": (0, -1, 1),
    "cor_quasi_static": (0, 0, 0),
    "cor_impulse": (0, 0, 0),
    "cor_kinetic.force_peaks": (0, 0, 0),
    "cor_kinetic.onsets": (0, 0, 0),
    "cor_kinetic.flights": (0, 0, 0),
    "cor_kinetic.contact": (0, 0, 0),
    "force_peak_n": (1, -2, 1),
    "force_fwhm_s": (0, 1, 0),
    "contact_time_s": (0, 1, 0),
    "deflection_max_m": (0, 0, 1),
    "plate_stiffness_n_per_m": (1, -2, 0),
    "plate_mass_kg": (1, 0, 0),
    "contact_stiffness_n_per_m": (1, -2, 0),
    "contact_damping_n_s_per_m": (1, -1, 0),
    "stiffness_slope_n_per_m": (1, -2, 0),
    "stiffness_from_slope_n_per_m": (1, -2, 0),
}


def rows_of(known: dict[str, float]) -> dict[str, QuantityBudget]:
    tables = budget(shot_of(setup=SETUP), InstrumentUncertainty(**QUIET | known))  # type: ignore[arg-type]
    return {table.key: table for table in tables.quantities}


@pytest.mark.parametrize(
    ("place", "known", "source", "relative"),
    [
        (0, {"mass_u_kg": 17.85e-6}, "mass", 1e-3),
        (1, {"timebase_limit": 1e-3 * math.sqrt(3.0)}, "timebase", 1e-3),
        (2, {"wavelength_vacuum_relative": 1e-3}, "wavelength in vacuum", 1e-3),
        (2, {"alignment_limit_rad": 0.05}, "alignment (cosine)", 0.5 * 0.05**2 / math.sqrt(3.0)),
    ],
)
def test_every_number_scales_with_its_powers_of_mass_clock_and_length(
    place: int, known: dict[str, float], source: str, relative: float
) -> None:
    tables = rows_of(known)
    assert set(tables) >= set(POWERS)
    for key, powers in POWERS.items():
        found = sum(row.sensitivity * (row.std or 0.0) for row in tables[key].rows if row.source == source)
        # the relative uncertainty is that of mass / value, of the clock and of the length
        assert found == pytest.approx(powers[place] * relative * tables[key].value, rel=1e-6, abs=1e-12), key


def test_each_reading_has_its_own_noise_under_its_own_name_as_type_a() -> None:
    tables = rows_of({})
    shot = shot_of(setup=SETUP)
    assert shot.impact is not None and shot.fit is not None
    for key, name in (
        ("velocity_in_m_per_s", "beat noise, flight in"),
        ("velocity_out_m_per_s", "beat noise, flight out"),
        ("cor_impulse", "beat noise, impulses"),
        ("force_peak_n", "beat noise, force"),
        ("force_fwhm_s", "beat noise, pulse width"),
        ("contact_time_s", "beat noise, contact time"),
        ("deflection_max_m", "beat noise, deflection"),
        ("stiffness_slope_n_per_m", "beat noise, slope"),
        ("plate_stiffness_n_per_m", "beat noise, through the fit"),
        ("plate_mass_kg", "beat noise, through the fit"),
        ("contact_stiffness_n_per_m", "beat noise, through the fit"),
        ("contact_damping_n_s_per_m", "beat noise, through the fit"),
    ):
        reading = getattr(shot.impact, key, None) or shot.fit.parameters[key]
        (row,) = (row for row in tables[key].rows if row.source == name)
        assert (row.kind, row.std, row.sensitivity) == ("A", pytest.approx(reading.std), pytest.approx(1.0)), key
        assert tables[key].std == pytest.approx(reading.std), key


def test_what_cancels_from_a_stiffness_and_a_ratio_is_listed_without_sensitivity() -> None:
    tables = rows_of({"wavelength_vacuum_relative": 1e-3, "alignment_limit_rad": 0.05})
    for key in ("plate_stiffness_n_per_m", "stiffness_slope_n_per_m", "cor_quasi_static", "cor_impulse"):
        found = {row.source: row.sensitivity for row in tables[key].rows}
        assert found["wavelength in vacuum"] == found["alignment (cosine)"] == 0.0, key
    for key in ("plate_mass_kg", "contact_time_s"):
        assert not {"wavelength in vacuum", "alignment (cosine)"} & {row.source for row in tables[key].rows}


def test_a_contradicted_rate_is_in_the_clock_alone_though_every_reading_carries_it() -> None:
    """Each number's own noise is what it was before the rate's error was added to it, whatever its power of time."""
    time = np.arange(0.0, 0.01, 1e-5)
    motion = replace(
        motion_from(time, -0.2 * time, Synthetic()), moving_mass_u_kg=0.0, rate_error=1e-3,
        reference=BeatQuality(2.7e6, 0.4, 40.0, 0.0), rest_frequency_hz=Quantity(2.7e6, 0.0),
    )  # fmt: skip
    plain = shot_of(setup=SETUP)
    assert plain.impact is not None and plain.fit is not None
    impact, fit = with_rate_error(plain.impact, motion), fit_with_rate_error(plain.fit, motion)
    wrong = budget(replace(plain, motion=motion, impact=impact, fit=fit), InstrumentUncertainty(**QUIET))  # type: ignore[arg-type]
    tables = rows_of({})
    for key in POWERS:
        found = wrong.of(key)
        assert found is not None
        assert found.std_a == pytest.approx(tables[key].std_a, rel=1e-2), key
        own = sum(row.contribution for row in found.rows if row.source == "timebase")
        assert own == pytest.approx(abs(1e-3 * POWERS[key][1] * found.value), rel=1e-6, abs=1e-12), key


def test_bounces_are_timed_between_peaks_onsets_and_the_ends_of_flights() -> None:
    impact = paper_impact()
    assert between_peaks(impact) == (PEAKS[:2], PEAKS[1:])
    assert between_onsets(impact) == (ONSETS[:2], ONSETS[1:])
    assert first_flights(impact) == ((RELEASES[0], ONSETS[1]), (RELEASES[1], ONSETS[2]))
    for key, (first, second) in (
        ("force_peaks", between_peaks(impact)),
        ("onsets", between_onsets(impact)),
        ("flights", first_flights(impact)),
    ):
        table = rows_of({})[f"cor_kinetic.{key}"]
        assert table.value == pytest.approx((second[1] - second[0]) / (first[1] - first[0]))
        parts = sorted(row.contribution for row in table.rows if row.source.startswith("beat noise"))
        reading = getattr(impact.cor_kinetic, key)
        assert math.hypot(*parts) == pytest.approx(reading.std, rel=1e-2)
        assert parts[0] / parts[1] == pytest.approx(table.value, rel=0.01)  # both intervals are as unsure


MADE = Budget(
    "s",
    (
        QuantityBudget(
            "k", "words", "N", 2.0,
            (BudgetRow("x", "A", 3.0, "m", -1.0, "hx"), BudgetRow("y", "B", 2.0, "kg", 2.0, "hy"),
             BudgetRow("z", "A", None, "N", 1.0, "hz")),
        ),
    ),
)  # fmt: skip


def test_contributions_add_in_squares_by_type() -> None:
    (table,) = MADE.quantities
    assert [row.contribution for row in table.rows] == [3.0, 4.0, 0.0]
    assert (table.std_a, table.std_b, table.std, table.expanded) == (3.0, 4.0, 5.0, 10.0)
    assert (table.quantity.value, table.quantity.std) == (2.0, 5.0)
    assert MADE.of("k") is table and MADE.of("x") is None


def test_a_budget_is_written_row_by_row_and_with_its_sums() -> None:
    head = ["s", "k", "N", "2.0"]
    assert budget_rows(MADE) == [
        [*head, "x", "A", "3.0", "m", "-1.0", "3.0", "hx"],
        [*head, "y", "B", "2.0", "kg", "2.0", "4.0", "hy"],
        [*head, "z", "A", "", "N", "1.0", "0.0", "hz"],
        [*head, "combined, type A", "A", "", "", "", "3.0", ""],
        [*head, "combined, type B", "B", "", "", "", "4.0", ""],
        [*head, "combined", "", "", "", "", "5.0", ""],
        [*head, "expanded, k = 2", "", "", "", "", "10.0", ""],
    ]
    assert len(COLUMNS) == 11
    source = {
        "source": "x",
        "type": "A",
        "std": 3.0,
        "unit": "m",
        "sensitivity": -1.0,
        "contribution": 3.0,
        "how": "hx",
    }
    written = json.loads(json.dumps(budget_result(MADE)))
    quantity = written["quantities"]["k"]
    assert written["coverage_factor"] == 2.0 and quantity.pop("sources")[0] == source
    assert quantity == {"value": 2.0, "unit": "N", "std_a": 3.0, "std_b": 4.0, "std": 5.0, "expanded": 10.0}


def repeatability(shot: Any, others: list[Any]) -> BudgetRow:
    table = budget(shot, others=others).of("cor_quasi_static")
    assert table is not None
    return next(row for row in table.rows if row.source == "repeatability")


@pytest.mark.parametrize(
    ("speed", "alike"), [(0.3 * 1.099, True), (0.3 * 1.101, False), (0.3 * 0.901, True), (0.3 * 0.899, False)]
)
def test_shots_within_a_tenth_of_the_speed_are_alike(speed: float, alike: bool) -> None:
    own = at_speed("own", 0.3, 0.98, 1e-7)
    row = repeatability(own, [own, at_speed("other", speed, 0.984, 1e-7)])
    if alike:
        assert (
            row.std == pytest.approx(4e-3 / math.sqrt(2.0), rel=1e-3) and "2 shots at similar speed, beyond" in row.how
        )
    else:
        assert (row.std, row.contribution) == (None, 0.0) and "no other shot" in row.how
    assert (row.kind, row.sensitivity, row.unit) == ("A", 1.0, "1")


@pytest.mark.parametrize(("count", "spread", "sloped"), [(3, 0.05, False), (4, 0.05, True), (4, 0.015, False)])
def test_a_line_over_speed_is_taken_off_four_shots_of_different_speed(count: int, spread: float, sloped: bool) -> None:
    shots = [
        at_speed(f"s{k}", v, 0.9 + 0.1 * v, 1e-9) for k, v in enumerate(0.3 * (1 + spread * np.linspace(0, 1, count)))
    ]
    row = repeatability(shots[0], shots[1:])
    values = [0.9 + 0.03 * (1 + spread * part) for part in np.linspace(0, 1, count)]
    assert row.std is not None
    if sloped:
        assert row.std < 1e-6 and "about their line over speed" in row.how
    else:
        assert row.std == pytest.approx(np.std(values, ddof=1), rel=1e-3)


def test_the_scatter_about_a_line_over_speed_has_two_degrees_of_freedom_fewer() -> None:
    off = np.array([3e-4, -5e-4, 1e-4, 4e-4, -3e-4, 2e-4])
    speeds = 0.3 * np.linspace(0.96, 1.04, 6)
    shots = [at_speed(f"s{k}", v, 0.9 + 0.1 * v + e, 1e-9) for k, (v, e) in enumerate(zip(speeds, off, strict=True))]
    left = off - np.polyval(np.polyfit(speeds, off, 1), speeds)
    assert repeatability(shots[0], shots[1:]).std == pytest.approx(np.sqrt(left @ left / 4), rel=1e-3)


def test_a_rest_frequency_taken_too_low_lifts_velocities_shortens_the_deflection_and_shears_the_slope() -> None:
    time = np.arange(0.0, 0.01, 1e-5)
    motion = replace(motion_from(time, -0.2 * time, Synthetic()), rest_frequency_hz=Quantity(2.7e6, 0.0))
    shot = shot_of(setup=SETUP, motion=motion)
    assert shot.impact is not None
    lasts = shot.impact.turnaround_time_s.value - shot.impact.touch_time_s.value  # type: ignore[union-attr]
    known = InstrumentUncertainty(**QUIET | {"rest_frequency_u_hz": 1.0})  # type: ignore[arg-type]
    half = 0.5 * 632.8e-9  # m/s of a hertz
    for key, expected in (
        ("velocity_in_m_per_s", half),
        ("velocity_out_m_per_s", half),
        ("cor_quasi_static", half * (1.0 / 0.265 + 0.261702343 / 0.265**2)),  # -(v_out + d) / (v_in + d)
        ("deflection_max_m", -half * lasts),
    ):
        table = budget(shot, known).of(key)
        assert table is not None
        found = {row.source: row.sensitivity for row in table.rows}["rest frequency"]
        assert found == pytest.approx(expected, rel=1e-3), key
    slope = budget(shot, known).of("stiffness_slope_n_per_m")
    assert slope is not None
    at = np.linspace(0.209, 0.975, 500)
    depth = 2.388512e-3 * np.sin(np.pi * at)
    (steeper, _) = np.polyfit(depth - half * 28.70771255e-3 * at, depth, 1)  # the deflection grows by less
    found = {row.source: row.sensitivity for row in slope.rows}["rest frequency"]
    assert found == pytest.approx(slope.value * (steeper - 1.0), rel=0.01)


def test_warmer_air_makes_lengths_longer_and_denser_air_shorter() -> None:
    tables = rows_of({"room_temperature_u_k": 1.0, "room_pressure_u_pa": 100.0, "room_humidity_u_percent": 1.0})
    rows = {row.source: row.sensitivity for row in tables["velocity_out_m_per_s"].rows}
    for name, slope in (("air temperature", 0.95e-6), ("air pressure", -0.268e-8), ("air humidity", 0.0085e-6)):
        assert rows[name] == pytest.approx(0.261702343 * slope, rel=0.03)


def test_numbers_that_were_not_seen_or_are_none_do_not_repeat() -> None:
    own = at_speed("own", 0.3, 0.98, 1e-7)
    assert own.impact is not None
    spoilt = [
        replace(own, name=f"n{k}", impact=replace(own.impact, cor_quasi_static=bad))
        for k, bad in enumerate((NotSeen("x"), Quantity(math.nan, 1.0), Quantity(0.9, math.inf)))
    ]
    assert repeatability(own, [own, *spoilt]).std is None


def test_a_reading_is_stated_with_its_combined_uncertainty() -> None:
    shot = shot_of(setup=SETUP)
    combined = combined_uncertainties(shot)
    assert combined == {table.key: table.std for table in budget(shot).quantities} and len(combined) >= 18
    assert combined_uncertainties(replace(shot, impact=None)) == {}
    reading = Quantity(3.0, 0.1, "how")
    assert with_combined_uncertainty(reading, "a", {"a": 0.5}) == Quantity(3.0, 0.5, "how")
    assert with_combined_uncertainty(reading, "a", {"b": 0.5}) is reading
    unseen = NotSeen("x")
    assert with_combined_uncertainty(unseen, "a", {"a": 0.5}) is unseen


def test_each_source_has_the_unit_of_its_own_kind() -> None:
    plate = Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8510.0, 131e9)
    known = replace(InstrumentUncertainty(), rest_frequency_u_hz=1.0)
    time = np.arange(0.0, 0.01, 1e-5)
    motion = motion_from(time, -0.2 * time, Synthetic())
    units: dict[str, set[str]] = {}
    for table in budget(shot_of(setup=replace(SETUP, plate=plate), motion=motion), known).quantities:
        for row in table.rows:
            units.setdefault(row.source, set()).add(row.unit)
            assert row.kind == ("A" if row.source.split(",")[0] in NOISES else "B"), row.source
    expected = {
        "mass": "kg", "timebase": "1", "alignment (cosine)": "1", "wavelength in vacuum": "m", "air temperature": "K",
        "air pressure": "Pa", "air humidity": "%", "rest frequency": "Hz", "bandwidth": "1", "bandwidth, T1": "s",
        "plate: arm length": "m", "plate: arm width": "m", "plate: thickness": "m", "plate: disc diameter": "m",
        "plate: beam theory": "1", "m_p* of the fit": "kg", "k_N of the fit": "N/m",
    }  # fmt: skip
    assert {source: units[source] for source in expected} == {source: {unit} for source, unit in expected.items()}
    table = ShotSources(shot_of(setup=SETUP), known)
    made = table.plate(plate)
    rows = {name: table.row(number, 1.0, 0.0) for name, number in made.items()}
    modulus = rows.pop("youngs_modulus_pa")
    assert modulus.unit == "Pa" and modulus.std == pytest.approx(0.02 * 131e9)
    assert {name: row.unit for name, row in rows.items()} == {
        "arm_length_m": "m", "arm_width_m": "m", "thickness_m": "m", "disc_diameter_m": "m", "density_kg_m3": "kg/m3",
        "beam_theory": "1",
    }  # fmt: skip
    assert made["arm_width_m"].nominal_value == 2e-3  # type: ignore[union-attr]


def test_without_a_fit_or_a_converged_one_a_slope_is_not_corrected() -> None:
    shot = shot_of(setup=SETUP)
    assert shot.fit is not None
    for fit in (None, replace(shot.fit, converged=False), replace(shot.fit, parameters={})):
        assert budget(replace(shot, fit=fit)).of("stiffness_from_slope_n_per_m") is None
    assert budget(shot).of("youngs_modulus_pa") is None  # no geometry is stated
