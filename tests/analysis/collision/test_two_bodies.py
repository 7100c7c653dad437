"""Two bodies stepped from sample to sample, or from mean to mean: as far as nothing may happen, and no further."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from analysis.collision.solver import modes, two_bodies
from analysis.collision.solver.matrices import STEP_S
from analysis.collision.solver.modes import CONTACT, FREE, NEAR_0, OVERLAP, OVERLAP_RATE, PHASE, PLATE, VELOCITY
from analysis.collision.solver.system import Ahead
from tests.analysis.collision.plain import made_plain

H = 0.05
# four numbers that swing and decay, and a constant force
A = np.array(
    [[0, 1, 0, 0, 0], [-2, -0.1, 0.5, 0.2, 0.3], [0, 0, 0, 1, 0], [0.7, 0.1, -3, -0.2, -0.4], [0, 0, 0, 0, 0.0]]
)
BEGIN = np.array([0.2, 1.0, -0.3, 0.4, 1.0])
NEVER = np.array([0, 0, 0, 0, 1.0])


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    made_plain(monkeypatch, two_bodies, modes)


def at(count: float) -> np.ndarray:
    """Return the state after so many steps."""
    return np.asarray(expm(A * H * count) @ BEGIN)


def glided(
    guards: dict[int, np.ndarray], *, forward: bool = True, block: int = 1, samples: int = 24, phase: int = CONTACT,
    times: np.ndarray | None = None, signs: dict[int, float] | None = None, begin: int | None = None,
) -> Any:  # fmt: skip
    """Return the next sample, the time, the state and what was shown, stepped with these guards as rows."""
    h = H if forward else -H
    rows = np.zeros((5, 5))
    for item, row in guards.items():
        rows[item] = row
    e, shown = expm(A * h), np.vstack([np.eye(5)[:4], [1, 0, 2, 0, 3]])
    mean = np.mean([shown @ expm(A * h * k) for k in range(1, block + 1)], axis=0)
    steps = np.zeros(4)
    steps[STEP_S] = h
    form = SimpleNamespace(
        e=e, whole=expm(A * h * block), guard=rows, guard_rate=rows @ A, mean=mean, steps=steps
    )  # fmt: skip
    mode = np.zeros(NEAR_0)
    mode[[PHASE, PLATE]] = phase, 1.0
    signed = np.zeros(5)
    for item in guards:
        signed[item] = (signs or {}).get(item, 1.0)
    motion = SimpleNamespace(signs=signed, mode=mode)
    active = np.array([len(guards), *guards, *[0] * 3])
    if times is None:
        times = H * np.arange(1, samples + 1) if forward else -H * np.arange(samples, 0, -1)
    record: Any = SimpleNamespace(
        times=times, block=block, states=np.full((len(times) // block, 5), np.nan), d_x=None
    )  # fmt: skip
    z = BEGIN[:, None].copy()
    last = len(times) - 1 if forward else 0
    if begin is None:
        begin = 0 if forward else len(times) - 1
    i, t = two_bodies.step_two_bodies(z, form, motion, active, record, Ahead(begin, last, forward, False), 0.0)
    return int(i), float(t), z[:, 0], record.states


@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("guards", [{}, {OVERLAP: NEVER}, {OVERLAP: NEVER, VELOCITY: NEVER}])
def test_where_nothing_happens_every_sample_is_shown(guards: dict[int, np.ndarray], forward: bool) -> None:
    i, t, z, shown = glided(guards, forward=forward)
    way = 1 if forward else -1
    assert i == (24 if forward else -1) and t == pytest.approx(24 * H * way)
    np.testing.assert_allclose(z, at(24 * way), rtol=1e-12)
    exact = np.array([at(k * way)[[0, 1, 2, 3, 2]] for k in range(1, 25)])  # the contact point is the plate
    np.testing.assert_allclose(shown, exact[::way], rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("guards", [{}, {OVERLAP: NEVER}, {OVERLAP: NEVER, VELOCITY: NEVER}])
@pytest.mark.parametrize("samples", [24, 26])
def test_where_nothing_happens_every_mean_is_shown(samples: int, guards: dict[int, np.ndarray], forward: bool) -> None:
    """What does not fill a mean is left to be stepped by itself."""
    begin = None if forward else 23
    times = None if forward else np.concatenate([-H * np.arange(24, 0, -1), np.arange(samples - 24) + 1.0])
    i, t, z, shown = glided(guards, forward=forward, block=4, samples=samples, times=times, begin=begin)
    way = 1 if forward else -1
    assert i == (24 if forward else -1) and t == pytest.approx(24 * H * way)
    np.testing.assert_allclose(z, at(24 * way), rtol=1e-11)
    rows = np.vstack([np.eye(5)[:4], [1, 0, 2, 0, 3]])
    exact = np.array([np.mean([rows @ at(way * (4 * b + k)) for k in (1, 2, 3, 4)], axis=0) for b in range(6)])
    np.testing.assert_allclose(shown[: len(exact)], exact[::way], rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("begin", [1, 2])
def test_means_begin_where_a_block_does(begin: int) -> None:
    times = H * (np.arange(24) - begin + 1.0)
    assert glided({}, block=4, times=times, begin=begin)[:2] == (begin, 0.0)
    assert glided({}, block=4, times=-times[::-1], begin=23 - begin, forward=False)[:2] == (23 - begin, 0.0)


@pytest.mark.parametrize("block", [1, 4])
@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("place", [0, 1])  # of the two that are watched
@pytest.mark.parametrize("item", [OVERLAP, OVERLAP_RATE, VELOCITY])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_before_a_guard_passes_zero_it_stops(sign: float, item: int, place: int, forward: bool, block: int) -> None:
    way, when = (1 if forward else -1), 9.5
    row = np.array([0.3, -0.2, 0.5, 0.1, 0.0])
    row[4] = -row @ at(way * when)  # zero between the ninth step and the tenth
    row *= sign * np.sign(row @ BEGIN)
    before = [np.sign(sign * row @ at(way * k)) for k in range(13)]
    assert before == [1.0] * 10 + [-1.0] * 3
    other = VELOCITY if item != VELOCITY else OVERLAP
    guards = {item: row, other: NEVER} if place == 0 else {other: NEVER, item: row}
    i, t, z, shown = glided(guards, forward=forward, block=block, signs={item: sign})
    steps = 9 if block == 1 else 8
    assert i == (steps if forward else 23 - steps) and t == pytest.approx(way * steps * H)
    np.testing.assert_allclose(z, at(way * steps), rtol=1e-11)
    assert np.isfinite(shown).all(axis=1).sum() == steps // block


@pytest.mark.parametrize("block", [1, 4])
@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("item", [OVERLAP, OVERLAP_RATE, VELOCITY])
@pytest.mark.parametrize("steps", [0, 8])
def test_it_stops_before_a_guard_that_falls_and_rises_within_a_step(
    steps: int, item: int, place: int, forward: bool, block: int
) -> None:
    """Of the velocity two zeros within one step are not looked for."""
    way = 1 if forward else -1
    lowest = at(way * (steps + 0.5 * block))
    # a guard whose rate is zero there, and that is far from zero everywhere
    row = np.linalg.lstsq(np.array([A @ lowest, A @ A @ lowest]), np.array([0.0, 1.0]), rcond=None)[0]
    row[4] += 1.0 - min(row @ at(way * k) for k in np.arange(0, 24, 0.25))
    other = VELOCITY if item != VELOCITY else OVERLAP
    guards = {item: row, other: NEVER} if place == 0 else {other: NEVER, item: row}
    i = glided(guards, forward=forward, block=block)[0]
    passed = steps if item != VELOCITY else 24
    assert i == (passed if forward else 23 - passed)


@pytest.mark.parametrize("block", [1, 4])
def test_it_stops_where_the_times_become_uneven(block: int) -> None:
    for place, moved in ((13, 1e-12), (13, -1e-12), (12, 1e-9)):
        times = H * np.arange(1, 25)
        times[place:] += moved
        assert glided({}, times=times, block=block)[0] == (place if block == 1 else 12 if place == 12 else 16)


@pytest.mark.parametrize("block", [1, 4])
def test_it_stops_where_the_block_may_have_gone(block: int) -> None:
    x, y = (np.array([at(k)[place] for k in range(0, 25, block)]) for place in (0, 2))
    first = int(np.argmax(x > 2e-5 + 1.5 * np.abs(y)))
    assert first > 0
    assert glided({}, phase=FREE, block=block)[0] == first * block
    assert glided({}, phase=CONTACT, block=block)[0] == 24
    assert glided({}, phase=FREE, block=block, forward=False)[0] == -1  # before they have met none has
    assert math.isclose(glided({}, phase=FREE, block=block)[1], first * block * H)
