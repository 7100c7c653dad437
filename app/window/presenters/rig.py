"""Operate the rig (source, ARM, abort, re-arm, settings) and show its state and signals."""

import time
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot
from PySide6.QtWidgets import QApplication

from app.session import Entry, Rig, SettingsStore
from app.window.controls.file_dialog import PathKind, ask
from app.window.controls.theme import Tone
from app.window.controls.widgets import Sheet
from app.window.panels import state_words
from app.window.panels.layout import Layout
from app.words import duration
from instrument.capture import Snapshot, State
from instrument.devices import is_bench
from instrument.live import LiveView
from levimass import Value

RECORDINGS = "Recordings (*.sigmf-meta *.sigmf-data *.csv *.toml);;All files (*)"


class RigPresenter(QObject):
    """Connects the rig with its panels; emits each CapturedShot with its news."""

    shot_came = Signal(object, bool)  # whether the rig re-arms
    appearance_chosen = Signal(str)
    save_elsewhere_wanted = Signal(object)  # the folder, as a Path

    def __init__(self, rig: Rig, store: SettingsStore, panels: Layout, parent: QObject) -> None:
        super().__init__(parent)
        self._rig, self._store, self._panels = rig, store, panels
        self._last_shot: state_words.LastShot | None = None
        self._before = (State.IDLE, 0)  # state and number of shots at the previous refresh
        self._live_shown: LiveView | None = None
        panels.controls.rearm.toggled.connect(self._set_rearm)
        for panel in (panels.controls, panels.setup):
            panel.source_wanted.connect(self.use_source)
        panels.setup.arm.clicked.connect(self.arm)
        panels.settings.applied.connect(self._settings_applied)
        self._offer_sources()

    def refresh(self) -> Snapshot:
        """Show the newest snapshot in banner, buttons, signal line and LIVE; return it."""
        snapshot = self._rig.latest()
        p = self._panels
        word, sentence, tone = state_words.banner(snapshot, self._last_shot)
        since = "" if tone is Tone.NEUTRAL else duration(time.monotonic() - snapshot.since_s)
        p.banner.show_state(word, sentence, tone, since)
        p.banner.offer_saving(len(snapshot.unsaved))
        sources = self._rig.sources()
        if sources != self._offered and not p.controls.source.view().isVisible():
            self._offer_sources()
        p.controls.show_state(self._rig.can_arm(snapshot), self._rig.can_abort(snapshot))
        for name, sign in state_words.tile_texts(
            snapshot.signal, self._rig.rate_hz, self._store.settings.bandwidth_hz
        ).items():
            p.signals.show_tile(name, sign)
        p.signals.show_folder(str(snapshot.signal.folder or ""))
        on_live = p.tabs.currentIndex() == Layout.LIVE
        on_setup = p.setup.isVisible()
        self._rig.watch(on_live or on_setup, switch=on_setup)
        if on_live and snapshot.live is not self._live_shown:
            self._live_shown = snapshot.live
            p.live.show_live(snapshot.live)
            self._show_raw(snapshot)
        self._take_shots(snapshot)
        self._signal_trigger(snapshot)
        return snapshot

    def _show_raw(self, snapshot: Snapshot) -> None:
        """Show raw samples with the trigger's thresholds; set ones at once, although they apply from the next ARM."""
        settings = self._store.settings
        set_v = settings.switch_low_v, settings.switch_high_v
        learned = None in set_v  # the signal determines the thresholds
        thresholds_v = snapshot.signal.switch_thresholds_v if learned else set_v
        self._panels.live.show_raw(snapshot.live, self._rig.channels, thresholds_v, learned)

    def _signal_trigger(self, snapshot: Snapshot) -> None:
        """Beep or flash once per trigger, according to the settings."""
        before, now = self._before, (snapshot.state, snapshot.shots)
        self._before = now
        taking = (State.TRIGGERED, State.TRANSFERRING)
        # the trigger states may begin and end between two refreshes
        if before[0] not in taking and (now[0] in taking or now[1] > before[1]):
            if self._store.settings.sound:
                QApplication.beep()
            if self._store.settings.flash:
                self._panels.banner.flash()

    def _take_shots(self, snapshot: Snapshot) -> None:
        for captured in self._rig.take_shots(snapshot):
            self.shot_came.emit(captured, self._rig.rearm)
        for problem in self._rig.take_problems():
            self._panels.say(problem, Tone.BAD)

    @Slot(object)
    def remember(self, entry: Entry) -> None:
        """Set the banner's sentence on the last shot."""
        self._last_shot = state_words.last_shot(entry)

    @Slot()
    def arm(self) -> None:
        if self._panels.controls.arm.isEnabled():
            self._panels.live.hold.setChecked(False)  # resume frozen curves, to show this shot
            self._rig.arm()
            self._panels.tabs.setCurrentIndex(Layout.LIVE)

    @Slot()
    def abort(self) -> None:
        """Close an open sheet, else abort the capture."""
        p = self._panels
        sheets = [sheet for sheet in p.findChildren(Sheet) if sheet.isVisible()]
        if sheets:
            for sheet in sheets:
                sheet.close()
            return
        self._rig.abort()

    @Slot()
    def trigger_now(self) -> None:
        self._rig.trigger_now()

    @Slot()
    def save_elsewhere(self) -> None:
        """Ask for a folder and save the shots that are only in memory."""
        if not self._rig.latest().unsaved:
            self._panels.say("All shots are saved", Tone.NEUTRAL)
            return
        title, then = "Save the shots in memory to", self.save_elsewhere_wanted.emit
        ask(self._panels, title, PathKind.FOLDER, then, Path.home())

    @Slot(bool)
    def _set_rearm(self, on: bool) -> None:
        self._rig.set_rearm(on)

    @Slot()
    def focus_source(self) -> None:
        self._panels.controls.source.setFocus()

    @Slot(str)
    def use_source(self, name: str) -> None:
        """Open another source; ask for the recording if it is a replay."""
        if name == "replay:":
            self._offer_sources()
            title, start = "Recording to play back", self._store.start_folder
            ask(self._panels, title, PathKind.FILE, lambda path: self.use_source(f"replay:{path}"), start, RECORDINGS)
            return
        if name != self._rig.source:
            self._rig.open(name)
            self._store.remember_source(name)
        self._offer_sources()

    def _offer_sources(self) -> None:
        self._offered = self._rig.sources()
        self._panels.controls.offer_sources(self._offered, self._rig.source)

    @Slot()
    def toggle_settings(self) -> None:
        sheet = self._panels.settings
        if sheet.isVisible():
            sheet.hide()
        else:
            self._panels.setup.hide()
            sheet.show_values(self._store.settings.values())
            sheet.open()

    @Slot(dict)
    def _settings_applied(self, values: dict[str, Value]) -> None:
        site = self._store.settings.site
        problem = self._store.change(values)
        if problem:
            self._panels.settings.refuse(problem)
            return
        if self._store.settings.site != site and is_bench(self._rig.source):
            self._rig.open(self._rig.source)
        self._rig.options_changed()
        self.appearance_chosen.emit(self._store.settings.appearance)
