"""What a person reads or presses in a panel, found in its widgets."""

from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton, QTableView

from app.session.entry import Entry
from app.session.session import Session
from app.window.panels.compare import TrendPlot
from app.window.panels.effects import EffectRows
from app.window.panels.large import LargePanel
from app.window.panels.next_steps import NextSteps
from app.window.panels.setup_sheet import SetupSheet
from app.window.plots.framed_plot import Caption
from app.window.plots.plot_notes import PlotNotes


def caption_words(caption: Caption) -> str:
    """Return the words in a plot's corner, "" while the axis shows them."""
    return str(caption.toPlainText()) if caption.isVisible() else ""


def check_lines(sheet: SetupSheet) -> list[str]:
    """Return the lines on the signals."""
    return [line.text() for line in sheet._lines if line.text()]


def use_buttons(sheet: SetupSheet) -> list[QPushButton]:
    """Return the buttons that choose a device, from top to bottom."""
    widgets = [sheet._devices.itemAt(index).widget() for index in range(sheet._devices.count())]
    return [widget for widget in widgets if isinstance(widget, QPushButton)]


def click_head(table: QTableView, column: int) -> None:
    """Click the heading of a column."""
    header = table.horizontalHeader()
    place = QPoint(header.sectionViewportPosition(column) + header.sectionSize(column) // 2, header.height() // 2)
    QTest.mouseClick(header.viewport(), Qt.MouseButton.LeftButton, pos=place)


def large_text(panel: LargePanel, name: str) -> str:
    """Return what LARGE shows for a number."""
    cells: list[tuple[QLabel, QLabel, QLabel]] = panel._cells
    return next(value.text() for label, value, _ in cells if label.text() == name)


def effect_button(rows: EffectRows, key: str) -> QPushButton:
    """Return the button that adds or removes an effect."""
    return next(button for button in rows._buttons() if button.property("effect") == key)


def next_buttons(steps: NextSteps) -> list[QPushButton]:
    """Return the buttons below NEXT STEP, from the left."""
    widgets = (steps._row.itemAt(place).widget() for place in range(steps._row.count()))
    return [widget for widget in widgets if isinstance(widget, QPushButton)]


def notes_drawn(notes: PlotNotes) -> list[tuple[str, float, float]]:
    """Return text and place, in the plot's units, of the notes that are drawn."""
    return [(drawn.note.text, *drawn.place) for drawn in notes._drawn]


def trend_points(trend: TrendPlot) -> list[tuple[float, float]]:
    """Return speed and number of each shot in a trend."""
    return list(zip(*[*trend.columns.values()][:2], strict=True))


def read_entries(session: Session) -> tuple[Entry, ...]:
    """Return the entries whose shot was read, with or without success."""
    return tuple(entry for entry in session.entries if entry.shot is not None)
