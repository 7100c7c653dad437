"""What laws of free curves do to the shots: which range is visited, and whose derivative stands where."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import TOUCHING, Infeasible
from analysis.collision.effects.kernel import STATES
from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import graded_basis, visited_range
from analysis.diagnosis.learning import curve_motion as module
from analysis.diagnosis.learning.curve_motion import FitWithMotions, Motions, Term
from analysis.inference.model.arrow import Arrow

PLACE = next(one for one in ARGUMENTS if (one.where, one.name) == ("block", "place"))
BEND = next(one for one in ARGUMENTS if one.where == "plate" and not one.touching)
OVERLAP = next(one for one in ARGUMENTS if one.where == "contact" and one.touching)
BASIS = graded_basis(-1.0, 2.0, 4)


def path_of(seed: int) -> Any:
    """Return six steps of a path with the inputs of an effect at their middles; two are before the touch."""
    inputs = np.random.default_rng(seed).uniform(-1.0, 1.0, (6, 3, STATES))
    inputs[:, :, TOUCHING] = np.array([0, 0, 1, 1, 0, 1])[:, None]
    return SimpleNamespace(effect_inputs=inputs, early=np.array([True, True, False, False, False, False]))


@pytest.mark.parametrize(
    ("argument", "steps"), [(PLACE, slice(0, 6)), (BEND, slice(2, 6)), (OVERLAP, [2, 3, 5])],
    ids=["block", "plate", "contact"],
)  # fmt: skip
def test_a_law_is_visited_where_it_acts(argument: Any, steps: Any) -> None:
    """On the block in flight too, on the plate from the touch on, in contact while they touch."""
    paths = [path_of(1), path_of(2)]
    before_law = FitWithMotions("fit", "motions", tuple((path, "collision") for path in paths))  # type: ignore[arg-type]
    expected = visited_range([np.asarray(argument.value(path.effect_inputs[steps, 1])) for path in paths])
    assert before_law.visited(argument) == pytest.approx(expected)


def test_the_columns_of_a_law_are_those_of_the_members_of_its_basis(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(module, "first_order_change", lambda *given: asked.append(given) or answer)
    answer: Any = "columns"
    term = Term(PLACE, BASIS, np.zeros(BASIS.count))
    row: Any = "row"
    path: Any = ("path", "collision")
    assert module._columns(term, row, path, 9) == "columns"  # type: ignore[comparison-overlap]
    ((linear, effect, collision, parameters, samples),) = asked
    assert (linear, effect, collision, samples) == ("path", "row", "collision", 9)
    expected = [[1.0, member.address, 0.0] for member in BASIS.members]
    np.testing.assert_array_equal(parameters, expected)
    answer = None
    with pytest.raises(Infeasible, match="first order"):
        module._columns(term, row, path, 9)


def problem_of(*, moves: bool = False) -> Any:
    """Return a problem of two shots whose own number stands at a place of its own."""
    lines = [(np.full(3, 10.0 + k), np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]) + k) for k in (0, 1)]

    def shot_at(index: int, point: Any) -> Any:
        def with_laws(laws: Any) -> Any:
            return SimpleNamespace(path=lambda steps: (index, point, list(laws), steps), collision=f"c{index}")

        return SimpleNamespace(with_laws=with_laws)

    return SimpleNamespace(
        size=3, places=[np.array([0, 1]), np.array([0, 2])], derivatives=lambda z, rows=(): lines, shot_at=shot_at,
        arrow=lambda blocks: Arrow(tuple(blocks), 1, (np.array([0, 1]), np.array([0, 2])), 3),
        unpack=lambda z: ("point", z), data=SimpleNamespace(shots=["s0", "s1"], site=SimpleNamespace(moves=moves)),
        displacement=lambda z, rows: [("shown", z, row) for row in rows],
    )  # fmt: skip


@pytest.mark.parametrize("laid", [True, False])
def test_derivatives_stand_at_the_places_of_their_numbers(laid: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Base and starts first, then the coefficients of each curve, which all shots share."""
    asked: list[Any] = []

    def columns(term: Term, row: Any, path: Any, samples: int) -> np.ndarray:
        asked.append((path, samples))
        return np.full((samples, term.basis.count), float(path[0][0]) + 100.0)

    monkeypatch.setattr(module, "_columns", columns)
    term = Term(PLACE, BASIS, np.zeros(BASIS.count))
    problem = problem_of()
    if laid:
        fitted: Any = SimpleNamespace(problem=problem, z="z", point="point")
        found = module.fit_with_motions(fitted).beside(term)
        laws: list[Any] = []
        point: Any = "point"
    else:
        z: Any = "z"
        found = module.motions(problem, z, (term,))
        laws, point = [term.argument.row(term.curve)], ("point", "z")
    count = BASIS.count
    assert found.derivatives.shared == 1 + count and found.derivatives.size == 3 + count
    for k, (block, at) in enumerate(zip(found.derivatives.blocks, found.derivatives.places, strict=True)):
        assert at.tolist() == [0, *range(3, 3 + count), 1 + k]
        np.testing.assert_array_equal(block[:, [0, -1]], np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]) + k)
        np.testing.assert_array_equal(block[:, 1:-1], np.full((3, count), 100.0 + k))
        np.testing.assert_array_equal(found.displacement_m[k], np.full(3, 10.0 + k))
    for (path, collision), samples in asked:
        index, at, acting, steps = path
        assert (at, steps, samples, collision) == (point, 1, 3, f"c{index}") and len(acting) == len(laws)
    if not laid:
        assert [one[:2] for one in module.displacements(problem, z, (term, term))] == [("shown", "z")] * 2


def test_on_a_moving_frame_laws_are_laid_on_the_fit_under_the_noise_of_the_flights() -> None:
    again = SimpleNamespace(problem=problem_of(moves=True), z="again", point="point again")
    noisy = SimpleNamespace(fit_once=lambda z: again if z == "z" else None)
    problem = problem_of(moves=True)
    problem.with_noise = lambda noise: noisy if noise == "of flights" else None
    fitted: Any = SimpleNamespace(problem=problem, z="z", point="point", unlearned_noise="of flights")
    assert module.fit_with_motions(fitted).fitted is again  # type: ignore[comparison-overlap]
    still: Any = SimpleNamespace(problem=problem_of(), z="z", point="point")
    before_law = module.fit_with_motions(still)
    assert before_law.fitted is still and isinstance(before_law.motions, Motions)
