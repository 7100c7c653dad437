"""The exact solver against closed forms, conservation laws, limits, and itself at random parameters."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.collision.parameters import PAPER, Collision, Variant
from analysis.collision.solver import general, march


def one_body(damping_n_s_per_m: float, stiffness_n_per_m: float = 200.0) -> Collision:
    return Collision(0.02, -0.3, 0.0, math.inf, stiffness_n_per_m, damping_n_s_per_m)


def energy(collision: Collision, run: general.Trajectory) -> np.ndarray:
    overlap = np.where(run.force_n != 0, -run.gap_m, 0.0)
    return (
        0.5 * collision.block_mass_kg * run.velocity_m_per_s**2
        + 0.5 * collision.plate_mass_kg * run.plate_velocity_m_per_s**2
        + 0.5 * collision.plate_stiffness_n_per_m * run.plate_displacement_m**2
        + 0.5 * collision.contact_stiffness_n_per_m * overlap**2
    )


def test_locked_plate_without_damping_is_a_half_sine() -> None:
    collision = one_body(0.0)
    omega = math.sqrt(200.0 / 0.02)
    time_s = np.linspace(0, math.pi / omega, 301)
    run = general.solve(collision, (), time_s)
    assert run.displacement_m == pytest.approx(-0.3 / omega * np.sin(omega * time_s), abs=1e-15)
    after = general.solve(collision, (), np.array([2 * math.pi / omega]))
    assert after.events[-1].time_s == pytest.approx(math.pi / omega, abs=1e-15)
    assert after.velocity_m_per_s[-1] == pytest.approx(0.3, rel=1e-13)


def test_locked_plate_with_damping_is_the_damped_swing() -> None:
    collision = one_body(0.8)
    decay, square = 0.8 / 2 / 0.02, 200.0 / 0.02
    omega = math.sqrt(square - decay**2)
    run = general.solve(collision, (), np.linspace(0, 1.5 * math.pi / omega, 100))
    inside = run.time_s < math.pi / omega
    swing = -0.3 / omega * np.exp(-decay * run.time_s) * np.sin(omega * run.time_s)
    assert run.displacement_m[inside] == pytest.approx(swing[inside], abs=1e-15)
    assert run.events[-1].time_s == pytest.approx(math.pi / omega, abs=1e-15)
    assert -run.velocity_m_per_s[-1] / -0.3 == pytest.approx(math.exp(-decay * math.pi / omega), rel=1e-12)


def test_damped_contact_without_tension_releases_at_no_force() -> None:
    # Schwager and Poeschel, Granular Matter 9 (2007) 465, eq. 8: the contact ends before the overlap does.
    collision = replace(one_body(0.8), variant=Variant.NO_TENSION)
    decay, square = 0.8 / 2 / 0.02, 200.0 / 0.02
    omega = math.sqrt(square - decay**2)
    duration = (math.pi - math.atan2(2 * decay * omega, omega**2 - decay**2)) / omega
    run = general.solve(collision, (), np.array([0.1]))
    assert next(e for e in run.events if e.kind == "release").time_s == pytest.approx(duration, abs=1e-14)


def test_released_plate_swings_freely() -> None:
    omega = math.sqrt(PAPER.plate_stiffness_n_per_m / PAPER.plate_mass_kg)
    run = general.solve(PAPER, (), np.linspace(0.03, 0.06, 500))
    y, u = run.plate_displacement_m, run.plate_velocity_m_per_s
    amplitude = np.hypot(y, u / omega)
    assert np.ptp(amplitude) < 1e-13 * amplitude[0] + 1e-18
    phase = np.unwrap(np.arctan2(-u / omega, y))
    assert np.polyfit(run.time_s, phase, 1)[0] == pytest.approx(omega, rel=1e-10)


def test_energy_is_kept_without_and_paid_to_the_dashpot_with_damping() -> None:
    time_s = np.arange(0, 0.04, 1e-6)
    bare = replace(PAPER, contact_damping_n_s_per_m=0.0)
    kept = energy(bare, general.solve(bare, (), time_s))
    assert np.ptp(kept) < 1e-11 * kept[0]
    run = general.solve(PAPER, (), time_s)
    rate = np.where(run.force_n != 0, run.plate_velocity_m_per_s - run.velocity_m_per_s, 0.0)
    lost = np.concatenate([[0], np.cumsum(0.5 * np.diff(time_s) * (rate[1:] ** 2 + rate[:-1] ** 2))]) * 0.4
    total = energy(PAPER, run)
    # The trapezoid steps over six switches of one microsecond each: 6 * 1e-6 s * gamma v^2 / 2 of 0.6 mJ.
    assert np.abs(total + lost - total[0]).max() < 6 * 1e-6 * 0.4 * 0.265**2


@pytest.mark.parametrize("seed", range(4))
def test_without_damping_the_film_runs_backwards(seed: int) -> None:
    random = np.random.default_rng(seed)
    bare = replace(PAPER, contact_damping_n_s_per_m=0.0, plate_stiffness_n_per_m=float(random.uniform(80, 600)))
    there = general.solve(bare, (), np.array([0.0, 0.1]))
    release = there.released
    assert release is not None
    x, v, y, u = release.state
    back = replace(bare, velocity_in_m_per_s=-v, plate_displacement_m=y, plate_velocity_m_per_s=-u)
    run = general.solve(back, (), np.array([release.time_s]))
    changes = [event.time_s for event in run.events if event.time_s < release.time_s - 1e-9]
    mirrored = sorted(release.time_s - event.time_s for event in there.events if event.time_s > 1e-9)
    assert changes == pytest.approx(mirrored[: len(changes)], abs=1e-9)
    assert run.displacement_m[-1] == pytest.approx(0.0, abs=1e-10)
    assert run.velocity_m_per_s[-1] == pytest.approx(0.265, abs=1e-8)
    assert x == pytest.approx(y, abs=1e-17)


def touches(stiffness_n_per_m: float, rate_hz: float, block: int = 1, directions: tuple[int, ...] = ()) -> int:
    """Return how often block and plate touch or part on a plate of this stiffness."""
    collision, time_s = replace(PAPER, plate_stiffness_n_per_m=stiffness_n_per_m), np.arange(0, 0.04, 1 / rate_hz)
    return len(general.solve(collision, (), time_s, directions=directions, block=block).events)


@pytest.mark.parametrize(("softer", "stiffer"), [(84.0, 85.0), (270.0, 271.0)])
def test_a_touch_that_lasts_less_than_a_step_is_not_missed(softer: float, stiffer: float) -> None:
    """Somewhere between these plates one touch less occurs: there the last one to do so only grazes."""
    fine = 1e6
    grazed, missed = touches(softer, fine), touches(stiffer, fine)
    assert grazed == missed + 2
    while stiffer - softer > 1e-9:
        middle = 0.5 * (softer + stiffer)
        softer, stiffer = (middle, stiffer) if touches(middle, fine) == grazed else (softer, middle)
    for plate, expected in ((softer - 1e-8, grazed), (stiffer + 1e-8, missed)):
        assert touches(plate, 2e4) == touches(plate, 1e4) == touches(plate, 5e3) == expected
        assert touches(plate, 2e4, directions=(0, 1)) == expected
        assert touches(plate, 1e5, block=5) == touches(plate, 1e5, block=5, directions=(0, 1)) == expected


def test_stiff_contact_of_a_light_plate_is_the_half_sine_on_the_plate() -> None:
    omega = math.sqrt(PAPER.plate_stiffness_n_per_m / PAPER.block_mass_kg)
    errors = []
    for factor in (1, 10, 100):
        stiff = replace(
            PAPER,
            contact_stiffness_n_per_m=1e4 * factor,
            plate_mass_kg=PAPER.plate_mass_kg / factor,
            contact_damping_n_s_per_m=2.0,
        )
        run = general.solve(stiff, (), np.arange(0, 0.03, 1e-5))
        errors.append(abs(-run.displacement_m.min() * omega / 0.265 - 1))
    assert errors[0] > 5 * errors[1] > 25 * errors[2]


@settings(max_examples=15, deadline=None)
@given(
    velocity=st.floats(0.05, 0.6),
    plate=st.floats(50, 1000),
    mass=st.floats(5e-5, 1e-3),
    contact=st.floats(2e3, 5e4),
    damping=st.floats(0.1, 1.5),  # without any, the contact rings on and its phase error grows with every swing
    variant=st.sampled_from(list(Variant)),
)
def test_two_steppers_agree_anywhere(
    velocity: float, plate: float, mass: float, contact: float, damping: float, variant: Variant
) -> None:
    collision = Collision(17.85e-3, -velocity, plate, mass, contact, damping, variant=variant)
    time_s = np.arange(-0.002, 1.3 * collision.contact_time_estimate_s, 2e-5)
    one = general.solve(collision, (), time_s, directions=range(7))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(march, "in_closed_form", lambda *_: march.NOT_LINEAR)
        other = general.solve(collision, [], time_s, stride=0.5)
    # A chain of bounces magnifies any error as it does a small change of the parameters.  At stride 1 the steps' own
    # error is magnified too: to 3e-11 after forty changes of the contact.
    magnified = np.linalg.norm(one.displacement_derivatives[:, :5] * collision.vector[:5], axis=1).max()
    assert np.abs(one.displacement_m - other.displacement_m).max() < 3e-12 * magnified
    gap = one.gap_m
    assert np.all(gap[one.force_n != 0] <= 1e-15)
    assert abs(one.velocity_m_per_s[-1]) <= velocity * (1 + 1e-12)


def test_samples_may_lie_anywhere() -> None:
    random = np.random.default_rng(3)
    times = np.sort(random.uniform(-0.01, 0.05, 400))
    fine = np.sort(np.concatenate([times, np.arange(-0.01, 0.05, 1e-5)]))
    dense = general.solve(PAPER, (), fine)
    sparse = general.solve(PAPER, (), times)
    assert sparse.displacement_m == pytest.approx(dense.displacement_m[np.searchsorted(fine, times)], abs=1e-14)


def test_impossible_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="towards the plate"):
        PAPER.at_speed(0.1)
    with pytest.raises(ValueError, match="plate_mass_kg must be positive"):
        replace(PAPER, plate_mass_kg=-1.0)
    with pytest.raises(ValueError, match="ascending"):
        general.solve(PAPER, (), np.array([0.1, 0.0]))
