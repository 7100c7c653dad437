"""What a leak adds to a phase, against the argument of the two phasors' sum."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.signal.phase_errors import Leak, leak_phase


@pytest.mark.parametrize("ratio", [0.01, 0.05, 0.1])
def test_to_the_second_order_in_the_ratio(ratio: float) -> None:
    """At a slow Doppler shift, where no filter takes anything off."""
    tuning = SimpleNamespace(window=np.ones(1), decimation=1, spread=0.0, phase_rate_hz=1e6)
    track = SimpleNamespace(spec=SimpleNamespace(tuning=tuning))
    grid = SimpleNamespace(rate_hz=1e6, input_rate_hz=1e6, step=1)
    rest = 0.25 * np.arange(20_000)
    true = rest + np.linspace(0.0, 7.0, rest.size)
    angle = 2 * np.pi * (0.3 + rest - true)
    exact = np.angle(1.0 + ratio * np.exp(1j * angle)) / (2 * np.pi)
    added = leak_phase(Leak(ratio, 0.0, 0.3), true + exact, rest, cast(Any, track), cast(Any, grid))
    third = ratio**3 / (2 * np.pi)
    inside = slice(100, -100)
    assert np.max(np.abs(added - exact)[inside]) < 2.0 * third < 0.5 * ratio**2 / (4 * np.pi)
