"""The state of the instrument, readable from two metres: word, sign, colour, and what to do."""

from PySide6.QtCore import Qt, QTimer, Signal, Slot
from PySide6.QtGui import QFontMetrics, QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from app.window.theme import Colours, Tone, sized

SIGNS = {
    Tone.NEUTRAL: "■",
    Tone.WAITING: "◉",
    Tone.BUSY: "▶",
    Tone.GOOD: "✓",
    Tone.WARNING: "!",
    Tone.BAD: "✗",
}
FLASH_MS = 400  # one slow change, no flicker
FACTORS = (1.15, 1.0, 0.85)  # of the system's font, for the sentence


class Banner(QFrame):
    """The banner; its parts keep their places when the words change."""

    save_wanted = Signal()

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        self._tone = Tone.NEUTRAL
        self._flashing = QTimer(self)
        self._flashing.setSingleShot(True)
        self._flashing.setInterval(FLASH_MS)
        self._flashing.timeout.connect(self._flashed)
        self.setObjectName("banner")
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 4, 12, 4)
        row.setSpacing(8)
        self._sign = QLabel(self)
        self._word = QLabel(self)
        self._detail = QLabel(self)
        self._clock = QLabel(self)
        self._sign.setFont(sized(self.font(), 2.3, bold=True))
        self._word.setFont(sized(self.font(), 2.3, bold=True))
        self._clock.setFont(sized(self.font(), 1.6, bold=True))
        self._detail.setFont(sized(self.font(), 1.15))
        self._detail.setWordWrap(True)
        self._detail.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._sign.setFixedWidth(self._sign.fontMetrics().horizontalAdvance("◉◉"))
        self._sign.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._word.setMinimumWidth(self._word.fontMetrics().horizontalAdvance("ANALYSING"))
        self._clock.setFixedWidth(self._clock.fontMetrics().horizontalAdvance("00:00 "))
        self._clock.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        column = QVBoxLayout()
        column.setSpacing(0)
        row.addWidget(self._sign)
        row.addWidget(self._word)
        row.addWidget(self._detail, 1)
        self.save_elsewhere = QPushButton("Save elsewhere …", self)
        self.save_elsewhere.setToolTip("Save the shots that are only in memory to another folder  (Ctrl+S)")
        self.save_elsewhere.setMinimumHeight(int(2.2 * self.fontMetrics().height()))
        self.save_elsewhere.clicked.connect(self.save_wanted)
        self.save_elsewhere.hide()
        row.addWidget(self.save_elsewhere)
        row.addWidget(self._clock)
        self._detail.setMinimumWidth(self.fontMetrics().horizontalAdvance("M") * 12)
        self.setFixedHeight(max(self._word.sizeHint().height() + 8, 3 * self.fontMetrics().lineSpacing() + 8))
        self.setAccessibleName("State of the instrument")
        self.show_state("READY", "", Tone.NEUTRAL)

    @property
    def word(self) -> str:
        return self._word.text()

    @property
    def detail(self) -> str:
        return self._detail.text()

    @property
    def tone(self) -> Tone:
        return self._tone

    def dress(self, colours: Colours) -> None:
        self._colours = colours
        background, text = colours.tones[self._tone]
        if self._flashing.isActive():
            background, text = text, background
        self.setStyleSheet(
            f"#banner {{ background: {background}; border-radius: 6px; }} #banner QLabel {{ color: {text}; }}"
        )

    @Slot()
    def flash(self) -> None:
        """Exchange text and background colour for a moment."""
        self._flashing.start()
        self.dress(self._colours)

    @property
    def flashing(self) -> bool:
        return self._flashing.isActive()

    @Slot()
    def _flashed(self) -> None:
        self.dress(self._colours)

    def offer_saving(self, unsaved: int) -> None:
        """Show the button that saves to another folder while shots are only in memory."""
        if self.save_elsewhere.isHidden() == (unsaved > 0):
            self.save_elsewhere.setVisible(unsaved > 0)
            self._clock.setVisible(unsaved == 0)  # the words need its room
            self._fit()
        words = f"Save {unsaved} shot{'s' if unsaved > 1 else ''} elsewhere …"
        if unsaved and self.save_elsewhere.text() != words:
            self.save_elsewhere.setText(words)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Choose the largest font in which the whole sentence fits."""
        self.layout().activate()
        room = self.contentsRect().height() - 8
        for factor in FACTORS:
            font = sized(self.font(), factor)
            flags = Qt.TextFlag.TextWordWrap.value
            needed = QFontMetrics(font).boundingRect(0, 0, self._detail.width(), 10_000, flags, self._detail.text())
            if needed.height() <= room or factor == FACTORS[-1]:
                if self._detail.font() != font:
                    self._detail.setFont(font)
                return

    def show_state(self, word: str, detail: str, tone: Tone, clock: str = "") -> None:
        """Show a state; called 28 times a second, it touches only what changed."""
        if tone is not self._tone or not self._sign.text():
            self._tone = tone
            self._sign.setText(SIGNS[tone])
            self.dress(self._colours)
        if word != self._word.text() or detail != self._detail.text():
            self._word.setText(word)
            self._detail.setText(detail)
            self._detail.setToolTip(detail)
            self.setAccessibleDescription(f"{word}. {detail}")
            self._fit()
        if clock != self._clock.text():
            self._clock.setText(clock)
