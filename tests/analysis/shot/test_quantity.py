"""A number is shown with the last digits of its uncertainty, and never with more."""

import math

import pytest

from analysis.shot.quantity import NotSeen, Quantity, to_json


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
