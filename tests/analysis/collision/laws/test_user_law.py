"""A user's law moves the block as the catalogue's row with the same equation does."""

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.laws.arguments import ARGUMENTS
from analysis.collision.laws.forms import FORMS
from analysis.collision.laws.user_law import LawError, UserLaw, _random_states, known_effect, law_from_table
from analysis.collision.parameters import PAPER, Collision, Infeasible
from analysis.collision.solver import general
from tests.law_rigs import Bodies, LawRig, Memory

TIMES_S = np.arange(-1000, 4001) * 1e-5


def law(where: str, formula: str, **start: float) -> UserLaw:
    parameters = {name: {"unit": "", "start": value} for name, value in start.items()}
    return law_from_table({"name": "mine", "where": where, "formula": formula, "parameters": parameters})


@pytest.mark.parametrize(
    ("name", "values", "where", "formula"),
    [
        ("coulomb_friction", (1e-4,), "block", "-a*sign(v)"),
        ("viscous_drag", (1e-3,), "block", "-a*v"),
        ("quadratic_drag", (1e-2,), "block", "-a*v*abs(v)"),
        ("bearing_gradient", (5.0,), "block", "-a*x"),
        ("cubic_stiffness", (2e5,), "plate", "-a*y**3"),
        ("plate_damping", (1e-3,), "plate", "-a*u"),
        ("nonlinear_contact_damping", (1e3,), "contact", "a*d*d_rate"),
        ("contact_exponent", (0.1,), "contact", "1e4*d*((d/50e-6)**a - 1)"),
    ],
)
def test_a_typed_law_is_the_row_of_its_equation(name: str, values: Any, where: str, formula: str) -> None:
    row, own = effect_named(name), law(where, formula, a=values[0])
    assert own.acts is row.acts
    assert own.amplitude == "a"
    directions = [0, 2, 4, general.direction(0, 0)]
    if name == "contact_exponent":
        directions.remove(2)  # the row scales the fitted contact stiffness, the typed law a number
    theirs = general.solve(PAPER, [general.ActiveEffect(row, values)], TIMES_S, directions=directions)
    ours = general.solve(PAPER, [general.ActiveEffect(own, values)], TIMES_S, directions=directions)
    assert [e.kind for e in ours.events] == [e.kind for e in theirs.events]
    assert ours.displacement_m == pytest.approx(theirs.displacement_m, abs=2e-15)
    # Where a law is not smooth at the touch, derivatives are right to the strides by which each was followed.
    part = 1e-5 if row.rough else 1e-8
    for k in range(len(directions)):
        size = np.max(np.abs(theirs.displacement_derivatives[:, k]))
        assert ours.displacement_derivatives[:, k] == pytest.approx(
            theirs.displacement_derivatives[:, k], abs=part * size
        )


@pytest.mark.parametrize(
    ("argument", "form", "unit"),
    [
        ("place", "linear", "N/m"),
        ("place", "cubic", "N/m³"),
        ("speed one way", "linear", "N s/m"),
        ("speed one way", "quadratic", "N s²/m²"),
        ("speed one way", "cubic", "N s³/m³"),
        ("place times speed", "quadratic", "N/m² s/m"),
        ("place", "exponential", "N"),
        ("place", "power", "N per (argument)^n"),
    ],
)
def test_the_strength_of_a_learned_law_has_the_unit_of_its_form(argument: str, form: str, unit: str) -> None:
    of = next(one for one in ARGUMENTS if one.where == "block" and one.name == argument)
    shape = next(one for one in FORMS if one.name == form)
    learned = shape.law(of, {"a": 1.0, **shape.starts(-1e-3, 1e-2)[0]}, 1e-2)
    assert next(one.unit for one in learned.parameters if one.name == "a") == unit


def test_of_two_parameters_that_turn_a_law_off_its_strength_is_the_linear_one() -> None:
    assert [law("block", formula, b=2.0, a=3.0).amplitude for formula in ("-b**2*a*v", "-b*a**2*v")] == ["a", "b"]


