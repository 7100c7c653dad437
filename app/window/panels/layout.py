"""Create and arrange the panels of the window; save and restore geometry and splitters as text."""

from PySide6.QtCore import QByteArray, QRect, QSize, Qt, Slot
from PySide6.QtGui import QResizeEvent, QWheelEvent
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QMainWindow,
    QSizePolicy,
    QSplitter,
    QStyle,
    QTabBar,
    QTabWidget,
    QWidget,
)

from app.session import note
from app.window.controls.theme import Theme, Themed, Tone
from app.window.controls.widgets import Sheet, vertical
from app.window.panels.compare import ComparePanel
from app.window.panels.diagnosis import DiagnosisPanel
from app.window.panels.help import AboutSheet, KeySheet, Tour
from app.window.panels.large import LargePanel
from app.window.panels.law import LawSheet
from app.window.panels.live import LivePanel
from app.window.panels.mapping_sheet import MappingSheet
from app.window.panels.model import ModelPanel
from app.window.panels.numbers import NumbersPanel
from app.window.panels.rig import Banner, Controls, SignalLine
from app.window.panels.session_table import SessionTable
from app.window.panels.settings_sheet import SettingsSheet
from app.window.panels.setup_sheet import SetupSheet
from app.window.panels.shot import ShotPanel
from app.window.panels.spectrum import SpectrumPanel
from app.window.panels.tables import BudgetPanel, PaperPanel
from app.window.panels.work_line import NoticeList, WorkLine
from app.window.plots.plot_view import PlotView, in_front


class Layout(QWidget):
    """All panels of the window, and the sheets that open above them."""

    PAGES = ("LIVE", "SHOT", "COMPARE", "SPECTRUM", "DIAGNOSIS", "BUDGET", "PAPER", "LARGE")
    LIVE, SHOT, COMPARE, SPECTRUM, DIAGNOSIS, BUDGET, PAPER, LARGE = range(len(PAGES))

    def __init__(self, theme: Theme, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._number: int | None = None  # number of the last selected shot
        self.controls = Controls(self)
        self.banner = Banner(self)
        self.signals = SignalLine(self)
        self.live = LivePanel(self)
        self.shot = ShotPanel(self)
        self.compare = ComparePanel(self)
        self.spectrum = SpectrumPanel(self)
        self.diagnosis = DiagnosisPanel(self)
        self.budget = BudgetPanel(self)
        self.paper = PaperPanel(self)
        self.large = LargePanel(self)
        self.numbers = NumbersPanel(self)
        self.model = ModelPanel(self)
        self.table = SessionTable(self)
        self.work = WorkLine(self)
        self.tabs = QTabWidget(self)
        self.tabs.setTabBar(_NoWheelTabBar(self.tabs))
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName("Pages")
        # a fixed least width, so that no page widens the window
        self.tabs.setMinimumWidth(44 * self.fontMetrics().horizontalAdvance("M"))
        for name in self.PAGES:
            index = self.tabs.addTab(getattr(self, name.lower()), name)
            self.tabs.setTabToolTip(index, f"{name}  (Ctrl+{index + 1})")
        self._place()
        self.settings = SettingsSheet(self)
        self.setup = SetupSheet(self)
        self.mapping = MappingSheet(self)
        self.law = LawSheet(self)
        self.keys = KeySheet(self)
        self.about = AboutSheet(self)
        self.messages = NoticeList(self.work.notices, self)
        self.tour = Tour(self)
        self._theme = theme
        self.apply_colours()

    def _place(self) -> None:
        column = vertical(self, (6, 4, 6, 4), 4)
        top = QHBoxLayout()
        top.setSpacing(10)
        top.addWidget(self.controls)
        top.addWidget(self.banner, 1)
        column.addLayout(top)
        column.addWidget(self.signals)
        side = QFrame(self)
        side.setProperty("card", True)
        side_column = vertical(side, (1, 1, 1, 1), 0)
        side_column.addWidget(self.numbers, 1)
        side_column.addWidget(self.model)
        side.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)
        across = self.across = QSplitter(Qt.Orientation.Horizontal, self)
        across.addWidget(self.tabs)
        across.addWidget(side)
        across.setSizes([1400, 430])  # for a large screen; on a small one the numbers get their least width
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
    def apply_colours(self) -> None:
        """Apply the theme's colours to all widgets that draw themselves."""
        for widget in self.findChildren(QWidget):
            if isinstance(widget, Themed):
                widget.apply_colours(self._theme.colours)

    def name_shot(self, number: int | None) -> None:
        """Show the number of the selected shot in the tab SHOT if there is room."""
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
        """Return the plot on which the keys act: the focused one of the current page, else its first, else None."""
        page = self.tabs.currentWidget()
        if isinstance(page, LivePanel | ComparePanel | SpectrumPanel):
            return in_front(page.plots)
        return page.plot_in_front() if isinstance(page, ShotPanel | DiagnosisPanel) else None

    def say(self, words: str, tone: Tone) -> None:
        """Show a message in the status line, and write it to the log."""
        note(words)
        self.work.notices.say(words, tone)

    def place_sheets(self) -> None:
        for sheet in self.findChildren(Sheet):
            if sheet.isVisible():
                sheet.place()


