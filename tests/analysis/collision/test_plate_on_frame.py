"""A frame that shakes optics and plate: the simulated rig's motion in the clamp's coordinates, and true derivatives."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE, WIDER_EFFECTS, effect_named, on_sensor, sensor_effects
from analysis.collision.effects.kernel import Q_RATE, W_RATE, Q, W
from analysis.collision.effects.on_sensor import plate_on_frame, plate_response_to_frame
from analysis.collision.parameters import Variant
from analysis.inference.model.base import TwoBodies
from analysis.inference.model.response import ShotModel, respond
from instrument.bench import frame
from instrument.bench.mechanics import Trajectory
from tests.analysis.inference.shown import samples_at
from tests.bench.blind import Truth, clean_m, drawn, run

NAME = "frame_vibration_with_plate"
LINE = {"amplitude_m_per_s": 5e-5, "frequency_hz": 90.0, "phase_rad": 0.4, "plate_factor": 0.8}
REACH = {"adhesion": {"force_n": 2e-3, "range_m": 1e-4}}


def rig(effects: dict[str, dict[str, float]]) -> Truth:
    return replace(drawn((), 3), effects=effects)


def model_of(truth: Truth, trajectory: Trajectory, size: int) -> ShotModel:
    """Return the model of a shot that the bench let happen, at so many samples."""
    b, line = truth.bodies, truth.effects[NAME]
    touch = trajectory.events[0][1]
    omega = 2 * math.pi * line["frequency_hz"]
    foot = -line["plate_factor"] * line["amplitude_m_per_s"] * math.sin(omega * touch + line["phase_rad"])
    shared = [b.plate_stiffness_n_per_m, b.plate_mass_kg, b.contact_stiffness_n_per_m, b.contact_damping_n_s_per_m]
    own = np.array([trajectory.velocity_in_m_per_s + foot, touch, 0.0])
    samples = samples_at(np.arange(size) * 1e-5, 1, b.block_mass_kg)
    values = {effect_named(name): given for name, given in truth.effects.items()}
    return ShotModel(samples, TwoBodies(Variant.PAPER), np.array(shared), own, values)


def moved(shot: ShotModel, name: str, by: float) -> ShotModel:
    """Return the model with one of its parameters changed."""
    base, line = shot.base.names, ("velocity_in_m_per_s", "touch_time_s", "offset_m")
    if name in base:
        return replace(shot, shared=shot.shared + by * np.array([other == name for other in base]))
    if name in line:
        return replace(shot, own=shot.own + by * np.array([other == name for other in line]))
    effect, parameter = effect_named(name.split(".")[0]), name.split(".")[1]
    given = shot.values[effect]
    return replace(shot, values={**shot.values, effect: {**given, parameter: given[parameter] + by}})


def value_of(shot: ShotModel, name: str) -> float:
    """Return the value of one of the model's parameters."""
    values = {f"{effect.key}.{p}": v for effect, given in shot.values.items() for p, v in given.items()}
    values |= dict(zip(shot.base.names, shot.shared, strict=True))
    return float(({"velocity_in_m_per_s": shot.own[0]} | values)[name])


@pytest.mark.parametrize("hz", [47.0, 90.0, 165.0, 700.0])
@pytest.mark.parametrize("factor", [0.0, 0.3, 1.0])
def test_the_motion_is_the_benchs(hz: float, factor: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame, "PLATE_QUALITY", 1e9)  # what a plate loses is for plates that lose
    monkeypatch.setattr(on_sensor, "_PLATE_QUALITY", 1e9)
    truth = rig({NAME: {**LINE, "frequency_hz": hz, "plate_factor": factor}})
    x = clean_m(truth, 0)
    shot = model_of(truth, run(truth, 0), x.size)
    response = respond(shot, shot.samples.time_s)
    off = x - response.displacement_m
    assert np.ptp(off) < 4e-12  # of a swing of 100 nm and a motion of millimetres


@pytest.mark.parametrize("beside", [{}, REACH])
def test_derivatives_are_those_of_the_solution(beside: dict[str, dict[str, float]]) -> None:
    truth = rig({NAME: LINE, **beside})
    shot = model_of(truth, run(truth, 0), clean_m(truth, 0).size)
    response = respond(shot, shot.samples.time_s, derivatives=True)
    out = response.velocity_out
    for place, name in enumerate(shot.names):
        h = {"touch_time_s": 2e-8, "offset_m": 1e-6}.get(name) or 2e-5 * abs(value_of(shot, name))
        h *= 200.0 if name.startswith(NAME) else 1.0
        shifted, left = [], []
        for times in (-2, -1, 1, 2):
            there = respond(moved(shot, name, times * h), shot.samples.time_s)
            shifted.append(there.displacement_m)
            left.append(there.velocity_out[0])
        difference = (shifted[0] - 8 * shifted[1] + 8 * shifted[2] - shifted[3]) / (12 * h)
        column = response.derivatives[:, place]
        # Events cross the sampling instants between the four solutions; their kinks are what is left.
        assert np.abs(difference - column).max() < 1e-3 * np.abs(column).max() + 4e-15 / h, name
        slope = (left[0] - 8 * left[1] + 8 * left[2] - left[3]) / (12 * h)
        assert slope == pytest.approx(out[1][place], rel=1e-3, abs=1e-9 * np.abs(out[1]).max() + 1e-13 / h), name


def test_the_contact_point_swings_as_a_foot_moves_it() -> None:
    values = (5e-5, 90.0, 0.4, 0.8)
    at_rest, rate, omega = plate_response_to_frame(values, 221.4, 1.984e-4, 0.01)
    ahead = [plate_response_to_frame(values, 221.4, 1.984e-4, 0.01 + h)[0] for h in (-1e-6, 1e-6)]
    assert rate == pytest.approx((ahead[1] - ahead[0]) / 2e-6, rel=1e-6)
    own = 221.4 / 1.984e-4
    foot = 0.8 * 5e-5 / omega * math.cos(omega * 0.01 + 0.4)
    assert at_rest == pytest.approx(foot * own / (own - omega**2), rel=1e-3)
    s, out = np.zeros(15), np.zeros(6)
    s[Q], s[W] = 1e-8, 2e-5
    plate_on_frame(s, (at_rest, rate, omega), out)
    assert out[Q_RATE] == 2e-5 and out[W_RATE] == pytest.approx(-(omega**2) * (1e-8 + at_rest))


def test_it_stands_where_the_narrow_one_does() -> None:
    order = [row.name for row in sensor_effects([*CATALOGUE.values(), *WIDER_EFFECTS.values()])]
    assert order.index(NAME) == order.index("frame_vibration") + 1
    for row in WIDER_EFFECTS.values():
        narrow = CATALOGUE[row.widens]
        assert row.parameters[: len(narrow.parameters)] == narrow.parameters and row.amplitude == narrow.amplitude
