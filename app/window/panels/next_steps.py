"""What to do where a residual is unexplained: try a candidate, propose a law, take another shot."""

from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QPushButton, QVBoxLayout, QWidget

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis, Verdict, in_words, remark_on
from app.window.flow_layout import FlowLayout, clear_layout
from app.window.widgets import text_label
from app.words import local_words

MOST_TRIED = 3
OPEN = (Verdict.UNEXPLAINED, Verdict.PARTLY_EXPLAINED)
ANOTHER_SHOT = (
    "more shots at other speeds, half and twice as fast: effects that depend on speed, position or time "
    "differ there; "
    "and a repetition of one shot, to see whether the effect repeats"
)


class NextSteps(QWidget):
    """Heading, buttons, and the next shot in words; hidden where nothing is open."""

    try_wanted = Signal(object)  # the effect of a candidate that did not pass
    law_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._effects: dict[str, Effect] = {}  # of the buttons, by key
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        heading = text_label("NEXT STEP", self, heading=True)
        column.addWidget(heading)
        row = QWidget(self)
        self._row = FlowLayout(row)
        column.addWidget(row)
        self._shot = text_label("", self, wrap=True)
        column.addWidget(self._shot)
        self.hide()

    @property
    def words(self) -> str:
        """Get the sentence on the next shot."""
        return self._shot.text()

    @property
    def buttons(self) -> list[QPushButton]:
        """Get the buttons, from the left."""
        widgets = (self._row.itemAt(place).widget() for place in range(self._row.count()))
        return [widget for widget in widgets if isinstance(widget, QPushButton)]

    def show_diagnosis(self, diagnosis: Diagnosis | None, in_model: tuple[Effect, ...]) -> None:
        """Show the possible next steps after a diagnosis."""
        clear_layout(self._row)
        self.setVisible(diagnosis is not None and diagnosis.verdict in OPEN)
        if diagnosis is None or diagnosis.verdict not in OPEN:
            return
        named = {found.effect for found in diagnosis.effects} | set(in_model)
        left = [c for c in diagnosis.candidates if c.effect not in named and c.parameters]
        for candidate in sorted(left, key=lambda c: -abs(c.score))[:MOST_TRIED]:
            remark = f" ({said})" if (said := remark_on(candidate)) else ""
            button = self._button(
                f"Try {candidate.effect.words}",
                f"Add it to the model although it did not pass{remark}; it is marked as tried",
            )
            button.setProperty("effect", candidate.effect.key)
            self._effects[candidate.effect.key] = candidate.effect
            button.clicked.connect(self._try)
        button = self._button("Propose a law …", "Type a law of your own; it is fitted and judged like the others")
        button.clicked.connect(self.law_wanted)
        self._shot.setText(f"Next shot: {local_words(in_words(diagnosis).separating_shot or ANOTHER_SHOT)}")

    def _button(self, words: str, tip: str) -> QPushButton:
        button = QPushButton(words, self)
        button.setToolTip(tip)
        self._row.addWidget(button)
        button.show()
        return button

    @Slot()
    def _try(self) -> None:
        self.try_wanted.emit(self._effects[str(self.sender().property("effect"))])
