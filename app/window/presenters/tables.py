"""Show BUDGET and PAPER for the last selected shot; PAPER is computed in a job."""

from collections.abc import Callable

from PySide6.QtCore import QObject

from analysis.paper import Reproduction, reproduce
from analysis.shot import Progress, Shot, Stop
from app.session import Entry, Job, Workbench
from app.window.layout import Layout


class TablesPresenter(QObject):
    """Updates the page shown where the selection has changed."""

    def __init__(
        self, workbench: Workbench, panels: Layout, front: Callable[[], Entry | None], parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._workbench, self._panels, self._front = workbench, panels, front
        self._budget_of: list[Shot] | None = None
        self._paper_of: tuple[Shot | None] | None = None
        self._job: Job | None = None

    def refresh(self) -> None:
        """Update the page shown, and take the result of the job."""
        page = self._panels.tabs.currentIndex()
        if page == Layout.BUDGET:
            self._show_budget()
        elif page == Layout.PAPER:
            self._ask_paper()
        self._take_paper()

    def _front_shot(self) -> Shot | None:
        entry = self._front()
        return entry.shot if entry is not None else None

    def _show_budget(self) -> None:
        shot, numbers = self._front_shot(), self._panels.table.numbers
        entries = self._workbench.session.entries
        others = [e.shot for e in entries if e.number in numbers and e.shot is not None and e.shot is not shot]
        now = others if shot is None else [shot, *others]
        before = self._budget_of
        if before is not None and len(now) == len(before) and all(a is b for a, b in zip(now, before, strict=True)):
            return
        self._budget_of = now
        self._panels.budget.show_shot(shot, others)

    def _ask_paper(self) -> None:
        shot = self._front_shot()
        if self._paper_of is not None and self._paper_of[0] is shot:
            return
        self._paper_of = (shot,)

        def work(report: Progress, _: Stop) -> Reproduction:
            report("the paper's simulation", 0.2)
            return reproduce(shot)

        self._workbench.jobs.cancel("paper")
        self._job = self._workbench.jobs.submit("the paper", work, "paper")

    def _take_paper(self) -> None:
        job = self._job
        if job is None:
            return
        if not job.done.is_set():
            self._panels.paper.say(self._workbench.jobs.waiting_words(job, "the paper's numbers"))
            return
        self._job = None
        if isinstance(job.result, Reproduction) and not job.cancelled:
            self._panels.paper.show_reproduction(job.result)
        else:
            self._panels.paper.say(f"not computed: {job.problem or 'cancelled'}; choose another shot to try again")