@pytest.mark.parametrize(
    "formula", ["-a*exp(b*x)*v", "a*tanh(v/b)", "-a*max(0, -x - b)", "a*cos(x/b)*u", "-a*sqrt(abs(y))*v + b*0"]
)
def test_derivatives_of_any_formula_are_those_of_differences(formula: str) -> None:
    own = law("block", formula, a=1e-3, b=2e-3 if "b" in formula else 1.0)
    values = (1e-3, 2e-3)
    run = general.solve(
        PAPER, [general.ActiveEffect(own, values)], TIMES_S, directions=[general.direction(0, k) for k in (0, 1)]
    )
    for k in (0, 1):
        moved = []
        for sign in (-1, 1):
            near = list(values)
            near[k] *= 1 + sign * 1e-3  # past a cusp the speed depends to 1e-11 m/s on where the steps come to lie
            moved.append(general.solve(PAPER, [general.ActiveEffect(own, tuple(near))], TIMES_S).displacement_m)
        slope = (moved[1] - moved[0]) / (2e-3 * values[k])
        exact = run.displacement_derivatives[:, k]
        assert np.max(np.abs(slope)) > 0 or "*0" in formula
        assert np.max(np.abs(exact - slope)) <= 2e-3 * np.max(np.abs(slope)) + 1e-9


def _collision(bodies: Bodies) -> Collision:
    return Collision(
        plate_stiffness_n_per_m=bodies.k_p,
        plate_mass_kg=bodies.plate_kg,
        contact_stiffness_n_per_m=bodies.k_n,
        contact_damping_n_s_per_m=bodies.gamma_n,
        velocity_in_m_per_s=-0.25,
        block_mass_kg=bodies.block_kg,
    )


@pytest.mark.parametrize("where", ["block", "plate"])
@pytest.mark.parametrize("hinge_m", [-1e-4, -6.6e-4, -1.4e-3])
def test_a_law_that_begins_in_mid_contact_is_followed(where: str, hinge_m: float) -> None:
    """By an integrator of its own, whose events lie on the hinge; wherever the law is nothing at first."""
    bodies = Bodies()
    collision = _collision(bodies)
    place = {"block": 0, "plate": 2}[where]
    letter = {"block": "x", "plate": "y"}[where]

    def force(*state: float) -> float:
        return 0.5 * max(0.0, hinge_m - state[place])

    def kink(*state: float) -> float:
        return state[place] - hinge_m

    rig = LawRig(kinks=(kink,), bodies=bodies, **{f"on_{where}": force})
    theirs = rig.displacement_m(TIMES_S, 0.25)
    bare = LawRig(bodies=bodies).displacement_m(TIMES_S, 0.25)
    own = law(where, f"a*max(0, c - {letter})", a=0.5, c=hinge_m)
    ours = general.solve(collision, [general.ActiveEffect(own, (0.5, hinge_m))], TIMES_S).displacement_m
    assert np.max(np.abs(theirs - bare)) > 1e-7
    assert ours == pytest.approx(theirs, abs=2e-12)  # the kink itself is stepped over


@pytest.mark.parametrize("hinge_m", [-1e-4, -6.6e-4])
def test_a_steep_kink_is_met_as_finely_by_a_fit_as_it_needs(hinge_m: float) -> None:
    bodies = Bodies()

    def force(_x: float, _v: float, y: float, _u: float) -> float:
        return 5.0 * max(0.0, hinge_m - y)

    rig = LawRig(kinks=(lambda _x, _v, y, _u: y - hinge_m,), bodies=bodies, on_plate=force)
    theirs = rig.displacement_m(TIMES_S, 0.25, 2e-5)
    own = law("plate", "a*max(0, c - y)", a=5.0, c=hinge_m)
    ours = general.solve(
        _collision(bodies), [general.ActiveEffect(own, (5.0, hinge_m))], TIMES_S, stride=2.0
    ).displacement_m
    assert ours == pytest.approx(theirs, abs=5e-12)  # averaged noise of the beat: 16e-12


@pytest.mark.parametrize("where", ["block", "plate"])
def test_a_law_of_time_counts_from_the_touch(where: str) -> None:
    """By an integrator of its own, to which time is a memory that grows by a second a second; before, by hand."""
    bodies = Bodies()
    omega, size = 2 * math.pi * 90.0, 2e-3

    def force(_x: float, _v: float, _y: float, _u: float, t: float) -> float:
        return size * math.sin(omega * t)

    memory = Memory(lambda *_: 1.0, **{f"on_{where}": force})
    theirs = LawRig(bodies=bodies, memory=memory).displacement_m(TIMES_S, 0.25, 1e-5)
    if where == "block":
        t = TIMES_S[TIMES_S < 0]
        swing = size / bodies.block_kg / omega
        theirs[: t.size] = (swing - 0.25) * t - swing / omega * np.sin(omega * t)
    own = law(where, f"a*sin(2*pi*{90.0}*t)", a=size)
    ours = general.solve(_collision(bodies), [general.ActiveEffect(own, (size,))], TIMES_S).displacement_m
    assert np.max(np.abs(theirs - LawRig(bodies=bodies).displacement_m(TIMES_S, 0.25))) > 1e-8
    assert ours == pytest.approx(theirs, abs=2e-12)


