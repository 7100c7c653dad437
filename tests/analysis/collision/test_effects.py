"""Every effect: the sign of its force, its effect on the energy, and closed forms where there are any."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE, effect_named
from analysis.collision.effects.kernel import FORCE, MASS, ON_BLOCK, OUTPUTS, Q_RATE, STATES, W_RATE, Q, V, W, X
from analysis.collision.effects.on_block import block_mode
from analysis.collision.effects.on_plate import second_plate_mode
from analysis.collision.effects.on_sensor import cyclic_error, demodulation_lag
from analysis.collision.effects.row import Acts, SensorInput
from analysis.collision.parameters import PAPER
from analysis.collision.solver import general
from analysis.collision.solver.general import ActiveEffect

NAMES = {
    *("coulomb_friction", "viscous_drag", "quadratic_drag", "tilt", "bearing_gradient", "block_mode"),
    *("cubic_stiffness", "plate_damping", "viscoelastic_arm", "second_plate_mode", "support_compliance"),
    *("plate_motion", "contact_exponent", "nonlinear_contact_damping", "adhesion"),
    *("sensor_drift", "demodulation_lag", "frame_vibration", "cyclic_error"),
}
FLIGHT_S = np.arange(-2000, 1) * 1e-5
WHOLE_S = np.arange(0, 6001) * 1e-5
M = PAPER.block_mass_kg


def with_effect(name: str, *values: float, time_s: np.ndarray = WHOLE_S) -> general.Trajectory:
    return general.solve(PAPER, [ActiveEffect(effect_named(name), values)], time_s)


def test_the_catalogue_is_that_of_the_field() -> None:
    assert set(CATALOGUE) >= NAMES
    for name, effect in CATALOGUE.items():
        assert effect.name == name
        assert effect.amplitude in [p.name for p in effect.parameters]
        assert (effect.kernel is not None) + (effect.sensor is not None) + (effect.acts is Acts.AT_START) == 1
        function = effect.kernel or effect.sensor
        assert function is None or "p = (" in (function.__doc__ or "")
        assert set(effect.look_alikes) <= set(CATALOGUE)
        assert pickle.loads(pickle.dumps(effect)) == effect
    with pytest.raises(ValueError, match="no effect is called 'magic'"):
        effect_named("magic")


def test_flight_before_the_touch_follows_the_closed_forms() -> None:
    t, v = FLIGHT_S, -0.265
    friction = with_effect("coulomb_friction", 1e-3, time_s=t)
    assert friction.displacement_m == pytest.approx(v * t + 0.5 * 1e-3 / M * t**2, abs=1e-15)
    viscous = with_effect("viscous_drag", 1e-2, time_s=t)
    decay = 1e-2 / M
    assert viscous.displacement_m == pytest.approx(v / decay * (1 - np.exp(-decay * t)), abs=1e-14)
    quadratic = with_effect("quadratic_drag", 1e-1, time_s=t)
    # v' = +c v^2 / m for v < 0: 1 / v falls as c t / m.
    assert quadratic.velocity_m_per_s == pytest.approx(1 / (1 / v - 0.1 / M * t), rel=1e-12)
    tilt = with_effect("tilt", 1e-3, time_s=t)
    assert tilt.displacement_m == pytest.approx(v * t + 0.5 * 9.80665 * math.sin(1e-3) * t**2, abs=1e-15)
    gradient = with_effect("bearing_gradient", 5.0, time_s=t)
    omega = math.sqrt(5.0 / M)
    assert gradient.displacement_m == pytest.approx(v / omega * np.sin(omega * t), abs=1e-14)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("coulomb_friction", (1e-3,)),
        ("viscous_drag", (1e-2,)),
        ("quadratic_drag", (1e-2,)),
        ("plate_damping", (1e-2,)),
        ("viscoelastic_arm", (2.0, 3e-3)),
    ],
)
def test_losses_slow_the_block_down(name: str, values: tuple[float, ...]) -> None:
    alone = general.solve(PAPER, (), WHOLE_S)
    assert with_effect(name, *values).velocity_m_per_s[-1] < alone.velocity_m_per_s[-1] - 1e-6


def test_nonlinear_contact_damping_costs_what_its_force_does() -> None:
    locked = replace(PAPER, plate_stiffness_n_per_m=0.0, plate_mass_kg=math.inf, contact_damping_n_s_per_m=0.0)
    run = general.solve(
        locked, [ActiveEffect(effect_named("nonlinear_contact_damping"), (4e3,))], np.arange(0, 0.006, 1e-6)
    )
    overlap, rate = np.maximum(-run.gap_m, 0.0), -run.velocity_m_per_s
    lost = float(np.trapezoid(4e3 * overlap * rate**2, run.time_s))
    assert 0.5 * M * (0.265**2 - run.velocity_m_per_s[-1] ** 2) == pytest.approx(lost, rel=1e-6)
    assert lost > 1e-5


@pytest.mark.parametrize(
    ("name", "values"),
    [("bearing_gradient", (2.0,)), ("cubic_stiffness", (3e6,)), ("contact_exponent", (0.5,)), ("tilt", (1e-3,))],
)
def test_forces_with_a_potential_keep_the_energy(name: str, values: tuple[float, ...]) -> None:
    bare = replace(PAPER, contact_damping_n_s_per_m=0.0)
    run = general.solve(bare, [ActiveEffect(effect_named(name), values)], np.arange(0, 0.045, 1e-6))
    release = run.released
    assert release is not None
    x, v, y, u = release.state[:4]
    potential = 0.5 * bare.plate_stiffness_n_per_m * y**2
    if name == "bearing_gradient":
        potential += 0.5 * values[0] * x**2
    elif name == "cubic_stiffness":
        potential += 0.25 * values[0] * y**4
    elif name == "tilt":
        potential -= M * 9.80665 * math.sin(values[0]) * x
    after = 0.5 * M * v**2 + 0.5 * bare.plate_mass_kg * u**2 + potential
    tolerance = 1e-10 if effect_named(name).rough else 1e-11
    assert after == pytest.approx(0.5 * M * 0.265**2, rel=tolerance)


@pytest.mark.parametrize("name", ["block_mode", "second_plate_mode", "support_compliance"])
def test_hidden_oscillators_only_hold_energy(name: str) -> None:
    bare = replace(PAPER, contact_damping_n_s_per_m=0.0)
    values = {
        "block_mode": (1e-3, 700.0, 0.0),
        "second_plate_mode": (1e-3, 900.0, 0.0),
        "support_compliance": (2e-5, 300.0),
    }[name]
    run = general.solve(bare, [ActiveEffect(effect_named(name), values)], np.arange(0, 0.045, 1e-5))
    release = run.released
    assert release is not None
    x, v, y, u, q, w = release.state
    omega, k_p = 2 * math.pi * values[1], bare.plate_stiffness_n_per_m
    if name == "block_mode":
        mass = values[0]
        total = 0.5 * (M - mass) * v**2 + 0.5 * mass * w**2 + 0.5 * mass * omega**2 * (q - x) ** 2 + 0.5 * k_p * y**2
    elif name == "second_plate_mode":
        mass = values[0]
        total = 0.5 * M * v**2 + 0.5 * k_p * y**2 + 0.5 * mass * (w**2 + omega**2 * q**2)
    else:
        # The clamp's own mass is 1 / (C omega^2), its spring 1 / C.
        total = 0.5 * M * v**2 + 0.5 * k_p * (y - q) ** 2 + 0.5 / values[0] * (q**2 + (w / omega) ** 2)
    total += 0.5 * bare.plate_mass_kg * u**2
    assert total == pytest.approx(0.5 * M * 0.265**2, rel=1e-10)


def test_dashpots_of_hidden_oscillators_take_the_power_that_they_should() -> None:
    """Of the relative speed alone: what moves as one loses nothing."""
    random = np.random.default_rng(3)
    mass, hz, zeta = 1e-3, 700.0, 0.07
    omega = 2 * math.pi * hz
    s, of_block, of_plate = random.normal(size=STATES), np.zeros(OUTPUTS), np.zeros(OUTPUTS)
    block_mode(s, (mass, hz, zeta), of_block)
    v, q, w = s[V], s[Q] - s[X], s[W]
    power = v * of_block[ON_BLOCK] + mass * w * of_block[W_RATE] + mass * omega**2 * q * (of_block[Q_RATE] - v)
    assert power == pytest.approx(-2 * zeta * omega * mass * (w - v) ** 2)
    assert of_block[MASS] == -mass
    second_plate_mode(s, (mass, hz, zeta), of_plate)
    power = mass * w * of_plate[W_RATE] + mass * omega**2 * s[Q] * of_plate[Q_RATE]
    assert power == pytest.approx(-s[FORCE] * w - 2 * zeta * omega * mass * w**2)


def test_hertz_contact_with_a_locked_plate_lasts_as_long_as_hertz_says() -> None:
    # t = 2.9432 (delta_max / v): Johnson, "Contact Mechanics", eq. 11.24; stiffness k xi^1.5 / sqrt(xi_0).
    locked = replace(PAPER, plate_stiffness_n_per_m=0.0, plate_mass_kg=math.inf, contact_damping_n_s_per_m=0.0)
    run = general.solve(locked, [ActiveEffect(effect_named("contact_exponent"), (0.5,))], np.array([0.02]))
    release = run.released
    assert release is not None
    stiffness = 1e4 / math.sqrt(50e-6)
    deepest = (1.25 * M * 0.265**2 / stiffness) ** 0.4
    exact_factor = 2 * math.sqrt(math.pi) * math.gamma(0.4) / (5 * math.gamma(0.9)) * 1.0
    assert release.time_s == pytest.approx(2 * exact_factor * deepest / 0.265, rel=1e-9)
    # xi^1.5 is not smooth where it begins: the eighth order is lost there, and with it two digits.
    assert release.state[1] == pytest.approx(0.265, rel=1e-10)


def test_adhesion_costs_the_work_of_its_range() -> None:
    force, reach = 2e-3, 2e-5
    held = with_effect("adhesion", force, reach)
    assert held.released is not None
    # What the way in gave is paid back after the last release, on whatever way the block goes in reach of the plate.
    lost = 0.5 * M * (held.released.state[1] ** 2 - held.velocity_m_per_s[-1] ** 2)
    assert lost > 0.5 * force * reach
    assert sum(event.kind == "range" for event in held.events) >= 1


def test_plate_in_motion_is_met_where_it_is() -> None:
    moving = replace(PAPER, plate_displacement_m=1e-5, plate_velocity_m_per_s=2e-3)
    run = general.solve(moving, (), np.array([0.0, 0.06]))
    assert run.displacement_m[0] == run.plate_displacement_m[0] == 1e-5


def test_sensor_lag_of_a_ramp_is_a_delay_and_of_a_swing_a_low_pass() -> None:
    t = np.arange(4000) * 1e-5
    tau = 5e-5
    seen = SensorInput(t, np.full(t.size, 0.2), 632.8e-9, 1e5)
    p = np.array([[tau], [0], [0]], dtype=np.complex128)
    ramp = demodulation_lag(seen, (0.2 * t)[:, None].astype(np.complex128), p)[:, 0].real
    assert ramp == pytest.approx(0.2 * (t - tau), abs=1e-15)
    omega = 2 * math.pi * 400
    seen = SensorInput(t, omega * np.cos(omega * t), 632.8e-9, 1e5)
    swing = demodulation_lag(seen, np.sin(omega * t)[:, None].astype(np.complex128), p)[:, 0].real
    gain, phase = 1 / math.hypot(1, omega * tau), math.atan(omega * tau)
    late = t > 40 * tau
    assert swing[late] == pytest.approx(gain * np.sin(omega * t[late] - phase), abs=2 * (omega * 1e-5) ** 2 / 8)


def test_a_cyclic_error_repeats_along_the_measured_path_where_that_is_known() -> None:
    """A frame that moves is part of the path; a strong error must not count as path."""
    t = np.arange(200) * 1e-6
    path = 1e-8 + 2e-3 * t
    frame = 5e-8 * np.sin(2 * math.pi * 3e3 * t)
    p = np.array([[5e-9], [2.0], [0.3]])
    scale = 632.8e-9 / (4 * math.pi)  # of the path, over the phase of the light that shows it
    error = -scale * np.angle(1.0 - 5e-9 / scale * np.exp(1j * (2.0 / scale * (path + frame) + 0.3)))
    seen = SensorInput(t, np.full(t.size, 2e-3), 632.8e-9, 1e6, measured_m=path + frame + error)
    assert cyclic_error(seen, path[:, None], p)[:, 0] == pytest.approx(path + error, abs=1e-11)
