"""The plates and weights of a set of shots: what they are called, and which shots go together."""

from dataclasses import replace

import pytest

from analysis.shot.plates_of_set import weights_words, why_not_together
from analysis.shot.recording import Plate, Setup
from tests.app import synthetic

PLATE = Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8.51e3, 131e9)


def test_shots_of_other_weights_and_plates_go_together():
    shot = synthetic.shot()
    plates = (PLATE, None, replace(PLATE, thickness_m=0.5e-3))
    shots = [replace(shot, setup=Setup(0.018 + 0.05 * k, plate=plate)) for k, plate in enumerate(plates)]
    assert why_not_together(shots) is None


def test_shots_of_two_models_are_refused_in_words():
    one = synthetic.shot()
    other = replace(one, settings=replace(one.settings, model="contact"))
    assert "different base models (contact, paper)" in str(why_not_together([one, other]))


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
