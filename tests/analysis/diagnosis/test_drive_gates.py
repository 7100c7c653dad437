"""The criteria that a law of a drive must meet, each with a case that does and one that does not."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from analysis.diagnosis import driven_search
from analysis.diagnosis.driven import remainder
from analysis.diagnosis.driven_search import (
    FOLDS,
    Trial,
    cross_validated_n,
    law_force,
    look_alikes,
    same_in_both_halves,
)
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.drive.catalogue import LAWS
from analysis.drive.driven_fit import fit_accepted
from analysis.drive.regression import Regression, _differences, regress
from analysis.drive.repeatability import folds, repeatability_of
from analysis.drive.stretch import Table, prepare
from analysis.shot.shot import AnalysisError
from tests.analysis.drive.slider import Drive, Floats


def table_of(*drives: Drive) -> Table:
    return Table.of(prepare([drive.motion() for drive in drives]))


def with_force(table: Table, added: Floats) -> Table:
    """Return a table whose measured force has ``added``, shape (m,), more than it had."""
    other = Table.of(table.stretches)
    other._seen["", (0.0,)] = (table.force() + added)[:, None]
    return other


@pytest.fixture(scope="module")
def drag() -> Table:
    return table_of(Drive(lambda x, v: 20.0 * np.sign(v)))


@pytest.mark.parametrize(("later", "same"), [(1.0, True), (1.3, True), (1.45, False), (-1.0, False), (0.0, False)])
def test_a_law_must_have_the_same_force_in_both_halves(drag: Table, later: float, same: bool) -> None:
    friction = drag.columns(LAWS["coulomb_friction"], ())[:, 0]
    changed = with_force(drag, np.where(drag.earlier, 0.0, (later - 1.0) * 20.0 * friction))
    found = regress(changed, ("coulomb_friction",), changed.earlier)
    assert same_in_both_halves(changed, found, "coulomb_friction") is same


@pytest.mark.parametrize("delay_s", [0.0, 2e-3, 8e-3])
def test_the_force_of_a_delay_is_what_the_motion_has_not_followed_yet(drag: Table, delay_s: float) -> None:
    given: Any = SimpleNamespace(nonlinear={"drive_delay.time_s": delay_s})
    force = law_force(drag, given, "drive_delay")
    assert force == pytest.approx(drag.force() - drag.force(delay_s))
    assert force.any() == (delay_s > 0.0)  # without a delay there is none


def bare(table: Table) -> Trial:
    """Return the model without laws, as a search begins with it."""
    found = regress(table, (), table.earlier)
    return Trial((), found, 0.0, found.rms_of(~table.earlier), cross_validated_n(table, folds(table, FOLDS), found))


def trial(table: Table, delta_bic: float, held: float, across: float) -> Trial:
    """Return a trial that foretells ``held`` and ``across`` times as badly as the model before."""
    before, found = bare(table), regress(table, ("coulomb_friction",), table.earlier)
    errors = held * before.validation_n, across * before.cross_validated_n
    return Trial(("coulomb_friction",), found, delta_bic, *errors)


@pytest.mark.parametrize(
    ("delta_bic", "held", "across", "joins"),
    [
        (-11.5, 0.97, 0.97, True),
        (-11.3, 0.97, 0.97, False),  # ten and twice ln 2
        (-100.0, 0.99, 0.5, False),  # the later half
        (-100.0, 0.5, 0.99, False),  # parts of the cycle that took no part
        (-100.0, 0.97, 0.5, True),
        (-100.0, 0.5, 0.97, True),
    ],
)
def test_a_law_must_lower_bic_and_both_errors_of_prediction(
    drag: Table, delta_bic: float, held: float, across: float, joins: bool
) -> None:
    one = trial(drag, delta_bic, held, across)
    assert (driven_search.best_trial(drag, bare(drag), [one]) is not None) is joins


def test_a_law_that_changes_between_the_halves_is_not_added(drag: Table, monkeypatch: pytest.MonkeyPatch) -> None:
    before, one = bare(drag), trial(drag, -100.0, 0.5, 0.5)
    assert driven_search.best_trial(drag, before, [one]) is one
    monkeypatch.setattr(driven_search, "same_in_both_halves", lambda *_: False)
    assert driven_search.best_trial(drag, before, [one]) is None


@pytest.mark.parametrize(
    ("delta_bic", "held", "joins"), [(-106.1, 0.489, "pair"), (-105.9, 0.489, "one"), (-106.1, 0.491, "one")]
)
def test_two_laws_must_be_better_than_the_better_of_them_alone(
    drag: Table, delta_bic: float, held: float, joins: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By six in BIC and by a fiftieth of its error of prediction, whatever a third law does."""
    monkeypatch.setattr(driven_search, "same_in_both_halves", lambda *_: True)
    one, worse, third = (
        replace(trial(drag, bic, 0.5, 0.5), added=(name,))
        for name, bic in (("coulomb_friction", -100.0), ("quadratic_drag", -50.0), ("cubic_stiffness", -101.0))
    )
    pair = replace(trial(drag, delta_bic, held, 0.4), added=("quadratic_drag", "coulomb_friction"))
    third = replace(third, cross_validated_n=np.inf)
    best = driven_search.best_trial(drag, bare(drag), [pair, third, one, worse])
    assert best is {"pair": pair, "one": one}[joins]


