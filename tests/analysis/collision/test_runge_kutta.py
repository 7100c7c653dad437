"""The stepper's method and interpolation: the order it claims, polynomials exactly, the length of the next step."""

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from analysis.collision.solver import modes, system
from analysis.collision.solver import runge_kutta as module
from analysis.collision.solver.modes import CONTACT, FREE, NEAR_0, PHASE, PLATE, VELOCITY
from analysis.collision.solver.runge_kutta import (
    ALLOWED,
    EVER,
    HELD,
    LONGEST,
    SAFE,
    SIXTH,
    STEP,
    SWINGS,
)
from analysis.collision.solver.system import (
    DONE,
    HIDDEN,
    LEFT_FOR_GOOD,
    MAY_CONTAIN_EVENT,
    MOVES,
    NOT_FINITE,
    SLOT_COLUMNS,
    STEP_LIMIT,
    STEPS_LEFT,
    TIME,
    Ahead,
    MotionState,
    State,
)
from tests.analysis.collision.plain import made_plain


def tableau() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stages (11, 11), weights (11,) and nodes (11,) of the method."""
    table, begins, weights = module._cooper_verner()
    a = np.zeros((12, 11))
    for row, (begin, end) in enumerate(itertools.pairwise(begins), start=1):
        a[row, table[begin:end]] = weights[begin:end]
    return a[:11], a[11], a[:11].sum(axis=1)


def test_the_method_is_of_order_eight() -> None:
    a, b, c = tableau()
    for power in range(8):
        assert b @ c**power == pytest.approx(1 / (power + 1), abs=1e-12)
    for power, stages in itertools.product(range(4), range(1, 5)):  # tall trees
        value = c**power
        for _ in range(stages):
            value = a @ value
        if power + stages < 8:
            assert b @ value == pytest.approx(math.factorial(power) / math.factorial(power + stages + 1), abs=1e-12)
    # two branches: c^3 beside one that was grown over a stage, 1 / (8 * 4)
    assert b @ (c**3 * (a @ c**3)) == pytest.approx(1 / 32, abs=1e-12)
    assert b @ ((a @ c**2) * (a @ c**3)) == pytest.approx(1 / (8 * 3 * 4), abs=1e-12)
    errors = []
    for steps in (4, 8):
        y, h = np.array([1.0, 0.0]), 2.0 / steps
        for _ in range(steps):
            k = np.zeros((11, 2))
            for stage in range(11):
                at = y + h * a[stage] @ k
                k[stage] = at[1], -math.sin(at[0])
            y = y + h * b @ k
        errors.append(y)
    fine = np.array([1.0, 0.0])
    for _ in range(64):
        k = np.zeros((11, 2))
        for stage in range(11):
            at = fine + 2.0 / 64 * a[stage] @ k
            k[stage] = at[1], -math.sin(at[0])
        fine = fine + 2.0 / 64 * b @ k
    ratio = np.abs(errors[0] - fine).max() / np.abs(errors[1] - fine).max()
    assert 2**7 < ratio < 2**10


def ends(polynomial: np.polynomial.Polynomial, h: float) -> tuple[Any, Any]:
    """Return the states at 0 and ``h`` of a motion, in the second pair of the second row."""
    out = []
    for at in (0.0, h):
        z, f = np.full((2, 4), np.nan), np.full((2, 4), np.nan)
        z[1, 2:] = polynomial(at), polynomial.deriv()(at)
        f[1, 3] = polynomial.deriv(2)(at)
        z[0, 0], f[0, 0] = polynomial(at), polynomial.deriv()(at)
        out.append(SimpleNamespace(z=z, f=f))
    return out[0], out[1]


@pytest.mark.parametrize("h", [0.7, -0.4])
def test_between_steps_a_quintic_is_followed_exactly(h: float) -> None:
    quintic = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5, -3.0, 1.7])
    one, other = ends(quintic, h)
    for share in (0.0, 0.3, 0.8, 1.0):
        x, v = module._quintic.py_func(one, other, 2, 1, h, share * h)
        assert (x, v) == pytest.approx((quintic(share * h), quintic.deriv()(share * h)), rel=1e-12)
    assert module._fifth.py_func(one, other, 2, 1, h) == pytest.approx(1.7, rel=1e-10)
    cubic = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5])
    one, other = ends(cubic, h)
    for share in (0.0, 0.3, 1.0):
        assert module._cubic.py_func(one, other, 0, h, share * h) == pytest.approx(cubic(share * h), rel=1e-12)


def test_the_next_step_is_as_long_as_its_error_is_allowed() -> None:
    limits, memory = np.zeros(13), np.zeros(5)
    limits[ALLOWED], memory[LONGEST], memory[EVER] = 1e-16, 1e-6, 1e-2
    stepper: Any = SimpleNamespace(limits=limits, memory=memory)

    def longest(sixth: float, swing: float) -> float:
        memory[SIXTH] = sixth
        return float(module._longest_step.py_func(stepper, swing))

    assert longest(-1.0, 1.0) == 1e-6 and longest(0.0, 1.0) == 1e-2
    slow = (1e-16 * 64 / 5.0) ** (1 / 6)
    assert longest(5.0, 0.9 / slow) == pytest.approx(slow)
    # beyond a radian the error goes with the ninth power
    swing = 2.0 / slow
    long = longest(5.0, swing)
    assert 5.0 / 64 * long**6 * (swing * long) ** 3 == pytest.approx(1e-16)
    assert longest(1e40, 1.0) == 1e-6 and longest(1e-40, 1.0) == 1e-2


def test_the_limits_of_a_step_are_those_of_its_mode() -> None:
    def place(phase: int, plate: float, forward: bool) -> int:
        mode = np.zeros(NEAR_0)
        mode[[PHASE, PLATE]] = phase, plate
        return int(modes.rate_at.py_func(mode, forward))

    assert [place(CONTACT, 1.0, True), place(FREE, 1.0, True), place(FREE, 0.0, True)] == [0, 1, 2]
    assert place(CONTACT, 1.0, False) == 3 == place(FREE, 0.0, False)


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Let the stepper be called step by step."""
    made_plain(monkeypatch, module, modes, system)
    return monkeypatch


