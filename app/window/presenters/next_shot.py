"""Plan the next shot after a diagnosis, take it, and show the result."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Slot

from app.session import PLAN, Diagnosed, Entry, NextShots, Workbench
from app.window.layout import Layout


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
        self._shown: object = None
        card = panels.diagnosis.next_shot
        card.plan_wanted.connect(self.plan)
        card.take_wanted.connect(self.take)
        card.give_up_wanted.connect(self.give_up)

    def refresh(self) -> None:
        """Show the plan for the diagnosis shown; select a set that a planned shot has just joined."""
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
        """Add a captured shot to the set it was planned for."""
        self._plans.arrived(entry)

    @Slot()
    def plan(self) -> None:
        """Plan a shot that decides between the candidates of the diagnosis shown."""
        found = self._found()
        if found is not None:
            self._plans.plan(found)

    @Slot()
    def take(self) -> None:
        """Arm for the planned shot; on the simulated bench also set it."""
        found = self._found()
        if found is not None:
            self._plans.take(found)

    @Slot()
    def give_up(self) -> None:
        """Stop waiting for the planned shot."""
        self._plans.give_up()
