"""Lines in what a fit leaves over: waves at even times, and records too short for any."""

import numpy as np
import pytest

from analysis.collision.linearisation import linear_path
from analysis.collision.on_moving_frame import moved_by_frame
from analysis.collision.parameters import Collision
from analysis.inference.screen.lines import _Waves, _waves

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
    path = linear_path(collision, (), TIME_S - TIME_S[300])
    moved, after = moved_by_frame(path, collision, np.empty(0), TIME_S.size)
    assert moved.shape == (TIME_S.size, 0) and after.shape == (0,)


def test_a_lines_gain_is_that_of_a_fit_of_cosine_and_sine_beside_what_is_fitted() -> None:
    random = np.random.default_rng(2)
    frequency_hz = np.array([21.0, 100.0, 333.0, 900.0])
    white = _waves(frequency_hz, TIME_S)
    fitted = np.linalg.qr(np.stack([np.ones(1000), TIME_S, np.cos(2 * np.pi * 97.0 * TIME_S)], axis=1))[0]
    noise = random.standard_normal(1000) + 0.3 * np.sin(2 * np.pi * 333.0 * TIME_S)
    left = noise - fitted @ (fitted.T @ noise)
    c, s = white[:, :4], white[:, 4:]
    products = np.stack([np.einsum("ij,ij->j", one, other) for one, other in ((c, c), (c, s), (s, s))])
    found = _Waves(products, np.zeros((1000, 0)), np.zeros((0, 8))).gain(white, np.column_stack([fitted, left]))
    for k in range(4):
        columns = np.stack([c[:, k], s[:, k]], axis=1)
        columns -= fitted @ (fitted.T @ columns)
        gain = np.sum(left**2) - np.linalg.lstsq(columns, left, rcond=None)[1][0]
        assert found[k] == pytest.approx(gain, rel=1e-8)
    # whitening the motion of a frame adds directions to the waves
    directions, moved = random.standard_normal((1000, 2)), 0.1 * random.standard_normal((2, 8))
    whole = white + directions @ moved
    c, s = whole[:, :4], whole[:, 4:]
    products = np.stack([np.einsum("ij,ij->j", one, other) for one, other in ((c, c), (c, s), (s, s))])
    both = _Waves(products, directions, moved).gain(white, np.column_stack([fitted, left]))
    direct = _Waves(products, np.zeros((1000, 0)), np.zeros((0, 8))).gain(whole, np.column_stack([fitted, left]))
    np.testing.assert_allclose(both, direct, rtol=1e-9)
