"""The desktop window: composes panels and presenters, and pulls what is new 28 times a second."""

import signal
import sys
from dataclasses import replace
from pathlib import Path

from platformdirs import user_config_path, user_log_path
from PySide6.QtCore import Qt, QTimer, Slot
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QKeyEvent, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QApplication, QMainWindow

from analysis.shot.shot import AnalysisSettings
from app.session.choices import Choices
from app.session.jobs import Saver
from app.session.log import ProgramLog, note
from app.session.model_in_use import OwnLaws
from app.session.next_shots import PLAN, NextShots
from app.session.own_session import last_session
from app.session.prepare import complete, rehearse
from app.session.results import Results
from app.session.rig import Open, Rig
from app.session.session import Entry
from app.session.warm import Kernels
from app.session.workbench import Workbench
from app.window import menus, window_state
from app.window.layout import Layout
from app.window.presenters.diagnosis import DiagnosisPresenter
from app.window.presenters.files import FilesPresenter
from app.window.presenters.help import HelpPresenter
from app.window.presenters.laws import LawsPresenter
from app.window.presenters.mapping import MappingPresenter
from app.window.presenters.model import ModelPresenter
from app.window.presenters.next_shot import NextShotPresenter
from app.window.presenters.rig import RigPresenter
from app.window.presenters.selection import SelectionPresenter
from app.window.presenters.session import SessionPresenter
from app.window.presenters.setup import SetupPresenter
from app.window.presenters.tables import TablesPresenter
from app.window.presenters.tour import TourPresenter
from app.window.presenters.view import ViewPresenter
from app.window.theme import Theme, Tone
from app.window.window_state import first_size, keep_within_screen
from instrument.capture.acquisition import State
from instrument.devices.digitizer import Digitizer
from instrument.devices.sources import at_site
from instrument.live.snapshot import FinishedShot, Snapshot
from instrument.process.digitizer import open_apart
from instrument.process.work import AnalysisApart, WorkApart

PULL_MS = 35
FRAMED_MS = 300  # after the first show: by then the system has given the window its title bar
SWITCH_S = 5e-4  # a busy thread gives way this soon; Python's own 5 ms, at each of a frame's many calls, adds up


