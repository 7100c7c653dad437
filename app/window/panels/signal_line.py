"""The line of signals before arming: beats, light switch, noise floor, disk."""

from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QSizePolicy, QWidget

from app.window.theme import MARKS, Colours, Tone
from app.window.widgets import text_label


@dataclass(frozen=True, slots=True)
class Sign:
    """The words of a tile, their tone, and a hover."""

    words: str
    tone: Tone
    hover: str = ""


TILES = (
    ("pd0", "PD0", "2.73012 MHz  41 dB"),
    ("pd1", "PD1", "2.73012 MHz  moving"),
    ("switch", "light switch", "interrupted"),
    ("floor", "noise floor", "0.08 µm/s at 10 kHz"),
    ("disk", "disk", "412 GB free"),
)


class SignalLine(QFrame):
    """Tiles of fixed width, and the folder of the shots."""

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("card", True)
        self._colours = colours
        self._signs: dict[str, Sign] = {}
        self._saving = ""  # where shots go, in words
        row = QHBoxLayout(self)
        row.setContentsMargins(6, 2, 6, 2)
        row.setSpacing(3)
        self._marks: dict[str, QLabel] = {}
        self._values: dict[str, QLabel] = {}
        for name, title, widest in TILES:
            mark, heading, value = QLabel(self), QLabel(title, self), QLabel("–", self)
            mark.setFixedWidth(self.fontMetrics().horizontalAdvance("✓M"))
            mark.setAlignment(Qt.AlignmentFlag.AlignCenter)
            heading.setProperty("faint", True)
            value.setMinimumWidth(self.fontMetrics().horizontalAdvance(widest) + 4)
            value.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            value.setAccessibleName(title)
            for widget in (mark, heading, value):
                row.addWidget(widget)
            row.addSpacing(4)
            self._marks[name], self._values[name] = mark, value
        self._folder = text_label("", self, faint=True)
        self._folder.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._folder.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        row.addWidget(self._folder, 1)
        for name, _, _ in TILES:
            self.show_sign(name, Sign("–", Tone.NEUTRAL))

    def text(self, name: str) -> str:
        """Return the words of a tile."""
        return self._values[name].text()

    def dress(self, colours: Colours) -> None:
        self._colours = colours
        for name, sign in self._signs.items():
            self._marks[name].setStyleSheet(f"color: {colours.signs[sign.tone]}; font-weight: bold")

    def show_sign(self, name: str, sign: Sign) -> None:
        """Show the words of a tile; touches only what changed."""
        before = self._signs.get(name)
        if before == sign:
            return
        self._signs[name] = sign
        self._values[name].setText(sign.words)
        self._values[name].setToolTip(sign.hover)
        self._values[name].setAccessibleDescription(f"{sign.words}. {sign.hover}")
        if before is None or before.tone is not sign.tone:
            self._marks[name].setText(MARKS[sign.tone])
            self._marks[name].setStyleSheet(f"color: {self._colours.signs[sign.tone]}; font-weight: bold")

    def show_folder(self, folder: str) -> None:
        """Show where shots are saved."""
        words = f"saving to {folder}" if folder else "not saving"
        if self._saving != words:
            self._saving = words
            self._folder.setToolTip(folder)
            self._fit_folder()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Shorten the folder in its middle, or leave it out where there is no room."""
        super().resizeEvent(event)
        self.layout().activate()
        self._fit_folder()

    def _fit_folder(self) -> None:
        metrics, room = self._folder.fontMetrics(), self._folder.width()
        enough = room >= metrics.horizontalAdvance("saving to /home …/data")
        self._folder.setText(metrics.elidedText(self._saving, Qt.TextElideMode.ElideMiddle, room) if enough else "")
