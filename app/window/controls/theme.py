"""Colour schemes (dark and light), palette, style sheet and fonts of the window."""

from dataclasses import asdict, dataclass
from enum import StrEnum
from string import Template

from PySide6.QtCore import QObject, Qt, Signal, Slot
from PySide6.QtGui import QColor, QFont, QGuiApplication, QPalette
from PySide6.QtWidgets import QApplication


class Tone(StrEnum):
    """The meaning of a colour; a word or a mark always shows the same meaning."""

    NEUTRAL = "neutral"
    WAITING = "waiting"
    BUSY = "busy"
    GOOD = "good"
    WARNING = "warning"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class Colours:
    """A colour scheme; text on ``panel`` and on every tone has a contrast of at least 4.5 to 1."""

    window: str
    panel: str
    plot: str
    text: str
    faint: str  # secondary text
    edge: str
    grid: str
    accent: str
    accent_text: str
    measured: str
    simulated: str
    residual: str
    band: str  # opaque, because half-transparent fills reduce the frame rate
    band_edge: str
    marker: str
    cursor_a: str
    cursor_b: str
    tones: dict[Tone, tuple[str, str]]  # (background, text)
    signs: dict[Tone, str]  # text colour of each tone on the panel
    series: tuple[str, ...]  # overlaid shots; none resembles ``simulated``


LIGHT = Colours(
    window="#eef0f3",
    panel="#ffffff",
    plot="#ffffff",
    text="#14181d",
    faint="#56606c",
    edge="#c6ccd4",
    grid="#e9ecf0",
    accent="#1b5fa8",
    accent_text="#ffffff",
    measured="#1a2733",
    simulated="#f0803c",
    residual="#1b5fa8",
    band="#d5dde8",
    band_edge="#8497b0",
    marker="#7a8694",
    cursor_a="#7a2bb5",
    cursor_b="#0b7a53",
    tones={
        Tone.NEUTRAL: ("#3d4a58", "#ffffff"),
        Tone.WAITING: ("#f5b400", "#1c1500"),
        Tone.BUSY: ("#1b5fa8", "#ffffff"),
        Tone.GOOD: ("#15703f", "#ffffff"),
        Tone.WARNING: ("#f5b400", "#1c1500"),
        Tone.BAD: ("#b3161b", "#ffffff"),
    },
    signs={
        Tone.NEUTRAL: "#56606c",
        Tone.WAITING: "#7d5a00",
        Tone.BUSY: "#1b5fa8",
        Tone.GOOD: "#15703f",
        Tone.WARNING: "#7d5a00",
        Tone.BAD: "#b3161b",
    },
    series=("#1b5fa8", "#a3195b", "#15703f", "#7a2bb5", "#6b7600", "#0f7f8c", "#14181d", "#4a5563"),
)

DARK = Colours(
    window="#14181d",
    panel="#1d232a",
    plot="#101418",
    text="#e8edf2",
    faint="#a3afbc",
    edge="#3a444f",
    grid="#222a32",
    accent="#5aa9ff",
    accent_text="#06121f",
    measured="#dfe7ee",
    simulated="#ff8a4c",
    residual="#5aa9ff",
    band="#2b3744",
    band_edge="#6d86a3",
    marker="#8793a0",
    cursor_a="#d39bff",
    cursor_b="#5fdcaa",
    tones={
        Tone.NEUTRAL: ("#45525f", "#ffffff"),
        Tone.WAITING: ("#ffc533", "#1c1500"),
        Tone.BUSY: ("#1f6fc4", "#ffffff"),
        Tone.GOOD: ("#1a7f49", "#ffffff"),
        Tone.WARNING: ("#ffc533", "#1c1500"),
        Tone.BAD: ("#c8252b", "#ffffff"),
    },
    signs={
        Tone.NEUTRAL: "#a3afbc",
        Tone.WAITING: "#ffc533",
        Tone.BUSY: "#5aa9ff",
        Tone.GOOD: "#5fdc98",
        Tone.WARNING: "#ffc533",
        Tone.BAD: "#ff7d7d",
    },
    series=("#5aa9ff", "#ff7fb2", "#5fdc98", "#d39bff", "#d9e04a", "#4fd3e0", "#ffffff", "#b4bec9"),
)