def test_a_constant_in_contact_acts_while_they_touch_and_only_then() -> None:
    bodies = Bodies()
    theirs = LawRig(bodies=bodies, between=lambda *_: -2e-3).displacement_m(TIMES_S, 0.25, 1e-5)
    own = law("contact", "-a", a=2e-3)
    ours = general.solve(_collision(bodies), [general.ActiveEffect(own, (2e-3,))], TIMES_S).displacement_m
    assert np.max(np.abs(theirs - LawRig(bodies=bodies).displacement_m(TIMES_S, 0.25))) > 1e-9
    assert ours == pytest.approx(theirs, abs=2e-12)


def test_time_is_not_for_the_force_in_contact() -> None:
    with pytest.raises(LawError, match="t is for laws of the block or the plate"):
        law_from_table(table(where="contact", formula="-a*exp(-t/b)"))


def table(**changes: Any) -> dict[str, Any]:
    whole: dict[str, Any] = {
        "name": "pull", "where": "block", "formula": "-a*exp(x/b)",
        "parameters": {"a": {"unit": "N", "start": 1e-3, "lower": 0}, "b": {"unit": "m", "start": 1e-3, "lower": 1e-5}},
    }  # fmt: skip
    whole |= changes
    return {key: value for key, value in whole.items() if value is not None}


def test_what_was_written_is_read_again() -> None:
    own = law_from_table(table(words="a pull that fades"))
    assert law_from_table(own.written()) == own
    assert own is law_from_table(own.written())  # compiled once


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"name": None}, "name: missing"),
        ({"name": "two words"}, "name: 'two words'"),
        ({"name": "adhesion"}, "already"),
        ({"where": "floor"}, "where: 'floor'"),
        ({"formula": "a*b"}, "names nothing of the motion"),
        ({"formula": "a*b*q"}, "formula: column 5: no 'q'"),
        ({"formula": "x**2 + a + b"}, "no parameter turns the law off"),
        ({"formula": "a*log(x)*b"}, "no finite force"),
        ({"formula": "a*b*0*x"}, "no force anywhere"),
        ({"parameters": {}}, "one to 3"),
        ({"parameters": {"a": 3}}, "write it as"),
        ({"parameters": {"a": {"unit": "N", "start": 0}}}, "parameters.a.start"),
        ({"parameters": {"a": {"unit": "N", "start": 1, "upper": 0.5}}}, "is not between"),
        ({"parameters": {"a": {"unit": "N", "start": 10**400}}}, "parameters.a.start: beyond all size"),
        ({"parameters": {"a": {"start": 1.0}}}, "parameters.a.unit: missing"),
        ({"parameters": {"a": {"unit": "N", "start": 1.0, "own": 1}}}, "parameters.a.own: true"),
        ({"formula": "a*x", "parameters": {"a": {"unit": "N/m", "start": 1.0, "own": True}}}, "that the shots share"),
        ({"extra": 1}, "unknown key 'extra'"),
        ({"name": "l\u00e4w"}, "is not a word of letters"),
        ({"name": "n" * 41}, "at most 40"),
        ({"name": "  "}, "name: missing, or not a text"),
        ({"words": 3}, "words: missing, or not a text"),
        ({"parameters": {key: {"unit": "N", "start": 1} for key in "abcd"}}, "one to 3"),
        ({"parameters": [1]}, "one to 3"),
        ({"parameters": {"_a": {"unit": "N", "start": 1}}}, "'_a' is not a word"),
        ({"parameters": {"\u00e4": {"unit": "N", "start": 1}}}, "is not a word"),
        ({"parameters": {"a b": {"unit": "N", "start": 1}}}, "'a b' is not a word"),
        ({"parameters": {"a": {"unit": "N", "start": 1, "step": 2}}}, "parameters.a: unknown key 'step'"),
        ({"parameters": {"a": {"unit": "N", "start": math.inf}}}, "parameters.a.start: a finite"),
        ({"parameters": {"a": {"unit": "N"}}}, "parameters.a.start: a finite"),
        ({"parameters": {"a": {"unit": "N", "start": True}}}, "parameters.a.start: True is not a number"),
        ({"parameters": {"a": {"unit": "N", "start": 1, "lower": 1, "upper": 1}}}, "start 1 is not between 1 and 1"),
        ({"parameters": {"a": {"unit": "N", "start": 1, "lower": 2}}}, "start 1 is not between 2 and inf"),
    ],
)
def test_a_law_that_cannot_be_used_is_refused_in_one_line(changes: dict[str, Any], why: str) -> None:
    with pytest.raises(LawError, match=why) as refused:
        law_from_table(table(**changes))
    assert "\n" not in str(refused.value)


