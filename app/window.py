"""The desktop window: composes panels and desks, and pulls what is new 28 times a second."""

import signal
import sys
from pathlib import Path

from platformdirs import user_config_path
from PySide6.QtCore import Qt, QTimer, Slot
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QApplication, QMainWindow

from app import keyboard
from app.choices import Choices
from app.diagnosis_desk import DiagnosisDesk
from app.layout import Layout
from app.mapping_desk import MappingDesk
from app.model_desk import ModelDesk
from app.rig import Open, Rig
from app.rig_desk import RigDesk
from app.saver import Saver
from app.selection_desk import SelectionDesk
from app.session import Entry, Session
from app.session_desk import SessionDesk
from app.setup_desk import SetupDesk
from app.tables_desk import TablesDesk
from app.theme import Theme, Tone
from app.tour_desk import TourDesk
from app.view_desk import ViewDesk
from app.warm import Kernels, run_once
from app.workbench import Workbench
from instrument.apart.analysis import AnalysisApart
from instrument.apart.digitizer import open_apart
from instrument.apart.work import WorkApart
from instrument.snapshot import FinishedShot

PULL_MS = 35
SWITCH_S = 5e-4  # a busy thread gives way this soon; Python's own 5 ms, at each of a frame's many calls, adds up


class MainWindow(QMainWindow):
    """The one window.  Whatever takes longer than a frame runs in the rig's threads, the jobs' or a child."""

    def __init__(self, rig: Rig, bench: Workbench, theme: Theme, choices: Choices, kernels: Kernels) -> None:
        super().__init__()
        self.setWindowTitle("Levimass")
        self.setAcceptDrops(True)
        self.rig, self.bench, self.theme = rig, bench, theme
        self._warned = False  # that shots are only in memory
        self.panels = Layout(theme, self)
        self.setCentralWidget(self.panels)
        self.rig_desk = RigDesk(rig, choices, self.panels, self)
        self.selection_desk = SelectionDesk(bench, self.panels, self)
        self.session_desk = SessionDesk(bench, self.panels, self.selection_desk, self)
        self.diagnosis_desk = DiagnosisDesk(bench, self.panels, self)
        self.view_desk = ViewDesk(self.panels, self)
        self.setup_desk = SetupDesk(rig, choices, bench.errands, self.panels, self)
        self.setup_desk.source_wanted.connect(self.rig_desk.use_source)
        self.setup_desk.arm_wanted.connect(self.rig_desk.arm)
        self.tour_desk = TourDesk(choices, self.panels, self)
        self.mapping_desk = MappingDesk(bench, choices, self.panels, self)
        self.session_desk.mapping_wanted.connect(self.mapping_desk.ask)
        self.tables_desk = TablesDesk(bench, self.panels, self.selection_desk.front, self)
        self.model_desk = ModelDesk(bench, choices, self.panels, self.selection_desk.front, self)
        for desk in (self.rig_desk, self.session_desk, self.view_desk, self.model_desk):
            desk.said.connect(self.say)
        self.rig_desk.shot_finished.connect(self._shot_finished)
        self.session_desk.arrived.connect(self._arrived)
        self.rig_desk.save_elsewhere_wanted.connect(self._save_elsewhere)
        self.rig_desk.appearance_chosen.connect(self._appearance_chosen)
        theme.changed.connect(self._dress)
        desks = (self.rig_desk, self.session_desk, self.diagnosis_desk, self.view_desk, self.model_desk)
        keyboard.bind(self, (*desks, self.setup_desk, self.tour_desk, self))
        if bench.session.problem:
            self.say(bench.session.problem, Tone.WARNING)
        for words in choices.warnings:
            self.say(words, Tone.WARNING)
        bench.jobs.submit("kernels", kernels.work, "warm")
        bench.read_unread()
        self.session_desk.show()
        if bench.session.entries:  # a session reopens where it was: at its last shot
            self.panels.table.select([bench.session.entries[-1].number])
        self._dress()
        self.pull()
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self.pull)
        self._timer.start(PULL_MS)
        self.panels.controls.arm.setFocus()

    @Slot()
    def pull(self) -> None:
        """Bring the screen up to date; the only place where it happens."""
        snapshot = self.rig_desk.show()
        self.session_desk.rig_doing, self.session_desk.rig_share = snapshot.doing, snapshot.progress
        self.session_desk.show()
        self.selection_desk.show()
        self.diagnosis_desk.show()
        self.tables_desk.show()
        self.model_desk.show()
        self.mapping_desk.show()
        self.setup_desk.show(snapshot)

    @Slot(str, Tone)
    def say(self, words: str, tone: Tone) -> None:
        """Show a message in the lowest line."""
        self.panels.work.notices.say(words, tone)

    @Slot(object)
    def _shot_finished(self, finished: FinishedShot) -> None:
        self.session_desk.take(finished, stay=self.rig.rearm)

    @Slot(object)
    def _save_elsewhere(self, folder: Path) -> None:
        self.bench.save_elsewhere(self.rig.save_pending, folder)

    @Slot(object)
    def _arrived(self, entry: Entry) -> None:
        self.rig_desk.remember(entry)

    @Slot(str)
    def _appearance_chosen(self, choice: str) -> None:
        self.theme.choose(choice)

    @Slot()
    def _dress(self) -> None:
        self.panels.dress()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Press the button in focus by Enter."""
        if not keyboard.pressed_by_enter(self.focusWidget(), event):
            super().keyPressEvent(event)

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
        self.session_desk.open_paths(paths)
        event.acceptProposedAction()

    def closeEvent(self, event: QCloseEvent) -> None:
        """End every thread before the window goes; shots only in memory ask for a second thought."""
        unsaved = len(self.rig.latest().unsaved)
        if unsaved and not self._warned:
            self._warned = True
            what = "1 shot is" if unsaved == 1 else f"{unsaved} shots are"
            self.say(f"{what} only in memory: save elsewhere (Ctrl+S), or close again to drop them", Tone.BAD)
            event.ignore()
            return
        self._timer.stop()
        self.bench.close()
        self.rig.close()
        event.accept()


def open_window(folder: Path, open_digitizer: Open = open_apart, *, apart: bool = True) -> MainWindow:
    """Return the window, not shown yet, with settings and session kept in ``folder``.

    ``apart``: the rig's shots are analysed in a process of their own, what is asked for beside it in another.
    """
    sys.setswitchinterval(SWITCH_S)
    choices = Choices(folder / "settings.json")
    theme = Theme(choices.settings.appearance)
    analyst, helper = (AnalysisApart(run_once), WorkApart(run_once)) if apart else (None, None)
    kernels = Kernels([child.start for child in (analyst, helper) if child is not None])
    rig = Rig(
        choices.options,
        choices.analysis,
        kernels.wait,
        source=choices.settings.source,
        open_digitizer=open_digitizer,
        analyst=analyst,
    )
    bench = Workbench(Session.reopen(folder / "session.json"), choices.analysis, Saver(), helper)
    window = MainWindow(rig, bench, theme, choices, kernels)
    theme.setParent(window)
    room = window.screen().availableSize()
    window.resize(min(1480, room.width()), min(920, room.height()))
    return window


def run(argv: list[str]) -> int:
    """Open the window on the simulated bench and stay until it is closed; return the exit status."""
    application = QApplication.instance() or QApplication([sys.argv[0] if sys.argv else "levimass", *argv])
    assert isinstance(application, QApplication)
    application.setApplicationName("Levimass")
    application.setStyle("Fusion")
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Qt's loop never returns to Python for a Ctrl+C
    window = open_window(user_config_path("levimass"))
    window.show()
    window.tour_desk.start_once()
    return application.exec()
