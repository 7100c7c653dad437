"""What a row of the catalogue says of its function is what the function does."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.collision.effects import (
    CATALOGUE,
    NUISANCES,
    WIDER_EFFECTS,
    effect_named,
    in_contact,
    on_block,
    on_plate,
    on_sensor,
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
    Q_RATE,
    SIGN_V,
    STATES,
    TOUCHING,
    W_RATE,
    XI,
    Q,
    W,
)
from analysis.collision.effects.row import Acts, Effect, SensorInput
from analysis.shot.quantity import split_unit

ROWS = [*CATALOGUE.values(), *WIDER_EFFECTS.values()]
KERNELS = [row for row in ROWS if row.kernel is not None]
SENSORS = [row for row in ROWS if row.sensor is not None]
LOSSES = {  # less than nothing of them would drive the block
    "coulomb_friction", "viscous_drag", "quadratic_drag", "plate_damping", "viscoelastic_arm",
    "nonlinear_contact_damping", "adhesion",
}  # fmt: skip
SIZES = {"block_mode", "second_plate_mode", "support_compliance", "demodulation_lag", "frame_vibration", "cyclic_error"}
SIGNED = {
    "tilt", "bearing_gradient", "cubic_stiffness", "plate_motion", "contact_exponent", "sensor_drift",
}  # fmt: skip
KNOWN = LOSSES | SIZES | SIGNED  # an effect added later has a test of its own


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_block, "sine", math.sin)
    monkeypatch.setattr(in_contact, "power", math.pow)


def outputs(row: Effect, changed: dict[int, float] | None = None, **values: float) -> np.ndarray:
    """Return what an effect adds at a state with all inputs, overlapping and touching, with some changed."""
    s = np.random.default_rng(3).uniform(0.5, 1.5, STATES)
    s[[SIGN_V, NEAR, TOUCHING]] = 1.0
    for place, value in (changed or {}).items():
        s[place] = value
    given = {"amplitude_m_per_s": 0.7, "frequency_hz": 0.3, "phase_rad": 0.2} if row.clocked else {}
    p = [{p.name: 0.7 + 0.1 * k for k, p in enumerate(row.parameters)} | given | values][0]
    out = np.zeros(OUTPUTS)
    assert row.kernel is not None
    row.kernel(s, list(p.values()), out)
    return out


@pytest.mark.parametrize("row", KERNELS, ids=lambda row: row.name)
def test_a_force_acts_where_the_row_says(row: Effect) -> None:
    out = outputs(row)
    on = {place for place in (ON_BLOCK, ON_PLATE, PAIR, MASS) if out[place] != 0.0}
    allowed = {Acts.ON_BLOCK: {ON_BLOCK, MASS}, Acts.ON_PLATE: {ON_PLATE}, Acts.IN_CONTACT: {PAIR}}[row.acts]
    assert on <= allowed and (on or row.shift)
    assert row.hidden == sum(out[place] != 0.0 for place in (Q_RATE, W_RATE))
    assert row.moves_with_block is (row.acts is Acts.ON_BLOCK and row.hidden > 0)
    assert not row.moves_with_block or MASS in on  # what moves within the block is a part of its mass
    # what moves the contact point does so by a coordinate of its own, whose rate is its second number
    if row.hidden == 2:
        faster = outputs(row, {W: 9.0})
        assert faster[Q_RATE] == 9.0
    within, beyond = outputs(row, {NEAR: 1.0}), outputs(row, {NEAR: 0.0})
    assert (row.range_at >= 0) is (not np.array_equal(within, beyond))
    assert row.range_at < 0 or row.parameters[row.range_at].name == "range_m"


@pytest.mark.parametrize("row", KERNELS, ids=lambda row: row.name)
def test_the_amplitude_is_that_in_which_a_small_effect_grows_or_vanishes(row: Effect) -> None:
    if row.clocked or row.name == "contact_exponent":
        return
    place = row.index(row.amplitude)
    assert place == 0
    one, two, four = (
        outputs(row, {Q: 0.0, W: 0.0}, **{row.amplitude: size}) for size in (1e-4, 2e-4, 4e-4)
    )  # of nothing that swings yet
    if row.inverse:
        assert one[W_RATE] - outputs(row, {Q: 0.0, W: 0.0, FORCE: 0.0})[W_RATE] == pytest.approx(2 * two[W_RATE])
        return
    bare = outputs(row, {Q: 0.0, W: 0.0}, **{row.amplitude: 0.0})
    np.testing.assert_allclose(four - bare, 2 * (two - bare), rtol=1e-4, atol=1e-18)
    np.testing.assert_allclose(two - bare, 2 * (one - bare), rtol=1e-4, atol=1e-18)
    assert (two - bare).any() and not bare[[ON_BLOCK, ON_PLATE, PAIR, MASS]].any()


def test_only_a_law_with_another_exponent_is_rough_where_the_overlap_begins() -> None:
    assert {row.name for row in ROWS if row.rough} == {"contact_exponent"}
    for row in KERNELS:
        if row.acts is not Acts.IN_CONTACT:
            continue
        near = [outputs(row, {XI: xi})[PAIR] - outputs(row, {XI: 0.0})[PAIR] for xi in (1e-9, 2e-9)]
        assert bool(abs(near[0]) > 0 and abs(near[1] / near[0] - 2.0) > 1e-4) is row.rough, row.name
    assert not any(row.nonlinear or row.kinked for row in ROWS)


@pytest.mark.parametrize("row", [row for row in ROWS if row.acts is not Acts.AT_START], ids=lambda row: row.name)
def test_limits_are_those_of_physics(row: Effect) -> None:
    by_name = {p.name: p for p in row.parameters}
    amplitude = by_name[row.amplitude]
    if (name := row.name.removesuffix("_with_plate")) in KNOWN:
        assert (amplitude.lower < 0.0) is (name in SIGNED), row.name
    for p in row.parameters:
        assert p.lower < p.upper and (not p.logarithmic or 0.0 < p.lower < p.upper < math.inf)
        assert p.lower <= p.scale <= p.upper
        assert all(p.lower <= value <= p.upper for value in (*p.grid, *p.tried))
        assert list(p.grid) == sorted(p.grid)
        assert (p.name == "phase_rad") is p.own and p.logarithmic >= p.name.endswith(("_hz", "_ratio"))
        assert p.fixed is (p.name == "order")
    if "damping_ratio" in by_name:
        assert by_name["damping_ratio"].upper < 1.0  # it swings
    if "phase_rad" in by_name:
        assert by_name["phase_rad"].grid == (0.0, math.pi / 2)  # as sine and as cosine: all others are sums of these


INF = math.inf
HZ, ZETA, SIZE = (1.0, 2e4), (1e-4, 0.6), (0.0, INF)
LIMITS = {  # what a search may not leave, parameter by parameter
    "tilt": [(-0.5, 0.5)], "contact_exponent": [(-0.15, 2.0)], "plate_motion": [(-INF, INF)] * 2,
    "block_mode": [(0.0, 8e-3), HZ, ZETA], "second_plate_mode": [(1e-5, 1e4), HZ, ZETA],
    "viscoelastic_arm": [SIZE, (2e-5, 0.5)], "support_compliance": [(0.0, 1e-2), (1.0, 1e4)],
    "adhesion": [SIZE, (1e-7, 5e-3)], "demodulation_lag": [(2e-7, 5e-4)],
    "frame_vibration": [SIZE, HZ, (-INF, INF)], "cyclic_error": [(0.0, 3e-8), (0.5, 4.0), (-INF, INF)],
    "frame_vibration_with_plate": [SIZE, HZ, (-INF, INF), (0.0, 1.0)],
}  # fmt: skip


def test_a_search_stays_within_the_limits_of_its_parameters() -> None:
    found = {row.name: [(p.lower, p.upper) for p in row.parameters] for row in ROWS}
    of_one = {name: [SIZE if name in LOSSES else (-INF, INF)] for name in KNOWN}
    assert found.items() >= (of_one | LIMITS).items()


def test_what_a_parameter_is_stands_in_its_name() -> None:
    own, logarithms = set(), set()
    for row in (*ROWS, *NUISANCES.values()):
        for p in row.parameters:
            assert p.unit == split_unit(p.name)[1], (row.name, p.name)
            own |= {(row.name, p.name)} if p.own else set()
            logarithms |= {(row.name, p.name)} if p.logarithmic else set()
        assert row.in_series in (None, tuple(p.name for p in row.parameters)), row.name
        assert row.amplitude == row.parameters[0].name and row.delay_parameter in ("", row.amplitude)
    assert own == {(row.name, "phase_rad") for row in ROWS if "phase_rad" in [p.name for p in row.parameters]} | {
        ("plate_motion", "velocity_m_per_s"), ("plate_motion", "displacement_m"),
        ("flight_acceleration", "before_m_per_s2"), ("flight_acceleration", "after_m_per_s2"),
    }  # fmt: skip
    scales = {(row.name, p.name) for row in ROWS for p in row.parameters if p.name in ("frequency_hz", "damping_ratio")}
    assert logarithms == scales | {
        ("second_plate_mode", "mass_kg"), ("viscoelastic_arm", "relaxation_time_s"), ("adhesion", "range_m"),
        ("demodulation_lag", "time_s"),
    }  # fmt: skip


def test_where_the_plate_is_locked_its_cubic_spring_is_the_contacts_own() -> None:
    assert {row.name: row.locked for row in ROWS if row.locked} == {"cubic_stiffness": on_plate.cubic_contact}
    assert {row.name for row in ROWS if not row.one_body} == {
        "plate_damping", "viscoelastic_arm", "second_plate_mode", "support_compliance", "plate_motion",
        "frame_vibration_with_plate",
    }  # fmt: skip


def test_a_contact_exponent_leaves_the_spring_as_it_is_at_50_um_and_acts_in_an_overlap_alone() -> None:
    row, k = effect_named("contact_exponent"), {CONTACT_STIFFNESS: 3e3}
    # of Hertz twice as stiff at four times the overlap
    for xi, more in ((50e-6, 0.0), (200e-6, 3e3 * 200e-6), (12.5e-6, -0.5 * 3e3 * 12.5e-6), (-200e-6, 0.0)):
        assert outputs(row, k | {XI: xi}, delta=0.5)[PAIR] == pytest.approx(more, abs=1e-15)
    assert outputs(row, k | {XI: 200e-6, TOUCHING: 0.0}, delta=0.5)[PAIR] == 0.0


def test_a_tilted_block_is_pulled_by_its_weights_share() -> None:
    assert outputs(effect_named("tilt"), {BLOCK_MASS: 2.0}, angle_rad=math.pi / 6)[ON_BLOCK] == pytest.approx(9.80665)


TIME_S = 3.0 + np.linspace(0.0, 0.02, 2001)


def seen(velocity: np.ndarray, wavelength_m: float = 633e-9) -> SensorInput:
    return SensorInput(TIME_S, velocity, wavelength_m, 1e5)


def sensed(row: Effect, x: np.ndarray, velocity: np.ndarray, size: float | None = None, **how: float) -> np.ndarray:
    values = [p.scale if p.name != row.amplitude or size is None else size for p in row.parameters][:3]
    p = np.array(values + [0.3] * (3 - len(values)))[:, None]
    assert row.sensor is not None
    return np.asarray(row.sensor(seen(velocity, **how), x[:, None], p))[:, 0]


@pytest.mark.parametrize("row", SENSORS, ids=lambda row: row.name)
def test_what_the_optics_show_is_what_the_row_says(row: Effect) -> None:
    still, nothing = np.full(TIME_S.size, 1e-3), np.zeros(TIME_S.size)
    assert bool(np.ptp(sensed(row, still, nothing)) > 1e-15) is row.at_rest
    v = -0.01 + 0.3 * (TIME_S - 3.01)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]))]) * 1e-5
    told = sensed(row, x, v)
    assert (not np.array_equal(told, sensed(row, x, v, wavelength_m=500e-9))) is row.optical
    early_x, early_v = x.copy(), v.copy()
    early_x[:5] += 1e-6
    early_v[:5] += 1e-2
    # a path's velocity is that between the samples before and after
    assert (not np.array_equal(told[6:], sensed(row, early_x, early_v)[6:])) is row.has_memory
    if not row.has_memory:
        moved = sensed(row, x + 1e-7, v) - 1e-7  # whatever turns with the fringes does not follow the path
        assert bool(np.abs(moved - told).max() > 1e-10) is row.needs_full_rate
    assert (row.delay_parameter == row.amplitude) is row.has_memory and bool(row.delay_parameter) is row.has_memory
    # beyond a pure delay a lag shows only with its square
    one = 2e-5 if row.delay_parameter else 1e-3 * next(p.scale for p in row.parameters if p.name == row.amplitude)
    small, twice = (sensed(row, x, v, size) for size in (one, 2.0 * one))

    def shown(told: np.ndarray, size: float) -> float:
        delayed = np.interp(TIME_S - size, TIME_S, x) if row.delay_parameter else x
        return float(np.abs(told - delayed)[300:].max())

    assert shown(twice, 2.0 * one) / shown(small, one) == pytest.approx(2.0**row.response_power, rel=0.05)


@pytest.mark.parametrize("complexly", [False, True])
def test_a_lag_is_that_of_a_first_order_filter_for_every_path_by_itself(complexly: bool) -> None:
    """Two paths with lags of their own, from a steady flight, against the filter's equation."""
    v = -0.3 + 40.0 * (TIME_S - 3.0) + 0.05 * np.sin(2e3 * TIME_S)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(TIME_S))]) + 1e-3
    lags = np.array([8e-5, 3e-4])
    paths = np.stack([x, x + 2e-3], axis=1)
    p = np.zeros((3, 2), dtype=complex if complexly else float)
    p[0] = lags + (1e-30j if complexly else 0.0)
    told = on_sensor.demodulation_lag(seen(v), paths.astype(p.dtype), p)
    for k, tau in enumerate(lags):
        exact = solve_ivp(
            lambda t, m, k=k, tau=tau: (np.interp(t, TIME_S, paths[:, k]) - m) / tau, (TIME_S[0], TIME_S[-1]),
            [paths[0, k] - tau * v[0]], t_eval=TIME_S, max_step=5e-6, rtol=1e-9,
        )  # fmt: skip
        np.testing.assert_allclose(told[:, k].real, exact.y[0], atol=3e-9)
        if complexly:
            more = p.real.copy()
            more[0, k] += 1e-8
            slope = (on_sensor.demodulation_lag(seen(v), paths, more)[:, k] - told[:, k].real) / 1e-8
            np.testing.assert_allclose(told[:, k].imag / 1e-30, slope, rtol=1e-3, atol=2e-4)
    if complexly:  # a change of the path is another path, with a velocity of its own
        change = np.stack([np.sin(700.0 * TIME_S), np.cos(300.0 * TIME_S)], axis=1)
        moved = on_sensor.demodulation_lag(seen(v), paths + 1e-30j * change, p.real.astype(complex)).imag / 1e-30
        for k in range(2):
            speed = np.gradient(change[:, k], TIME_S)
            alone = on_sensor.demodulation_lag(seen(speed), change[:, [k]], p.real[:, [k]])[:, 0]
            np.testing.assert_allclose(moved[:, k], alone, rtol=1e-9, atol=1e-12)
    plain: Any = on_sensor._lag.py_func
    if not complexly:
        out = np.full_like(paths, np.nan)
        plain(TIME_S, paths, np.stack([v, v], axis=1), lags, out)
        np.testing.assert_allclose(out, told, rtol=1e-12)
        gone = np.full_like(paths, np.nan)
        plain(TIME_S, paths, np.stack([v, v], axis=1), np.array([1e-9, 1e-5 / 601]), gone)
        np.testing.assert_allclose(gone[1:], paths[1:] - np.outer(v[1:], [1e-9, 1e-5 / 601]), atol=1e-12)


