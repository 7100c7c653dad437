"""What a motion record from elsewhere, or one without a collision, is said to lack."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.reading.record_checks import _reversed, _speed, check_collision, describe_motion, describe_reversal
from analysis.shot.motion import Motion
from analysis.shot.shot import AnalysisError
from tests.analysis.synthetic_collision import Synthetic, motion_from

RIG = Synthetic(rate_hz=1e4, bandwidth_hz=1e3)
TIME_S = np.arange(0.0, 0.1, 1 / RIG.rate_hz)
DOWN = 0.2 * np.abs(TIME_S - 0.05)  # falls to its turn and rises


def record(x: Any, wavelength_m: float | None = None, **changes: Any) -> Motion:
    whole = motion_from(TIME_S, x, RIG)
    return replace(whole, **{"wavelength_m": wavelength_m, "displacement_std_m": np.full(TIME_S.size, 1e-6), **changes})


def test_a_record_from_elsewhere_has_to_state_a_mass_and_fall_towards_its_turn() -> None:
    check_collision(record(DOWN))
    check_collision(record(-DOWN, 633e-9))  # of the optics it is told otherwise
    with pytest.raises(AnalysisError, match="moving_mass_kg: not stated"):
        check_collision(record(DOWN, moving_mass_kg=float("nan")))
    with pytest.raises(AnalysisError, match="reverse its sign"):
        check_collision(record(-DOWN))


@pytest.mark.parametrize(("lasts_s", "right"), [(0.9e-6, False), (1.1e-6, True), (599.0, True), (601.0, False)])
def test_a_record_of_less_than_a_microsecond_or_more_than_ten_minutes_has_another_unit(
    lasts_s: float, right: bool
) -> None:
    time_s = 3.0 + TIME_S * lasts_s / TIME_S[-1]
    if right:
        check_collision(record(DOWN, time_s=time_s))
    else:
        with pytest.raises(AnalysisError, match="1000 samples over"):
            check_collision(record(DOWN, time_s=time_s))


def test_a_motion_is_reversed_whose_one_turn_is_a_top_that_stands_out() -> None:
    assert _reversed(-DOWN, 1e-6) and not _reversed(DOWN, 1e-6)
    holed = np.where(np.arange(TIME_S.size) % 7 == 0, np.nan, -DOWN)
    assert _reversed(holed, 1e-6)
    assert not _reversed(np.concatenate([-DOWN, DOWN]), 1e-6)  # the lowest point lies inside
    assert not _reversed(TIME_S, 1e-6)
    for noise, clear in ((0.9, True), (1.1, False)):  # twenty of it
        assert _reversed(-DOWN, noise * 0.01 / 20.0) is clear
    for part, clear in ((0.04, False), (0.07, True)):  # of the whole path, beyond the higher end
        late = np.where(0.1 * (1 - part) > TIME_S, TIME_S, 0.2 * (1 - part) - TIME_S)
        assert _reversed(late, 1e-6) is clear and _reversed(late[::-1], 1e-6) is clear


def test_of_the_optics_the_slower_flight_tells_whether_time_or_the_sense_is_reversed() -> None:
    for out, said in ((0.9, "the sense is reversed"), (1.1, "time runs backwards")):
        x = np.where(TIME_S < 0.05, TIME_S, 0.05 - out * (TIME_S - 0.05))
        told = describe_reversal(record(x, 633e-9))
        assert told is not None and said in told
        assert describe_reversal(record(-x, 633e-9)) is None
        assert describe_reversal(record(x)) is None
    for known, told_of in ((199, False), (200, True)):
        x = np.full(TIME_S.size, np.nan)
        x[:known] = -np.abs(np.arange(known) - known // 2)
        assert (describe_reversal(record(x, 633e-9)) is not None) is told_of


def test_a_speed_is_that_of_the_flight_though_a_contact_is_slower() -> None:
    slowed = np.concatenate([0.3 * np.arange(0, 700), 0.3 * 700 + 0.1 * np.arange(300)]) * 1e-4
    assert _speed(slowed, 1e4) == pytest.approx(0.3, rel=1e-9)
    assert _speed(-slowed, 2e4) == pytest.approx(0.6, rel=1e-9)
    assert _speed(slowed[:1], 1e4) == 0.0


@pytest.mark.parametrize(("travel_m", "rests"), [(0.9e-4, True), (1.1e-4, False)])
def test_a_block_that_goes_less_than_a_tenth_of_a_millimetre_stands_still(travel_m: float, rests: bool) -> None:
    said = describe_motion(record(travel_m * TIME_S / TIME_S[-1], 633e-9))
    assert ("stands still" in said) is rests and ("leaves the plate" in said) is not rests
    for known in (199, 200):
        x = np.where(np.arange(TIME_S.size) < known, -TIME_S, np.nan)
        assert ("at 1 m/s: the record ends" in describe_motion(record(x, 633e-9))) is (known == 200)