class _NoWheelTabBar(QTabBar):
    """A tab bar that ignores the mouse wheel."""

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.accept()


def state_text(window: QMainWindow, panels: Layout) -> str:
    """Return geometry, splitter and header states as base64 text, one word per part."""
    parts = [window.saveGeometry(), *(splitter.saveState() for splitter in (panels.across, panels.down))]
    parts.append(panels.table.table.horizontalHeader().saveState())
    return " ".join(bytes(part.toBase64().data()).decode("ascii") for part in parts)


def restore_state(window: QMainWindow, panels: Layout, words: str) -> None:
    """Restore the state in a text of ``state_text``; invalid text changes nothing.  Qt selects an existing screen."""
    splitters = (panels.across, panels.down)
    parts = [QByteArray.fromBase64(word.encode("ascii", "replace")) for word in words.split()]
    if len(parts) != len(splitters) + 2:
        return
    window.restoreGeometry(parts[0])
    for splitter, part in zip(splitters, parts[1:-1], strict=True):
        splitter.restoreState(part)
    header = panels.table.table.horizontalHeader()
    header.restoreState(parts[-1])
    header.setSortIndicatorClearable(True)  # not in states saved by earlier versions
    header.setSortIndicator(-1, Qt.SortOrder.AscendingOrder)


USUAL = QSize(1480, 920)
TITLE_PX = 40  # assumed height of the title bar before the system has drawn it


def first_size(window: QMainWindow) -> QSize:
    """Return the window size for the first start: ``USUAL``, reduced to fit the screen."""
    title = max(TITLE_PX, window.style().pixelMetric(QStyle.PixelMetric.PM_TitleBarHeight))
    border = 2 * window.style().pixelMetric(QStyle.PixelMetric.PM_MdiSubWindowFrameWidth)
    room = window.screen().availableSize() - QSize(border, title + border)
    return USUAL.boundedTo(room)


def placed(inner: QRect, frame: QRect, room: QRect) -> QRect:
    """Return a window's inner rectangle, moved and shrunk so that its frame is within ``room``."""
    if room.contains(frame):
        return inner
    wider, higher = frame.width() - inner.width(), frame.height() - inner.height()
    size = inner.size().boundedTo(room.size() - QSize(wider, higher))
    left = min(max(frame.left(), room.left()), room.right() + 1 - size.width() - wider)
    top = min(max(frame.top(), room.top()), room.bottom() + 1 - size.height() - higher)
    return QRect(left + inner.left() - frame.left(), top + inner.top() - frame.top(), size.width(), size.height())


def keep_within_screen(window: QMainWindow) -> None:
    """Move and shrink a visible window so that its frame is on the screen."""
    if window.isMaximized() or window.isFullScreen() or not window.isVisible():
        return
    inner = window.geometry()
    wanted = placed(inner, window.frameGeometry(), window.screen().availableGeometry())
    if wanted != inner:
        window.setGeometry(wanted)
