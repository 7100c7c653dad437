"""The arrangement of the panels in the window; presenters connect them."""

from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QResizeEvent, QWheelEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QSizePolicy, QSplitter, QTabBar, QTabWidget, QVBoxLayout, QWidget

from app.window.panels.about_sheet import AboutSheet
from app.window.panels.banner import Banner
from app.window.panels.budget import BudgetPanel
from app.window.panels.compare import ComparePanel
from app.window.panels.controls import Controls
from app.window.panels.diagnosis import DiagnosisPanel
from app.window.panels.key_sheet import KeySheet
from app.window.panels.large import LargePanel
from app.window.panels.law_sheet import LawSheet
from app.window.panels.live import LivePanel
from app.window.panels.mapping_sheet import MappingSheet
from app.window.panels.model import ModelPanel
from app.window.panels.notice import NoticeList
from app.window.panels.numbers import NumbersPanel
from app.window.panels.paper import PaperPanel
from app.window.panels.session_table import SessionTable
from app.window.panels.settings_sheet import SettingsSheet
from app.window.panels.setup_sheet import SetupSheet
from app.window.panels.shot import ShotPanel
from app.window.panels.signal_line import SignalLine
from app.window.panels.spectrum import SpectrumPanel
from app.window.panels.tour import Tour
from app.window.panels.work_line import WorkLine
from app.window.plots.plot_view import PlotView
from app.window.theme import Theme


class Layout(QWidget):
    """All panels; the sheets lie above them and are hidden at first."""

    LIVE, SHOT, COMPARE, SPECTRUM, DIAGNOSIS, BUDGET, PAPER, LARGE = range(8)

    def __init__(self, theme: Theme, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._number: int | None = None  # of the last selected shot
        c = theme.colours
        self.controls = Controls(self)
        self.banner = Banner(c, self)
        self.signals = SignalLine(c, self)
        self.live = LivePanel(c, self)
        self.shot = ShotPanel(c, self)
        self.compare = ComparePanel(c, self)
        self.spectrum = SpectrumPanel(c, self)
        self.diagnosis = DiagnosisPanel(c, self)
        self.budget = BudgetPanel(self)
        self.paper = PaperPanel(c, self)
        self.large = LargePanel(c, self)
        self.numbers = NumbersPanel(c, self)
        self.model = ModelPanel(c, self)
        self.table = SessionTable(self)
        self.work = WorkLine(c, self)
        self.tabs = SteadyTabs(self)
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName("Pages")
        # no page may widen the window
        self.tabs.setMinimumWidth(44 * self.fontMetrics().horizontalAdvance("M"))
        for name, page in (
            ("LIVE", self.live),
            ("SHOT", self.shot),
            ("COMPARE", self.compare),
            ("SPECTRUM", self.spectrum),
            ("DIAGNOSIS", self.diagnosis),
            ("BUDGET", self.budget),
            ("PAPER", self.paper),
            ("LARGE", self.large),
        ):
            index = self.tabs.addTab(page, name)
            self.tabs.setTabToolTip(index, f"{name}  (Ctrl+{index + 1})")
        self._place()
        self.settings = SettingsSheet(c, self)
        self.setup = SetupSheet(c, self)
        self.mapping = MappingSheet(c, self)
        self.law = LawSheet(c, self)
        self.keys = KeySheet(self)
        self.about = AboutSheet(self)
        self.messages = NoticeList(self.work.notices, c, self)
        self.tour = Tour(c, self)
        self._theme = theme

    def _place(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 4, 6, 4)
        column.setSpacing(4)
        top = QHBoxLayout()
        top.setSpacing(10)
        top.addWidget(self.controls)
        top.addWidget(self.banner, 1)
        column.addLayout(top)
        column.addWidget(self.signals)
        side = QFrame(self)
        side.setProperty("card", True)
        side_column = QVBoxLayout(side)
        side_column.setContentsMargins(1, 1, 1, 1)
        side_column.setSpacing(0)
        side_column.addWidget(self.numbers, 1)
        side_column.addWidget(self.model)
        side.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)
        across = self.across = QSplitter(Qt.Orientation.Horizontal, self)
        across.addWidget(self.tabs)
        across.addWidget(side)
        across.setSizes([1400, 430])  # of a large screen; on a small one the numbers take the least they need
        across.setStretchFactor(0, 1)
        across.setStretchFactor(1, 0)
        across.setChildrenCollapsible(False)
        across.splitterMoved.connect(self._rename)
        down = self.down = QSplitter(Qt.Orientation.Vertical, self)
        down.addWidget(across)
        down.addWidget(self.table)
        down.setStretchFactor(0, 1)
        down.setStretchFactor(1, 0)
        down.setSizes([720, 150])
        down.setChildrenCollapsible(False)
        column.addWidget(down, 1)
        column.addWidget(self.work)

    @Slot()
    def dress(self) -> None:
        """Apply the theme's colours to every panel."""
        for panel in (
            self.banner,
            self.signals,
            self.live,
            self.shot,
            self.compare,
            self.spectrum,
            self.diagnosis,
            self.paper,
            self.large,
            self.numbers,
            self.model,
            self.work.notices,
            self.settings,
            self.setup,
            self.mapping,
            self.law,
            self.messages,
            self.tour,
        ):
            panel.dress(self._theme.colours)

    def name_shot(self, number: int | None) -> None:
        """Show the number of the selected shot in the tab SHOT, where there is room."""
        self._number = number
        bar = self.tabs.tabBar()
        self.tabs.setTabText(self.SHOT, "SHOT" if number is None else f"SHOT {number}")
        if sum(bar.tabSizeHint(index).width() for index in range(bar.count())) > self.tabs.width():
            self.tabs.setTabText(self.SHOT, "SHOT")

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._rename()

    @Slot()
    def _rename(self) -> None:
        self.name_shot(self._number)

    def plot_in_front(self) -> PlotView | None:
        """Return the plot that the keys act on: the focused one of the current page, else its first."""
        page = self.tabs.currentWidget()
        if isinstance(page, LivePanel | ShotPanel | ComparePanel | SpectrumPanel | DiagnosisPanel):
            return page.plot_in_front()
        return None

    def place_sheets(self) -> None:
        """Place the sheets after a change of size."""
        self.settings.place()
        self.setup.place()
        self.mapping.place()
        self.law.place()
        self.about.place()
        self.messages.place()
        self.tour.place()
        if self.keys.isVisible():
            self.keys.place()


class _Bar(QTabBar):
    def wheelEvent(self, event: QWheelEvent) -> None:
        event.accept()  # the wheel does not change pages


class SteadyTabs(QTabWidget):
    """Pages with tabs that a click or a key changes."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setTabBar(_Bar(self))
