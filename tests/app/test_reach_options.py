"""What the rig can do, as the command line says it to the planning."""

import pytest

from analysis.planning.next_shot import Reach
from app.command_line import replay, resolve
from app.command_line.cli import reach_of
from app.command_line.parser import parse
from app.session.settings import Settings
from tests.app import synthetic


def asked(*more: str) -> Reach:
    return reach_of(parse(["plan", "x", *more]))


def test_where_nothing_is_said_the_command_line_plans_as_the_window_does():
    assert asked() == Reach() == Settings().reach


def test_speeds_weights_and_run_up_are_taken_as_said():
    found = asked("--speeds", "0.4,0.1", "--weights", "0.02,0.05", "--run-up", "0.02")
    assert found.speeds_m_per_s == (0.1, 0.4) and found.added_kg == (0.0, 0.02, 0.05) and found.run_up_m == 0.02
    assert asked("--weights", "0").added_kg == (0.0,)


class PlannedWith(BaseException):  # which nobody on the way takes for a fault
    """The limits of the rig that a plan was made with."""


@pytest.fixture
def stops_at_the_plan(monkeypatch):
    def plan_next(*_, reach, **__):
        raise PlannedWith(reach)

    for module in (replay, resolve):
        monkeypatch.setattr(module, "plan_next", plan_next)
    monkeypatch.setattr(replay, "refit_diagnosed", lambda *_: None)
    monkeypatch.setattr(replay, "plan_precision", lambda *_, reach: plan_next(reach=reach))
    monkeypatch.setattr(resolve, "diagnose", lambda *_, **__: synthetic.diagnosis(synthetic.shot()))


@pytest.mark.parametrize("parameter", ["", "plate_stiffness_n_per_m"])
def test_a_plan_reaches_as_far_as_the_rig_does(stops_at_the_plan, parameter):
    shot, reach = synthetic.shot(), Reach((0.1,), (0.0,), 0.02)
    with pytest.raises(PlannedWith) as found:
        replay.plan_shots([shot], synthetic.diagnosis(shot), parameter, reach)
    assert found.value.args == (reach,)


def test_shots_that_decide_are_planned_within_the_same_reach(stops_at_the_plan):
    reach = Reach((0.1,), (0.0,), 0.02)
    with pytest.raises(PlannedWith) as found:
        resolve._standing([synthetic.shot()], (), 2, reach)
    assert found.value.args == (reach,)
