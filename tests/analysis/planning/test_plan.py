"""Planned shots: their separation is predicted by derivatives and by refitting, and confirmed on the bench."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.effects import effect_named, effects_named
from analysis.diagnosis.findings.result import FoundEffect
from analysis.inference.fit.shot_fit import fit_shots
from analysis.planning import distances as planned
from analysis.planning.distances import Distances, nearest, refitted, screen_shots
from analysis.planning.model_comparison import ModelComparison, compare_models, refit_diagnosed
from analysis.planning.next_shot import NextShot, Reach, contact_s, effort, next_shots
from analysis.planning.plan import Plan, plan
from analysis.planning.predictions import Information, blank_shot
from analysis.planning.shot_log import PlannedStep, plan_next
from analysis.shot.fit import Fit
from analysis.shot.motion import Motion
from analysis.shot.shot import Cancelled
from tests.analysis.diagnosis.shots import calm, motions_of
from tests.analysis.planning.rig import rig, with_shots
from tests.analysis.shots import shots_of
from tests.bench.blind import Truth

NAMES = ("coulomb_friction", "sensor_drift")
REACH = Reach(speeds_m_per_s=(0.1, 0.3), added_kg=(0.0, 0.05))


def _stood(truth: Truth, names: tuple[str, ...]) -> tuple[ModelComparison, Fit, tuple[Motion, ...]]:
    motions = motions_of(truth)
    fit = fit_shots(motions, effects=names[:1])
    open_class = compare_models(fit, effects_named(names), motions)
    assert open_class is not None
    return open_class, fit, motions


@pytest.fixture(scope="module")
def friction() -> tuple[Truth, ModelComparison, Plan]:
    truth = rig({"coulomb_friction": {"force_n": 7e-9}})
    open_class, _, _ = _stood(truth, NAMES)
    return truth, open_class, plan(open_class, REACH)


def test_friction_and_drift_are_separated_as_predicted(friction):
    truth, open_class, wanted = friction
    assert wanted.now < 5.0 and wanted.settles and wanted.separation > 6.5
    samples = open_class.members[0].fitted.problem.data.shots
    (shot,) = wanted.shots
    motions = motions_of(with_shots(truth, wanted.shots, contact_s(shot, samples)))
    found = FoundEffect(effect_named("coulomb_friction"), {}, {})
    said = SimpleNamespace(effects=(found,), fit_after=fit_shots(motions, effects=NAMES[:1]))
    standing = plan_next(shots_of(motions), said, (PlannedStep(shot, wanted.members, wanted.after_first),))
    (step,) = standing.steps
    assert standing.plan is None and standing.settled and step.leader == effect_named("coulomb_friction")
    # The force itself is known to a tenth or so beforehand, and what is reached scatters by one.
    assert step.expected_separation == wanted.expected[effect_named("coulomb_friction")]
    assert step.reached == pytest.approx(step.expected_separation, rel=0.25, abs=3.0)
    assert json.loads(json.dumps(step.to_json()))["reached_separation"] == step.reached


def test_the_first_order_agrees_with_a_refit_where_the_models_are_nearly_linear(friction):
    _, open_class, _ = friction
    shots = open_class.members[0].fitted.problem.data.shots
    some = next_shots(shots, REACH)[:2]
    distances = screen_shots(open_class, some, lambda _: None, calm)
    for shot in some:
        fitted = nearest(refitted(open_class, (shot,), distances, calm))
        for member, value in distances.nearest((shot,)).items():
            assert fitted[member] == pytest.approx(value, rel=0.03)


def test_several_equal_shots_add_information_and_effort(friction):
    _, open_class, _ = friction
    shots = open_class.members[0].fitted.problem.data.shots
    shot = next_shots(shots, REACH)[0]
    distances = screen_shots(open_class, [shot], lambda _: None, calm)
    one, two = distances.nearest((shot,))[0], distances.nearest((shot, shot))[0]
    now = distances.nearest(())[0]
    assert now < one < two
    laden = replace(shot, added_mass_kg=0.05)
    assert effort((shot, shot), 0.0) == 2 * effort((shot,), 0.0)
    assert effort((shot, laden), 0.0) > effort((shot, shot), 0.0)


def test_no_shot_separates_a_dashpot_from_an_arm_that_relaxes_at_once():
    truth = rig({"plate_damping": {"coefficient_n_s_per_m": 4e-7}})
    open_class, _, _ = _stood(truth, ("plate_damping", "viscoelastic_arm"))
    hopeless = plan(open_class, REACH)
    assert not hopeless.settles and hopeless.best < 5.0
    assert hopeless.inseparable == tuple(hopeless.expected) and "is equivalent to a dashpot of k tau" in hopeless.words


def test_where_no_shot_has_a_solution_no_shot_is_planned(friction, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where a weight is so heavy that the plate has no room for the block."""

    def no_room(*_: object) -> None:
        raise Infeasible("the block never leaves the plate")

    monkeypatch.setattr(planned, "blank_shot", no_room)
    none = plan(friction[1], REACH)
    assert none.shots == () and none.best == 0.0 and none.now == friction[2].now
    assert "No shot of this rig" in none.words


