"""Where a minimisation says that it has converged."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.inference.fit.least_squares import (
    Minimum,
    Square,
    _corrected,
    _Damping,
    _fall_along_edge,
    _length,
    free_to_move,
    minimise,
)
from analysis.inference.model.normal_matrix import NormalMatrix


@pytest.mark.parametrize("at", [0.0, 1e12])
@pytest.mark.parametrize(("promise", "converged"), [(1e-3, True), (0.5, False)])
def test_an_end_in_rounding_is_a_minimum_only_where_little_was_promised(
    promise: float, converged: bool, at: float
) -> None:
    """No step lowers the sum, until its fall is lost in the digits of the sum, or it in those of the parameter."""
    start = np.array([at])

    def square(z: np.ndarray) -> Square:
        chi2 = 1000.0 if np.array_equal(z, start) else 1000.0 + 1e-4
        return Square(chi2, NormalMatrix.of(np.eye(1)), np.array([np.sqrt(promise)]), 1000)

    found = minimise(square, start)
    assert found.converged is converged
    assert np.array_equal(found.parameters, start)


def test_a_quadratic_form_is_minimised_in_a_step() -> None:
    curvature = np.array([[4.0, 1.0], [1.0, 3.0]])
    lowest = np.array([1.0, -2.0])
    evaluated = []

    def square(z: np.ndarray) -> Square:
        evaluated.append(z)
        away = z - lowest
        return Square(float(away @ curvature @ away) + 5.0, NormalMatrix.of(curvature), curvature @ away, 100)

    found = minimise(square, np.zeros(2))
    assert found.converged and len(evaluated) <= 4
    np.testing.assert_allclose(found.parameters, lowest, atol=1e-3)  # of standard deviations of about a half


def quadratic(curvature: np.ndarray, lowest: np.ndarray, rest: float = 5.0) -> Callable[[np.ndarray], Square]:
    def square(z: np.ndarray) -> Square:
        away = z - lowest
        return Square(float(away @ curvature @ away) + rest, NormalMatrix.of(curvature), curvature @ away, 100)

    return square


def test_a_bound_holds_what_presses_against_it_and_the_rest_goes_to_its_minimum_beside_it() -> None:
    curvature = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, 0.0], [0.5, 0.0, 2.0]])
    lowest = np.array([1.0, -2.0, 0.3])
    low, high = np.array([-9.0, -1.0, -9.0]), np.array([9.0, 9.0, 9.0])
    found = minimise(quadratic(curvature, lowest), np.array([0.0, 5.0, 0.0]), bounds=(low, high))
    # with the second at -1, one beyond its lowest, the others solve their own equations
    rest = lowest[[0, 2]] - np.linalg.solve(curvature[np.ix_([0, 2], [0, 2])], curvature[[0, 2], 1]) * 1.0
    assert found.converged and found.at_bound == (1,)
    np.testing.assert_allclose(found.parameters, [rest[0], -1.0, rest[1]], atol=1e-3)
    mirrored = minimise(quadratic(curvature, -lowest), np.array([0.0, -5.0, 0.0]), bounds=(-high, -low))
    np.testing.assert_allclose(mirrored.parameters, -found.parameters, atol=2e-3)
    assert mirrored.at_bound == (1,)
    held = minimise(quadratic(curvature, lowest), np.array([7.0, 0.0, 0.0]), bounds=(low, np.array([-9.0, 9.0, 9.0])))
    assert held.parameters[0] == -9.0 and 0 in held.at_bound


def test_a_bent_valley_is_followed_to_its_end() -> None:
    """Rosenbrock's, as residuals: 10 (y - x^2) and 1 - x."""
    evaluated = []

    def square(z: np.ndarray) -> Square:
        evaluated.append(z)
        left = np.array([10.0 * (z[1] - z[0] ** 2), 1.0 - z[0]])
        slope = np.array([[-20.0 * z[0], 10.0], [-1.0, 0.0]])
        return Square(float(left @ left), NormalMatrix.of(slope.T @ slope), slope.T @ left, 2)

    found = minimise(square, np.array([-1.2, 1.0]), tolerance=1e-10)
    assert found.converged and len(evaluated) < 40
    np.testing.assert_allclose(found.parameters, [1.0, 1.0], atol=1e-4)
    evaluated.clear()
    assert not minimise(square, np.array([-1.2, 1.0]), evaluations=3).converged and len(evaluated) == 3
    evaluated.clear()
    stopped = minimise(square, np.array([-1.2, 1.0]), cancelled=lambda: len(evaluated) >= 2)
    assert not stopped.converged and len(evaluated) == 2


