"""Shots with weights on the block are told by number."""

import pytest

from analysis.shot.plates_of_set import weights_words


@pytest.mark.parametrize(
    ("masses_kg", "words"),
    [
        ([0.01785] * 3 + [0.06785] * 2, "shots 1-3 as found, 4-5 with 50.00 g added"),
        ([0.06785, 0.01785, 0.03785], "shots 1 with 50.00 g added, 2 as found, 3 with 20.00 g added"),
        ([0.01785, 0.0178504], ""),
        ([0.02], ""),
        ([], ""),
    ],
)
def test_weights_in_words(masses_kg, words):
    assert weights_words(masses_kg) == words
