"""Shots that may be judged together: of one model and one plate, whatever their masses."""

from dataclasses import replace

import pytest

from analysis.one_rig import why_not_together
from analysis.recording import Plate, Setup
from app.command_line.replay import _diagnosis
from tests.app import synthetic

PLATE = Plate(15e-3, 2e-3, 0.3e-3, 10e-3, 8.51e3, 131e9)
THICK = replace(PLATE, thickness_m=0.5e-3)


def _shots(*plates):
    shot = synthetic.shot()
    return [replace(shot, setup=Setup(0.018 + 0.05 * k, plate=plate)) for k, plate in enumerate(plates)]


@pytest.mark.parametrize(
    "plates",
    [(PLATE, PLATE), (PLATE, None), (None, None), (PLATE, replace(PLATE, thickness_m=0.305e-3))],
    ids=["one plate", "not stated", "none stated", "measured again"],
)
def test_shots_of_one_plate_go_together_with_any_weights(plates):
    assert why_not_together(_shots(*plates)) is None


def test_another_plate_is_said_and_not_fitted_as_if_it_were_the_first(capsys):
    shots = _shots(PLATE, None, PLATE, THICK, THICK)
    why = why_not_together(shots)
    assert why == "the shots are of different plates (1-3 one, 4-5 another): select one's"
    assert _diagnosis(shots, ()) is None
    assert capsys.readouterr().err.strip() == f"levimass: no joint diagnosis: {why}"


def test_a_plate_that_cannot_be_decides_nothing():
    assert why_not_together(_shots(PLATE, replace(PLATE, arm_width_m=0.1))) is None


def test_shots_of_two_models_are_said():
    one, other = _shots(None, None)
    other = replace(other, settings=replace(other.settings, model="contact"))
    assert "different base models (contact, paper)" in str(why_not_together([one, other]))
