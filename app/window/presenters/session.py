"""Commands on the session's shots: open, export, report, edit notes, remove, repeat the analysis."""

from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Qt, Signal, Slot
from PySide6.QtGui import QGuiApplication
from PySide6.QtPrintSupport import QPrintDialog, QPrinter

from app.report import document_of
from app.session import Event, EventKind, SettingsStore, Workbench
from app.window.controls.file_dialog import FileDialogs, PathKind, ask
from app.window.controls.theme import Tone
from app.window.panels.layout import Layout
from app.window.presenters.rig import RECORDINGS
from app.window.presenters.selection import SelectionPresenter
from app.words import counted
from instrument.capture import CapturedShot
from instrument.files import FORMATS, format_of, is_foreign

ENDINGS = (".sigmf-meta", ".sigmf-data", ".csv", ".toml", *FORMATS)
OPENED = f"{RECORDINGS};;Other programs' files ({' '.join(f'*{ending}' for ending in FORMATS)})"


MODELS = "Levimass model (*.toml)"
EXPORTS = {  # method of ``Exports`` -> title of the dialog, kind of path, proposed name, filters
    "export": ("Export CSV to", PathKind.FOLDER, "", ""),
    "export_hdf5": ("Export HDF5 to", PathKind.FOLDER, "", ""),
    "report": ("Save the report", PathKind.NEW_FILE, "report.html", "HTML (*.html);;PDF (*.pdf)"),
    "save_model": ("Save the model", PathKind.NEW_FILE, "model.toml", MODELS),
    "test_model": ("Test a model's predictions", PathKind.FILE, "", MODELS),
}


def is_unmapped(path: Path) -> bool:
    """Return whether this is a foreign file whose channels are not assigned yet."""
    motion = path.suffix.lower() == ".csv" and path.with_suffix(".toml").exists()
    return format_of(path) is not None and not motion and not is_foreign(path)


