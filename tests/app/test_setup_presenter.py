"""The guided set-up: devices found beside the screen, permission, and verdicts on the signals before arming."""

import json
import threading
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.session.settings_store import SettingsStore
from app.window.controls.theme import LIGHT, Tone, style_sheet
from app.window.main_window import MainWindow, open_window
from app.window.panels.rig import Banner
from app.window.panels.setup_sheet import SetupSheet
from instrument.devices.device_search import FoundDevice, udev_instructions
from instrument.devices.digitizer import DigitizerError
from instrument.devices.doctor import Check, Grade
from instrument.devices.sources import open_source
from tests.app import rigs
from tests.app.on_screen import check_lines, use_buttons
from tests.instrument.devices.scpi_emulator import EmulatedScope, TcpScope

WAIT_MS = 30_000
BARRED = FoundDevice("hantek6022", "Hantek 6022", "USB bus 1", "it is closed to this user", "see below", barred=True)


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path, warm_kernels: None):  # type: ignore[no-untyped-def]
    chosen = {"levimass_settings": 1, "folder": str(tmp_path / "data"), "duration_s": 0.12}
    (tmp_path / "settings.json").write_text(json.dumps(chosen))
    window = open_window(tmp_path, rigs.still_bench, apart=False)
    qtbot.addWidget(window)
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow, timeout=WAIT_MS)
    yield window
    window.close()
    assert [t.name for t in threading.enumerate() if t.name.startswith("levimass")] == []


def test_the_set_up_finds_devices_says_the_remedy_and_judges_the_signals(qtbot: QtBot, window: MainWindow) -> None:
    gate = threading.Event()

    def slow() -> tuple[FoundDevice, ...]:
        gate.wait(20.0)
        return (BARRED,)

    window.setup_presenter._find = slow
    sheet = window.panels.setup
    qtbot.keyClick(window, Qt.Key.Key_F3)
    assert sheet.isVisible() and not sheet.look.isEnabled()  # a bus that hangs does not hold the screen
    qtbot.waitUntil(lambda: len(check_lines(sheet)) >= 4, timeout=WAIT_MS)  # and the site, once the block has rested
    gate.set()
    qtbot.waitUntil(lambda: len(use_buttons(sheet)) == 2, timeout=WAIT_MS)
    assert sheet.remedy.text() == udev_instructions()
    lines = {line.split(" ", 1)[1].split(":")[0]: line for line in check_lines(sheet)}
    assert "beat at 2.7" in lines["PD0, rest beat"] and "V (" in lines["PD0, rest beat"]
    assert "beat at 2.7" in lines["PD1, moving beat"]
    assert "toggle" in lines["Light switch"]
    assert "check light switch" in sheet.verdict.text()  # nobody passed through it yet
    here, there = use_buttons(sheet)
    assert not here.isEnabled() and there.isEnabled()
    qtbot.waitUntil(there.isVisible, timeout=WAIT_MS)
    there.setFocus()
    qtbot.keyClick(there, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: window.rig.source == "hantek6022", timeout=WAIT_MS)
    assert window.panels.controls.source.currentData() == "hantek6022"
    qtbot.waitUntil(lambda: not use_buttons(sheet)[1].isEnabled(), timeout=WAIT_MS)
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert not sheet.isVisible()


def test_arming_from_the_set_up_and_a_missing_usb_library(qtbot: QtBot, window: MainWindow) -> None:
    def missing() -> tuple[FoundDevice, ...]:
        raise DigitizerError("no USB library", "install libusb")

    window.setup_presenter._find = missing
    sheet = window.panels.setup
    qtbot.keyClick(window, Qt.Key.Key_F3)
    qtbot.waitUntil(lambda: "install libusb" in sheet._found.text(), timeout=WAIT_MS)
    assert len(use_buttons(sheet)) == 1 and sheet.remedy.text() == ""
    qtbot.waitUntil(lambda: sheet.arm.isEnabled() and len(check_lines(sheet)) >= 4, timeout=WAIT_MS)
    sheet.arm.click()
    assert not sheet.isVisible()
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "ARMED", timeout=WAIT_MS)


