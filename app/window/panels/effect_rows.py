"""The effects found and those in the model, each with a button that adds or removes it."""

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from analysis.collision import Effect
from analysis.diagnosis import FoundEffect
from app.window.flow_layout import clear_layout
from app.window.widgets import text_label
from app.words import effect_numbers

TRIED = "tried; not named by a diagnosis"


class EffectRows(QWidget):
    """A row per effect, and one button for all where several are missing in the model."""

    add_wanted = Signal(list)  # of effects
    remove_wanted = Signal(object)  # an effect

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._effects: dict[str, Effect] = {}  # of the buttons, by key
        self._missing: list[Effect] = []
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)

    def show_effects(
        self, found: Sequence[FoundEffect], in_model: tuple[Effect, ...], tried: Sequence[Effect] = ()
    ) -> None:
        """Show the effects found, then others in the model; ``tried`` are those that no diagnosis named."""
        focused = self.window().focusWidget()
        focused_effect = focused.property("effect") if focused is not None and self.isAncestorOf(focused) else None
        clear_layout(self._column)
        self._effects = {}
        for one in found:
            parameters = effect_numbers(one.effect, one.parameters)
            rivals = ", ".join(other.words for other in one.indistinguishable_from)
            words = parameters + (f"   indistinguishable from: {rivals}" if rivals else "")
            self._add_row(one.effect, words, one.effect in in_model)
        self._missing = [one.effect for one in found if one.effect not in in_model]
        if len(self._missing) > 1:
            button = QPushButton("Add all to the model", self)
            button.setToolTip("Use these effects from now on; all shots are refitted")
            button.clicked.connect(self._add_all)
            self._column.addWidget(button, 0, Qt.AlignmentFlag.AlignRight)
        for effect in in_model:
            if effect not in {one.effect for one in found}:
                self._add_row(effect, TRIED if effect in tried else "", True)
        if focused_effect is not None:  # keep the focus at this effect
            for button in self._buttons():
                if button.property("effect") == focused_effect:
                    button.setFocus()

    def _add_row(self, effect: Effect, words: str, in_model: bool) -> None:
        row = QWidget(self)
        line = QHBoxLayout(row)
        line.setContentsMargins(0, 0, 0, 0)
        title = effect.words.capitalize()
        label = text_label(f"<b>{title}</b>  {words}", row, selectable=True, wrap=True)
        button = QPushButton("Remove from the model" if in_model else "Add to the model", row)
        button.setProperty("effect", effect.key)
        self._effects[effect.key] = effect
        button.setAccessibleDescription(title)
        button.setToolTip(
            "Remove the effect; all shots are refitted"
            if in_model
            else "Use the effect from now on; all shots are refitted"
        )
        button.clicked.connect(self._remove if in_model else self._add)
        line.addWidget(label, 1)
        line.addWidget(button)
        self._column.addWidget(row)
        row.show()  # at once, as a hidden button takes no focus

    def button(self, key: str) -> QPushButton:
        """Return the button that adds or removes an effect."""
        return next(button for button in self._buttons() if button.property("effect") == key)

    def _buttons(self) -> list[QPushButton]:
        rows = [self._column.itemAt(index).widget() for index in range(self._column.count())]
        return [button for row in rows if row is not None for button in row.findChildren(QPushButton)]

    @Slot()
    def _add(self) -> None:
        self.add_wanted.emit([self._of_sender()])

    @Slot()
    def _add_all(self) -> None:
        self.add_wanted.emit(self._missing)

    @Slot()
    def _remove(self) -> None:
        self.remove_wanted.emit(self._of_sender())

    def _of_sender(self) -> Effect:
        return self._effects[str(self.sender().property("effect"))]
