"""Names carry their units: every effect's row says the same in its name and in its unit."""

import pytest

from analysis.collision.effects import CATALOGUE
from analysis.shot.quantity import words_and_unit


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
def test_a_name_is_read(name: str, words: str, unit: str) -> None:
    assert words_and_unit(name) == (words, unit)


def test_rows_and_names_agree() -> None:
    for effect in CATALOGUE.values():
        for parameter in effect.parameters:
            assert words_and_unit(parameter.name)[1] == parameter.unit, f"{effect.name}.{parameter.name}"
