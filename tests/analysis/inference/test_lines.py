"""Lines in what a fit leaves over: waves at even times, and records too short for any."""

import numpy as np
import pytest

from analysis.collision.parameters import Collision
from analysis.inference.noise.frame_response import responses
from analysis.inference.screen.lines import _waves

TIME_S = 3e-3 + np.arange(1000) / 20e3


@pytest.mark.parametrize("samples", [1, 31, 32, 33, 1000])
def test_waves_are_cosines_and_sines(samples: int) -> None:
    frequency_hz = np.array([21.0, 333.0, 2450.0])
    time_s = TIME_S[: max(samples, 2)]
    turn = 2 * np.pi * time_s[:, None] * frequency_hz
    found = _waves(frequency_hz, time_s)
    assert np.max(np.abs(found - np.concatenate([np.cos(turn), np.sin(turn)], axis=1))) < 1e-10


def test_a_record_too_short_for_any_line_has_none() -> None:
    assert _waves(np.empty(0), TIME_S).shape == (TIME_S.size, 0)


def test_a_frame_that_does_not_move_moves_nothing() -> None:
    collision = Collision(0.01785, -0.265, 221.4, 1.984e-4, 1e4, 0.4)
    moved, after = responses(collision, TIME_S - TIME_S[300], np.empty(0))
    assert moved.shape == (TIME_S.size, 0) and after.shape == (0,)
