"""Each argument of a free law: the force is the curve of its expression, the rate follows from the curve's slope."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects.kernel import (
    ON_BLOCK,
    ON_PLATE,
    OUTPUTS,
    PAIR,
    SIGN_V,
    STATES,
    TOUCHING,
    XI,
    XI_RATE,
    U,
    V,
    X,
    Y,
)
from analysis.collision.effects.row import Acts
from analysis.collision.laws.arguments import ARGUMENTS, Argument
from analysis.collision.laws.curve import graded_basis
from analysis.collision.laws.formula import Formula
from analysis.collision.parameters import PAPER

NAMES = {"x": X, "v": V, "y": Y, "u": U, "d": XI, "d_rate": XI_RATE}
ADDS = {"block": (ON_BLOCK, Acts.ON_BLOCK), "plate": (ON_PLATE, Acts.ON_PLATE), "contact": (PAIR, Acts.IN_CONTACT)}
CURVE = graded_basis(-2.0, 2.0, 6).curve(np.random.default_rng(4).normal(size=9))


@pytest.mark.parametrize("argument", ARGUMENTS, ids=lambda one: f"{one.where} {one.name}")
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_a_force_is_the_curve_of_its_expression_times_its_factor(
    argument: Argument, way: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = argument.kernel.__globals__  # type: ignore[attr-defined]
    monkeypatch.setitem(names, "curve_at", lambda address, at: {77.0: CURVE}[address](np.asarray(at)))
    monkeypatch.setitem(names, "sign_of", np.sign)
    s = np.random.default_rng(5).uniform(0.2, 1.5, STATES)
    s[[V, U]] *= way
    s[SIGN_V] = way
    state: dict[str, Any] = {name: s[place] for name, place in NAMES.items()}
    at = float(Formula(argument.expression, (), ()).values(state, {}))
    factor = float(Formula(argument.factor or "1", (), ()).values(state, {}))
    assert argument.value(s[None, :])[0] == pytest.approx(at)
    place, acts = ADDS[argument.where]
    for touching in (0.0, 1.0):
        s[TOUCHING] = touching
        out = np.ones(OUTPUTS)
        argument.kernel(s, (3.0, 77.0), out)
        expected = np.ones(OUTPUTS)
        if touching or argument.where != "contact":
            expected[place] += 3.0 * float(CURVE(np.array(at))) * factor
        np.testing.assert_allclose(out, expected, rtol=1e-12)
    row = argument.row(CURVE)
    assert row.acts is acts and row.kernel is argument.kernel and row.amplitude == "factor"
    assert row.name == f"law_{argument.where}_{argument.name.replace(' ', '_')}"
    assert row.rough is argument.touching is (argument.where == "contact")
    assert row.kinked is (argument.factor == "sign(u)")
    size, table = row.parameters
    assert (size.scale, table.scale, size.fixed, table.fixed) == (1.0, CURVE.address, True, True)


def test_the_rate_of_a_law_is_its_slope_over_the_mass_it_moves() -> None:
    none = np.empty(0)
    light = replace(PAPER, plate_mass_kg=2 * PAPER.block_mass_kg)
    for argument in ARGUMENTS:
        slow = argument.unit == "m/s"
        for collision, lightest in ((PAPER, PAPER.plate_mass_kg), (light, PAPER.block_mass_kg)):
            mass = PAPER.block_mass_kg if argument.where == "block" else lightest
            rate = CURVE.largest_slope / mass
            assert argument.row(CURVE).fastest(none, collision) == pytest.approx(rate if slow else math.sqrt(rate))


def test_what_the_base_model_holds_of_a_law_is_said() -> None:
    for argument in ARGUMENTS:
        assert bool(argument.gauge) <= bool(argument.unseen)
    assert {(one.name, one.gauge) for one in ARGUMENTS if one.gauge} == {
        ("bend", ("x",)), ("overlap", ("x",)), ("overlap rate", ("x",)), ("overlap times rate", ("1",)),
    }  # fmt: skip
