"""A whole session through the real window: ``python -m tests.app.whole_session PICTURES [light|dark] [brief]``.

Started on a display (see ``virtual_screen``), it opens the program as ``levimass`` does and then only presses what a
person could: set up, arm, five shots with a fault among them, look, compare, diagnose jointly, add the effect, save
the model, report (brief: only start, tour, settings and set-up).  A picture of the screen is taken at every step; the
exit status is 0 where all came about.
"""

import os
import shutil
import sys
import traceback
from pathlib import Path

from PySide6.QtCore import QObject, QPoint, QTimer, Slot
from PySide6.QtGui import QGuiApplication

from tests.app.person import Person, Role

SHOTS = 5
LONG_S = 1500.0  # a joint diagnosis on a busy machine


class Story(QObject):
    """One session, from the first start to the report."""

    def __init__(self, home: Path, pictures: Path, colours: str, brief: bool) -> None:
        super().__init__()
        self._brief = brief
        self._home, self._colours = home, colours
        self._data = home / "rig"
        self._data.mkdir()
        self.person = Person(pictures)
        self.problem = ""

    @Slot()
    def tell(self) -> None:
        """Play it; what goes wrong is kept and the program closed as a person would."""
        try:
            self._first_minute()
            self._settings()
            if not self._brief:
                self._five_shots()
                self._look()
                self._several()
                self._diagnosis()
                self._papers()
            self._close()
        except Exception as error:  # whatever it was, the window must not stay open
            traceback.print_exc()
            self.problem = str(error) or repr(error)
            QGuiApplication.exit(1)

    def _first_minute(self) -> None:
        p = self.person
        p.bring_to_front("Levimass")
        p.see("Next", Role.Button)
        p.picture("first-start")
        for step in range(2, 6):
            p.click("Next", Role.Button)
            p.wait_to_read(f"{step} of 5")
            p.picture(f"tour-{step}")
        p.click("Done", Role.Button)
        p.press("F1")
        p.wait_to_read("The short tour")
        p.picture("keys")
        p.press("Esc")

    def _settings(self) -> None:
        p = self.person
        p.press("F2")
        p.see("Moving mass (g)")
        p.choose("Colours", self._colours)
        p.click("Recordings", Role.EditableText)
        p.press("Ctrl+A")
        p.type(str(self._data))
        p.click("Apply", Role.Button)
        p.wait_to_read("Applied.")
        p.picture("settings")
        p.press("F2")
        p.choose("Simulated bench", "Simulated bench with a flaw")
        p.press("F3")
        p.wait_to_read("PD0, rest beat: ")
        p.picture("set-up")
        p.press("F3")
        p.click("LIVE", Role.PageTab)
        p.wait("the button ARM", lambda: p.see("ARM", Role.Button).enabled)

    def _five_shots(self) -> None:
        p = self.person
        for number in range(1, SHOTS + 1):
            if number == SHOTS:
                self._a_fault()
            p.press("Space")
            if number == 1:
                self._states()
            p.wait_to_read(f"SHOTS  {number}", LONG_S)
            if number == 1:
                p.wait_to_read("Shot 1 is saved", LONG_S)
                p.picture("first-shot")
        p.wait_to_read(f"Shot {SHOTS} is saved", LONG_S)

    def _states(self) -> None:
        """Take pictures of what the banner says until the first shot is there; a quick push passes over some."""
        p = self.person
        for words, name in (("ARMED", "armed"), ("CAPTURED", "captured"), ("ANALYSING", "analysing")):
            p.wait(words, lambda words=words: p.reads(words) or p.reads("SHOTS  1"), LONG_S)
            p.picture(name)

    def _a_fault(self) -> None:
        """The folder of the recordings is gone when the fifth shot is to be armed."""
        p = self.person
        self._data.rename(self._home / "moved away")
        p.press("Space")
        p.wait_to_read("FAULT", LONG_S)
        p.picture("fault")
        (self._home / "moved away").rename(self._data)

    def _look(self) -> None:
        p = self.person
        p.press("Ctrl+2")
        for key, name in (("1", "whole"), ("2", "contact"), ("3", "deflection"), ("4", "gap"), ("5", "raw")):
            p.press(key)
            p.wait("the samples", lambda: not p.reads("reading the samples"))
            p.picture(f"shot-{name}")
        p.press("3")
        p.press("C")
        p.wait_to_read("slope per m")
        p.picture("deflection-cursors")
        p.press("C")
        p.press("1")
        p.press("C")
        p.picture("cursors")
        p.press("Ctrl+Shift+C")
        assert "slope" in QGuiApplication.clipboard().text()
        p.press("C")
        for kind in ("PNG", "SVG", "CSV"):
            p.press("Ctrl+P")
            words = "Save the samples in view as CSV …" if kind == "CSV" else f"Save as {kind} …"
            p.click(words, Role.MenuItem)
            plot = self._home / f"plot.{kind.lower()}"
            p.answer(f"Save the plot as {kind}", plot)
            p.wait(f"{plot.name} on the disk", plot.exists)
        number = p.see("quasi-static", Role.StaticText)
        p.point_at(number.place.center())
        p.picture("hover")
        p.press("N")
        p.type("pushed by hand")
        p.press("Return")
        p.wait_to_read("pushed by hand")
        p.press("Ctrl+Z")
        p.wait("the note to go", lambda: not p.reads("pushed by hand"))
        p.press("Ctrl+4")
        p.wait("the spectra", lambda: not p.reads("computing the spectra"))
        p.picture("spectrum")
        p.press("B")
        p.wait_to_read("Standard uncertainties; expanded")
        p.picture("budget")
        p.press("Ctrl+7")
        p.wait_to_read("numbers agree as printed", LONG_S)
        p.picture("paper")

    def _several(self) -> None:
        p = self.person
        self._select_all()
        p.press("Ctrl+3")
        p.picture("compare")
        p.choose("COR quasi-static", "k_p (N/m)")
        p.press("2")
        p.picture("compare-contact")
        p.press("1")

    def _select_all(self) -> None:
        table = self.person.see("Shots of the session", Role.Table).place
        self.person.click_at(QPoint(table.left() + 60, table.top() + 60))
        self.person.press("Ctrl+A")

    def _diagnosis(self) -> None:
        p = self.person
        p.press("D")
        p.wait("the diagnosis under way", lambda: p.find("Progress of the diagnosis") is not None)
        p.picture("diagnosing")
        p.wait_to_read("EFFECT FOUND", LONG_S)
        p.picture("diagnosis")
        together = p.find("Add all to the model", Role.Button) is not None
        p.click("Add all to the model" if together else "Add to the model", Role.Button)
        p.see("Remove from the model", Role.Button)
        p.picture("effect-added")
        p.press("Ctrl+2")
        p.press("1")
        p.wait_to_read("paper model + quadratic drag", LONG_S)
        p.picture("shot-with-the-effect")

    def _papers(self) -> None:
        p = self.person
        self._select_all()
        model = self._home / "model.toml"
        p.press("Ctrl+Shift+S")
        p.answer("Save the model", model)
        p.wait("the model on the disk", model.exists, LONG_S)
        p.press("Ctrl+Shift+O")
        p.answer("Open a model", model)
        p.wait_to_read("agrees with the model file", LONG_S)
        p.picture("model-file")
        report = self._home / "report.html"
        p.press("Ctrl+T")
        p.answer("Save the report", report)
        p.wait("the report on the disk", report.exists, LONG_S)
        p.wait_to_read("Report of 5 shots saved")
        p.picture("reported")
        shutil.copy(report, self.person.pictures)

    def _close(self) -> None:
        self.person.press("Ctrl+Q")


def main(arguments: list[str]) -> int:
    """Tell the story into a folder of pictures; return the exit status."""
    if not arguments or not set(arguments[1:]) <= {"light", "dark", "brief"}:
        print("usage: python -m tests.app.whole_session PICTURES [light|dark] [brief]", file=sys.stderr)
        return 2
    home = Path(os.environ["LEVIMASS_SESSION_HOME"])
    story = Story(home, Path(arguments[0]), "dark" if "dark" in arguments else "light", "brief" in arguments)

    from app.window.main_window import run

    QTimer.singleShot(0, story.tell)
    status = run([])
    if story.problem:
        print(f"whole_session: {story.problem}", file=sys.stderr)
        return 1
    return status


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
