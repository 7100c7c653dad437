"""The shot that decides, in the window and on the command line."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from analysis.collision.effects import effects_named
from analysis.inference.fit.shot_fit import fit_shots
from analysis.planning.next_shot import NextShot
from analysis.planning.plan import Plan
from analysis.planning.shot_log import PlannedStep, PlanningState
from analysis.shot.recording import Setup
from app.command_line.cli import main
from app.command_line.replay import plan_shots
from app.session.next_shots import NextShots, planned_record, planned_setup
from app.session.settings import Settings
from app.session.verdict_basis import Diagnosed, Diagnoses
from app.window.panels.next_steps import NextShotCard
from instrument.capture.stream_reader import CaptureOptions
from tests.analysis.diagnosis.shots import motions_of
from tests.analysis.planning.rig import rig
from tests.app import synthetic

FAST = NextShot(0.6, 0.05, 0.012, 0.02)
BETWEEN = DRAG, _ = effects_named(("quadratic_drag", "viscous_drag"))
PLAN = Plan((FAST,), BETWEEN, 2.0, {DRAG: 9.0}, {DRAG: 9.0}, 9.0, ())
HOPELESS = replace(PLAN, shots=(), best=1.5, inseparable=BETWEEN)
STEP = PlannedStep(FAST, BETWEEN, PLAN.after_first)


@pytest.fixture
def card(qtbot):
    card = NextShotCard()
    qtbot.addWidget(card)
    return card


@pytest.fixture(scope="module")
def said():
    return synthetic.diagnosis(synthetic.shot())


def test_the_card_offers_a_plan_only_where_a_choice_is_open(card, said):
    card.show_standing(said, None, None, False)
    assert not card.isHidden() and not card.plan.isHidden() and card.take.isHidden()
    sure = replace(said, effects=(replace(said.effects[0], indistinguishable_from=()),))
    card.show_standing(sure, None, None, False)
    assert card.isHidden()
    card.show_standing(None, None, None, False)
    assert card.isHidden()


def test_the_card_says_what_to_set_what_it_will_show_and_what_it_showed(card, said, qtbot):
    card.show_standing(said, PlanningState(PLAN), None, False)
    assert "0.6 m/s with 50 g added" in card.sentence.text() and "9 noise norms" in card.sentence.text()
    assert card.take.text() == "ARM for planned shot" and card.plan.isHidden()
    card.show_standing(said, PlanningState(PLAN), None, True)
    assert card.take.text() == "Set bench and take shot"
    with qtbot.waitSignal(card.take.clicked):
        card.take.click()
    card.show_standing(said, PlanningState(PLAN), FAST, False)
    assert card.take.isHidden() and not card.give_up.isHidden() and "Set, then push" in card.sentence.text()
    done = replace(STEP, reached=8.4, leader=DRAG)
    card.show_standing(said, PlanningState(None, (done,)), None, False)
    assert "9 noise norms expected, 8.4 reached" in card.log.text() and "Resolved" in card.sentence.text()


def test_the_card_says_that_no_shot_can(card, said):
    card.show_standing(said, PlanningState(HOPELESS), None, True)
    assert "No shot of this rig" in card.sentence.text() and card.take.isHidden()


class _Workbench:
    """A workbench that keeps what it is asked for."""

    def __init__(self, shots):
        self.session = SimpleNamespace(shots=lambda numbers: [shots[n] for n in numbers])
        self.diagnoses = Diagnoses()
        self.asked, self.jobs = [], []

    def submit_long(self, name, work, kind, take):
        self.jobs.append(SimpleNamespace(work=work, take=take))

    def diagnose(self, numbers):
        self.asked.append(tuple(numbers))


class _Rig:
    """A rig that keeps what it is asked for."""

    def __init__(self, source):
        self.source, self.taken, self.opened = source, [], []

    def open(self, source, planned=None):
        if planned is None:
            self.opened.append(source)
        else:
            self.taken.append((source, planned))


@pytest.fixture
def planned(said):
    shot = synthetic.shot()
    workbench, rig = _Workbench({1: shot, 2: shot, 3: shot}), _Rig("bench?seed=4")
    choices = SimpleNamespace(settings=Settings(weights_kg="0.02 0.1", speeds_m_per_s="0.3"))
    plans, found = NextShots(workbench, rig, choices), Diagnosed(said, (1, 2))
    plans.plan(found)
    workbench.jobs[-1].take(PlanningState(PLAN))
    assert plans.poll() is None
    return plans, workbench, rig, found


def test_a_planned_shot_is_set_taken_joined_and_told(planned, said, tmp_path):
    plans, workbench, rig, found = planned
    assert plans.plan_for(found) == PlanningState(PLAN)
    plans.take(found)
    ((source, change),) = rig.taken
    assert source == "bench?seed=4&speed=0.6000&added=0.05000&first=2" and plans.taking == FAST
    settings = change(CaptureOptions(tmp_path)).settings
    assert settings.samples / settings.sample_rate_hz > FAST.before_s + FAST.after_s
    plans.take(found)
    assert len(rig.taken) == 1  # one is under way
    plans.arrived(SimpleNamespace(number=3, shot=workbench.session.shots((3,))[0]))
    assert workbench.asked == [(1, 2, 3)] and rig.opened == ["bench?seed=4"] and plans.taking is None
    assert plans.poll() is None  # not diagnosed yet
    workbench.diagnoses.append(Diagnosed(said, (1, 2, 3)))
    assert plans.poll() == (1, 2, 3)
    assert workbench.jobs[-1].work.args[2] == (STEP,)


def test_the_set_diagnosed_again_before_the_planned_shot_comes_is_not_that_shot(planned, said):
    plans, workbench, _, found = planned
    plans.take(found)
    workbench.diagnoses.append(Diagnosed(said, (1, 2)))
    assert plans.poll() is None and plans.taking == FAST


@pytest.mark.parametrize(
    ("trigger_time_s", "way_m"),
    [(0.055, 0.265 * (synthetic.TOUCH_S - 0.055)), (synthetic.TOUCH_S + 0.01, 0.0), (None, 0.0)],
)
def test_a_planned_shot_is_recorded_from_the_planned_time_before_the_touch(trigger_time_s, way_m):
    """The record begins by the light switch, which the block passes before it touches."""
    shots = [replace(synthetic.shot(), trigger_time_s=trigger_time_s)]
    settings = planned_record(FAST, shots, 1e6)
    assert settings.pre_trigger_samples == pytest.approx(1e6 * (FAST.before_s - way_m / FAST.speed_m_per_s), abs=1.0)


def test_a_plan_asks_only_for_speeds_and_weights_at_hand(planned):
    _, workbench, _, _ = planned
    reach = workbench.jobs[-1].work.keywords["reach"]
    assert reach.speeds_m_per_s == (0.3,) and reach.added_kg == (0.0, 0.02, 0.1)


def test_weights_typed_into_the_settings_as_well_count_once(planned, tmp_path):
    """The one rule: a planned shot has the block as the set had it, and the plan's weights."""
    plans, workbench, rig, found = planned
    rig.source = "hantek6022"
    plans.take(found)
    ((source, change),) = rig.taken
    as_found = workbench.session.shots((1,))[0].motion.moving_mass_kg
    for stated in (as_found, as_found + FAST.added_mass_kg):
        taken = change(CaptureOptions(tmp_path, setup=Setup(stated)))
        assert source == "hantek6022" and taken.setup.moving_mass_kg == pytest.approx(as_found + 0.05, rel=1e-12)
    shots = workbench.session.shots((1,))
    assert planned_setup(Setup(9.0), FAST, shots).moving_mass_kg == pytest.approx(as_found + 0.05)


