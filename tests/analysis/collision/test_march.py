"""The solver in plain Python, from mode to mode, against scipy's integration of the same bodies; and its limits."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest

from analysis.collision import (
    acting,
    crossings,
    exponentials,
    general,
    march,
    matrices,
    modes,
    propagator,
    rates,
    runge_kutta,
    system,
    two_bodies,
)
from analysis.collision.effects import named
from analysis.collision.effects.kernel import STATES
from analysis.collision.general import Active, direction
from analysis.collision.parameters import KERNEL_ORDER, Collision, Variant
from tests.analysis.collision.hybrid import Beside, Hybrid, moved
from tests.analysis.collision.plain import made_plain

RIG = Collision(0.02, -0.3, 300.0, 2e-3, 3e3, 0.3)
TIME_S = np.arange(-8, 120) * 2.5e-4 + 1.1e-4
PULL = (2e-3, 8e-5)


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """Let the solver and the effects be called in plain Python."""
    every = (crossings, exponentials, march, matrices, modes, propagator, rates, runge_kutta, system, two_bodies)
    made_plain(monkeypatch, *every)
    numbers, functions = count(1), {}

    def numbered(function: Any) -> int:
        functions[number := next(numbers)] = function
        return number

    def called(number: int, s: Any, p: Any, first: int) -> None:
        functions[int(number)](s, p[first:], s[STATES:])

    monkeypatch.setattr(acting, "address", numbered)
    monkeypatch.setattr(acting, "complex_address", numbered)
    monkeypatch.setattr(rates, "call_within", called)
    yield monkeypatch


def effects_of(beside: Beside) -> tuple[list[Active], dict[str, int]]:
    """Return the catalogue's effects that are these, and the directions of their numbers."""
    out, at = [], {}
    if beside.mode:
        mass, omega, damping = beside.mode
        at |= {"mode.0": direction(0, 0), "mode.2": direction(0, 2)}
        out.append(Active(named("block_mode"), (mass, omega / (2 * np.pi), damping)))
    if beside.adhesion:
        at |= {f"adhesion.{k}": direction(len(out), k) for k in (0, 1)}
        out.append(Active(named("adhesion"), beside.adhesion))
    if beside.friction_n:
        at["friction_n"] = direction(len(out), 0)
        out.append(Active(named("coulomb_friction"), (beside.friction_n,)))
    if beside.cubic_n_per_m3:
        at["cubic_n_per_m3"] = direction(len(out), 0)
        out.append(Active(named("cubic_stiffness"), (beside.cubic_n_per_m3,)))
    return out, at


CASES = [
    (RIG, Beside()),
    (replace(RIG, variant=Variant.CLAMPED), Beside()),
    (replace(RIG, variant=Variant.NO_TENSION, contact_damping_n_s_per_m=2.5), Beside()),
    (replace(RIG, plate_displacement_m=2e-5, plate_velocity_m_per_s=0.02), Beside(friction_n=0.02)),
    (replace(RIG, variant=Variant.CLAMPED), Beside(adhesion=PULL, friction_n=0.02)),
    (RIG, Beside(mode=(2e-3, 900.0, 0.1))),
]
STEPPED = [*CASES, (RIG, Beside(cubic_n_per_m3=4e6))]


@pytest.mark.parametrize("place", range(len(CASES)))
def test_in_closed_form_it_is_scipys_solution_with_its_events_and_derivatives(place: int) -> None:
    check(*CASES[place], KERNEL_ORDER[:7])


@pytest.mark.parametrize("place", range(2, len(STEPPED)))
def test_step_by_step_it_is_scipys_solution_too(place: int, plain: pytest.MonkeyPatch) -> None:
    plain.setattr(march, "in_closed_form", lambda *_: march.NOT_LINEAR)
    check(*STEPPED[place], ("contact_stiffness_n_per_m", "velocity_in_m_per_s"))


def check(collision: Collision, beside: Beside, by: Sequence[str]) -> None:
    """Compare states, events and derivatives with those of the same bodies integrated by scipy."""
    effects, at = effects_of(beside)
    wanted = {name: KERNEL_ORDER.index(name) for name in by} | at
    run = general.solve(collision, effects, TIME_S, directions=list(wanted.values()))
    exact = Hybrid(collision, beside)
    states = exact.solved(TIME_S)
    kinds = [kind for kind, _ in exact.events if kind != "apart" and (effects or kind != "turn")]
    times = np.array([t for kind, t in exact.events if kind in kinds])
    assert [event.kind for event in run.events] == kinds
    np.testing.assert_allclose([event.time_s for event in run.events], times, atol=1e-11)
    assert np.abs(run.displacement_m - states[:, 0]).max() < 1e-12
    assert np.abs(run.velocity_m_per_s - states[:, 1]).max() < 1e-9
    met = np.isfinite(states[:, 2]) & ((times[-1] > TIME_S) | (beside.cubic_n_per_m3 == 0.0))  # then it rings by itself
    assert np.abs(run.plate_displacement_m - states[:, 2])[met].max() < 1e-11
    assert np.abs(run.plate_velocity_m_per_s - states[:, 3])[met].max() < 1e-7
    for column, name in enumerate(wanted):
        size = abs(value_of(collision, beside, name)) or {"plate_displacement_m": 1e-5}.get(name, 0.1)
        ahead, back = (Hybrid(*moved(collision, beside, name, sign * 1e-4 * size)) for sign in (1, -1))
        difference = (ahead.solved(TIME_S)[:, 0] - back.solved(TIME_S)[:, 0]) / 2e-4
        found = run.displacement_derivatives[:, column] * size
        assert np.abs(found - difference).max() < 2e-5 * np.abs(difference).max(), name
        slopes = [(a[1] - b[1]) / 2e-4 for a, b in zip(ahead.events, back.events, strict=True) if a[0] in kinds]
        told = [event.time_derivatives[column] * size for event in run.events]
        np.testing.assert_allclose(told, slopes, rtol=1e-4, atol=1e-8, err_msg=name)


def value_of(collision: Collision, beside: Beside, name: str) -> float:
    """Return the number that ``moved`` would change."""
    plain, _, place = name.partition(".")
    value: Any = getattr(collision if hasattr(collision, plain) else beside, plain)
    return float(value[int(place)] if place else value)
