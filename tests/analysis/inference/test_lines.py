"""Lines in what a fit leaves over: waves at even times, and records too short for any."""

from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.parameters import Collision
from analysis.collision.solver.linearisation import linear_path
from analysis.collision.solver.on_moving_frame import moved_by_frame
from analysis.inference.model.free_parameters import trial_effect
from analysis.inference.screen import lines
from analysis.inference.screen.lines import _gain, _waves, scan, starts_near_strong_lines
from analysis.inference.screen.whitened_columns import WhitenedColumns
from tests.analysis.diagnosis.shots import base_fit, shots

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
    nothing = np.zeros((0, 8))
    found = _gain(WhitenedColumns(white, np.zeros((1000, 0)), nothing, nothing), np.column_stack([fitted, left]))
    for k in range(4):
        columns = np.stack([c[:, k], s[:, k]], axis=1)
        columns -= fitted @ (fitted.T @ columns)
        gain = np.sum(left**2) - np.linalg.lstsq(columns, left, rcond=None)[1][0]
        assert found[k] == pytest.approx(gain, rel=1e-8)


def test_starts_lie_at_and_beside_the_loudest_lines_that_could_pay(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five of them at most, a width apart: one over the record."""
    grid = np.array([100.0, 104.0, 106.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0])
    total = np.array([50.0, 49.0, 48.0, 10.0, 40.0, 30.0, 20.0, 21.0, 60.0])
    monkeypatch.setattr(lines, "scan", lambda at: (grid, total))
    some: Any = Some(problem=Some(data=Some(shots=[Some(length_s=0.1), Some(length_s=0.2)])))
    mode, clamp = trial_effect(effect_named("block_mode")), trial_effect(effect_named("support_compliance"))

    def found(kind: Any, louder_than: float) -> list[float]:
        starts = starts_near_strong_lines(some, kind, louder_than)
        for start in starts:
            assert set(start) == {p.name for p in kind.effect.parameters}
            assert {**start, "frequency_hz": 0.0, "damping_ratio": 0.0} == {
                **kind.starts[0], "frequency_hz": 0.0, "damping_ratio": 0.0,
            }  # fmt: skip
        return [start["frequency_hz"] for start in starts]

    loud = [700.0, 100.0, 106.0, 300.0, 400.0]  # 104 Hz is within five of 100
    beside = [f + by for f in loud for by in (-1.25, 0.0, 1.25)]
    assert found(clamp, 0.0) == pytest.approx(beside)
    assert found(mode, 0.0) == pytest.approx([f for f in beside for _ in range(2)])
    dampings = [start["damping_ratio"] for start in starts_near_strong_lines(some, mode, 0.0)]
    assert len(set(dampings[:2])) == 2 and dampings == dampings[:2] * 15 and max(dampings) < 0.05
    assert found(clamp, 49.5) == pytest.approx(beside[:6]) and found(clamp, 60.0) == []


def test_a_scan_is_no_coarser_than_the_record_and_its_gains_are_those_of_every_shot() -> None:
    line = {"amplitude_m_per_s": 3e-7, "frequency_hz": 333.0, "phase_rad": 0.3}
    at = base_fit(shots({"frame_vibration": line}, count=2)).linearise()
    grid, total = scan(at)
    slowest, _ = at.problem.data.band_hz
    length = max(shot.length_s for shot in at.problem.data.shots)
    assert grid[0] == slowest and 2400.0 < grid[-1] < 2500.0
    np.testing.assert_allclose(np.diff(grid), np.minimum(0.03 * grid[:-1], 0.4 / length))
    assert abs(grid[total.argmax()] - 333.0) < 0.5 / length and total.max() > 100.0
    for k in (3, int(total.argmax()), 300):
        gain = 0.0
        turn = 2 * np.pi * grid[k]
        for index, (shot, left) in enumerate(zip(at.problem.data.shots, at.tangents.parts(at.left), strict=True)):
            waves = np.stack([np.cos(turn * shot.centre_s), np.sin(turn * shot.centre_s)], axis=1)
            white = shot.whitened(at.noise, waves)
            basis = np.hstack([at.basis.own[index], at.basis.shared[index]])
            taken = basis.T @ white  # a shot by itself: other shots hold shared parameters
            pull = white.T @ left
            gain += pull @ np.linalg.solve(white.T @ white - taken.T @ taken, pull)
        assert total[k] == pytest.approx(gain, rel=1e-6)
    assert scan(at)[1] is total
    none = type(at).of(at.problem, at.z)
    object.__setattr__(none, "left", np.zeros_like(at.left))
    assert not scan(none)[1].any()