MARKS = {
    Tone.NEUTRAL: "○",
    Tone.WAITING: "◔",
    Tone.BUSY: "◔",
    Tone.GOOD: "✓",
    Tone.WARNING: "!",
    Tone.BAD: "✗",
}


def sized(font: QFont, factor: float, bold: bool = False) -> QFont:
    """Return the font scaled relative to its present size, which follows the system's."""
    scaled = QFont(font)
    if font.pointSizeF() > 0:
        scaled.setPointSizeF(font.pointSizeF() * factor)
    else:
        scaled.setPixelSize(round(font.pixelSize() * factor))
    scaled.setBold(bold)
    return scaled


def palette(colours: Colours) -> QPalette:
    """Return the Qt palette of a colour scheme."""
    result = QPalette()
    role = QPalette.ColorRole
    for which, colour in (
        (role.Window, colours.window),
        (role.WindowText, colours.text),
        (role.Base, colours.panel),
        (role.AlternateBase, colours.window),
        (role.Text, colours.text),
        (role.Button, colours.panel),
        (role.ButtonText, colours.text),
        (role.BrightText, colours.text),
        (role.ToolTipBase, colours.panel),
        (role.ToolTipText, colours.text),
        (role.PlaceholderText, colours.faint),
        (role.Highlight, colours.accent),
        (role.HighlightedText, colours.accent_text),
        (role.Link, colours.accent),
        (role.Mid, colours.edge),
        (role.Dark, colours.edge),
        (role.Accent, colours.accent),
    ):
        result.setColor(which, QColor(colour))
    for which in (role.WindowText, role.Text, role.ButtonText):
        faded = QColor(colours.faint)
        faded.setAlpha(150)
        result.setColor(QPalette.ColorGroup.Disabled, which, faded)
    return result


def style_sheet(colours: Colours) -> str:
    """Return the style sheet of a colour scheme, with what a palette cannot express."""
    neutral, neutral_text = colours.tones[Tone.NEUTRAL]
    tones = "".join(f'QLabel[tone="{tone}"] {{ color: {colour}; }}\n' for tone, colour in colours.signs.items())
    return _STYLE.substitute(asdict(colours), neutral=neutral, neutral_text=neutral_text) + tones


