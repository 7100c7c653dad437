"""The main window: creates panels and presenters, and updates them up to 28 times a second."""

import signal
import sys
from dataclasses import replace
from pathlib import Path

from platformdirs import user_config_path, user_log_path
from PySide6.QtCore import Qt, QTimer, Slot
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QKeyEvent, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QApplication, QMainWindow

from analysis.shot import AnalysisSettings
from app.session import (
    PLAN,
    Kernels,
    NextShots,
    Open,
    OwnLaws,
    ProgramLog,
    ResultCache,
    Rig,
    Saver,
    SettingsStore,
    Spool,
    Workbench,
    complete,
    last_session,
    warm_up_analysis,
)
from app.window.controls import commands
from app.window.controls.theme import Theme, Tone
from app.window.panels.layout import Layout, first_size, keep_within_screen, restore_state, state_text
from app.window.presenters.diagnosis import DiagnosisPresenter, LawsPresenter, NextShotPresenter
from app.window.presenters.files import FilesPresenter, ModelPresenter
from app.window.presenters.mapping import MappingPresenter
from app.window.presenters.rig import RigPresenter
from app.window.presenters.selection import PlotNotesPresenter, SelectionPresenter, TablesPresenter
from app.window.presenters.session import SessionPresenter
from app.window.presenters.setup import SetupPresenter
from app.window.presenters.view import HelpPresenter, ViewPresenter
from app.words import counted
from instrument.capture import Snapshot, State
from instrument.devices import Digitizer, with_site
from instrument.process import SubprocessAnalysis, SubprocessWorker, open_in_subprocess

PULL_MS = 35
LIVE_MS = 100  # update interval while only the live curves change, which arrive at this rate
STILL_MS = 140  # update interval while nothing changes: no live curve, no job
FRAMED_MS = 300  # delay after the window is shown, until the system has drawn the title bar
SWITCH_S = 5e-4  # Python's thread switch interval; the default of 5 ms would delay frames


