"""Small changes along a path, in plain Python: those of the starting speed, and of a frame that moves."""

import numpy as np
import pytest

from analysis.collision.parameters import Collision, Infeasible
from analysis.collision.solver import general, on_moving_frame
from analysis.collision.solver.linearisation import LinearPath, linear_path
from tests.analysis.collision.hybrid import Beside, Hybrid
from tests.analysis.collision.paths import CASES, RIG, TIME_S, paths_in_python


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    paths_in_python(monkeypatch)
    return monkeypatch


def carried(path: LinearPath, begin: np.ndarray, samples: int) -> np.ndarray:
    """Return the change of the block's place that a change of the state at the first touch leads to."""
    out, d = np.full(samples, np.nan), begin.copy()
    for r in range(path.size):
        if path.early[r]:
            continue
        if not path.linked[r]:
            d = d + path.event_jump[r] * (path.event_gradient[r, :-1] @ d)
        d = path.propagator[r] @ d
        if path.sample[r] >= 0:
            out[path.sample[r]] = d[0]
    return out


@pytest.mark.parametrize("place", range(len(CASES)))
def test_a_change_of_the_speed_is_carried_as_the_solver_differentiates_it(place: int) -> None:
    collision, active = CASES[place]
    path = linear_path(collision, active, TIME_S)
    exact = general.solve(collision, active, TIME_S, directions=[4]).displacement_derivatives[:, 0]
    begin = np.zeros(path.propagator.shape[1])
    begin[1] = 1.0
    found = carried(path, begin, TIME_S.size)
    after = TIME_S > 0.0
    assert np.isnan(found[~after]).all()
    assert np.abs(found - exact)[after].max() < 3e-6 * np.abs(exact).max()


def test_an_oscillation_too_fast_for_the_record_is_refused() -> None:
    with pytest.raises(Infeasible, match="too fast"):
        linear_path(Collision(0.02, -0.3, 300.0, 2e-3, 3e7, 0.3), [], TIME_S)


@pytest.mark.parametrize("place", [0, 1])
def test_what_a_moving_frame_adds_is_what_scipys_solution_differs_by(place: int) -> None:
    """At two frequencies, as cosine and as sine; before the touch the block alone flies on in space."""
    collision, _ = CASES[place]
    omega = np.array([150.0, 700.0])
    path = linear_path(collision, [], TIME_S)
    shown, after = on_moving_frame.moved_by_frame(path, collision, omega, TIME_S.size)
    assert shown.shape == (TIME_S.size, 4) and after.shape == (4,)
    touched = TIME_S > 0.0
    for column, (rate, turn) in enumerate([(rate, turn) for turn in (0.0, -np.pi / 2) for rate in omega]):
        size = 1e-9
        ahead, back = (Hybrid(collision, Beside(frame=(sign * size, rate, turn))) for sign in (1, -1))
        exact = (ahead.solved(TIME_S) - back.solved(TIME_S)) / (2 * size)
        scale = np.abs(exact[touched, 0]).max()
        assert np.abs(shown[:, column] - exact[:, 0])[touched].max() < 2e-4 * scale
        alone = np.cos(turn) - rate * TIME_S * np.sin(turn) - np.cos(rate * TIME_S + turn)
        np.testing.assert_allclose(shown[~touched, column], alone[~touched], atol=1e-6)
        when = ahead.events[-1][1]
        at = np.array([when + 1e-5, when + 5e-4])  # free, in the frame's coordinates: faster as the frame is slower
        (begin, end) = (Hybrid(collision, one.beside).solved(at)[:, 1] for one in (ahead, back))
        in_space = (begin - end) / (2 * size) - rate * np.sin(rate * at + turn)
        np.testing.assert_allclose(in_space, after[column], atol=3e-4 * np.abs(after).max())


@pytest.mark.parametrize("place", [0, 1, 2])
def test_for_forces_alone_a_path_is_the_same_without_what_only_effects_need(place: int) -> None:
    collision, _ = CASES[place]
    whole, brief = (linear_path(collision, [], TIME_S, 2, for_forces=alone) for alone in (False, True))
    for name in ("length_s", "sample", "early", "linked", "propagator", "event_gradient", "event_jump"):
        one, other = getattr(whole, name), getattr(brief, name)
        np.testing.assert_allclose(other, one, atol=1e-9 * max(float(np.abs(one).max()), 1e-6), err_msg=name)
    inertia = 3
    known, found = (np.delete(path.weights, inertia, axis=3) for path in (whole, brief))
    np.testing.assert_allclose(found, known, atol=1e-9 * np.abs(known).max())
    assert np.isnan(brief.weights[:, :, 1, inertia]).all()
    assert brief.effect_inputs.shape == (0, *whole.effect_inputs.shape[1:])
    with_effects = [linear_path(RIG, CASES[3][1], TIME_S, for_forces=alone) for alone in (False, True)]
    np.testing.assert_array_equal(*(path.effect_inputs for path in with_effects))
