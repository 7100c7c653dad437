"""Shots that reduce an uncertainty: predicted by derivatives, confirmed by a fit with the shot taken."""

import numpy as np
import pytest

from analysis.inference.fit.shot_fit import fit_shots
from analysis.planning.model_comparison import refit_diagnosed
from analysis.planning.next_shot import Reach, contact_s
from analysis.planning.precision import ALL, _spread, plan_precision
from analysis.shot.shot import AnalysisError
from tests.analysis.diagnosis.shots import calm, motions_of
from tests.analysis.planning.rig import rig, with_shots

REACH = Reach(speeds_m_per_s=(0.1, 0.3, 0.6), added_kg=(0.0, 0.05))
STIFFNESS = "contact_stiffness_n_per_m"


@pytest.fixture(scope="module")
def fitted():
    truth = rig({})
    motions = motions_of(truth)
    return truth, refit_diagnosed(fit_shots(motions), motions, calm)


def test_the_uncertainty_after_the_shot_is_the_predicted_one(fitted):
    truth, before = fitted
    plan = plan_precision(before, STIFFNESS, REACH)
    assert plan.std_after == pytest.approx(plan.ratio * plan.std_before)
    place = before.problem.names.index((STIFFNESS, -1))
    assert plan.std_before == pytest.approx(before.std[place], rel=0.02)
    contact = contact_s(plan.shots[0], before.problem.data.shots)
    motions = motions_of(with_shots(truth, plan.shots, contact))
    after = refit_diagnosed(fit_shots(motions), motions, calm)
    assert after.std[place] == pytest.approx(plan.std_after, rel=0.05)


def test_the_fit_of_a_diagnosed_model_asks_whether_it_is_to_stop(fitted):
    truth, _ = fitted
    motions = motions_of(truth)
    given = fit_shots(motions)
    asked: list[int] = []
    refit_diagnosed(given, motions, lambda: bool(asked.append(1)))
    assert asked


def test_the_cheapest_shots_that_reach_the_wanted_uncertainty_are_chosen_else_the_best(fitted):
    _, before = fitted
    little = plan_precision(before, STIFFNESS, REACH, wanted=0.9)
    too_much = plan_precision(before, STIFFNESS, REACH, wanted=1e-6)
    assert little.ratio <= 0.9 and len(little.shots) == 1
    assert len(too_much.shots) == 3 and too_much.ratio < little.ratio
    every = plan_precision(before, ALL, REACH, wanted=0.9)
    assert every.ratio <= 0.9 and every.std_after is None and "all parameters" in every.words


def test_an_unknown_parameter_is_refused_with_the_list_of_parameters(fitted):
    with pytest.raises(AnalysisError, match=r"no shared parameter is called 'k_N'; there are plate_stiffness"):
        plan_precision(fitted[1], "k_N", REACH)


def test_the_spread_is_that_of_the_covariance_or_the_geometric_mean_of_its_axes():
    random = np.random.default_rng(1)
    units = np.array([1.0, 1e4, 1e-6])
    root = random.standard_normal((5, 3)) * units
    covariance, row = np.linalg.inv(root.T @ root / np.outer(units, units)) / np.outer(units, units), units * [1, -2, 0]
    assert _spread(root.T @ root, row) == pytest.approx(np.sqrt(row @ covariance @ row), rel=1e-9)
    axes = np.sqrt(np.linalg.eigvalsh(covariance * np.outer(units, units)))
    assert _spread(root.T @ root, None) == pytest.approx(np.prod(axes / units) ** (1 / 3), rel=1e-9)


def test_the_weights_that_are_on_the_block_are_counted_in_the_effort(fitted):
    """Bare shots were taken: one with weights, more sure as it is, is not taken where a bare one does."""
    _, before = fitted
    bare, laden = (plan_precision(before, STIFFNESS, Reach((0.6,), added), wanted=0.99) for added in ((0.0,), (0.05,)))
    both = plan_precision(before, STIFFNESS, Reach((0.6,), (0.05, 0.0)), wanted=0.99)
    assert bare.ratio <= 0.99 and both == bare != laden
    every = plan_precision(before, ALL, Reach((0.6,), (0.0,)), wanted=0.99)
    assert every.words == f"all parameters {1 / every.ratio:.2g} times as sure, on the geometric mean"
    assert bare.words == (
        f"{STIFFNESS} {1 / bare.ratio:.2g} times as sure ({bare.std_before:.2g} to {bare.std_after:.2g})"
    )