def test_a_shot_that_cannot_be_read_joins_nothing_and_one_may_give_up(planned):
    plans, workbench, rig, found = planned
    plans.take(found)
    plans.arrived(SimpleNamespace(number=9, shot=None))
    assert workbench.asked == [] and plans.taking is None and rig.opened == ["bench?seed=4"]
    plans.take(found)
    plans.cancel_planned()
    assert plans.taking is None and len(rig.opened) == 2
    plans.arrived(SimpleNamespace(number=3, shot=workbench.session.shots((3,))[0]))
    assert workbench.asked == []


def test_a_replay_is_told_which_shot_makes_a_number_surer(said, capsys):
    truth = rig({})
    motions = motions_of(truth)
    fit = fit_shots(motions)
    shots = [SimpleNamespace(motion=motion, fit=fit) for motion in motions]
    sure = replace(said, effects=(), fit_after=fit)
    ahead = plan_shots(shots, sure, "contact_damping_n_s_per_m")
    assert ahead is not None and "would make contact_damping_n_s_per_m" in ahead.words
    assert ahead.result["std_after"] < 0.6 * ahead.result["std_before"] and ahead.result["shots"]
    json.dumps(ahead.result, allow_nan=False)
    assert plan_shots(shots, sure, "").result is None
    assert plan_shots(shots, sure, "gamma") is None and plan_shots(shots, None, "") is None
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 2 and "no shared parameter is called 'gamma'" in lines[0]


def test_resolve_without_a_source_that_is_there_is_one_line(tmp_path, capsys):
    arguments = ["--acquire", "1", "--source", "nothing", "--out", str(tmp_path), "--resolve", "1"]
    assert main(arguments) == 1
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


@pytest.mark.slow
def test_the_bench_is_asked_until_one_name_is_left(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, result_file = "bench?effect=coulomb_friction:force_n=2e-7&seed=4", tmp_path / "out.json"
    where = ["--out", str(tmp_path / "shots"), "--rate", "10e6", "--json", str(result_file)]
    assert main(["--acquire", "2", "--source", source, "--resolve", "2", *where]) == 0
    result = json.loads(result_file.read_text())
    assert [effect["name"] for effect in result["diagnosis"]["effects"]] == ["coulomb_friction"]
    assert result["next_shots"] is None and 1 <= len(result["plan"]) <= 2
    for step in result["plan"]:
        assert step["reached_separation"] == pytest.approx(step["expected_separation"], rel=0.35)
