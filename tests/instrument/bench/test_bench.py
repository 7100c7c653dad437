"""What the simulated rig can be asked for, and what those who record it may know."""

from typing import Any

import numpy as np
import pytest

from instrument.bench import rig
from instrument.bench.optics import DropOut, Optics, node_times_s
from instrument.bench.rig import Bench, SimulatedStream
from instrument.bench.site import Knock, Site


@pytest.mark.parametrize("velocity", [0.02, 1.0])
@pytest.mark.parametrize("spread", [0.0, 0.99])
@pytest.mark.parametrize("added", [0.0, 1.0])
def test_a_rig_at_its_limits_can_be_made(velocity: float, spread: float, added: float) -> None:
    bench = Bench(velocity_m_per_s=velocity, velocity_spread=spread, added_kg=added)
    assert bench.bodies_with_weights.block_mass_kg == bench.bodies.block_mass_kg + added == bench.setup.moving_mass_kg


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


@pytest.mark.parametrize("sudden", ["nothing", "a knock", "a drop-out", "a flight"])
def test_a_path_has_close_nodes_where_something_sudden_may_lie_between_them(
    sudden: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    spaced: list[float] = []
    monkeypatch.setattr(rig, "node_times_s", lambda *of: (spaced.append(of[-1]), node_times_s(*of))[1])
    optics = Optics(drop_outs=(DropOut(5.0, 5.1),) if sudden == "a drop-out" else ())
    site = Site(knocks=(Knock(1e-6, at_s=0.0),) if sudden == "a knock" else ())
    stage = SimulatedStream(Bench(optics=optics, site=site), 10e6)
    pushed = stage.push(0.1)
    out = np.empty((1000, 3), np.int16)
    ends = round(10e6 * pushed.release_s), round(10e6 * pushed.caught_s)
    firsts = {"a flight": [ends[0] - 999, ends[1] - 1]}.get(sudden, [0, ends[0] - 1001, ends[1] + 1])
    for first in firsts:
        stage.fill(first, out)
    assert spaced == [40e-6 if sudden == "nothing" else 5e-6] * len(firsts)


def test_pushes_spread_about_the_speed_that_was_asked_for_and_do_not_repeat() -> None:
    stage = SimulatedStream(Bench(velocity_spread=0.15), 1e6)
    scenes = [stage.push(0.0) for _ in range(12)]
    speeds = [-float(np.interp(scene.release_s, scene.time_s, scene.block_m_per_s)) for scene in scenes]
    assert stage.shots == 12
    assert all(0.265 * 0.85 <= speed <= 0.265 * 1.15 for speed in speeds)
    assert max(speeds) - min(speeds) > 0.02 and len(set(speeds)) == 12