def test_the_wider_of_two_rows_has_the_narrow_ones_parameters_and_one_more() -> None:
    for row in WIDER_EFFECTS.values():
        narrow = effect_named(row.widens)
        assert (
            row.parameters[:-1] == narrow.parameters and row.sensor is narrow.sensor and row.at_rest == narrow.at_rest
        )
        assert not any(other.widens for other in CATALOGUE.values())


# what imitates what, as the catalogue's page says in words
ALIKE = {
    "coulomb_friction": {"viscous_drag", "sensor_drift"}, "viscous_drag": {"quadratic_drag", "coulomb_friction"},
    "quadratic_drag": {"viscous_drag"}, "tilt": {"sensor_drift"}, "bearing_gradient": {"tilt"},
    "cubic_stiffness": {"contact_exponent"}, "contact_exponent": {"cubic_stiffness"},
    "plate_damping": {"viscoelastic_arm"}, "viscoelastic_arm": {"plate_damping"},
    "support_compliance": {"coulomb_friction", "viscous_drag"}, "plate_motion": {"coulomb_friction"},
    "nonlinear_contact_damping": {"plate_motion"}, "adhesion": {"sensor_drift"},
    "sensor_drift": {"tilt", "coulomb_friction"},
}  # fmt: skip


def test_what_looks_alike_is_what_the_catalogues_page_says() -> None:
    assert {name: set(alike) for name in KNOWN if (alike := CATALOGUE[name].look_alikes)} == ALIKE
    assert effect_named("viscoelastic_arm").has_simpler_look_alike(effect_named("plate_damping"))
    assert not effect_named("plate_damping").has_simpler_look_alike(effect_named("viscoelastic_arm"))
