"""Exponents that meet a contact of the literature are told with its name, and no others are."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.laws.user_law import law_from_table
from analysis.diagnosis.findings.contact_laws import sentence
from analysis.diagnosis.findings.result import FoundEffect, LearnedLaw
from analysis.shot.quantity import Quantity

LAW = law_from_table(
    {"name": "law", "where": "contact", "formula": "a*d_rate*d", "parameters": {"a": {"unit": "N", "start": 20.0}}}
)


def _exponent(delta: float, std: float = 1e-3) -> FoundEffect:
    return FoundEffect(effect_named("contact_exponent"), {"delta": Quantity(delta, std)}, {})


def _damping(n: float, std: float = 4e-3, form: str = "power") -> LearnedLaw:
    return LearnedLaw(
        effect=LAW, where="contact", argument="overlap times rate", form=form, formula="", nearest_form=form,
        parameters={"a": (Quantity(20.0, 1.0), "N"), "n": (Quantity(n, std), "")}, other_forms=(), same_by_gauge=(),
        curve_argument=np.zeros(1), curve_unit="m", curve_force_n=np.zeros(1), curve_std_n=np.zeros(1),
        visited=(0.0, 1.0), not_observable=(), evidence={}, form_force_n=np.zeros(1),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("effects", "laws", "name"),
    [
        ([_exponent(0.5)], [], "Hertz"),
        ([_exponent(0.5)], [_damping(0.502)], "Kuwabara"),
        ([_exponent(0.5)], [_damping(0.251)], "Tsuji"),
        ([_exponent(0.5)], [_damping(1.498)], "Hunt's and Crossley's contact on Hertz's"),
        ([], [_damping(1.0, form="linear")], "Hunt's and Crossley's contact on a linear spring"),
        ([], [_damping(0.999, form="power, odd")], "Hunt's and Crossley's contact on a linear spring"),
        ([_exponent(0.5029)], [], "Hertz"),  # within three standard deviations
        ([_exponent(0.5, 0.049)], [], "Hertz"),
        ([FoundEffect(effect_named("nonlinear_contact_damping"), {}, {})], [], "Hunt"),
    ],
)
def test_a_contact_of_the_literature_is_named(effects: list[FoundEffect], laws: list[LearnedLaw], name: str) -> None:
    assert name in sentence(effects, laws)


def test_an_exponent_that_was_assumed_is_not_told_as_found() -> None:
    assert "not tried" in sentence([FoundEffect(effect_named("nonlinear_contact_damping"), {}, {})], [])
    assert "not tried" not in sentence([], [_damping(1.0, form="linear")])


@pytest.mark.parametrize(
    ("effects", "laws"),
    [
        ([], []),
        ([_exponent(0.2)], []),
        ([_exponent(0.5, 0.051)], []),  # it would meet everything
        ([_exponent(0.5031)], []),
        ([_exponent(0.0)], [_damping(0.5)]),
        ([_exponent(0.0)], []),
        ([], [replace(_damping(1.0), where="plate")]),
        ([], [replace(_damping(1.0), argument="place")]),
        ([], [_damping(1.0, form="quadratic")]),
        ([_exponent(0.5)], [_damping(0.7)]),
        ([_exponent(0.2)], [_damping(0.5)]),
        ([FoundEffect(effect_named("coulomb_friction"), {}, {})], []),
    ],
)
def test_nothing_is_said_of_others(effects: list[FoundEffect], laws: list[LearnedLaw]) -> None:
    assert sentence(effects, laws) == ""
