"""What the diagnosis takes small effects to do, to first order, against the difference of two solved trajectories."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE, effect_named
from analysis.collision.effects.kernel import ON_BLOCK, Q_RATE, W_RATE, Q, V, W
from analysis.collision.effects.row import Acts, Effect, Parameter
from analysis.collision.parameters import PAPER
from analysis.collision.solver.first_order import first_order_change, steps_per_sample
from analysis.inference.fit.problem import Problem
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import base_named
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.free_parameters import trial_effect
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.floor import Floor
from analysis.inference.screen import screening
from analysis.inference.screen.columns import change_to_first_order
from tests.analysis.collision.simulated import shot as simulated
from tests.analysis.diagnosis.test_made_up import SLOSHING
from tests.analysis.inference.shown import model_of, shown

TIME_S = np.arange(1200) * 5e-5
SMALL = 0.02
AXES = ("frequency_hz", "damping_ratio")
HAVE: dict[str, Mapping[str, Mapping[str, float]]] = {
    "base": {},
    "hertz": {"contact_exponent": {"delta": 0.2}},
    "arm": {"viscoelastic_arm": {"stiffness_n_per_m": 2.0, "relaxation_time_s": 2e-3}},
    "mode": {"second_plate_mode": {"mass_kg": 5e-3, "frequency_hz": 2500.0, "damping_ratio": 0.02}},
    "sticky": {"adhesion": {"force_n": 1e-4, "range_m": 1e-5}},
    "friction": {"coulomb_friction": {"force_n": 2e-5}},
    "lag": {"demodulation_lag": {"time_s": 2e-5}},
}
MECHANICAL = [name for name, row in CATALOGUE.items() if row.kernel is not None and row.range_at < 0]
LINEAR = ("block_mode", "second_plate_mode", "support_compliance", "viscoelastic_arm", "sloshing")


def small(row: Effect, start: Mapping[str, float], size: float) -> dict[str, float]:
    """Return a start at ``size`` of its amplitude (an inverse one is small where it is large)."""
    value = start[row.amplitude]
    return {**start, row.amplitude: (value / size if size else 1e9) if row.inverse else value * size}


def difference(row: Effect, start: Mapping[str, float], have: Any, own: np.ndarray, model: str) -> np.ndarray:
    """Return what an effect does, by two solutions; both hold it, so that their steps are the same."""
    runs = [
        shown(TIME_S, PAPER.vector[:4], own, {**have, row.name: small(row, start, size)}, model).displacement_m
        for size in (SMALL, 0.0)
    ]
    return np.asarray(runs[0] - runs[1])


def check(row: Effect, have: Any, speed: float, points: int, model: str = "paper") -> None:
    own = np.array([speed, 0.0101234, 3e-6])
    shot = model_of(TIME_S, PAPER.vector[:4], own, have, model)
    starts = trial_effect(row).starts
    for k in np.unique(np.linspace(0, len(starts) - 1, points).astype(int)):
        start = starts[k]
        values = [start[parameter.name] for parameter in row.parameters]
        path = shot.path(steps_per_sample(row, values, shot.collision, shot.samples.spacing_s))
        found = change_to_first_order(shot, path, row, [small(row, start, SMALL)])
        if found is None and row.name not in LINEAR:
            pytest.skip(f"{row.name} is not linear in its hidden state: its trajectories are solved one by one")
        assert found is not None
        wanted = difference(row, start, have, own, model)
        assert np.linalg.norm(found[:, 0] - wanted) < 0.02 * np.linalg.norm(wanted), start


@pytest.mark.parametrize("speed", [-0.15, -0.27, -0.40])
@pytest.mark.parametrize("name", MECHANICAL)
def test_an_effect_on_the_base_model_does_what_two_trajectories_differ_by(name: str, speed: float) -> None:
    check(CATALOGUE[name], {}, speed, 9)


@pytest.mark.parametrize("model", ["clamped", "no_tension"])
def test_so_it_does_with_another_contact_law(model: str) -> None:
    """The path is that of the model's own contact: along the paper's, a second mode was half of itself off."""
    check(CATALOGUE["second_plate_mode"], {}, -0.27, 5, model)


@pytest.mark.parametrize("have", [have for have in HAVE if have != "base"])
@pytest.mark.parametrize("name", [name for name in MECHANICAL if CATALOGUE[name].hidden])
def test_so_does_one_beside_an_effect_that_the_fit_has(name: str, have: str) -> None:
    if name not in HAVE[have]:
        for speed in (-0.15, -0.27, -0.40):
            check(CATALOGUE[name], HAVE[have], speed, 3)


def test_a_made_up_effect_is_known_by_its_function_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CATALOGUE, "sloshing", SLOSHING)
    check(SLOSHING, {}, -0.27, 3)


@pytest.mark.parametrize("have", ["base", "lag"])
def test_many_starts_at_once_are_each_as_if_alone(have: str) -> None:
    shot = model_of(TIME_S, PAPER.vector[:4], np.array([-0.27, 0.01, 0.0]), HAVE[have])
    row = CATALOGUE["block_mode"]
    starts = trial_effect(row).starts[20:120:9]
    path = shot.path(2)
    averaged_shots = change_to_first_order(shot, path, row, starts)
    assert averaged_shots is not None
    for k, start in enumerate(starts):
        alone = change_to_first_order(shot, path, row, [start])
        assert alone is not None
        np.testing.assert_allclose(averaged_shots[:, k], alone[:, 0], rtol=1e-9, atol=1e-20)


def hardening(s: Any, p: Any, out: Any) -> None:
    """Carry a part on a spring that is not linear.  Made up."""
    out[ON_BLOCK] += p[0] * s[Q] * s[Q] * s[Q]
    out[Q_RATE] += s[W]
    out[W_RATE] += s[V] - s[Q] * s[Q] * s[Q]


def test_what_is_not_linear_in_its_hidden_state_has_no_first_order() -> None:
    row = Effect(
        "hardening", "", Acts.ON_BLOCK, (Parameter("force_n", "N", 1.0),), "force_n", hardening, hidden=2
    )  # fmt: skip
    shot = model_of(TIME_S, PAPER.vector[:4], np.array([-0.27, 0.01, 0.0]), {})
    assert first_order_change(shot.path(1), row, PAPER, np.ones((1, 3)), TIME_S.size) is None


def test_the_scores_are_those_of_trajectories_solved_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    speeds = (-0.15, -0.40)
    effects = {"block_mode": (2e-6, 870.0, 0.02)}
    motions = [simulated(PAPER.at_speed(v), effects=effects, seed=i) for i, v in enumerate(speeds)]
    data = JointData(averaged_shots(motions), base_named("paper"))
    bare = Problem(data, (), Floor(1e-10, (0.0, 0.0), (1e-2, 1e-2), data.shots[0].spacing_s))
    own = np.array([[v, 0.0123456, 3.1e-3] for v in speeds])
    start = bare.pack(Point(PAPER.vector[:4], own, tuple({} for _ in motions)))
    fitted = bare.fit(start)
    kinds = [trial_effect(CATALOGUE[name]) for name in LINEAR[:3]]
    # The first order is that of a small effect: beside the contact's own swing a mode of 0.1 kg is not.
    kinds = [
        replace(kind, starts=tuple({**s, "mass_kg": 2.0} if kind.inverse else s for s in kind.starts[::5]))
        for kind in kinds
    ]
    quick = [fitted.linearise().scores(kind) for kind in kinds]
    monkeypatch.setattr(screening, "MANY_STARTS", 10**9)
    slow = [fitted.linearise().scores(kind) for kind in kinds]
    for one, other in zip(quick, slow, strict=True):
        assert len(one) == len(other), one[0].kind.effect.name
        gains = {tuple(score.start[0][name] for name in AXES if name in score.start[0]): score.gain for score in one}
        best = other[0]
        at = tuple(best.start[0][name] for name in AXES if name in best.start[0])
        assert abs(gains[at] - best.gain) < 0.02 * best.gain, (best.kind.effect.name, at)
    assert max(quick, key=lambda listed: listed[0].gain)[0].kind.effect.name == "block_mode"


@pytest.mark.parametrize("name", ["adhesion", "sensor_drift", "plate_motion"])
def test_what_has_a_range_or_no_force_has_no_first_order(name: str) -> None:
    none: Any = None  # no path is looked at
    assert first_order_change(none, effect_named(name), PAPER, np.ones((1, 3)), 5) is None
