"""What the cursors say of a stretch whose measures are known."""

import numpy as np
import pytest

from app.window.plots.cursors import between


def test_measures_of_a_ramp():
    x_ms = np.linspace(0, 10, 1001)
    found = between("velocity", "m/s", 1e-3 * x_ms, 3.0 + 200.0 * x_ms * 1e-3, 3.0, 5.0)
    assert found.slope == pytest.approx(200.0)
    assert found.mean == pytest.approx(4.0)
    assert found.difference == 2.0
    assert found.rms == pytest.approx(np.sqrt(16 + 4 / 12), rel=1e-3)
    assert found.deviation == pytest.approx(2 / np.sqrt(12), rel=1e-2)


def test_lost_samples_do_not_count():
    y = np.ones(100)
    y[40:60] = np.nan
    found = between("force", "N", np.arange(100.0), y, 1.0, 1.0)
    assert (found.mean, found.rms) == (1.0, 1.0)


def test_nothing_between_is_nan_and_not_zero():
    found = between("force", "N", np.empty(0), np.empty(0), float("nan"), float("nan"))
    assert np.isnan([found.mean, found.rms, found.slope]).all()
