"""Commands on pages, views, cursors and plots; saving of plots."""

from collections.abc import Callable
from functools import partial
from operator import attrgetter
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot
from PySide6.QtGui import QGuiApplication

from app.window.file_dialog import FileDialogs, PathKind
from app.window.layout import Layout
from app.window.plots import save
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.plot_view import PlotView
from app.window.plots.time_plot import TimeStack
from app.window.theme import Tone
from app.window.widgets import call_with
from instrument.files import RecordingError


class ViewPresenter(QObject):
    """Connects keys and menus with the panels; it changes no data."""

    said = Signal(str, Tone)

    def __init__(self, panels: Layout, start: Callable[[], Path], parent: QObject) -> None:
        super().__init__(parent)
        p = self._panels = panels
        self._dialogs = FileDialogs(panels, start)
        for plot in panels.findChildren(PlotView):
            plot.export_wanted.connect(self._ask_and_save)
        p.model.details.clicked.connect(partial(call_with, self.show_page, "DIAGNOSIS"))
        p.numbers.budget.clicked.connect(partial(call_with, self.show_page, "BUDGET"))
        p.shot.save_plot.clicked.connect(self.plot_menu)
        p.work.keys.clicked.connect(p.keys.toggle)
        p.work.notices.all.clicked.connect(p.messages.toggle)

    def toggle(self, name: str) -> None:
        """Open or close a sheet, or press a checkable button; ``name`` is its place in ``Layout``, as "live.hold"."""
        attrgetter(name)(self._panels).toggle()

    def show_page(self, name: str) -> None:
        """Show one of ``Layout.PAGES``."""
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

    @Slot()
    def reset_view(self) -> None:
        plot = self._plot()
        if plot is not None:
            plot.reset()

    @Slot()
    def view_back(self) -> None:
        self._step_view(-1)

    @Slot()
    def view_forward(self) -> None:
        self._step_view(1)

    def _step_view(self, by: int) -> None:
        plot = self._plot()
        if plot is not None and not plot.step_view(by):
            self.said.emit("No previous view" if by < 0 else "No next view", Tone.NEUTRAL)

    @Slot()
    def toggle_cursors(self) -> None:
        plot = self._plot()
        if plot is not None:
            plot.toggle_cursors()

    @Slot()
    def copy_cursors(self) -> None:
        plot = self._plot()
        if plot is not None and plot.cursors.shown:
            plot.copy_cursors()
            self.said.emit("The cursor readings are on the clipboard", Tone.NEUTRAL)

    @Slot()
    def copy_plot(self) -> None:
        plot = self._plot()
        if plot is not None:
            QGuiApplication.clipboard().setImage(save.picture(plot))
            self.said.emit("The plot is on the clipboard as a picture", Tone.NEUTRAL)

    @Slot()
    def plot_menu(self) -> None:
        plot = self._plot()
        if plot is not None:
            plot.open_menu()

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
                save.save_columns(plot.columns, path)
            else:
                raise OSError(f"{path}: this plot has no samples to save")
        except (OSError, RecordingError) as error:
            self.said.emit(f"The plot was not saved: {error}", Tone.BAD)
        else:
            self.said.emit(f"Plot saved as {path}", Tone.GOOD)
