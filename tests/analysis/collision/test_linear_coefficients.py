"""The coefficients of an effect that is linear in the state or in its hidden state; others are refused."""

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.effects.kernel import (
    BLOCK_MASS,
    FORCE,
    MASS,
    ON_BLOCK,
    ON_PLATE,
    OUTPUTS,
    PLATE_STIFFNESS,
    Q_RATE,
    SIGN_V,
    STATES,
    W_RATE,
    Q,
    U,
    V,
    W,
    X,
    address,
)
from analysis.collision.solver.linear_coefficients import SEEN, coefficients

POINTS = np.random.default_rng(1).standard_normal((5, STATES))
POINTS[:, SIGN_V], POINTS[:, BLOCK_MASS], POINTS[:, PLATE_STIFFNESS] = -1.0, 0.02, 200.0


def in_state(name: str, *starts: tuple[float, ...], points: np.ndarray = POINTS) -> np.ndarray | None:
    kernel, out = effect_named(name).kernel, np.zeros((OUTPUTS, SEEN + 1, len(starts)))
    assert kernel is not None
    parameters = np.array([[*values, 0.0, 0.0][:3] for values in starts])
    linear = coefficients(address(kernel), points.copy(), parameters, out, np.zeros(STATES + OUTPUTS))
    return out if linear else None


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("viscous_drag", (3.0,), {(ON_BLOCK, V): -3.0}),
        ("bearing_gradient", (3.0,), {(ON_BLOCK, X): -3.0}),
        ("plate_damping", (3.0,), {(ON_PLATE, U): -3.0}),
        ("tilt", (0.1,), {(ON_BLOCK, SEEN): 0.02 * 9.80665 * np.sin(0.1)}),
        ("coulomb_friction", (3.0,), {(ON_BLOCK, SEEN): 3.0}),
        ("second_plate_mode", (0.5, 9.0, 0.1), {(W_RATE, FORCE): -2.0}),
        (
            "block_mode", (0.5, 1.0, 0.25),
            {
                (ON_BLOCK, X): -2.0 * np.pi**2, (ON_BLOCK, V): -0.5 * np.pi, (W_RATE, X): 4 * np.pi**2,
                (W_RATE, V): np.pi, (MASS, SEEN): -0.5,
            },
        ),
    ],
)  # fmt: skip
def test_what_is_linear_in_the_state_has_its_coefficients_and_its_value_at_rest(
    name: str, values: tuple[float, ...], expected: dict[tuple[int, int], float]
) -> None:
    twice = (2 * values[0], *values[1:])
    found = in_state(name, values, twice)
    assert found is not None
    matrix = np.zeros((OUTPUTS, SEEN + 1))
    for place, value in expected.items():
        matrix[place] = value
    np.testing.assert_allclose(*(np.delete(one, [Q, W], axis=1) for one in (found[:, :, 0], matrix)), atol=1e-12)
    assert not np.allclose(found[:, :, 1], matrix, rtol=1e-3)


def test_what_is_not_linear_in_the_state_is_refused() -> None:
    assert in_state("quadratic_drag", (3.0,)) is None and in_state("cubic_stiffness", (3.0,)) is None
    turned = POINTS.copy()
    turned[3, SIGN_V] = 1.0
    assert in_state("coulomb_friction", (3.0,), points=turned) is None
    assert in_state("viscous_drag", (3.0,), points=turned) is not None


def test_a_hidden_state_is_linear_or_refused() -> None:
    def hidden(name: str, *values: float) -> np.ndarray | None:
        found = in_state(name, values)
        return None if found is None else found[:, [Q, W], 0]

    arm = np.zeros((OUTPUTS, 2))
    arm[ON_PLATE, 0], arm[Q_RATE, 0] = -1.0, -4.0
    np.testing.assert_allclose(hidden("viscoelastic_arm", 3.0, 0.25), arm, atol=1e-9)
    mode = np.zeros((OUTPUTS, 2))
    mode[Q_RATE, 1], mode[W_RATE] = 1.0, [-4 * np.pi**2, -np.pi]
    np.testing.assert_allclose(hidden("second_plate_mode", 0.5, 1.0, 0.25), mode, atol=1e-9)
    clamp = np.zeros((OUTPUTS, 2))
    clamp[ON_PLATE, 0], clamp[Q_RATE, 1], clamp[W_RATE, 0] = 200.0, 1.0, -4 * np.pi**2 * (0.01 * 200.0 + 1)
    np.testing.assert_allclose(hidden("support_compliance", 0.01, 1.0), clamp, atol=1e-9)
