"""The top of the window: rig controls, a state banner readable from two metres, and the signal line."""

from dataclasses import dataclass

from PySide6.QtCore import Qt, QTimer, Signal, Slot
from PySide6.QtGui import QFontMetrics, QResizeEvent
from PySide6.QtWidgets import QCheckBox, QComboBox, QFrame, QLabel, QWidget

from app.window.controls.commands import with_keys
from app.window.controls.theme import MARKS, Colours, Themed, Tone, sized
from app.window.controls.widgets import (
    added,
    combo_box,
    fill_box,
    horizontal,
    push_button,
    set_tone,
    text_label,
)
from app.words import DASH, counted


class Controls(QWidget):
    """The rig controls: list of sources, ARM, Abort, re-arm."""

    source_wanted = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        row = horizontal(self, (0, 0, 0, 0), 8)
        where = "Where the samples come from: the simulated bench, a recording, or a device"
        self.source = combo_box("Source of the samples", with_keys(where, "focus_source"), self)
        self.source.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.source.setMinimumContentsLength(19)  # for "Simulated bench with a flaw"
        hover = "Wait for the light switch and record the next shot"
        self.arm = push_button("ARM", hover, self, command="arm", primary=True)
        self.abort = push_button("Abort", "Stop waiting or recording; finished shots are kept", self, command="abort")
        for button, words in ((self.arm, "ARM"), (self.abort, "Abort")):
            button.setFont(sized(self.font(), 1.35, bold=True))
            button.setAccessibleName(words)
            button.setMinimumHeight(int(2.6 * self.fontMetrics().height()))
        self.arm.setMinimumWidth(self.fontMetrics().horizontalAdvance("M") * 8)
        self.abort.setMinimumWidth(self.fontMetrics().horizontalAdvance("M") * 6)
        self.source.setMinimumHeight(self.arm.minimumHeight())
        self.rearm = QCheckBox("re-arm", self)
        hover = "Arm again automatically after each shot, until Abort"
        self.rearm.setToolTip(with_keys(hover, "toggle:controls.rearm"))
        for widget in (self.source, self.arm, self.abort, self.rearm):
            row.addWidget(widget)
        self.source.activated.connect(self._chosen)

    def offer_sources(self, sources: list[tuple[str, str]], present: str) -> None:
        """List the sources, given as (name, displayed words); the present one is selected."""
        items = [(words, name) for name, words in sources]
        other = [(present, present)] if present not in dict(sources) else []
        fill_box(self.source, [*items, *other], present)

    def show_state(self, can_arm: bool, can_abort: bool) -> None:
        for widget, can in ((self.arm, can_arm), (self.abort, can_abort), (self.source, can_arm)):
            widget.setEnabled(can)

    @Slot(int)
    def _chosen(self, _: int) -> None:
        self.source_wanted.emit(str(self.source.currentData()))


SIGNS = {
    Tone.NEUTRAL: "■",
    Tone.WAITING: "◉",
    Tone.BUSY: "▶",
    Tone.GOOD: "✓",
    Tone.WARNING: "!",
    Tone.BAD: "✗",
}
FLASH_MS = 400  # long enough to be one slow change, not a flicker
FACTORS = (1.15, 1.0, 0.85)  # sizes of the sentence relative to the system's font


