"""What is asked of a residual, worked out by hand on small ones."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2 as of_chance

from analysis.diagnosis.evidence import lack_of_fit
from analysis.diagnosis.evidence import residual as module
from analysis.diagnosis.evidence.lack_of_fit import (
    NO_MISFIT,
    LackOfFit,
    _after_turn,
    _apart,
    _inside,
    _kinks,
    _pushed,
    free_laws,
    gain,
    hats,
    low_frequency_excess,
    shared,
)
from analysis.diagnosis.evidence.residual import (
    Residual,
    _bumps,
    _coherence,
    _correlation,
    _line,
    _phase_of,
    _ratio,
    errors,
    remainder_of,
    residual_of,
)
from analysis.diagnosis.findings.criteria import CRITERIA, may_beat
from analysis.diagnosis.findings.result import Freedom, Phase
from analysis.inference import Arrow

COURSE = SimpleNamespace(
    touch_time_s=0.010, contact_time_s=0.010, turnaround_time_s=0.016, release_time_s=0.020, velocity_in_m_per_s=-0.2
)


def shot_of(count: int = 3000, spacing_s: float = 1e-5, **more: Any) -> Any:
    given = {
        "centre_s": spacing_s * np.arange(count), "valid": np.ones(count, dtype=bool), "course": COURSE,
        "spacing_s": spacing_s, "weight": 1.0, "without_frame_motion": lambda _floor, left: left,
    }  # fmt: skip
    return SimpleNamespace(**(given | more))


@pytest.mark.parametrize(
    ("changes", "rough", "significant", "missed"),
    [
        ({}, False, False, 0.0),
        ({"correlation": 0.149}, False, False, 0.0),
        ({"correlation": 0.151}, True, True, 0.0),
        ({"ratio": 2.49}, False, False, 0.0),
        ({"ratio": 2.51}, True, True, 0.0),
        ({"coherence": 10.1, "size": 3.0}, False, True, 3.0),
        ({"coherence": 9.9}, False, False, 0.0),
        ({"misfit": LackOfFit(Freedom.PLACE, 20.0, 19.0, 4)}, False, True, 4.0),
        ({"misfit": LackOfFit(Freedom.PLACE, 20.0, 21.0, 4)}, False, False, 0.0),
        ({"misfit": LackOfFit(Freedom.PLACE, 20.0, 19.0, 4), "coherence": 11.0, "size": 7.0}, False, True, 7.0),
    ],
)
def test_a_residual_is_more_than_noise_where_one_of_its_tests_says_so(
    changes: dict[str, Any], rough: bool, significant: bool, missed: float
) -> None:
    left = replace(Residual(0.0, 10.0, 0.0, 1.0), **changes)
    assert (left.rough, left.significant, left.unexplained_norms) == (rough, significant, missed)


@pytest.mark.parametrize(("samples", "limit"), [(200, 20.0), (10_000, 28.0 + math.log(10_000))])
def test_a_freedom_is_faint_below_the_scatter_of_chi2_and_what_a_law_must_bring(samples: int, limit: float) -> None:
    """The chi^2 of two hundred samples scatters by twenty, a law of ten thousand must bring 37."""
    limit = math.sqrt(limit)
    for share, is_faint in ((0.99, True), (1.01, False)):
        left = Residual(0.0, 10.0, 0.0, 1.0, misfit=LackOfFit(Freedom.BEND, (share * limit) ** 2 + 4, 1.0, 4))
        assert replace(left, samples=samples).faint is is_faint
        assert not replace(left, samples=samples, correlation=1.0).faint
        assert not replace(left, samples=samples, coherence=11.0).faint
    assert not Residual(0.0, 10.0, 0.0, 1.0, samples=samples).faint


def test_the_correlation_is_the_largest_of_twenty_lags_the_first_three_by_half() -> None:
    random = np.random.default_rng(1)
    white = random.standard_normal(20_000)

    def alike(lag: int, weight: float) -> list[np.ndarray]:
        out = white.copy()
        out[lag:] += weight * white[:-lag]
        return [out[:9000], out[9000:]]

    for lag, times in ((2, 0.5), (3, 0.5), (4, 1.0), (20, 1.0), (21, 0.0)):
        expected = times * 0.5 / 1.25
        assert _correlation(alike(lag, -0.5)) == pytest.approx(expected, abs=0.02)
    neighbours = alike(2, 0.3)
    assert low_frequency_excess(neighbours) == pytest.approx(1.0 + 2.0 * 0.3 / 1.09, abs=0.08)
    assert low_frequency_excess(alike(3, -0.5)) == 1.0 == pytest.approx(low_frequency_excess(alike(4, 0.5)), abs=0.08)


def test_the_ratio_is_of_the_loudest_phase_to_the_quietest() -> None:
    shot = shot_of()
    phases = dict(_phase_of(shot))
    white = np.ones(3000)
    white[phases[Phase.LOADING]] = 3.0
    white[phases[Phase.FLIGHT_OUT]] = 0.5
    assert _ratio([white], [shot]) == pytest.approx(36.0)
    valid = shot.valid.copy()
    valid[np.flatnonzero(phases[Phase.LOADING])[:-40]] = False  # too few are left to tell
    thinned = shot_of(valid=valid)
    assert _ratio([white[valid]], [thinned]) == pytest.approx(4.0)
    assert _ratio([white[:0]], [shot_of(valid=np.zeros(3000, dtype=bool))]) == 1.0


def test_bumps_are_raised_cosines_that_reach_one_at_their_knots() -> None:
    shot = shot_of()
    bumps = _bumps(shot)
    knots = [-1.0, -0.5, 0.0, 0.03, 0.07, 0.12, 0.2, 0.32, 0.46, 0.6, 0.75, 0.9, 1.0]
    last = (shot.centre_s[-1] - 0.01) / 0.01
    knots += [1 + (last - 1) * k / 3 for k in (1, 2, 3)]
    assert bumps.shape == (3000, len(knots))
    u = (shot.centre_s - 0.01) / 0.01
    for k, knot in enumerate(knots):
        assert bumps[np.argmin(np.abs(u - knot)), k] == pytest.approx(1.0, abs=0.02)
        if k:
            between = np.argmin(np.abs(u - 0.5 * (knot + knots[k - 1])))
            assert bumps[between, [k - 1, k]] == pytest.approx([0.5, 0.5], abs=0.06)
    np.testing.assert_allclose(bumps.sum(axis=1), 1.0, atol=1e-12)


def test_kinks_are_steps_and_bends_at_touch_turn_and_release() -> None:
    shot = shot_of()
    kinks = _kinks(shot)
    assert kinks.shape == (3000, 18)
    for k, place in enumerate((0.010, 0.016, 0.020)):
        for j, width in enumerate((0.01, 0.03, 0.1)):
            step, bend = kinks[:, 6 * k + 2 * j], kinks[:, 6 * k + 2 * j + 1]
            u = (shot.centre_s - place) / (width * 0.01)
            far = np.abs(u) > 20
            np.testing.assert_allclose(step[far], 0.5 * np.sign(u[far]))
            np.testing.assert_allclose(bend[far], np.abs(u[far]))
            near = np.abs(u) < 0.5  # the bend's slope is the step, twice
            np.testing.assert_allclose(np.gradient(bend, u)[near], 2 * step[near], atol=0.02)
    after = _after_turn(shot)
    assert after[1600] == pytest.approx(0.5) and after[1700] == pytest.approx(1 / (1 + math.exp(-2)), rel=1e-6)
    assert after[0] < 1e-9 and after[-1] > 1 - 1e-9
    assert _inside(np.array([1.0, -1.0, 2.0, -3.0, 4.0])).tolist() == [0, 1, 1, 1, 0]
    assert not _inside(np.ones(4)).any()
    assert hats(np.array([-1.0, 0.5, 2.5]), [0.0, 1.0, 3.0]).tolist() == [[1, 0, 0], [0.5, 0.5, 0], [0, 0.25, 0.75]]


def test_a_force_pushes_a_free_block_and_swings_one_on_a_spring() -> None:
    spacing_s, count = 1e-5, 4000
    time_s = spacing_s * np.arange(count)
    force = np.stack([np.full(count, 3.0), np.cos(40.0 * time_s)], axis=1)
    out = np.empty_like(force)
    _pushed(force, 0.5, 1e4, np.zeros(count), spacing_s, out)
    np.testing.assert_allclose(out[:, 0], 0.5 * 6.0 * time_s**2, rtol=1e-2, atol=1e-8)
    np.testing.assert_allclose(out[:, 1], 2.0 * (1 - np.cos(40.0 * time_s)) / 40.0**2, atol=2e-6)
    _pushed(force, 0.5, 1e4, np.ones(count), spacing_s, out)
    turn = math.sqrt(1e4 / 0.5)
    np.testing.assert_allclose(out[:, 0], 3.0 / 1e4 * (1 - np.cos(turn * time_s)), atol=2e-6)


def fit_of(shots: list[Any], left: list[np.ndarray], noise_m: float) -> Any:
    return SimpleNamespace(
        problem=SimpleNamespace(data=SimpleNamespace(shots=shots)), noise=SimpleNamespace(white_m=noise_m),
        residual_m=left, whitened=lambda: [one / noise_m for one in left],
    )  # fmt: skip


@pytest.mark.parametrize("power", [0.0, 1.0, 2.0])
def test_a_remainder_has_its_size_its_phases_and_its_power_of_the_speed(power: float) -> None:
    noise_m, speeds, weights = 1e-10, (0.1, 0.2, 0.4), (1.0, 2.0, 0.5)
    random = np.random.default_rng(2)
    shots, left = [], []
    for speed, weight in zip(speeds, weights, strict=True):
        course = SimpleNamespace(**{**vars(COURSE), "velocity_in_m_per_s": -speed})
        shot = shot_of(course=course, weight=weight)
        size = 20e-9 * (speed / 0.2) ** power
        signal = size * np.where(dict(_phase_of(shot))[Phase.UNLOADING], 3.0, 1.0)
        left.append(signal * random.choice([-1.0, 1.0], 3000) + weight * noise_m * random.standard_normal(3000))
        shots.append(shot)
    found = remainder_of(fit_of(shots, left, noise_m))
    sizes = [20e-9 * (speed / 0.2) ** power for speed in speeds]
    share = np.mean(np.where(dict(_phase_of(shots[0]))[Phase.UNLOADING], 9.0, 1.0))
    assert found.rms_m == pytest.approx(math.sqrt(share * np.mean(np.square(sizes))), rel=0.01)
    assert found.speed_power == pytest.approx(power, abs=0.02) and found.noise_m == noise_m
    assert found.phases[0] == (Phase.UNLOADING, pytest.approx(3 * math.sqrt(np.mean(np.square(sizes))), rel=0.02))
    assert len(found.phases) == 3 and found.looks_like is None and found.norms == 0.0
    near = fit_of([shots[0], replace_speed(shots[0], 0.114)], left[:2], noise_m)
    assert remainder_of(near).speed_power is None
    assert remainder_of(fit_of([shots[0], replace_speed(shots[0], 0.116)], left[:2], noise_m)).speed_power is not None


def replace_speed(shot: Any, speed: float) -> Any:
    course = SimpleNamespace(**{**vars(shot.course), "velocity_in_m_per_s": -speed})
    return SimpleNamespace(**{**vars(shot), "course": course})


def test_errors_are_pooled_over_the_samples_of_all_shots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "derivatives", lambda x, rate, band: (rate * x, band * x))
    random = np.random.default_rng(3)
    motions, shots, models, sums, chi2 = [], [], [], np.zeros((3, 2)), 0.0
    for count, mass in ((30, 0.5), (50, 2.0)):
        x, v, a, model = random.standard_normal((4, count))
        used = random.uniform(size=count) > 0.3
        v[3] = np.nan
        motions.append(
            SimpleNamespace(
                displacement_m=x, velocity_m_per_s=v, acceleration_m_per_s2=a, moving_mass_kg=mass, sample_rate_hz=2.0,
                bandwidth_hz=3.0,
            )
        )  # fmt: skip
        shots.append(
            SimpleNamespace(
                used=used, averaged=lambda m: m, left_m=lambda m, x=x: x - m, whitened=lambda floor, rest: rest / floor
            )
        )
        models.append(model)
        for k, left in enumerate((x - model, v - 2.0 * model, mass * (a - 3.0 * model))):
            good = left[used & np.isfinite(left)]
            sums[k] += np.sum(good**2), good.size
        chi2 += float(np.sum(((x - model) / 0.1) ** 2))
    given: Any = (motions, shots, models, 0.1, 7)
    found = errors(*given)
    rms = np.sqrt(sums[:, 0] / sums[:, 1])
    assert [found.displacement_rms_m, found.velocity_rms_m_per_s, found.force_rms_n] == pytest.approx(rms.tolist())
    assert found.reduced_chi2 == pytest.approx(chi2 / (80 - 7))


def test_a_criterion_may_be_reached_where_each_round_gains_as_much_as_all_before() -> None:
    # from 100 to 90: one round more leads to 80, two to 60
    assert may_beat(80.1, 90.0, 100.0) and not may_beat(80.0, 90.0, 100.0)
    assert may_beat(60.1, 90.0, 100.0, 2) and not may_beat(60.0, 90.0, 100.0, 2)
    assert may_beat(90.1, 90.0, 100.0, 0) and not may_beat(90.0, 90.0, 100.0, 0)
    assert CRITERIA.fall(1) == 10.0 and CRITERIA.fall(20) == pytest.approx(10 + 2 * math.log(20))
    assert CRITERIA.fall(0, wandering=True) == 22.0
    assert [CRITERIA.size_of_one(of) for of in (0, 1, 2, 3, 4)] == [5.0, 5.0, 12.0, 30.0, 30.0]


def test_a_shape_that_all_shots_share_is_sought_at_three_powers_of_the_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    speeds = (0.1, 0.4)
    shots = [shot_of(course=SimpleNamespace(**{**vars(COURSE), "velocity_in_m_per_s": -speed})) for speed in speeds]
    bumps = [_bumps(shot) for shot in shots]
    asked: list[Any] = []
    values = [3.0, 50.0, 20.0]

    def gained(fitted: Any, at: Any, shapes: Arrow) -> Any:
        asked.append(shapes)
        assert at == "at" and shapes.shared == bumps[0].shape[1]
        return values[len(asked) - 1], 11 + len(asked), "floor"

    monkeypatch.setattr(module, "gain", gained)
    fitted: Any = fit_of(shots, [], 1.0)
    at: Any = "at"
    best, limit, width = _coherence(fitted, at)
    for power, shapes in enumerate(asked):
        for block, bump, speed in zip(shapes.blocks, bumps, speeds, strict=True):
            np.testing.assert_allclose(block, bump * (speed / 0.4) ** power)
    assert len(asked) == 3 and (best, width) == (50.0, 14)
    assert limit == pytest.approx(1.35 * of_chance.isf(1e-3 / 3, 14))  # of three shapes each has a third of the chance
    asked.clear()
    values = [-3.0, -2.0, -1.0]
    assert _coherence(fitted, at)[0] == 0.0


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("over", [True, False])
def test_a_residual_is_tested_whole(over: bool, moves: bool, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a moving frame under the noise of the flights, of uncertain strengths: chance gains three times more."""
    white = [np.full(5, 2.0)] * count
    limit = 40.0 * 1.5 * (3.0 if moves else 1.0)
    at: Any = SimpleNamespace(under=lambda noise: ("under", noise))
    data = SimpleNamespace(shots=["shot"] * count, site=SimpleNamespace(moves=moves))
    fitted: Any = SimpleNamespace(
        problem=SimpleNamespace(data=data), unlearned_noise="flights", whitened=lambda: white
    )  # fmt: skip
    used = ("under", "flights") if moves else at
    monkeypatch.setattr(module, "_correlation", lambda given: 0.01 if given is white else None)
    monkeypatch.setattr(module, "_ratio", lambda given, shots: 1.2 if given is white and shots is data.shots else None)
    monkeypatch.setattr(module, "low_frequency_excess", lambda given: 1.5 if given is white else None)
    coherence = limit + (1.0 if over else -1.0)
    monkeypatch.setattr(module, "_coherence", lambda one, at: (coherence, 40.0, 9) if at == used else None)
    monkeypatch.setattr(module, "largest_misfit", lambda *given: given)
    found = residual_of(fitted, at)
    assert (found.correlation, found.ratio, found.samples) == (0.01, 1.2, 5 * count)
    assert found.misfit == (fitted, at, used, 1.5)
    if count == 1:
        assert (found.coherence, found.limit, found.size) == (0.0, math.inf, 0.0)
        return
    assert (found.coherence, found.limit) == (coherence, limit)
    assert found.size == (pytest.approx(math.sqrt(coherence - 9)) if over else 0.0)


