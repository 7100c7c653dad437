"""The sheet of the guided set-up: choose the source, check its signals, arm."""

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QGridLayout, QLabel, QVBoxLayout, QWidget

from app.window.controls.theme import MARKS, Tone
from app.window.controls.widgets import (
    Sheet,
    add_row,
    added,
    clear_layout,
    heading_label,
    line_edit,
    push_button,
    set_tone,
    show_toned,
    text_label,
    vertical,
)
from app.window.panels.state_words import TONES
from app.words import counted, lines, localised_text, tag
from instrument.devices import Check, FoundDevice, Grade

BENCH = FoundDevice("bench", "Simulated bench", "no device needed")
MAX_CHECKS = 6
TITLES = {"PD0": "PD0, rest beat", "PD1": "PD1, moving beat"}


class SetupSheet(Sheet):
    """The guided set-up: three steps from top to bottom."""

    source_wanted = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Set-up", parent)
        column, self._close = self.head("Set-up", "Close the set-up  (F3 or Esc)")
        column.setSpacing(6)
        self._add_sources(column)
        self._add_permission(column)
        self._add_checks(column)
        column.addStretch(1)
        self.show_looking()
        self.show_checks((), "no samples yet")

    def _add_sources(self, column: QVBoxLayout) -> None:
        self.look = push_button("Look again", "Search again for devices", self)
        add_row(column, heading_label("1   CHOOSE THE SOURCE", self), self.look)
        self._found = added(column, text_label("", self, wrap=True))
        self._devices = QGridLayout()
        self._devices.setColumnStretch(0, 1)
        column.addLayout(self._devices)
        self.address = line_edit(
            "Address of an oscilloscope in the network",
            "HOST, HOST:PORT or a VISA name; options as ?channels=1,2&trigger=3 may follow",
            self,
            "oscilloscope in the network, as 192.168.1.5",
        )
        self.address.setMaxLength(300)
        hover = "Open the oscilloscope at this address  (Enter in the field)"
        self.use_address = push_button("Use", hover, self)
        self.use_address.setAccessibleName("Use the oscilloscope at this address")
        add_row(column, self.address, self.use_address)
        self.refusal = added(column, text_label("", self, wrap=True))
        self.refusal.hide()

    def _add_permission(self, column: QVBoxLayout) -> None:
        self._permission = QWidget(self)
        permission = vertical(self._permission, (0, 8, 0, 0))
        copy = push_button("Copy", "Copy these lines for a terminal", self, self._copy)
        add_row(permission, heading_label("PERMISSION TO USE THE DEVICE", self), copy)
        self.remedy = added(permission, text_label("", self, selectable=True, wrap=True))
        self._permission.hide()
        column.addWidget(self._permission)

    def _add_checks(self, column: QVBoxLayout) -> None:
        column.addSpacing(10)
        column.addWidget(heading_label("2   CHECK THE SIGNALS, THE BLOCK AT REST", self))
        self._lines: list[QLabel] = []
        for _ in range(MAX_CHECKS):
            line = text_label("", self, selectable=True, wrap=True)
            line.setMinimumHeight(2 * self.fontMetrics().lineSpacing())
            line.setAlignment(Qt.AlignmentFlag.AlignTop)
            line.hide()
            self._lines.append(line)
            column.addWidget(line)
        column.addSpacing(10)
        column.addWidget(heading_label("3   ARM", self))
        self.verdict = added(column, text_label("", self, wrap=True, bold=True, size=1.15))
        hover = "Close the set-up and wait for the light switch  (space)"
        self.arm = added(column, push_button("ARM", hover, self, primary=True))

    # devices ----------------------------------------------------------------------------------------------------

    def show_looking(self) -> None:
        """Show that the search for devices is running."""
        self.look.setEnabled(False)
        self._found.setText("looking for devices …")

    def show_devices(
        self, found: Sequence[FoundDevice], known: Sequence[FoundDevice], present: str, problem: str = ""
    ) -> None:
        """List the bench, the devices found and known addresses; ``problem`` says why the search failed."""
        self.look.setEnabled(True)
        clear_layout(self._devices)
        if problem:
            self._found.setText(f"{MARKS[Tone.WARNING]} The search for devices failed: {problem}")
        elif found:
            self._found.setText(f"{counted(len(found), 'device')} found")
        else:
            self._found.setText("No digitizer is plugged in. The simulated bench needs none.")
        for line, device in enumerate((BENCH, *found, *known)):
            self._add_device(2 * line, device, device.source == present)

    def _add_device(self, line: int, device: FoundDevice, in_use: bool) -> None:
        label = text_label(lines((tag("b", device.name), device.where)), self, wrap=True)
        hover = f"Use {device.name} as the source"
        button = push_button("In use" if in_use else "Use", hover, self, self.source_wanted, device.source)
        button.setEnabled(not in_use)
        button.setAccessibleName(f"Use {device.name}")
        self._devices.addWidget(label, line, 0)
        self._devices.addWidget(button, line, 1, Qt.AlignmentFlag.AlignTop)
        if device.problem:
            below = text_label("", self, wrap=True)
            show_toned(below, f"{device.problem}: {device.remedy}", Tone.BAD)
            self._devices.addWidget(below, line + 1, 0)

    def refuse_address(self, words: str) -> None:
        """Show why an address is invalid; "" hides the message."""
        show_toned(self.refusal, words, Tone.BAD)
        self.refusal.setVisible(bool(words))

    def show_remedy(self, lines: str) -> None:
        """Show the commands that grant access to the device; "" hides them."""
        self.remedy.setText(lines)
        self._permission.setVisible(bool(lines))

    # signals ----------------------------------------------------------------------------------------------------

    def show_checks(self, checks: tuple[Check, ...], waiting: str = "") -> None:
        """Show the checks of the signals, or ``waiting``, which says why there are none yet."""
        for index, line in enumerate(self._lines):
            line.setVisible(index < len(checks) or (index == 0 and not checks))
            if index < len(checks):
                check = checks[index]
                name = TITLES.get(check.name, check.name[:1].upper() + check.name[1:])
                show_toned(line, f"{name}: {localised_text(check.line)}", TONES[check.grade])
            else:
                line.setText(waiting if index == 0 else "")
                set_tone(line, Tone.NEUTRAL)
        tone, words = _verdict(checks)
        self.verdict.setText(words)
        set_tone(self.verdict, tone)

    # the sheet --------------------------------------------------------------------------------------------------

    def open(self) -> None:
        self.open_at(self.look if self.look.isEnabled() else self._close)

    @Slot()
    def _copy(self) -> None:
        QGuiApplication.clipboard().setText(self.remedy.text())


def _verdict(checks: tuple[Check, ...]) -> tuple[Tone, str]:
    bad = [check for check in checks if check.grade is Grade.FAIL]
    doubtful = [check for check in checks if check.grade is Grade.WARN]
    if not checks:
        return Tone.NEUTRAL, "Nothing to check yet."
    if bad:
        return Tone.BAD, f"{MARKS[Tone.BAD]} Not ready for a shot: fix {_names(bad)}."
    if doubtful:
        return Tone.WARNING, f"{MARKS[Tone.WARNING]} You can arm; check {_names(doubtful)} first."
    return Tone.GOOD, f"{MARKS[Tone.GOOD]} Ready: press ARM, then push the block."


def _names(checks: list[Check]) -> str:
    return ", ".join(dict.fromkeys(check.name for check in checks))
