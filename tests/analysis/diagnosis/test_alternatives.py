"""Effects that were tried, with their standing; what a record could not have shown; curves in few points."""

import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis.findings.result import Standing
from analysis.diagnosis.verdict import alternatives as module
from analysis.diagnosis.verdict.alternatives import averaged_to, blind_spots, candidates, curve_of_fit
from tests.analysis.diagnosis.shots import KINDS

DRAG, TILT, MODE, FRICTION = effects_named(("viscous_drag", "tilt", "block_mode", "coulomb_friction"))


def test_every_effect_that_was_tried_has_its_standing(monkeypatch: pytest.MonkeyPatch) -> None:
    def fit(bic: float, likelihood: float = 10.0) -> Any:
        return SimpleNamespace(bic=bic, log_likelihood=likelihood, effects=())

    start = fit(100.0)
    fits = {DRAG: fit(60.0), TILT: fit(79.9), MODE: fit(80.1), FRICTION: fit(50.0, 9.9)}
    scores = {effect: SimpleNamespace(gain=gain) for effect, gain in zip(fits, (5.0, 7.0, 6.0, 8.0), strict=True)}
    trail: Any = SimpleNamespace(
        start=start, linearised=lambda fitted: "at", of=lambda effects: fits[effects[-1]], scores=scores,
        least_fall=lambda: 20.0,
    )  # fmt: skip
    monkeypatch.setattr(module, "effect_parameters", lambda fitted: {one: {"size": fitted.bic} for one in fits})
    monkeypatch.setattr(module, "curve_of_fit", lambda fitted, before: ("of fit", fitted.bic, before))
    monkeypatch.setattr(module, "curve_to_first_order", lambda at, score: (at, score.gain))
    best: Any = SimpleNamespace(effects=(DRAG,))
    found = candidates(best, trail)
    assert [(one.effect, one.delta_bic, one.score, one.standing) for one in found] == [
        (DRAG, -40.0, 5.0, Standing.IN_MODEL),
        (TILT, pytest.approx(-20.1), 7.0, Standing.BEHIND_ANOTHER),
        (MODE, pytest.approx(-19.9), 6.0, Standing.DOES_NOT_PAY),
        (FRICTION, None, 8.0, Standing.SCORED_ONLY),  # less likely than without: that search did not end
    ]
    assert found[0].parameters == {"size": 60.0} and found[0].explains_m == ("of fit", 60.0, start)
    assert found[3].parameters == {} and found[3].explains_m == ("at", 8.0)


def test_blind_spots_are_effects_that_were_tried_and_are_not_in_the_model(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "least_seen", lambda at, kind: at[kind.effect])
    at: Any = {DRAG: 1.0, TILT: None, FRICTION: 3.0}
    best: Any = SimpleNamespace(effects=(FRICTION,))
    kinds = [KINDS[name] for name in ("viscous_drag", "coulomb_friction", "block_mode", "tilt")]
    found = blind_spots(at, kinds, best)
    assert [(spot.effect, spot.parameter, spot.least) for spot in found] == [
        (DRAG, "coefficient_n_s_per_m", 1.0), (TILT, "angle_rad", None),
    ]  # fmt: skip


@pytest.mark.parametrize("size", [5, 6, 7, 23])
def test_a_curve_in_few_points_is_its_means(size: int) -> None:
    values = np.random.default_rng(1).standard_normal(size)
    found = averaged_to(6, values)
    assert found.dtype == np.float32
    if size <= 6:
        np.testing.assert_allclose(found, values, rtol=1e-6)
        return
    edges = [int(size * k / 6) for k in range(7)]
    parts = [values[begin:end].mean() for begin, end in itertools.pairwise(edges)]
    np.testing.assert_allclose(found, parts, rtol=1e-6)


def test_what_a_fit_explains_is_how_its_residual_differs() -> None:
    before: Any = SimpleNamespace(residual_m=[np.full(3, 5.0), np.full(3, 7.0)])
    fitted: Any = SimpleNamespace(residual_m=[np.full(3, 2.0), np.full(3, 1.0)])
    assert [curve.tolist() for curve in curve_of_fit(fitted, before)] == [[3.0] * 3, [6.0] * 3]


def test_a_scored_effect_explains_what_the_fit_does_not_give_way_to() -> None:
    random = np.random.default_rng(2)
    tangents = [random.standard_normal((20, 3)) for _ in range(2)]
    columns, residual = [random.standard_normal(20) for _ in range(2)], random.standard_normal(40)
    stacked = np.concatenate(tangents)
    at: Any = SimpleNamespace(
        contribution_of=lambda kind, start: columns if kind == "kind" else None, whole=residual,
        problem=SimpleNamespace(whitened=lambda some: np.concatenate(list(some))),
        tangents=SimpleNamespace(
            solve=lambda left: np.linalg.lstsq(stacked, left, rcond=None)[0], places=[np.arange(3)] * 2
        ),
        lines=[(None, one) for one in tangents],
    )  # fmt: skip
    score: Any = SimpleNamespace(kind="kind", start="start")
    found = module.curve_to_first_order(at, score)
    moved = np.linalg.lstsq(stacked, residual - np.concatenate(columns), rcond=None)[0]
    assert found is not None
    for curve, column, tangent in zip(found, columns, tangents, strict=True):
        np.testing.assert_allclose(curve, averaged_to(module.POINTS, column + tangent @ moved), rtol=1e-5)
    score.kind = "other"
    assert module.curve_to_first_order(at, score) is None
