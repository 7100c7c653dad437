"""Matrix exponentials of a mode, their derivatives, means and jumps over a step, against scipy's."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm, expm_frechet

from analysis.collision.effects.kernel import Q, W
from analysis.collision.solver import exponentials, linear_coefficients
from analysis.collision.solver.matrices import TERMS
from tests.analysis.collision.plain import made_plain


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    made_plain(monkeypatch, exponentials)


N = 5  # numbers of a state with its constant
ROWS = pytest.mark.parametrize("rows", [2, 3, 6])  # state and derivatives


def columns(rows: int) -> int:
    return 4 if rows <= 4 else 8


def form_of(seed: int, rows: int) -> Any:
    """Return a mode whose matrix depends on the first and the last parameter, with the last row nothing."""
    random = np.random.default_rng(seed)
    wide = columns(rows)
    a, by = random.standard_normal((N, N)), np.zeros((N, N, wide))
    by[:, :, 1], by[:, :, rows - 1] = random.standard_normal((2, N, N))
    a[0], a[2, 0] = [0.0, 1.0, 0.0, 0.0, 0.0], 0.0  # as of a place and its velocity
    by[0, :, 1], by[1, 2, 1], by[2, 2, 1] = 0.0, 1.0, 0.0
    a[-1] = 0.0
    by[-1] = 0.0
    return SimpleNamespace(
        a=a, by=by, e=np.full((N, N), np.nan), d=np.full((N, N, wide), np.nan), whole=np.empty((N, N)),
        d_whole=np.empty((N, N, wide)), shown=random.standard_normal((2, N)), mean=np.empty((2, N)),
        d_mean=np.empty((N, wide)), steps=np.zeros(4),
    )  # fmt: skip


def room(rows: int) -> Any:
    wide = columns(rows)
    return SimpleNamespace(
        square=np.full((3, N, N), np.nan), d_term=np.full((N, N, wide), np.nan),
        d_work=np.full((N, N, wide), np.nan), columns=np.full((3, N, wide), np.nan),
    )  # fmt: skip


def made(seed: int, h: float, rows: int) -> Any:
    form = form_of(seed, rows)
    form.terms = exponentials.exponential.py_func(form, room(rows), rows, h)
    return form


def slopes_of(form: Any, h: float) -> np.ndarray:
    """Return the derivatives of the exponential, the first for the state itself, as columns along the last axis."""
    out = np.zeros_like(form.d)
    for k in range(out.shape[2]):
        by = form.by[:, :, k]
        out[:, :, k] = expm_frechet(form.a * h, by * h)[1] if by.any() else 0.0
    return out


def state(rows: int) -> np.ndarray:
    z = np.random.default_rng(9).standard_normal((N, columns(rows)))
    z[-1] = 0.0
    z[-1, 0] = 1.0
    z[:, rows:] = 0.0
    return z


@ROWS
@pytest.mark.parametrize("h", [0.1, -0.7, 2.0])
def test_an_exponential_and_its_derivatives_are_scipys(h: float, rows: int) -> None:
    form = made(1, h, rows)
    np.testing.assert_allclose(form.e, expm(form.a * h), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(form.d, slopes_of(form, h), rtol=1e-10, atol=1e-11)
    assert not form.d[:, :, 0].any() and 6 < form.terms < 60 and made(1, 0.5 * h, rows).terms < form.terms


@ROWS
def test_a_step_carries_state_and_derivatives(rows: int) -> None:
    h, z = 0.3, state(rows)
    form = made(2, h, rows)
    exact = expm(form.a * h) @ z + np.einsum("ick,c->ik", slopes_of(form, h), z[:, 0])
    out = np.full(z.shape, 7.0)
    exponentials.step.py_func(z, form.e, form.d, out)
    np.testing.assert_allclose(out[:-1], exact[:-1], rtol=1e-10, atol=1e-12)
    assert np.all(out[-1] == 7.0)
    form.steps[TERMS] = 25
    by_series = np.full(z.shape, np.nan)
    exponentials.series.py_func(z, rows, form, h, by_series, room(rows))
    np.testing.assert_allclose(by_series[:, :rows], exact[:, :rows], rtol=1e-10, atol=1e-12)
    alone = np.full(z.shape, 7.0)
    exponentials.step_without_derivatives.py_func(z, form.e, alone)
    np.testing.assert_allclose(alone[:-1, 0], exact[:-1, 0], rtol=1e-11)
    assert np.all(alone[:, 1:] == 7.0)
    assert exponentials.row_times_state(form.shown, 1, z) == pytest.approx(form.shown[1] @ z[:, 0])


@ROWS
@pytest.mark.parametrize("times", [1, 2, 5])
def test_a_block_is_so_many_steps_with_their_mean(times: int, rows: int) -> None:
    h, z = 0.2, state(rows)
    form = made(3, h, rows)
    exponentials.block_matrices.py_func(form, room(rows), rows, times)
    np.testing.assert_allclose(form.whole, expm(form.a * h * times), rtol=1e-10, atol=1e-13)
    slopes = [slopes_of(form, h * k) for k in range(1, times + 1)]
    np.testing.assert_allclose(form.d_whole, slopes[-1], rtol=1e-9, atol=1e-11)
    mean = np.mean([expm(form.a * h * k) for k in range(1, times + 1)], axis=0)
    np.testing.assert_allclose(form.mean, form.shown @ mean, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(form.d_mean, np.mean(slopes, axis=0)[0], rtol=1e-9, atol=1e-11)
    shown, d_x = np.ones(2), np.ones(rows - 1)
    exponentials.add_block_mean.py_func(z, rows, form, shown, d_x, np.full(z.shape[1], np.nan))
    np.testing.assert_allclose(shown, 1.0 + form.mean @ z[:, 0])
    np.testing.assert_allclose(d_x, 1.0 + form.mean[0] @ z[:, 1:rows] + form.d_mean[:, 1:rows].T @ z[:, 0])


def test_hidden_states_answer_a_parabola_exactly() -> None:
    """The drive at begin, middle and end: a parabola through them, integrated with the exponential."""
    random = np.random.default_rng(4)
    linear, h = np.zeros((6, 10, 2)), 0.4
    linear[3:5, Q : W + 1] = random.standard_normal((2, 2, 2))
    out = np.full((2, 4, 2, 2, 2), np.nan)
    linear_coefficients.hidden_steps.py_func(linear, h, out, np.empty((2, 2, 2)), np.empty((4, 2, 2, 2)))
    weights = [
        lambda s: (1 - 2 * s / h) * (1 - s / h), lambda s: 4 * s / h * (1 - s / h), lambda s: s / h * (2 * s / h - 1),
    ]  # fmt: skip
    for c in range(2):
        g = linear[3:5, Q : W + 1, c]
        for end, t in enumerate((0.5 * h, h)):
            np.testing.assert_allclose(out[end, 0, :, :, c], expm(g * t), rtol=1e-10)
            for k, weight in enumerate(weights):
                exact, _ = quad_vec(lambda s, t=t, weight=weight, g=g: expm(g * (t - s)) * weight(s), 0.0, t)
                np.testing.assert_allclose(out[end, 1 + k, :, :, c], exact, atol=1e-12)
