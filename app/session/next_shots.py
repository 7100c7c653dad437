"""Plan the next shot after a diagnosis, take it with the rig, and repeat the diagnosis with it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from analysis.fitted import fit_pending
from analysis.planning import (
    MAX_SHOTS,
    NextShot,
    PlannedStep,
    PlanningState,
    contact_s,
    mass_without_weights_kg,
    next_step,
    plan_next,
)
from analysis.shot import Setup, Shot
from app.session.entry import Entry
from app.session.rig import Rig
from app.session.settings_store import SettingsStore
from app.session.verdict_basis import Diagnosed
from app.session.workbench import Workbench
from instrument.capture import CaptureOptions
from instrument.devices import CaptureSettings, is_bench, with_push

PLAN = "plan"  # kind of the planning jobs


@dataclass(frozen=True, slots=True)
class _Capture:
    """A planned shot being taken: the set that it joins, earlier planned steps, the source to reopen afterwards."""

    step: PlannedStep
    numbers: tuple[int, ...]
    before: tuple[PlannedStep, ...]
    source: str
    arrived: bool = False  # True: the shot is fitted and its number is in ``numbers``


class NextShots:
    """Plans of the diagnosed sets of shots, and the planned shot being taken."""

    def __init__(self, workbench: Workbench, rig: Rig, store: SettingsStore) -> None:
        self._workbench, self._rig, self._store = workbench, rig, store
        self._plans: dict[frozenset[int], PlanningState] = {}
        self._under: _Capture | None = None

    @property
    def taking(self) -> NextShot | None:
        """Get the planned shot for which the rig is armed, or None."""
        return self._under.step.shot if self._under is not None and not self._under.arrived else None

    @property
    def sets_rig(self) -> bool:
        """Get whether the program can set speed and weights itself, which only the simulated bench allows."""
        return is_bench(self._rig.source)

    def plan_for(self, found: Diagnosed | None) -> PlanningState | None:
        """Return the plan for the diagnosed set of shots, or None."""
        return None if found is None else self._plans.get(frozenset(found.numbers))

    def plan(self, found: Diagnosed, steps: Sequence[PlannedStep] = ()) -> None:
        """Queue the planning of a shot that distinguishes the candidates of a diagnosis, given earlier ``steps``."""
        shots = self._workbench.session.shots(found.numbers)
        left = max(0, MAX_SHOTS - len(steps))
        work = partial(plan_next, shots, found.diagnosis, tuple(steps), left=left, reach=self._store.settings.reach)
        take = partial(self._plans.__setitem__, frozenset(found.numbers))
        self._workbench.submit_long("next shot", work, PLAN, take)

    def take(self, found: Diagnosed) -> None:
        """Arm for the plan's next shot; on the simulated bench also set its speed and weights."""
        standing = self.plan_for(found)
        if standing is None or standing.settled or self.taking is not None:
            return
        step, shots, source = next_step(standing), self._workbench.session.shots(found.numbers), self._rig.source
        shot = step.shot
        wanted = with_push(source, shot.speed_m_per_s, shot.added_mass_kg, len(shots)) if self.sets_rig else source

        def changed(options: CaptureOptions) -> CaptureOptions:
            rate_hz = options.settings.sample_rate_hz if options.settings is not None else None
            setup = planned_setup(options.setup, shot, shots) if options.setup is not None else None
            settings = planned_record(shot, shots, rate_hz)
            return replace(options, settings=settings, setup=setup)

        self._under = _Capture(step, found.numbers, standing.steps, source)
        self._rig.open(wanted, changed)

    def cancel_planned(self) -> None:
        """Cancel the planned shot and reopen the previous source."""
        under, self._under = self._under, None
        if under is not None and not under.arrived:
            self._rig.open(under.source)

    def arrived(self, entry: Entry) -> None:
        """Once the planned shot is fitted, add it to its set and diagnose the set again."""
        under = self._under
        if under is None or under.arrived or (entry.shot is not None and fit_pending(entry.shot)):
            return
        self._rig.open(under.source)
        if entry.shot is None or entry.shot.motion is None or entry.shot.fit is None:
            self._under = None
            return
        numbers = (*under.numbers, entry.number)
        self._under = replace(under, numbers=numbers, arrived=True)
        self._workbench.diagnose(numbers)

    def poll(self) -> tuple[int, ...] | None:
        """Once the set with the new shot is diagnosed, plan the next shot and return the set's numbers; else None."""
        under = self._under
        if under is None or not under.arrived:
            return None
        found = self._workbench.diagnoses.newest
        if found is None or set(found.numbers) != set(under.numbers):
            return None
        self._under = None
        self.plan(found, (*under.before, under.step))
        return under.numbers


_MIN_BEFORE_SWITCH_S = 1e-3
_RATE_HZ = 10e6  # used if no shot has a sample rate


def planned_record(shot: NextShot, shots: Sequence[Shot], rate_hz: float | None) -> CaptureSettings:
    """Return the capture settings of a planned shot; ``rate_hz`` None: the sample rate of the shots so far."""
    from analysis.inference import averaged_shots  # slow to import

    rate_hz = rate_hz or next((one.sample_rate_hz for one in shots if one.sample_rate_hz), None) or _RATE_HZ
    samples = averaged_shots([one.motion for one in shots if one.motion is not None and one.fit is not None])
    whole_s = shot.before_s + contact_s(shot, samples) + shot.after_s
    before_switch_s = max(shot.before_s - _switch_m(shots) / shot.speed_m_per_s, _MIN_BEFORE_SWITCH_S)
    return CaptureSettings(rate_hz, round(rate_hz * whole_s), round(rate_hz * before_switch_s))


def planned_setup(setup: Setup, shot: NextShot, shots: Sequence[Shot]) -> Setup:
    """Return the rig of a planned shot: its mass is that of the lightest shot so far plus the planned weights.

    The mass in the settings is not used, because the operator may already have added the weights to it.
    """
    motions = [one.motion for one in shots if one.motion is not None]
    return replace(setup, moving_mass_kg=mass_without_weights_kg(motions) + shot.added_mass_kg)


def _switch_m(shots: Sequence[Shot]) -> float:
    """Return the distance from light switch to plate in m, the median of the shots so far; 0 if unknown."""
    ways = []
    for shot in shots:
        if shot.fit is not None and shot.trigger_time_s is not None:
            own = shot.fit.shots[0]
            ways.append(abs(own.velocity_in_m_per_s.value) * (own.touch_time_s.value - shot.trigger_time_s))
    return max(0.0, sorted(ways)[len(ways) // 2]) if ways else 0.0