class MainWindow(QMainWindow):
    """The main window.  Work longer than a frame runs in the threads of rig and jobs, or in subprocesses."""

    def __init__(
        self,
        rig: Rig,
        workbench: Workbench,
        theme: Theme,
        store: SettingsStore,
        kernels: Kernels,
        log: ProgramLog,
    ) -> None:
        super().__init__()
        self.log, self._store = log, store
        self.setWindowTitle("Levimass")
        self.setAcceptDrops(True)
        self.rig, self.workbench, self.theme = rig, workbench, theme
        self._warned_items: frozenset[str] = frozenset()  # keys of the losses named at the last attempt to close
        self.panels = Layout(theme, self)
        self.setCentralWidget(self.panels)
        self.rig_presenter = RigPresenter(rig, store, self.panels, self)
        self.selection_presenter = SelectionPresenter(workbench, self.panels, self)
        self.session_presenter = SessionPresenter(workbench, store, self.panels, self.selection_presenter, self)
        self.diagnosis_presenter = DiagnosisPresenter(workbench, self.panels, self)
        plans = NextShots(workbench, rig, store)
        self.next_shot_presenter = NextShotPresenter(
            plans, workbench, self.panels, self.diagnosis_presenter.found, self
        )
        self.view_presenter = ViewPresenter(self.panels, lambda: store.start_folder, self)
        self.files_presenter = FilesPresenter(workbench, store, self.panels, self)
        self.laws_presenter = LawsPresenter(workbench.own_laws, self.panels, self)
        self.setup_presenter = SetupPresenter(rig, store, workbench.short_jobs, self.panels, self)
        self.help_presenter = HelpPresenter(store, self.panels, log.folder, self)
        self.mapping_presenter = MappingPresenter(workbench, store, self.panels, self)
        self.tables_presenter = TablesPresenter(workbench, self.panels, self.selection_presenter.front, self)
        self.model_presenter = ModelPresenter(workbench, store, self.panels, self.selection_presenter.front, self)
        self.plot_notes_presenter = PlotNotesPresenter(
            workbench.session, self.panels, self.selection_presenter.front, self
        )
        self._connect_presenters(plans)
        theme.changed.connect(self.panels.apply_colours)
        self._start_work(kernels)
        if workbench.session.entries:  # select the last shot at the start
            self.panels.table.select([workbench.session.entries[-1].number])
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self.pull)
        self.pull()
        self._timer.start(PULL_MS)
        self.panels.controls.arm.setFocus()

    def _connect_presenters(self, plans: NextShots) -> None:
        """Connect the presenters with each other, and the menu commands with the presenters."""
        presenters = (
            self.rig_presenter,
            self.session_presenter,
            self.diagnosis_presenter,
            self.plot_notes_presenter,
            self.view_presenter,
            self.files_presenter,
            self.setup_presenter,
            self.help_presenter,
        )
        self.files_presenter.recordings_wanted.connect(self.session_presenter.open_paths)
        self.laws_presenter.diagnose_wanted.connect(self.diagnosis_presenter.diagnose)
        self.session_presenter.mapping_wanted.connect(self.mapping_presenter.ask)
        self.session_presenter.swap_wanted.connect(self.mapping_presenter.swap)
        self.session_presenter.arrived.connect(plans.arrived)
        self.session_presenter.arrived.connect(self.rig_presenter.remember)
        self.rig_presenter.shot_came.connect(self.session_presenter.take)
        self.rig_presenter.save_elsewhere_wanted.connect(self._save_elsewhere)
        self.rig_presenter.appearance_chosen.connect(self.theme.choose)
        below = {"recent": self.files_presenter.recent}
        self.actions_by_name = commands.bind(self, (*presenters, self.panels.table, self), below)

    def _start_work(self, kernels: Kernels) -> None:
        """Report problems of session and settings; queue kernels, reading of shots, search for unlisted recordings."""
        workbench, store = self.workbench, self._store
        if workbench.session.problem:
            self.panels.say(workbench.session.problem, Tone.WARNING)
        for words in store.warnings:
            self.panels.say(words, Tone.WARNING)
        workbench.jobs.submit("loading" if complete() else "first start", kernels.work, "warm")
        workbench.read_unread()
        workbench.find_unlisted(store.settings.data_folder, store.sessions)
        self.session_presenter.refresh()

    @Slot()
    def pull(self) -> None:
        """Update all panels; called by the timer."""
        snapshot = self.rig_presenter.refresh()
        for problem in self.log.take_problems():
            self.panels.say(problem, Tone.BAD)
        self._warned_items &= frozenset(self._unsaved_items(snapshot))  # the same name later means another shot
        self.session_presenter.refresh(snapshot.doing, snapshot.progress)
        self.selection_presenter.refresh()
        self.plot_notes_presenter.refresh()
        self.diagnosis_presenter.refresh()
        self.next_shot_presenter.refresh()
        self.tables_presenter.refresh()
        self.model_presenter.refresh()
        self.mapping_presenter.refresh()
        self.setup_presenter.refresh(snapshot)
        pace = self._pace_ms(snapshot)
        if self._timer.interval() != pace:
            self._timer.setInterval(pace)

    def _pace_ms(self, snapshot: Snapshot) -> int:
        """Return the interval until the next update in ms; it is longer while only the operator can change anything."""
        work = self.workbench.jobs.open_jobs or self.workbench.short_jobs.open_jobs or snapshot.waiting
        if work or snapshot.state is not State.IDLE:
            return PULL_MS
        live = self.panels.tabs.currentIndex() == Layout.LIVE or self.panels.setup.isVisible()
        return LIVE_MS if live else STILL_MS

    def _unsaved_items(self, snapshot: Snapshot) -> dict[str, str]:
        """Return what closing now would lose: a sentence for each item's key."""
        count = len(snapshot.unsaved)
        shots = "1 shot is" if count == 1 else f"{count} shots are"
        words = f"{shots} only in memory and will be lost: save to another folder (Ctrl+S)"
        found = dict.fromkeys(snapshot.unsaved, words)
        if snapshot.state in (State.ARMING, State.ARMED):
            found["rig"] = "The rig is armed"
        elif snapshot.state in (State.TRIGGERED, State.TRANSFERRING):
            found["rig"] = "A shot is being recorded"
        if self.workbench.session.unsaved:
            found["session"] = f"{self.workbench.session.problem}; its notes and verdicts would be lost"
        jobs = self.workbench.jobs
        if files := jobs.waiting("open"):
            found["files"] = f"{counted(files, 'recording')} still to be opened"
        if jobs.waiting("diagnosis", "export", PLAN):
            found["work"] = "A diagnosis, export or plan is still running"
        return found

    @Slot(object)
    def _save_elsewhere(self, folder: Path) -> None:
        self.workbench.unsaved.save(self.rig.save_pending, folder)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not commands.pressed_by_enter(self.focusWidget(), event):
            super().keyPressEvent(event)

    def showEvent(self, event: QShowEvent) -> None:
        """Schedule the move onto the screen for when the system has drawn the frame."""
        super().showEvent(event)
        self._size_shown = self.size()
        QTimer.singleShot(FRAMED_MS, self, self._keep_within_screen)

    @Slot()
    def _keep_within_screen(self) -> None:
        if self.size() == self._size_shown:  # do not move a window that the operator has resized
            keep_within_screen(self)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.panels.place_sheets()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        self.session_presenter.open_paths(paths)
        event.acceptProposedAction()

    def closeEvent(self, event: QCloseEvent) -> None:
        """End all threads and close; if something would be lost, warn first and close at the second attempt."""
        at_stake = self._unsaved_items(self.rig.latest())
        if not at_stake.keys() <= self._warned_items:
            self._warned_items = frozenset(at_stake)
            words = dict.fromkeys(at_stake.values())
            self.panels.say(f"{'; '.join(words)}. Close again to quit anyway", Tone.BAD)
            event.ignore()
            return
        self._timer.stop()
        self._store.change({"window": state_text(self, self.panels)})
        self.workbench.close()
        self.rig.close()
        event.accept()


