"""The least-squares fit of a drive against numpy's own, with laws searched, fixed, or dependent on each other."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.drive.catalogue import LAWS
from analysis.drive.regression import (
    DEPENDENT,
    delay_of,
    independent_count,
    least_squares,
    linearly_dependent,
    regress,
    rms,
)
from analysis.drive.stretch import Table, prepare
from analysis.shot.shot import AnalysisError
from tests.analysis.drive.slider import MASS, OFFSET, VISCOUS, Drive, Floats

MASS_NAME, DRAG_NAME, OFFSET_NAME = "moving_mass_kg", "viscous_coefficient_n_s_per_m", "offset_n"
FRICTION, SPRING = "coulomb_friction.force_n", "cubic_stiffness.coefficient_n_per_m3"


@pytest.fixture(scope="module")
def table() -> Table:
    """Return a drive with friction and a spring, in a band that leaves some 500 samples."""
    return Table.of(
        prepare([Drive(lambda x, v: 20.0 * np.sign(v) + 2e4 * x**3, encoder_m=2e-6, seconds=20.0).motion()])
    )


def columns_of(table: Table, *laws: str) -> Floats:
    return np.concatenate([table.base(), *(table.columns(LAWS[law], ()) for law in laws)], axis=1)


@pytest.mark.parametrize("fixed", [(), (FRICTION,), (MASS_NAME, SPRING), (DRAG_NAME, OFFSET_NAME)])
def test_what_is_known_is_taken_off_and_the_rest_is_fitted_to_the_samples_asked_for(
    table: Table, fixed: tuple[str, ...]
) -> None:
    names = (MASS_NAME, DRAG_NAME, OFFSET_NAME, FRICTION, SPRING)
    known = dict(zip(names, (90.0, 180.0, -2.0, 15.0, 1e4), strict=True))
    mask = table.time_s > 7.0
    found = regress(table, ("coulomb_friction", "cubic_stiffness"), mask, None, {name: known[name] for name in fixed})
    columns, force = columns_of(table, "coulomb_friction", "cubic_stiffness"), table.force()
    is_free = np.array([name not in fixed for name in names])
    values = np.array([known[name] for name in names])
    left = force - columns[:, ~is_free] @ values[~is_free]
    values[is_free] = np.linalg.lstsq(columns[mask][:, is_free], left[mask], rcond=None)[0]
    assert found.names == names and found.laws == ("coulomb_friction", "cubic_stiffness")
    np.testing.assert_allclose(found.values, values, rtol=1e-7)
    np.testing.assert_allclose(found.residual_n, force - columns @ values, atol=1e-7)
    assert found.rms_n == pytest.approx(np.sqrt(np.mean((force - columns @ values)[mask] ** 2)))
    assert found.rms_of(~mask) == pytest.approx(np.sqrt(np.mean((force - columns @ values)[~mask] ** 2)))
    np.testing.assert_allclose(found.tangents, columns[:, is_free])
    for place, free in enumerate(is_free):
        assert np.all(found.covariance[place] == 0.0) == (not free)
    # the sandwich, block by block of so many neighbours
    design, residual = columns[mask][:, is_free], found.residual_n[mask]
    bread, length = np.linalg.inv(design.T @ design), round(4.0 * residual.size ** (1.0 / 3.0))
    filling = sum(
        np.outer(score, score)
        for begin in range(0, residual.size, length)
        if (score := design[begin : begin + length].T @ residual[begin : begin + length]).size
    )
    np.testing.assert_allclose(found.covariance[np.ix_(is_free, is_free)], bread @ filling @ bread, rtol=1e-5)


def test_a_shape_that_is_searched_ends_where_the_rest_is_least_and_its_slope_is_in_the_tangents(table: Table) -> None:
    drive = Drive(lambda x, v: 20.0 * np.sign(v) * (1.0 + np.exp(-np.abs(v) / 0.05)), encoder_m=1e-6, seconds=20.0)
    table = Table.of(prepare([drive.motion()]))
    laws = ("coulomb_friction", "stribeck_friction")
    found = regress(table, laws, None, {"stribeck_friction.speed_m_per_s": 0.02})
    name = "stribeck_friction.speed_m_per_s"
    assert found.names[3:] == (FRICTION, "stribeck_friction.force_n", name)
    assert found.nonlinear == {name: found.quantity(name).value}
    speed = found.quantity(name).value
    assert speed == pytest.approx(0.05, rel=0.02)

    def modelled(v_s: float) -> Floats:
        columns = np.concatenate([columns_of(table, "coulomb_friction"), table.columns(LAWS[laws[1]], (v_s,))], axis=1)
        return columns @ found.values[:5]

    def left(v_s: float) -> float:
        return regress(table, laws, None, None, {name: v_s}).rms_n

    assert left(speed) == pytest.approx(found.rms_n, rel=1e-9)
    assert left(speed) < min(left(0.97 * speed), left(1.03 * speed))
    slope = (modelled(speed * 1.0001) - modelled(speed * 0.9999)) / (2e-4 * speed)
    np.testing.assert_allclose(found.tangents[:, 5], slope, atol=1e-4 * np.abs(slope).max())


def test_a_search_may_begin_at_or_beyond_a_bound(table: Table) -> None:
    inside = regress(table, ("presliding_friction",), None, {"presliding_friction.reach_m": 1e-3})
    travel = LAWS["presliding_friction"].nonlinear_parameters[0].scale_in(table.stretches)
    for beyond in (0.9 * travel, 0.3 * travel):
        far = regress(table, ("presliding_friction",), None, {"presliding_friction.reach_m": beyond})
        assert far.nonlinear["presliding_friction.reach_m"] <= 0.3 * travel
        assert far.rms_n <= 1.2 * inside.rms_n


@pytest.mark.parametrize("waves", [3.0, 12.0])
def test_a_ripple_stays_the_wave_that_it_began_as(waves: float) -> None:
    """By half a wave more or fewer along the travel at most."""
    table = Table.of(prepare([Drive(lambda x, v: 4.0 * np.sin(2 * np.pi * x / 0.013), encoder_m=1e-6).motion()]))
    travel = float(np.ptp(table.displacement_m))
    found = regress(table, ("position_ripple",), None, {"position_ripple.pitch_m": travel / waves})
    assert abs(travel / found.nonlinear["position_ripple.pitch_m"] - waves) < 0.5 + 1e-3


def test_a_delay_moves_the_force_before_anything_is_fitted(table: Table) -> None:
    nonlinear = {"drive_delay.time_s": 4e-3}
    assert delay_of(nonlinear) == 4e-3 and delay_of({}) == 0.0
    found = regress(table, ("drive_delay",), None, None, {"drive_delay.time_s": 4e-3})
    values = np.linalg.lstsq(table.base(), table.force(4e-3), rcond=None)[0]
    assert found.names == (MASS_NAME, DRAG_NAME, OFFSET_NAME, "drive_delay.time_s")
    np.testing.assert_allclose(found.values, [*values, 4e-3], rtol=1e-7)
    free = regress(table, ("drive_delay",), None, {"drive_delay.time_s": 1e-3})
    near = [table.force(free.nonlinear["drive_delay.time_s"] + by) for by in (-1e-4, 1e-4)]
    np.testing.assert_allclose(free.tangents[:, 3], (near[0] - near[1]) / 2e-4, atol=1e-3 * np.abs(near).max() / 1e-2)


@pytest.mark.parametrize(("factor", "dependent"), [(0.5, True), (2.0, False)])
def test_columns_are_dependent_where_one_has_next_to_nothing_of_its_own(factor: float, dependent: bool) -> None:
    # of two unit vectors an angle a apart the least singular value is sqrt(2) sin(a / 2)
    angle = 2.0 * np.arcsin(factor * DEPENDENT / np.sqrt(2.0))
    columns = np.array([[1.0, np.cos(angle)], [0.0, np.sin(angle)], [0.0, 0.0]])
    assert linearly_dependent(columns * [1e5, 1e-7]) is dependent
    assert linearly_dependent(np.array([[1.0, 0.0], [0.0, 0.0]]))
    assert linearly_dependent(np.array([[1.0, np.nan], [0.0, 1.0]]))
    assert not linearly_dependent(np.array([[1.0, 0.0], [0.0, 1e-9]]))


def test_a_motion_that_cannot_tell_two_parameters_apart_is_refused_by_their_names(table: Table) -> None:
    still = SimpleNamespace(
        raise_if_cancelled=lambda: None, time_s=np.zeros(9), base=lambda: np.ones((9, 3)),
        force=lambda later_s: np.arange(9.0), columns=lambda law, at: np.ones((9, 1)), stretches=(), record=np.zeros(9),
    )  # fmt: skip
    given: Any = still
    with pytest.raises(AnalysisError, match=r"^mass, drag and offset cannot be separated"):
        regress(given)
    with pytest.raises(AnalysisError, match=r"^coulomb friction, quadratic drag: cannot be distinguished"):
        regress(given, ("coulomb_friction", "quadratic_drag"))


def test_independent_samples_of_a_residual() -> None:
    one = np.zeros(1000, dtype=np.int64)
    assert independent_count(np.zeros(1000), one) == 1000.0
    # a block of round(4 * 1000^(1/3)) = 40 equal neighbours counts once
    blocks = np.repeat(np.random.default_rng(1).standard_normal(25), 40)
    assert independent_count(blocks, one) == pytest.approx(25.0)
    alternating = np.tile([1.0, -1.0], 500)
    assert independent_count(alternating, one) == 1000.0  # never more than there are
    loud = np.concatenate([np.tile([3.0, -3.0], 250), np.tile([1.0, -1.0], 250)])
    halves = np.repeat([0, 2], 500)
    assert independent_count(loud, halves) == pytest.approx(1.0 / (0.9**2 / 500 + 0.1**2 / 500))
    assert rms(np.array([3.0, -4.0])) == pytest.approx(np.sqrt(12.5)) and rms(np.zeros(0)) == 0.0


def test_columns_of_any_unit_are_solved_for_and_one_of_zeros_is_worth_nothing() -> None:
    random = np.random.default_rng(3)
    columns, target, units = random.standard_normal((60, 4)), random.standard_normal(60), [1.0, 1e6, 1e-9, 3.0]
    exact = np.linalg.lstsq(columns, target, rcond=None)[0] / units
    columns = columns * units
    np.testing.assert_allclose(least_squares(columns, target), exact, rtol=1e-8)
    nowhere = np.concatenate([columns, np.zeros((60, 1))], axis=1)  # a law that acts nowhere
    np.testing.assert_allclose(least_squares(nowhere, target), [*exact, 0.0], rtol=1e-8)


def test_a_drive_without_laws_is_its_mass_drag_and_offset() -> None:
    found = regress(Table.of(prepare([Drive().motion()])))
    for name, true in ((MASS_NAME, MASS), (DRAG_NAME, VISCOUS), (OFFSET_NAME, OFFSET)):
        assert abs(found.quantity(name).value - true) < 4.0 * found.quantity(name).std < 0.01 * abs(true)
