"""The quick integrator against the exact solver, and against the catalogue's own functions."""

import numpy as np
import pytest

from analysis.diagnosis.quick_shot import Optics, respond
from analysis.model.exact import solve as solve_exact
from analysis.model.least_squares import Infeasible
from analysis.model.parameters import PAPER

TIME_S = np.arange(6000) * 1e-5
OWN = np.array([-0.265, 0.0101234, 3e-6])
BASE = np.array([221.4, 1.984e-4, 1e4, 0.4])
OPTICS = Optics(632.8e-9, 1e5)


def test_the_base_model_is_that_of_the_exact_solver() -> None:
    quick = respond(TIME_S, BASE, OWN, {}, PAPER.block_mass_kg, OPTICS)
    exact = solve_exact(PAPER, TIME_S - OWN[1])
    np.testing.assert_allclose(quick.displacement_m, exact.displacement_m + OWN[2], atol=2e-11)
    times = [event.time_s + OWN[1] for event in exact.events if event.kind in ("touch", "release")]
    np.testing.assert_allclose(quick.changes_s, times, atol=1e-9)


MECHANICAL = {
    "coulomb_friction": (1e-4,),
    "viscous_drag": (1e-3,),
    "quadratic_drag": (3e-3,),
    "tilt": (5e-4,),
    "bearing_gradient": (0.05,),
    "block_mode": (3e-4, 870.0, 0.01),
    "cubic_stiffness": (3e5,),
    "plate_damping": (1e-3,),
    "viscoelastic_arm": (2.0, 2e-3),
    "second_plate_mode": (2e-2, 2500.0, 0.02),
    "support_compliance": (1e-5, 900.0),
    "contact_exponent": (0.2,),
    "nonlinear_contact_damping": (5e3,),
}


@pytest.mark.parametrize("name", MECHANICAL)
def test_an_effect_is_that_of_the_catalogue(name: str) -> None:
    general = pytest.importorskip("analysis.model.general")
    from analysis.model.effects import CATALOGUE

    effect = CATALOGUE[name]
    values = MECHANICAL[name]
    run = general.solve(PAPER, [general.Active(effect, values)], TIME_S - OWN[1])
    named = {p.name: v for p, v in zip(effect.parameters, values, strict=True)}
    quick = respond(TIME_S, BASE, OWN, {name: named}, PAPER.block_mass_kg, OPTICS)
    np.testing.assert_allclose(quick.displacement_m - OWN[2], run.displacement_m, atol=3e-11)


def test_impossible_parameters_are_refused() -> None:
    with pytest.raises(Infeasible):
        respond(TIME_S, BASE * [1, -1, 1, 1], OWN, {}, PAPER.block_mass_kg, OPTICS)
    heavy = {"block_mode": {"mass_kg": 1.0, "frequency_hz": 100.0, "damping_ratio": 0.01}}
    with pytest.raises(Infeasible):
        respond(TIME_S, BASE, OWN, heavy, PAPER.block_mass_kg, OPTICS)
