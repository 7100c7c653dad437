"""``python -m tests.app.screenshots DIR``: the window and its panels as pictures, by pressing what a person would."""

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from app.window.main_window import FRAMED_MS, MainWindow, open_window
from app.window.panels.layout import Layout
from app.window.plots.plot_notes import NoteEditor
from instrument.bench.digitizer import BenchDigitizer
from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import simulate
from instrument.bench.site import USUAL_SITE, site_named
from instrument.devices.digitizer import Digitizer, DigitizerError
from tests.app.on_screen import check_lines, read_entries

SIZE = (1480, 920)
MAX_BYTES = 300_000
LONGEST_S = 900.0  # a diagnosis on a busy machine


class ScreenshotError(Exception):
    """What did not come about in time."""


class _Unplugged(BenchDigitizer):
    """A bench whose cable is pulled for the picture of a fault."""

    pulled = False

    def read_into(self, buffer, timeout_s):  # type: ignore[no-untyped-def]
        """Fail once pulled."""
        if self.pulled:
            raise DigitizerError("the digitizer was unplugged", "plug it in, then arm again")
        return super().read_into(buffer, timeout_s)


class Photographer:
    """Drives one window and takes its pictures."""

    def __init__(self, folder: Path, into: Path) -> None:
        rig = Bench(site=site_named(USUAL_SITE), seed=7)
        self._bench = _Unplugged(rig, patient=True, first_push_s=0.3, push_every_s=0.7)
        self._into = into
        self._scratch = folder
        # armed with the block behind the switch: wait for the next push
        chosen = {"levimass_settings": 1, "folder": str(folder / "data"), "edge": "rising"}
        (folder / "settings.json").write_text(json.dumps(chosen))
        self.window: MainWindow = open_window(folder, self._source)
        self.window.theme.choose("light")
        self.window.show()
        QTest.qWait(2 * FRAMED_MS)  # by then it has been fitted to the screen, which is a small one here
        self.window.resize(*SIZE)
        self.window.activateWindow()

    def _source(self, _: str) -> Digitizer:
        return self._bench

    def wait(self, what: str, until: Callable[[], bool]) -> None:
        """Let the window live until something is so."""
        end = time.monotonic() + LONGEST_S
        while not until():
            if time.monotonic() > end:
                raise ScreenshotError(f"waited {LONGEST_S:g} s in vain for {what}")
            QTest.qWait(10)

    def press(self, key: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        """Press a key and let the window answer."""
        if not self.window.isActiveWindow():  # without a display another window of the process may have taken it
            self.window.activateWindow()
            self.wait("the window in front", self.window.isActiveWindow)
        QTest.keyClick(self.window, key, modifier)
        QTest.qWait(120)

    def take(self, name: str, of: QWidget | None = None) -> None:
        """Save a picture of the window, or of one panel."""
        QTest.qWait(80)
        path = self._into / f"{name}.png"
        picture = (of or self.window).grab().toImage()
        if not picture.save(str(path), quality=0):  # packed as tightly as PNG can
            raise ScreenshotError(f"{path}: could not be written")
        if path.stat().st_size > MAX_BYTES:  # a spectrogram's noise: five bits a colour do
            picture.convertToFormat(QImage.Format.Format_RGB555).save(str(path), quality=0)
        print(path)

    def run(self) -> None:
        """Take all pictures."""
        panels = self.window.panels
        self.wait("the window in front", self.window.isActiveWindow)
        self.wait("the beat", lambda: panels.controls.arm.isEnabled() and panels.live.numbers["velocity"].text() != "–")
        self.press(Qt.Key.Key_F4)
        self.take("tour")
        self.press(Qt.Key.Key_Escape)
        self.press(Qt.Key.Key_F3)
        self.wait("sound signals of a block at rest", self._checked)
        self.take("set-up")
        self.press(Qt.Key.Key_F3)
        rig, before = self.window.rig, self.window.rig.latest().signal.switch_toggles
        # else a push may come, and its shot be taken, before ARMED is looked for
        self.wait("the end of a push", lambda: rig.latest().signal.switch_toggles >= before + 2)
        self.press(Qt.Key.Key_Space)
        self.wait("ARMED", lambda: panels.banner.word.text() == "ARMED")
        self.take("armed")
        self.wait("a moving block", self._block_moves)
        self.take("live")
        self.wait("a shot", lambda: len(read_entries(self.window.workbench.session)) == 1)
        self.wait("READY", lambda: panels.banner.word.text() == "READY")
        panels.tabs.setCurrentIndex(Layout.SHOT)
        self._views()
        self._sheets()
        self._several()
        self._panels()
        self._dark()
        self._fault()

    def _block_moves(self) -> bool:
        """Return whether LIVE shows a moving block; it is chosen again if an analysed shot has shown its own page."""
        self.window.panels.tabs.setCurrentIndex(Layout.LIVE)
        return self.window.panels.live.numbers["velocity"].text()[1:4] not in ("0.0", "", "–")

    def _checked(self) -> bool:
        """Return whether every line of the set-up has its tick; look again where the block was just pushed."""
        sheet = self.window.panels.setup
        if len(check_lines(sheet)) < 4 or not sheet.look.isEnabled():
            return False
        sound = all(line.startswith("✓") for line in check_lines(sheet))
        if not sound:
            sheet.look.click()
        return sound

    def _views(self) -> None:
        self.press(Qt.Key.Key_1)
        self.take("window")
        for key, name in (
            (Qt.Key.Key_2, "first-contact"),
            (Qt.Key.Key_3, "force-deflection"),
            (Qt.Key.Key_4, "gap"),
            (Qt.Key.Key_5, "raw"),
        ):
            self.press(key)
            if name == "raw":
                self.wait("the samples", lambda: self.window.panels.shot.raw.wanted is None)
            self.take(name, self.window.panels.shot)
        self.press(Qt.Key.Key_1)
        self.press(Qt.Key.Key_C)
        self.take("cursors", self.window.panels.shot)
        self._note()
        self.press(Qt.Key.Key_C)

    def _note(self) -> None:
        """Write a note at cursor A, and take it back once its picture is taken."""
        shot = self.window.panels.shot
        shot.stack.cursors.place(0.0, 3.0)
        self.press(Qt.Key.Key_N, Qt.KeyboardModifier.ShiftModifier)
        (line,) = (editor for editor in shot.findChildren(NoteEditor) if editor.isVisible())
        QTest.keyClicks(line, "a knock at the table here?")
        QTest.keyClick(line, Qt.Key.Key_Return)
        QTest.qWait(120)
        self.take("note", shot)
        self.press(Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
        if any(entry.plot_notes for entry in self.window.workbench.session.entries):
            raise ScreenshotError("the note was not taken back")
        self.window.panels.work.notices.next()  # the message that says so is in no other picture

    def _sheets(self) -> None:
        self.press(Qt.Key.Key_F2)
        self.take("settings")
        self.press(Qt.Key.Key_F2)
        self.press(Qt.Key.Key_F1)
        self.take("keys")
        self.press(Qt.Key.Key_F1)
        self.press(Qt.Key.Key_4, Qt.KeyboardModifier.ControlModifier)
        self.wait("spectra", lambda: self.window.panels.spectrum.picture.image is not None)
        self.take("spectrum")
        self.press(Qt.Key.Key_B)
        self.window.panels.budget.table.topLevelItem(0).setExpanded(True)
        self.take("budget")
        self.press(Qt.Key.Key_7, Qt.KeyboardModifier.ControlModifier)
        self.wait("the paper", lambda: self.window.panels.paper.table.topLevelItemCount() > 0)
        self.take("paper")

    def _several(self) -> None:
        session, panels = self.window.workbench.session, self.window.panels
        effect = {"quadratic_drag": {"coefficient_n_s2_per_m2": 1e-3}}
        paths = simulate(self._scratch / "drag", 3, 5, effect)
        self.window.session_presenter.open_paths([Path(path) for path in paths])
        self.wait("three more shots", lambda: len(read_entries(session)) == 4)
        panels.table.select([entry.number for entry in session.entries[1:]])
        self.press(Qt.Key.Key_3, Qt.KeyboardModifier.ControlModifier)
        panels.compare.which.setCurrentIndex(panels.compare.which.findData("plate_stiffness_n_per_m"))
        self.take("compare")
        self.press(Qt.Key.Key_2)
        self.take("compare-contact", panels.compare)
        self.press(Qt.Key.Key_D)
        self.wait("the diagnosis", lambda: self.window.workbench.jobs.open_jobs == 0)
        QTest.qWait(200)
        self.take("diagnosis")
        self._model_file()

    def _model_file(self) -> None:
        panels, workbench, path = self.window.panels, self.window.workbench, self._scratch / "model.toml"
        workbench.exports.save_model(panels.table.numbers, path)
        self.wait("the model file", path.exists)
        workbench.model.load(path)
        self.press(Qt.Key.Key_2, Qt.KeyboardModifier.ControlModifier)
        self.wait("the model held against the shot", lambda: "model file" in panels.model.known.text())
        self.take("model-file")

    def _panels(self) -> None:
        panels = self.window.panels
        panels.tabs.setCurrentIndex(Layout.SHOT)
        for name, panel in (
            ("panel-controls", panels.controls),
            ("panel-banner", panels.banner),
            ("panel-signals", panels.signals),
            ("panel-numbers", panels.numbers),
            ("panel-model", panels.model),
            ("panel-session", panels.table),
        ):
            self.take(name, panel)

    def _dark(self) -> None:
        self.window.theme.choose("dark")
        self.window.panels.table.select([1])
        self.press(Qt.Key.Key_2)
        self.take("dark")
        self.window.theme.choose("light")

    def _fault(self) -> None:
        banner = self.window.panels.banner
        self._bench.pulled = True
        self.wait("the fault", lambda: banner.word.text() == "FAULT")
        self.take("fault")


def main(arguments: list[str]) -> int:
    """Take the pictures into the folder named; return the exit status."""
    if len(arguments) != 1:
        print("usage: python -m tests.app.screenshots DIR", file=sys.stderr)
        return 2
    into = Path(arguments[0])
    into.mkdir(parents=True, exist_ok=True)
    application = QApplication.instance() or QApplication(["levimass"])
    assert isinstance(application, QApplication)
    application.setStyle("Fusion")
    with tempfile.TemporaryDirectory(prefix="levimass-") as folder:
        photographer = Photographer(Path(folder), into)
        try:
            photographer.run()
        except ScreenshotError as error:
            print(f"levimass: {error}", file=sys.stderr)
            return 1
        finally:
            photographer.window.close()
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