def test_a_line_is_told_where_it_stands_out_of_what_noise_does() -> None:
    """Twelve times the median of three shots' power, or more where chance reaches further: of one shot 20."""
    random = np.random.default_rng(6)
    spacing_s, count = 5e-5, 2000
    time_s = spacing_s * np.arange(count)

    def line(amplitude: float, hertz: float, shots: int = 3) -> float | None:
        white = [
            random.standard_normal(count) + amplitude * np.sin(2 * np.pi * hertz * time_s + k) for k in range(shots)
        ]
        longer = [np.append(one, 1e3 * np.ones(70 * k)) for k, one in enumerate(white)]  # beyond the shortest shot
        made = [shot_of(len(one), spacing_s) for one in longer]
        fitted: Any = SimpleNamespace(
            problem=SimpleNamespace(data=SimpleNamespace(shots=made)), whitened=lambda: longer
        )
        return _line(fitted)

    for hertz in (430.0, 3170.0, 60.0):
        assert line(0.8, hertz) == pytest.approx(hertz, abs=10.0)
    assert line(0.0, 430.0) is None and line(0.8, 10.0) is None  # fewer than three periods are no line
    # of Hann's window the peak is A^2 n^2 / 16, the noise's mean 3 n / 8, its median ln 2 of it in one shot
    for shots in (1, 3):
        median = of_chance.ppf(0.5, 2 * shots) / 2 * 3 * count / 8
        least = max(12.0, of_chance.isf(1e-3 / (count / 2 - 2), 2 * shots) / of_chance.ppf(0.5, 2 * shots)) * median
        amplitude = math.sqrt(least * 16 / shots) / count
        assert line(1.5 * amplitude, 2000.0, shots) == pytest.approx(2000.0, abs=10.0)
        assert line(0.6 * amplitude, 2000.0, shots) is None


