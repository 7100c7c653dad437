"""The guided set-up: find devices, open a source, check its signals."""

import sys
import time

from PySide6.QtCore import QObject, Slot

from analysis.shot import Progress, Stop
from app.session import Jobs, Rig, SettingsStore
from app.window.panels.layout import Layout
from instrument.capture import Snapshot
from instrument.devices import (
    Check,
    DigitizerError,
    FoundDevice,
    found_devices,
    network_name,
    network_source,
    udev_instructions,
)
from instrument.live import judge, judge_site

JUDGED_EVERY_S = 0.4  # interval between checks of the signals, long enough to read them


class SetupPresenter(QObject):
    """Connects the set-up sheet with the rig; a short job searches for devices."""

    def __init__(self, rig: Rig, store: SettingsStore, short_jobs: Jobs, panels: Layout, parent: QObject) -> None:
        super().__init__(parent)
        self._rig, self._store, self._short_jobs, self._sheet = rig, store, short_jobs, panels.setup
        self._find = found_devices
        self._looking = False
        self._found: tuple[FoundDevice, ...] = ()
        self._problem = ""
        self._typed = ""  # source of a typed address that has not answered yet
        self._present = ""
        self._judged_s = 0.0
        self._sheet.look.clicked.connect(self.look)
        self._sheet.address.returnPressed.connect(self._use_address)
        self._sheet.use_address.clicked.connect(self._use_address)
        self._sheet.arm.clicked.connect(self._sheet.hide)
        rig.remember_network(store.settings.network_sources)

    @Slot()
    def toggle_setup(self) -> None:
        if self._sheet.isVisible():
            self._sheet.hide()
            return
        self._judged_s = 0.0
        self._sheet.open()
        self.look()

    @Slot()
    def look(self) -> None:
        """Search for devices, as a short job."""
        if self._looking:
            return

        def work(_: Progress, __: Stop) -> tuple[tuple[FoundDevice, ...] | None, str]:
            try:
                return self._find(), ""
            except DigitizerError as error:
                return None, f"{error.what}; {error.remedy}"

        self._looking = True
        self._sheet.show_looking()
        self._short_jobs.submit(
            "looking for devices", work, "devices", lambda found: self._take_found(*found), self._failed
        )

    def refresh(self, snapshot: Snapshot) -> None:
        """Store an address that has answered; update the sheet while it is open."""
        self._take_address()
        if not self._sheet.isVisible():
            return
        if not self._looking and self._present != self._rig.source:
            self._show_devices()
        now = time.monotonic()
        if now - self._judged_s >= JUDGED_EVERY_S:
            self._judged_s = now
            self._sheet.show_checks(*self._verdicts(snapshot))
            self._sheet.arm.setEnabled(self._rig.can_arm(snapshot))

    def _take_found(self, found: tuple[FoundDevice, ...] | None, problem: str) -> None:
        self._looking = False
        self._found, self._problem = found or (), problem
        if found is not None:
            self._rig.remember_found(found)
        self._show_devices()

    def _failed(self, why: str | None) -> None:
        self._take_found(None, why or "it was cancelled")

    def _show_devices(self) -> None:
        self._present = self._rig.source
        network = [FoundDevice(s, network_name(s), "in the network") for s in self._store.settings.network_sources]
        self._sheet.show_devices(self._found, network, self._present, self._problem)
        barred = any(device.barred for device in self._found)
        self._sheet.show_remedy(udev_instructions() if barred and sys.platform.startswith("linux") else "")

    def _verdicts(self, snapshot: Snapshot) -> tuple[tuple[Check, ...], str]:
        line, rate_hz = snapshot.signal, self._rig.rate_hz
        if rate_hz is None:
            return (), snapshot.message or "opening the source …"
        if not line.channels:
            return (), "No samples yet. A source that sends samples only when armed shows its signals after ARM."
        checks = judge(line.channels, rate_hz, line.switch_toggles, self._store.settings.rest_frequency_hz)
        floor = snapshot.live.floor
        return (*checks, judge_site(floor)) if floor is not None else checks, ""

    @Slot()
    def _use_address(self) -> None:
        try:
            self._typed = network_source(self._sheet.address.text())
        except DigitizerError as error:
            self._sheet.refuse_address(str(error))
            return
        self._sheet.refuse_address("")
        self._sheet.source_wanted.emit(self._typed)

    def _take_address(self) -> None:
        """Store the typed address once the oscilloscope there has answered."""
        if self._typed and self._rig.opened == self._typed:
            self._store.remember_network(self._typed)
            self._rig.remember_network(self._store.settings.network_sources)
            self._sheet.address.clear()
            self._present = ""
            self._typed = ""
