"""The log of shots that were planned and taken: what each was to show, and what it showed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from analysis.diagnosis.result import Diagnosis
from analysis.planning.next_shot import MOST_SHOTS, NextShot, Reach, undecided
from analysis.shot.motion import Motion
from analysis.shot.shot import Progress, Stop

if TYPE_CHECKING:  # what plans brings all of the diagnosis; a window shows plans long before it makes one
    from analysis.planning.contest import Contest
    from analysis.planning.plan import Plan


@dataclass(frozen=True, slots=True)
class Step:
    """One planned shot: ``expected`` gives the separation it was to bring by the effect that is the true one.

    ``reached`` is what all shots up to it bring, ``leader`` the likeliest member then; None before it was taken.
    """

    shot: NextShot
    members: tuple[str, ...]
    expected: Mapping[str, float]
    reached: float | None = None
    leader: str | None = None
    one_with: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # whom no shot parts from whom

    @property
    def expected_separation(self) -> float:
        """Get the separation foreseen for the member that turned out the likeliest; before, for the first of them."""
        return self.expected.get(self.leader or "", next(iter(self.expected.values())))

    @property
    def foreseen(self) -> bool:
        """Get whether something was foreseen for the member that turned out the likeliest."""
        return self.leader in self.expected

    def beside(self, leader: str) -> Collection[str]:
        """Return the members from which no distance was foreseen where ``leader`` is the true one.

        Of one that the plan could part from none it says how far those stand off that it could tell.
        """
        if leader in self.expected:
            return self.one_with.get(leader, ())
        return [member for member in self.members if member not in self.expected]

    def to_json(self) -> dict[str, Any]:
        """Return the step as the result file has it (docs/formats.md)."""
        return {
            "shot": self.shot.to_json(),
            "between": list(self.members),
            "expected_separation": self.expected_separation,
            "expected_if": dict(self.expected),
            "reached_separation": self.reached,
        }


@dataclass(frozen=True, slots=True)
class Standing:
    """Where a set of shots stands: what to take next (None: nothing is open), and the log so far."""

    plan: Plan | None
    steps: tuple[Step, ...] = ()

    @property
    def settled(self) -> bool:
        """Get whether nothing is open, or nothing that a shot could tell."""
        return self.plan is None or not self.plan.settles


def stand(
    motions: Sequence[Motion],
    diagnosis: Diagnosis,
    steps: Sequence[Step] = (),
    *,
    left: int = MOST_SHOTS,
    reach: Reach | None = None,
    progress: Progress = lambda _what, _fraction: None,
    cancelled: Stop = lambda: False,
) -> Standing:
    """Return where ``motions`` with their ``diagnosis`` stand, the last of ``steps`` just taken if there are any.

    ``left`` shots may still be taken; with none left the plan is for one who would go on.  Raises
    AnalysisError, Cancelled.
    """
    from analysis.planning.contest import contest
    from analysis.planning.plan import plan

    done, left_open = list(steps), undecided(diagnosis)
    now: Contest | None = None
    if done:
        now = contest(diagnosis.fit_after, done[-1].members, motions, cancelled)
        if now is not None:
            leader = now.members[0].effect
            done[-1] = replace(done[-1], reached=now.reached_from(done[-1].beside(leader)), leader=leader)
    if not done or set(left_open) != set(done[-1].members):
        now = contest(diagnosis.fit_after, left_open, motions, cancelled)
    if now is None:
        return Standing(None, tuple(done))
    further = plan(now, reach, most=left or MOST_SHOTS, progress=progress, stop=cancelled)
    return Standing(further, tuple(done))


def next_step(standing: Standing) -> Step:
    """Return the first shot of a standing's plan as a step to be taken."""
    assert standing.plan is not None and standing.plan.shots
    further = standing.plan
    return Step(further.shots[0], further.members, further.after_first, one_with=further.one_with)