def test_what_shapes_gain_is_told_by_the_noise_that_is_left_beside_them() -> None:
    """Base and starts give way to the shapes; the noise is learned from what both leave."""
    random = np.random.default_rng(7)
    tangents = [random.standard_normal((20, 2)) for _ in range(2)]
    shapes = Arrow.of([random.standard_normal((20, 3)) for _ in range(2)], 3)
    whole = random.standard_normal(40)
    columns, moving = np.vstack(shapes.blocks), np.vstack(tangents)
    basis = np.linalg.qr(moving)[0]

    def beside(rows: np.ndarray) -> np.ndarray:
        return np.asarray(rows - basis @ (basis.T @ rows))

    seen = beside(columns)
    projected = SimpleNamespace(
        new=np.array([True, True, False]), solve=lambda left: np.linalg.lstsq(seen, left, rcond=None)[0]
    )  # fmt: skip
    learned: list[Any] = []

    def learn_noise(left: Any, noise: Any) -> Any:
        learned.append((left, noise))
        return "new floor", 130.0

    shot = SimpleNamespace(whitened=lambda noise, block: block)
    at: Any = SimpleNamespace(
        noise="noise", whole=whole, left=beside(whole), lines=[(None, one) for one in tangents],
        basis=SimpleNamespace(projected_columns=lambda whitened: projected),
        tangents=SimpleNamespace(
            solve=lambda left: np.linalg.lstsq(moving, left, rcond=None)[0], places=[np.arange(2)] * 2
        ),
    )  # fmt: skip
    fitted: Any = SimpleNamespace(
        problem=SimpleNamespace(data=SimpleNamespace(shots=[shot, shot]), learn_noise=learn_noise), noise="noise",
        log_likelihood=100.0, residual_m=[whole[:20], whole[20:]],
    )  # fmt: skip
    assert gain(fitted, at, shapes) == (60.0, 2, "new floor")
    ((left, noise),) = learned
    exact = np.linalg.lstsq(np.hstack([moving, columns]), whole, rcond=None)[0]
    np.testing.assert_allclose(np.concatenate(left), whole - np.hstack([moving, columns]) @ exact, atol=1e-9)
    assert noise == "noise"
    at.noise = "of flights"  # another noise than the fit's stays as it is: the fall of chi^2 itself
    value, width, floor = gain(fitted, at, shapes)
    fall = float(at.left @ at.left - np.sum((at.left - seen @ np.linalg.lstsq(seen, at.left, rcond=None)[0]) ** 2))
    assert (value, width, floor) == (pytest.approx(fall), 2, "of flights")
    projected.new = np.zeros(3, dtype=bool)
    assert gain(fitted, at, shapes) == (0.0, 0, "noise")


