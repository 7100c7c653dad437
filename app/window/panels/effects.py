"""Lists of effects: those found or in the model, and the candidates ordered by evidence."""

import math
from collections.abc import Sequence

from PySide6.QtCore import QEvent, QObject, QRectF, QSize, Qt, Signal, Slot
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QPushButton, QSizePolicy, QWidget

from analysis.collision import Effect
from analysis.diagnosis import CRITERIA, Candidate, FoundEffect, remark_on
from app.session import by_evidence
from app.window.controls.theme import MARKS, Themed, Tone
from app.window.controls.widgets import clear_layout, horizontal, push_button, text_label, vertical
from app.words import DASH, effect_numbers, joined, lines, number, tag

TRIED = "tried by the operator; not found by a diagnosis"


def _found_words(found: FoundEffect) -> str:
    """Return the parameters of an effect found, and the effects that the data cannot tell it from."""
    rivals = ", ".join(other.words for other in found.indistinguishable_from)
    return effect_numbers(found.effect, found.parameters) + (f"   indistinguishable from: {rivals}" if rivals else "")


class EffectRows(QWidget):
    """A row for each effect, and one button to add all if several are not in the model."""

    add_wanted = Signal(list)  # list of Effect
    remove_wanted = Signal(object)  # an Effect

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._column = vertical(self)

    def show_effects(
        self, found: Sequence[FoundEffect], in_model: tuple[Effect, ...], tried: Sequence[Effect] = ()
    ) -> None:
        """Show the effects found, then others in the model; ``tried`` are effects that no diagnosis found."""
        focused = self.window().focusWidget()
        focused_effect = focused.property("effect") if focused is not None and self.isAncestorOf(focused) else None
        clear_layout(self._column)
        for one in found:
            self._add_row(one.effect, _found_words(one), one.effect in in_model)
        missing = [one.effect for one in found if one.effect not in in_model]
        if len(missing) > 1:
            hover = "Use these effects from now on; all shots are refitted"
            button = push_button("Add all to the model", hover, self, self.add_wanted, missing)
            self._column.addWidget(button, 0, Qt.AlignmentFlag.AlignRight)
        for effect in in_model:
            if effect not in {one.effect for one in found}:
                self._add_row(effect, TRIED if effect in tried else "", True)
        for button in self._buttons():  # keep the focus on the button of the same effect
            if focused_effect is not None and button.property("effect") == focused_effect:
                button.setFocus()

    def _add_row(self, effect: Effect, words: str, in_model: bool) -> None:
        row = QWidget(self)
        line = horizontal(row)
        title = effect.words.capitalize()
        label = text_label(joined(tag("b", title), f"  {words}"), row, selectable=True, wrap=True)
        if in_model:
            hover = "Remove the effect; all shots are refitted"
            button = push_button("Remove from the model", hover, row, self.remove_wanted, effect)
        else:
            hover = "Use the effect from now on; all shots are refitted"
            button = push_button("Add to the model", hover, row, self.add_wanted, [effect])
        button.setProperty("effect", effect.key)
        button.setAccessibleDescription(title)
        line.addWidget(label, 1)
        line.addWidget(button)
        self._column.addWidget(row)
        row.show()  # shown at once, because a hidden button cannot take the focus

    def _buttons(self) -> list[QPushButton]:
        rows = [self._column.itemAt(index).widget() for index in range(self._column.count())]
        return [button for row in rows if row is not None for button in row.findChildren(QPushButton)]


SHOWN = 7  # candidates shown before the button "Show all" is pressed
HEADINGS = (
    ("candidate", "Effects that were tried, in the order of their evidence"),
    ("−ΔBIC", "Evidence: by how much the effect lowers the Bayesian information criterion; more is better"),
    ("size (σ)", "Size of what it explains, in standard deviations of the noise: its norm over that of the noise"),
)
MIN_NAME_LETTERS = 12  # least width of a name in letters


class Bar(Themed, QWidget):
    """A horizontal bar of a candidate's evidence."""

    def __init__(self, share: float, chosen: bool, parent: QWidget) -> None:
        super().__init__(parent)
        self._share, self._chosen = min(1.0, max(0.0, share)), chosen
        self.setMinimumSize(QSize(24, 7))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def paintEvent(self, _: QPaintEvent) -> None:
        painter = QPainter(self)
        colour = self.colours.accent if self._chosen else self.colours.marker
        painter.fillRect(QRectF(0, 1, max(1.0, self._share * self.width()), self.height() - 2), QColor(colour))


