"""Diagnose the selected shots and show the result; add effects or own laws; plan and take the next shot."""

from collections.abc import Callable
from functools import partial
from typing import Any

from PySide6.QtCore import QObject, Signal, Slot

from analysis.collision import Effect, LawError, UserLaw
from analysis.diagnosis import Diagnosis
from analysis.drive import DriveCurves, drive_curves
from analysis.shot import Progress, Shot, Stop
from app.session import PLAN, Diagnosed, Entry, NextShots, OwnLaws, ShotJob, Workbench, verdict_of
from app.window.controls.theme import Tone
from app.window.panels.layout import Layout
from instrument.files import RecordingError
from levimass import PAPER_MODEL

Forces = tuple[Diagnosis, DriveCurves, DriveCurves]  # a drive's diagnosis, and its curves before and after it


def _forces_of(entry: Entry, diagnosis: Diagnosis, _: Progress, __: Stop) -> Forces:
    assert entry.shot is not None and entry.shot.motion is not None
    before, after = (drive_curves(entry.shot.motion, fit) for fit in (diagnosis.fit_before, diagnosis.fit_after))
    return diagnosis, before, after


class DiagnosisPresenter(QObject):
    """Connects the workbench with the model panel and the page DIAGNOSIS."""

    def __init__(self, workbench: Workbench, panels: Layout, parent: QObject) -> None:
        super().__init__(parent)
        self._workbench, self._panels = workbench, panels
        # diagnosis shown, effects in the model, and whether the diagnosis is valid for them
        self._shown: tuple[object, tuple[Effect, ...], bool] = (None, (), True)
        self._forces = ShotJob[Forces](workbench.short_jobs, "residual of the force", self._show_forces)
        page = panels.diagnosis
        page.cancel.clicked.connect(self._cancel)
        page.effects.add_wanted.connect(self._add)
        page.effects.remove_wanted.connect(self._remove)
        page.next_steps.try_wanted.connect(self._try)
        page.why.pointed.connect(workbench.candidate_residuals.first)

    def refresh(self) -> None:
        """Show progress, the diagnosis of the selected shots and the effects in the model."""
        self._show_progress()
        found = self.found()
        if self._panels.tabs.currentIndex() == Layout.DIAGNOSIS:
            self._explain(found)
        effects = self._workbench.session.effects.of(self._base())
        holds = found is None or self._holds(found, effects)
        if self._shown[0] is found and self._shown[1:] == (effects, holds):
            return
        self._shown = (found, effects, holds)
        self._panels.diagnosis.tried = self._workbench.session.effects.tried
        if found is None:
            self._panels.diagnosis.show_diagnosis(None, [], effects)
            return
        shots = self._shots_of(found)
        self._panels.diagnosis.show_diagnosis(found.diagnosis, shots, effects, found.version, holds)
        if found.diagnosis.drive is not None:
            self._compute_forces(found)

    def _show_progress(self) -> None:
        """Show the running diagnosis or plan, or that one waits for another job to end."""
        job = self._workbench.jobs.current
        what, fraction, of = None, 0.0, ""
        if job is not None and job.kind in ("diagnosis", PLAN):
            what, fraction, of = job.what or "starting", job.fraction, job.name
        elif job is not None and self._workbench.jobs.waiting("diagnosis", PLAN):
            what, of = f"waiting for {job.name} to end", "it begins then"
        self._panels.diagnosis.show_progress(what, fraction, of)
        self._panels.model.diagnose.setEnabled(what is None)

    def _compute_forces(self, found: Diagnosed) -> None:
        """Begin to compute the residual forces of the first of a diagnosed drive's shots."""
        entries = [self._workbench.session.entry(number) for number in found.numbers]
        drive = next((e for e in entries if e is not None and e.shot is not None and e.shot.motion is not None), None)
        if drive is not None:
            self._forces.forget()
            self._forces.start(drive, partial(_forces_of, drive, found.diagnosis))

    def _show_forces(self, drive: Entry, forces: Forces) -> None:
        """Show a drive's residual forces if they belong to the diagnosis shown."""
        found, (diagnosis, before, after) = self.found(), forces
        if found is not None and diagnosis is found.diagnosis and drive.shot is not None:
            self._panels.diagnosis.residuals.show_forces(drive.shot, before, after)

    def _explain(self, found: Diagnosed | None) -> None:
        """Fit the candidates of the diagnosis while no other job waits, and show their residuals."""
        why = self._workbench.candidate_residuals
        why.show(found.diagnosis if found is not None else None, self._shots_of(found))
        if why.refresh():
            self._panels.diagnosis.why.show_found(why.found)

    def _shots_of(self, found: Diagnosed | None) -> list[Shot]:
        return self._workbench.session.shots(found.numbers) if found is not None else []

    def _holds(self, found: Diagnosed, effects: tuple[Effect, ...]) -> bool:
        there = {entry.number for entry in self._workbench.session.entries}
        return verdict_of(found.diagnosis, found.numbers).is_valid(effects, there)

    @Slot()
    def diagnose(self) -> None:
        """Diagnose the selected shots jointly."""
        problem = self._workbench.diagnose(self._panels.table.numbers)
        if problem:
            self._panels.diagnosis.show_problem(problem)
        self._panels.tabs.setCurrentIndex(Layout.DIAGNOSIS)

    @Slot()
    def _cancel(self) -> None:
        for kind in ("diagnosis", PLAN):
            self._workbench.jobs.cancel(kind)

    @Slot(list)
    def _add(self, effects: list[Effect]) -> None:
        self._workbench.model.add(self._base(), effects)

    @Slot(object)
    def _try(self, effect: Effect) -> None:
        self._workbench.model.add_tried(self._base(), effect)

    @Slot(object)
    def _remove(self, effect: Effect) -> None:
        self._workbench.model.remove(self._base(), effect)

    def found(self) -> Diagnosed | None:
        """Return the diagnosis of the selected shots, or the newest if no shot is selected."""
        numbers = self._panels.table.numbers
        return self._workbench.diagnoses.of(numbers) if numbers else self._workbench.diagnoses.newest

    def _base(self) -> str:
        """Return the base model of the diagnosis shown, else that of the last selected shot."""
        found = self.found()
        if found is not None:
            return found.diagnosis.fit_before.model
        entry = self._workbench.session.entry(next(reversed(self._panels.table.numbers), 0))
        return entry.settings.model if entry is not None else PAPER_MODEL


