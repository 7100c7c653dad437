"""The shot that decides, in the window: planned after a diagnosis, taken, joined to it, told beside what was expected.

Plain Python, polled by the screen: a plan is a job, a planned shot is the rig's, its diagnosis the workbench's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from analysis.fitted.awaited_fit import awaits_fit
from analysis.planning.next_shot import MOST_SHOTS, NextShot, as_found_kg, contact_s
from analysis.planning.steps import Standing, Step, next_step, stand
from analysis.shot.recording import Setup
from analysis.shot.shot import Shot
from app.session.choices import Choices
from app.session.event import Diagnosed
from app.session.jobs import Job
from app.session.rig import Rig
from app.session.session import Entry
from app.session.workbench import Workbench
from instrument.capture.capture_options import CaptureOptions
from instrument.devices.digitizer import CaptureSettings
from instrument.devices.sources import is_bench, pushed

PLAN = "plan"  # the kind of its jobs


@dataclass(frozen=True, slots=True)
class _Under:
    """A planned shot under way: the set it is to join, the log before it, the source to go back to."""

    step: Step
    numbers: tuple[int, ...]
    before: tuple[Step, ...]
    source: str
    arrived: bool = False  # then it is one of ``numbers``


class NextShots:
    """Where every diagnosed set stands, and the one planned shot that may be under way."""

    def __init__(self, workbench: Workbench, rig: Rig, choices: Choices) -> None:
        self._workbench, self._rig, self._choices = workbench, rig, choices
        self._standings: dict[frozenset[int], Standing] = {}
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

    def standing(self, found: Diagnosed | None) -> Standing | None:
        """Return where the set of a diagnosis stands, None where it was not planned for."""
        return None if found is None else self._standings.get(frozenset(found.numbers))

    def plan(self, found: Diagnosed, steps: Sequence[Step] = ()) -> None:
        """Queue the planning of what would tell apart what this diagnosis left open."""
        motions = [shot.motion for shot in self._shots(found.numbers) if shot.motion is not None]
        left = max(0, MOST_SHOTS - len(steps))
        work = partial(stand, motions, found.diagnosis, tuple(steps), left=left, reach=self._choices.settings.reach)
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
            if not job.cancelled and isinstance(job.result, Standing):
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


_LEAST_BEFORE_SWITCH_S = 1e-3
_RATE_HZ = 10e6  # where no shot tells


def planned_record(shot: NextShot, shots: Sequence[Shot], rate_hz: float | None) -> CaptureSettings:
    """Return the capture of a planned shot: so much flight before the touch and after the contact.

    ``rate_hz`` None takes the rate of the shots so far.
    """
    from analysis.inference.fit.samples import together  # with all of the fit: not at every start

    rate_hz = rate_hz or next((one.sample_rate_hz for one in shots if one.sample_rate_hz), None) or _RATE_HZ
    samples = together([one.motion for one in shots if one.motion is not None and one.fit is not None])
    whole_s = shot.before_s + contact_s(shot, samples) + shot.after_s
    before_switch_s = max(shot.before_s - _switch_m(shots) / shot.speed_m_per_s, _LEAST_BEFORE_SWITCH_S)
    return CaptureSettings(rate_hz, round(rate_hz * whole_s), round(rate_hz * before_switch_s))


def planned_setup(setup: Setup, shot: NextShot, shots: Sequence[Shot]) -> Setup:
    """Return the rig of a planned shot: the block as the lightest of the shots so far had it, and the plan's weights.

    One rule for the window and ``--resolve``: what the settings state at that moment does not count, so that weights
    put on as the plan says and typed into the settings as well are not counted twice.
    """
    motions = [one.motion for one in shots if one.motion is not None]
    return replace(setup, moving_mass_kg=as_found_kg(motions) + shot.added_mass_kg)


def _switch_m(shots: Sequence[Shot]) -> float:
    """Return how far before the plate the light switch stands, as the shots so far show it; 0 where none does."""
    ways = []
    for shot in shots:
        if shot.fit is not None and shot.trigger_time_s is not None:
            own = shot.fit.shots[0]
            ways.append(abs(own.velocity_in_m_per_s.value) * (own.touch_time_s.value - shot.trigger_time_s))
    return max(0.0, sorted(ways)[len(ways) // 2]) if ways else 0.0
