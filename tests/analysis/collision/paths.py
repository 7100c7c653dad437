"""A path and the changes along it as plain Python, on a few collisions with and without effects."""

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.parameters import Collision, Variant
from analysis.collision.solver import first_order, linear_coefficients, linearisation, on_moving_frame, path_matrices
from analysis.collision.solver.general import ActiveEffect
from tests.analysis.collision.plain import solver_in_python

RIG = Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 0.3)
TIME_S = np.arange(-6, 120) * 2.5e-4 + 1.1e-4
CASES: list[tuple[Collision, list[ActiveEffect]]] = [
    (RIG, []),
    (Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 0.3, variant=Variant.CLAMPED), []),
    (Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 2.5, variant=Variant.NO_TENSION), []),
    (
        RIG,
        [
            ActiveEffect(effect_named("support_compliance"), (2e-4, 150.0)),
            ActiveEffect(effect_named("coulomb_friction"), (0.02,)),
        ],
    ),
    (RIG, [ActiveEffect(effect_named("quadratic_drag"), (0.05,))]),
]


def paths_in_python(patch: pytest.MonkeyPatch) -> None:
    """Let path and effects be called in plain Python."""
    numbered = solver_in_python(patch, first_order, linear_coefficients, linearisation, on_moving_frame, path_matrices)
    patch.setattr(first_order, "address", numbered)