def test_parameters_apart_are_free_in_all_shots_but_the_last() -> None:
    blocks = [np.arange(8.0).reshape(2, 4) + 10 * k for k in range(3)]
    found = _apart(Arrow.of(blocks, 3), slice(1, 3))
    assert [block.shape for block in found.blocks] == [(2, 2)] * 3 and found.shared == 0
    np.testing.assert_array_equal(found.blocks[1], blocks[1][:, 1:3])
    assert not found.blocks[2].any()
    together = shared([np.ones((2, 3)), np.ones((4, 3))])
    assert together.shared == together.size == 3


def test_free_laws_push_the_block_as_their_argument_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces in hats over the speed, the place and the bend of all shots, against or one way."""
    noted: list[Any] = []

    def pushed(force: Any, mass: float, stiffness: float, touching: Any, spacing: float, out: Any) -> None:
        noted.append((force.copy(), mass, stiffness, touching.tolist(), spacing))
        out[:] = force * mass

    monkeypatch.setattr(lack_of_fit, "_pushed", pushed)
    place = [np.array([4.0, 1.0, -2.0, 1.0, 3.0]), np.array([2.0, 1.0, -1.0, 0.0, 8.0])]
    speed = [np.array([-4.0, -4.0, -1.0, 2.0, 2.0]), np.array([-1.0, -1.0, 0.0, 1.0, 1.0])]
    gaps = [np.array([1.0, -1.0, 1.0, -1.0, 1.0]), np.array([1.0, 1.0, -1.0, 1.0, 1.0])]
    runs = [
        SimpleNamespace(displacement_m=x + 0.5, velocity_m_per_s=v, gap_m=gap)
        for x, v, gap in zip(place, speed, gaps, strict=True)
    ]  # fmt: skip
    shots = [SimpleNamespace(moving_mass_kg=mass, spacing_s=2e-5 * mass) for mass in (2.0, 3.0)]
    problem: Any = SimpleNamespace(
        data=SimpleNamespace(shots=shots), run=lambda i, point, *, coarse: runs[i] if coarse else None
    )
    own = [np.array([0.0, 0.0, 0.5])] * 2  # the offset is no place
    point: Any = SimpleNamespace(base=np.array([200.0, 1.0]), own=own)
    laws = free_laws(problem, point)
    assert list(laws) == [
        Freedom.SPEED_AGAINST_MOTION, Freedom.SPEED_ONE_WAY, Freedom.PLACE, Freedom.BEND, Freedom.BEND_AGAINST_MOTION,
    ]  # fmt: skip
    knots = {
        "speed": [0.0, 0.15, 0.35, 0.65, 1.0],
        "place": [0.0, 0.08, 0.2, 0.45, 1.0],
        "bend": [0.0, 0.25, 0.5, 0.75, 1.0],
    }
    touching = [[0, 1, 1, 1, 0], [0, 0, 1, 0, 0]]
    for k, (x, v) in enumerate(zip(place, speed, strict=True)):
        inside = np.array(touching[k], dtype=float)
        of_speed, of_place, of_bend = (
            np.stack([np.interp(u, knots[name], unit) for unit in np.eye(5)], axis=1)
            for name, u in (("speed", np.abs(v) / 4.0), ("place", x / 8.0), ("bend", -x / 2.0))
        )
        bent = of_bend[:, 1:] * inside[:, None]  # no bend, no force
        way = np.sign(v)[:, None]
        expected = (way * of_speed, of_speed, of_place, bent, way * bent)
        for (name, columns), force in zip(laws.items(), expected, strict=True):
            np.testing.assert_allclose(columns[k], force * shots[k].moving_mass_kg, err_msg=str(name))
    for k, (_, mass, stiffness, touch, spacing) in enumerate(noted):
        shot = shots[k // 5]
        assert (mass, stiffness, touch, spacing) == (shot.moving_mass_kg, 200.0, touching[k // 5], shot.spacing_s)
    assert NO_MISFIT.size == 0.0 and LackOfFit(Freedom.PLACE, 20.0, 9.0, 4).size == 4.0
