"""An effect that is one function and one row is simulated, fitted, scored and named like any other.

One is that of docs/add-an-effect.md, the others are written here.
"""

from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE
from analysis.collision.effects.kernel import MASS, ON_BLOCK, Q_RATE, W_RATE, V, W
from analysis.collision.effects.row import Acts, Effect, Parameter, SensorInput
from analysis.collision.parameters import PAPER
from analysis.diagnosis.diagnosis_of_shots import diagnose
from analysis.diagnosis.findings import words
from analysis.diagnosis.findings.result import Verdict
from analysis.inference.fit.problem import Problem
from analysis.inference.fit.shot_fit import fit_shots
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import base_named
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.free_parameters import trial_effects
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.floor import Floor
from tests.analysis.collision.simulated import shot
from tests.pages import effect_of_the_page

SPEEDS = (-0.15, -0.27, -0.40)


def sloshing(s: Any, p: Any, out: Any) -> None:
    """Drag a part m of the block's mass along: m w' = m (v - w) / tau; p = (m in kg, tau in s).  Made up."""
    pull = (s[W] - s[V]) / p[1]
    out[MASS] -= p[0]
    out[ON_BLOCK] += p[0] * pull
    out[Q_RATE] += s[W]
    out[W_RATE] -= pull


def cubic_drift(seen: SensorInput, x: Any, p: Any) -> Any:
    """Measure x + b t^3; p = (b in m/s^3).  Made up."""
    return x + p[0] * seen.time_s[:, None] ** 3


SLOSHING = Effect(
    "sloshing",
    "a block with a liquid inside",
    Acts.ON_BLOCK,
    (Parameter("mass_kg", "kg", 1e-5, lower=0.0), Parameter("time_s", "s", 3e-3, 1e-4, 1e-1, (1e-3, 3e-3, 1e-2))),
    "mass_kg",
    sloshing,
    hidden=2,
    moves_with_block=True,
    fastest=lambda values, _: 1 / float(values[1]),
)
CUBIC_DRIFT = Effect(
    "cubic_drift",
    "a clock that drifts",
    Acts.ON_SENSOR,
    (Parameter("curve_m_per_s3", "m/s³", 1e-4),),
    "curve_m_per_s3",
    sensor=cubic_drift,
)


def test_a_force_is_simulated_fitted_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CATALOGUE, "cubic_drag", effect_of_the_page())
    motions = [shot(PAPER.at_speed(v), effects={"cubic_drag": (3e-3,)}, seed=i) for i, v in enumerate(SPEEDS[::2])]
    fitted = fit_shots(motions, effects=("cubic_drag",)).parameters["cubic_drag.coefficient_n_s3_per_m3"]
    assert abs(fitted.value - 3e-3) < 4 * fitted.std < 1e-5
    found = diagnose(motions)
    assert found.verdict is Verdict.EFFECT_FOUND
    assert found.effects[0].name == "cubic_drag"
    value = found.effects[0].parameters["coefficient_n_s3_per_m3"]
    assert abs(value.value - 3e-3) < 4 * value.std < 1e-5
    assert "N s³/m³" in words.found(found.effects[0])


@pytest.mark.parametrize(("row", "values"), [(SLOSHING, (1e-5, 3e-3)), (CUBIC_DRIFT, (1e-4,))])
def test_what_remembers_and_what_only_the_sensor_shows_score_best(
    row: Effect, values: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(CATALOGUE, row.name, row)
    motions = [shot(PAPER.at_speed(v), effects={row.name: values}, seed=i) for i, v in enumerate(SPEEDS)]
    data = JointData(averaged_shots(motions), base_named("paper"))
    bare = Problem(data, (), Floor(1e-10, (0.0, 0.0), (1e-2, 1e-2), data.shots[0].spacing_s))
    own = np.array([[v, 0.0123456, 3.1e-3] for v in SPEEDS])
    start = bare.pack(Point(PAPER.vector[:4], own, tuple({} for _ in motions)))
    at = bare.fit(start).linearise()
    like = ("viscous_drag", "quadratic_drag", "tilt", "sensor_drift", row.name)
    gains = {kind.effect.name: at.scores(kind)[0].gain for kind in trial_effects() if kind.effect.name in like}
    assert max(gains, key=lambda name: gains[name]) == row.name
    assert gains[row.name] > 100