class MainWindow(QMainWindow):
    """The one window.  Whatever takes longer than a frame runs in the rig's threads, the jobs' or a child."""

    def __init__(
        self,
        rig: Rig,
        workbench: Workbench,
        theme: Theme,
        choices: Choices,
        kernels: Kernels,
        log: ProgramLog,
    ) -> None:
        super().__init__()
        self.log, self._choices = log, choices
        self.setWindowTitle("Levimass")
        self.setAcceptDrops(True)
        self.rig, self.workbench, self.theme = rig, workbench, theme
        self._warned: frozenset[str] = frozenset()  # what a close warned of: the next one is meant
        self.panels = Layout(theme, self)
        self.setCentralWidget(self.panels)
        self.rig_presenter = RigPresenter(rig, choices, self.panels, self)
        self.selection_presenter = SelectionPresenter(workbench, self.panels, self)
        self.session_presenter = SessionPresenter(workbench, choices, self.panels, self.selection_presenter, self)
        self.diagnosis_presenter = DiagnosisPresenter(workbench, self.panels, self)
        plans = NextShots(workbench, rig, choices)
        self.next_shot_presenter = NextShotPresenter(
            plans, workbench, self.panels, self.diagnosis_presenter.found, self
        )
        self.session_presenter.arrived.connect(self.next_shot_presenter.arrived)
        self.view_presenter = ViewPresenter(self.panels, lambda: choices.start_folder, self)
        self.files_presenter = FilesPresenter(workbench, choices, self.panels, self)
        self.files_presenter.recordings_wanted.connect(self.session_presenter.open_paths)
        self.laws_presenter = LawsPresenter(workbench.own_laws, self.panels, self)
        self.laws_presenter.diagnose_wanted.connect(self.diagnosis_presenter.diagnose)
        self.setup_presenter = SetupPresenter(rig, choices, workbench.errands, self.panels, self)
        self.setup_presenter.source_wanted.connect(self.rig_presenter.use_source)
        self.setup_presenter.arm_wanted.connect(self.rig_presenter.arm)
        self.tour_presenter = TourPresenter(choices, self.panels, self)
        self.help_presenter = HelpPresenter(self.panels, log.folder, self)
        self.mapping_presenter = MappingPresenter(workbench, choices, self.panels, self)
        self.session_presenter.mapping_wanted.connect(self.mapping_presenter.ask)
        self.session_presenter.swap_wanted.connect(self.mapping_presenter.swap)
        self.tables_presenter = TablesPresenter(workbench, self.panels, self.selection_presenter.front, self)
        self.model_presenter = ModelPresenter(workbench, choices, self.panels, self.selection_presenter.front, self)
        for presenter in (
            self.rig_presenter,
            self.session_presenter,
            self.view_presenter,
            self.model_presenter,
            self.files_presenter,
            self.help_presenter,
            self.laws_presenter,
        ):
            presenter.said.connect(self.say)
        self.rig_presenter.shot_captured.connect(self.session_presenter.take_captured)
        self.rig_presenter.shot_finished.connect(self._shot_finished)
        self.session_presenter.arrived.connect(self._arrived)
        self.rig_presenter.save_elsewhere_wanted.connect(self._save_elsewhere)
        self.rig_presenter.appearance_chosen.connect(self._appearance_chosen)
        theme.changed.connect(self._dress)
        presenters = (
            self.rig_presenter,
            self.session_presenter,
            self.diagnosis_presenter,
            self.laws_presenter,
            self.view_presenter,
            self.model_presenter,
            self.files_presenter,
            self.setup_presenter,
            self.tour_presenter,
            self.help_presenter,
        )
        self.actions_by_name = menus.bind(self, (*presenters, self), {"recent": self.files_presenter.recent})
        if workbench.session.problem:
            self.say(workbench.session.problem, Tone.WARNING)
        for words in choices.warnings:
            self.say(words, Tone.WARNING)
        workbench.jobs.submit("loading" if complete() else "first start", kernels.work, "warm")
        workbench.read_unread()
        workbench.look_for_unlisted(choices.settings.data_folder, choices.sessions)
        self.session_presenter.refresh()
        if workbench.session.entries:  # a session reopens where it was: at its last shot
            self.panels.table.select([workbench.session.entries[-1].number])
        self.pull()
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self.pull)
        self._timer.start(PULL_MS)
        self.panels.controls.arm.setFocus()

    @Slot()
    def pull(self) -> None:
        """Bring the screen up to date; the only place where it happens."""
        snapshot = self.rig_presenter.refresh()
        for problem in self.log.take_problems():
            self.say(problem, Tone.BAD)
        self._warned &= frozenset(self._at_stake(snapshot))  # a name that comes again is another shot's
        self.session_presenter.rig_doing, self.session_presenter.rig_share = snapshot.doing, snapshot.progress
        self.session_presenter.refresh()
        self.selection_presenter.refresh()
        self.diagnosis_presenter.refresh()
        self.next_shot_presenter.refresh()
        self.tables_presenter.refresh()
        self.model_presenter.refresh()
        self.mapping_presenter.refresh()
        self.setup_presenter.refresh(snapshot)

    @Slot(str, Tone)
    def say(self, words: str, tone: Tone) -> None:
        """Show a message in the lowest line, and keep it in the log."""
        note(words)
        self.panels.work.notices.say(words, tone)

    def _at_stake(self, snapshot: Snapshot) -> dict[str, str]:
        """Return what closing the window now would lose or miss, in words; by a name for each thing."""
        found = {}
        for name in snapshot.unsaved:
            found[name] = f"{_shots(len(snapshot.unsaved))} only in memory: save elsewhere (Ctrl+S), or lose them"
        if snapshot.state in (State.ARMED, State.TRIGGERED, State.TRANSFERRING):
            found["rig"] = "The rig is armed" if snapshot.state is State.ARMED else "A shot is being recorded"
        if self.workbench.session.unsaved:
            found["session"] = f"{self.workbench.session.problem}; its notes and verdicts would be lost"
        jobs = self.workbench.jobs
        if files := jobs.waiting("open"):
            found["files"] = f"{files} recording{'' if files == 1 else 's'} still to be opened"
        if jobs.waiting("diagnosis", "export", PLAN):
            found["work"] = "A diagnosis, an export or a plan is under way"
        return found

    @Slot(object)
    def _shot_finished(self, finished: FinishedShot) -> None:
        self.session_presenter.take(finished, stay=self.rig.rearm)

    @Slot(object)
    def _save_elsewhere(self, folder: Path) -> None:
        self.workbench.elsewhere.save(self.rig.save_pending, folder)

    @Slot(object)
    def _arrived(self, entry: Entry) -> None:
        self.rig_presenter.remember(entry)

    @Slot(str)
    def _appearance_chosen(self, choice: str) -> None:
        self.theme.choose(choice)

    @Slot()
    def _dress(self) -> None:
        self.panels.dress()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Press the button in focus by Enter."""
        if not menus.pressed_by_enter(self.focusWidget(), event):
            super().keyPressEvent(event)

    def showEvent(self, event: QShowEvent) -> None:
        """Look once the system has drawn the frame whether all of it is on the screen."""
        super().showEvent(event)
        self._size_shown = self.size()
        QTimer.singleShot(FRAMED_MS, self, self._keep_within_screen)

    @Slot()
    def _keep_within_screen(self) -> None:
        if self.size() == self._size_shown:  # else a person has chosen another size meanwhile
            keep_within_screen(self)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the sheets in place."""
        super().resizeEvent(event)
        self.panels.place_sheets()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Take files."""
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the recordings dropped on the window."""
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        self.session_presenter.open_paths(paths)
        event.acceptProposedAction()

    def closeEvent(self, event: QCloseEvent) -> None:
        """End every thread before the window goes; what would be lost asks for a second thought."""
        at_stake = self._at_stake(self.rig.latest())
        if not at_stake.keys() <= self._warned:
            self._warned = frozenset(at_stake)
            words = dict.fromkeys(at_stake.values())
            self.say(f"{'; '.join(words)}. Close again to quit all the same", Tone.BAD)
            event.ignore()
            return
        self._timer.stop()
        self._choices.change({"window": window_state.taken(self, self.panels)})
        self.workbench.close()
        self.rig.close()
        event.accept()


