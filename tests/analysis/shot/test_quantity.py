"""A number is shown with two digits of its uncertainty, and its name carries its unit."""

import math

import pytest

from analysis.collision.effects import CATALOGUE
from analysis.shot.quantity import NotSeen, Quantity, power_of_time, split_unit, to_json


@pytest.mark.parametrize(
    ("value", "std", "shown"),
    [
        (0.98755572, 1.2e-7, "0.98755572 ± 0.00000012"),
        (221.39766, 0.00057, "221.39766 ± 0.00057"),
        (-0.265, 3e-6, "-0.2650000 ± 0.0000030"),
        (10003.4978, 1.0949, "10003.5 ± 1.1"),
        (12345.6, 123.4, "12350 ± 120"),
        (1.98363045e-4, 5.4448e-9, "(1.983630 ± 0.000054)e-4"),
        (2.73e6, 15.0, "(2.730000 ± 0.000015)e+6"),
        (0.0, 0.5, "0.00 ± 0.50"),
        (1.5, 0.0, "1.5"),
        (1.5, math.nan, "1.5"),
    ],
)
def test_shown(value: float, std: float, shown: str) -> None:
    assert str(Quantity(value, std)) == shown


def test_json_holds_no_infinity() -> None:
    assert to_json(Quantity(1.0, math.inf)) is None
    assert to_json(Quantity(math.nan, 1.0)) is None
    assert to_json(NotSeen("why")) is None
    assert to_json(Quantity(1.0, 0.5)) == {"value": 1.0, "std": 0.5}


@pytest.mark.parametrize(
    ("name", "words", "unit"),
    [
        ("coefficient_n_s2_per_m2", "coefficient", "N s²/m²"),
        ("velocity_in_m_per_s", "velocity in", "m/s"),
        ("ramp_m_per_s2", "ramp", "m/s²"),
        ("mobility_m_per_n_s", "mobility", "m/(N s)"),
        ("order", "order", ""),
        ("m", "m", ""),
        ("steps_per_s", "steps per s", ""),
    ],
)
def test_a_name_gives_words_and_unit(name: str, words: str, unit: str) -> None:
    assert split_unit(name) == (words, unit)


def test_rows_and_names_agree() -> None:
    for effect in CATALOGUE.values():
        for parameter in effect.parameters:
            assert split_unit(parameter.name)[1] == parameter.unit, f"{effect.name}.{parameter.name}"


@pytest.mark.parametrize(
    ("name", "power"),
    [
        ("plate_mass_kg", 0),
        ("deflection_m", 0),
        ("stiffness_n_per_m", -2),  # kg/s²
        ("force_n", -2),
        ("velocity_in_m_per_s", -1),
        ("coefficient_n_s_per_m", -1),  # kg/s
        ("coefficient_n_s2_per_m2", 0),  # kg/m
        ("coefficient_n_s3_per_m3", 1),
        ("coefficient_n_s4_per_m4", 2),
        ("ramp_m_per_s2", -2),
        ("jerk_m_per_s3", -3),
        ("snap_m_per_s4", -4),
        ("mobility_m_per_n_s", 1),  # s/kg
        ("frequency_hz", -1),
        ("relaxation_time_s", 1),
        ("plate_damping.coefficient_n_s_per_m", -1),
        ("order", 0),
    ],
)
def test_a_number_scales_with_the_clock_by_the_seconds_in_its_unit(name: str, power: int) -> None:
    assert power_of_time(name) == power
