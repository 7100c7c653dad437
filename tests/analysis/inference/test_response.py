"""One shot of the diagnosis: what it refuses, and an attraction against the simulated bench."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision import averaged
from analysis.collision.parameters import Infeasible
from analysis.inference.model.base import PLATE_NAMES
from analysis.inference.model.response import Response, ShotModel, respond
from instrument.bench.measured_path import simulate_collision
from instrument.bench.mechanics import Bodies
from tests.analysis.inference.shown import model_of, shown

TIME_S = np.arange(6000) * 1e-5
OWN = np.array([-0.265, 0.0101234, 3e-6])
BASE = np.array([221.4, 1.984e-4, 1e4, 0.4])


def test_impossible_parameters_are_refused() -> None:
    with pytest.raises(Infeasible):
        shown(TIME_S, BASE * [1, -1, 1, 1], OWN, {})
    heavy = {"block_mode": {"mass_kg": 1.0, "frequency_hz": 100.0, "damping_ratio": 0.01}}
    with pytest.raises(Infeasible):
        shown(TIME_S, BASE, OWN, heavy)
    nothing = {"second_plate_mode": {"mass_kg": 0.0, "frequency_hz": 900.0, "damping_ratio": 0.01}}
    with pytest.raises(Infeasible):
        shown(TIME_S, BASE, OWN, nothing)


@pytest.mark.parametrize("reach_m", [1e-5, 1e-4])
def test_an_attraction_is_met_as_the_bench_meets_it(reach_m: float) -> None:
    adhesion, bodies, far_m = {"force_n": 5e-3, "range_m": reach_m}, Bodies(), 3e-3
    truth = simulate_collision(OWN[0], {"adhesion": adhesion}, bodies, far_m, TIME_S[-1] + 1e-4)
    base = np.array([getattr(bodies, name) for name in PLATE_NAMES])
    # "Velocity in" is that of the free flight, the touch the instant it would lead to.
    own = np.array([OWN[0], far_m / -OWN[0], 0.0])
    run = shown(TIME_S, base, own, {"adhesion": adhesion})
    np.testing.assert_allclose(run.displacement_m, truth.block_m(TIME_S), atol=2e-11)


def test_a_clock_that_began_long_ago_makes_no_oscillation_faster() -> None:
    late = TIME_S + 1e4
    run = shown(late, BASE, OWN + np.array([0.0, 1e4, 0.0]), {})
    np.testing.assert_allclose(run.displacement_m, shown(TIME_S, BASE, OWN, {}).displacement_m, atol=1e-11)
    longest = 1e5 / np.sqrt(1e4 * (1 / 0.01785 + 1 / 1.984e-4) + 221.4 / 1.984e-4)
    for share, followed in ((0.97, True), (1.03, False)):
        time_s = np.arange(0.0, share * longest, 3e-4)
        if followed:
            assert np.isfinite(shown(time_s, BASE, OWN, {}).displacement_m).all()
        else:
            with pytest.raises(Infeasible, match="the contact would swing faster"):
                shown(time_s, BASE, OWN, {})


LINE = {"amplitude_m_per_s": 2e-5, "frequency_hz": 120.0, "phase_rad": 0.4}
MANY: list[dict[str, dict[str, float]]] = [
    {},
    {"demodulation_lag": {"time_s": 3e-5}, "frame_vibration": LINE, "viscous_drag": {"coefficient_n_s_per_m": 1e-3}},
    {"cyclic_error": {"amplitude_m": 2e-9, "order": 1.0, "phase_rad": 0.3}, "sensor_drift": {"ramp_m_per_s2": 1e-3}},
    {"adhesion": {"force_n": 2e-3, "range_m": 5e-5}, "frame_vibration_with_plate": LINE | {"plate_factor": 0.7}},
    {
        "plate_motion": {"velocity_m_per_s": 1e-3, "displacement_m": 2e-6},
        "block_mode": {"mass_kg": 3e-4, "frequency_hz": 300.0, "damping_ratio": 0.05},
    },
]  # fmt: skip
SMALL = {"phase_rad": 1.0, "offset_m": 1e-6, "touch_time_s": 1e-3, "angle_rad": 1.0}


def moved(shot: ShotModel, place: int, by: float) -> ShotModel:
    """Return the model with one of its named parameters changed."""
    name, shared = shot.names[place], shot.base.names
    if name in shared:
        return replace(shot, shared=shot.shared + by * np.eye(len(shared))[place])
    own = ("velocity_in_m_per_s", "touch_time_s", "offset_m")
    if name in own:
        return replace(shot, own=shot.own + by * np.eye(3)[own.index(name)])
    values = {
        effect: {n: v + by * (f"{effect.key}.{n}" == name) for n, v in given.items()}
        for effect, given in shot.values.items()
    }
    return replace(shot, values=values)


@pytest.mark.parametrize("have", MANY)
@pytest.mark.parametrize("block", [1, 5])
def test_the_slopes_of_what_the_optics_show_are_those_of_all_parameters(
    block: int, have: Mapping[str, Mapping[str, float]]
) -> None:
    """Also of the velocity after the last release, and what is averaged is the mean of what is not."""
    time_s = np.arange(1500) * 4e-5
    shot = model_of(time_s, BASE, OWN, have)

    def run(one: ShotModel, **how: Any) -> Response:
        return respond(one, time_s, stride=1.0, block=block, **how)

    exact = run(shot, derivatives=True)
    assert "order" not in "".join(shot.names) and exact.derivatives.shape == (1500 // block, len(shot.names))
    np.testing.assert_allclose(exact.displacement_m, run(shot).displacement_m, atol=1e-15)
    fine = respond(shot, time_s, stride=1.0)
    for name in ("displacement_m", "velocity_m_per_s", "gap_m"):
        np.testing.assert_allclose(getattr(exact, name), averaged(getattr(fine, name), block), atol=1e-12)
    assert exact.velocity_out is not None and run(shot).velocity_out == (exact.velocity_out[0], pytest.approx(0.0))
    for place, name in enumerate(shot.names):
        value = {**dict(zip(shot.base.names, BASE, strict=True)), "velocity_in_m_per_s": OWN[0]}.get(name, 0.0)
        for effect, given in shot.values.items():
            value = {f"{effect.key}.{n}": v for n, v in given.items()}.get(name, value)
        h = 1e-4 * SMALL.get(name.rpartition(".")[2], abs(value))
        ahead, back = (run(moved(shot, place, way * h)) for way in (1, -1))
        slope = (ahead.displacement_m - back.displacement_m) / (2 * h)
        column = exact.derivatives[:, place]
        off = np.abs(slope - column)
        # samples that an event crosses between the two solutions may be off, and the band of a chirp counts as fixed
        rel = 2e-2 if "cyclic_error" in have else 2e-3
        assert np.quantile(off, 0.99) < rel * np.abs(column).max() + 1e-15 / h, name
        assert ahead.velocity_out is not None and back.velocity_out is not None
        out = (ahead.velocity_out[0] - back.velocity_out[0]) / (2 * h)
        assert exact.velocity_out[1][place] == pytest.approx(out, rel=1e-3, abs=1e-4 * abs(OWN[0] / 1e4 / h)), name
