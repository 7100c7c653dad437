"""First-order responses of every candidate against finite differences of the whole model."""

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE
from analysis.collision.parameters import PAPER
from analysis.inference.fit.prepare import base_named, prepare
from analysis.inference.fit.response import Model, respond
from analysis.inference.fit.search import Problem
from analysis.inference.screen.tangents import Projection, base_tangents, candidates
from tests.analysis.collision.simulated import shot

OWN = np.array([-0.265, 0.0123456, 3.1e-3])
SHARED = PAPER.vector[:4]


@pytest.fixture(scope="module")
def problem() -> Problem:
    return Problem.of(Model(base_named("paper")), [prepare(shot(seed=2))])


def test_base_tangents(problem: Problem) -> None:
    parameters = np.concatenate([SHARED, OWN])
    tangents = base_tangents(problem, parameters)[0]
    for place, value in enumerate(parameters):
        h = 1e-5 * abs(value) if place != 5 else 1e-7
        sides = []
        for sign in (1, -1):
            moved = parameters.copy()
            moved[place] += sign * h
            sides.append(respond(problem.model, problem.shots[0], moved[:4], moved[4:]).displacement_m)
        difference = (sides[0] - sides[1]) / (2 * h)
        assert np.abs(difference - tangents[:, place]).max() < 1e-4 * np.abs(tangents[:, place]).max()


@pytest.mark.parametrize("name", [n for n, e in CATALOGUE.items() if n != "demodulation_lag" and not e.own])
def test_candidates(problem: Problem, name: str) -> None:
    effect = CATALOGUE[name]
    found = list(candidates(problem, np.concatenate([SHARED, OWN]), [name]))
    candidate = found[len(found) // 3]
    model = Model(base_named("paper"), (effect,))
    values = {p.name: candidate.point.get(p.name, p.scale) for p in effect.parameters}
    amplitude = 1e-3 * CATALOGUE[name].parameters[effect.index(effect.amplitude)].scale
    sides = []
    for size in (amplitude, -amplitude):
        values[effect.amplitude] = size
        if candidate.inverse:
            values[effect.amplitude] = np.copysign(1e4, size)
        chosen = tuple((f"{name}.{k}", float(v)) for k, v in values.items() if effect.parameters[effect.index(k)].fixed)
        model = Model(base_named("paper"), (effect,), chosen)
        shared = np.concatenate([SHARED, [values[n.split(".")[1]] for n in model.shared_effect_names]])
        own = np.concatenate([OWN, [0.0] * (len(model.own_names) - 3)])
        sides.append(respond(model, problem.shots[0], shared, own, derivatives=False).displacement_m)
    step = 2e-4 if candidate.inverse else 2 * amplitude
    difference = (sides[0] - sides[1]) / step
    column = candidate.columns[0][:, 0]
    # The oscillators' drive is taken straight between grid points, which costs parts in a thousand.
    assert np.abs(difference - column).max() < 2e-2 * np.abs(column).max() + 4e-15 / step


def test_the_projection_sees_what_is_there_and_little_else() -> None:
    motions = [shot(PAPER.at_speed(v), effects={"tilt": (1e-5,)}, seed=i) for i, v in enumerate((-0.15, -0.3))]
    from analysis.inference.fit.base_minimum import first_guesses
    from analysis.inference.fit.search import own_start, search

    shots = [prepare(motion) for motion in motions]
    problem = Problem.of(Model(base_named("paper")), shots)
    begin = first_guesses(base_named("paper"), shots, lambda: False)[0]
    minimum = search(problem, np.concatenate([begin, *(own_start(s, problem.model) for s in shots)]), lambda: False)
    projection = Projection(problem, minimum.parameters)
    some = list(candidates(problem, minimum.parameters, ["tilt", "viscous_drag", "contact_exponent"]))
    gains = {candidate.name: projection.gain(candidate) for candidate in some}
    assert max(gains, key=lambda name: gains[name].fall) == "tilt"
    tilt = gains["tilt"]
    assert abs(tilt.amplitudes[0] - 1e-5) < 4.5 * np.sqrt(tilt.covariance[0, 0])
    assert list(projection.falls(some)) == pytest.approx([gains[c.name].fall for c in some], rel=1e-6)