def test_derivatives_past_a_slope_without_bound_do_not_depend_on_where_the_steps_come_to_lie() -> None:
    """A damping that goes as the root of the overlap has no bounded slope where the two bodies part."""
    own = law("contact", "(a*abs(d)**n)*d_rate", a=21.2, n=0.5)
    by = [0, 1, 2, 3, general.direction(0, 0), general.direction(0, 1)]
    near = []
    for change in (0.0, 1e-7, 3e-7):
        collision = replace(PAPER, contact_stiffness_n_per_m=9e3 * (1 + change))
        run = general.solve(collision, [general.ActiveEffect(own, (21.2, 0.5))], TIMES_S, directions=by, stride=2.0)
        near.append(run.displacement_derivatives / np.max(np.abs(run.displacement_derivatives), axis=0))
    assert np.max(np.abs(near[1] - near[0])) < 2e-4
    assert np.max(np.abs(near[2] - near[0])) < 2e-4


@pytest.mark.parametrize(
    ("where", "formula"),
    [("block", "a/x"), ("block", "a*v/(x - x)"), ("plate", "a/y"), ("contact", "a*d_rate/d"), ("block", "a*log(x)")],
)
def test_a_division_by_zero_is_no_trajectory_and_raises_nothing_else(where: str, formula: str) -> None:
    try:
        effect = law(where, formula, a=1e-6)
    except LawError:
        return  # said before any collision is followed
    try:
        run = general.solve(PAPER, [general.ActiveEffect(effect, (1e-6,))], TIMES_S, directions=[0, 2])
    except Infeasible as why:
        assert "without bound" in str(why)
    else:
        assert run.displacement_m.shape == TIMES_S.shape


