"""The plates and weights of a set of shots: what they are called, and which shots go together."""

from dataclasses import replace

import pytest

from analysis.shot.plates_of_set import describe_plates, describe_weights, plate_count, plate_numbers, why_no_joint_fit
from analysis.shot.recording import Plate, Setup
from tests.app import synthetic

PLATE = Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8.51e3, 131e9)


def test_shots_of_other_weights_and_plates_go_together():
    shot = synthetic.shot()
    plates = (PLATE, None, replace(PLATE, thickness_m=0.5e-3))
    shots = [replace(shot, setup=Setup(0.018 + 0.05 * k, plate=plate)) for k, plate in enumerate(plates)]
    assert why_no_joint_fit(shots) is None


def test_shots_of_two_models_are_refused_in_words():
    one = synthetic.shot()
    other = replace(one, settings=replace(one.settings, model="contact"))
    assert "different base models (contact, paper)" in str(why_no_joint_fit([one, other]))


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
    assert describe_weights(masses_kg) == words


@pytest.mark.parametrize(("thicker", "same"), [(1.031, True), (1.033, False), (0.966, True), (0.965, False)])
def test_plates_within_a_tenth_of_the_stiffness_are_one(thicker, same):
    """Stiffness goes with the cube of the thickness."""
    motion = synthetic.shot().motion
    plates = (PLATE, replace(PLATE, thickness_m=thicker * PLATE.thickness_m), None, PLATE)
    motions = [replace(motion, plate=plate) for plate in plates]
    assert plate_numbers(motions) == ((0, 0, 0, 0) if same else (0, 1, 1, 0))
    assert plate_count(motions) == (1 if same else 2) and plate_count([]) == 1
    assert describe_plates(motions) == ("" if same else "shots 1 on plate 1, 2-3 on plate 2, 4 on plate 1")
    assert plate_numbers([replace(motion, plate=None), motions[1]]) == (0, 0)
