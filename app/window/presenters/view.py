"""Commands on pages, views, cursors and plots."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot
from PySide6.QtGui import QGuiApplication

from app.window.file_dialog import Want, ask
from app.window.layout import Layout
from app.window.plots import save
from app.window.plots.plain_plot import PlainPlot
from app.window.plots.plot_view import PlotView
from app.window.plots.time_stack import TimeStack
from app.window.theme import Tone
from instrument.files import RecordingError


class ViewPresenter(QObject):
    """Connects keys and menus with the panels; changes no data."""

    said = Signal(str, Tone)

    def __init__(self, panels: Layout, start: Callable[[], Path], parent: QObject) -> None:
        super().__init__(parent)
        self._panels = panels
        self._start = start  # the first folder of file dialogs
        self._folder: Path | None = None
        self._plot_to_save: PlotView | None = None
        p = panels
        for plot in panels.findChildren(PlotView):
            plot.export_wanted.connect(self._ask_and_save)
        p.model.details_wanted.connect(self.show_diagnosis)
        p.numbers.budget_wanted.connect(self.show_budget)
        p.work.keys_wanted.connect(self.toggle_keys)

    @Slot()
    def show_live(self) -> None:
        """Show the page LIVE."""
        self._panels.tabs.setCurrentIndex(Layout.LIVE)

    @Slot()
    def toggle_hold(self) -> None:
        """Freeze or resume the curves of LIVE."""
        self._panels.live.hold.toggle()

    @Slot()
    def toggle_noise_only(self) -> None:
        """Switch between combined and noise-only uncertainties."""
        self._panels.numbers.noise_only.toggle()

    @Slot()
    def show_shot_page(self) -> None:
        self._panels.tabs.setCurrentIndex(Layout.SHOT)

    @Slot()
    def show_compare(self) -> None:
        """Show the page COMPARE."""
        self._panels.tabs.setCurrentIndex(Layout.COMPARE)

    @Slot()
    def show_spectrum(self) -> None:
        """Show the page SPECTRUM."""
        self._panels.tabs.setCurrentIndex(Layout.SPECTRUM)

    @Slot()
    def show_diagnosis(self) -> None:
        """Show the page DIAGNOSIS."""
        self._panels.tabs.setCurrentIndex(Layout.DIAGNOSIS)

    @Slot()
    def show_budget(self) -> None:
        """Show the page BUDGET."""
        self._panels.tabs.setCurrentIndex(Layout.BUDGET)

    @Slot()
    def show_paper(self) -> None:
        """Show the page PAPER."""
        self._panels.tabs.setCurrentIndex(Layout.PAPER)

    @Slot()
    def show_large(self) -> None:
        """Show the page LARGE."""
        self._panels.tabs.setCurrentIndex(Layout.LARGE)

    @Slot()
    def view_whole(self) -> None:
        """Show the whole shot, or all of the overlaid ones."""
        if self._panels.tabs.currentIndex() == Layout.COMPARE:
            self._panels.compare.show_whole()
        else:
            self._view("whole")

    @Slot()
    def view_contact(self) -> None:
        """Show the first contact."""
        if self._panels.tabs.currentIndex() == Layout.COMPARE:
            self._panels.compare.show_contact()
        else:
            self._view("contact")

    @Slot()
    def view_deflection(self) -> None:
        """Show force against deflection."""
        self._view("deflection")

    @Slot()
    def view_gap(self) -> None:
        self._view("gap")

    @Slot()
    def view_raw(self) -> None:
        """Show the raw signals."""
        self._view("raw")

    def _view(self, name: str) -> None:
        self._panels.tabs.setCurrentIndex(Layout.SHOT)
        self._panels.shot.set_view(name)
        self._panels.shot.reset()

    def _plot(self) -> PlotView | None:
        """Return the plot that the keys act on; where the page has none, change to SHOT."""
        plot = self._panels.plot_in_front()
        if plot is None:
            self.show_shot_page()
            plot = self._panels.plot_in_front()
        return plot

    @Slot()
    def reset_view(self) -> None:
        """Reset the plot."""
        plot = self._plot()
        if plot is not None:
            plot.reset()

    @Slot()
    def view_back(self) -> None:
        """Show the previous view of the plot."""
        self._step_view(-1)

    @Slot()
    def view_forward(self) -> None:
        """Show the next view of the plot."""
        self._step_view(1)

    def _step_view(self, by: int) -> None:
        plot = self._plot()
        if plot is not None and not plot.step_view(by):
            self.said.emit("No previous view" if by < 0 else "No next view", Tone.NEUTRAL)

    @Slot()
    def toggle_cursors(self) -> None:
        """Turn the cursors of the plot on or off."""
        plot = self._plot()
        if plot is not None:
            plot.toggle_cursors()

    @Slot()
    def copy_cursors(self) -> None:
        """Copy the cursor readings of the plot."""
        plot = self._plot()
        if plot is not None and plot.cursors.shown:
            plot.copy_cursors()
            self.said.emit("The cursor readings are on the clipboard", Tone.NEUTRAL)

    @Slot()
    def copy_plot(self) -> None:
        """Copy the plot as a picture."""
        plot = self._plot()
        if plot is not None:
            QGuiApplication.clipboard().setImage(save.picture(plot))
            self.said.emit("The plot is on the clipboard as a picture", Tone.NEUTRAL)

    @Slot()
    def plot_menu(self) -> None:
        plot = self._plot()
        if plot is not None:
            plot.open_menu()

    @Slot()
    def toggle_keys(self) -> None:
        """Show or hide the sheet of keys."""
        sheet = self._panels.keys
        sheet.setVisible(not sheet.isVisible())
        if sheet.isVisible():
            sheet.place()

    @Slot(object, str)
    def _ask_and_save(self, plot: PlotView, kind: str) -> None:
        start, kinds = (self._folder or self._start()) / f"plot.{kind}", f"{kind.upper()} (*.{kind})"
        self._plot_to_save = plot
        ask(self._panels, f"Save the plot as {kind.upper()}", Want.NEW_FILE, self._save_asked, start, kinds)

    def _save_asked(self, paths: list[Path]) -> None:
        if self._plot_to_save is not None:
            self.save(self._plot_to_save, paths[0])

    def save(self, plot: PlotView, path: Path) -> None:
        """Save a plot in the format of the path's ending."""
        self._folder = path.parent
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
