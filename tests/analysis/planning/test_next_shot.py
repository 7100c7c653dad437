"""The shots that may be asked for: their settings, words, effort and order."""

import itertools
import math
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.collision.effects import effects_named
from analysis.planning.next_shot import (
    NextShot,
    Reach,
    contact_s,
    effort,
    first_indistinguishable,
    in_order,
    next_shots,
    on_the_rig,
    shots_in_words,
    usual_flights,
)

BARE, LADEN = NextShot(0.2, 0.0, 0.01, 0.02), NextShot(0.2, 0.05, 0.01, 0.02)
LONG = NextShot(0.35, 0.0123456, 0.0123, 0.0456, True)


def sample(
    touch_s: float, release_s: float, end_s: float, mass_kg: float = 0.02, plate: int = 0, begin_s: float = 0.0
) -> Any:
    course = SimpleNamespace(touch_time_s=touch_s, release_time_s=release_s, contact_time_s=release_s - touch_s)
    return SimpleNamespace(course=course, centre_s=[begin_s, 0.5, end_s], moving_mass_kg=mass_kg, plate_number=plate)


def test_a_shot_in_words_and_in_a_file() -> None:
    assert BARE.words == "0.2 m/s"
    assert LONG.words == (
        "0.35 m/s with 12.35 g added, recorded from 12 ms before the touch to 46 ms after the contact"
    )
    assert LONG.to_json() == {
        "speed_m_per_s": 0.35, "added_mass_kg": 0.0123456, "before_s": 0.0123, "after_s": 0.0456, "words": LONG.words,
    }  # fmt: skip
    assert shots_in_words((BARE, LADEN, BARE)) == "Two shots at 0.2 m/s and one shot at 0.2 m/s with 50 g added"
    assert shots_in_words((BARE,) * 6) == "Six shots at 0.2 m/s" and shots_in_words((BARE,) * 7) == "7 shots at 0.2 m/s"


def test_effort_counts_shots_changes_of_weights_and_longer_records() -> None:
    assert effort((), 0.0) == 0.0
    assert effort((BARE, LADEN, LADEN, BARE), 0.0) == 4 + 0.5 * 2
    assert effort((BARE, LADEN, LADEN, BARE), 0.05) == 4 + 0.5 * 3
    assert effort((LONG,), LONG.added_mass_kg + 0.9e-5) == 1.1 and effort((LONG,), LONG.added_mass_kg - 1.1e-5) == 1.6
    every = set(itertools.permutations((LADEN, BARE, LADEN)))
    assert in_order((LADEN, BARE, LADEN), 0.0) == (BARE, LADEN, LADEN)
    assert in_order((LADEN, BARE, LADEN), 0.05) == (LADEN, LADEN, BARE)
    assert effort(in_order((LADEN, BARE, LADEN), 0.0), 0.0) == min(effort(one, 0.0) for one in every)


def test_every_speed_and_weight_may_be_asked_for_as_usual_and_where_it_helps_at_full_length() -> None:
    shots = [sample(0.011, 0.03, 0.07, begin_s=0.001), sample(0.05, 0.08, 0.5)]
    assert usual_flights(shots) == pytest.approx((0.01, 0.04))
    assert usual_flights([sample(0.001, 0.5, 0.503)]) == (2e-3, 5e-3)
    found = next_shots(shots, Reach((0.1, 1.0), (0.0, 0.05), run_up_m=5e-3, after_s=0.06))
    slow, fast = 0.95 * 5e-3 / 0.1, 0.95 * 5e-3
    expected = []
    for speed, before, further in ((0.1, 0.01, slow), (1.0, fast, fast)):
        for added in (0.0, 0.05):
            expected += [(speed, added, before, 0.04, False), (speed, added, further, 0.06, True)]
    assert [(s.speed_m_per_s, s.added_mass_kg, s.before_s, s.after_s, s.longer) for s in found] == [
        pytest.approx(one) for one in expected
    ]
    # a full length less than three tenths more is no other shot; a flight before of more than 0.1 s is not asked for
    assert [s.longer for s in next_shots(shots, Reach((0.475,), (0.0,), 5e-3, 0.0549))] == [False]
    assert [s.longer for s in next_shots(shots, Reach((0.475,), (0.0,), 5e-3, 0.0551))] == [False, True]
    assert next_shots(shots, Reach((0.01,), (0.0,), 0.1, 0.06))[1].before_s == 0.1
    assert next_shots([sample(0.3, 0.4, 0.45)], Reach((0.01,), (0.0,), 0.1, 0.3))[1].before_s == 0.3
    assert next_shots(shots, Reach((0.1,), (0.0,), 5e-3, 0.02))[0].after_s == 0.02


def test_a_contact_lasts_as_on_the_plate_that_is_on_the_rig_with_the_mass_of_the_shot() -> None:
    shots = [sample(0.01, 0.02, 0.1, 0.018, 1), sample(0.01, 0.05, 0.1, 0.02, 2), sample(0.01, 0.03, 0.1, 0.03, 2)]
    assert on_the_rig(shots) == shots[1:]
    assert contact_s(LADEN, shots) == pytest.approx(0.04 * math.sqrt((0.018 + 0.05) / 0.02))


def test_the_first_effect_with_other_names_is_what_is_undecided() -> None:
    one, two, three, four, five = effects_named(
        ("viscous_drag", "tilt", "block_mode", "coulomb_friction", "sensor_drift")
    )
    sure = SimpleNamespace(effect=five, indistinguishable_from=())
    unsure = SimpleNamespace(effect=one, indistinguishable_from=(two, three, four, five))
    other = SimpleNamespace(effect=two, indistinguishable_from=(one,))

    def of(*effects: Any) -> tuple[Any, ...]:
        given: Any = SimpleNamespace(effects=effects)
        return first_indistinguishable(given)

    assert of(sure, unsure, other) == (one, two, three, four) and of(other, unsure) == (two, one)
    assert of(sure) == () == of()
