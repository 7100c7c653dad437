"""Planning the next shot after a diagnosis, taking it, and showing what it brought."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Slot

from app.session.event import Diagnosed
from app.session.next_shots import PLAN, NextShots
from app.session.session import Entry
from app.session.workbench import Workbench
from app.window.layout import Layout


class NextShotPresenter(QObject):
    """Between the plans and the card; ``found`` gives the diagnosis on the screen."""

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
        self._shown: object = None
        card = panels.diagnosis.next_shot
        card.plan_wanted.connect(self.plan)
        card.take_wanted.connect(self.take)
        card.give_up_wanted.connect(self.give_up)

    def refresh(self) -> None:
        """Bring plan and log of the diagnosis in front to the screen; a shot that joined a set brings that to it."""
        joined = self._plans.poll()
        if joined is not None:
            self._panels.table.select(list(joined))
            self._panels.tabs.setCurrentIndex(Layout.DIAGNOSIS)
        card, found = self._panels.diagnosis.next_shot, self._found()
        job = self._workbench.jobs.current
        card.enable_plan(job is None or job.kind not in (PLAN, "diagnosis"))
        now = (found, self._plans.standing(found), self._plans.taking, self._plans.sets_itself)
        if now != self._shown:
            self._shown = now
            card.show_standing(found.diagnosis if found is not None else None, *now[1:])

    @Slot(object)
    def arrived(self, entry: Entry) -> None:
        """Let a shot of the rig join the set it was planned for."""
        self._plans.arrived(entry)

    @Slot()
    def plan(self) -> None:
        """Plan what would tell apart what the diagnosis in front left open."""
        found = self._found()
        if found is not None:
            self._plans.plan(found)

    @Slot()
    def take(self) -> None:
        """Arm for the planned shot; on the simulated bench it is set too."""
        found = self._found()
        if found is not None:
            self._plans.take(found)

    @Slot()
    def give_up(self) -> None:
        """Stop waiting for the planned shot."""
        self._plans.give_up()
