"""The function of each effect on one state, its rates, and the parameters of a row."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import (
    CATALOGUE,
    NUISANCES,
    effect_named,
    in_contact,
    on_block,
    on_plate,
    on_sensor,
    sensor_effects,
    without_nuisances,
)
from analysis.collision.effects.kernel import (
    BLOCK_MASS,
    CONTACT_STIFFNESS,
    FORCE,
    MASS,
    NEAR,
    ON_BLOCK,
    ON_PLATE,
    OUTPUTS,
    PAIR,
    PLATE_STIFFNESS,
    Q_RATE,
    SIGN_V,
    STATES,
    TOUCHING,
    W_RATE,
    XI,
    XI_RATE,
    Q,
    U,
    V,
    W,
    X,
    Y,
)
from analysis.collision.effects.row import SensorInput
from analysis.collision.parameters import PAPER


def state(**given: float) -> np.ndarray:
    places = {
        "x": X, "v": V, "y": Y, "u": U, "d": XI, "d_rate": XI_RATE, "force": FORCE, "q": Q, "w": W, "sign": SIGN_V,
        "near": NEAR, "touching": TOUCHING, "k_p": PLATE_STIFFNESS, "k_n": CONTACT_STIFFNESS, "m": BLOCK_MASS,
    }  # fmt: skip
    s = np.full(STATES, np.nan)
    for name, value in given.items():
        s[places[name]] = value
    return s


@pytest.mark.parametrize(
    ("kernel", "given", "p", "added"),
    [
        (on_block.coulomb_friction, {"sign": -1.0}, (3.0,), {ON_BLOCK: 3.0}),
        (on_block.viscous_drag, {"v": -2.0}, (3.0,), {ON_BLOCK: 6.0}),
        (on_block.quadratic_drag, {"v": -2.0, "sign": -1.0}, (3.0,), {ON_BLOCK: 12.0}),
        (on_block.bearing_gradient, {"x": -2.0}, (3.0,), {ON_BLOCK: 6.0}),
        (on_block.flight_acceleration, {"m": 5.0, "sign": -1.0}, (2.0, 3.0), {ON_BLOCK: 10.0}),
        (on_block.flight_acceleration, {"m": 5.0, "sign": 1.0}, (2.0, 3.0), {ON_BLOCK: 15.0}),
        (
            # omega = 2, so 4 * (5 - 2) + 2 * 0.25 * 2 * (7 - 3) = 16
            on_block.block_mode, {"x": 2.0, "v": 3.0, "q": 5.0, "w": 7.0}, (0.5, 1 / math.pi, 0.25),
            {ON_BLOCK: 8.0, MASS: -0.5, Q_RATE: 7.0, W_RATE: -16.0},
        ),
        (on_plate.cubic_stiffness, {"y": -2.0}, (3.0,), {ON_PLATE: 24.0}),
        (on_plate.cubic_contact, {"d": 2.0, "touching": 1.0}, (3.0,), {PAIR: 24.0}),
        (on_plate.cubic_contact, {"d": 2.0, "touching": 0.0}, (3.0,), {}),
        (on_plate.plate_damping, {"u": -2.0}, (3.0,), {ON_PLATE: 6.0}),
        (on_plate.viscoelastic_arm, {"u": 2.0, "q": 5.0}, (3.0, 0.5), {ON_PLATE: -5.0, Q_RATE: -4.0}),
        (
            on_plate.second_plate_mode, {"force": 6.0, "q": 5.0, "w": 7.0}, (0.5, 1 / math.pi, 0.25),
            {Q_RATE: 7.0, W_RATE: -(12.0 + 7.0 + 20.0)},
        ),
        (
            on_plate.support_compliance, {"k_p": 3.0, "y": 9.0, "q": 5.0, "w": 7.0}, (0.5, 1 / math.pi),
            {ON_PLATE: 15.0, Q_RATE: 7.0, W_RATE: 4.0 * (0.5 * 3.0 * 4.0 - 5.0)},
        ),
        (in_contact.nonlinear_contact_damping, {"d": 2.0, "d_rate": -3.0, "touching": 1.0}, (5.0,), {PAIR: -30.0}),
        (in_contact.nonlinear_contact_damping, {"d": 2.0, "d_rate": -3.0, "touching": 0.0}, (5.0,), {}),
        (in_contact.adhesion, {"near": 1.0}, (5.0, 9.0), {PAIR: -5.0}),
        (in_contact.adhesion, {"near": 0.0}, (5.0, 9.0), {}),
        (on_sensor.plate_on_frame, {"q": 5.0, "w": 7.0}, (2.0, 99.0, 3.0), {Q_RATE: 7.0, W_RATE: -63.0}),
    ],
)  # fmt: skip
def test_an_effect_adds_its_force(
    kernel: Any, given: dict[str, float], p: tuple[float, ...], added: dict[int, float]
) -> None:
    out = np.ones(OUTPUTS)
    kernel(state(**given), p, out)
    expected = np.ones(OUTPUTS)
    for place, value in added.items():
        expected[place] += value
    np.testing.assert_allclose(out, expected, rtol=1e-12)


def test_the_rates_of_effects_are_those_of_their_equations() -> None:
    light = replace(PAPER, block_mass_kg=2.0, plate_mass_kg=0.5)
    for name, values, rate in (
        ("plate_damping", [3.0], 6.0),
        ("viscoelastic_arm", [9.0, 0.25], 4.0),
        ("block_mode", [9.0, 2.0, 0.1], 4 * math.pi),
        ("nonlinear_contact_damping", [3.0], 50e-6 * 3.0 * 2.5),
        ("frame_vibration_with_plate", [1.0, 2.0, 7.0, 3.0], 7.0),
        ("coulomb_friction", [5.0], 0.0),
    ):
        assert effect_named(name).fastest(np.array(values), light) == pytest.approx(rate), name
    assert effect_named("second_plate_mode").stiffens(np.array([0.2]), light) == pytest.approx(1 + 1 / (0.2 * 2.5))
    assert effect_named("contact_exponent").stiffens(np.array([-0.5]), light) == pytest.approx(1.5 * 2.0)
    assert effect_named("tilt").stiffens(np.array([9.0]), light) == 1.0


SEEN = SensorInput(5.0 + np.linspace(0.0, 0.1, 1001), np.full(1001, 0.2), 6e-7, 1e6)


def test_drift_and_vibration_are_added_to_what_is_measured() -> None:
    x = np.stack([SEEN.time_s, -SEEN.time_s], axis=1)
    t = SEEN.time_s
    drifted = on_sensor.sensor_drift(SEEN, x, np.array([[3.0, -4.0]]))
    np.testing.assert_allclose(drifted - x, 0.5 * np.outer((t - 5.0) ** 2, [3.0, -4.0]), atol=1e-12)
    p = np.array([[2.0, 4.0], [10.0, 20.0], [0.3, 0.4]])
    shaken = on_sensor.frame_vibration(SEEN, x, p) - x
    velocity = np.gradient(shaken, t, axis=0)[5:-5]
    for k, (size, hertz, phase) in enumerate(p.T):
        np.testing.assert_allclose(velocity[:, k], size * np.sin(2 * np.pi * hertz * t + phase)[5:-5], atol=2e-3)
        assert abs(shaken[:, k].mean()) < 0.01
    waves = np.array([[3e-9, 4e-9], [0.0, -12e-9]])
    values = on_sensor.vibration_from_wave(10.0, waves)
    omega = 20 * np.pi
    size = math.sqrt((25 + 144) / 2) * 1e-9
    for one, (c, s) in zip(values, waves, strict=True):
        assert one["amplitude_m_per_s"] == pytest.approx(omega * size) and one["frequency_hz"] == 10.0
        p = np.array([[omega * math.hypot(c, s)], [10.0], [one["phase_rad"]]])
        added = on_sensor.frame_vibration(SEEN, 0.0 * x[:, :1], p)[:, 0]
        np.testing.assert_allclose(added, c * np.cos(omega * t) + s * np.sin(omega * t), atol=1e-15)
    with_plate = on_sensor.vibration_with_plate_from_wave(10.0, waves)
    assert with_plate == [{**one, "plate_factor": 0.5} for one in values]


def test_a_plate_on_a_frame_answers_as_a_resonator() -> None:
    """y'' = -own (y - c) - own / Q (y' - c'): the real part of own / (own - w^2 + i ...) of the clamp's motion."""
    stiffness, mass, factor = 200.0, 2e-4, 0.7
    own = stiffness / mass
    for hertz in (20.0, 150.0, 1e3 / (2 * np.pi), 400.0):  # the third is its own
        omega = 2 * np.pi * hertz

        clamp = factor * 3e-6 / omega * np.exp(1j * (omega * 0.0123 + 0.4))
        loss = 1j * omega * math.sqrt(own) / 1e4
        answer = clamp * (own + loss) / (own - omega**2 + loss)
        q, rate, turn = on_sensor.plate_response_to_frame((3e-6, hertz, 0.4, factor), stiffness, mass, 0.0123)
        assert turn == pytest.approx(omega)
        assert (q, rate) == pytest.approx((answer.real, (1j * omega * answer).real), rel=1e-4)