def test_bic_weighs_the_smaller_error_against_the_parameters_that_it_took() -> None:
    def of(rms_n: float, parameters: int) -> Regression:
        return cast(Any, SimpleNamespace(rms_n=rms_n, values=np.zeros(parameters)))

    assert driven_search.bic_change(of(2.0, 3), of(1.0, 5), 100.0) == pytest.approx(
        -200.0 * np.log(2.0) + 2 * np.log(100.0)
    )
    assert driven_search.bic_change(of(1.0, 5), of(1.0, 3), 1.5) == pytest.approx(-2 * np.log(2.0))


@pytest.mark.parametrize(
    ("most", "accepted", "laws", "progress"),
    [(1, (), 1, [1.0]), (1, ("cubic_stiffness",), 2, [1.0]), (5, (), 3, [0.4, 0.8])],  # of four one is useless
)
def test_a_search_adds_so_many_laws_at_most_to_those_that_are_accepted(
    most: int, accepted: tuple[str, ...], laws: int, progress: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    def force(x: Floats, v: Floats) -> Floats:
        return 20.0 * np.sign(v) + 2e4 * x**3 + 150.0 * v * np.abs(v)

    monkeypatch.setattr(driven_search, "CRITERIA", replace(CRITERIA, drive_laws=most))
    told: list[float] = []
    table = table_of(Drive(force, encoder_m=1e-6, seconds=20.0))
    found = driven_search.search_laws(table, accepted, told.append)
    assert len(found.found.laws) == laws and set(accepted) <= set(found.found.laws)
    assert set(found.evidence) == set(found.found.laws) - set(accepted)
    assert told == progress
    assert [one.delta_bic for one in found.trials] == sorted(one.delta_bic for one in found.trials)
    if laws == 3:
        assert set(found.found.laws) == {"coulomb_friction", "quadratic_drag", "cubic_stiffness"}
        assert {len(one.added) for one in found.trials} == {1, 2}
        assert sum(len(one.added) == 2 for one in found.trials) == 3 < sum(len(one.added) == 1 for one in found.trials)
        for law, evidence in found.evidence.items():
            kept = table.earlier
            fewer = regress(table, tuple(name for name in found.found.laws if name != law), kept)
            assert evidence["held_out_force_rms_without_it_n"] == pytest.approx(fewer.rms_of(~kept), rel=1e-6)
            assert evidence["delta_bic"] == pytest.approx(
                -driven_search.bic_change(found.found, fewer, found.found.independent_samples), rel=1e-6
            )


def test_a_law_that_the_motion_cannot_tell_from_the_others_is_not_accepted(drag: Table) -> None:
    one_way = table_of(Drive(seconds=9.0, steady_m_per_s=2.0, encoder_m=1e-6))
    with pytest.raises(AnalysisError, match=r"^coulomb friction: cannot be distinguished"):
        fit_accepted(one_way, ("bearing_gradient", "coulomb_friction"))
    with pytest.raises(AnalysisError, match="no effect of a drive is called 'friction'"):
        fit_accepted(drag, ("friction",))
    half = drag.time_s < 7.0
    both = fit_accepted(drag, ("stribeck_friction", "coulomb_friction"), half)
    assert set(both.laws) == {"stribeck_friction", "coulomb_friction"}
    assert both.mask is half and both.rms_n <= regress(drag, ("coulomb_friction",), half).rms_n


def test_each_part_of_the_cycle_is_predicted_from_the_others(drag: Table) -> None:
    fold = folds(drag, FOLDS)
    spoilt = fold == fold[0]
    force = drag.force() + np.where(spoilt, 300.0 * np.sin(drag.time_s), 0.0)
    columns = drag.base()
    left = np.empty(force.size)
    for one in np.unique(fold):
        out = fold == one
        left[out] = force[out] - columns[out] @ np.linalg.lstsq(columns[~out], force[~out], rcond=None)[0]
    other = with_force(drag, force - drag.force())
    of_others = cross_validated_n(other, fold, regress(other))
    assert len(np.unique(fold)) > 2
    assert of_others == pytest.approx(float(np.sqrt(np.mean(left**2))), rel=1e-6)
    assert of_others > 1.002 * regress(other).rms_n


@pytest.mark.parametrize(("coefficient", "alike"), [(7e7, True), (2e8, False)])
def test_a_law_that_fits_as_well_is_named_as_look_alike(coefficient: float, alike: bool) -> None:
    law = "cubic_stiffness"  # over so little travel that its force is about the noise
    table = table_of(Drive(lambda x, v: coefficient * x**3, waves=((1e-3, 0.31), (4e-4, 0.97))))
    assert ("bearing_gradient" in look_alikes(table, regress(table, (law,)), law)) is alike


def _some(seed: int, laws: tuple[str, ...]) -> Regression:
    return regress(table_of(Drive(seed=seed, seconds=6.0)), laws)


FREE: list[tuple[str, ...]] = [(), ("coulomb_friction",), ("bearing_gradient", "quadratic_drag"), ("cubic_stiffness",)]


@settings(max_examples=12, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**31), laws=st.sampled_from(FREE))
def test_every_std_is_the_root_of_its_variance(seed: int, laws: tuple[str, ...]) -> None:
    found = _some(seed, laws)
    stds = [found.quantity(name).std for name in found.names]
    np.testing.assert_allclose(np.square(stds), np.diag(found.covariance), rtol=1e-12)
    for law in laws:
        for name, quantity in found.parameters(law).items():
            place = found.names.index(f"{law}.{name}")
            assert quantity.std**2 == pytest.approx(found.covariance[place, place], rel=1e-12)
            assert quantity.value == found.values[place]


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**31),
    times=st.floats(0.1, 30.0),
    coefficients=arrays(np.float64, 3, elements=st.floats(-1e3, 1e3)),
)
def test_numbers_and_stds_scale_with_the_unit_of_the_force(seed: int, times: float, coefficients: Floats) -> None:
    table = table_of(Drive(seed=seed, seconds=6.0))
    one = regress(table)
    more = with_force(table, (times - 1.0) * table.force() + table.base() @ coefficients)
    other = regress(more)
    np.testing.assert_allclose(other.values, times * one.values + coefficients, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(other.covariance, times**2 * one.covariance, rtol=1e-5)


def test_the_earlier_half_of_each_record_is_fitted_and_the_later_foretold() -> None:
    table = table_of(Drive(seed=1, seconds=6.0), Drive(seed=2, seconds=9.0))
    for record in np.unique(table.record):
        of = table.record == record
        assert table.time_s[of & table.earlier].max() < table.time_s[of & ~table.earlier].min()
        assert table.earlier[of].mean() == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(("friction_n", "stays"), [(20.0, True), (0.0, False)])
def test_a_law_without_which_no_more_is_missed_is_taken_out_again(
    friction_n: float, stays: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the criterion says of it."""
    monkeypatch.setattr(driven_search, "bic_change", lambda *_: 100.0)
    table = table_of(Drive(lambda x, v: friction_n * np.sign(v)))
    found = regress(table, ("coulomb_friction",), table.earlier)
    left, pays = driven_search.without_useless(table, found, ())
    assert left.laws == (("coulomb_friction",) if stays else ()) and set(pays) == set(left.laws)


@pytest.mark.parametrize(("rises", "stays"), [(6.1, True), (5.9, False)])
def test_a_law_stays_without_which_bic_rises_by_six(
    drag: Table, rises: float, stays: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(driven_search, "bic_change", lambda *_: rises)
    found = regress(drag, ("coulomb_friction",), drag.earlier)
    left, evidence = driven_search.without_useless(drag, found, ())
    assert left.laws == (("coulomb_friction",) if stays else ())
    assert [one["delta_bic"] for one in evidence.values()] == ([-rises] if stays else [])


def test_what_a_drive_repeats_to_is_the_scatter_of_one_pass_and_not_of_two() -> None:
    table = table_of(Drive(waves=((0.05, 0.5),), seconds=12.0))
    noisy = with_force(table, np.random.default_rng(6).normal(0.0, 5.0, table.time_s.size))
    found = regress(noisy)
    repeats = repeatability_of(noisy, found, 0.1)
    assert repeats.repeats and repeats.cycle_s == pytest.approx(2.0, abs=0.02)
    assert repeats.force_n == pytest.approx(5.0, rel=0.05)
    assert repeatability_of(noisy, found, 8.0).force_n == 8.0  # never below the noise of the force


def test_the_search_for_a_laws_shape_follows_the_true_slopes() -> None:
    slopes = np.array([[3.0, -0.2], [0.5, 40.0], [0.0, 1.0]])
    found = _differences(lambda z: slopes @ z, np.array([0.3, -1.0]), np.array([2e-3, 5e-5]))
    np.testing.assert_allclose(found, slopes, atol=1e-9)


@pytest.mark.parametrize("waves", [1, 2, 3])
def test_what_is_left_goes_with_the_place_where_it_repeats_along_the_travel(drag: Table, waves: int) -> None:
    place, speed = drag.displacement_m, drag.velocity_m_per_s
    along = np.sin(2 * np.pi * waves * place / np.ptp(place))
    one_way = np.where(speed > 0.0, 1.0, -1.0)
    told = [remainder(drag, cast(Any, SimpleNamespace(residual_n=left))) for left in (along, one_way)]
    assert told[0].place == pytest.approx(1.0) and told[0].direction < 0.3
    assert told[1].direction == pytest.approx(1.0) and told[1].place < 0.3