def test_a_refused_step_is_followed_by_one_that_is_clearly_shorter() -> None:
    """Two directions a million times apart in curvature, uphill everywhere: no two points are nearly the same."""
    curvature, start = np.array([[1.0, 0.9], [0.9, 1.0]]) * np.outer([1e3, 1.0], [1e3, 1.0]), np.zeros(2)
    asked: list[np.ndarray] = []

    def square(z: np.ndarray) -> Square:
        asked.append(z)
        return Square(1e3 + 1e-3 * len(asked), NormalMatrix.of(curvature), np.array([2e4, -3.0]), 1000)

    found = minimise(square, start, evaluations=30)
    lengths = np.sqrt(np.array(asked[1:-1]) ** 2 @ np.diag(curvature))  # the last looks for an edge
    assert not found.converged and np.array_equal(found.parameters, start)
    assert np.all(lengths[1:] <= 0.7 * lengths[:-1]) and np.all(lengths[1:] >= 0.05 * lengths[:-1])
    assert 5 < len(asked) < 20


def followed(square: Callable[[np.ndarray], Square], start: np.ndarray, **options: Any) -> tuple[Minimum, list[Any]]:
    """Return the minimum of a search, and where it has been."""
    asked: list[np.ndarray] = []

    def noted(z: np.ndarray) -> Square:
        asked.append(z)
        return square(z)

    return minimise(noted, start, **options), asked


def test_every_step_between_bounds_promises_a_fall_and_ends_within_them() -> None:
    """Cut at the bounds, Newton's step would lead uphill in nearly every valley that crosses a corner."""
    rng = np.random.default_rng(7)
    for _ in range(200):
        root = rng.standard_normal((6, 4)) * [1.0, 0.1, 1.0, 3.0]
        curvature, lowest = root.T @ root, rng.normal(0.0, 3.0, 4)
        start = rng.uniform(-1.0, 1.0, 4)
        found, asked = followed(quadratic(curvature, lowest), start, bounds=(np.full(4, -1.0), np.full(4, 1.0)))
        values = [quadratic(curvature, lowest)(z).chi2 for z in asked]
        assert found.converged and np.all(np.diff(values) < 0) and np.all(np.abs(asked) <= 1.0)
        pull = found.square.gradient  # nothing presses but against its bound
        inside = np.abs(found.parameters) < 1.0
        assert np.all(np.abs(pull[inside]) < 1e-2 * np.sqrt(np.diag(curvature)[inside]))
        assert np.all(pull[~inside] * found.parameters[~inside] <= 1e-9)


def test_parameters_that_follow_go_to_their_own_minimum() -> None:
    curvature = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, 0.2], [0.5, 0.2, 2.0]])
    gradient, moved = np.array([0.3, -0.7, 0.1]), np.array([0.0, 0.5, 0.0])
    own = [0, 2]
    step = Square(1.0, NormalMatrix.of(curvature), gradient, 9).followed(moved, own)
    whole = moved.copy()
    whole[own] = step
    np.testing.assert_allclose((gradient + curvature @ whole)[own], 0.0, atol=1e-12)


def test_parameters_are_held_where_they_are_fixed_or_pressed_against_a_bound() -> None:
    low, high = np.array([0.0, 0.0, 0.0, 0.0, 5.0, 0.0]), np.array([1.0, 1.0, 1.0, 1.0, 5.0, 1.0])
    here, gradient = np.array([0.0, 0.0, 1.0, 1.0, 5.0, 0.5]), np.array([1.0, -1.0, 1.0, -1.0, 0.0, 9.0])
    assert free_to_move(here, gradient, low, high).tolist() == [False, True, True, False, False, True]


