"""What the simulated rig can be asked for, and what those who record it may know."""

from typing import Any

import numpy as np
import pytest

from instrument.bench.rig import Bench, SimulatedStream


@pytest.mark.parametrize("velocity", [0.02, 1.0])
@pytest.mark.parametrize("spread", [0.0, 0.99])
@pytest.mark.parametrize("added", [0.0, 1.0])
def test_a_rig_at_its_limits_can_be_made(velocity: float, spread: float, added: float) -> None:
    bench = Bench(velocity_m_per_s=velocity, velocity_spread=spread, added_kg=added)
    assert bench.loaded_bodies.block_mass_kg == bench.bodies.block_mass_kg + added == bench.setup.moving_mass_kg


@pytest.mark.parametrize(
    "asked",
    [
        {"velocity_m_per_s": 0.0199},
        {"velocity_m_per_s": 1.001},
        {"velocity_m_per_s": -0.265},
        {"velocity_spread": -0.01},
        {"velocity_spread": 1.0},
        {"added_kg": -1e-6},
        {"added_kg": 1.001},
        {"effects": {"witchcraft": {}}},
    ],
)
def test_a_rig_beyond_them_is_refused(asked: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"can be simulated|witchcraft"):
        Bench(**asked)


def test_pushes_spread_about_the_speed_that_was_asked_for_and_do_not_repeat() -> None:
    stage = SimulatedStream(Bench(velocity_spread=0.15), 1e6)
    scenes = [stage.push(0.0) for _ in range(12)]
    speeds = [-float(np.interp(scene.release_s, scene.time_s, scene.block_m_per_s)) for scene in scenes]
    assert stage.shots == 12
    assert all(0.265 * 0.85 <= speed <= 0.265 * 1.15 for speed in speeds)
    assert max(speeds) - min(speeds) > 0.02 and len(set(speeds)) == 12
