"""The penalty of parameters with values in every shot, where one shared value of another effect does the same."""

from types import SimpleNamespace

import numpy as np
import pytest

from analysis.collision.effects import effects_named
from analysis.diagnosis.verdict.indistinguishable import imitates_by_coincidence, per_shot_cost
from analysis.inference.fit.shot_fit import fit_shots
from analysis.planning.distances import nearest, refitted, screen_shots
from analysis.planning.model_comparison import ModelComparison, compare_models
from analysis.planning.next_shot import NextShot, contact_s
from tests.analysis.diagnosis.shots import calm, motions_of
from tests.analysis.planning.rig import rig, with_shots
from tests.bench.blind import Truth

NAMES = ("nonlinear_contact_damping", "plate_motion")


def _fitted(names, here, inverse):
    free = [("one", SimpleNamespace(name=name), -1) for name in names]
    return SimpleNamespace(problem=SimpleNamespace(offset=0, free_parameters=free), z=here, inverse=inverse)


def test_the_penalty_of_own_values_is_the_evidence_at_its_likeliest_scatter():
    random = np.random.default_rng(1)
    here = random.normal(0, 3.0, 6)
    root = random.normal(0, 0.4, (6, 6)) + np.eye(6)
    inverse = root @ root.T
    kinds = np.array([0, 1] * 3)

    def nats(scatter):
        spread = inverse + np.diag(np.asarray(scatter)[kinds] ** 2)
        determinants = np.linalg.slogdet(spread)[1] - np.linalg.slogdet(inverse)[1]
        return 0.5 * (determinants + here @ np.linalg.solve(spread, here))

    grid = np.geomspace(1e-2, 1e2, 120)
    least = min(nats((a, b)) for a in grid for b in grid)
    got = per_shot_cost(_fitted(["v", "d"] * 3, here, inverse), "one")
    assert got.nats == pytest.approx(least, abs=0.01)  # 12.5 decide
    assert got.nats == pytest.approx(nats(got.prior_width), abs=1e-6)


def test_a_value_far_from_zero_costs_the_logarithm_of_its_size():
    got = per_shot_cost(_fitted(["a"], np.array([1e3]), np.eye(1)), "one")
    assert got.nats == pytest.approx(np.log(1e3) + 0.5, abs=1e-3)
    assert per_shot_cost(_fitted(["a"], np.array([0.0]), np.eye(1)), "one").nats < 0.1
    assert per_shot_cost(_fitted(["a"], np.array([1.0]), np.full((1, 1), np.nan)), "one") is None


@pytest.fixture(scope="module")
def damped() -> tuple[Truth, ModelComparison]:
    truth = rig({"nonlinear_contact_damping": {"coefficient_n_s_per_m2": 2.0}})
    return truth, _contest(truth, NAMES[0])


def _contest(truth: Truth, given: str) -> ModelComparison:
    motions = motions_of(truth)
    found = compare_models(fit_shots(motions, effects=(given,)), effects_named(NAMES), motions)
    assert found is not None
    return found


def test_the_penalty_that_a_next_shot_adds_is_predicted(damped):
    truth, now = damped
    shot = NextShot(0.6, 0.0, 0.012, 0.02)
    samples = now.members[0].fitted.problem.data.shots
    foreseen = nearest(refitted(now, (shot,), screen_shots(now, [shot], lambda _: None, calm), calm))
    then = _contest(with_shots(truth, [shot], contact_s(shot, samples)), NAMES[0])
    leader = [member.effect.name for member in now.members].index("nonlinear_contact_damping")
    assert then.members[0].effect.name == "nonlinear_contact_damping"
    assert then.members[1].penalty > now.members[1 - leader].penalty + 3.0
    # Two shots know the coefficient to a tenth or so, and what is reached scatters by one noise norm.
    assert then.separation_from(()) == pytest.approx(foreseen[leader], rel=0.25, abs=3.0)


def test_a_shared_value_replaces_a_swinging_plate_and_not_the_reverse(damped):
    truth, _ = damped
    shots = [NextShot(0.6, 0.05, 0.012, 0.02)] * 4
    many = _contest(with_shots(truth, shots, 0.025), NAMES[0])
    shared, own = sorted(many.members, key=lambda member: member.effect.name)
    assert imitates_by_coincidence(own.fitted, own.effect, shared.fitted, shared.effect)
    assert not imitates_by_coincidence(shared.fitted, shared.effect, own.fitted, own.effect)


def test_a_plate_that_does_swing_is_not_taken_for_a_coincidence():
    truth = rig({"plate_motion": {"velocity_m_per_s": 4e-6, "displacement_m": 2e-9}})
    swings = _contest(truth, NAMES[1])
    own = next(member for member in swings.members if member.effect.name == "plate_motion")
    shared = next(member for member in swings.members if member.effect.name != "plate_motion")
    assert swings.members[0] is own
    assert not imitates_by_coincidence(own.fitted, own.effect, shared.fitted, shared.effect)
