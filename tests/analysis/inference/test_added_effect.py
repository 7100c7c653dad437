"""The start of a fit with one more effect: the parameters fitted before move out of its way while that helps."""

from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest

from analysis.inference.fit import added_effect


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
