"""Laws of every collision at random parameters: scaling, energy, time reversal, derivatives, the hard limit."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from analysis.collision.effects import effect_named
from analysis.collision.parameters import PAPER, Collision, Infeasible, Variant
from analysis.collision.solver import general
from tests.analysis.collision.simulated import with_vector

RIGS = st.builds(
    Collision,
    block_mass_kg=st.floats(5e-3, 5e-2),
    velocity_in_m_per_s=st.floats(-0.6, -0.05),
    plate_stiffness_n_per_m=st.floats(50, 1000),
    plate_mass_kg=st.floats(5e-5, 1e-3),
    contact_stiffness_n_per_m=st.floats(2e3, 5e4),
    contact_damping_n_s_per_m=st.floats(0.05, 1.5),
    variant=st.sampled_from(list(Variant)),
)


def times(rig: Collision) -> np.ndarray:
    return np.linspace(-0.002, 1.4 * rig.contact_time_estimate_s, 1500)


def solved(rig: Collision, time_s: np.ndarray, *, derivatives: bool = False) -> general.Trajectory:
    """Solve a rig that does not chatter for ever: such a one is refused, as the solver says."""
    try:
        return general.solve(rig, (), time_s, directions=range(7) if derivatives else ())
    except Infeasible:
        reject()


@settings(max_examples=20, deadline=None)
@given(rig=RIGS, factor=st.floats(0.1, 10.0))
def test_the_base_model_is_linear_in_the_speed(rig: Collision, factor: float) -> None:
    one = solved(rig, times(rig), derivatives=True)
    other = solved(rig.at_speed(factor * rig.velocity_in_m_per_s), times(rig))
    # Where the bodies only just touch, rounding is magnified as any small change is.
    magnified = np.linalg.norm(one.displacement_derivatives[:, :5] * rig.vector[:5], axis=1).max()
    assert np.abs(other.displacement_m - factor * one.displacement_m).max() < 1e-10 * factor * magnified


@settings(max_examples=20, deadline=None)
@given(rig=RIGS, factor=st.floats(0.2, 5.0))
def test_masses_and_forces_scale_together(rig: Collision, factor: float) -> None:
    heavier = replace(
        rig,
        block_mass_kg=factor * rig.block_mass_kg,
        plate_mass_kg=factor * rig.plate_mass_kg,
        plate_stiffness_n_per_m=factor * rig.plate_stiffness_n_per_m,
        contact_stiffness_n_per_m=factor * rig.contact_stiffness_n_per_m,
        contact_damping_n_s_per_m=factor * rig.contact_damping_n_s_per_m,
    )
    one, other = solved(rig, times(rig), derivatives=True), solved(heavier, times(rig))
    magnified = np.linalg.norm(one.displacement_derivatives[:, :5] * rig.vector[:5], axis=1).max()
    assert np.abs(other.displacement_m - one.displacement_m).max() < 1e-10 * magnified


@settings(max_examples=20, deadline=None)
@given(rig=RIGS)
def test_a_dashpot_only_takes_energy(rig: Collision) -> None:
    run = solved(rig, times(rig))
    kinetic = rig.block_mass_kg * run.velocity_m_per_s**2 + rig.plate_mass_kg * run.plate_velocity_m_per_s**2
    bent = rig.plate_stiffness_n_per_m * run.plate_displacement_m**2
    pressed = rig.contact_stiffness_n_per_m * np.maximum(-run.gap_m, 0.0) ** 2
    total = 0.5 * (kinetic + bent + pressed)[run.time_s >= 0]
    if rig.variant is not Variant.NO_TENSION:  # there what is still pressed in at the release is let go of
        assert np.all(np.diff(total) <= 1e-12 * total[0])
    assert np.all(total <= total[0] * (1 + 1e-12))


@settings(max_examples=15, deadline=None)
@given(rig=RIGS, place=st.integers(0, 4))
def test_derivatives_are_those_of_the_trajectory(rig: Collision, place: int) -> None:
    run = solved(rig, times(rig), derivatives=True)
    vector = rig.vector
    h = 1e-6 * abs(vector[place])
    sides = []
    for sign in (-1, 1):
        moved = vector.copy()
        moved[place] += sign * h
        sides.append(solved(with_vector(rig, moved), times(rig)))
    if len({len(side.events) for side in (*sides, run)}) > 1:
        return  # a bounce more on one side: there is no derivative
    difference = (sides[1].displacement_m - sides[0].displacement_m) / (2 * h)
    column = run.displacement_derivatives[:, place]
    # The acceleration jumps at a touch: samples within its shift differ by second order in h, over h.
    magnified = np.linalg.norm(run.displacement_derivatives[:, :5] * vector[:5], axis=1).max() / abs(vector[place])
    assert np.abs(difference - column).max() < 1e-3 * magnified


@pytest.mark.parametrize(
    ("name", "values"), [("cubic_stiffness", (3e6,)), ("bearing_gradient", (5.0,)), ("contact_exponent", (0.4,))]
)
def test_with_a_potential_the_film_runs_backwards(name: str, values: tuple[float, ...]) -> None:
    bare = replace(PAPER, contact_damping_n_s_per_m=0.0)
    effects = [general.ActiveEffect(effect_named(name), values)]
    there = general.solve(bare, effects, np.array([0.0, 0.06]))
    release = there.released
    assert release is not None
    x, v, y, u = release.state[:4]
    back = replace(bare, velocity_in_m_per_s=-v, plate_displacement_m=y, plate_velocity_m_per_s=-u)
    run = general.solve(back, effects, np.array([release.time_s]))
    assert x == pytest.approx(y, abs=1e-15)
    assert run.displacement_m[-1] == pytest.approx(0.0, abs=1e-9)
    assert run.velocity_m_per_s[-1] == pytest.approx(0.265, abs=1e-6)


def test_a_contact_without_give_is_an_elastic_bounce_after_another() -> None:
    # k_N to infinity without damping: the first bounce is that of two free masses, whatever the plate's spring.
    m_b, m_p = PAPER.block_mass_kg, PAPER.plate_mass_kg
    plate_after = -2 * m_b / (m_b + m_p) * 0.265
    errors = []
    for factor in (1e2, 1e4, 1e6):
        hard = replace(PAPER, contact_stiffness_n_per_m=1e4 * factor, contact_damping_n_s_per_m=0.0)
        swing = math.pi * math.sqrt(1 / (hard.contact_stiffness_n_per_m * (1 / m_b + 1 / m_p)))
        run = general.solve(hard, (), np.array([0.0, 2 * swing]))
        release = next(event for event in run.events if event.kind == "release")
        assert release.time_s == pytest.approx(swing, rel=10 / factor)
        errors.append(abs(release.state[3] / plate_after - 1))
    assert errors[0] < 2e-2
    assert errors[2] < 1e-3 * errors[0]
