"""The stepper in closed form: how long its steps are, which modes it knows, what it may not step over, and its end."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from analysis.collision.solver import exponentials, matrices, modes, system, two_bodies
from analysis.collision.solver import propagator as module
from analysis.collision.solver.matrices import SLOW, STEP_S, STEPS_PER_SAMPLE, TERMS
from analysis.collision.solver.modes import CONTACT, FREE, NEAR_0, OVERLAP, PHASE, PLATE, VELOCITY
from analysis.collision.solver.propagator import CHECKED_BLOCK, MODES_MET, PRESENT, STEPS_TO_SAMPLE
from analysis.collision.solver.system import (
    DONE,
    LEFT_FOR_GOOD,
    MAY_CONTAIN_EVENT,
    NOT_FINITE,
    STEP_LIMIT,
    STEPS_LEFT,
    TIME,
    Ahead,
)
from tests.analysis.collision.plain import made_plain

N = 5
H = 5e-4
A = 100.0 * np.array([[0, 1, 0, 0, 0], [-2, 0, 0.5, 0, 0.3], [0, 0, 0, 1, 0], [0.7, 0, -3, 0, -0.4], [0, 0, 0, 0, 0.0]])
BEGIN = np.array([0.2, 1.0, -0.3, 0.4, 1.0])


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    made_plain(monkeypatch, module, exponentials, matrices, modes, system, two_bodies)
    return monkeypatch


def record_of(times: np.ndarray, block: int = 1, count: int = 0, shown: int = 5) -> Any:
    rows = times.size // block
    return SimpleNamespace(
        times=times, block=block, states=np.zeros((rows, shown)), d_x=np.zeros((rows, count))
    )  # fmt: skip


def stepper_of(
    record: Any, count: int = 0, slots: int = 0, swings: tuple[float, ...] = (7.0, 5.0, 3.0, 2.0, 0.0)
) -> Any:
    made = SimpleNamespace(numbers=4, which=np.arange(count), slots=np.zeros((slots, 8)))
    size = module.room_for(4, count, slots, record.states.shape[1])
    room = np.zeros(size)
    stepper, at = module.stepper_of(made, record, np.array(swings), room, 0)
    assert size - 4 <= at <= size
    return stepper


@pytest.mark.parametrize(
    ("times", "spacing_s"),
    [
        ([0.5], 1e-3),
        ([0.0, 2e-4, 4e-4, 6e-4], 2e-4),
        ([0.0, 2e-4, 4.0000000003e-4], 2.00000000015e-4),  # even: the mean of all is known better
        ([0.0, 2e-4, 9e-4], 2e-4),
        ([0.0, 0.0, 0.25], 5e-7),  # no shorter than a solution may take
        ([-0.25, -0.25, 0.1], 5e-7),
        ([0.0, 0.0, 1e-5], 2e-9),
        ([0.03, 0.0300000001, 0.0300000002], 6.00000004e-8),
    ],
)
def test_the_spacing_of_times_is_their_mean_or_that_of_the_first(times: list[float], spacing_s: float) -> None:
    assert module._spacing(np.array(times)) == pytest.approx(spacing_s, rel=1e-13)
    record = record_of(np.array(times))
    assert stepper_of(record).spacing_s == pytest.approx(spacing_s, rel=1e-13)
    assert stepper_of(record, swings=(1.0, 1.0, 1.0, 1.0, 7e-5)).spacing_s == 7e-5  # as it was told


def test_a_stepper_knows_no_mode_and_no_place_to_be_careful() -> None:
    made = stepper_of(record_of(np.arange(3.0)), count=2, slots=1)
    assert made.every.tolist() == [-1] * 4 + [0, 1] and made.at.tolist() == [0, 0, 0, -1]
    assert made.z.shape == (2, N, 4) and made.z[:, -1, 0].tolist() == [1.0, 1.0]
    assert made.modes.shape == (16, NEAR_0 + 1) and made.active.size == 6
    assert made.kept.a.shape == made.kept.whole.shape == (16, N, N) and made.plain.z.shape == (7, 4)


@pytest.mark.parametrize(
    ("phase", "plate", "forward", "swing"),
    [(CONTACT, 1.0, True, 7.0), (FREE, 1.0, True, 5.0), (FREE, 0.0, True, 3.0), (FREE, 0.0, False, 2.0)],
)
@pytest.mark.parametrize("block", [1, 2])
def test_steps_are_as_long_as_the_fastest_rate_of_the_mode_allows(
    phase: int, plate: float, forward: bool, swing: float, block: int, plain: pytest.MonkeyPatch
) -> None:
    plain.setattr(module, "linearise", lambda form, *_: form.a.__setitem__(slice(None), A) is None)
    mode = np.zeros(NEAR_0)
    mode[[PHASE, PLATE]] = phase, plate
    for radians, pieces in ((0.69, 1), (0.71, 2), (1.39, 2), (1.41, 3)):
        spacing = 1e-4
        record = record_of(spacing * np.arange(8), block)
        rate = radians / spacing
        made = stepper_of(record, swings=(*(rate if one == swing else 1e9 for one in (7.0, 5.0, 3.0, 2.0)), 0.0))
        form = matrices.form_at(made.kept, 0)
        form.guard[:] = 0.0
        form.guard[OVERLAP] = [-1.0, 0.0, 1.5, 0.0, 0.25]
        laid: Any = SimpleNamespace(which=np.array([], dtype=int))
        assert module._linearise_mode(made, form, laid, mode, block, forward)
        step = (spacing if forward else -spacing) / pieces
        assert form.steps[STEPS_PER_SAMPLE] == pieces and form.steps[STEP_S] == pytest.approx(step)
        np.testing.assert_allclose(form.e, expm(A * step), rtol=1e-12, atol=1e-15)
        slow = not (plate > 0.5 and radians * block > 0.7)
        assert form.steps[SLOW] == float(slow) and form.steps[TERMS] > 6
        contact_point = [0.0, 0.0, 1.0, 0.0, 0.25 if plate else 0.0]  # the block's place plus the overlap, or the plate
        np.testing.assert_allclose(form.shown, [*np.eye(N)[:4], contact_point])
        if block > 1 and pieces == 1:
            np.testing.assert_allclose(form.whole, expm(2 * A * step), rtol=1e-12, atol=1e-15)
    long = stepper_of(record_of(np.arange(4.0) * 2.5e-3), swings=(1e-9,) * 4 + (0.0,))
    form = matrices.form_at(long.kept, 0)
    module._linearise_mode(long, form, laid, mode, 1, forward)
    assert form.steps[STEPS_PER_SAMPLE] == 3  # a millisecond at most
    plain.setattr(module, "linearise", lambda *_: False)
    assert not module._linearise_mode(long, form, laid, mode, 1, forward)


def test_a_mode_is_learned_once_and_the_oldest_forgotten(plain: pytest.MonkeyPatch) -> None:
    made = stepper_of(record_of(np.arange(4.0)), count=1)
    learned: list[int] = []
    plain.setattr(module, "_linearise_mode", lambda *given: learned.append(int(given[0].at[PRESENT])) or True)
    here = SimpleNamespace(z=np.array([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]]))
    laid: Any = SimpleNamespace(which=np.array([3]), numbers=4)

    def arm(flag: float) -> int:
        mode = np.zeros(NEAR_0)
        mode[-1] = flag
        made.at[STEPS_TO_SAMPLE] = 9
        moving: Any = SimpleNamespace(here=here, mode=mode, signs=np.array([0.0, 1.0, 0.0, -1.0]))
        assert module.begin_mode(made, laid, moving, record_of(np.arange(4.0)), True)
        assert made.at[STEPS_TO_SAMPLE] == 0 and made.active[:3].tolist() == [2, 1, 3]
        np.testing.assert_allclose(made.z[0, :4, :2], here.z.T)
        assert made.z[0, 4, 0] == 1.0
        return int(made.at[PRESENT])

    assert [arm(flag) for flag in (0.0, 1.0, 0.0, 1.0, 2.0)] == [0, 1, 0, 1, 2] and learned == [0, 1, 2]
    assert [arm(float(flag)) for flag in range(3, 17)] == [*range(3, 16), 0] and made.at[MODES_MET] == 17
    assert arm(16.0) == 0 and arm(1.0) == 1 and arm(0.0) == 1 and len(learned) == 18  # the first was forgotten


class Path:
    """A stepper in a mode that it knows, with a state and guards of which nothing is to pass zero."""

    def __init__(
        self, times: np.ndarray, *, block: int = 1, count: int = 0, swing: float = 100.0, phase: int = CONTACT,
        begin: np.ndarray = BEGIN, forward: bool = True,
    ) -> None:  # fmt: skip
        self.record = record_of(times, block, count)
        self.made = stepper_of(self.record, count, swings=(swing,) * 4 + (0.0,))
        self.mode = np.zeros(NEAR_0)
        self.mode[[PHASE, PLATE]] = phase, 1.0
        self.laid: Any = SimpleNamespace(
            which=np.arange(count), numbers=4, slots=np.zeros((0, 8)), p=np.array([3.0, 1.0])
        )  # fmt: skip
        form = matrices.form_at(self.made.kept, 0)
        form.guard[:] = [0.0, 0.0, 0.0, 0.0, 1.0]
        form.guard[OVERLAP] = [-1.0, 0.0, 1.0, 0.0, 0.0]
        form.guard_rate[:] = 0.0
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "linearise", lambda form, *_: form.a.__setitem__(slice(None), A) is None)
            module._linearise_mode(self.made, form, self.laid, self.mode, block, forward)
        self.form = form
        self.made.z[0, :, 0] = begin
        here = SimpleNamespace(z=np.zeros((1 + count, 4)))
        self.motion: Any = SimpleNamespace(
            here=here, mode=self.mode, signs=np.zeros(4), clock=np.array([0.0, 0.0, 1e9])
        )  # fmt: skip
        self.forward = forward

    def run(self, i: int = 0, *, cleared: bool = False) -> tuple[int, float, int]:
        size = self.record.block * (self.record.times.size // self.record.block)
        ahead = Ahead(i, size - 1 if self.forward else 0, self.forward, cleared)
        found = module.run(self.made, self.laid, self.motion, self.record, ahead)
        return int(found[0]), float(found[1]), int(found[2])

    def watch(self, item: int, row: np.ndarray) -> None:
        self.motion.signs[item] = 1.0
        self.form.guard[item], self.form.guard_rate[item] = row, row @ A
        self.made.active[:2] = 1, item


@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("count", [0, 2])
@pytest.mark.parametrize(("spacing", "swing"), [(H, 100.0), (H, 4000.0)])  # one step to a sample, and three
def test_every_sample_is_shown_with_its_derivatives(spacing: float, swing: float, count: int, forward: bool) -> None:
    way = 1.0 if forward else -1.0
    times = np.sort(way * spacing * np.arange(1, 9))
    path = Path(times, count=count, swing=swing, forward=forward)
    path.form.by[:] = 0.0
    for k in range(count):
        path.made.z[0, :, 1 + k] = [1.0, 0.5 * k, 0.0, 0.2, 0.0]
    assert path.run(0 if forward else 7)[::2] == (8 if forward else -1, DONE)
    exact = np.array([expm(A * t) @ BEGIN for t in times])
    np.testing.assert_allclose(path.record.states[:, :4], exact[:, :4], rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(path.record.states[:, 4], exact @ path.form.shown[4], rtol=1e-11)
    for k in range(count):
        slope = np.array([(expm(A * t) @ [1.0, 0.5 * k, 0.0, 0.2, 0.0])[0] for t in times])
        np.testing.assert_allclose(path.record.d_x[:, k], slope, rtol=1e-11)
    assert path.motion.clock[TIME] == pytest.approx(way * 8 * spacing)
    np.testing.assert_allclose(path.motion.here.z[0], exact[7 if forward else 0][:4], rtol=1e-11)


def test_steps_are_counted_and_a_solution_without_an_end_is_left() -> None:
    path = Path(H * np.arange(1, 40), count=1, swing=4000.0)
    path.form.by[:] = 0.0
    path.motion.clock[STEPS_LEFT] = 20.0
    i, _, why = path.run()
    assert why == STEP_LIMIT and i == 5  # three steps and the sample itself
    done = Path(H * np.arange(1, 4), count=1, swing=4000.0)
    done.form.by[:] = 0.0
    assert done.run()[2] == DONE and done.motion.clock[STEPS_LEFT] == 1e9 - 12.0


@pytest.mark.parametrize("item", [OVERLAP, VELOCITY])
@pytest.mark.parametrize("count", [0, 1])
def test_it_ends_before_a_guard_passes_zero(count: int, item: int) -> None:
    path = Path(H * np.arange(1, 20), count=count)
    path.form.by[:] = 0.0
    row = np.array([0.3, -0.2, 0.5, 0.1, 0.0])
    row[4] = -row @ expm(A * H * 6.5) @ BEGIN
    row *= np.sign(row @ BEGIN)
    path.watch(item, row)
    assert path.run() == (6, pytest.approx(H), MAY_CONTAIN_EVENT)
    np.testing.assert_allclose(path.motion.here.z[0], (expm(A * 6 * H) @ BEGIN)[:4], rtol=1e-11)
    again = Path(H * np.arange(1, 20), count=count)
    again.form.by[:] = 0.0
    again.watch(item, -row)  # it has just been dealt with
    assert again.run(cleared=True)[2] == MAY_CONTAIN_EVENT and again.motion.clock[TIME] == pytest.approx(H)


def test_a_guard_that_dips_within_a_step_is_seen_of_the_contact_alone() -> None:
    path = Path(H * np.arange(1, 20))
    signs = np.array([1.0, 0.0, 0.0, -1.0])

    def crosses(values: tuple[float, float], slopes: tuple[float, float], item: int, h: float = 1.0) -> bool:
        path.made.active[:2] = 1, item
        form: Any = SimpleNamespace(guard=np.zeros((4, N)), guard_rate=np.zeros((4, N)))
        form.guard[item, 0], form.guard_rate[item, 1] = signs[item], signs[item]
        z, end = (
            np.array([[value], [slope], [0.0], [0.0], [1.0]]) for value, slope in zip(values, slopes, strict=True)
        )
        return bool(module._crosses(z, end, h, form, path.made.active, signs))

    for item in (OVERLAP, VELOCITY):
        assert crosses((1.0, -0.1), (0.0, 0.0), item) and not crosses((1.0, 0.1), (0.0, 0.0), item)
        assert crosses((0.1, 0.1), (-2.0, 2.0), item) is (item == OVERLAP)
        assert crosses((0.1, 0.1), (2.0, -2.0), item, -1.0) is (item == OVERLAP)
        assert not crosses((0.1, 0.1), (2.0, -2.0), item) and not crosses((1.1, 1.1), (-2.0, 2.0), item)
    path.made.active[0] = 0
    assert not module._crosses(None, None, 1.0, None, path.made.active, signs)


def test_a_run_ends_where_the_block_has_gone_or_the_motion_runs_away(plain: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    plain.setattr(module, "has_left_for_good", lambda z, mode, laid, omega: asked.append((z.tolist(), omega)) or True)
    for count in (0, 1):
        gone = Path(H * np.arange(1, 9), phase=FREE, count=count)
        gone.form.by[:] = 0.0
        begin = [1.0, 1.0, 0.1, 0.0, 1.0]
        gone.made.z[0, :, 0] = begin
        if count:
            gone.made.z[0, :4, 1] = 7.0
        assert (
            gone.run()[::2] == (0, LEFT_FOR_GOOD) and gone.motion.here.z.tolist() == [begin[:4]] + [[7.0] * 4] * count
        )
        assert asked[-1] == (begin[:4], pytest.approx(np.sqrt(3.0)))
    back = Path(-H * np.arange(8, 0, -1), phase=FREE, forward=False)
    assert back.run(7)[2] == DONE
    for place in (0, 1, 3):
        lost = Path(H * np.arange(1, 9), count=1)
        lost.form.by[:] = 0.0
        lost.made.z[0, place, 0] = np.inf
        with np.errstate(invalid="ignore"):
            assert lost.run()[2] == NOT_FINITE


@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("count", [0, 2])
@pytest.mark.parametrize("swing", [100.0, 600.0])  # within a mean nothing is fast, or something may be
def test_means_are_taken_whole_where_nothing_happens_and_sample_by_sample_elsewhere(
    swing: float, count: int, forward: bool
) -> None:
    """A guard that passes zero within the third mean: the two before are whole, of it what comes before."""
    way = 1.0 if forward else -1.0
    times = np.sort(way * H * np.arange(1, 17))
    path = Path(times, block=4, count=count, swing=swing, forward=forward)
    path.form.by[:] = path.form.d[:] = path.form.d_whole[:] = path.form.d_mean[:] = 0.0
    slopes = np.array([[1.0, 0.5, 0.0, 0.2, 0.0], [0.0, -1.0, 0.3, 0.0, 0.0]])[:count]
    for k, slope in enumerate(slopes):
        path.made.z[0, :, 1 + k] = slope
    row = np.array([0.3, -0.2, 0.5, 0.1, 0.0])
    row[4] = -row @ expm(A * way * H * 10.5) @ BEGIN
    row *= np.sign(row @ BEGIN)
    path.watch(OVERLAP, row)
    i, h, why = path.run(0 if forward else 15)
    assert (i, why) == (10 if forward else 5, MAY_CONTAIN_EVENT) and h == pytest.approx(way * H)
    every = np.array([expm(A * t) for t in times])
    states = every @ BEGIN
    blocks = [0, 1] if forward else [3, 2]
    for b in blocks:
        np.testing.assert_allclose(path.record.states[b, :4], states[4 * b : 4 * b + 4].mean(axis=0)[:4], rtol=1e-10)
        for k, slope in enumerate(slopes):
            np.testing.assert_allclose(path.record.d_x[b, k], (every @ slope)[4 * b : 4 * b + 4, 0].mean(), rtol=1e-10)
    part = slice(8, 10) if forward else slice(6, 8)
    b = 2 if forward else 1
    np.testing.assert_allclose(path.record.states[b, :4], states[part, :4].sum(axis=0) / 4, rtol=1e-10)
    assert path.made.at[CHECKED_BLOCK] in (8, 7, -1)
