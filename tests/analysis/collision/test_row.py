"""A row of the catalogue: the search of its parameters, what it says of itself, its grid of frequencies."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.effects import on_plate
from analysis.collision.effects.row import Acts, Effect, Parameter, frequencies
from analysis.collision.parameters import PAPER


def test_parameters_are_searched_by_their_size_or_their_logarithm() -> None:
    plain, log = Parameter("a", "", 4.0, -8.0, 12.0), Parameter("b", "", 1.0, 0.5, 8.0, logarithmic=True)
    assert (plain.to_search(2.0), plain.to_value(0.5), plain.slope(9.0), plain.bounds) == (0.5, 2.0, 4.0, (-2.0, 3.0))
    assert log.to_search(math.e) == pytest.approx(1.0) and log.to_value(2.0) == pytest.approx(math.e**2)
    assert log.slope(2.0) == log.to_value(2.0) and log.bounds == (math.log(0.5), math.log(8.0))
    bare = Parameter("c", "", 0.0)
    assert (bare.to_search(3.0), bare.to_value(3.0), bare.slope(3.0)) == (3.0, 3.0, 1.0)
    assert math.isfinite(log.to_search(0.0)) and math.isfinite(log.to_value(1e9))


def test_what_an_effect_says_of_itself() -> None:
    own, shared = Parameter("a", "", 1.0, own=True), Parameter("b_n", "N", 1.0)
    one = Effect("some_effect", "words", Acts.ON_PLATE, (own, shared), "a")
    assert one.short_words == "some effect" and one.key == "some_effect" and one.index("b_n") == 1
    assert not one.own and replace(one, parameters=(own, own)).own
    with pytest.raises(ValueError, match="some_effect has no parameter 'c'; it has a, b_n"):
        one.index("c")
    acts = {acts: replace(one, acts=acts) for acts in Acts}
    assert {a for a, e in acts.items() if e.changes_contact} == {Acts.ON_PLATE, Acts.IN_CONTACT, Acts.AT_START}
    assert {a for a, e in acts.items() if not e.one_body} == {Acts.ON_PLATE, Acts.AT_START}
    assert replace(acts[Acts.ON_BLOCK], hidden=1).changes_contact
    assert replace(one, locked=on_plate.cubic_contact).one_body
    assert one == replace(one, words="other") != replace(one, name="other") and len({one, replace(one, words="x")}) == 1
    nothing_more = {name: getattr(one, name) for name in Effect.__slots__[5:]}
    assert {name for name, value in nothing_more.items() if value} == {
        "range_at",
        "response_power",
        "fastest",
        "stiffens",
    }
    assert (one.range_at, one.response_power, one.fastest(np.ones(1), PAPER), one.stiffens(np.ones(1), PAPER)) == (
        -1,
        1,
        0,
        1,
    )
    assert one != "some_effect" and repr(one) == "Effect('some_effect')"


def test_a_grid_of_frequencies_is_as_fine_as_it_says() -> None:
    for low, high, step in ((10.0, 4000.0, 0.03), (200.0, 3000.0, 0.012)):
        grid = np.array(frequencies(low, high, step))
        steps = grid[1:] / grid[:-1] - 1
        assert (grid[0], grid[-1]) == pytest.approx((low, high)) and steps.max() <= step + 1e-12
        assert steps.max() > 0.97 * step
