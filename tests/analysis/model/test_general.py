"""The general integrator: as exact as the closed form without effects, and true derivatives with every effect."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.model import exact, general
from analysis.model.effects import CATALOGUE
from analysis.model.parameters import PAPER, Variant

TIME_S = np.arange(-500, 4500) * 1e-5
MECHANICAL = [name for name, effect in CATALOGUE.items() if effect.kernel is not None]


@pytest.mark.parametrize("variant", list(Variant))
def test_without_effects_it_is_the_exact_solution(variant: Variant) -> None:
    collision = replace(PAPER, variant=variant)
    truth = exact.solve(collision, TIME_S, derivatives=True)
    run = general.solve(collision, [], TIME_S, directions=range(7))
    assert np.abs(run.displacement_m - truth.displacement_m).max() < 1e-14
    assert np.abs(run.plate_displacement_m - truth.plate_displacement_m).max() < 2e-12
    scale = np.abs(truth.displacement_derivatives).max(axis=0)
    assert np.all(np.abs(run.displacement_derivatives - truth.displacement_derivatives).max(axis=0) < 1e-9 * scale)
    changes = [event for event in run.events if event.kind not in ("turn", "apart")]
    assert [e.time_s for e in changes] == pytest.approx(
        [e.time_s for e in truth.events if e.kind != "apart"], abs=1e-11
    )


@pytest.mark.parametrize("name", MECHANICAL)
def test_derivatives_are_those_of_the_solution(name: str) -> None:
    effect = CATALOGUE[name]
    larger = 1.0 if effect.inverse else 10.0  # so that rounding stays small beside the effect
    values = tuple((larger if p.name == effect.amplitude else 1.0) * p.scale for p in effect.parameters)
    places = [general.direction(0, place) for place in range(len(values))]
    run = general.solve(PAPER, [general.Active(effect, values)], TIME_S, directions=places)
    for place, value in enumerate(values):
        # A central difference of third order: steps of h and 2 h.
        h = 2e-3 * value
        shifted = []
        for times in (-2, -1, 1, 2):
            other = tuple(v + times * h if p == place else v for p, v in enumerate(values))
            shifted.append(general.solve(PAPER, [general.Active(effect, other)], TIME_S).displacement_m)
        difference = (shifted[0] - 8 * shifted[1] + 8 * shifted[2] - shifted[3]) / (12 * h)
        column = run.displacement_derivatives[:, place]
        # Events cross the sampling instants between the four solutions; their kinks are what is left.
        noise = 2e-15 / h
        assert np.abs(difference - column).max() < 2e-3 * np.abs(column).max() + noise
