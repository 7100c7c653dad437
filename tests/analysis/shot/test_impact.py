"""What disturbs the path: the spectrum of the frame's vibration between its sines and beyond them."""

import numpy as np
import pytest

from analysis.shot.impact import VibrationLine, VibrationSpectrum
from analysis.shot.quantity import Quantity


def test_beyond_its_last_sine_a_spectrum_falls_with_the_fourth_power_from_where_it_ends() -> None:
    """Up to its last frequency a flat spectrum is flat: the fall begins there and not before."""
    frequency_hz = np.array([10.0, 20.0, 30.0, 40.0])
    flat = VibrationSpectrum(frequency_hz, np.full(4, 10.0 * 3e-18), np.ones(4, dtype=np.bool_))
    asked = np.array([10.0, 25.0, 40.0, 80.0, 400.0])
    found = flat.densities_m2_per_hz(asked) / 3e-18
    assert found == pytest.approx(np.array([1.0, 1.0, 1.0, 1.0 / 16.0, 1e-4]), rel=1e-9)


def _floor(frequency_hz: list[float], density: float, lines: int = 0) -> VibrationSpectrum:
    """Return a floor of even density, with so many lines of 1 pm^2 at 12, 22, ... Hz."""
    known = np.array(frequency_hz)
    frequency = np.append(known, [12.0 + 10 * n for n in range(lines)])
    order = np.argsort(frequency)
    power = np.append(density * np.gradient(known), np.full(lines, 1e-24))
    return VibrationSpectrum(frequency[order], power[order], order < known.size)


def test_power_is_density_times_width_and_lines_are_no_density() -> None:
    floor = _floor([10.0, 11.0, 15.0, 30.0], 3e-18, lines=2)
    assert floor.frequency_hz.tolist() == [10.0, 11.0, 12.0, 15.0, 22.0, 30.0]
    assert floor.random.tolist() == [True, True, False, True, False, True]
    found = floor.densities_m2_per_hz(np.array([10.0, 12.0, 22.0, 60.0])) / 3e-18
    assert found == pytest.approx([1.0, 1.0, 1.0, 1 / 16])
    assert floor.density_m2_per_hz(15.0) / 3e-18 == pytest.approx(1.0)
    assert floor.rms_m * 1e9 == pytest.approx(np.sqrt(1e18 * floor.power_m2.sum()))
    one = VibrationSpectrum(np.array([5.0]), np.array([1e-18]), np.ones(1, dtype=np.bool_))
    assert one.density_m2_per_hz(5.0) == 0.0  # of one sine no density is known


def test_what_is_left_below_a_frequency_has_every_line() -> None:
    floor = _floor([10.0, 20.0, 30.0], 3e-18, lines=1)
    slow = floor.below(20.0)
    assert slow.frequency_hz.tolist() == [10.0, 12.0] and slow.random.tolist() == [True, False]
    assert floor.below(0.0).frequency_hz.tolist() == [12.0]


def test_a_line_is_two_sines_of_its_power_at_either_end_of_its_uncertain_frequency() -> None:
    line = VibrationLine(Quantity(24.9, 0.02), Quantity(5e-9, 1e-10), 0.3)
    with_it = _floor([10.0, 40.0], 1e-18).with_lines([line])
    assert with_it.frequency_hz == pytest.approx([10.0, 24.88, 24.92, 40.0])
    assert with_it.random.tolist() == [True, False, False, True]
    assert with_it.power_m2 / 1e-18 == pytest.approx([30.0, 12.5, 12.5, 30.0])
