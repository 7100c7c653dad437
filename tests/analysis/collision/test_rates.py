"""The equations of motion with made-up effects of every kind, against Newton's law written out; true derivatives."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects.kernel import (
    BLOCK_MASS,
    CONTACT_STIFFNESS,
    FORCE,
    MASS,
    NEAR,
    ON_BLOCK,
    ON_PLATE,
    OUTPUTS,
    PAIR,
    PLATE_STIFFNESS,
    Q_RATE,
    SIGN_V,
    STATES,
    TOUCHING,
    W_RATE,
    XI,
    XI_RATE,
    Q,
    U,
    V,
    W,
    X,
    Y,
)
from analysis.collision.solver import modes, rates, system
from analysis.collision.solver.modes import CONTACT, FREE, INNER_MASS, NEAR_0, OVERLAPPED, PARTING, PLATE, SIGN
from analysis.collision.solver.system import (
    FIRST,
    HIDDEN,
    IS_PAIR,
    MOVES,
    ON_PLATE_SIDE,
    RANGE_AT,
    RATE_AT,
    RIDES,
    SLOT_COLUMNS,
    State,
    System,
)
from tests.analysis.collision.plain import made_plain

K_P, M_P, K_N, GAMMA, MASS_B = 7.0, 0.6, 11.0, 2.5, 3.0
OWN = (0.8, -0.4, 1.3, 0.7, -0.6, 0.9, 0.5, 0.3)  # two parameters of each effect
P = np.array([K_P, M_P, K_N, GAMMA, -1.0, 0.0, 0.0, MASS_B, *OWN])


def pressing(s: Any, p: Any, out: Any) -> None:
    """Between the bodies; what it is told of the contact force is nothing, as that is not known yet."""
    out[PAIR] += p[0] * s[XI] ** 2 + p[1] * s[XI_RATE] * s[NEAR] + s[FORCE]


def riding(s: Any, p: Any, out: Any) -> None:
    """Inside the block, with inertia and two hidden states."""
    out[MASS] += p[0] * s[X] ** 2
    out[ON_BLOCK] += p[1] * s[Q] * s[V] + s[SIGN_V] * s[BLOCK_MASS]
    out[Q_RATE] += s[W] - s[X] * p[0]
    out[W_RATE] += s[FORCE] * p[1] - s[Q] ** 2


def clamping(s: Any, p: Any, out: Any) -> None:
    """On the plate's side, with hidden states that move the contact point."""
    out[ON_PLATE] += p[0] * s[Q] * s[U] + s[PLATE_STIFFNESS] * s[Y] * s[W]
    out[Q_RATE] += s[W] * p[1]
    out[W_RATE] += s[FORCE] * s[CONTACT_STIFFNESS] - s[Q] * s[W]


def dragging(s: Any, p: Any, out: Any) -> None:
    """On the block, from outside; it has no hidden state, and in ``s`` those of a place that is not its own."""
    out[ON_BLOCK] += p[0] * s[V] ** 3 + p[1] * s[TOUCHING] * s[FORCE] ** 2


FUNCTIONS = (riding, clamping, pressing, dragging)


def laid_out(which: list[int]) -> System:
    slots = np.zeros((4, SLOT_COLUMNS))
    slots[:, [RANGE_AT, RATE_AT]] = -1.0
    slots[:, FIRST] = 8, 10, 12, 14
    slots[0, [HIDDEN, RIDES]] = 2.0, 1.0
    slots[1, [HIDDEN, MOVES, ON_PLATE_SIDE]] = 2.0, -0.3, 1.0
    slots[2, IS_PAIR] = 1.0
    inputs = np.full(STATES + OUTPUTS, 99.0)
    functions: Any = np.array([FUNCTIONS, FUNCTIONS])
    return System(P.copy(), slots, functions, np.array(which), 0, 8, inputs, P.astype(complex), inputs.astype(complex))


def mode_of(phase: int, *, plate: float = 1.0, inside: float = 1.0, near: float = 1.0) -> np.ndarray:
    mode = np.zeros(NEAR_0 + 4)
    mode[[PLATE, INNER_MASS, SIGN]] = plate, inside, -1.0
    mode[NEAR_0 + 2] = near
    modes.set_phase(phase, mode)
    return mode


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    made_plain(monkeypatch, rates, modes, system)

    def called(function: Callable[..., None], s: Any, p: Any, first: int) -> None:
        function(s, p[first : first + 2], s[STATES:])

    monkeypatch.setattr(rates, "call_within", called)