def stepper(rows: int, size: int, **limits: float) -> Any:
    given = np.zeros(13)
    for name, value in limits.items():
        given[getattr(module, name)] = value
    room = np.full(module.room_for(rows, size), np.nan)
    made, end = module.stepper_of(given, rows, size, room, 0)
    assert end == room.size  # all of it, and no more
    return made


def state(rows: int, size: int, fill: float = np.nan) -> State:
    return State(np.full((rows, size), fill), np.full((rows, size), fill), np.full((rows, 3), fill))


def test_a_step_carries_state_and_derivatives_and_writes_their_rates(plain: pytest.MonkeyPatch) -> None:
    """Of s' = A s with a forcing that grows with the state of another row, against the exponential."""
    random = np.random.default_rng(1)
    a, h, rows = random.standard_normal((8, 8)), 0.1, 3
    asked = []

    def of_state(at: State, _system: Any, mode: str) -> float:
        at.f[0], at.contact[0] = a @ at.z[0], 7.0
        return asked.append(mode) or 5.0  # type: ignore[func-returns-value]

    def of_derivatives(at: State, count: int, which: str, _system: Any, mode: str, mass: float) -> None:
        assert (which, mode, mass, count) == ("which", "mode", 5.0, rows)
        for row in range(1, rows):
            at.f[row] = a @ at.z[row] + row * at.z[0]

    plain.setattr(module, "state_rates", of_state)
    plain.setattr(module, "derivative_rates", of_derivatives)
    made, here, there = stepper(rows, 8), state(rows, 8), state(rows, 8)
    here = here._replace(f=made.slopes[0])
    here.z[:] = random.standard_normal((rows, 8))
    of_state(here, None, "mode")
    of_derivatives(here, rows, "which", None, "mode", 5.0)
    moving: Any = SimpleNamespace(here=here, there=there, mode="mode")
    module.step_to(made, SimpleNamespace(which="which"), moving, h, rows)
    whole = np.kron(np.eye(rows), a) + np.kron(np.outer([0, 1, 2], [1, 0, 0]), np.eye(8))
    exact = (expm(h * whole) @ here.z.ravel()).reshape(rows, 8)
    np.testing.assert_allclose(there.z, exact, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(there.f, (whole @ there.z.ravel()).reshape(rows, 8), rtol=1e-12, atol=1e-12)
    assert there.contact[0].tolist() == [7.0] * 3 and set(asked) == {"mode"}
    module.step_to(made, SimpleNamespace(which="which"), moving, -h, 1)
    np.testing.assert_allclose(there.z[0], expm(-h * a) @ here.z[0], rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(there.z[1:], exact[1:], rtol=1e-9, atol=1e-10)  # left as they were


@pytest.mark.parametrize(
    ("effects", "swing", "ever"), [(1.0, 1e3, 2e-3), (1.5e-3, 1e3, 1.5e-3), (1.0, 0.0, 1e-4), (1e-5, 1e3, 1e-4)]
)
def test_a_mode_begins_with_a_short_step_and_knows_how_long_steps_may_become(
    effects: float, swing: float, ever: float, plain: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    plain.setattr(module, "rates", lambda *given: asked.append(given))
    made = stepper(1, 8, EFFECTS=effects, SHORTEST=0.25)
    made.limits[SAFE : SAFE + 4], made.limits[SWINGS : SWINGS + 4] = 9.0, 9.0
    made.limits[SAFE + 1], made.limits[SWINGS + 1] = 1e-4, swing
    mode = np.zeros(NEAR_0)
    mode[[PHASE, PLATE]] = FREE, 1.0
    moving: Any = SimpleNamespace(here="here", mode=mode)
    given: Any = SimpleNamespace(which=np.array([3, 5]))
    assert module.begin_mode(made, given, moving, None, True)
    assert asked == [("here", 3, given.which, given, mode)]
    assert made.memory[[STEP, LONGEST, HELD, SIXTH]].tolist() == [2.5e-5, 1e-4, 0.0, -1.0]
    assert made.memory[EVER] == pytest.approx(ever)


def swinging(at: float, rate: float, sizes: tuple[float, float, float]) -> State:
    """Return a state whose block, plate and derivative swing with these sizes."""
    made = state(2, 8, 0.0)
    for row, place, size in ((0, 0, sizes[0]), (0, 2, sizes[1]), (1, 0, sizes[2])):
        made.z[row, place], made.z[row, place + 1] = size * math.sin(rate * at), size * rate * math.cos(rate * at)
        made.f[row, place + 1] = -(rate**2) * made.z[row, place]
    return made


@pytest.mark.parametrize("sizes", [(1e-6, 1e-9, 1e-9), (1e-9, 5e-5, 1e-9), (1e-9, 1e-9, 5e-4), (1e-9, -5e-5, 1e-9)])
def test_a_long_step_is_refused_where_the_quintic_between_its_ends_is_too_far_off(
    sizes: tuple[float, float, float], plain: pytest.MonkeyPatch
) -> None:
    """The plate's error counts a fiftieth, a derivative's as much as a thousandth of its parameter changes."""
    rate, h = 1e3, 3e-4
    here, there = (swinging(at, rate, sizes) for at in (-0.5 * h, 0.5 * h))
    weights = (1.0, 0.02, 1e-3 * 2.0)
    top, errors = 0.5 * math.pi / rate, []
    for (row, place), size, weight in zip(((0, 0), (0, 2), (1, 0)), sizes, weights, strict=True):
        both = (swinging(top + at, rate, sizes) for at in (-0.5 * h, 0.5 * h))  # where the sixth derivative is largest
        errors.append(weight * abs(module._quintic(*both, place, row, h, 0.5 * h)[0] - size))
    error = max(errors)

    def enough(allowed: float, known: float = 1e30, by: int = 4, **memory: float) -> tuple[bool, float]:
        made = stepper(2, 8, ALLOWED=allowed)
        made.memory[[LONGEST, EVER, SIXTH]] = 1e-4, 1e-2, known
        for name, value in memory.items():
            made.memory[getattr(module, name)] = value
        given: Any = SimpleNamespace(which=np.array([by]), p=np.array([0.0, 0.0, 0.0, 0.0, -2.0]))
        return bool(module._error_allowed(made, given, here, there, rate, h)), float(made.memory[SIXTH])

    assert enough(1.1 * error / 30)[0] and not enough(0.9 * error / 30)[0]
    sixth = 64 * error / h**6
    # the sixth derivative is remembered, the one before forgotten by half in a radian
    assert enough(1.0, known=0.0)[1] == pytest.approx(sixth, rel=0.02)
    assert enough(1.0, known=1e3 * sixth)[1] == pytest.approx(1e3 * sixth / 1.15, rel=1e-9)
    # a kink: it grows by four at once
    assert enough(1.0, known=sixth / 3.9)[0] and not enough(1.0, known=sixth / 4.1)[0]
    assert enough(0.0, LONGEST=h)[0]  # a safe step stands
    assert enough(0.0, LONGEST=2.01 * h) == (True, 1e30) == enough(0.0, EVER=1e-4)  # too short to tell
    assert enough(0.0, LONGEST=1.99 * h)[1] != 1e30
    if sizes[2] > 1e-6:
        assert enough(0.9 * error / 30, by=-1)[0]  # no parameter, no change


def test_beyond_a_radian_the_error_of_a_step_goes_with_the_ninth_power(plain: pytest.MonkeyPatch) -> None:
    plain.setattr(module, "_fifth", lambda *_: 6e6)
    given: Any = SimpleNamespace(which=np.array([], dtype=np.int64))

    def enough(swing: float, allowed: float) -> bool:
        made = stepper(1, 8, ALLOWED=allowed)
        made.memory[[LONGEST, EVER, SIXTH]] = 1e-5, 1.0, 1e30
        return bool(module._error_allowed(made, given, None, None, swing, 1e-3))

    for swing, times in ((0.9e3, 1.0), (2e3, 8.0)):
        error = 1e6 * swing * 1e-18 / 64 * times
        assert enough(swing, 1.01 * error / 30) and not enough(swing, 0.99 * error / 30)


@pytest.mark.parametrize("item", range(6))
def test_a_guard_is_crossed_where_its_sign_is_lost_or_may_have_been_between(
    item: int, plain: pytest.MonkeyPatch
) -> None:
    """Guards that dip and rise again within a step are seen, but for a block that turns twice."""
    plain.setattr(module, "guard", lambda k, at, _: at[0] if k == item else 1.0)
    plain.setattr(module, "guard_rate", lambda k, at, _: at[1] if k == item else 0.0)

    def crossed(sign: float, here: tuple[float, float], there: tuple[float, float], h: float = 1.0) -> bool:
        signs = np.zeros(6)
        signs[item] = sign
        moving: Any = SimpleNamespace(signs=signs, here=here, there=there)
        return bool(module._crossed(moving, None, h))

    for sign in (1.0, -1.0):
        assert crossed(sign, (sign, 0.0), (-0.1 * sign, 0.0)) and not crossed(sign, (sign, 0.0), (0.1 * sign, 0.0))
        dips = (0.1 * sign, -2.0 * sign), (0.1 * sign, 2.0 * sign)
        assert crossed(sign, *dips) is (item != VELOCITY) and not crossed(sign, *dips[::-1])
        assert crossed(sign, *dips[::-1], h=-1.0) is (item != VELOCITY)
    assert not crossed(0.0, (1.0, 0.0), (-1.0, 0.0)) and not crossed(0.0, (0.1, -2.0), (0.1, 2.0))


class Falling:
    """A block that falls evenly onto the plate, or away from it, stepped exactly; what was done is noted."""

    def __init__(
        self, patch: pytest.MonkeyPatch, times: list[float], *, speed: float = -1.0, gap: float = 10.0, **limits: float
    ) -> None:
        self.patch, self.steps, self.shown = patch, [], []
        given = {"GROWTH": 2.0, "NEARING": 0.0, "SHORTEST": 0.125, "ALLOWED": 1.0} | limits
        self.made = stepper(1, 4, **given)
        self.made.limits[SAFE : SAFE + 4], self.made.limits[SWINGS : SWINGS + 4] = 1.0, 0.1
        self.made.memory[:] = 1.0, 1.0, 1.0, 0.0, -1.0
        here, there = state(1, 4, 0.0), state(1, 4, 0.0)
        here.z[0] = gap, speed, 0.0, 0.0
        self.mode = np.zeros(NEAR_0)
        self.mode[[PHASE, PLATE]] = FREE, 1.0
        self.motion = MotionState(
            here, there, there, self.mode, np.array([-1.0, 0.0, 0.0, 0.0]), np.zeros((4, 2)), np.array([0.0, 0.0, 1e9]),
            np.array([-1]),
        )  # fmt: skip
        self.system: Any = SimpleNamespace(
            which=np.array([], dtype=np.int64), p=np.array([4.0, 1.0]), slots=np.zeros((0, 8))
        )
        self.record: Any = SimpleNamespace(times=np.array(times))
        self.touch(here)
        patch.setattr(module, "_step", self.step)
        patch.setattr(module, "write_samples", self.show)

    @staticmethod
    def touch(at: State) -> None:
        at.contact[0] = -at.z[0, 0], -at.z[0, 1], 0.0

    def step(self, _made: Any, _system: Any, here: State, there: State, mode: Any, h: float, rows: int) -> None:
        assert mode is self.mode and rows == 1
        self.steps.append(h)
        there.z[0] = here.z[0]
        there.z[0, 0] += h * here.z[0, 1]
        self.touch(there)

    def show(self, _made: Any, _system: Any, motion: Any, record: Any, i: int, h: float) -> int:
        way = 1 if h >= 0.0 else -1
        begin = i
        while 0 <= i < record.times.size and (record.times[i] - motion.clock[TIME]) * way <= abs(h):
            i += way
        self.shown.append((begin, i))
        return i

    def run(self, i: int = 0, *, forward: bool = True, cleared: bool = False) -> tuple[int, float, int]:
        ahead = Ahead(i, len(self.record.times) - 1 if forward else 0, forward, cleared)
        found = module.run(self.made, self.system, self.motion, self.record, ahead)
        return int(found[0]), float(found[1]), int(found[2])


def test_steps_lead_to_the_last_sample_and_grow(plain: pytest.MonkeyPatch) -> None:
    fall = Falling(plain, [0.5, 2.0, 4.0], gap=100.0)
    fall.made.memory[STEP] = 0.25
    assert fall.run() == (3, 0.0, DONE)
    assert fall.steps == [0.25, 0.5, 1.0, 1.0, 1.0, 0.25]  # twice as long each, a safe one at most
    assert fall.shown == [(0, 1), (1, 2), (2, 3)]
    assert fall.motion.clock[TIME] == 4.0 and fall.motion.here.z[0, 0] == 96.0
    assert fall.motion.clock[STEPS_LEFT] == 1e9 - 20.0 * 6
    # a step that was cut short is followed by as many as were asked for without growth
    held = Falling(plain, [40.0], gap=100.0)
    held.made.memory[[STEP, HELD]] = 0.25, 2.0
    held.run()
    assert held.steps[:5] == [0.25, 0.25, 0.25, 0.5, 1.0]
    back = Falling(plain, [-2.5, -1.0, 3.0], gap=100.0)
    back.motion.signs[0] = 0.0
    assert back.run(1, forward=False) == (-1, 0.0, DONE)
    assert back.steps == [-1.0, -1.0, -0.5] and back.motion.clock[TIME] == -2.5


def test_an_event_is_approached_in_shorter_and_shorter_steps(plain: pytest.MonkeyPatch) -> None:
    fall = Falling(plain, [50.0], gap=2.3)
    fall.motion.signs[0] = -1.0
    i, h, why = fall.run()
    assert (i, why) == (0, MAY_CONTAIN_EVENT) and h == 0.125
    assert fall.steps == [1.0, 1.0, 1.0, 0.25, 0.25, 0.125]
    assert fall.motion.clock[TIME] == 2.25 and fall.made.memory[STEP] == 0.125
    again = Falling(plain, [50.0], gap=-0.5, speed=-1.0)  # it has just been dealt with: guards are ignored for one step
    assert again.run(cleared=True)[2] == MAY_CONTAIN_EVENT and again.motion.clock[TIME] == 1.0
    # where the law is rough the bodies are approached by a share of what is left
    near = Falling(plain, [50.0], gap=2.0, NEARING=0.4)
    near.run()
    assert near.steps[:4] == pytest.approx([0.8, 0.48, 0.288, 0.1728]) and near.steps[4] == 0.125
    # a step longer than safe keeps off, too
    long = Falling(plain, [50.0], gap=10.0)
    long.made.memory[[STEP, EVER, SIXTH]] = 20.0, 20.0, 0.0
    long.run()
    assert long.steps[:2] == pytest.approx([4.0, 2.4]) and min(long.steps[:4]) >= 1.0


def test_a_run_ends_where_there_is_nothing_to_follow(plain: pytest.MonkeyPatch) -> None:
    few = Falling(plain, [50.0], gap=100.0)
    few.motion.clock[STEPS_LEFT] = 59.0
    assert few.run() == (0, 0.0, STEP_LIMIT) and len(few.steps) == 2
    for place, value in ((1, np.inf), (3, np.nan), (0, -np.inf)):
        lost = Falling(plain, [50.0], gap=100.0)
        lost.motion.signs[0], lost.mode[PHASE] = 0.0, CONTACT
        lost.motion.here.z[0, place] = value
        assert lost.run()[::2] == (0, NOT_FINITE)
    gone = Falling(plain, [50.0], gap=1.0, speed=1.0)
    gone.motion.here.z[0, 3] = 0.7  # of the plate's velocity it is not asked beforehand
    asked: list[Any] = []
    plain.setattr(module, "has_left_for_good", lambda z, mode, system, omega: asked.append((z.tolist(), omega)) or True)
    assert gone.run() == (0, 0.0, LEFT_FOR_GOOD) and not gone.steps
    assert asked == [([1.0, 1.0, 0.0, 0.7], 2.0)]
    back = Falling(plain, [-50.0], gap=1.0, speed=1.0)
    back.motion.signs[0] = 0.0
    assert back.run(forward=False)[2] == DONE  # before they have met no block has gone
    kink = Falling(plain, [8.0], gap=100.0)
    kink.motion.signs[0], kink.mode[PHASE] = 0.0, CONTACT
    kink.made.memory[[STEP, EVER, SIXTH]] = 4.0, 4.0, 0.0
    plain.setattr(module, "_error_allowed", lambda made, system, here, there, swing, h: (h <= 1.0, swing == 0.1)[0])
    kink.run()
    assert kink.steps[:3] == [4.0, 1.0, 2.0]  # repeated as a safe one


@pytest.mark.parametrize("h", [0.5, -0.5])
@pytest.mark.parametrize("columns", [5, 9])
def test_samples_within_a_step_are_shown(h: float, columns: int, plain: pytest.MonkeyPatch) -> None:
    """Block, plate and what swings by a quintic, what relaxes by a cubic; what moves the contact point moves it."""
    random = np.random.default_rng(3)
    slots = np.zeros((2, SLOT_COLUMNS))
    slots[0, [HIDDEN, MOVES]] = 1.0, 0.0
    slots[1, [HIDDEN, MOVES]] = 2.0, -3.0
    paths = [np.polynomial.Polynomial(random.standard_normal(n)) for n in (6, 6, 4, 6, 6)]  # the last is a derivative
    states = []
    for at in (0.0, h):
        made = state(2, 8, 0.0)
        for place, path in enumerate(paths[:4]):
            made.z[0, 2 * place], made.z[0, 2 * place + 1] = path(at), path.deriv()(at)
            made.f[0, 2 * place], made.f[0, 2 * place + 1] = path.deriv()(at), path.deriv(2)(at)
        made.z[1, :2], made.f[1, 1] = (paths[4](at), paths[4].deriv()(at)), paths[4].deriv(2)(at)
        states.append(made)
    way, t = (1 if h > 0 else -1), 2.0
    shares = [-0.1, 0.0, 0.4, 1.0, 1.01]
    times = t + h * np.array(shares[::way])
    mode = np.zeros(NEAR_0)
    mode[PLATE] = 1.0
    clock = np.array([t, 0.5, 0.0])
    moving: Any = SimpleNamespace(here=states[0], there=states[1], clock=clock, mode=mode)
    given: Any = SimpleNamespace(slots=slots, which=np.array([2]), p=np.array([9.0, 1.0]))
    record: Any = SimpleNamespace(times=times, states=np.full((5, columns), np.nan), d_x=np.full((5, 1), np.nan))
    begin = 1 if way > 0 else 3
    after = module.write_samples(None, given, moving, record, begin, h)
    assert after == begin + 3 * way
    for k in range(5):
        at = times[k] - t
        if k not in (1, 2, 3):
            assert np.isnan(record.states[k]).all()
            continue
        x, y, arm, swing, d_x = (path(at) for path in paths)
        v, u, w = (paths[place].deriv()(at) for place in (0, 1, 3))
        expected = [x, v, y, u, y - 3.0 * swing]
        np.testing.assert_allclose(record.states[k, :5], expected, rtol=1e-11)
        assert record.d_x[k, 0] == pytest.approx(d_x, rel=1e-11)
        if columns == 9:
            np.testing.assert_allclose(record.states[k, [5, 7, 8]], [arm, swing, w], rtol=1e-11)
    # at an instant, as where a mode ends
    at_once: Any = SimpleNamespace(times=np.array([t, t, 3.0]), states=np.zeros((3, columns)), d_x=np.zeros((3, 1)))
    assert module.write_samples(None, given, moving, at_once, 0, 0.0) == 2
    assert at_once.states[1, :4].tolist() == states[0].z[0, :4].tolist() and at_once.d_x[1, 0] == states[0].z[1, 0]
    # after the block has gone the plate swings freely since it was left
    mode[PLATE] = 0.0
    module.write_samples(None, given, moving, record, begin, h)
    y0, u0 = states[0].z[0, 2:4]
    for omega in (3.0, 0.0):
        given.p[0] = omega**2
        module.write_samples(None, given, moving, record, begin, h)
        for k in (1, 2, 3):
            since = times[k] - 0.5
            swing = math.sin(omega * since) / omega if omega else since
            y, u = (
                y0 * math.cos(omega * since) + u0 * swing,
                u0 * math.cos(omega * since) - y0 * omega * math.sin(omega * since),
            )
            np.testing.assert_allclose(record.states[k, 2:5], [y, u, y], rtol=1e-12)
