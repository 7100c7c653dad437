"""Numbers are told with the prefix that reads best, and a dash has no unit."""

import math

import pytest
from PySide6.QtCore import QLocale

from app.words.model_texts import prefix_for
from app.words.wording import with_prefix


@pytest.mark.parametrize(
    ("value", "unit", "told"),
    [
        (111e-6, "m", "111 µm"), (9.21, "N", "9.21 N"), (1.5e-9, "m", "1.5 nm"), (4e-13, "m", "0.4 pm"),
        (0.0, "N", "0 N"), (-3.1e-3, "N", "-3.1 mN"), (0.99999e-3, "N", "1 mN"), (math.nan, "m", "–"), (None, "N", "–"),
        (12345.0, "Hz", "12.3 kHz"),
    ],
)  # fmt: skip
def test_numbers_with_prefixes(value, unit, told):
    before = QLocale()
    QLocale.setDefault(QLocale("C"))
    try:
        assert with_prefix(value, unit) == told
    finally:
        QLocale.setDefault(before)


def test_a_plot_counts_in_the_prefix_of_its_largest():
    assert prefix_for(3e-8, "m") == (pytest.approx(1e9), "nm") and prefix_for(0.0, "m") == (1.0, "m")
