"""A path and the changes along it as plain Python, on a few collisions with and without effects."""

from typing import Any

import numpy as np
import pytest

from analysis.collision import (
    acting,
    crossings,
    exponentials,
    first_order,
    linear_coefficients,
    linearisation,
    march,
    matrices,
    modes,
    on_moving_frame,
    path_matrices,
    propagator,
    rates,
    runge_kutta,
    system,
    two_bodies,
)
from analysis.collision.effects import named
from analysis.collision.effects.kernel import STATES
from analysis.collision.general import Active
from analysis.collision.parameters import Collision, Variant
from tests.analysis.collision.plain import made_plain

RIG = Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 0.3)
TIME_S = np.arange(-6, 120) * 2.5e-4 + 1.1e-4
CASES: list[tuple[Collision, list[Active]]] = [
    (RIG, []),
    (Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 0.3, variant=Variant.CLAMPED), []),
    (Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 2.5, variant=Variant.NO_TENSION), []),
    (RIG, [Active(named("support_compliance"), (2e-4, 150.0)), Active(named("coulomb_friction"), (0.02,))]),
    (RIG, [Active(named("quadratic_drag"), (0.05,))]),
]


def paths_in_python(patch: pytest.MonkeyPatch) -> None:
    """Let path and effects be called in plain Python."""
    made_plain(
        patch, crossings, exponentials, first_order, linear_coefficients, linearisation, march, matrices, modes,
        on_moving_frame, path_matrices, propagator, rates, runge_kutta, system, two_bodies,
    )  # fmt: skip
    functions: list[Any] = []

    def numbered(function: Any) -> int:
        functions.append(function)
        return len(functions) - 1

    def within(number: int, s: Any, p: Any, first: int) -> None:
        functions[int(number)](s, p[first:], s[STATES:])

    patch.setattr(acting, "address", numbered)
    patch.setattr(acting, "complex_address", numbered)
    patch.setattr(first_order, "address", numbered)
    patch.setattr(rates, "call_within", within)
    patch.setattr(linear_coefficients, "call", lambda number, s, p, out: functions[int(number)](s, p, out))


def noting(cut: Any, taken: list[int]) -> Any:
    """Return ``cut`` that notes the position after each array."""

    def noted(room: Any, at: int, shape: Any) -> Any:
        array, end = cut(room, at, shape)
        taken.append(end)
        return array, end

    return noted