def test_damping_eases_slowly_after_a_refusal_and_ends_where_no_step_is_short_enough() -> None:
    one, other = _Damping(), _Damping()
    one.ease(1.0)
    other.refuse(1.0)
    assert other.value > 5.0 * _Damping().value
    begin = other.value
    shares = []
    for _ in range(4):
        other.ease(1.0)
        shares.append(other.value / begin)
        begin = other.value
    assert shares[:3] == pytest.approx([shares[0]] * 3) and shares[3] == pytest.approx(one.value / _Damping().value)
    assert one.value / _Damping().value < shares[0] < 1.0
    worse, fair = _Damping(), _Damping()
    worse.ease(0.1)
    fair.ease(0.5)
    assert worse.value > _Damping().value > fair.value > one.value  # as the fall keeps what was promised of it
    tries, here, wide = 0, np.zeros(2), (np.full(2, -9.0), np.full(2, 9.0))
    square = Square(1.0, NormalMatrix.of(np.eye(2)), np.ones(2), 9)
    while (way := other.way(square, here, np.ones(2, dtype=bool), wide)) is not None:
        tries += 1
        assert 0.0 < way[1] <= 2.0  # of chi^2, what the whole way promises
        other.refuse(_length(square, way[0]))
    assert 8 < tries < 40 and other.value > 1e12


def test_a_search_is_given_up_where_it_is_called_hopeless_once_little_is_promised() -> None:
    """A valley of gradient 2 (z - 3): the promise is the square of what is left to go."""
    asked: list[float] = []

    def search(gives_up: bool, begin: float) -> bool:
        asked.clear()

        def stop_early(at: np.ndarray, square: Square) -> bool:
            asked.append(float(at[0]))
            return gives_up

        curved = quadratic(np.eye(1), np.array([3.0]), rest=100.0)
        return minimise(curved, np.array([begin]), stop_early=stop_early).converged

    assert not search(True, 2.0) and asked == [2.0]
    assert search(False, 2.0) and asked == [2.0]
    far = 3.0 - np.sqrt(15.0 * 1.3)  # with chi^2 of 100 over 100 samples and more
    assert search(False, far) and asked != [far]


def bent(z: np.ndarray) -> np.ndarray:
    return np.array([10.0 * (z[1] - z[0] ** 2), 1.0 - z[0]])


@pytest.mark.parametrize(("missing", "once"), [(0.29, True), (0.31, False)])
def test_corrections_end_where_most_of_the_fall_that_was_promised_is_there(missing: float, once: bool) -> None:
    """The step takes chi^2 from 9 to 1 in a straight valley; this one is bent by what is ``missing`` of that."""
    left, wide = np.array([3.0, 0.0]), (np.full(2, -9.0), np.full(2, 9.0))
    square = Square(9.0, NormalMatrix.of(np.eye(2)), left, 2, left, lambda s: s, lambda v: v)
    asked: list[np.ndarray] = []

    def bent_by(point: np.ndarray) -> np.ndarray:
        asked.append(point)
        return np.array([np.sqrt(1.0 + 8.0 * missing), 0.0])

    found = _corrected(bent_by, square, np.zeros(2), np.array([-2.0, 0.0]), np.ones(2, dtype=bool), wide)
    assert found is not None and found[1] == pytest.approx(1.0 + 8.0 * missing)
    assert (len(asked) == 1) == once


def test_a_long_step_is_corrected_until_the_residual_is_as_predicted() -> None:
    """Rosenbrock's valley, from its floor: straight on the residual would be a hundred times what it was."""
    here, slope = np.array([-0.5, 0.25]), np.array([[10.0, 10.0], [-1.0, 0.0]])
    left = bent(here)
    square = Square(
        float(left @ left),
        NormalMatrix.of(slope.T @ slope),
        slope.T @ left,
        2,
        left,
        lambda s: slope @ s,
        lambda v: slope.T @ v,
    )
    step, free, wide = np.array([1.0, -1.0]), np.ones(2, dtype=bool), (np.full(2, -9.0), np.full(2, 9.0))
    straight = bent(here + step)
    assert straight @ straight > 30.0 * square.chi2
    found = _corrected(bent, square, here, here + step, free, wide)
    assert found is not None
    point, chi2 = found
    assert chi2 == pytest.approx(bent(point) @ bent(point)) and chi2 < square.chi2
    assert abs(point[0] - 0.5) < 0.2  # as far along the floor as the step was meant to go
    held = _corrected(bent, square, here, here + step, free, (np.full(2, -0.6), np.full(2, 9.0)))
    assert held is not None and (held[0] >= -0.6).all()

    def nowhere(_: np.ndarray) -> np.ndarray:
        raise Infeasible("none")

    assert _corrected(nowhere, square, here, here + step, free, wide) is None
    bare = Square(square.chi2, square.curvature, square.gradient, 2)
    assert _corrected(bent, bare, here, here + step, free, wide) is None