def open_window(
    folder: Path,
    open_digitizer: Open | None = None,
    *,
    apart: bool = True,
    site: str | None = None,
    log: ProgramLog | None = None,
) -> MainWindow:
    """Return the main window without showing it; settings, session, laws and cache are in ``folder``.

    ``site`` is the floor vibration of the simulated bench, by default that of the settings.  ``apart``: use one
    subprocess for the analysis of the rig's shots and another for all other long work.
    """
    sys.setswitchinterval(SWITCH_S)
    store = SettingsStore(folder / "settings.json")
    theme = Theme(store.settings.appearance)
    workers = (SubprocessAnalysis(warm_up_analysis), SubprocessWorker(warm_up_analysis)) if apart else (None, None)
    analyst, helper = workers
    kernels = Kernels(analyst, helper)

    def opened(source: str) -> Digitizer:
        return open_in_subprocess(with_site(source, site or store.settings.site))

    session = last_session(store.settings.session, folder)

    def analysis() -> AnalysisSettings:
        settings = store.analysis()
        return replace(settings, effects=session.effects.of(settings.model))

    rig = Rig(
        lambda source, digitizer: store.settings.options(source, digitizer),
        analysis,
        kernels.wait,
        source=store.settings.source,
        open_digitizer=open_digitizer or opened,
        analyst=analyst,
    )
    kept, laws, spool = ResultCache(folder / "kept"), OwnLaws(folder / "laws"), Spool(folder / "kept")
    workbench = Workbench(session, store.analysis, Saver(), helper, store.analysis_again, kept, laws, spool)
    window = MainWindow(rig, workbench, theme, store, kernels, log or ProgramLog(folder))
    theme.setParent(window)
    window.resize(first_size(window))
    restore_state(window, window.panels, store.settings.window)
    return window


def run(argv: list[str], site: str | None = None) -> int:
    """Open the window and run until it is closed; return the exit status."""
    application = QApplication.instance() or QApplication([sys.argv[0] if sys.argv else "levimass", *argv])
    assert isinstance(application, QApplication)
    application.setApplicationName("Levimass")
    application.setStyle("Fusion")
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Qt's event loop does not deliver Ctrl+C to Python
    log = ProgramLog(user_log_path("levimass"))
    log.install()
    window = open_window(user_config_path("levimass"), site=site, log=log)
    window.show()
    window.help_presenter.start_once()
    try:
        return application.exec()
    finally:
        log.close()
