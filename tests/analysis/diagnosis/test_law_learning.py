"""Laws off the catalogue, from a generator of its own, learned from three shots; and none where there is none."""

import math
from collections.abc import Sequence

import pytest

from analysis.diagnosis.diagnose import diagnose
from analysis.diagnosis.result import Diagnosis, Verdict
from analysis.motion import Motion
from tests.law_rigs import LawRig, nothing


def told(motions: Sequence[Motion]) -> Diagnosis:
    return diagnose(motions)


def test_a_law_of_the_place_is_learned_with_its_form() -> None:
    rig = LawRig(on_block=lambda x, _v, _y, _u: -2e-3 * math.exp(-abs(x) / 7e-4), kinks=(lambda x, *_: x,))
    said = told(rig.shots())
    assert said.verdict is Verdict.LAW_LEARNED
    (law,) = said.laws
    assert (law.where, law.argument, law.form) == ("block", "place", "exponential")
    size, length = law.parameters["a"][0], law.parameters["b"][0]
    assert abs(size.value + 2e-3) < 4 * size.std < 2e-6
    assert abs(length.value - 7e-4) < 4 * length.std < 7e-7
    assert said.error_held_out_after is not None and said.error_held_out_before is not None
    assert said.error_held_out_after.displacement_rms_m < 0.01 * said.error_held_out_before.displacement_rms_m
    assert said.error_after.displacement_rms_m == pytest.approx(rig.noise_m, rel=0.1)
    assert said.effects == () and said.fit_after.effects == (law.name,)


def test_a_law_of_the_bend_with_a_kink_is_learned() -> None:
    rig = LawRig(on_plate=lambda _x, _v, y, _u: -60.0 * min(0.0, y + 8e-4), kinks=(lambda _x, _v, y, _u: y + 8e-4,))
    said = told(rig.shots())
    assert said.verdict in (Verdict.LAW_LEARNED, Verdict.PARTLY_EXPLAINED)
    (law,) = said.laws
    assert (law.where, law.argument) == ("plate", "bend")


def test_a_clean_set_grows_no_law() -> None:
    said = told(LawRig(on_block=nothing).shots())
    assert said.verdict is Verdict.ADEQUATE
    assert said.laws == ()