def _shots(count: int) -> str:
    return "1 shot is" if count == 1 else f"{count} shots are"


def open_window(
    folder: Path,
    open_digitizer: Open | None = None,
    *,
    apart: bool = True,
    site: str | None = None,
    log: ProgramLog | None = None,
) -> MainWindow:
    """Return the window, not shown yet, with settings and session kept in ``folder``, the log there or where it is.

    Its simulated bench stands at ``site``, or else where the settings say.
    ``apart``: the rig's shots are analysed in a process of their own, what is asked for beside it in another.
    """
    sys.setswitchinterval(SWITCH_S)
    choices = Choices(folder / "settings.json")
    theme = Theme(choices.settings.appearance)
    analyst, helper = (AnalysisApart(rehearse), WorkApart(rehearse)) if apart else (None, None)
    kernels = Kernels(analyst, helper)

    def opened(source: str) -> Digitizer:
        return open_apart(at_site(source, site or choices.settings.site))

    session = last_session(choices.settings.session, folder)

    def analysis() -> AnalysisSettings:
        settings = choices.analysis()
        return replace(settings, effects=session.effects.of(settings.model))

    rig = Rig(
        choices.options,
        analysis,
        kernels.wait,
        source=choices.settings.source,
        open_digitizer=open_digitizer or opened,
        analyst=analyst,
    )
    kept, laws = Results(folder / "kept"), OwnLaws(folder / "laws")
    workbench = Workbench(session, choices.analysis, Saver(), helper, choices.analysis_again, kept, laws)
    window = MainWindow(rig, workbench, theme, choices, kernels, log or ProgramLog(folder))
    theme.setParent(window)
    window.resize(first_size(window))
    window_state.restore(window, window.panels, choices.settings.window)
    return window


def run(argv: list[str], site: str | None = None) -> int:
    """Open the window on the simulated bench and stay until it is closed; return the exit status."""
    application = QApplication.instance() or QApplication([sys.argv[0] if sys.argv else "levimass", *argv])
    assert isinstance(application, QApplication)
    application.setApplicationName("Levimass")
    application.setStyle("Fusion")
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Qt's loop never returns to Python for a Ctrl+C
    log = ProgramLog(user_log_path("levimass"))
    log.install()
    window = open_window(user_config_path("levimass"), site=site, log=log)
    window.show()
    window.tour_presenter.start_once()
    try:
        return application.exec()
    finally:
        log.close()
