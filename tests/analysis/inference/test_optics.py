"""What the optics show of a small change of a motion, against the difference of what they show of two."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision import SensorInput
from analysis.collision.effects import effect_named
from analysis.collision.parameters import PAPER
from analysis.inference.model.optics import change_shown, shown_by_optics
from analysis.inference.model.response import respond
from tests.analysis.inference.shown import model_of

TIME_S = np.arange(1000) * 5e-5
OWN = np.array([-0.265, 0.0101234, 0.0])
LAG = {"demodulation_lag": {"time_s": 1e-4}}
ERROR = {"cyclic_error": {"amplitude_m": 3e-9, "order": 1.0, "phase_rad": 0.3}}
LINE = {"frame_vibration": {"amplitude_m_per_s": 1e-4, "frequency_hz": 80.0, "phase_rad": 0.2}}


@pytest.mark.parametrize("have", [{}, LAG, ERROR, LAG | LINE, LAG | ERROR | {"tilt": {"angle_rad": 1e-3}}])
def test_a_small_change_is_shown_as_two_motions_differ(have: Mapping[str, Mapping[str, float]]) -> None:
    shot = model_of(TIME_S, PAPER.vector[:4], OWN, have)
    bare = model_of(TIME_S, PAPER.vector[:4], OWN, {name: v for name, v in have.items() if name == "tilt"})
    run = respond(bare, TIME_S, stride=1.0)
    change = np.stack([np.sin(900.0 * TIME_S), np.cos(300.0 * TIME_S)], axis=1)
    found = change_shown(shot, shot.path(1), change)
    h = 1e-12
    for k in range(2):
        ahead, back = (
            shown_by_optics(
                shot, run.displacement_m + way * change[:, k],
                run.velocity_m_per_s + way * np.gradient(change[:, k], TIME_S) * ("demodulation_lag" in have),
            )
            for way in (h, -h)
        )  # fmt: skip
        slope = (ahead - back) / (2 * h)
        assert np.abs(found[:, k] - slope).max() < 2e-3 * np.abs(slope).max()
    if not have:
        assert found is change


def test_effects_of_the_sensor_follow_each_other_on_the_records_own_light() -> None:
    shot = model_of(TIME_S, PAPER.vector[:4], OWN, {**LAG, **ERROR, "viscous_drag": {"coefficient_n_s_per_m": 1.0}})
    x, v = -0.2 * TIME_S, np.full(TIME_S.size, -0.2)
    seen = SensorInput(TIME_S, v, 632.8e-9, 10 / 5e-5)
    expected: Any = x[:, None]
    for have in (LAG, ERROR):
        ((name, values),) = have.items()
        sensor = effect_named(name).sensor
        assert sensor is not None
        expected = sensor(seen, expected, np.array([*values.values(), 0.0, 0.0])[:3, None])
    np.testing.assert_allclose(shown_by_optics(shot, x, v), expected[:, 0], rtol=1e-14)
    dark = replace(shot, samples=replace(shot.samples, wavelength_m=None))
    lagging = model_of(TIME_S, PAPER.vector[:4], OWN, LAG)
    np.testing.assert_array_equal(shown_by_optics(dark, x, v), shown_by_optics(lagging, x, v))
    none = model_of(
        TIME_S, PAPER.vector[:4], OWN, {"frame_vibration": LINE["frame_vibration"] | {"amplitude_m_per_s": 0.0}}
    )
    assert shown_by_optics(none, x, v).tolist() == x.tolist()
    both = np.stack([x, x + 1e-3], axis=1)
    assert shown_by_optics(shot, both, v).shape == both.shape
