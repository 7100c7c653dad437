"""What an operator does with the session's shots, and what the panels show of those that are selected."""

from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot

from analysis.recording import Recording
from app.asked_work import AskedWork
from app.file_question import Want, ask
from app.jobs import Asked, Report
from app.layout import Layout
from app.panels.shot_raw import RawCurves, curves_of
from app.plots.shot_times import time_zero
from app.rig_desk import RECORDINGS
from app.session import Entry
from app.spectra import Spectra, spectra_of
from app.theme import Tone
from app.verdict import tone_of
from app.workbench import Happening, Kind, Workbench, raw_of
from instrument.foreign.remembered import FORMATS, format_of, is_foreign
from instrument.snapshot import FinishedShot

OPENED = f"{RECORDINGS};;Other programs' files ({' '.join(f'*{ending}' for ending in FORMATS)})"


def _zero_s(entry: Entry) -> float:
    return time_zero(entry.shot)[0] if entry.shot is not None else 0.0


def _spectra_of(entry: Entry, recording: Recording, report: Report, cancelled: Asked) -> Spectra:
    return spectra_of(recording, _zero_s(entry), report, cancelled)


def _raw_curves_of(_: Entry, recording: Recording, __: Report, ___: Asked) -> RawCurves:
    return curves_of(recording)


def is_unmapped(path: Path) -> bool:
    """Return whether this is another program's file and nobody said yet which of its channels is which."""
    motion = path.suffix.lower() == ".csv" and path.with_suffix(".toml").exists()
    return format_of(path) is not None and not motion and not is_foreign(path)


