"""First guesses: the same for every scale of the rig, whatever the record lacks, and cheap where it is plain."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible, solve
from analysis.collision.parameters import PAPER, Collision, Variant
from analysis.inference.fit import first_guesses as module
from analysis.inference.fit.first_guesses import first_guesses, rank
from analysis.inference.fit.problem import Problem
from analysis.inference.model.base import Base, OneBodyOnContact, TwoBodies, base_named
from analysis.inference.model.course import NoCollision
from analysis.inference.model.samples import averaged_shot
from analysis.shot import Cancelled
from tests.analysis.collision.simulated import shot

BASE = base_named("paper")
RATE_HZ = 1e5  # of the record: nothing is averaged


def ranked(collision: Collision, gap: slice | None = None) -> tuple[list[Collision], np.ndarray]:
    whole = averaged_shot(shot(collision, white_m=1e-10), RATE_HZ)
    valid = whole.valid.copy()
    if gap is not None:
        valid[gap] = False
    return rank(replace(whole, displacement_m=np.where(valid, whole.displacement_m, np.nan), valid=valid), BASE)


def test_a_rig_of_another_scale_has_the_same_pattern_of_bounces() -> None:
    heavy = replace(
        PAPER,
        plate_stiffness_n_per_m=2 * PAPER.plate_stiffness_n_per_m,
        contact_stiffness_n_per_m=2 * PAPER.contact_stiffness_n_per_m,
        plate_mass_kg=0.5 * PAPER.plate_mass_kg,
        block_mass_kg=0.5 * PAPER.block_mass_kg,
        velocity_in_m_per_s=2 * PAPER.velocity_in_m_per_s,
    )  # twice as fast a swing, the same ratios
    (one, *_), left_m = ranked(PAPER)
    (other, *_), other_left_m = ranked(heavy)
    ratios = [c.contact_stiffness_n_per_m / c.plate_stiffness_n_per_m for c in (one, other)]
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-9)
    shares = [c.plate_mass_kg / c.block_mass_kg for c in (one, other)]
    assert shares[0] == pytest.approx(shares[1], rel=1e-9)
    assert other_left_m[0] == pytest.approx(left_m[0], rel=0.02)  # half the time at twice the speed
    assert one.plate_mass_kg == pytest.approx(PAPER.plate_mass_kg, rel=0.6)


def test_a_gap_in_contact_is_left_out_not_filled() -> None:
    whole, left_m = ranked(PAPER)
    touch = int(0.0123456 * RATE_HZ)
    torn, torn_left_m = ranked(PAPER, slice(touch + 900, touch + 1300))
    assert torn[0] == whole[0]
    assert torn_left_m[0] < 2 * left_m[0]


def test_one_search_is_enough_where_the_pattern_of_bounces_is_plain(monkeypatch: pytest.MonkeyPatch) -> None:
    searches = []

    def counted(*arguments, **options):
        searches.append(arguments)
        return search(*arguments, **options)

    search = Problem.search
    monkeypatch.setattr(Problem, "search", counted)
    found = first_guesses(BASE, [averaged_shot(shot(PAPER))], lambda: False)
    assert len(searches) == 1
    assert found[0] == pytest.approx(PAPER.vector[:4], rel=1e-3)


@pytest.mark.parametrize(("base", "count"), [(TwoBodies(Variant.CLAMPED), 168), (OneBodyOnContact(), 3)])
def test_every_candidate_swings_on_its_plate_as_slowly_as_the_others(base: Base, count: int) -> None:
    """At 110 rad/s to a hundredth, so that a contact time tells which of them a record resembles; fast swings decay."""
    found = list(base.candidates(PAPER.block_mass_kg, PAPER.block_mass_kg * 110.0**2, PAPER.velocity_in_m_per_s))
    assert len(found) == len(set(found)) == count
    for c in found:
        assert c.variant is base.variant and c.block_mass_kg == PAPER.block_mass_kg
        spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
        mass = np.diag([c.block_mass_kg, c.plate_mass_kg])
        stiff = c.contact_stiffness_n_per_m * spring + np.diag([0.0, c.plate_stiffness_n_per_m])
        if not base.plate_moves:
            spring, mass, stiff = spring[:1, :1], mass[:1, :1], stiff[:1, :1]
        squares, ways = np.linalg.eig(np.linalg.solve(mass, stiff))
        assert np.sqrt(squares.min()) == pytest.approx(110.0, rel=0.01)
        way = ways[:, squares.argmax()]
        damping = c.contact_damping_n_s_per_m * (way @ spring @ way) / (way @ mass @ way) / (2 * np.sqrt(squares.max()))
        assert min(abs(damping / share - 1.0) for share in (0.04, 0.15, 0.4)) < 0.07


def test_a_candidate_is_scaled_to_a_shots_mass_time_and_speed() -> None:
    course = averaged_shot(shot(PAPER)).course
    faster = replace(course, velocity_in_m_per_s=-0.4, rate_rad_per_s=330.0)
    candidate = replace(PAPER, variant=Variant.NO_TENSION)
    scaled = module._scaled(candidate, faster, 2.0 * PAPER.block_mass_kg)
    time_s = np.linspace(-2e-3, 0.04, 900)
    slow, fast = solve(candidate, (), time_s), solve(scaled, (), time_s / 3.0)
    ratio = -0.4 / PAPER.velocity_in_m_per_s / 3.0
    np.testing.assert_allclose(fast.displacement_m, ratio * slow.displacement_m, rtol=1e-9, atol=1e-13)
    assert scaled.block_mass_kg == 2.0 * PAPER.block_mass_kg and scaled.variant is Variant.NO_TENSION


def test_of_a_shot_the_contact_with_a_little_flight_is_fitted() -> None:
    whole = replace(averaged_shot(shot(PAPER)), weight=3.0, sway="a frame's")  # type: ignore[arg-type]
    near, course = module._contact_of(whole), whole.course
    begin = course.touch_time_s - 0.1 * course.contact_time_s
    end = course.touch_time_s + 1.25 * course.contact_time_s
    inside = (whole.centre_s >= begin) & (whole.centre_s < end)
    np.testing.assert_array_equal(near.centre_s, whole.centre_s[inside])
    np.testing.assert_array_equal(near.displacement_m, whole.displacement_m[inside])
    assert near.time_s.size == near.used.size == near.factor * near.centre_s.size and near.valid.size == inside.sum()
    np.testing.assert_allclose(near.averaged(near.time_s), near.centre_s)
    assert near.weight == 1.0 and near.sway is None and near.course is course


def test_with_several_plates_the_contact_is_that_of_most_shots_and_each_plate_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    base = replace(BASE, plates=3)
    shots = [replace(averaged_shot(shot(PAPER)), plate_number=k) for k in (0, 1, 1, 2)]

    def of_plate(one, those, *_):  # type: ignore[no-untyped-def]
        assert one.plates == 1 and all(s.plate_number == 0 for s in those)
        asked.append(len(those))
        return [10.0 * len(asked) + np.arange(4.0), None]

    asked: list[int] = []
    found = module._plate_by_plate
    monkeypatch.setattr(module, "first_guesses", of_plate)
    shared = found(base, shots, lambda: False, 0.0)
    assert asked == [1, 2, 1]
    # stiffness and mass of the first plate, the contact of the second plate's shots, then the further plates
    assert shared.tolist() == [10.0, 11.0, 22.0, 23.0, 20.0, 21.0, 30.0, 31.0]


def guessed(
    monkeypatch: pytest.MonkeyPatch, left_m: list[float | None], sways_m: float = 0.0, factors: tuple[float, ...] = ()
) -> tuple[list[float], list[float]]:
    """Return the contacts guessed (over PAPER's stiffness) and searched, where searches leave so many m of noise.

    The candidates leave 1 um each before they are searched.
    """
    stiff = PAPER.contact_stiffness_n_per_m
    ratios = factors or tuple(1.0 + k for k in range(len(left_m)))
    ranked = [replace(PAPER, contact_stiffness_n_per_m=stiff * ratio) for ratio in ratios]
    monkeypatch.setattr(module, "rank", lambda *_: (ranked, np.full(len(ranked), 1e-6)))
    monkeypatch.setattr(module, "side_by_side", lambda of, some: [of(one) for one in some])
    asked: list[float] = []

    def search(problem: Problem, z: np.ndarray, *, evaluations: int, **_: Any) -> Any:
        assert evaluations == 18
        ratio = problem.unpack(z).base[2] / stiff
        asked.append(float(ratio))
        left = left_m[int(np.argmin(np.abs(np.array(ratios) - ratio)))]
        if left is None:
            raise Infeasible("none")
        white = problem.noise.white_m
        return SimpleNamespace(parameters=z, square=SimpleNamespace(chi2=100 * (left / white) ** 2, samples=100))

    monkeypatch.setattr(Problem, "search", search)
    found = first_guesses(BASE, [averaged_shot(shot(PAPER))], lambda: False, sways_m)
    return [float(shared[2] / stiff) for shared in found], asked


@pytest.mark.parametrize(
    ("left_m", "sways_m", "enough"),
    [
        (0.029e-6, 0.0, True),  # of a wrong sequence's residual
        (0.031e-6, 0.0, False),
        (0.09e-6, 0.1e-6, True),  # no more than the frame's own motion
        (0.11e-6, 0.1e-6, False),
        (0.19e-6, 5e-6, True),  # a fifth at most, however the frame moves
        (0.21e-6, 5e-6, False),
    ],
)
def test_a_first_candidate_that_leaves_little_is_the_only_one(
    monkeypatch: pytest.MonkeyPatch, left_m: float, sways_m: float, enough: bool
) -> None:
    found, asked = guessed(monkeypatch, [left_m, 0.5e-6, 0.6e-6], sways_m)
    tried = pytest.approx([1.0] if enough else [1.0, 2.0, 3.0])
    assert found == tried and asked == tried


def test_six_candidates_are_searched_and_those_that_end_apart_are_kept_best_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, asked = guessed(monkeypatch, [4e-7, 3e-7, None, 6e-7, 5e-7, 2e-7, 1e-7])
    assert asked == pytest.approx([1, 2, 3, 4, 5, 6]) and found == pytest.approx([6, 2, 1, 5, 4])
    near, _ = guessed(monkeypatch, [4e-7, 3e-7, 5e-7], factors=(1.0, 1.029, 1.07))
    assert near == pytest.approx([1.029, 1.07])  # the first is within three hundredths of the second
    with pytest.raises(NoCollision, match="no trajectory of the base model resembles"):
        guessed(monkeypatch, [None, None])
    monkeypatch.setattr(module, "rank", lambda *_: ([], np.empty(0)))
    with pytest.raises(NoCollision, match="no trajectory of the base model resembles"):
        first_guesses(BASE, [averaged_shot(shot(PAPER))], lambda: False)


def test_guesses_end_where_someone_stops_them_and_the_fastest_shot_is_looked_at() -> None:
    slow, fast = (averaged_shot(shot(PAPER.at_speed(v))) for v in (-0.15, -0.3))
    with pytest.raises(Cancelled):
        first_guesses(BASE, [slow], lambda: True)
    assert module._fastest([slow, fast]) is fast and module._fastest([fast, slow]) is fast
    some = module.resembling_candidates(BASE, [slow, fast], 3)
    np.testing.assert_array_equal(some, [BASE.shared(one) for one in rank(fast, BASE)[0][:3]])
    assert module.resembling_candidates(BASE.on_plates(2), [slow, fast], 3) == []