_STYLE = Template("""
QToolTip { color: $text; background: $panel; border: 1px solid $edge; padding: 4px; }
QFrame[card="true"] { background: $panel; border: 1px solid $edge; border-radius: 6px; }
QFrame#tour { background: $panel; border: 2px solid $accent; border-radius: 8px; }
QFrame#ring { border: 3px solid $accent; border-radius: 8px; }
QWidget[panel="true"] { background: $panel; }
QLabel[faint="true"] { color: $faint; }
QLabel[quantity="true"][tone="warning"] { font-weight: bold; }
QLabel[heading="true"] { color: $faint; font-weight: bold; letter-spacing: 1px; }
QPushButton, QToolButton { padding: 4px 9px; border: 1px solid $edge; border-radius: 5px;
    background: $panel; color: $text; }
QFileDialog QToolButton, QTabBar QToolButton { padding: 2px; }
QPushButton:hover, QToolButton:hover { border-color: $accent; }
QPushButton:focus, QToolButton:focus { border: 2px solid $accent; padding: 3px 8px; }
QPushButton:pressed, QToolButton:pressed { background: $edge; }
QPushButton:checked, QToolButton:checked { background: $neutral; color: $neutral_text; }
QPushButton:disabled, QToolButton:disabled { color: $marker;
    background: $window; }
QPushButton[primary="true"] { background: $accent; color: $accent_text; font-weight: bold;
    border-color: $accent; }
QPushButton[primary="true"]:focus { border: 2px solid $text; }
QPushButton[primary="true"]:disabled { background: $window; color: $marker;
    border-color: $edge; }
QLineEdit { padding: 3px 5px; border: 1px solid $marker; border-radius: 4px;
    background: $plot; }
QLineEdit:focus { border: 2px solid $accent; padding: 2px 4px; }
QTableView QLineEdit, QTreeView QLineEdit { padding: 0 2px; border-radius: 0; }
QGraphicsView { border: 1px solid $plot; }
QGraphicsView:focus { border: 1px solid $accent; }
QTabBar::tab { padding: 6px 5px; border: none; border-bottom: 3px solid transparent; color: $faint;
    background: transparent; font-weight: bold; font-size: 0.92em; }
QTabBar::tab:selected { color: $text; border-bottom: 3px solid $accent; }
QTabBar::tab:focus { color: $accent; }
QTabBar { qproperty-drawBase: 0; }
QCheckBox::indicator { width: 0.9em; height: 0.9em; border: 1px solid $marker; border-radius: 3px;
    background: $panel; }
QCheckBox::indicator:checked { background: $accent; border: 3px solid $panel;
    outline: 1px solid $accent; width: 0.65em; height: 0.65em; }
QCheckBox::indicator:focus { border-color: $accent; }
QTabWidget::pane { border: none; border-top: 1px solid $edge; }
QHeaderView::section { background: $window; color: $faint; border: none;
    border-bottom: 1px solid $edge; padding: 4px 8px; }
QTableView { border: none; gridline-color: $edge; selection-background-color: $accent;
    selection-color: $accent_text; alternate-background-color: $window; }
QTableView::item { padding: 0 6px; }
QTableView::item:selected { background: $accent; color: $accent_text; }
QTreeView::item { padding: 2px 4px; }
QScrollBar { background: $panel; border: none; }
QScrollBar:vertical { width: 12px; }
QScrollBar:horizontal { height: 12px; }
QScrollBar::handle { background: $edge; border-radius: 4px; margin: 2px; }
QScrollBar::handle:vertical { min-height: 28px; }
QScrollBar::handle:horizontal { min-width: 28px; }
QScrollBar::handle:hover { background: $marker; }
QScrollBar::add-line, QScrollBar::sub-line, QScrollBar::add-page, QScrollBar::sub-page { background: none;
    width: 0; height: 0; }
QScrollArea, QScrollArea > QWidget { border: none; background: $panel; }
QSplitter::handle { background: $edge; }
QSplitter::handle:horizontal { width: 3px; }
QSplitter::handle:vertical { height: 3px; }
QProgressBar { border: 1px solid $edge; border-radius: 4px; text-align: center;
    background: $window; color: $text; min-height: 1.2em; }
QProgressBar::chunk { background: $band; border-radius: 3px; }
""")


class Themed:
    """Mixin of widgets that paint themselves in the theme's colours instead of using the style sheet."""

    colours = LIGHT

    def apply_colours(self, colours: Colours) -> None:
        """Set the colours in which the widget draws."""
        self.colours = colours


class Theme(QObject):
    """The colour scheme in use: the chosen one, else the system's."""

    changed = Signal()

    def __init__(self, choice: str) -> None:
        super().__init__()
        self._choice = choice
        self.colours = LIGHT
        QGuiApplication.styleHints().colorSchemeChanged.connect(self._apply)
        self._apply()

    @Slot(str)
    def choose(self, choice: str) -> None:
        """Choose the scheme: "system", "dark" or "light"."""
        self._choice = choice
        self._apply()

    @Slot()
    def _apply(self) -> None:
        system_dark = QGuiApplication.styleHints().colorScheme() == Qt.ColorScheme.Dark
        dark = self._choice == "dark" or (self._choice == "system" and system_dark)
        self.colours = DARK if dark else LIGHT
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.setPalette(palette(self.colours))
            sheet = style_sheet(self.colours)
            if application.styleSheet() != sheet:  # setting it takes 2 s while a window is open
                application.setStyleSheet(sheet)
        self.changed.emit()
