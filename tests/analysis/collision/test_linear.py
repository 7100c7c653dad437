"""The closed form of linear effects: the same motion as step by step, refused for an effect that is not linear."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE
from analysis.collision.parameters import PAPER, Infeasible, Variant
from analysis.collision.solver import general, march

TIME_S = np.arange(-1500, 4500) * 1e-5 - 3.3e-6
LINEAR = (
    "coulomb_friction",
    "viscous_drag",
    "tilt",
    "bearing_gradient",
    "block_mode",
    "plate_damping",
    "viscoelastic_arm",
    "second_plate_mode",
    "support_compliance",
)
OTHERS = ("quadratic_drag", "cubic_stiffness", "contact_exponent", "nonlinear_contact_damping")


def active(*names: str) -> list[general.ActiveEffect]:
    rows = sorted((CATALOGUE[name] for name in names), key=lambda row: row.hidden == 0)
    return [general.ActiveEffect(row, tuple(p.scale for p in row.parameters)) for row in rows]


def directions(effects: Sequence[general.ActiveEffect]) -> list[int]:
    own = [general.direction(slot, place) for slot, one in enumerate(effects) for place in range(len(one.values))]
    return [0, 1, 2, 3, 4, *own]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """What the closed form answered, call by call."""
    answers: list[int] = []
    closed = march.in_closed_form

    def integrate(*arguments: Any) -> int:
        answers.append(int(closed(*arguments)))
        return answers[-1]

    monkeypatch.setattr(march, "in_closed_form", integrate)
    return answers


@pytest.mark.parametrize("variant", list(Variant))
@pytest.mark.parametrize("names", [*((name,) for name in LINEAR), ("block_mode", "coulomb_friction")])
def test_it_is_what_steps_lead_to(names: tuple[str, ...], variant: Variant, monkeypatch: pytest.MonkeyPatch) -> None:
    collision, effects = replace(PAPER, variant=variant), active(*names)
    run = general.solve(collision, effects, TIME_S, directions=directions(effects))
    monkeypatch.setattr(march, "in_closed_form", lambda *_: march.NOT_LINEAR)
    steps = general.solve(collision, effects, TIME_S, directions=directions(effects))
    assert np.abs(run.displacement_m - steps.displacement_m).max() < 1e-14
    scale = np.abs(steps.displacement_derivatives).max(axis=0)
    assert np.all(np.abs(run.displacement_derivatives - steps.displacement_derivatives).max(axis=0) < 1e-8 * scale)
    assert [event.kind for event in run.events] == [event.kind for event in steps.events]
    for one, other in zip(run.events, steps.events, strict=True):
        assert one.time_s == pytest.approx(other.time_s, abs=1e-12)
        (found, known) = (event.state_derivatives[:, 0] for event in (one, other))
        assert found == pytest.approx(known, rel=1e-6, abs=1e-7 * np.abs(known).max())


@pytest.mark.parametrize("names", [(), *((name,) for name in LINEAR), LINEAR[4:7]])
def test_means_are_those_of_the_samples(names: tuple[str, ...], asked: list[int]) -> None:
    effects = active(*names)
    every = general.solve(PAPER, effects, TIME_S, directions=directions(effects))
    means = general.solve(PAPER, effects, TIME_S[:-3], directions=directions(effects), block=5)
    assert min(asked) > 0
    for one, other in (
        (means.time_s, every.time_s),
        (means.displacement_m, every.displacement_m),
        (means.velocity_m_per_s, every.velocity_m_per_s),
        (means.displacement_derivatives, every.displacement_derivatives),
    ):
        expected = general.averaged(other[:-5], 5)
        assert one.shape == expected.shape
        assert np.abs(one - expected).max() < 1e-10 * np.abs(expected).max() + 1e-15
    assert every.released is not None  # after which the plate is left to ring, from the next instant looked at
    together, expected = means.time_s < every.released.time_s, general.averaged(every.contact_point_m[:-5], 5)
    assert np.abs(means.contact_point_m - expected)[together].max() < 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("spacing_s", [0.9e-4, 1.4e-4, 2.5e-4])  # one, two and three steps to a sample in contact
@pytest.mark.parametrize("names", [(), ("viscous_drag",)])
def test_means_of_coarse_samples_are_those_of_the_samples(names: tuple[str, ...], spacing_s: float) -> None:
    time_s = np.arange(-12, 480) * spacing_s
    every = general.solve(PAPER, active(*names), time_s, directions=(0, 1))
    for asked_for in ((), (0, 1)):
        means = general.solve(PAPER, active(*names), time_s, directions=asked_for, block=4)
        expected = general.averaged(every.displacement_m, 4)
        assert np.abs(means.displacement_m - expected).max() < 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("names", [(), ("coulomb_friction",), ("viscous_drag", "tilt"), ("block_mode",)])
def test_means_without_derivatives_are_those_with_them(names: tuple[str, ...], asked: list[int]) -> None:
    effects, random, touched = active(*names), np.random.default_rng(5), []
    for _ in range(20):
        factors = 10.0 ** random.uniform(-1.0, 1.0, 4)
        rig = replace(
            PAPER,
            plate_stiffness_n_per_m=factors[0] * PAPER.plate_stiffness_n_per_m,
            plate_mass_kg=factors[1] * PAPER.plate_mass_kg,
            contact_stiffness_n_per_m=factors[2] * PAPER.contact_stiffness_n_per_m,
            contact_damping_n_s_per_m=factors[3] * PAPER.contact_damping_n_s_per_m,
        )
        time_s = TIME_S - random.uniform(0.0, 1e-5)
        try:
            plain = general.solve(rig, effects, time_s, block=5)
        except Infeasible:
            continue
        full = general.solve(rig, effects, time_s, directions=directions(effects), block=5)
        assert [event.kind for event in plain.events] == [event.kind for event in full.events]
        assert np.abs(plain.displacement_m - full.displacement_m).max() < 1e-14
        assert np.abs(plain.contact_point_m - full.contact_point_m).max() < 1e-14
        assert np.abs(plain.velocity_m_per_s - full.velocity_m_per_s).max() < 1e-10
        touched.append(sum(event.kind == "touch" for event in plain.events))
    assert len(touched) > 10 and max(touched) > 2 and min(touched) == 1  # some bounce


def test_means_hold_where_something_swings_faster_than_they_show(asked: list[int]) -> None:
    effects = [general.ActiveEffect(CATALOGUE["second_plate_mode"], (5e-3, 5000.0, 0.01))]
    every = general.solve(PAPER, effects, TIME_S, directions=directions(effects))
    means = general.solve(PAPER, effects, TIME_S, directions=directions(effects), block=5)
    assert min(asked) > 0
    assert [event.time_s for event in means.events] == pytest.approx([e.time_s for e in every.events], abs=1e-14)
    for one, other in (
        (means.displacement_m, every.displacement_m),
        (means.displacement_derivatives, every.displacement_derivatives),
    ):
        expected = general.averaged(other, 5)
        assert np.all(np.abs(one - expected).max(axis=0) < 1e-8 * np.abs(expected).max(axis=0))


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_not_linear_is_seen(name: str, asked: list[int]) -> None:
    effects = active(name)
    general.solve(PAPER, effects, TIME_S)
    general.solve(PAPER, effects, TIME_S, directions=directions(effects))
    assert asked == [march.NOT_LINEAR, march.NOT_LINEAR]


def test_what_is_linear_only_as_its_coefficient_is_zero_is_seen(asked: list[int]) -> None:
    """Its motion is linear, but what a change of the coefficient does is not."""
    none, some = (general.ActiveEffect(CATALOGUE["cubic_stiffness"], (value,)) for value in (0.0, 1e3))
    run = general.solve(PAPER, [none], TIME_S, directions=[general.direction(0, 0)])
    assert asked == [march.NOT_LINEAR]
    moved = general.solve(PAPER, [some], TIME_S).displacement_m - run.displacement_m
    assert run.displacement_derivatives[:, 0] * 1e3 == pytest.approx(moved, abs=1e-3 * np.abs(moved).max())


@pytest.mark.parametrize("name", ["viscoelastic_arm", "block_mode", "support_compliance"])
def test_hidden_states_are_shown_between_steps_as_they_are_solved(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an arm that relaxes one number is shown, by a cubic between steps; of what swings two, by a quintic."""
    effects, within = active(name), TIME_S[(TIME_S > 0.0) & (TIME_S < 0.028)]
    closed = general.solve_with_modes(PAPER, effects, within).states
    monkeypatch.setattr(march, "in_closed_form", lambda *_: march.NOT_LINEAR)
    stepped = general.solve_with_modes(PAPER, effects, within).states
    assert closed.shape == stepped.shape and closed.shape[1] == 7
    assert np.all(np.abs(stepped - closed).max(axis=0) <= 2e-6 * np.abs(closed).max(axis=0))
    assert np.abs(closed[:, 5]).max() > 1e-6


def test_times_may_lie_anyhow() -> None:
    effects = active("support_compliance")
    some = np.sort(np.random.default_rng(1).uniform(TIME_S[0], TIME_S[-1], 200))
    at = general.solve(PAPER, effects, some)
    alone = [float(general.solve(PAPER, effects, np.array([t])).displacement_m[0]) for t in some[::20]]
    assert at.displacement_m[::20] == pytest.approx(alone, abs=1e-14)
