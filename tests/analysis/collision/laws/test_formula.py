"""Formulas: what is read, what is refused and at which column, and that kernels and arrays agree."""

import math

import numpy as np
import pytest

from analysis.collision.laws.formula import Formula, FormulaError, read


def value(text: str, **given: float) -> float:
    parameters = [name for name in given if name not in ("x", "v", "y", "u", "d", "d_rate")]
    state = {name: given.get(name, 0.0) for name in ("x", "v", "y", "u", "d", "d_rate")}
    return float(read(text, parameters).values(state, {name: given[name] for name in parameters}))


def test_formulas_mean_what_algebra_says() -> None:
    assert value("-c * v * abs(v)", c=2.0, v=-3.0) == 18.0
    assert value("a*exp(-x/b)", a=2.0, b=0.5, x=1.0) == pytest.approx(2 * math.exp(-2))
    assert value("-a**2*v", a=3.0, v=1.0) == -9.0
    assert value("a*d**1.5", a=1.0, d=4.0) == pytest.approx(8.0)
    assert value("a*d**1.5", a=1.0, d=-4.0) == 0.0  # apart: nothing of a power that is not whole
    assert value("a*v**-2", a=1.0, v=2.0) == 0.25
    assert value(
        "a*min(1, y) + max(0, x) + sign(v) + step(u) + sqrt(d) + tanh(0) + cos(0) + sin(pi/2) + log(1)",
        a=1.0,
        y=5.0,
        x=-1.0,
        v=-2.0,
        u=1.0,
        d=9.0,
    ) == pytest.approx(1 + 0 - 1 + 1 + 3 + 0 + 1 + 1 + 0)


def test_what_is_named_is_known() -> None:
    formula = read("-c*d_rate*d", ["c"])
    assert formula == Formula("-c*d_rate*d", ("c",), ("d", "d_rate"))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("__import__('os').system('true')*c", "column 1: only numbers"),
        ("c*(lambda: 1)()", "column 3: only numbers"),
        ("c*x.real", "column 3: only numbers"),
        ("c*[1][0]", "column 3: only numbers"),
        ("c*(x := 3)", "column 4: only numbers"),
        ("c*'text'", "column 3: only numbers"),
        ("c*True", "column 3: only numbers"),
        ("c*1j", "column 3: only numbers"),
        ("c*(x if v else u)", "column 4: only numbers"),
        ("c*open(x)", "column 3: no function 'open'"),
        ("c*sin(x, v)", "column 3: sin takes 1, not 2"),
        ("c*sin(x, key=v)", "column 3: only numbers"),
        ("c*w", "column 3: no 'w' is known here"),
        ("c*v^2", "column 1: a power is written"),
        ("c*1e999", "column 3: a number beyond"),
        ("c*", "not a formula"),
        ("x", "'c' is not in the formula"),
        ("", "empty"),
        ("c*x" + "+x" * 300, "longer than"),
        ("c*" + "abs(" * 60 + "x" + ")" * 60, "nested too deep"),
        ("c*" + "-" * 60 + "x", "nested too deep"),
        ("c\n+x", "more than one line"),
    ],
)
def test_what_is_no_formula_is_refused_with_its_place(text: str, why: str) -> None:
    with pytest.raises(FormulaError, match=why) as refused:
        read(text, ["c"])
    assert "\n" not in str(refused.value)


def test_a_parameter_may_not_take_a_word_of_the_state() -> None:
    with pytest.raises(FormulaError, match="taken"):
        read("v*x", ["v"])


def test_towers_of_powers_stay_small() -> None:
    text = "c*" + "(" * 20 + "x" + "**12)" * 20
    assert np.isfinite(read(text, ["c"]).values({"x": np.array([1.0])}, {"c": 1.0})).all()


@pytest.mark.parametrize("text", ["-c*v*abs(v)", "-c*sign(v)", "c*abs(d)**1.5", "c*exp(x/2)*max(1, 2)", "c*tanh(u)"])
def test_what_turns_where_an_event_lies_has_no_kink(text: str) -> None:
    assert not read(text, ["c"]).kinked


@pytest.mark.parametrize(
    "text",
    ["c*max(0, 1 - y)", "c*exp(-abs(x))", "c*step(v - 1)", "c*abs(v - 1)", "c*max(0, abs(v) - 1)", "c*y*sign(u)"],
)
def test_a_corner_anywhere_else_is_a_kink(text: str) -> None:
    assert read(text, ["c"]).kinked


@pytest.mark.parametrize(
    ("text", "place"), [("-a*v # and -b*x", 6), ("-a*v#", 5), ("# a", 1), ("-a*ｖ", 4), ("-a*v − x", 6)]
)
def test_no_part_of_a_formula_is_passed_over_in_silence(text: str, place: int) -> None:
    with pytest.raises(FormulaError, match="is not allowed in a formula") as caught:
        read(text, ["a"])
    assert caught.value.column == place


@pytest.mark.parametrize(
    ("text", "straight"),
    [
        ("-a*v", True), ("a*x + 2*a*y - u/3", True), ("-a*sign(v)", True), ("a*abs(v)", True), ("-(a*x)", True),
        ("a*abs(v)*sign(v)", True), ("a*exp(2)*d", True), ("a*sin(a)*x", True), ("a*(x - y)/(1 + a)", True),
        ("a*v*abs(v)", False), ("a*x*y", False), ("a/x", False), ("a*abs(u)", False), ("a*sign(u)", False),
        ("a*x**2", False), ("a*exp(x)", False), ("a*sign(v - 1)", False), ("a*abs(2*v)", False), ("a*t", False),
        ("a*x*sign(v) + 0*t", False),
    ],
)  # fmt: skip
def test_a_formula_is_straight_that_is_linear_for_each_direction_of_the_block(text: str, straight: bool) -> None:
    assert read(text, ["a"]).straight is straight


def test_a_formula_counts_its_states_and_its_time() -> None:
    timed = read("a*sin(t)*x", ["a"])
    assert timed.timed and timed.state == ("x", "t") and not read("a*x", ["a"]).timed
    assert read("  a*x ", ["a"]).values({"x": 3.0}, {"a": 2.0}) == 6.0
    assert value("a*x**-3 + pi", a=2.0, x=2.0) == pytest.approx(0.25 + math.pi)
    assert value("a*(-x)**3", a=1.0, x=2.0) == -8.0 and value("+a - -x", a=1.0, x=2.0) == 3.0
    assert value("a*x**13", a=1.0, x=-2.0) == 0.0 and value("a*x**12", a=1.0, x=-2.0) == 4096.0
    assert value("a*x**0", a=5.0, x=-2.0) == 0.0  # no whole power that is multiplied out
    with pytest.raises(
        FormulaError, match=r"^column 5: no 'z' is known here; there are x, v, y, u, d, d_rate, t, a, b$"
    ) as no:
        read("a*b*z", ["b", "a"])
    assert no.value.column == 5
    with pytest.raises(FormulaError, match=r"^the parameter 'b' is not in the formula$") as unused:
        read("a*x", ["a", "b"])
    assert unused.value.column == 0
    read("a*x" + " " * 397, ["a"])
    with pytest.raises(FormulaError, match="longer than 400 characters"):
        read("a*x" + " " * 398, ["a"])