class SessionDesk(QObject):
    """Between the workbench and its panels."""

    said = Signal(str, Tone)
    arrived = Signal(object)
    mapping_wanted = Signal(object)  # paths of files whose channels are not known yet

    def __init__(self, bench: Workbench, panels: Layout, parent: QObject) -> None:
        super().__init__(parent)
        self._bench, self._panels = bench, panels
        self._spectra = AskedWork[Spectra](bench.jobs, "spectrum", _spectra_of)
        self._raw_view = AskedWork[RawCurves](bench.errands, "raw signals", _raw_curves_of)
        self._seen = -1
        self._shown: tuple[int, object] | None = None
        self._undrawn: set[int] = set()  # pages whose selection changed while another one was in front
        self._raw: tuple[int, Recording | None] | None = None
        self._folder = Path.home()
        self.rig_doing: str | None = None  # what the rig's own analysis is at, for the line of work
        self.rig_share: float | None = None
        table, p = panels.table, panels
        table.selected.connect(self._selected)
        table.export_wanted.connect(self._export_pressed)
        table.report_wanted.connect(self._report_pressed)
        table.remove_wanted.connect(self._remove_pressed)
        table.reanalyse_wanted.connect(self._reanalyse_pressed)
        table.note_edited.connect(self._note_edited)
        table.undo_wanted.connect(self.undo)
        table.open_wanted.connect(self.open_recordings)
        p.model.diagnose_wanted.connect(self.diagnose)
        p.diagnosis.diagnose_wanted.connect(self.diagnose)
        p.diagnosis.cancel_wanted.connect(self._cancel_diagnosis)
        p.diagnosis.add_wanted.connect(self._add_effect)
        p.diagnosis.add_all_wanted.connect(self._add_effects)
        p.diagnosis.remove_wanted.connect(self._remove_effect)
        p.work.cancel_wanted.connect(self._cancel_work)
        p.shot.raw_wanted.connect(self._raw_wanted)
        p.tabs.currentChanged.connect(self._page_changed)

    # what ended -------------------------------------------------------------------------------------------------

    def show(self) -> None:
        """Bring table, progress and finished work to the screen."""
        for happening in self._bench.poll():
            self._happened(happening)
        jobs = self._bench.jobs
        self._panels.work.show_work(jobs, self.rig_doing, self.rig_share)
        job = jobs.current
        diagnosing = job is not None and job.kind == "diagnosis"
        what = (job.what or "starting") if job is not None and diagnosing else None
        self._panels.diagnosis.show_progress(what, job.fraction if job is not None else 0.0)
        self._panels.model.diagnose.setEnabled(not diagnosing)
        spectra = self._spectra.take()
        if spectra is not None:
            self._panels.spectrum.show_spectra(spectra)
        raw = self._raw_view.take()
        if raw is not None:
            self._panels.shot.raw.show_curves(raw)
        self._show_table()

    def _show_table(self) -> None:
        session = self._bench.session
        if session.revision != self._seen:
            self._seen = session.revision
            self._panels.table.show_session(session)
            if session.problem:
                self.said.emit(session.problem, Tone.BAD)

    def _happened(self, happening: Happening) -> None:
        self._show_table()
        if happening.kind is Kind.SHOT:
            self._panels.table.select(list(happening.numbers))
            if self._panels.tabs.currentIndex() == Layout.LIVE:
                self._panels.tabs.setCurrentIndex(Layout.SHOT)
        elif happening.kind is Kind.CHANGED:
            self._selected(self._panels.table.numbers)
        elif happening.kind is Kind.DIAGNOSED:
            self._show_diagnosis()
            self._selected(self._panels.table.numbers)
        elif happening.kind is Kind.MODEL:
            self._show_diagnosis()
            self.said.emit(happening.words, Tone.GOOD)
        else:
            self.said.emit(happening.words, Tone.BAD if happening.kind is Kind.PROBLEM else Tone.GOOD)

    def take(self, finished: FinishedShot, stay: bool) -> None:
        """Take a shot of the rig; ``stay``: leave the page that is in front."""
        if finished.shot is None:
            self.said.emit(f"{finished.name}: {finished.problem or 'not analysed'}", Tone.BAD)
            return
        entry = self._bench.add_shot(finished.shot)
        self._show_table()
        if finished.problem:
            self.said.emit(f"{finished.name}: {finished.problem}", Tone.BAD)
        self.arrived.emit(entry)
        tabs, chosen = self._panels.tabs, self._panels.table.numbers
        if len(chosen) < 2:  # a selection of several is at work: it is not spoilt
            self._panels.table.select([entry.number])
        if tabs.currentIndex() == Layout.LIVE and not stay:  # whoever reads another page is not torn from it
            tabs.setCurrentIndex(Layout.SHOT)

    # what is selected -------------------------------------------------------------------------------------------

    def front(self) -> Entry | None:
        """Return the entry that the panels show: the last selected one."""
        numbers = self._panels.table.numbers
        return self._bench.session.entry(numbers[-1]) if numbers else None

    def _recording(self, entry: Entry) -> Recording | None:
        if self._raw is None or self._raw[0] != entry.number:
            self._raw = (entry.number, raw_of(entry))
        return self._raw[1]

    @Slot(list)
    def _selected(self, numbers: list[int]) -> None:
        p = self._panels
        entry = self.front()
        shot = entry.shot if entry is not None else None
        now = (entry.number, shot) if entry is not None else None
        if now is None or self._shown is None or now[0] != self._shown[0] or now[1] is not self._shown[1]:
            self._shown = now
            self._undrawn.add(Layout.SHOT)
            p.tabs.setTabText(Layout.SHOT, f"SHOT {entry.number}" if entry is not None else "SHOT")
            p.numbers.show_shot(shot, f"Shot {entry.number}   {entry.name}" if entry is not None else "")
            p.model.show_shot(shot)
        verdict = entry.verdict if entry is not None else ""
        p.model.show_verdict(verdict, tone_of(verdict))
        self._undrawn.add(Layout.COMPARE)
        self._page_changed(p.tabs.currentIndex())

    @Slot(int)
    def _page_changed(self, page: int) -> None:
        """Draw what is to be seen: plots of a page behind cost a frame while shots come in."""
        if page in self._undrawn:
            self._undrawn.discard(page)
            if page == Layout.SHOT:
                self._raw_view.forget()
                entry = self.front()
                shot = entry.shot if entry is not None else None
                self._panels.shot.show_shot(shot, self._recording(entry) if entry is not None else None)
            else:
                numbers = self._panels.table.numbers
                self._panels.compare.show_entries([e for e in self._bench.session.entries if e.number in numbers])
        if page != Layout.SPECTRUM:
            return
        entry = self.front()
        recording = self._recording(entry) if entry is not None else None
        if entry is None or recording is None:
            self._panels.spectrum.show_spectra(None)
        elif self._spectra.ask(entry, recording):
            self._panels.spectrum.say(f"computing the spectra of {entry.name} …")

    @Slot(object)
    def _raw_wanted(self, recording: Recording) -> None:
        entry = self.front()
        if entry is not None:
            self._raw_view.ask(entry, recording)

    def _show_diagnosis(self) -> None:
        found = self._bench.diagnosed
        if found is None:
            self._panels.diagnosis.show_diagnosis(None, [], self._bench.effects)
            return
        entries = [self._bench.session.entry(number) for number in found.numbers]
        shots = [entry.shot for entry in entries if entry is not None and entry.shot is not None]
        self._panels.diagnosis.show_diagnosis(found.diagnosis, shots, self._bench.effects)

    # what is pressed --------------------------------------------------------------------------------------------

    @Slot()
    def open_recordings(self) -> None:
        """Ask for recordings and open them."""
        ask(self._panels, "Open recordings", Want.FILES, self.open_paths, self._folder, OPENED)

    def open_paths(self, paths: list[Path]) -> None:
        """Open recordings and folders of recordings."""
        if paths:
            self._folder = paths[0].parent
            unmapped = [path for path in paths if path.is_file() and is_unmapped(path)]
            self._bench.open_paths([path for path in paths if path not in unmapped])
            if unmapped:
                self.mapping_wanted.emit(unmapped)

    @Slot(list)
    def _export_pressed(self, _: list[int]) -> None:
        self.export_selected()

    @Slot()
    def export_selected(self) -> None:
        """Ask for a folder and export the selected shots, or all."""
        ask(self._panels, "Export CSV to", Want.FOLDER, self._export_asked, self._folder)

    def _export_asked(self, paths: list[Path]) -> None:
        self.export_to(paths[0])

    def export_to(self, folder: Path) -> None:
        """Export the selected shots, or all, to a folder."""
        self._folder = folder
        self._bench.export(self._panels.table.numbers, folder)

    @Slot(list)
    def _report_pressed(self, _: list[int]) -> None:
        self.report_selected()

    @Slot()
    def report_selected(self) -> None:
        """Ask for a file and write the report of the selected shots, or of all."""
        start = self._folder / "report.html"
        ask(self._panels, "Save the report", Want.NEW_FILE, self._report_asked, start, "HTML (*.html)")

    def _report_asked(self, paths: list[Path]) -> None:
        self._folder = paths[0].parent
        self._bench.report(self._panels.table.numbers, paths[0])

    @Slot(list)
    def _remove_pressed(self, _: list[int]) -> None:
        self.remove_selected()

    @Slot()
    def remove_selected(self) -> None:
        """Take the selected shots off the list."""
        numbers = self._panels.table.numbers
        if numbers:
            self._bench.session.remove(numbers)
            self._show_table()
            self._selected(self._panels.table.numbers)
            self.said.emit(f"{len(numbers)} shots taken off the list; Undo (Ctrl+Z) brings them back", Tone.NEUTRAL)

    @Slot(list)
    def _reanalyse_pressed(self, _: list[int]) -> None:
        self.reanalyse_selected()

    @Slot()
    def reanalyse_selected(self) -> None:
        """Analyse the selected shots again, as copies."""
        count = self._bench.reanalyse(self._panels.table.numbers)
        words = f"{count} shots are analysed again as copies, with the present settings"
        self.said.emit(words if count else "Select shots that have a recording", Tone.NEUTRAL)

    @Slot()
    def undo(self) -> None:
        """Take back the last note or removal."""
        what = self._bench.session.undo()
        self._show_table()
        self.said.emit(f"Undone: {what}" if what else "Nothing to undo", Tone.NEUTRAL)

    @Slot(int, str)
    def _note_edited(self, number: int, note: str) -> None:
        self._bench.set_note(number, note)
        self._show_table()

    @Slot()
    def edit_note(self) -> None:
        """Write a note on the shot in front."""
        self._panels.table.edit_note()

    @Slot()
    def previous_shot(self) -> None:
        """Select the shot before."""
        self._step(-1)

    @Slot()
    def next_shot(self) -> None:
        """Select the shot after."""
        self._step(1)

    def _step(self, by: int) -> None:
        numbers = [entry.number for entry in self._bench.session.entries]
        if numbers:
            front = self.front()
            place = numbers.index(front.number) + by if front is not None else len(numbers) - 1
            self._panels.table.select([numbers[max(0, min(place, len(numbers) - 1))]])

    @Slot()
    def diagnose(self) -> None:
        """Diagnose the selected shots together."""
        problem = self._bench.diagnose(self._panels.table.numbers)
        if problem:
            self._panels.diagnosis.show_problem(problem)
        self._panels.tabs.setCurrentIndex(Layout.DIAGNOSIS)

    @Slot()
    def _cancel_diagnosis(self) -> None:
        self._bench.jobs.cancel("diagnosis")

    @Slot(str)
    def _add_effect(self, name: str) -> None:
        self._bench.set_effect(name, True)
        self._show_diagnosis()

    @Slot(list)
    def _add_effects(self, names: list[str]) -> None:
        self._bench.add_effects(names)
        self._show_diagnosis()

    @Slot(str)
    def _remove_effect(self, name: str) -> None:
        self._bench.set_effect(name, False)
        self._show_diagnosis()

    @Slot()
    def _cancel_work(self) -> None:
        self._bench.jobs.cancel()