@pytest.mark.parametrize("run_up_m", [12e-3, 30e-3])
@pytest.mark.parametrize("speed_m_per_s", [0.1, 0.6])
def test_a_flight_before_the_touch_ends_within_the_free_path(run_up_m: float, speed_m_per_s: float) -> None:
    way_m = Reach(run_up_m=run_up_m).before_s(speed_m_per_s) * speed_m_per_s
    assert 0.9 * run_up_m < way_m < run_up_m


def test_a_plan_states_the_settings_and_can_be_cancelled(friction):
    _, open_class, wanted = friction
    assert "m/s" in wanted.words and "coulomb friction and sensor drift" in wanted.words
    fractions: list[float] = []
    with pytest.raises(Cancelled):
        plan(open_class, REACH, progress=lambda _, f: fractions.append(f), stop=lambda: len(fractions) > 2)
    assert fractions and all(np.diff(sorted(fractions)) >= 0)


def test_there_is_no_comparison_without_one_of_its_members(friction):
    truth, _, _ = friction
    motions = motions_of(truth)
    assert compare_models(fit_shots(motions), effects_named(NAMES), motions) is None


def test_a_swinging_plate_is_predicted_to_swing_as_in_one_of_the_shots():
    truth = rig({"plate_motion": {"velocity_m_per_s": 4e-7, "displacement_m": 5e-11}})
    fitted = refit_diagnosed(fit_shots(motions_of(truth), effects=("plate_motion",)), motions_of(truth), calm)
    shot = next_shots(fitted.problem.data.shots, REACH)[0]
    problem, z = fitted.with_shots([blank_shot(shot, fitted)])
    *starts, added = [values[effect_named("plate_motion")] for values in problem.unpack(z).values]
    assert any(added == pytest.approx(one) for one in starts)


def test_an_inseparable_pair_may_be_separated_from_a_third():
    shot = NextShot(0.3, 0.0, 0.012, 0.03)
    says_nothing = Information(np.eye(1), np.zeros(1), 0.0)
    tells = Information(np.eye(1), np.zeros(1), 16.0)
    pairs = {(0, 1): says_nothing, (0, 2): tells, (1, 0): says_nothing, (1, 2): tells}
    distances = Distances(dict.fromkeys(pairs, says_nothing), {shot: pairs}, {0: 0.0, 1: 0.0})
    assert distances.inseparable_pairs(3) == {(0, 1), (1, 0)}
    assert distances.nearest((shot, shot)) == {0: 0.0, 1: 0.0}
    left = distances.without(distances.inseparable_pairs(3))
    assert left.nearest((shot, shot)) == pytest.approx({0: 32**0.5, 1: 32**0.5}) and left.members == (0, 1)


@pytest.mark.slow
def test_an_inseparable_pair_is_separated_from_a_third_as_one():
    truth = rig({"plate_damping": {"coefficient_n_s_per_m": 2e-5}})
    open_class, _, _ = _stood(truth, ("plate_damping", "viscoelastic_arm", "second_plate_mode"))
    wanted = plan(open_class, Reach(speeds_m_per_s=(0.6,), added_kg=(0.0,)), most=1)
    assert wanted.settles and wanted.inseparable_from[effect_named("plate_damping")] == (
        effect_named("viscoelastic_arm"),
    )
    assert "plate damping and viscoelastic arm stay one" in wanted.words
    assert json.loads(json.dumps(wanted.to_json()))["one_with"]["viscoelastic_arm"] == ["plate_damping"]


def test_without_an_expectation_only_members_that_the_plan_could_separate_count():
    shot = NextShot(0.3, 0.0, 0.02, 0.02)
    members = mode, damping, arm = effects_named(("second_plate_mode", "plate_damping", "viscoelastic_arm"))
    inseparable_from = {damping: members[::2], arm: members[:2]}
    step = PlannedStep(shot, members, {mode: 4.0}, 10.0, damping, inseparable_from)
    assert step.leader not in step.expected and set(step.excluded(damping)) == set(members[1:])
    assert not step.excluded(mode) and mode in step.expected
