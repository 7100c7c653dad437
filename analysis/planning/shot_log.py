"""The log of planned shots that were taken, with the separation expected of each and the separation reached."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis
from analysis.planning.next_shot import MAX_SHOTS, NextShot, Reach, first_indistinguishable
from analysis.shot import Progress, Shot, Stop, motions_of

if TYPE_CHECKING:  # these import the whole diagnosis, which a window does not need before it makes a plan
    from analysis.planning.model_comparison import ModelComparison
    from analysis.planning.plan import Plan


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """One planned shot: ``expected`` gives the separation expected after it for each effect that may be the true one.

    ``reached`` is the separation by all shots up to this one, ``leader`` the likeliest member then; None until taken.
    """

    shot: NextShot
    members: tuple[Effect, ...]
    expected: Mapping[Effect, float]
    reached: float | None = None
    leader: Effect | None = None
    inseparable_from: Mapping[Effect, tuple[Effect, ...]] = field(default_factory=dict)  # as in ``Plan``

    @property
    def expected_separation(self) -> float:
        """Get the separation expected if the leader is true; before the shot is taken, if the first member is true."""
        first = next(iter(self.expected.values()))
        return first if self.leader is None else self.expected.get(self.leader, first)

    def excluded(self, leader: Effect) -> Collection[Effect]:
        """Return the members from which no separation was expected where ``leader`` is the true one.

        For a leader that the plan could separate from none, these are all members that it could not separate.
        """
        if leader in self.expected:
            return self.inseparable_from.get(leader, ())
        return [member for member in self.members if member not in self.expected]

    def to_json(self) -> dict[str, Any]:
        return {
            "shot": self.shot.to_json(),
            "between": [effect.key for effect in self.members],
            "expected_separation": self.expected_separation,
            "expected_if": {effect.key: value for effect, value in self.expected.items()},
            "reached_separation": self.reached,
        }


@dataclass(frozen=True, slots=True)
class PlanningState:
    """The plan for a set of shots (None: no effect has look-alikes left), and the log of planned shots so far."""

    plan: Plan | None
    steps: tuple[PlannedStep, ...] = ()

    @property
    def settled(self) -> bool:
        """Get whether no effect has look-alikes left, or no shot could separate them."""
        return self.plan is None or not self.plan.settles


def plan_next(
    shots: Sequence[Shot],
    diagnosis: Diagnosis,
    steps: Sequence[PlannedStep] = (),
    *,
    left: int = MAX_SHOTS,
    reach: Reach | None = None,
    progress: Progress = lambda _what, _fraction: None,
    cancelled: Stop = lambda: False,
) -> PlanningState:
    """Plan the shots still needed, given ``shots`` and their diagnosis; the last of ``steps``, if any, was just taken.

    At most ``left`` shots are planned; with 0 left, as many as if none had been taken.  Raises AnalysisError,
    Cancelled.
    """
    from analysis.planning.model_comparison import compare_models
    from analysis.planning.plan import plan

    done, undecided_now = list(steps), first_indistinguishable(diagnosis)
    motions = motions_of(shots)
    comparison: ModelComparison | None = None
    if done:
        comparison = compare_models(diagnosis.fit_after, done[-1].members, motions, cancelled)
        if comparison is not None:
            leader = comparison.members[0].effect
            done[-1] = replace(done[-1], reached=comparison.separation_from(done[-1].excluded(leader)), leader=leader)
    if not done or set(undecided_now) != set(done[-1].members):
        comparison = compare_models(diagnosis.fit_after, undecided_now, motions, cancelled)
    if comparison is None:
        return PlanningState(None, tuple(done))
    further = plan(comparison, reach, most=left or MAX_SHOTS, progress=progress, stop=cancelled)
    return PlanningState(further, tuple(done))


def next_step(state: PlanningState) -> PlannedStep:
    plan = state.plan
    assert plan is not None and plan.shots
    return PlannedStep(plan.shots[0], plan.members, plan.after_first, inseparable_from=plan.inseparable_from)
