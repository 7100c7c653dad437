"""What the optics show of a small change of a motion, against the difference of what they show of two."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from analysis.collision import SensorInput
from analysis.collision.effects import effect_named
from analysis.collision.parameters import PAPER
from analysis.inference.model.response import Floats, change_shown, respond
from analysis.shot import DEFAULT_WAVELENGTH_AIR_M
from tests.analysis.inference.shown import model_of

TIME_S = np.arange(1000) * 5e-5
OWN = np.array([-0.265, 0.0101234, 0.0])
LAG = {"demodulation_lag": {"time_s": 1e-4}}
ERROR = {"cyclic_error": {"amplitude_m": 3e-9, "order": 1.0, "phase_rad": 0.3}}
LINE = {"frame_vibration": {"amplitude_m_per_s": 1e-4, "frequency_hz": 80.0, "phase_rad": 0.2}}
CHANGE = np.stack([np.sin(900.0 * TIME_S), np.cos(300.0 * TIME_S)], axis=1)


def through_sensor(have: Mapping[str, Mapping[str, float]], x: Floats, v: Floats) -> Floats:
    """Return a motion, shape (n,), after lag, vibration and cyclic error, in this order."""
    for name in ("demodulation_lag", "frame_vibration", "cyclic_error"):
        if name in have:
            sensor = effect_named(name).sensor
            assert sensor is not None
            parameters = np.array([*have[name].values(), 0.0, 0.0])[:3, None]
            x = sensor(SensorInput(TIME_S, v, 632.8e-9, 10 / 5e-5), x[:, None], parameters)[:, 0]
    return x


@pytest.mark.parametrize("have", [{}, LAG, ERROR, LAG | LINE, ERROR | LAG | {"tilt": {"angle_rad": 1e-3}}])
def test_a_small_change_is_shown_as_two_motions_differ(have: Mapping[str, Mapping[str, float]]) -> None:
    shot = model_of(TIME_S, PAPER.vector[:4], OWN, have)
    bare = model_of(TIME_S, PAPER.vector[:4], OWN, {name: v for name, v in have.items() if name == "tilt"})
    run = respond(bare, TIME_S, stride=1.0)
    found = change_shown(shot, shot.path(1), CHANGE)
    h = 1e-12
    for k in range(2):
        ahead, back = (
            through_sensor(
                have, run.displacement_m + way * CHANGE[:, k],
                run.velocity_m_per_s + way * np.gradient(CHANGE[:, k], TIME_S) * ("demodulation_lag" in have),
            )
            for way in (h, -h)
        )  # fmt: skip
        slope = (ahead - back) / (2 * h)
        assert np.abs(found[:, k] - slope).max() < 2e-3 * np.abs(slope).max()
    if not have:
        assert found is CHANGE


def test_a_record_without_a_wavelength_is_shown_as_the_fit_shows_it() -> None:
    shot = model_of(TIME_S, PAPER.vector[:4], OWN, ERROR)
    dark, usual = (
        change_shown(replace(shot, samples=replace(shot.samples, wavelength_m=wavelength_m)), shot.path(1), CHANGE)
        for wavelength_m in (None, DEFAULT_WAVELENGTH_AIR_M)
    )
    assert dark.tolist() == usual.tolist() != CHANGE.tolist()


def test_an_effect_of_no_amplitude_shows_a_change_as_it_is() -> None:
    for have in (LAG, ERROR, LINE):
        ((name, values),) = have.items()
        none = {name: values | {effect_named(name).amplitude: 0.0}}
        shot = model_of(TIME_S, PAPER.vector[:4], OWN, none)
        np.testing.assert_allclose(change_shown(shot, shot.path(1), CHANGE), CHANGE, rtol=1e-12)
