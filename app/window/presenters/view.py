"""Commands on pages, views, cursors and plots; saving of plots; the help menu."""

from collections.abc import Callable
from functools import partial
from importlib import resources
from operator import attrgetter
from pathlib import Path

from PySide6.QtCore import QObject, QUrl, Slot
from PySide6.QtGui import QDesktopServices, QGuiApplication

from app.session import SettingsStore
from app.window.controls.file_dialog import FileDialogs, PathKind
from app.window.controls.theme import Tone
from app.window.panels.help import Step
from app.window.panels.layout import Layout
from app.window.plots import save
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.plot_view import PlotView
from app.window.plots.time_plot import TimeStack
from instrument.files import RecordingError


class ViewPresenter(QObject):
    """Connects keys and menus with the panels; it changes no data."""

    def __init__(self, panels: Layout, start: Callable[[], Path], parent: QObject) -> None:
        super().__init__(parent)
        self._panels = panels
        self._dialogs = FileDialogs(panels, start)
        for plot in panels.findChildren(PlotView):
            plot.export_wanted.connect(self._ask_and_save)

    def toggle(self, name: str) -> None:
        """Open or close a sheet, or press a checkable button; ``name`` is its place in ``Layout``, as "live.hold"."""
        attrgetter(name)(self._panels).toggle()

    def show_page(self, name: str) -> None:
        self._panels.tabs.setCurrentIndex(Layout.PAGES.index(name))

    def show_view(self, name: str) -> None:
        """Show a view of the shot; on COMPARE show the whole length or the first contact of the overlaid shots."""
        compare = self._panels.compare
        of_several = {"whole": compare.stack.reset, "contact": compare.show_contact}
        if self._panels.tabs.currentIndex() == Layout.COMPARE and name in of_several:
            of_several[name]()
            return
        self.show_page("SHOT")
        self._panels.shot.set_view(name)
        self._panels.shot.reset()

    def _plot(self) -> PlotView | None:
        """Return the plot on which the keys act; if the page has none, change to SHOT."""
        plot = self._panels.plot_in_front()
        if plot is None:
            self.show_page("SHOT")
            plot = self._panels.plot_in_front()
        return plot

    def on_plot(self, method: str) -> None:
        """Call a method of the plot on which the keys act."""
        if (plot := self._plot()) is not None:
            getattr(plot, method)()

    def step_view(self, by: str) -> None:
        """Go back ("-1") or forward ("1") in the plot's history of views."""
        plot = self._plot()
        if plot is not None and not plot.step_view(int(by)):
            self._panels.say("No previous view" if by == "-1" else "No next view", Tone.NEUTRAL)

    @Slot()
    def copy_cursors(self) -> None:
        plot = self._plot()
        if plot is not None and plot.cursors.shown:
            plot.copy_cursors()
            self._panels.say("The cursor readings are on the clipboard", Tone.NEUTRAL)

    @Slot()
    def copy_plot(self) -> None:
        if (plot := self._plot()) is not None:
            QGuiApplication.clipboard().setImage(save.picture(plot))
            self._panels.say("The plot is on the clipboard as a picture", Tone.NEUTRAL)

    @Slot(object, str)
    def _ask_and_save(self, plot: PlotView, kind: str) -> None:
        title, kinds = f"Save the plot as {kind.upper()}", f"{kind.upper()} (*.{kind})"
        self._dialogs.ask(title, PathKind.NEW_FILE, partial(self.save, plot), f"plot.{kind}", kinds)

    def save(self, plot: PlotView, path: Path) -> None:
        """Save a plot in the format of the path's ending."""
        try:
            if path.suffix == ".svg":
                save.save_svg(plot, path)
            elif path.suffix == ".png":
                save.save_png(plot, path)
            elif isinstance(plot, TimeStack):
                save.save_csv(plot, path)
            elif isinstance(plot, PlainPlot):
                save.save_columns(plot.columns.items(), path)
            else:
                raise OSError(f"{path}: this plot has no samples to save")
        except (OSError, RecordingError) as error:
            self._panels.say(f"The plot was not saved: {error}", Tone.BAD)
        else:
            self._panels.say(f"Plot saved as {path}", Tone.GOOD)


DOCS = Path(__file__).resolve().parents[3] / "docs"


def _steps(p: Layout) -> tuple[Step, ...]:
    """Return the callouts of the tour."""
    return (
        Step(
            p.controls.arm,
            "Press ARM",
            "Nothing needs to be plugged in: the simulated bench pushes its block by itself. Press ARM (space) "
            "and the next push becomes a shot. You can do it now; the tour stays.",
        ),
        Step(
            p.banner,
            "The state, and what to do",
            "One word, readable from afar: READY, ARMED, CAPTURED, ANALYSING, FAULT. Beside it: what to do.",
        ),
        Step(
            p.numbers,
            "The numbers of the shot",
            "Each with its standard uncertainty; hover to read how it was found, press Budget (B) for where "
            "the uncertainty comes from.",
        ),
        Step(
            p.table,
            "The session",
            "Every shot taken or opened. Select several to compare (Ctrl+3) or to diagnose (D): it says what "
            "the model lacks.",
        ),
        Step(
            p.work,
            "Your own rig",
            "Set-up (F3) finds a digitizer and checks its signals; Settings (F2) takes mass, air and "
            "wavelength; F1 shows every key.",
        ),
    )


class HelpPresenter(QObject):
    """Describes the tour and stores that it was seen; opens manual and log folder with the system's programs."""

    def __init__(self, store: SettingsStore, panels: Layout, log_folder: Path, parent: QObject) -> None:
        super().__init__(parent)
        self._store, self._panels, self._log_folder = store, panels, log_folder
        self.tour = panels.tour
        self.tour.steps = _steps(panels)
        self.tour.ended.connect(self._ended)

    def start_once(self) -> None:
        """Start the tour unless it was seen before."""
        if not self._store.settings.tour_done:
            self.tour.open()

    @Slot()
    def _ended(self) -> None:
        if not self._store.settings.tour_done:
            self._store.change({"tour_done": True})
        self._panels.controls.arm.setFocus()

    @Slot()
    def show_manual(self) -> None:
        """Open the tutorial if it is installed, else show a message."""
        tutorial = DOCS / "tutorial.md"
        if not tutorial.exists():
            tutorial = Path(str(resources.files("resources").joinpath("tutorial.md")))
        if tutorial.exists():
            self._open(tutorial)
        else:
            self._panels.say("The tutorial is not installed here; see the short tour (F4)", Tone.NEUTRAL)

    @Slot()
    def show_log(self) -> None:
        self._open(self._log_folder)

    def _open(self, path: Path) -> None:
        opened = QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))
        self._panels.say(f"{path}" if opened else f"No program opens it here; it is {path}", Tone.NEUTRAL)