class LawsPresenter(QObject):
    """Connects the folder of own laws with the law sheet and the diagnosis."""

    diagnose_wanted = Signal()

    def __init__(self, laws: OwnLaws, panels: Layout, parent: QObject) -> None:
        super().__init__(parent)
        self._laws, self._panels = laws, panels
        panels.diagnosis.law_curve.keep_wanted.connect(self._keep)
        panels.diagnosis.next_steps.law_wanted.connect(panels.law.toggle)
        panels.law.wanted.connect(self._take)

    @Slot(object)
    def _keep(self, law: UserLaw) -> None:
        self._panels.law.fill(law.written())
        self._panels.law.open()

    @Slot(dict)
    def _take(self, table: dict[str, Any]) -> None:
        try:
            law = self._laws.keep(table)
        except (LawError, RecordingError) as error:
            self._panels.law.say(str(error), Tone.BAD)
            return
        self._panels.law.hide()
        words = f"The law {law.name!r} is saved in {self._laws.folder} and tried in every diagnosis"
        self._panels.say(words, Tone.GOOD)
        self.diagnose_wanted.emit()


class NextShotPresenter(QObject):
    """Connects the plans with the card NEXT SHOT; ``found`` returns the diagnosis shown."""

    def __init__(
        self,
        plans: NextShots,
        workbench: Workbench,
        panels: Layout,
        found: Callable[[], Diagnosed | None],
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self._plans, self._workbench, self._panels, self._found = plans, workbench, panels, found
        self._shown: tuple[object, ...] | None = None
        card = panels.diagnosis.next_shot
        card.plan.clicked.connect(self.plan)
        card.take.clicked.connect(self.take)
        card.give_up.clicked.connect(plans.cancel_planned)

    def refresh(self) -> None:
        """Show the plan for the diagnosis shown; select a set once the planned shot added to it is diagnosed."""
        joined = self._plans.poll()
        if joined is not None:
            self._panels.table.select(list(joined))
            self._panels.tabs.setCurrentIndex(Layout.DIAGNOSIS)
        card, found = self._panels.diagnosis.next_shot, self._found()
        job = self._workbench.jobs.current
        card.plan.setEnabled(job is None or job.kind not in (PLAN, "diagnosis"))
        now = (found, self._plans.plan_for(found), self._plans.taking, self._plans.sets_rig)
        # compared by identity: == on repeated diagnoses would compare the arrays of their fits
        if self._shown is None or any(a is not b for a, b in zip(now, self._shown, strict=True)):
            self._shown = now
            card.show_standing(found.diagnosis if found is not None else None, *now[1:])

    @Slot()
    def plan(self) -> None:
        """Plan a shot that distinguishes the candidates of the diagnosis shown."""
        found = self._found()
        if found is not None:
            self._plans.plan(found)

    @Slot()
    def take(self) -> None:
        """Arm for the planned shot; on the simulated bench also set its speed and weights."""
        found = self._found()
        if found is not None:
            self._plans.take(found)
