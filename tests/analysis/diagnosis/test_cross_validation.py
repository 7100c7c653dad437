"""What the other shots leave open of a held-out one, against the dense Gaussian; when a prediction earns a name."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.diagnosis.evidence import cross_validation
from analysis.diagnosis.evidence.cross_validation import Prediction, _PredictionUncertainty, choose, predict
from analysis.inference import NormalMatrix


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
    assert after.predicts_better(before) is beats and after.predicts_significantly_better(before) is earns
    sure = prediction(100.0, 1.0, [1.0, 2.0], share=0.25)  # what it leaves open anyhow scatters nothing
    assert after.predicts_significantly_better(sure) is (beats and surprise < 95.0)


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
    made = _PredictionUncertainty.of(curvature, shared, covariance)
    assert made.log_volume == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-9)
    plain = float(rest @ rest)
    assert made.chi2(plain, jacobian.T @ rest) == pytest.approx(float(rest @ np.linalg.solve(dense, rest)), rel=1e-9)
    exact = _PredictionUncertainty.of(curvature, shared, None)
    assert exact.log_volume == 0.0 and exact.chi2(plain, jacobian.T @ rest) == plain


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
    assert both is not None and both.displacement_m == ("three", "seven") and both.minus_2_ln_likelihood == 15.0
    assert both.rms_m == pytest.approx(np.sqrt((3 * 4.0 + 16.0) / 4)) and both.left.tolist() == [1.0, 2.0, 3.0, 9.0]
    assert both.squared(np.array([1.0, 1.0, 1.0, 2.0])) == 2 * 3 + 4
    assert asked == [("fitted", "floor", "stop")] * 2
    none: Any = ("fitted", (3, 8), "floor", "stop")
    assert predict(*none) is None


class OneOut:
    """A fit of three shots of which the middle one is held out; ``unseen`` is a plate that it alone was taken on."""

    def __init__(self, patch: pytest.MonkeyPatch, unseen: tuple[int, ...] = (), *, fails: bool = False) -> None:
        # in the others' vector: k_p, a plate of no shot of theirs, two starts; in the shot's: k_p, its plate, its start
        random = np.random.default_rng(1)
        self.fails, self.asked = fails, []
        root, own = random.standard_normal((4, 4)), random.standard_normal((6, 3))
        self.covariance, self.rows = root @ root.T, own
        self.residual = random.standard_normal(6)
        self.some: Any = SimpleNamespace(
            shared=[0, 1], unseen=[1] if unseen else [], size=4, search=self.search, names=None
        )  # fmt: skip
        self.one: Any = SimpleNamespace(
            shared=[0, 1], unseen=[], square=self.square, predict=self.predict,
            unpack=lambda z: ("unpacked", z.tolist()),
            full=lambda point: [("path", point)], with_noise=lambda floor: self.one if floor == "floor" else None,
            free_parameters=[(None, None, -1), (None, None, 0), (None, None, 0)],
        )  # fmt: skip

        def of(fitted: Any, shots: list[int]) -> Any:
            if shots == [1]:
                return self.one, np.array([10.0, 20.0, 30.0]), [2]
            assert shots == [0, 2]
            return self.some, np.array([10.0, 20.0, 1.0, 2.0]), [2, 3]

        patch.setattr(cross_validation, "_of", of)
        measured = SimpleNamespace(
            displacement_m=np.array([1.0, 5.0, 9.0]), averaged=lambda path: 1.0, valid=np.array([True, True, False]),
            without_frame_motion=lambda floor, off: off + 1.0 if floor == "floor" else None,
        )  # fmt: skip
        data = SimpleNamespace(shots=["first", measured, "last"])
        self.fitted: Any = SimpleNamespace(problem=SimpleNamespace(data=data), held_out_cache={})
        self.cut_off, self.searches = False, 0

    def search(self, z: Any, *, evaluations: int, cancelled: Any) -> Any:
        assert z.tolist() == [10.0, 20.0, 1.0, 2.0] and (evaluations, cancelled) == (25, self.stop)
        self.searches += 1
        if self.fails:
            raise Infeasible("nowhere")
        curvature = SimpleNamespace(
            inverse=lambda seen: self.covariance if self.asked.append(seen.tolist()) is None else None
        )
        square = SimpleNamespace(curvature=curvature)
        return SimpleNamespace(parameters=np.array([11.0, 22.0, 1.5, 2.5]), square=square)

    def square(self, z: Any) -> Any:
        assert z.tolist() == [10.0, 20.0, 30.0]
        return SimpleNamespace(followed=lambda moved, own: self.asked.append((moved.tolist(), own)) or 0.25)

    def predict(self, z: Any, held: Any, *, evaluations: int, tolerance: float) -> Any:
        self.asked.append((z.tolist(), held, evaluations, tolerance))
        end = SimpleNamespace(
            residual=self.residual, pull=lambda d: self.rows.T @ d, chi2=float(self.residual @ self.residual),
            samples=50,
            gradient=self.rows.T @ self.residual, curvature=NormalMatrix.of(self.rows.T @ self.rows),
        )  # fmt: skip
        return SimpleNamespace(parameters=z + 0.5, square=end)

    def stop(self) -> bool:
        return self.cut_off

    def told(self) -> Any:
        floor: Any = "floor"
        return cross_validation._predict(self.fitted, 1, floor, self.stop)


@pytest.mark.parametrize("unseen", [(), (1,)])
def test_a_shot_is_predicted_with_what_the_others_know_and_pays_for_its_own(
    unseen: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plate that no other shot was taken on is its own, as its start is."""
    out = OneOut(monkeypatch, unseen)
    told = out.told()
    shared, own = ([0], [1, 2]) if unseen else ([0, 1], [2])
    seen, moved, given = out.asked
    there = [11.0, 20.0, 30.0] if unseen else [11.0, 22.0, 30.0]
    assert moved == ([there[0] - 10.0, there[1] - 20.0, 0.0], own)
    begun = [value + 0.25 * (place in own) for place, value in enumerate(there)]
    assert given == (begun, shared, 10, 1e-2) and seen == [True, not unseen, True, True]
    open_ = _PredictionUncertainty.of(out.rows.T @ out.rows, shared, out.covariance[shared][:, shared])
    chi2 = open_.chi2(float(out.residual @ out.residual), out.rows.T @ out.residual)
    assert told.minus_2_ln_likelihood == pytest.approx(
        chi2 + open_.log_volume + 2 * np.log(50)
    )  # two numbers of its own effects
    assert told.rms_m == pytest.approx(np.sqrt((1.0 + 25.0) / 2))
    assert told.displacement_m == (("path", ("unpacked", [value + 0.5 for value in begun])),)
    assert told.left is out.residual
    difference = np.arange(6.0)
    assert told.squared(difference) == pytest.approx(
        open_.chi2(float(difference @ difference), out.rows.T @ difference)
    )


def test_what_the_other_shots_say_is_kept_unless_it_was_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    out = OneOut(monkeypatch)
    out.cut_off = True
    first = out.told()
    assert out.searches == 1 and not out.fitted.held_out_cache
    out.cut_off = False
    for _ in range(2):
        again = out.told()
        assert (
            out.searches == 2
            and again.minus_2_ln_likelihood == first.minus_2_ln_likelihood
            and again.rms_m == first.rms_m
        )
    assert list(out.fitted.held_out_cache) == [1]


def test_a_shot_that_cannot_be_followed_is_not_predicted(monkeypatch: pytest.MonkeyPatch) -> None:
    assert OneOut(monkeypatch, fails=True).told() is None
    unknown = OneOut(monkeypatch)
    unknown.covariance = None  # type: ignore[assignment]
    plain = float(unknown.residual @ unknown.residual)
    assert unknown.told().minus_2_ln_likelihood == pytest.approx(plain + 2 * np.log(50))  # as if exactly known
