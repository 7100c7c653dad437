"""The controls of the rig: source, ARM, Abort, automatic re-arm."""

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QCheckBox, QComboBox, QHBoxLayout, QWidget

from app.window.theme import sized
from app.window.widgets import push_button


class Controls(QWidget):
    """Buttons and the list of sources; emits what is pressed."""

    arm_wanted = Signal()
    abort_wanted = Signal()
    rearm_changed = Signal(bool)
    source_chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        self.source = QComboBox(self)
        self.source.setAccessibleName("Source of the samples")
        self.source.setToolTip("Where the samples come from: the simulated bench, a recording, or a device  (S)")
        self.source.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.source.setMinimumContentsLength(19)  # "Simulated bench with a flaw"
        self.arm = push_button("ARM", "Wait for the light switch and record the next shot  (space)", self, primary=True)
        self.abort = push_button("Abort", "Stop waiting or recording; finished shots are kept  (Esc)", self)
        for button, words in ((self.arm, "ARM"), (self.abort, "Abort")):
            button.setFont(sized(self.font(), 1.35, bold=True))
            button.setAccessibleName(words)
            button.setMinimumHeight(int(2.6 * self.fontMetrics().height()))
        self.arm.setMinimumWidth(self.fontMetrics().horizontalAdvance("M") * 8)
        self.abort.setMinimumWidth(self.fontMetrics().horizontalAdvance("M") * 6)
        self.source.setMinimumHeight(self.arm.minimumHeight())
        self.rearm = QCheckBox("re-arm", self)
        self.rearm.setToolTip("Re-arm by itself after each shot, until Abort  (R)")
        row.addWidget(self.source)
        row.addWidget(self.arm)
        row.addWidget(self.abort)
        row.addWidget(self.rearm)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.arm.clicked.connect(self.arm_wanted)
        self.abort.clicked.connect(self.abort_wanted)
        self.rearm.toggled.connect(self.rearm_changed)
        self.source.activated.connect(self._chosen)
        QWidget.setTabOrder(self.source, self.arm)
        QWidget.setTabOrder(self.arm, self.abort)
        QWidget.setTabOrder(self.abort, self.rearm)

    def offer_sources(self, sources: list[tuple[str, str]], present: str) -> None:
        """List the sources as (name for open_source, words); the present one is selected."""
        self.source.blockSignals(True)
        self.source.clear()
        for name, words in sources:
            self.source.addItem(words, name)
        place = self.source.findData(present)
        if place < 0:
            self.source.addItem(present, present)
            place = self.source.count() - 1
        self.source.setCurrentIndex(place)
        self.source.blockSignals(False)

    def show_state(self, can_arm: bool, can_abort: bool) -> None:
        """Enable what is possible now."""
        if self.arm.isEnabled() != can_arm:
            self.arm.setEnabled(can_arm)
        if self.abort.isEnabled() != can_abort:
            self.abort.setEnabled(can_abort)
        if self.source.isEnabled() != can_arm:
            self.source.setEnabled(can_arm)

    @Slot(int)
    def _chosen(self, _: int) -> None:
        self.source_chosen.emit(str(self.source.currentData()))