def test_where_the_last_step_needed_no_correction_derivatives_are_computed_at_once() -> None:
    """A valley that bends a little: no step of Newton needs a correction."""
    asked: list[tuple[str, float]] = []

    def residual(z: np.ndarray) -> np.ndarray:
        asked.append(("residual", float(z[0])))
        return at(z)

    def at(z: np.ndarray) -> np.ndarray:
        return np.array([9.0 - z[0] - 0.05 * z[0] ** 2])

    def square(z: np.ndarray) -> Square:
        asked.append(("square", float(z[0])))
        left, slope = at(z), np.array([[-1.0 - 0.1 * z[0]]])
        return Square(
            float(left @ left),
            NormalMatrix.of(slope.T @ slope),
            slope.T @ left,
            1,
            left,
            lambda s: slope @ s,
            lambda v: slope.T @ v,
        )

    found = minimise(square, np.zeros(1), residual=residual, tolerance=1e-9)
    assert found.converged and abs(found.parameters[0] - 6.7332) < 1e-3
    kinds = [kind for kind, _ in asked]
    assert kinds[:3] == ["square", "residual", "square"]  # the first step is looked at before its derivatives
    assert set(kinds[3:]) == {"square"}


@pytest.mark.parametrize("rise", [5.0, 0.0])
@pytest.mark.parametrize("left", [1.0, 4.0])
def test_a_corner_is_a_minimum_however_much_was_promised_beyond_it(left: float, rise: float) -> None:
    """The slope before the corner promises 0.1 and 1.6 of chi^2; without a rise the search goes on to its end."""

    def residual(z: np.ndarray) -> np.ndarray:
        return np.array([left - 0.1 * z[0] + rise * max(z[0], 0.0), 0.3 * z[0]])

    def square(z: np.ndarray) -> Square:
        now, slope = residual(z), np.array([[-0.1 + rise * (z[0] > 0.0)], [0.3]])
        return Square(
            float(now @ now),
            NormalMatrix.of(slope.T @ slope),
            slope.T @ now,
            100,
            now,
            lambda s: slope @ s,
            lambda v: slope.T @ v,
        )

    found = minimise(square, np.zeros(1), residual=residual)
    assert found.converged
    assert bool(found.parameters[0] == 0.0) is (rise > 0.0)


def test_along_an_edge_chi2_falls_to_the_minimum_among_the_points_of_the_edge() -> None:
    """Beyond the edge n z = 0 stands a wall as steep as the root of the distance; here is a point of the edge."""
    rng = np.random.default_rng(5)
    for height in (-1.0, 4000.0):
        root, lowest, normal = rng.standard_normal((9, 4)), rng.normal(0.0, 3.0, 4), rng.standard_normal(4)
        inside = quadratic(root.T @ root, lowest)
        here = np.array([1.0, 0.0, -1.0, 0.0])
        here -= normal * (normal @ here) / (normal @ normal)
        normal *= np.sign(normal @ (lowest - here))  # the minimum lies beyond the edge

        def square(z: np.ndarray, inside: Any = inside, normal: np.ndarray = normal, height: float = height) -> Square:
            at, far = inside(z), float(normal @ z)
            if far <= 0.0:
                return at
            wall = normal * 0.5 * height / np.sqrt(far)  # chi^2 has twice this derivative
            return Square(at.chi2 + 2 * height * np.sqrt(far), at.curvature, at.gradient + wall, at.samples)

        at, free = inside(here), np.ones(4, dtype=bool)
        newton = lowest - here
        fall = _fall_along_edge(square, at, here + 1e-2 * newton, newton, free)
        if height < 0.0:
            assert fall == np.inf  # no edge: it goes on downhill
            continue
        plane = np.linalg.svd(normal[None])[2][1:]  # directions along the edge
        step = -plane.T @ np.linalg.solve(plane @ at.curvature.shared @ plane.T, plane @ at.gradient)
        assert fall == pytest.approx(at.chi2 - inside(here + step).chi2, rel=1e-2) and fall > 1.0

        def nowhere(_: np.ndarray) -> Square:
            raise Infeasible("none")

        assert _fall_along_edge(nowhere, at, here, newton, free) == np.inf
