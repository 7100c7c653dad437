"""Shots that reduce an uncertainty: predicted by derivatives, confirmed by a fit with the shot taken."""

import pytest

from analysis.inference.fit.shot_fit import fit_shots
from analysis.planning.model_comparison import refit_diagnosed
from analysis.planning.next_shot import Reach, contact_s
from analysis.planning.precision import ALL, plan_precision
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
