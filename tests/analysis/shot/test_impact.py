"""What disturbs the path: the spectrum of the frame's vibration between its sines and beyond them."""

import numpy as np
import pytest

from analysis.shot.impact import Shaking


def test_beyond_its_last_sine_a_spectrum_falls_with_the_fourth_power_from_where_it_ends() -> None:
    """Up to its last frequency a flat spectrum is flat: the fall begins there and not before."""
    frequency_hz = np.array([10.0, 20.0, 30.0, 40.0])
    flat = Shaking(frequency_hz, np.full(4, 10.0 * 3e-18), np.ones(4, dtype=np.bool_))
    asked = np.array([10.0, 25.0, 40.0, 80.0, 400.0])
    found = flat.densities_m2_per_hz(asked) / 3e-18
    assert found == pytest.approx(np.array([1.0, 1.0, 1.0, 1.0 / 16.0, 1e-4]), rel=1e-9)