@pytest.mark.parametrize(("share", "passed"), [(0.3, 1.0), (0.52, 0.5), (0.7, 0.0)])
def test_a_cyclic_error_passes_where_its_chirp_does(share: float, passed: float) -> None:
    """Of the record's rate: whole up to 0.38 and gone from 0.66 on; the path moves, whatever the block does.

    The light that leaks turns the phase of the sum of both, which is its own sine to first order only.
    """
    speed = share * 1e6 * 6e-7 / 2 / 2.0  # of order two
    x = (speed * SEEN.time_s)[:, None]
    p = np.array([[5e-9], [2.0], [0.3]])
    error = (on_sensor.cyclic_error(SEEN, x, p) - x)[:, 0]
    scale = 6e-7 / (4 * np.pi)
    leaks = np.angle(1.0 - 5e-9 / scale * np.exp(1j * (2.0 / scale * x[:, 0] + 0.3)))
    np.testing.assert_allclose(error, -passed * scale * leaks, atol=1e-13)
    faint = (on_sensor.cyclic_error(SEEN, x, p * [[1e-3], [1.0], [1.0]]) - x)[:, 0]
    np.testing.assert_allclose(faint, passed * 5e-12 * np.sin(8 * np.pi / 6e-7 * x[:, 0] + 0.3), atol=1e-15)


def test_effects_of_the_sensor_act_in_the_order_of_the_path() -> None:
    order = ["sensor_drift", "demodulation_lag", "frame_vibration", "frame_vibration_with_plate", "cyclic_error"]
    assert [effect.name for effect in sensor_effects([effect_named(name) for name in (*order[::-1], "tilt")])] == order
    (nuisance,) = NUISANCES.values()
    assert without_nuisances([CATALOGUE["tilt"], nuisance]) == (CATALOGUE["tilt"],)
