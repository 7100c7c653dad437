"""The Runge-Kutta stepper: as exact as the closed form without effects, with true derivatives for every effect."""

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE, kernel
from analysis.collision.effects.row import Acts, Effect, Parameter
from analysis.collision.parameters import PAPER, Infeasible, Variant
from analysis.collision.solver import general, march

TIME_S = np.arange(-500, 4500) * 1e-5
BENDS = (0.3, -2.0, 1e4, 3e6, -2e9)  # of a made-up law of the bend, in N per power of the metre


def of_the_bend(s: Any, p: Any, out: Any) -> None:
    """Add -(c_0 y^2 + c_1 y^3 + ...) to the plate, more coefficients than any row of the catalogue has."""
    power = s[kernel.Y] * s[kernel.Y]
    for k in range(5):
        out[kernel.ON_PLATE] -= p[k] * power
        power *= s[kernel.Y]


MECHANICAL = [name for name, effect in CATALOGUE.items() if effect.kernel is not None]


@pytest.mark.parametrize("variant", list(Variant))
def test_without_effects_it_is_the_exact_solution(variant: Variant, monkeypatch: pytest.MonkeyPatch) -> None:
    collision = replace(PAPER, variant=variant)
    truth = general.solve(collision, (), TIME_S, directions=range(7))
    monkeypatch.setattr(march, "in_closed_form", lambda *_: march.NOT_LINEAR)
    run = general.solve(collision, [], TIME_S, directions=range(7))
    assert np.abs(run.displacement_m - truth.displacement_m).max() < 1e-14
    assert np.abs(run.plate_displacement_m - truth.plate_displacement_m).max() < 2e-12
    scale = np.abs(truth.displacement_derivatives).max(axis=0)
    assert np.all(np.abs(run.displacement_derivatives - truth.displacement_derivatives).max(axis=0) < 1e-9 * scale)
    changes = [event for event in run.events if event.kind != "turn"]
    assert [e.time_s for e in changes] == pytest.approx([e.time_s for e in truth.events], abs=1e-11)


@pytest.mark.parametrize("name", MECHANICAL)
def test_derivatives_are_those_of_the_solution(name: str) -> None:
    effect = CATALOGUE[name]
    larger = 1.0 if effect.inverse else 10.0  # so that rounding stays small beside the effect
    values = tuple((larger if p.name == effect.amplitude else 1.0) * p.scale for p in effect.parameters)
    places = [general.direction(0, place) for place in range(len(values))]
    run = general.solve(PAPER, [general.ActiveEffect(effect, values)], TIME_S, directions=places)
    for place, value in enumerate(values):
        # A central difference of third order: steps of h and 2 h.
        h = 2e-3 * value
        shifted = []
        for times in (-2, -1, 1, 2):
            other = tuple(v + times * h if p == place else v for p, v in enumerate(values))
            shifted.append(general.solve(PAPER, [general.ActiveEffect(effect, other)], TIME_S).displacement_m)
        difference = (shifted[0] - 8 * shifted[1] + 8 * shifted[2] - shifted[3]) / (12 * h)
        column = run.displacement_derivatives[:, place]
        # Events cross the sampling instants between the four solutions; their kinks are what is left.
        noise = 2e-15 / h
        assert np.abs(difference - column).max() < 2e-3 * np.abs(column).max() + noise


def test_a_law_may_have_many_coefficients() -> None:
    parameters = tuple(Parameter(f"c_{k}", "", 1.0) for k in range(5))
    law = Effect("of_the_bend", "", Acts.ON_PLATE, parameters, "c_0", of_the_bend)
    friction = general.ActiveEffect(CATALOGUE["coulomb_friction"], (2e-5,))
    by = [*(general.direction(0, k) for k in range(5)), general.direction(1, 0)]
    run = general.solve(PAPER, [general.ActiveEffect(law, BENDS), friction], TIME_S, directions=by)
    for k, value in enumerate(BENDS):
        sides = []
        for sign in (1, -1):
            moved = tuple(v * (1 + 1e-4 * sign) if i == k else v for i, v in enumerate(BENDS))
            sides.append(general.solve(PAPER, [general.ActiveEffect(law, moved), friction], TIME_S).displacement_m)
        column = run.displacement_derivatives[:, k] * value
        difference = (sides[0] - sides[1]) / 2e-4
        assert np.abs(difference - column).max() < 2e-4 * np.abs(column).max() + 1e-11
    alone = general.solve(PAPER, [friction], TIME_S, directions=[general.direction(0, 0)]).displacement_derivatives[
        :, 0
    ]
    assert np.abs(run.displacement_derivatives[:, 5]).max() == pytest.approx(np.abs(alone).max(), rel=0.5)


@pytest.mark.parametrize("stepper", ["in closed form", "step by step"])
def test_what_swings_too_fast_to_be_followed_is_refused(stepper: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if stepper == "step by step":
        monkeypatch.setattr(march, "in_closed_form", lambda *_: march.NOT_LINEAR)
    stiff = replace(PAPER, plate_stiffness_n_per_m=1e-3, contact_damping_n_s_per_m=5e6)
    general.solve(PAPER, [], TIME_S)  # compiled from here on
    began = time.thread_time()
    with pytest.raises(Infeasible, match="more steps than a solution may take"):
        general.solve(stiff, [], TIME_S)
    assert time.thread_time() - began < 5.0  # minutes, before
    damped = replace(PAPER, contact_damping_n_s_per_m=100.0 if stepper == "step by step" else 1e3)
    assert np.isfinite(general.solve(damped, [], TIME_S).displacement_m).all()  # overdamped, and followed to its end


@pytest.mark.parametrize("share", [0.9, 0.99, 0.999, 1.001])
def test_a_block_that_hardly_leaves_the_range_of_an_attraction_leaves_it(share: float) -> None:
    """Of the gap's peak between two touches: an excursion may be shorter than a step, which ends within the range."""
    time_s = np.arange(400) * 1e-5

    def run(effect: Effect, range_m: float) -> general.Trajectory:
        return general.solve(PAPER, [general.ActiveEffect(effect, (6e-5, range_m))], time_s)

    adhesion = CATALOGUE["adhesion"]
    far = run(adhesion, 1e-3)
    range_m = share * float((far.displacement_m - far.contact_point_m)[:130].max())
    closed, stepped = (run(effect, range_m) for effect in (adhesion, replace(adhesion, nonlinear=True)))
    assert np.abs(closed.displacement_m - stepped.displacement_m).max() < 1e-15
    events = [[event.kind for event in trajectory.events] for trajectory in (closed, stepped)]
    assert events[0] == events[1] and events[0].count("range") == (2 if share < 1.0 else 0)
