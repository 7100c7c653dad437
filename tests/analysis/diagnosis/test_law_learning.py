"""Laws off the catalogue, from a generator of its own, learned from a few shots; and none where there is none."""

import math
from collections.abc import Sequence

import pytest

from analysis.diagnosis.evidence.cross_validation import choose
from analysis.diagnosis.learning.law_learning import Discovery, learn_law
from analysis.diagnosis.learning.two_laws import learn_laws, learn_second_law, learn_two
from analysis.inference.fit.first_fit import base_fit, first_fit
from analysis.inference.fit.problem import Fitted
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import base_named
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.site import STILL_FRAME
from tests.law_rigs import LawRig


def begun(rig: LawRig, speeds_m_per_s: Sequence[float] = (0.15, 0.24, 0.36)) -> Fitted:
    motions = rig.shots(speeds_m_per_s)
    data = JointData(averaged_shots(motions), base_named("paper"))
    return base_fit(data, first_fit(averaged_shots(motions), "paper", STILL_FRAME, lambda: False), lambda: False)


def learned(rig: LawRig) -> tuple[Fitted, Discovery | None]:
    start = begun(rig, (0.15, 0.36))
    held = choose(start.problem.data)
    return start, learn_laws(start, held, lambda _what, _fraction: None, lambda: False)


@pytest.fixture(scope="module")
def attraction() -> tuple[Fitted, Discovery | None]:
    """Return the base fit of shots with an attraction that falls off with the place, and what is learned from them."""
    rig = LawRig(on_block=lambda x, _v, _y, _u: -2e-3 * math.exp(-abs(x) / 7e-4), kinks=(lambda x, *_: x,))
    return learned(rig)


def test_a_law_of_the_place_is_learned_with_its_form(attraction: tuple[Fitted, Discovery | None]) -> None:
    _, found = attraction
    assert found is not None and found.explains
    (law,) = found.laws
    assert (law.where, law.argument, law.form) == ("block", "place", "exponential")
    size, length = law.parameters["a"][0], law.parameters["b"][0]
    assert abs(size.value + 2e-3) < 4 * size.std < 4e-6
    assert abs(length.value - 7e-4) < 4 * length.std < 1.4e-6
    before, after = found.predictions
    assert after.rms_m < 0.01 * before.rms_m
    assert found.fitted.noise.std_m == pytest.approx(LawRig().noise_m / math.sqrt(2.5), rel=0.3)  # of averaged samples
    assert law.visited[0] < -1e-3 and law.visited[1] > 1e-3


@pytest.mark.slow
def test_what_cannot_come_before_a_criterion_is_not_asked_to_the_end(
    attraction: tuple[Fitted, Discovery | None],
) -> None:
    start, first = attraction
    assert first is not None
    held, told = choose(start.problem.data), []

    def tell(what: str, _fraction: float) -> None:
        told.append(what)

    out_of_reach = first.fitted.bic - 3.0 * (start.bic - first.fitted.bic)
    assert learn_law(start, held, tell, lambda: False, beat=out_of_reach) is None
    assert learn_second_law(first, held, tell, lambda: False, beat=out_of_reach) is first
    assert "trying a force as a function of place" in told and "learning two laws at once" in told
    assert not any(what.startswith("reading the curve") or what == "learning a second law" for what in told)


def test_a_law_of_the_bend_that_begins_in_mid_contact_is_not_taken_for_one_of_the_place() -> None:
    hinge_m = -8e-4
    rig = LawRig(
        on_plate=lambda _x, _v, y, _u: 0.3 * max(0.0, hinge_m - y),
        kinks=(lambda _x, _v, y, _u: y - hinge_m,),
        noise_m=1e-10,
    )
    _, found = learned(rig)
    assert found is not None and found.explains
    (law,) = found.laws
    assert (law.where, law.argument, law.form) == ("plate", "bend", "hinge below")
    slope, hinge = law.parameters["a"][0], law.parameters["c"][0]
    assert abs(slope.value - 0.3) < 4 * slope.std < 0.01
    assert abs(hinge.value - hinge_m) < 4 * hinge.std < 2e-5


@pytest.mark.slow
def test_two_laws_that_one_alone_would_pass_for_a_third_are_learned_at_once() -> None:
    rig = LawRig(
        on_block=lambda x, v, _y, _u: -2e-6 * math.exp(-abs(x) / 9e-4) * v,
        on_plate=lambda _x, _v, y, _u: -10.0 * abs(y) ** 2.5 * math.copysign(1.0, y),
        kinks=(lambda x, *_: x,),
    )
    start = begun(rig)
    found = learn_two(start, choose(start.problem.data), lambda: False)
    assert found is not None and found.explains
    assert [law.argument for law in found.laws] == ["place times speed", "bend"]
    assert found.laws[0].form == "exponential"
    assert found.laws[1].form in ("power", "power, odd")  # one function but for the little that the plate swings back
    squeeze, bend = (law.parameters for law in found.laws)
    for told, truth in ((squeeze["a"], -2e-6), (squeeze["b"], 9e-4), (bend["n"], 2.5)):
        assert abs(told[0].value - truth) < 4 * told[0].std < 0.5 * abs(truth)
    assert all(law.evidence["delta_bic"] < -28 for law in found.laws)


def test_a_clean_set_grows_no_law() -> None:
    assert learned(LawRig())[1] is None