class CandidateBars(Themed, QWidget):
    """A row for each candidate: name, logarithmic bar, evidence, size; a line marks the evidence threshold."""

    pointed = Signal(object)  # effect of the hovered or focused candidate, or None

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._candidates: tuple[Candidate, ...] = ()
        self._named: set[Effect] = set()
        self._all = False
        self._inner: QWidget | None = None
        self._column = vertical(self)
        self._column.addStretch(1)
        self.setAccessibleName("Candidates in the order of their evidence")

    @property
    def threshold(self) -> float:
        """Get the evidence threshold: the least fall of the BIC for the best of this number of candidates."""
        return CRITERIA.fall(len(self._candidates))

    def show_candidates(self, candidates: tuple[Candidate, ...], named: set[Effect]) -> None:
        """Show the candidates; effects found by the diagnosis (``named``) get a tick."""
        self._candidates, self._named = candidates, named
        self._build()

    @Slot()
    def _show_all(self) -> None:
        self._all = not self._all
        self._build()

    def _build(self) -> None:
        if self._inner is not None:
            self._column.removeWidget(self._inner)
            self._inner.deleteLater()
        inner = self._inner = QWidget(self)
        grid = QGridLayout(inner)
        grid.setContentsMargins(4, 2, 6, 2)
        grid.setVerticalSpacing(1)
        grid.setColumnStretch(0, 1)
        ranked = by_evidence(self._candidates)
        if ranked:
            for place, (words, hover) in enumerate(HEADINGS):
                head = text_label(words, inner, faint=True)
                head.setToolTip(hover)
                head.setAlignment(Qt.AlignmentFlag.AlignRight if place else Qt.AlignmentFlag.AlignLeft)
                grid.addWidget(head, 0, place)
        shown = ranked if self._all else ranked[:SHOWN]
        most = max((_evidence(c) for c in ranked), default=1.0)
        ruled = False
        for candidate in shown:
            if not ruled and _evidence(candidate) < self.threshold:
                self._add_rule(grid, inner)
                ruled = True
            self._add_row(grid, candidate, most, inner)
        if len(ranked) > SHOWN:
            words = "Show fewer" if self._all else f"Show all {len(ranked)}"
            more = push_button(words, "The other candidates that were tried", inner, self._show_all)
            grid.addWidget(more, grid.rowCount(), 0, 1, 3, Qt.AlignmentFlag.AlignLeft)
        self._column.insertWidget(0, inner)
        inner.show()

    def _add_rule(self, grid: QGridLayout, inner: QWidget) -> None:
        rule = text_label(f"evidence begins above: −ΔBIC {number(self.threshold, 3)}", inner, wrap=True)
        rule.setToolTip(
            "A fall of the BIC by 10 is very strong evidence (Kass and Raftery 1995); the rest is the price of having "
            f"chosen among {len(self._candidates)} candidates."
        )
        frame = QFrame(inner)
        frame.setFrameShape(QFrame.Shape.HLine)
        grid.addWidget(frame, grid.rowCount(), 0, 1, 3)
        grid.addWidget(rule, grid.rowCount(), 0, 1, 3)

    def _add_row(self, grid: QGridLayout, candidate: Candidate, most: float, inner: QWidget) -> None:
        pays = candidate.delta_bic is None or candidate.delta_bic < 0.0
        chosen = candidate.effect in self._named and pays
        words = (f"{MARKS[Tone.GOOD]} " if chosen else "") + candidate.effect.words
        name = text_label(words, inner, elide=Qt.TextElideMode.ElideRight, bold=chosen)
        name.setMinimumWidth(MIN_NAME_LETTERS * self.fontMetrics().horizontalAdvance("n"))
        name.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        name.setAccessibleName(f"{candidate.effect.words}: show what it explains")
        share = math.log10(1.0 + max(0.0, _evidence(candidate))) / math.log10(1.0 + max(most, 10.0))
        bar = Bar(share, chosen, inner)
        bar.apply_colours(self.colours)
        fall = candidate.delta_bic
        evidence = QLabel(DASH if fall is None else number(-fall, 3), inner)
        size = QLabel(number(abs(candidate.score), 3), inner)
        remark = remark_on(candidate) or (
            "not fitted in full: its first-order score was too small" if fall is None else ""
        )
        numbers = effect_numbers(candidate.effect, candidate.parameters)
        hover = lines((tag("b", candidate.effect.words), remark, numbers))
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        line = grid.rowCount()
        grid.addWidget(name, line, 0)
        grid.addWidget(bar, line + 1, 0)
        for place, label in enumerate((evidence, size), 1):
            label.setAlignment(right)
            grid.addWidget(label, line, place, 2, 1)
        for widget in (name, bar, evidence, size):
            widget.setToolTip(hover)
            widget.setProperty("candidate", candidate.effect.key)
            widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Emit the effect of the candidate that is hovered or focused."""
        key = watched.property("candidate")
        if key and event.type() in (QEvent.Type.Enter, QEvent.Type.FocusIn):
            self.pointed.emit(next((one.effect for one in self._candidates if one.effect.key == key), None))
        elif key and event.type() in (QEvent.Type.Leave, QEvent.Type.FocusOut):
            self.pointed.emit(None)
        return super().eventFilter(watched, event)


def _evidence(candidate: Candidate) -> float:
    """Return the fall of the BIC, or minus infinity if the candidate was not fitted in full."""
    return -candidate.delta_bic if candidate.delta_bic is not None else -math.inf
