"""The exact solver against the reference table of docs/physics.md, "the model", to its digits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.parameters import PAPER, Variant
from analysis.collision.solver.gear import simulate
from analysis.collision.solver.general import solve

ONSETS_S = [0.0, 1.56573968e-3, 2.34904083e-3]
RELEASES_S = [0.45318387e-3, 2.16218652e-3, 28.70771255e-3]


def test_events_and_outgoing_velocity() -> None:
    run = solve(PAPER, (), np.array([0.06]))
    onsets = [e.time_s for e in run.events if e.kind == "touch"]
    releases = [e.time_s for e in run.events if e.kind == "release"]
    assert onsets == pytest.approx(ONSETS_S, abs=1e-11)
    assert releases == pytest.approx(RELEASES_S, abs=1e-11)
    assert run.velocity_m_per_s[-1] == pytest.approx(0.261702343, abs=5.1e-10)
    assert run.velocity_m_per_s[-1] / 0.265 == pytest.approx(0.987556, abs=5.1e-7)


def test_peak_force_and_deflection() -> None:
    time_s = np.arange(0.0, 0.03, 1e-7)
    run = solve(PAPER, (), time_s)
    peak = int(np.argmax(run.force_n))
    assert run.force_n[peak] == pytest.approx(0.511915, abs=5.1e-7)
    assert time_s[peak] == pytest.approx(14.3312e-3, abs=1e-7)
    assert -run.displacement_m.min() == pytest.approx(2.388512e-3, abs=5.1e-10)
    first = [(0.0, 0.45e-3, 0.16220e-3), (1.5e-3, 2.1e-3, 1.77080e-3), (2.35e-3, 3.3e-3, 2.67670e-3)]
    for begin, end, at in first:
        inside = (time_s > begin) & (time_s < end)
        assert time_s[inside][np.argmax(run.force_n[inside])] == pytest.approx(at, abs=1e-7)


def test_clamped_variant() -> None:
    run = solve(replace(PAPER, variant=Variant.CLAMPED), (), np.arange(0.0, 0.06, 1e-6))
    assert run.velocity_m_per_s[-1] == pytest.approx(0.261136, abs=6e-7)
    onsets = [e.time_s for e in run.events if e.kind == "touch"]
    assert onsets == pytest.approx([0.0, 1.737e-3, 2.792e-3, *onsets[3:]], abs=6e-7)
    for begin, end, at in [(0.0, 0.4e-3, 0.162e-3), (1.73e-3, 2.3e-3, 1.934e-3), (2.8e-3, 3.3e-3, 3.029e-3)]:
        inside = (run.time_s > begin) & (run.time_s < end)
        assert run.time_s[inside][np.argmax(run.force_n[inside])] == pytest.approx(at, abs=1.1e-6)


def test_no_tension_never_pulls() -> None:
    run = solve(replace(PAPER, variant=Variant.NO_TENSION), (), np.arange(0.0, 0.06, 1e-5))
    assert run.force_n.min() >= -1e-12
    assert [e.kind for e in run.events] == ["touch", "release"] * 3


def test_gear_agrees_within_its_own_error() -> None:
    exact = solve(PAPER, (), np.arange(4001) * 1e-5)
    coarse = simulate(PAPER, 0.04, every=100)[:, 1]
    fine = simulate(PAPER, 0.04, step_s=2e-8, every=500)[:, 1]
    error = np.abs(coarse - exact.velocity_m_per_s).max()
    # Contact switches between steps: an error of first order, so a fifth of the step leaves about a fifth of it.
    assert error < 3e-6
    assert np.abs(fine - exact.velocity_m_per_s).max() < 0.5 * error
    assert coarse[-1] == pytest.approx(exact.velocity_m_per_s[-1], abs=3e-7)


def test_gears_steps_are_those_of_its_matrices() -> None:
    """Eq. 5-8 in their printed form: prediction by Pascal's triangle, correction by one column of coefficients."""
    step_s, steps = 8e-6, 250
    x, v, y, *_ = simulate(PAPER, steps * step_s, step_s=step_s).T
    predict = np.array([[math.comb(column, row) for column in range(6)] for row in range(6)], float)
    correct = np.array([3 / 16, 251 / 360, 1.0, 11 / 18, 1 / 6, 1 / 60])
    block, plate = np.zeros(6), np.zeros(6)  # x^(n) h^n / n!
    block[1] = PAPER.velocity_in_m_per_s * step_s
    for step in range(1, steps + 1):
        block, plate = predict @ block, predict @ plate
        overlap, rate = plate[0] - block[0], (plate[1] - block[1]) / step_s
        stiffness, damping = PAPER.contact_stiffness_n_per_m, PAPER.contact_damping_n_s_per_m
        force = stiffness * overlap + damping * rate if overlap > 0.0 else 0.0
        pull = -PAPER.plate_stiffness_n_per_m * plate[0] - force
        block = block + correct * (0.5 * step_s**2 * force / PAPER.block_mass_kg - block[2])
        plate = plate + correct * (0.5 * step_s**2 * pull / PAPER.plate_mass_kg - plate[2])
        assert x[step] == pytest.approx(block[0], rel=1e-11)
        assert y[step] == pytest.approx(plate[0], rel=1e-11)
        assert v[step] * step_s == pytest.approx(block[1], rel=1e-11)


@pytest.mark.parametrize("variant", list(Variant))
@pytest.mark.parametrize("displacement_m", [0.0, -2e-5])
def test_gear_follows_every_contact_law(variant: Variant, displacement_m: float) -> None:
    """On a plate that swings before it is met; the laws differ by fifty times what is allowed, and more."""
    collision = replace(PAPER, variant=variant, plate_displacement_m=displacement_m, plate_velocity_m_per_s=3e-3)
    exact = solve(collision, (), np.arange(401) * 1e-4)
    x, v, y, u, force = simulate(collision, 0.04, every=1000).T
    np.testing.assert_allclose(x, exact.displacement_m, atol=1e-8)
    np.testing.assert_allclose(v, exact.velocity_m_per_s, atol=6e-6)
    np.testing.assert_allclose(y, exact.plate_displacement_m, atol=1e-7)
    np.testing.assert_allclose(u, exact.plate_velocity_m_per_s, atol=6e-4)
    np.testing.assert_allclose(force[1:], exact.force_n[1:], atol=1e-3)  # at the touch it has none yet


def test_gear_refuses_steps_and_durations_of_nothing() -> None:
    for step_s, duration_s, every in ((0.0, 1e-3, 1), (1e-7, 0.0, 1), (1e-7, 1e-3, 0)):
        with pytest.raises(ValueError, match="must be positive"):
            simulate(PAPER, duration_s, step_s=step_s, every=every)
    np.testing.assert_array_equal(simulate(PAPER, 1e-5, every=30), simulate(PAPER, 1e-5)[::30])