def test_an_oscilloscope_in_the_network_is_typed_used_and_remembered(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    sheet, rig = window.panels.setup, window.rig
    window.setup_presenter._find = lambda: ()
    rig._open = open_source
    qtbot.keyClick(window, Qt.Key.Key_F3)
    sheet.address.setFocus()
    qtbot.keyClicks(sheet.address, "no address")  # a blank is typed here and arms nothing
    qtbot.keyClick(sheet.address, Qt.Key.Key_Return)
    assert "'no address' is no address: type HOST" in sheet.refusal.text() and rig.source == "bench"

    sheet.address.setText("127.0.0.1:1")
    sheet.use_address.click()
    assert sheet.refusal.text() == ""
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "FAULT", timeout=WAIT_MS)
    with TcpScope(EmulatedScope("rigol", polls_until_trigger=1)) as server:
        source = f"scpi:127.0.0.1:{server.port}"
        sheet.address.setText(f"127.0.0.1:{server.port}")
        qtbot.keyClick(sheet.address, Qt.Key.Key_Return)
        qtbot.waitUntil(lambda: (source, f"Oscilloscope at 127.0.0.1:{server.port}") in rig.sources(), timeout=WAIT_MS)
        assert rig.opened == source
        assert json.loads((tmp_path / "settings.json").read_text())["network"] == source, "port 1 never answered"
        qtbot.waitUntil(lambda: len(use_buttons(sheet)) == 2, timeout=WAIT_MS)
        assert not use_buttons(sheet)[1].isEnabled()
        rig.open("bench")
        qtbot.waitUntil(lambda: rig.opened == "bench" or rig.latest().state == "fault", timeout=WAIT_MS)
    assert SettingsStore(tmp_path / "settings.json").settings.network_sources == (source,)


def test_the_tour_is_shown_once_and_leaves_the_keys_alone(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    tour = window.panels.tour
    window.help_presenter.start_once()
    assert tour.isVisible() and tour.title.text() == "Press ARM"
    qtbot.keyClick(tour.onward, Qt.Key.Key_Return)
    assert tour.title.text() != "Press ARM"
    qtbot.waitUntil(lambda: window.panels.controls.arm.isEnabled() and window.rig.channels != (), timeout=WAIT_MS)
    qtbot.keyClick(window, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: window.panels.banner.word.text() == "ARMED", timeout=WAIT_MS)
    assert tour.isVisible()
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert not tour.isVisible()
    assert window.panels.banner.word.text() == "ARMED"  # the first Esc sends the tour away only
    assert json.loads((tmp_path / "settings.json").read_text())["tour_done"] is True
    window.help_presenter.start_once()
    assert not tour.isVisible()
    qtbot.keyClick(window, Qt.Key.Key_F4)
    assert tour.isVisible()
    for _ in range(5):
        tour.next()
    assert not tour.isVisible()


def test_verdicts_are_worded_by_the_worst_of_the_checks(qtbot: QtBot) -> None:
    sheet = SetupSheet()
    qtbot.addWidget(sheet)
    assert "no samples yet" in check_lines(sheet)
    good = Check("PD0", Grade.OK, "beat at 2.73 MHz")
    sheet.show_checks((good,))
    assert "Ready: press ARM" in sheet.verdict.text() and check_lines(sheet) == ["✓ PD0, rest beat: beat at 2.73 MHz"]
    sheet.show_checks((good, Check("PD1", Grade.FAIL, "no beat")))
    assert "Not ready for a shot: fix PD1" in sheet.verdict.text()


def test_a_long_fault_stays_readable_beside_the_button_that_saves_elsewhere(qapp: QApplication, qtbot: QtBot) -> None:
    qapp.setStyleSheet(style_sheet(LIGHT))  # as in the window, also where no test before has opened one
    banner = Banner()
    qtbot.addWidget(banner)
    banner.resize(700, banner.height())
    banner.show()
    banner.show_state("READY", "Press ARM (space), then push the block.", Tone.NEUTRAL)
    large = banner.detail.font().pointSizeF()
    banner.offer_saving(2)
    words = "The shot could not be saved: No space left on device. In memory only: shot-0003. "
    banner.show_state("FAULT", words + "Save it elsewhere, then arm again.", Tone.BAD)
    assert banner.detail.font().pointSizeF() < large
    qtbot.waitUntil(lambda: banner.detail.heightForWidth(banner.detail.width()) <= banner.height() - 12)
    assert banner.save_elsewhere.text() == "Save 2 shots elsewhere …"
    banner.offer_saving(0)
    assert banner.save_elsewhere.isHidden()
