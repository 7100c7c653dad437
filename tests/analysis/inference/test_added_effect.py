"""The start of a fit with one more effect: the parameters fitted before move out of its way while that helps."""

from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest

from analysis.inference.fit import added_effect
from analysis.inference.fit.arrow import Arrow


@pytest.mark.parametrize(("start", "better"), [(0.3, True), (0.9, True), (1.06, False), (1.2, False), (2.0, False)])
def test_a_step_that_leaves_a_larger_residual_is_not_taken(
    monkeypatch: pytest.MonkeyPatch, start: float, better: bool
) -> None:
    """Far from the straight line the step overshoots: from 1.06 on, what it would leave is larger than before."""

    def residual(z: np.ndarray) -> np.ndarray:
        return np.array([z[0] + 0.9 * z[0] ** 3])

    monkeypatch.setattr(added_effect, "_compensation", lambda tangents: lambda left: left)
    before = Some(offset=1, free_parameters=())
    bounds = np.array([-9.0]), np.array([9.0])
    problem: Any = Some(offset=1, free_parameters=(), bounds=bounds, whitened_residual=residual)
    at: Any = Some(problem=before, once=lambda name, made: made(), tangents=None)
    found = added_effect._compensated(at, problem, np.array([start]))
    if better:
        assert abs(found[0]) < 0.95 * start
    else:
        assert found[0] == start


def test_parameters_compensate_by_a_least_squares_step_but_not_where_hardly_anything_shows() -> None:
    random = np.random.default_rng(1)
    columns = random.standard_normal((80, 4)) * [1.0, 1e5, 1e-6, 0.0]
    columns[:, 1] = 1e5 * columns[:, 0] + 1e-1 * columns[:, 1]  # a tenth of it its own
    left = random.standard_normal(80)
    some = Arrow.of([columns[:40], columns[40:]], 4)
    step = added_effect._compensation(some)(left)
    exact = np.linalg.lstsq(columns[:, :3], left, rcond=None)[0]
    np.testing.assert_allclose(columns @ step, columns[:, :3] @ exact, atol=1e-7)
    assert step[3] == 0.0
    columns[:, 1] = 1e5 * columns[:, 0] + 1.0 * random.standard_normal(80)  # a hundred-thousandth
    step = added_effect._compensation(Arrow.of([columns], 4))(left)
    kept = np.linalg.lstsq(columns[:, [0, 2]], left, rcond=None)[0]
    np.testing.assert_allclose(columns @ step, columns[:, [0, 2]] @ kept, atol=1e-4)
