"""The change that a small effect makes along a path, against the derivatives of a solution."""

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.solver import first_order, general
from analysis.collision.solver.general import ActiveEffect
from analysis.collision.solver.linearisation import linear_path
from tests.analysis.collision.paths import CASES, RIG, TIME_S, paths_in_python
from tests.analysis.collision.plain import LINES_FOLLOWED


@pytest.fixture(autouse=LINES_FOLLOWED)
def plain(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Let paths and effects be called in plain Python."""
    paths_in_python(monkeypatch)
    return monkeypatch


SMALL = {
    "coulomb_friction": (1e-6,), "quadratic_drag": (1e-6,), "bearing_gradient": (1e-5,), "plate_damping": (1e-7,),
    "nonlinear_contact_damping": (1e-3,), "block_mode": (1e-9, 120.0, 0.1), "viscoelastic_arm": (1e-6, 4e-3),
    "support_compliance": (1e-11, 150.0), "second_plate_mode": (1e6, 120.0, 0.1),
}  # fmt: skip


@pytest.mark.parametrize("place", [0, 1, 3])
@pytest.mark.parametrize("name", list(SMALL))
def test_a_small_effect_does_what_the_solver_differentiates(name: str, place: int) -> None:
    """At two starts at once, of which one is twice the other."""
    collision, active = CASES[place]
    if any(one.effect.name == name for one in active):
        return
    row, values = effect_named(name), SMALL[name]
    steps = first_order.steps_per_sample(row, values, collision, 2.5e-4)
    path = linear_path(collision, active, TIME_S, steps)
    parameters = np.zeros((2, 3))
    parameters[:, : len(values)] = values
    parameters[1, 0] *= 2.0
    found = first_order.first_order_change(path, row, collision, parameters, TIME_S.size)
    assert found is not None
    none = values[0] / 1e-3 if row.inverse else 1e-13 * values[0]  # a heavy mode does little
    beside = sorted([*active, ActiveEffect(row, (none, *values[1:]))], key=lambda one: one.effect.hidden == 0)
    slot = [one.effect.name for one in beside].index(name)
    run = general.solve(collision, beside, TIME_S, directions=[general.direction(slot, 0)])
    exact = run.displacement_derivatives[:, 0] * (-(none**2) / values[0] if row.inverse else values[0])
    scale = np.abs(exact).max()
    assert np.abs(found[:, 0] - exact).max() < 2e-4 * scale
    np.testing.assert_allclose(found[:, 1], (0.5 if row.inverse else 2.0) * found[:, 0], atol=1e-7 * scale)


def test_what_cannot_be_followed_to_first_order_has_no_answer() -> None:
    path = linear_path(RIG, [], TIME_S)
    assert first_order.first_order_change(path, effect_named("adhesion"), RIG, np.ones((1, 3)), TIME_S.size) is None
    assert first_order.first_order_change(path, effect_named("sensor_drift"), RIG, np.ones((1, 3)), TIME_S.size) is None


@pytest.mark.parametrize(("turns", "steps"), [(0.49, 1), (0.51, 2), (0.99, 2), (1.01, 4), (4.1, 16)])
def test_a_sample_is_divided_into_a_power_of_two_steps_of_half_a_radian(turns: float, steps: int) -> None:
    row = effect_named("block_mode")
    rate = row.fastest(np.array([1e-5, 100.0, 0.01]), RIG)
    assert first_order.steps_per_sample(row, (1e-5, 100.0, 0.01), RIG, turns / rate) == steps
