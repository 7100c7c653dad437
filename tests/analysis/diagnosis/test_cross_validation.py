"""What the other shots leave open of a held-out one, against the dense Gaussian; when a prediction earns a name."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.diagnosis.verdict import cross_validation
from analysis.diagnosis.verdict.cross_validation import Prediction, _Open, choose, predict


def shot_set(*speeds: float) -> Any:
    return SimpleNamespace(shots=[SimpleNamespace(course=SimpleNamespace(velocity_in_m_per_s=-v)) for v in speeds])


def test_the_slowest_a_middle_one_and_the_fastest_are_held_out() -> None:
    assert choose(shot_set(0.3, 0.1, 0.5, 0.2, 0.4)) == (0, 1, 2)
    assert choose(shot_set(0.3, 0.1, 0.5, 0.2)) == (0, 1, 2)
    assert choose(shot_set(0.5, 0.2, 0.1)) == (0, 1, 2)
    assert choose(shot_set(0.5, 0.2, 0.1), in_turn=False) == (1,)
    assert choose(shot_set(0.5, 0.2, 0.3, 0.1), in_turn=False) == (2,)
    assert choose(shot_set(0.5, 0.2)) == (1,) and choose(shot_set(0.1, 0.2), in_turn=False) == (0,)
    assert choose(shot_set(0.5)) == () == choose(shot_set())


def prediction(surprise: float, rms_m: float, left: list[float], share: float = 1.0) -> Prediction:
    return Prediction((), surprise, rms_m, np.array(left), lambda d: share * float(d @ d))


@pytest.mark.parametrize(
    ("surprise", "rms_m", "beats", "earns"),
    [
        (89.9, 1.0, True, True),  # two predictions five apart scatter by ten
        (90.1, 1.0, True, False),
        (99.9, 1.01, True, False),
        (100.0, 0.5, False, False),
        (50.0, 1.019, True, True),
        (50.0, 1.021, False, False),  # further off by more than a fiftieth
    ],
)
def test_a_prediction_beats_another_and_earns_a_name_by_more_than_chance_scatters(
    surprise: float, rms_m: float, beats: bool, earns: bool
) -> None:
    before, after = prediction(100.0, 1.0, [1.0, 2.0]), prediction(surprise, rms_m, [4.0, -2.0])
    assert after.beats(before) is beats and after.earns_a_name(before) is earns
    sure = prediction(100.0, 1.0, [1.0, 2.0], share=0.25)  # what it leaves open anyhow scatters nothing
    assert after.earns_a_name(sure) is (beats and surprise < 95.0)


def test_what_is_open_is_integrated_out_of_the_likelihood() -> None:
    """Two parameters known to a covariance, two of the shot's own free: the marginal Gaussian, written down."""
    random = np.random.default_rng(1)
    jacobian, left = random.standard_normal((40, 4)), random.standard_normal(40)
    root = random.standard_normal((2, 2)) * [[1.0], [1e-3]]
    covariance, shared, own = root @ root.T, [0, 2], [1, 3]
    curvature = jacobian.T @ jacobian
    basis = np.linalg.qr(jacobian[:, own])[0]

    def beside_own(columns: np.ndarray) -> np.ndarray:
        return np.asarray(columns - basis @ (basis.T @ columns))

    seen, rest = beside_own(jacobian[:, shared]), beside_own(left)
    dense = np.eye(40) + seen @ covariance @ seen.T
    made = _Open.of(curvature, shared, covariance)
    assert made.log_volume == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-9)
    plain = float(rest @ rest)
    assert made.chi2(plain, jacobian.T @ rest) == pytest.approx(float(rest @ np.linalg.solve(dense, rest)), rel=1e-9)
    exact = _Open.of(curvature, shared, None)
    assert exact.log_volume == 0.0 and exact.chi2(plain, jacobian.T @ rest) == plain
    beside = cross_validation._beside(made, lambda d: jacobian.T @ d, rest)
    assert beside == pytest.approx(made.chi2(plain, jacobian.T @ rest))


def test_held_out_shots_are_predicted_one_by_one_and_counted_together(monkeypatch: pytest.MonkeyPatch) -> None:
    each = {
        3: Prediction(("three",), 10.0, 2.0, np.array([1.0, 2.0, 3.0]), lambda d: 2.0 * float(d @ d)),  # type: ignore[arg-type]
        7: Prediction(("seven",), 5.0, 4.0, np.array([9.0]), lambda d: float(d @ d)),  # type: ignore[arg-type]
    }
    asked: list[Any] = []

    def one(fitted: Any, shot: int, floor: Any, stop: Any) -> Prediction | None:
        asked.append((fitted, floor, stop))
        return each.get(shot)

    monkeypatch.setattr(cross_validation, "_predict", one)
    given: Any = ("fitted", (3, 7), "floor", "stop")
    both = predict(*given)
    assert both is not None and both.displacement_m == ("three", "seven") and both.surprise == 15.0
    assert both.rms_m == pytest.approx(np.sqrt((3 * 4.0 + 16.0) / 4)) and both.left.tolist() == [1.0, 2.0, 3.0, 9.0]
    assert both.squared(np.array([1.0, 1.0, 1.0, 2.0])) == 2 * 3 + 4
    assert asked == [("fitted", "floor", "stop")] * 2
    none: Any = ("fitted", (3, 8), "floor", "stop")
    assert predict(*none) is None
