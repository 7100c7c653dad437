"""Numbers of a shot that are impossible, or that contradict one another, are flagged; others are not."""

import math
from dataclasses import replace
from typing import Any, cast

import pytest

from analysis.shot.consistency import NUMBERS_AFFECTED, fit_flags, flags_affecting, reading_flags
from analysis.shot.fit import Overlay, ShotFit
from analysis.shot.quantity import NotSeen, Quantity, Reading
from app.words.flags import FLAGS
from tests.analysis.impacts import impact_of
from tests.analysis.shots import PAPER_FIT

NO_CURVES = cast(Any, None)


def curves(*events_s: tuple[str, float]) -> Overlay:
    return Overlay(NO_CURVES, NO_CURVES, NO_CURVES, NO_CURVES, NO_CURVES, events_s)


IMPACT = impact_of(
    velocity_in_m_per_s=Quantity(-0.265, 1e-5),
    velocity_out_m_per_s=Quantity(0.2617, 1e-5),
    contact_time_s=Quantity(0.03, 7e-5),
)
OWN = ShotFit(
    Quantity(-0.265, 1e-5), Quantity(0.2617, 1e-5), Quantity(0.02, 1e-7), Quantity(0.0, 1e-9), curves(), NO_CURVES, 1.0
)
FIT = replace(PAPER_FIT, shots=(OWN,))


@pytest.mark.parametrize(
    ("ratio", "flagged"),
    [
        (Quantity(0.99, 1e-3), False),
        (Quantity(1.0019, 1e-3), False),  # by chance
        (Quantity(1.0021, 1e-3), True),  # a block that leaves faster than it came
        (Quantity(1.5, math.nan), False),
        (NotSeen("no flight"), False),
    ],
)
def test_a_restitution_above_one_is_flagged_where_noise_does_not_do_it(ratio: Reading, flagged: bool) -> None:
    flags = reading_flags(impact_of(cor_quasi_static=ratio, cor_impulse=NotSeen("interrupted")), None)
    assert flags == (("restitution_above_one",) if flagged else ())


@pytest.mark.parametrize(("apart", "agree"), [(2.9, True), (3.1, False), (-2.9, True), (-3.1, False)])
def test_two_restitutions_agree_within_three_of_both_uncertainties_together(apart: float, agree: bool) -> None:
    one, std = Quantity(0.98, 3e-4), 5e-4  # together, with 4e-4
    other = Quantity(0.98 + apart * std, 4e-4)
    flags = reading_flags(impact_of(cor_quasi_static=one, cor_impulse=other), None)
    assert flags == (() if agree else ("impulse_disagrees",))
    assert reading_flags(impact_of(cor_quasi_static=one, cor_impulse=NotSeen("interrupted")), None) == ()


@pytest.mark.parametrize(
    ("impulse_ns", "std_ns", "flagged"),
    [
        (9.4e-3, 1e-5, False),
        (9.4e-3 + 6.9e-5, 1e-5, False),  # five of both together are 7.1e-5
        (9.4e-3 + 7.2e-5, 1e-5, True),
        (9.4e-3 - 7.2e-5, 1e-5, True),
        (9.5e-3, math.nan, False),
    ],
)
def test_an_impulse_that_is_not_the_change_of_momentum_is_flagged(
    impulse_ns: float, std_ns: float, flagged: bool
) -> None:
    """A force in another unit, or a mass that is not the block's."""
    flags = reading_flags(IMPACT, (Quantity(impulse_ns, std_ns), Quantity(9.4e-3, 1e-5)))
    assert flags == (("momentum_disagrees",) if flagged else ())


@pytest.mark.parametrize(
    ("own", "fit", "flags"),
    [
        ({}, {}, ()),
        ({"velocity_in_m_per_s": Quantity(-0.265 - 6e-5, 1e-5)}, {}, ()),
        ({"velocity_in_m_per_s": Quantity(-0.265 - 8e-5, 1e-5)}, {}, ("fit_disagrees",)),
        ({"velocity_out_m_per_s": Quantity(0.2617 - 8e-5, 1e-5)}, {}, ("fit_disagrees",)),
        ({}, {"reduced_chi2": 1.9}, ()),
        ({}, {"reduced_chi2": 2.1}, ("chi2_far_from_one",)),
        ({}, {"reduced_chi2": 0.51}, ()),
        ({}, {"reduced_chi2": 0.49}, ("chi2_far_from_one",)),
        ({}, {"reduced_chi2": math.nan}, ()),
        ({"rings": True}, {}, ()),  # said by the fit itself, where no frame moves
        ({"rings": True}, {"on_frames": True}, ("knock_suspected",)),
        ({}, {"on_frames": True, "reduced_chi2": 2.1}, ("knock_suspected", "chi2_far_from_one")),
        ({}, {"converged": False, "reduced_chi2": 9.0}, ()),  # it describes nothing, and says so itself
    ],
)
def test_a_fit_is_flagged_where_it_is_not_what_was_read(
    own: dict[str, Any], fit: dict[str, Any], flags: tuple[str, ...]
) -> None:
    assert fit_flags(IMPACT, replace(FIT, shots=(replace(OWN, **own),), **fit)) == flags


@pytest.mark.parametrize(
    ("after_s", "chi2", "flags"),
    [
        (0.03, 1.0, ()),
        (0.03 + 3.4e-4, 1.0, ()),  # five of the reading's
        (0.03 + 3.6e-4, 1.0, ("contact_disagrees",)),
        (0.03 - 3.6e-4, 1.0, ("contact_disagrees",)),
        (0.025, 0.49, ("contact_disagrees", "chi2_far_from_one")),  # a wrong touch also makes the flight seem noisy
        (0.025, 2.1, ("chi2_far_from_one",)),  # the fit does not describe the shot
    ],
)
def test_a_contact_that_was_read_longer_or_shorter_than_a_good_fit_has_it_is_flagged(
    after_s: float, chi2: float, flags: tuple[str, ...]
) -> None:
    """From the first touch to the last release, whatever lies between."""
    bounces = (("touch", 0.02), ("release", 0.0203), ("touch", 0.021), ("release", 0.02 + after_s))
    own = replace(OWN, overlay=curves(*bounces))
    assert fit_flags(IMPACT, replace(FIT, shots=(own,), reduced_chi2=chi2)) == flags
    caught = replace(OWN, overlay=curves(("touch", 0.02)))
    assert fit_flags(IMPACT, replace(FIT, shots=(caught,))) == ()


def test_a_fit_of_several_shots_is_not_compared_with_one() -> None:
    both = replace(FIT, shots=(OWN, OWN), reduced_chi2=9.0)
    assert fit_flags(IMPACT, both) == ()


@pytest.mark.parametrize(("on_frames", "flags"), [(False, ("plate_shaken",)), (True, ())])
def test_a_plate_that_moved_before_it_was_touched_is_told_of_a_fit_that_had_it_at_rest(
    on_frames: bool, flags: tuple[str, ...]
) -> None:
    shaken = replace(IMPACT, flags=("vibration",))
    assert fit_flags(shaken, replace(FIT, on_frames=on_frames)) == flags


def test_a_flag_is_shown_at_the_numbers_that_it_concerns_and_has_words() -> None:
    assert flags_affecting("force_peak_n", ("wander", "momentum_disagrees", "knock")) == ("momentum_disagrees", "knock")
    assert flags_affecting("plate_mass_kg", ("momentum_disagrees",)) == ()
    assert set(NUMBERS_AFFECTED) <= set(FLAGS)