class Banner(Themed, QFrame):
    """The state banner; its parts keep their positions when the text changes."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.tone = Tone.NEUTRAL
        self._flashing = QTimer(self)
        self._flashing.setSingleShot(True)
        self._flashing.setInterval(FLASH_MS)
        self._flashing.timeout.connect(self._flashed)
        self.setObjectName("banner")
        row = horizontal(self, (8, 4, 12, 4), 8)
        self._sign = added(row, text_label("", self, bold=True, size=2.3))
        self.word = added(row, text_label("", self, bold=True, size=2.3))
        self.detail = added(row, text_label("", self, selectable=True, wrap=True, size=FACTORS[0]), 1)
        self._clock = text_label("", self, bold=True, size=1.6)
        self._sign.setFixedWidth(self._sign.fontMetrics().horizontalAdvance("◉◉"))
        self._sign.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.word.setMinimumWidth(self.word.fontMetrics().horizontalAdvance("ANALYSING"))
        self._clock.setFixedWidth(self._clock.fontMetrics().horizontalAdvance("00:00 "))
        self._clock.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        hover = "Save the shots that are only in memory to another folder"
        self.save_elsewhere = added(row, push_button("Save elsewhere …", hover, self, command="save_elsewhere"))
        self.save_elsewhere.setMinimumHeight(int(2.2 * self.fontMetrics().height()))
        self.save_elsewhere.hide()
        row.addWidget(self._clock)
        self.detail.setMinimumWidth(self.fontMetrics().horizontalAdvance("M") * 12)
        self.setFixedHeight(max(self.word.sizeHint().height() + 8, 3 * self.fontMetrics().lineSpacing() + 8))
        self.setAccessibleName("State of the instrument")
        self.show_state("READY", "", Tone.NEUTRAL)

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        background, text = colours.tones[self.tone]
        if self._flashing.isActive():
            background, text = text, background
        self.setStyleSheet(
            f"#banner {{ background: {background}; border-radius: 6px; }} #banner QLabel {{ color: {text}; }}"
        )

    @Slot()
    def flash(self) -> None:
        """Exchange text and background colour for ``FLASH_MS``."""
        self._flashing.start()
        self.apply_colours(self.colours)

    @Slot()
    def _flashed(self) -> None:
        self.apply_colours(self.colours)

    def offer_saving(self, unsaved: int) -> None:
        """Show the button "Save elsewhere" while shots are only in memory."""
        if self.save_elsewhere.isHidden() == (unsaved > 0):
            self.save_elsewhere.setVisible(unsaved > 0)
            self._clock.setVisible(unsaved == 0)  # the sentence needs its space
            self._fit()
        if unsaved:
            self.save_elsewhere.setText(f"Save {counted(unsaved, 'shot')} elsewhere …")

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Set the largest font in which the whole sentence fits."""
        self.layout().activate()
        room = self.contentsRect().height() - 8
        for factor in FACTORS:
            font = sized(self.font(), factor)
            flags = Qt.TextFlag.TextWordWrap.value
            needed = QFontMetrics(font).boundingRect(0, 0, self.detail.width(), 10_000, flags, self.detail.text())
            if needed.height() <= room or factor == FACTORS[-1]:
                if self.detail.font() != font:
                    self.detail.setFont(font)
                return

    def show_state(self, word: str, detail: str, tone: Tone, clock: str = "") -> None:
        """Show a state; called 28 times a second, so only changed parts are updated."""
        if tone is not self.tone or not self._sign.text():
            self.tone = tone
            self._sign.setText(SIGNS[tone])
            self.apply_colours(self.colours)
        if word != self.word.text() or detail != self.detail.text():
            self.word.setText(word)
            self.detail.setText(detail)
            self.detail.setToolTip(detail)
            self.setAccessibleDescription(f"{word}. {detail}")
            self._fit()
        self._clock.setText(clock)


@dataclass(frozen=True, slots=True)
class TileText:
    """The text of a tile in the signal line, its tone and its tooltip."""

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
    """The signal line: tiles of fixed width, and the data folder."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("card", True)
        self._signs: dict[str, TileText] = {}
        row = horizontal(self, (6, 2, 6, 2), 3)
        self._marks: dict[str, QLabel] = {}
        self.values: dict[str, QLabel] = {}
        for name, title, widest in TILES:
            mark, heading = text_label("", self, bold=True), text_label(title, self, faint=True)
            value = text_label(DASH, self, selectable=True)
            mark.setFixedWidth(self.fontMetrics().horizontalAdvance("✓M"))
            mark.setAlignment(Qt.AlignmentFlag.AlignCenter)
            value.setMinimumWidth(self.fontMetrics().horizontalAdvance(widest) + 4)
            value.setAccessibleName(title)
            for widget in (mark, heading, value):
                row.addWidget(widget)
            row.addSpacing(4)
            self._marks[name], self.values[name] = mark, value
        middle = Qt.TextElideMode.ElideMiddle
        self._folder = text_label("", self, elide=middle, faint=True, selectable=True)
        self._folder.setProperty("least", "saving to /home …/data")
        row.addWidget(self._folder, 1)
        for name, _, _ in TILES:
            self.show_tile(name, TileText(DASH, Tone.NEUTRAL))

    def show_tile(self, name: str, sign: TileText) -> None:
        """Show the text of a tile; an unchanged tile is not updated."""
        if self._signs.get(name) == sign:
            return
        self._signs[name] = sign
        self.values[name].setText(sign.words)
        self.values[name].setToolTip(sign.hover)
        self.values[name].setAccessibleDescription(f"{sign.words}. {sign.hover}")
        self._marks[name].setText(MARKS[sign.tone])
        set_tone(self._marks[name], sign.tone)

    def show_folder(self, folder: str) -> None:
        words = f"saving to {folder}" if folder else "not saving"
        if self._folder.whole != words:
            self._folder.setText(words)
            self._folder.setToolTip(folder)
