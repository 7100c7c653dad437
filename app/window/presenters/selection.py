"""Show the selected shots: the last one in most panels, all in COMPARE and BUDGET; store notes on the plots."""

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QObject, Slot

from analysis.diagnosis import Diagnosis
from analysis.drive import DriveCurves, drive_curves
from analysis.paper import Reproduction, reproduce
from analysis.shot import PlotNote, Progress, Recording, Shot, Stop
from app.report import time_zero
from app.session import Entry, Job, Session, ShotJob, Spectra, Workbench, raw_of, spectra_of
from app.window.controls.theme import Tone
from app.window.panels.layout import Layout
from app.window.panels.shot_raw import RawCurves, curves_of
from app.window.panels.state_words import misfit_advice, verdict_line


def _title(entry: Entry) -> str:
    return f"Shot {entry.number}   {entry.name}"


class SelectionPresenter(QObject):
    """Shows the selected shots; draws a page only when it is visible, to leave processor time for a capture."""

    def __init__(self, workbench: Workbench, panels: Layout, parent: QObject) -> None:
        super().__init__(parent)
        self._workbench, self._panels = workbench, panels
        self._spectra = ShotJob[Spectra](workbench.jobs, "spectrum", self._take_spectra)
        self._raw_view = ShotJob[RawCurves](
            workbench.short_jobs, "raw signals", lambda _, curves: panels.shot.show_raw(curves)
        )
        self._drive = ShotJob[tuple[Shot, DriveCurves]](
            workbench.short_jobs, "force", lambda _, drive: panels.shot.show_drive(*drive)
        )
        self._shown: tuple[int, object, object] | None = None
        self._undrawn: set[int] = set()  # pages not yet drawn for the present selection
        self._raw: tuple[int, Recording | None] | None = None
        panels.table.selected.connect(self.show_again)
        panels.shot.raw_wanted.connect(self._raw_wanted)
        panels.shot.drive_wanted.connect(self._drive_wanted)
        panels.tabs.currentChanged.connect(self._page_changed)

    def refresh(self) -> None:
        """Show that spectra are being computed, or which job they wait for."""
        front = self.front()
        if self._spectra.job is not None and front is not None:
            words = self._workbench.jobs.waiting_words(self._spectra.job, f"the spectra of {front.name}")
            self._panels.spectrum.said.setText(words)

    def _take_spectra(self, entry: Entry, spectra: Spectra) -> None:
        front = self.front()
        if front is not None and front.number == entry.number:
            self._panels.spectrum.show_spectra(spectra, entry.shot, _title(entry))
        else:
            self._spectra.forget()

    def front(self) -> Entry | None:
        """Return the last selected entry, which the panels show."""
        numbers = self._panels.table.numbers
        return self._workbench.session.entry(numbers[-1]) if numbers else None

    def _why_none(self) -> str:
        """Return a sentence that says why no shot is shown; "" for an empty session."""
        if hidden := self._panels.table.hidden:
            names = ", ".join(map(str, hidden))
            return f"The filter hides the selected shot{'s' if len(hidden) > 1 else ''} {names}."
        if self._workbench.session.entries:
            return "No shot is selected: click one in the list below."
        return ""

    def _judged_by(self, entry: Entry | None) -> Diagnosis | None:
        """Return the diagnosis behind an entry's verdict if the verdict is valid, else None."""
        if entry is None or entry.verdict_of is None or not self._workbench.session.verdict_is_valid(entry):
            return None
        found = self._workbench.diagnoses.of([entry.number])
        return found.diagnosis if found is not None and entry.number in found.numbers else None

    def show_verdict(self) -> None:
        """Show the verdict on the last selected shot, struck through if it is outdated."""
        entry = self.front()
        fit = entry.shot.fit if entry is not None and entry.shot is not None else None
        effects = fit.effects if fit is not None else ()
        holds = entry is None or self._workbench.session.verdict_is_valid(entry)
        self._panels.model.show_verdict(*verdict_line(entry, effects, holds), misfit_advice(entry, effects, holds))

    def _recording(self, entry: Entry) -> Recording | None:
        if self._raw is None or self._raw[0] != entry.number:
            self._raw = (entry.number, raw_of(entry))
        return self._raw[1]

    @Slot()
    def show_again(self) -> None:
        """Update the panels after a change of the selection or of the selected shots."""
        p = self._panels
        entry = self.front()
        shot = entry.shot if entry is not None else None
        band_from = self._judged_by(entry)
        now = (entry.number, shot, band_from) if entry is not None else None
        before = self._shown
        if now is None or before is None or now[0] != before[0] or now[1] is not before[1] or now[2] is not before[2]:
            self._shown = now
            self._undrawn.add(Layout.SHOT)
            title, version = (_title(entry), entry.version) if entry is not None else ("", "")
            p.name_shot(entry.number if entry is not None else None)
            p.numbers.show_shot(shot, title, version)
            p.large.show_shot(shot, title)
            p.model.show_shot(shot, self._workbench.session.effects.tried)
        self.show_verdict()
        self._undrawn.add(Layout.COMPARE)
        self._page_changed(p.tabs.currentIndex())

    @Slot(int)
    def _page_changed(self, page: int) -> None:
        if page in self._undrawn:
            self._undrawn.discard(page)
            if page == Layout.SHOT:
                self._raw_view.forget()
                self._drive.forget()
                entry = self.front()
                if entry is None:
                    self._panels.shot.show_shot(None, words=self._why_none())
                else:
                    recording, judged_by = self._recording(entry), self._judged_by(entry)
                    self._panels.shot.show_shot(entry.shot, recording, _title(entry), judged_by)
            else:
                self._panels.compare.show_entries(self._workbench.session.entries_with(self._panels.table.numbers))
        if page != Layout.SPECTRUM:
            return
        entry = self.front()
        recording = self._recording(entry) if entry is not None else None
        if entry is None or recording is None:
            self._spectra.forget()
            self._panels.spectrum.show_spectra(None)
            return
        zero = time_zero(entry.shot)[0] if entry.shot is not None else 0.0
        if self._spectra.start(entry, partial(spectra_of, recording, zero)):
            self._panels.spectrum.show_spectra(None)  # remove the previous shot's spectra

    @Slot(object)
    def _drive_wanted(self, shot: Shot) -> None:
        entry, motion, fit = self.front(), shot.motion, shot.fit
        if entry is not None and motion is not None and fit is not None:
            self._drive.start(entry, lambda _, __: (shot, drive_curves(motion, fit)))

    @Slot(object)
    def _raw_wanted(self, recording: Recording) -> None:
        entry = self.front()
        if entry is not None:
            self._raw_view.start(entry, lambda _, __: curves_of(recording))


