"""Every effect that a diagnosis tried, best first: a bar, its score in words, its evidence."""

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QGridLayout, QLabel, QScrollArea, QSizePolicy, QWidget

from analysis.diagnosis.result import Candidate
from app.window.theme import MARKS, Colours, Tone
from app.words.wording import DASH, effect_numbers, effect_words, number

SHOWN_CANDIDATES = 19
NARROWEST = 16  # letters of a name in one line


class Bar(QWidget):
    """A horizontal bar; its length is said in words beside it."""

    def __init__(self, share: float, colour: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._share, self._colour = min(1.0, max(0.0, share)), colour
        self.setMinimumSize(QSize(24, 12))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the bar."""
        painter = QPainter(self)
        painter.fillRect(QRectF(0, 1, max(1.0, self._share * self.width()), self.height() - 2), QColor(self._colour))


class CandidateBars(QScrollArea):
    """Every effect that was tried, best first."""

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = colours
        self._grid: QGridLayout | None = None
        self._longest = self._beside = 0  # width of the longest name, and of what stands beside it
        self.setWidgetResizable(True)
        self.setAccessibleName("Effects that were tried, best first")
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAsNeeded)

    def dress(self, colours: Colours) -> None:
        """Set the colours used from the next show on."""
        self._colours = colours

    def show_candidates(self, candidates: tuple[Candidate, ...], named: set[str]) -> None:
        """Show the candidates; named ones carry a tick."""
        inner = QWidget(self)
        grid = QGridLayout(inner)
        grid.setContentsMargins(4, 2, 10, 2)
        grid.setVerticalSpacing(3)
        grid.setColumnStretch(1, 1)
        names: list[QLabel] = []
        most = max((abs(candidate.score) for candidate in candidates), default=1.0) or 1.0
        ranked = sorted(candidates, key=lambda c: -abs(c.score))  # in the order of their bars
        for line, candidate in enumerate(ranked[:SHOWN_CANDIDATES]):
            pays = candidate.delta_bic is None or candidate.delta_bic < 0.0
            chosen = candidate.name in named and pays
            mark = f"{MARKS[Tone.GOOD]} " if chosen else ""
            name = QLabel(mark + effect_words(candidate.name), inner)
            name.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            font = name.font()
            font.setBold(chosen)
            name.setFont(font)
            names.append(name)
            colour = self._colours.accent if chosen else self._colours.marker
            score = QLabel(number(candidate.score, 3), inner)
            score.setAlignment(Qt.AlignmentFlag.AlignRight)
            bic = DASH if candidate.delta_bic is None else f"ΔBIC {number(candidate.delta_bic, 3)}"
            evidence = QLabel(bic, inner)
            evidence.setProperty("faint", True)
            hover = "<br>".join(
                (f"<b>{candidate.name}</b>", candidate.remark, effect_numbers(candidate.name, candidate.parameters))
            )
            for place, widget in enumerate((name, Bar(abs(candidate.score) / most, colour, inner), score, evidence)):
                widget.setToolTip(hover)
                grid.addWidget(widget, line, place)
        grid.setRowStretch(SHOWN_CANDIDATES, 1)
        self._longest = max((label.sizeHint().width() for label in names), default=0)
        self._beside = inner.sizeHint().width() - self._longest
        for label in names:
            label.setWordWrap(True)
        self._grid = grid
        self.setWidget(inner)
        least = min(self._longest, NARROWEST * self.fontMetrics().horizontalAdvance("n"))
        self.setMinimumWidth(self._beside + least + self.verticalScrollBar().sizeHint().width())
        self._share_width()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Let names have the width that is there, and go on in a second line where it is too little."""
        super().resizeEvent(event)
        self._share_width()

    def _share_width(self) -> None:
        if self._grid is not None:
            self._grid.setColumnMinimumWidth(0, max(0, min(self._longest, self.viewport().width() - self._beside)))
