"""The next shot in the window: planned after a diagnosis, taken by the rig, and added to the diagnosed set."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from analysis.fitted import awaits_fit
from analysis.planning import MOST_SHOTS, NextShot, PlannedStep, PlanningState, next_step, plan_next
from analysis.shot import Shot
from app.session.choices import Choices
from app.session.event import Diagnosed
from app.session.jobs import Job
from app.session.planned_capture import planned_record, planned_setup
from app.session.rig import Rig
from app.session.session import Entry
from app.session.workbench import Workbench
from instrument.capture import CaptureOptions
from instrument.devices import is_bench, pushed

PLAN = "plan"  # the kind of its jobs


@dataclass(frozen=True, slots=True)
class _Capture:
    """A planned shot being taken: the set it joins, the steps before it, the source to reopen afterwards."""

    step: PlannedStep
    numbers: tuple[int, ...]
    before: tuple[PlannedStep, ...]
    source: str
    arrived: bool = False  # then it is one of ``numbers``


class NextShots:
    """The plans of all diagnosed sets, and the planned shot that is being taken."""

    def __init__(self, workbench: Workbench, rig: Rig, choices: Choices) -> None:
        self._workbench, self._rig, self._choices = workbench, rig, choices
        self._standings: dict[frozenset[int], PlanningState] = {}
        self._job: tuple[Job, frozenset[int]] | None = None
        self._under: _Capture | None = None

    @property
    def taking(self) -> NextShot | None:
        """Get the planned shot that the rig waits for, or None."""
        return self._under.step.shot if self._under is not None and not self._under.arrived else None

    @property
    def sets_itself(self) -> bool:
        """Get whether the program can set speed and weights itself: at the simulated bench."""
        return is_bench(self._rig.source)

    def standing(self, found: Diagnosed | None) -> PlanningState | None:
        """Return the plan for the set of a diagnosis, None where there is none."""
        return None if found is None else self._standings.get(frozenset(found.numbers))

    def plan(self, found: Diagnosed, steps: Sequence[PlannedStep] = ()) -> None:
        """Queue the planning of a shot that decides between the candidates of a diagnosis."""
        motions = [shot.motion for shot in self._shots(found.numbers) if shot.motion is not None]
        left = max(0, MOST_SHOTS - len(steps))
        work = partial(plan_next, motions, found.diagnosis, tuple(steps), left=left, reach=self._choices.settings.reach)
        self._job = (self._workbench.aside("next shot", work, PLAN), frozenset(found.numbers))

    def take(self, found: Diagnosed) -> None:
        """Arm for the first shot of the plan; on the simulated bench also set its speed and weights."""
        standing = self.standing(found)
        if standing is None or standing.settled or self.taking is not None:
            return
        step, shots, source = next_step(standing), self._shots(found.numbers), self._rig.source
        shot = step.shot
        wanted = pushed(source, shot.speed_m_per_s, shot.added_mass_kg, len(shots)) if self.sets_itself else source

        def changed(options: CaptureOptions) -> CaptureOptions:
            rate_hz = options.settings.sample_rate_hz if options.settings is not None else None
            setup = planned_setup(options.setup, shot, shots) if options.setup is not None else None
            settings = planned_record(shot, shots, rate_hz)
            return replace(options, settings=settings, setup=setup)

        self._under = _Capture(step, found.numbers, standing.steps, source)
        self._rig.take(wanted, changed)

    def give_up(self) -> None:
        """Cancel the planned shot, and reopen the source used before."""
        under, self._under = self._under, None
        if under is not None and not under.arrived:
            self._rig.open(under.source)

    def arrived(self, entry: Entry) -> None:
        """Add a captured shot, once it is fitted, to the set it was planned for, and diagnose that again."""
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
        """Take finished work; return the numbers of a set that a planned shot has just joined, else None."""
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
