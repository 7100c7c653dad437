"""Which sensor effect was found first says nothing about which acts first."""

import numpy as np

from analysis.collision.parameters import PAPER
from tests.analysis.inference.shown import shown

LAG, RIPPLE = {"time_s": 8e-6}, {"amplitude_m": 1e-9, "order": 2.0, "phase_rad": 0.3}


def test_the_ripple_repeats_with_the_path_that_is_shown_whichever_was_found_first() -> None:
    time_s = np.arange(0.0, 0.05, 1e-5)
    own = np.array([-0.27, 0.01, 0.0])
    both = [
        shown(time_s, PAPER.vector[:4], own, values).displacement_m
        for values in (
            {"cyclic_error": RIPPLE, "demodulation_lag": LAG},
            {"demodulation_lag": LAG, "cyclic_error": RIPPLE},
        )
    ]
    assert np.array_equal(both[0], both[1])
    late = shown(time_s, PAPER.vector[:4], own, {"demodulation_lag": LAG}).displacement_m
    turn = int(np.argmin(late))
    near = slice(turn - 15, turn + 15)  # slow enough for the demodulator
    scale = 632.8e-9 / (4 * np.pi)
    ripple = -scale * np.angle(1.0 - 1e-9 / scale * np.exp(1j * (2.0 / scale * late[near] + 0.3)))
    assert np.abs(both[0][near] - late[near] - ripple).max() < 1e-12
