"""What else a learned law may be: other forms, and other readings of the same function."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.curve import graded_basis
from analysis.collision.laws.forms import FORMS
from analysis.collision.laws.user_law import law_from_table
from analysis.diagnosis.findings import words
from analysis.diagnosis.findings.result import FoundEffect, LearnedLaw, OtherForm
from analysis.diagnosis.learning import learned_law as module
from analysis.diagnosis.learning.closed_forms import Fitting, information
from analysis.diagnosis.learning.curve_motion import Term
from analysis.diagnosis.learning.learned_law import (
    FormFit,
    as_learned,
    in_joint_fit,
    is_same_function,
    part_beyond_base,
)
from analysis.inference.model.normal_matrix import NormalMatrix
from analysis.shot.quantity import Quantity

BEND = next(one for one in ARGUMENTS if (one.where, one.name) == ("plate", "bend"))
AT_M = np.linspace(-1.5e-3, 0.0, 50)


def curve(form: str, **values: float) -> np.ndarray:
    (found,) = (one for one in FORMS if one.name == form)
    return np.asarray(found.values(AT_M, values))


@pytest.mark.parametrize(
    ("form", "values", "same"),
    [("quadratic, odd", {"a": -200.0}, True), ("quadratic", {"a": 201.0}, False), ("power", {"a": 200, "n": 2}, True)],
)
def test_forms_that_are_one_curve_over_the_range_are_readings_of_one_function(
    form: str, values: dict[str, float], same: bool
) -> None:
    other, shown = OtherForm(BEND.where, BEND.name, form, "", 0.1, curve(form, **values)), curve("quadratic", a=200.0)
    assert is_same_function(other, shown, part_beyond_base(BEND, AT_M, shown)) is same


def test_a_form_of_another_argument_is_never_the_same_function() -> None:
    assert not is_same_function(OtherForm("block", "place", "quadratic", "", 0.0), curve("quadratic", a=200.0), AT_M)


def test_forms_that_differ_only_beside_what_the_base_model_holds_are_not_one_function() -> None:
    overlap = next(one for one in ARGUMENTS if (one.where, one.name) == ("contact", "overlap"))
    at_m = np.linspace(0.0, 3.5e-5, 50)
    saturating = -2.5e-3 * at_m / (at_m + 1.66e-4)
    power = 5900.0 * at_m**1.74
    (linear,) = np.linalg.lstsq(at_m[:, None], saturating - power, rcond=None)[0]
    moved = power + linear * at_m  # what is linear in the overlap is k_N
    apart = float(np.max(np.abs(moved - saturating)))
    close = saturating + (moved - saturating) * 5e-4 * float(np.max(np.abs(saturating))) / apart
    other = OtherForm("contact", "overlap", "power", "", 0.3, close)
    assert is_same_function(other, saturating, saturating)
    assert not is_same_function(other, saturating, part_beyond_base(overlap, at_m, saturating))


def test_a_law_of_ones_own_is_told_with_its_formula_and_its_units() -> None:
    parameters = {"a": {"unit": "N s/m", "start": 1e-3}, "b": {"unit": "m", "start": 1e-3}}
    law = law_from_table({"name": "brake", "where": "block", "formula": "-a*exp(x/b)*v", "parameters": parameters})
    found = FoundEffect(law, {"a": Quantity(4e-4, 1e-6, ""), "b": Quantity(1.2e-3, 1e-6, "")}, {})
    assert words.found(found) == "brake: -a*exp(x/b)*v with a (4.000 ± 0.010)e-4 N s/m, b (1.2000 ± 0.0010)e-3 m"


@pytest.mark.parametrize(("share", "same"), [(0.99e-3, True), (1.01e-3, False)])
def test_curves_of_one_function_differ_by_less_than_a_thousandth_of_what_is_new(share: float, same: bool) -> None:
    shown, new_n = np.array([1.0, 5.0, -2.0]), np.array([0.5, -2.0, 1.0])
    for moved in ([1.0, 0.0, 0.0], [0.0, -1.0, 0.5]):
        other = OtherForm("block", "place", "power", "", 0.0, shown + 2.0 * share * np.array(moved))
        assert is_same_function(other, shown, new_n) is same


BASIS = graded_basis(-1e-3, 2e-3, 6)
PLACE = next(one for one in ARGUMENTS if (one.where, one.name) == ("block", "place"))


def form_fit(name: str, bic: float, argument: Any = BEND, **values: float) -> FormFit:
    """Return a form with these values as the fit of some shots has it, beside another effect."""
    form = next(one for one in FORMS if one.name == name)
    law = form.law(argument, values, 1e-3)
    random = np.random.default_rng(8)
    root = random.standard_normal((80, 3 + 2 * BASIS.count))
    at = np.linspace(-1e-3, 2e-3, 200)
    coefficients = np.linalg.lstsq(BASIS.design(at), form.values(at, values), rcond=None)[0]
    terms = (Term(PLACE, BASIS, np.zeros(BASIS.count)), Term(argument, BASIS, coefficients))
    penalties = 0.3 * np.eye(BASIS.count)
    learned: Any = SimpleNamespace(
        terms=terms, freedom=3.5, z=np.zeros(3), curvature=NormalMatrix.of(root.T @ root),
        penalty=np.kron(np.diag([9.0, 1.0]), penalties),
    )  # fmt: skip
    free = [
        (effect_named("tilt"), SimpleNamespace(name="angle_rad"), -1),
        *((law, SimpleNamespace(name=n), -1) for n in values),
    ]
    std = np.arange(1.0, 20.0)
    fitted: Any = SimpleNamespace(
        effects=(effect_named("tilt"), law), bic=bic, point=SimpleNamespace(values=[{law: values}]), noise="noise",
        problem=SimpleNamespace(offset=5, free_parameters=free, data=SimpleNamespace(shots=["s0", "s1"])),
        with_marginal_covariance=lambda: SimpleNamespace(std=std),
    )  # fmt: skip
    return FormFit(fitted, learned, Fitting(form, values, 1.0, np.zeros(3)))


@pytest.mark.parametrize("told_by_form", [True, False])
def test_a_learned_law_is_told_with_its_numbers_its_curve_and_what_it_may_be_instead(
    told_by_form: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = form_fit("quadratic, odd", 100.0, a=200.0)
    twin, near, far = (
        form_fit("power, odd", 101.0, a=200.0, n=2.0),
        form_fit("cubic", 109.9, a=9e4),
        form_fit("cubic", 110.1, a=9e4),
    )
    other = form_fit("linear", 105.0, PLACE, a=3.0)
    again = form_fit("quadratic, odd", 100.5, a=200.0)
    monkeypatch.setattr(
        module, "_held_out_chi2", lambda fitted, after, held: 1.25 if (after, held) == ("after", (1,)) else 0.0
    )
    given: Any = (SimpleNamespace(bic=160.0), [best, again, twin, other, near, far], told_by_form, "after", (1,))
    law = as_learned(*given)
    assert (law.effect, law.where, law.argument, law.nearest_form) == (best.law, "plate", "bend", "quadratic, odd")
    assert law.form == ("quadratic, odd" if told_by_form else None)
    assert law.formula == (best.law.formula.text if told_by_form else None)
    # behind the effect that the fit has beside it: the sixth number after five of base and starts
    assert law.parameters == (
        {"a": (Quantity(200.0, 7.0, "fit of the law"), best.law.parameters[0].unit)} if told_by_form else {}
    )
    assert [(one.form, one.argument, one.delta_bic) for one in law.other_forms] == [
        ("linear", "place", 5.0), ("cubic", "bend", pytest.approx(9.9)),
    ]  # fmt: skip
    assert law.other_forms[0].curve_force_n is None
    same = [words for words in law.same_by_gauge if "the same over the range covered" in words]
    assert len(same) == 1 and same[0].startswith("power, odd, ")
    at = np.linspace(-1e-3, 2e-3, 81)
    np.testing.assert_allclose(law.curve_argument, at)
    np.testing.assert_allclose(law.form_force_n, 200.0 * at * np.abs(at))
    known = np.linalg.inv(information(best.learned) + 0.3 * np.eye(BASIS.count))
    std = np.sqrt(np.diag(BASIS.design(at) @ known @ BASIS.design(at).T))
    np.testing.assert_allclose(law.curve_std_n, std, rtol=1e-6)
    assert law.visited == (BASIS.knots[0], BASIS.knots[-1]) and law.curve_unit == "m"
    assert law.evidence == {"delta_bic": -60.0, "held_out_chi2": 1.25, "degrees_of_freedom": 3.5}
    assert law.not_observable[-1] == "any part outside the range covered"
    # its curve lies as near to the form as what the base model holds lets it
    assert np.abs(law.curve_force_n - law.form_force_n).max() < 0.05 * np.abs(law.form_force_n).max()


def test_in_the_fit_with_another_law_a_law_has_the_numbers_of_that_fit() -> None:
    one = form_fit("quadratic", 100.0, a=200.0)
    bare: Any = object.__new__(LearnedLaw)
    for name, value in (
        ("effect", one.law),
        ("form", None),
        ("formula", None),
        ("nearest_form", "quadratic"),
        ("parameters", {}),
    ):
        object.__setattr__(bare, name, value)
    assert in_joint_fit(bare, one.fitted, False) is bare
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "replace", lambda law, **new: new)
        told: Any = in_joint_fit(bare, one.fitted, True)
    parameters = {"a": (Quantity(200.0, 7.0, "fit of the law"), one.law.parameters[0].unit)}
    assert told == {"form": "quadratic", "formula": one.law.formula.text, "parameters": parameters}
    assert one.bic == 100.0
    np.testing.assert_allclose(replace(one, place=-1).curve(np.array([1.0, -2.0])), [200.0, 800.0])


def test_held_out_shots_are_judged_by_the_noise_of_the_fit() -> None:
    def shot(size: float, count: int) -> Any:
        return SimpleNamespace(
            averaged=lambda x: 2.0 * x, left_m=lambda shown: size - shown,
            whitened=lambda noise, left: np.repeat(left, count, axis=0) / noise,
        )  # fmt: skip

    fitted: Any = SimpleNamespace(
        noise=0.5, problem=SimpleNamespace(data=SimpleNamespace(shots=[None, shot(5.0, 3), shot(9.0, 1)]))
    )  # fmt: skip
    after: Any = SimpleNamespace(displacement_m=(np.array([1.0]), np.array([4.0])))
    assert module._held_out_chi2(fitted, after, (1, 2)) == pytest.approx((3 * 6.0**2 + 2.0**2) / 4)