class TablesPresenter(QObject):
    """Updates the pages BUDGET and PAPER while they are visible and the selection has changed."""

    def __init__(
        self, workbench: Workbench, panels: Layout, front: Callable[[], Entry | None], parent: QObject
    ) -> None:
        super().__init__(parent)
        self._workbench, self._panels, self._front = workbench, panels, front
        self._budget_of: list[Shot] | None = None
        self._paper_of: tuple[Shot | None] | None = None
        self._job: Job | None = None

    def refresh(self) -> None:
        """Update the visible page, and show what the paper's numbers wait for."""
        page = self._panels.tabs.currentIndex()
        if page == Layout.BUDGET:
            self._show_budget()
        elif page == Layout.PAPER:
            self._ask_paper()
        if self._job is not None:
            self._panels.paper.said.setText(self._workbench.jobs.waiting_words(self._job, "the paper's numbers"))

    def _front_shot(self) -> Shot | None:
        entry = self._front()
        return entry.shot if entry is not None else None

    def _show_budget(self) -> None:
        shot, entries = self._front_shot(), self._workbench.session.entries_with(self._panels.table.numbers)
        others = [e.shot for e in entries if e.shot is not None and e.shot is not shot]
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

        if self._job is not None:
            self._job.discard()
        self._job = self._workbench.jobs.submit("the paper", work, "paper", self._take_paper, self._fail_paper)

    def _take_paper(self, reproduction: Reproduction) -> None:
        self._job = None
        self._panels.paper.show_reproduction(reproduction)

    def _fail_paper(self, why: str | None) -> None:
        self._job = None
        self._panels.paper.said.setText(f"not computed: {why or 'cancelled'}; choose another shot to try again")


class PlotNotesPresenter(QObject):
    """Connects the notes in the session with the plots of SHOT and SPECTRUM."""

    def __init__(self, session: Session, panels: Layout, front: Callable[[], Entry | None], parent: QObject) -> None:
        super().__init__(parent)
        self._session, self._panels, self._front = session, panels, front
        self._plots = (*panels.shot.plots, *panels.spectrum.plots)
        self._number: int | None = None
        for plot in self._plots:
            plot.notes.changed.connect(self._changed)

    def refresh(self) -> None:
        """Show the notes of the displayed shot."""
        entry = self._front()
        self._number = entry.number if entry is not None else None
        for plot in self._plots:
            plot.notes.show(entry.plot_notes if entry is not None else ())

    @Slot()
    def note_on_plot(self) -> None:
        """Open the editor for a note on the plot in front."""
        plot = self._panels.plot_in_front()
        if plot not in self._plots or not plot.write_note():
            self._panels.say("Notes are written on the plots of a shot: SHOT (Ctrl+2), SPECTRUM (Ctrl+4)", Tone.NEUTRAL)

    @Slot(object, object)
    def _changed(self, before: PlotNote | None, after: PlotNote | None) -> None:
        if self._number is not None:
            self._session.change_plot_note(self._number, before, after)
            self.refresh()