class SessionPresenter(QObject):
    """Connects the workbench with the table and the status line."""

    arrived = Signal(object)
    swap_wanted = Signal(object, int)  # path and entry number of a foreign file whose PD0 and PD1 are swapped
    mapping_wanted = Signal(object)  # paths of foreign files whose channels are not assigned yet

    def __init__(
        self,
        workbench: Workbench,
        store: SettingsStore,
        panels: Layout,
        selection: SelectionPresenter,
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self._workbench, self._panels, self._selection = workbench, panels, selection
        self._seen = -1
        self._not_saved = False  # whether the session was unsaved at the last refresh
        self._choose_next = False  # whether to select the next opened shot
        self._store = store
        self._dialogs = FileDialogs(panels, lambda: store.start_folder)
        panels.table.model.note_edited.connect(self._note_edited)
        panels.work.cancel.clicked.connect(self._cancel_work)

    # results ----------------------------------------------------------------------------------------------------

    def refresh(self, rig_doing: str | None = None, rig_share: float | None = None) -> None:
        """Show table, outcomes of jobs, and the progress of the running job, else of the rig's analysis."""
        for event in self._workbench.poll():
            self._show_event(event)
        self._panels.work.show_work(self._workbench.jobs, rig_doing, rig_share)
        self._show_table()

    def _show_table(self) -> None:
        session = self._workbench.session
        if session.revision != self._seen:
            self._seen = session.revision
            self._panels.table.show_session(session)
            self._selection.show_verdict()
            not_saved = session.save_problem  # read once, because the saver's thread may change it
            if problem := not_saved or session.read_problem:
                self._panels.say(problem, Tone.BAD)
            elif self._not_saved:
                self._panels.say("The session is saved again", Tone.GOOD)
            self._not_saved = not_saved is not None

    def _show_event(self, event: Event) -> None:
        self._show_table()
        if event.kind in (EventKind.SHOT, EventKind.CHANGED):
            self._offer_swap(event.numbers)
        if event.kind is EventKind.SHOT:
            if not self._choose_next:  # only the first opened shot of a folder is selected
                return
            self._choose_next = False
            self._panels.table.select(list(event.numbers))
            if self._panels.tabs.currentIndex() == Layout.LIVE:
                self._panels.tabs.setCurrentIndex(Layout.SHOT)
        elif event.kind in (EventKind.CHANGED, EventKind.DIAGNOSED):
            self._selection.show_again()
        elif event.kind is EventKind.PRINT:
            self._print(event.words)
        elif event.kind is EventKind.UNLISTED:
            paths = list(event.paths)
            declined = partial(self._workbench.session.dismiss, [str(path) for path in paths])
            self._panels.work.notices.say(event.words, Tone.WARNING, "Open", partial(self.open_paths, paths), declined)
        else:
            self._panels.say(event.words, Tone.BAD if event.kind is EventKind.PROBLEM else Tone.GOOD)

    def _offer_swap(self, numbers: tuple[int, ...]) -> None:
        """Offer to exchange PD0 and PD1 of shots in which the analysis found them swapped."""
        for number in numbers:
            entry = self._workbench.session.entry(number)
            if entry is None or entry.path is None or entry.shot is None or not entry.shot.channels_swapped:
                continue
            path = Path(entry.path)
            if is_foreign(path):
                words, swap = f"{entry.name}: PD0 and PD1 are swapped", partial(self.swap_wanted.emit, path, number)
                self._panels.work.notices.say(words, Tone.WARNING, "Swap them", swap)

    def take(self, captured: CapturedShot, stay: bool) -> None:
        """Add a shot of the rig before its analysis, its readings, or its fit; ``stay``: do not change the page."""
        shot = captured.shot
        if captured.waits:
            self._workbench.add_captured(captured)
            self._show_table()
            return
        if shot is not None and captured.fitted_later:
            entry = self._workbench.take_fit(shot, captured.number)
            if entry is not None:
                self._show_event(Event(EventKind.CHANGED, "", (entry.number,)))
                self.arrived.emit(entry)
            return
        if shot is None:
            entry = self._workbench.add_unanalysed(captured)
        else:
            entry = self._workbench.add_shot(shot, captured.number)
        self._show_table()
        if captured.problem:
            self._panels.say(f"{captured.name}: {captured.problem}", Tone.BAD)
        if entry is None:  # the entry was removed before its analysis ended
            return
        self.arrived.emit(entry)
        tabs, chosen = self._panels.tabs, self._panels.table.numbers
        if len(chosen) < 2:  # a selection of several shots is kept
            self._panels.table.select([entry.number])
        if tabs.currentIndex() == Layout.LIVE and not stay:  # any other page is kept
            tabs.setCurrentIndex(Layout.SHOT)

    # commands --------------------------------------------------------------------------------------------------

    @Slot()
    def open_recordings(self) -> None:
        ask(self._panels, "Open recordings", PathKind.FILES, self.open_paths, self._dialogs.folder, OPENED)

    def open_paths(self, paths: list[Path]) -> None:
        if paths:
            self._dialogs.chosen = paths[0].parent
            self._store.remember_recent(paths)
            for path in [path for path in paths if path.is_file() and not path.name.lower().endswith(ENDINGS)]:
                self._panels.say(f"{path.name} is not a recording (they end in {', '.join(ENDINGS)})", Tone.BAD)
                paths = [other for other in paths if other != path]
            unmapped = [path for path in paths if path.is_file() and is_unmapped(path)]
            if self._workbench.open_paths([path for path in paths if path not in unmapped]):
                self._choose_next = True
            if unmapped:
                self.mapping_wanted.emit(unmapped)

    @Slot()
    def open_folder(self) -> None:
        self._dialogs.ask("Open a folder of recordings", PathKind.FOLDER, lambda folder: self.open_paths([folder]))

    def export(self, method: str) -> None:
        """Ask for the path of one of ``EXPORTS``; the shots selected then, or all if none is, are given to it."""

        def then(path: Path) -> None:
            getattr(self._workbench.exports, method)(self._panels.table.numbers, path)

        title, want, name, kinds = EXPORTS[method]
        self._dialogs.ask(title, want, then, name, kinds)

    @Slot()
    def load_model(self) -> None:
        self._dialogs.ask("Open a model", PathKind.FILE, self._workbench.model.load, kinds=MODELS)

    @Slot()
    def print_report(self) -> None:
        """Make the report on the selected shots, or on all if none is selected, and open the printer dialogue."""
        self._workbench.exports.report_to_print(self._panels.table.numbers)
        self._panels.say("Preparing the report; the printer dialogue follows", Tone.NEUTRAL)

    def _print(self, html: str) -> None:
        printer = QPrinter(QPrinter.PrinterMode.HighResolution)
        question = QPrintDialog(printer, self._panels)
        question.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        question.accepted.connect(partial(self._print_on, printer, html))
        question.setModal(False)
        question.show()

    def _print_on(self, printer: QPrinter, html: str) -> None:
        document_of(html).print_(printer)
        self._panels.say("The report was sent to the printer", Tone.GOOD)

    @Slot()
    def copy_shots(self) -> None:
        """Copy the selected rows, or all, as a tab-separated table."""
        text = self._panels.table.as_text()
        QGuiApplication.clipboard().setText(text)
        self._panels.say(f"Copied to the clipboard: {counted(max(0, text.count(chr(10)) - 1), 'line')}", Tone.NEUTRAL)

    @Slot()
    def remove_selected(self) -> None:
        numbers = self._panels.table.numbers
        if numbers:
            self._workbench.session.remove(numbers)
            self._show_table()
            self._selection.show_again()
            words = f"{counted(len(numbers), 'shot')} removed from the list; Undo (Ctrl+Z) restores them"
            self._panels.say(words, Tone.NEUTRAL)

    @Slot()
    def reanalyse_selected(self) -> None:
        """Analyse copies of the selected shots with the present settings."""
        count = self._workbench.reanalyse(self._panels.table.numbers)
        self._choose_next = count > 0
        corrections = self._workbench.corrections_in_words()
        words = (
            f"Re-analysing {counted(count, 'shot')} as {'a copy' if count == 1 else 'copies'} with the present settings"
        )
        words += f" and {corrections} instead of the recordings' own" if corrections else ""
        self._panels.say(words if count else "Select shots that have a recording", Tone.NEUTRAL)

    @Slot()
    def undo(self) -> None:
        what = self._workbench.undo()
        self._show_table()
        self._panels.say(f"Undone: {what}" if what else "Nothing to undo", Tone.NEUTRAL)

    @Slot()
    def redo(self) -> None:
        what = self._workbench.redo()
        self._show_table()
        self._panels.say(f"Redone: {what}" if what else "Nothing to redo", Tone.NEUTRAL)

    @Slot(int, str)
    def _note_edited(self, number: int, note: str) -> None:
        self._workbench.set_note(number, note)
        self._show_table()

    def step_shot(self, by: str) -> None:
        """Select the shot above ("-1") or below ("1") in the table; the last one if none is selected."""
        numbers = self._panels.table.shown
        if numbers:
            front = self._selection.front()
            there = front is not None and front.number in numbers
            place = max(0, numbers.index(front.number) + int(by)) if front is not None and there else len(numbers)
            self._panels.table.select([numbers[min(place, len(numbers) - 1)]])

    @Slot()
    def _cancel_work(self) -> None:
        self._workbench.candidate_residuals.stop()
        self._workbench.jobs.cancel()