def test_a_derivative_goes_through_a_quotient() -> None:
    own = law("block", "-a*v/(1 + 1e3*x*x)", a=1e-3)
    step = 1e-6
    ways = [
        general.solve(PAPER, [general.ActiveEffect(own, (1e-3 + k * step,))], TIMES_S, directions=[]) for k in (-1, 1)
    ]
    exact = general.solve(PAPER, [general.ActiveEffect(own, (1e-3,))], TIMES_S, directions=[general.direction(0, 0)])
    slope = (ways[1].displacement_m - ways[0].displacement_m) / (2 * step)
    np.testing.assert_allclose(exact.displacement_derivatives[:, 0], slope, atol=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("name", ["stir_", "_stir_", "_", "a__b_"])
def test_a_law_without_words_survives_its_own_file(name: str) -> None:
    parameters = {"a": {"unit": "", "start": 1}}
    own = law_from_table({"name": name, "where": "block", "formula": "-a*v", "parameters": parameters})
    assert (
        known_effect(own.key) is own and law_from_table(own.written()) == own and own.words.strip() == own.words != ""
    )


@pytest.mark.parametrize(
    ("where", "formula", "rate"),
    [
        ("block", "-a*x", math.sqrt(40.0 / PAPER.block_mass_kg)),
        ("block", "-a*v", 40.0 / PAPER.block_mass_kg),
        ("block", "-a*v*abs(v)", 2 * 40.0 * 0.265 / PAPER.block_mass_kg),
        ("plate", "-a*y", math.sqrt(40.0 / PAPER.plate_mass_kg)),
        ("plate", "-a*u - a*x", 40.0 / PAPER.plate_mass_kg),
        ("contact", "a*d", math.sqrt(40.0 / PAPER.plate_mass_kg)),
        ("contact", "-a*d_rate", 40.0 / PAPER.plate_mass_kg),
        ("block", "a*sin(700*t)", 700.0),
    ],
)
def test_the_rate_of_a_law_is_its_steepest_slope_over_the_mass(where: str, formula: str, rate: float) -> None:
    table = {"name": "l", "where": where, "formula": formula, "parameters": {"a": {"unit": "", "start": 1.0}}}
    law = law_from_table(table)
    assert law.fastest(np.array([40.0]), PAPER) == pytest.approx(rate, rel=0.05)
    if where == "contact":
        locked = replace(PAPER, plate_mass_kg=math.inf, plate_stiffness_n_per_m=0.0)
        lighter = PAPER.plate_mass_kg / PAPER.block_mass_kg
        slower = lighter if "d_rate" in formula else lighter**0.5
        assert law.fastest(np.array([40.0]), locked) == pytest.approx(rate * slower)
    assert law.rough is (where == "contact") and law.hidden == int("*t)" in formula)


def test_the_states_at_which_a_law_is_looked_at_are_those_of_a_collision() -> None:
    states = _random_states(PAPER)
    run = general.solve(replace(PAPER, contact_damping_n_s_per_m=0.0), (), np.arange(3000) * 1e-5)
    deepest, first = -run.displacement_m.min(), -run.gap_m[run.time_s < 4e-4].min()
    assert states["y"].min() == pytest.approx(-deepest, rel=0.05) and -0.02 * deepest < states["y"].max() <= 0.0
    assert np.abs(states["v"]).max() == pytest.approx(0.265, rel=0.02)
    assert states["d"].min() >= 0.0 and states["d"].max() == pytest.approx(first, rel=0.03)
    assert np.abs(states["d_rate"]).max() == pytest.approx(0.265, rel=0.02)
    assert np.abs(states["u"]).max() == pytest.approx(2 * 0.265, rel=0.02)
    assert states["t"].min() >= 0.0 and states["t"].max() == pytest.approx(2 * PAPER.contact_time_estimate_s, rel=0.02)
    assert states["x"].min() < 1.15 * states["y"].min() and states["x"].max() > 0.0


def test_a_law_may_be_named_as_long_as_that_and_begin_at_one_of_its_limits() -> None:
    long = law_from_table(table(name="n" * 40))
    assert long.name == "n" * 40 and long.words == "n" * 40
    for limits in ({"lower": 1.0}, {"upper": 1.0}, {"lower": -2.0, "upper": 1.0}):
        own = law_from_table(table(formula="a*x", parameters={"a": {"unit": "N/m", "start": 1.0} | limits}))
        (given,) = own.parameters
        assert (given.lower, given.upper) == (limits.get("lower", -math.inf), limits.get("upper", math.inf))
    down = law_from_table(table(formula="a*x", parameters={"a": {"unit": "N/m", "start": -3.0}})).parameters[0]
    assert (down.scale, down.tried, down.unit, down.own) == (3.0, (-3.0,), "N/m", False)


def test_a_law_is_the_same_after_a_file_and_in_another_process() -> None:
    own = law_from_table(table(words="fades", parameters={
        "a": {"unit": "N", "start": -2.0, "upper": 5.0}, "b": {"unit": "m", "start": 1e-3, "own": True},
    }))  # fmt: skip
    assert pickle.loads(pickle.dumps(own)) is own and known_effect(own.key) is own
    assert own.written()["parameters"] == {
        "a": {"unit": "N", "start": -2.0, "upper": 5.0}, "b": {"unit": "m", "start": 1e-3, "own": True},
    }  # fmt: skip
    assert own.short_words == "fades" and own.key.startswith("pull{")
    other = law_from_table(table(words="another"))
    assert other != own and len({own, other, law_from_table(own.written())}) == 2
    assert known_effect(own.key.replace("pull{", "push{")) is None  # named twice, and not alike
    assert (
        known_effect("pull") is None and known_effect("pull{") is None and known_effect("tilt") is effect_named("tilt")
    )
    assert known_effect("frame_vibration_with_plate") is not None and known_effect("flight_acceleration") is not None


def test_a_law_of_time_without_size_has_no_rate_and_states_are_drawn_all_over_a_collision() -> None:
    still = law("block", "a*0*t + a*x", a=2.0)
    assert still.fastest(np.array([0.0]), PAPER) == 0.0
    assert law("block", "a*t", a=2.0).fastest(np.array([2.0]), PAPER) == pytest.approx(
        1.0 / math.sqrt(np.mean(_random_states(PAPER)["t"] ** 2))
    )
    locked = replace(PAPER, plate_mass_kg=math.inf, plate_stiffness_n_per_m=0.0)
    assert law("contact", "a*d", a=2.0).fastest(np.array([2.0]), locked) == pytest.approx(
        math.sqrt(2.0 / PAPER.block_mass_kg)
    )
    states = _random_states(PAPER)
    overlap = 2.0 * (states["d"] - states["d"].min())
    assert np.ptp(states["x"] - 1.2 * states["y"]) == pytest.approx(2.0 * np.ptp(overlap) / 2.0, rel=0.02)
    assert all(values.shape == (400,) and np.isfinite(values).all() for values in states.values())
