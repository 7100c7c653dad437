"""The shot that decides, in the window: planned after a diagnosis, taken, joined to it, told beside what was expected.

Plain Python, polled by the screen: a plan is a job, a planned shot is the rig's, its diagnosis the workbench's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from analysis.fitted.fitted_shot import awaits_fit
from analysis.planning.next_shot import MOST_SHOTS, NextShot
from analysis.planning.shot_log import PlannedStep, PlanningState, next_step, plan_next
from analysis.shot.shot import Shot
from app.session.choices import Choices
from app.session.event import Diagnosed
from app.session.jobs import Job
from app.session.planned_record import planned_record, planned_setup
from app.session.rig import Rig
from app.session.session import Entry
from app.session.workbench import Workbench
from instrument.capture.capture_options import CaptureOptions
from instrument.devices.sources import is_bench, pushed

PLAN = "plan"  # the kind of its jobs


@dataclass(frozen=True, slots=True)
class _Under:
    """A planned shot under way: the set it is to join, the log before it, the source to go back to."""

    step: PlannedStep
    numbers: tuple[int, ...]
    before: tuple[PlannedStep, ...]
    source: str
    arrived: bool = False  # then it is one of ``numbers``


class NextShots:
    """Where every diagnosed set stands, and the one planned shot that may be under way."""

    def __init__(self, workbench: Workbench, rig: Rig, choices: Choices) -> None:
        self._workbench, self._rig, self._choices = workbench, rig, choices
        self._standings: dict[frozenset[int], PlanningState] = {}
        self._job: tuple[Job, frozenset[int]] | None = None
        self._under: _Under | None = None

    @property
    def taking(self) -> NextShot | None:
        """Get the planned shot that is waited for, None while there is none."""
        return self._under.step.shot if self._under is not None and not self._under.arrived else None

    @property
    def sets_itself(self) -> bool:
        """Get whether the program can set speed and weights at the source in use: at the simulated bench."""
        return is_bench(self._rig.source)

    def standing(self, found: Diagnosed | None) -> PlanningState | None:
        """Return where the set of a diagnosis stands, None where it was not planned for."""
        return None if found is None else self._standings.get(frozenset(found.numbers))

    def plan(self, found: Diagnosed, steps: Sequence[PlannedStep] = ()) -> None:
        """Queue the planning of what would tell apart what this diagnosis left open."""
        motions = [shot.motion for shot in self._shots(found.numbers) if shot.motion is not None]
        left = max(0, MOST_SHOTS - len(steps))
        work = partial(plan_next, motions, found.diagnosis, tuple(steps), left=left, reach=self._choices.settings.reach)
        self._job = (self._workbench.aside("next shot", work, PLAN), frozenset(found.numbers))

    def take(self, found: Diagnosed) -> None:
        """Arm for the first shot of the plan; on the simulated bench its speed and weights are set too."""
        standing = self.standing(found)
        if standing is None or standing.settled or self.taking is not None:
            return
        step, shots, source = next_step(standing), self._shots(found.numbers), self._rig.source
        shot = step.shot
        asked = pushed(source, shot.speed_m_per_s, shot.added_mass_kg, len(shots)) if self.sets_itself else source

        def changed(options: CaptureOptions) -> CaptureOptions:
            rate_hz = options.settings.sample_rate_hz if options.settings is not None else None
            setup = planned_setup(options.setup, shot, shots) if options.setup is not None else None
            settings = planned_record(shot, shots, rate_hz)
            return replace(options, settings=settings, setup=setup)

        self._under = _Under(step, found.numbers, standing.steps, source)
        self._rig.take(asked, changed)

    def give_up(self) -> None:
        """Wait no longer for a planned shot."""
        under, self._under = self._under, None
        if under is not None and not under.arrived:
            self._rig.open(under.source)

    def arrived(self, entry: Entry) -> None:
        """Let a shot that the rig took join the set for which it was planned, once it is fitted; diagnose that anew."""
        under = self._under
        if under is None or under.arrived or (entry.shot is not None and awaits_fit(entry.shot)):
            return
        self._rig.open(under.source)
        if entry.shot is None or entry.shot.motion is None or entry.shot.fit is None:
            self._under = None
            return
        numbers = (*under.numbers, entry.number)
        self._under = replace(under, numbers=numbers, arrived=True)
        self._workbench.diagnose(numbers)

    def poll(self) -> tuple[int, ...] | None:
        """Take what ended; return the numbers of a set that a planned shot has just joined, else None."""
        if self._job is not None and self._job[0].done.is_set():
            job, numbers = self._job
            self._job = None
            if not job.cancelled and isinstance(job.result, PlanningState):
                self._standings[numbers] = job.result
        under = self._under
        if under is None or not under.arrived:
            return None
        found = self._workbench.diagnoses.newest
        if found is None or set(found.numbers) != set(under.numbers):
            return None
        self._under = None
        self.plan(found, (*under.before, under.step))
        return under.numbers

    def _shots(self, numbers: Sequence[int]) -> list[Shot]:
        entries = (self._workbench.session.entry(number) for number in numbers)
        return [entry.shot for entry in entries if entry is not None and entry.shot is not None]
