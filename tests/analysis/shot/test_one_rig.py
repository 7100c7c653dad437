"""Shots that may be judged together: of one model, whatever their masses and plates."""

from dataclasses import replace

from analysis.shot.plates_of_set import why_not_together
from analysis.shot.recording import Plate, Setup
from tests.app import synthetic

PLATE = Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8.51e3, 131e9)


def test_shots_of_other_weights_and_plates_go_together():
    shot = synthetic.shot()
    plates = (PLATE, None, replace(PLATE, thickness_m=0.5e-3))
    shots = [replace(shot, setup=Setup(0.018 + 0.05 * k, plate=plate)) for k, plate in enumerate(plates)]
    assert why_not_together(shots) is None


def test_shots_of_two_models_are_said():
    one = synthetic.shot()
    other = replace(one, settings=replace(one.settings, model="contact"))
    assert "different base models (contact, paper)" in str(why_not_together([one, other]))