def newton(z: np.ndarray, p: np.ndarray, phase: int, plate: bool, inside: bool, near: bool) -> tuple[Any, Any, float]:
    """Return the rates of the state, (overlap, its rate, the force of the law) and the block's inertia."""
    x, v, y, u, q, w, c, e = z
    k_p, m_p, k_n, gamma, mass = *p[:4], p[7]
    a0, a1, b0, b1, c0, c1, d0, d1 = p[8:]
    xi, rate = y - 0.3 * c - x, u - 0.3 * e - v
    law = {FREE: 0.0, CONTACT: k_n * xi + gamma * rate, PARTING: k_n * xi, OVERLAPPED: k_n * xi + gamma * rate}[phase]
    touching = phase != FREE
    if plate or near:
        law += c0 * xi**2 + c1 * rate * near
    force = 0.0 if phase == OVERLAPPED else law
    on_block, on_plate, inertia = force, -force - k_p * y, mass
    hidden = [0.0] * 4
    if inside:
        inertia += a0 * x**2
        on_block += a1 * q * v - mass
        hidden[:2] = w - x * a0, force * a1 - q**2
    if plate:
        on_plate += b0 * c * u + k_p * y * e
        hidden[2:] = e * b1, force * k_n - c * e
    on_block += d0 * v**3 + d1 * touching * force**2
    of_plate = [u, on_plate / m_p] if plate else [0.0, 0.0]
    return np.array([v, on_block / inertia, *of_plate, *hidden]), np.array([xi, rate, law]), inertia


CASES = [
    (phase, plate, inside, near)
    for phase in (FREE, CONTACT, PARTING, OVERLAPPED)
    for plate, inside, near in ((1, 1, 1), (0, 1, 1), (1, 0, 0), (0, 0, 0))
]


@pytest.mark.parametrize(("phase", "plate", "inside", "near"), CASES)
def test_effects_of_every_kind_act_where_they_take_part(phase: int, plate: int, inside: int, near: int) -> None:
    z = np.random.default_rng(phase).standard_normal(8)
    made, state = laid_out([]), State(np.zeros((1, 8)), np.full((1, 8), np.nan), np.full((1, 3), np.nan))
    state.z[0] = z
    mass = rates.rates(state, 1, made.which, made, mode_of(phase, plate=plate, inside=inside, near=near))
    f, contact, inertia = newton(z, P, phase, bool(plate), bool(inside), bool(near))
    np.testing.assert_allclose(state.f[0], f, rtol=1e-12)
    np.testing.assert_allclose(state.contact[0], contact, rtol=1e-12)
    assert mass == pytest.approx(inertia, rel=1e-14)


@pytest.mark.parametrize(("phase", "plate", "inside", "near"), CASES)
def test_derivatives_by_the_state_and_by_every_parameter(phase: int, plate: int, inside: int, near: int) -> None:
    """By no parameter, by those of the bodies, and by those of the effects, each beside a derivative of the state."""
    random = np.random.default_rng(10 + phase)
    which = [-1, 0, 1, 2, 3, 7, *range(8, 16)]
    rows = 1 + len(which)
    made, state = laid_out(which), State(*(np.full((rows, size), np.nan) for size in (8, 8, 3)))
    state.z[:] = random.standard_normal((rows, 8))
    rates.rates(state, rows, made.which, made, mode_of(phase, plate=plate, inside=inside, near=near))
    given = phase, bool(plate), bool(inside), bool(near)
    for row, by in enumerate(which, start=1):
        if by == 7:
            continue  # the block's mass is no direction of the solver
        parameter = np.zeros(P.size)
        if by >= 0:
            parameter[by] = 1.0
        ahead, back = (
            newton(state.z[0] + h * state.z[row], P + h * parameter, *given) for h in (1e-5, -1e-5)
        )  # fmt: skip
        for found, one, other in ((state.f[row], ahead[0], back[0]), (state.contact[row], ahead[1], back[1])):
            np.testing.assert_allclose(found, (one - other) / 2e-5, rtol=1e-6, atol=1e-7, err_msg=f"{by}")
    assert made.p_complex.tolist() == P.tolist()  # put back
