"""Widgets that panels share: labels, buttons, fields, a layout that continues in a new line, a sheet."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from PySide6.QtCore import QMargins, QRect, QSize, Qt, SignalInstance, Slot
from PySide6.QtGui import QHideEvent, QResizeEvent
from PySide6.QtWidgets import (
    QComboBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLayout,
    QLayoutItem,
    QLineEdit,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)
from shiboken6 import isValid

from app.window.theme import MARKS, Tone, sized
from app.words import Markup, lines, tag


class TextLabel(QLabel):
    """A label that takes nothing for markup but ``Markup``, whatever a name of a shot or a law looks like."""

    whole = ""  # all of its text, also where it is shortened

    def setText(self, text: str) -> None:
        self.whole = text
        self.setTextFormat(Qt.TextFormat.RichText if isinstance(text, Markup) else Qt.TextFormat.PlainText)
        super().setText(text)

    def setToolTip(self, text: str) -> None:
        super().setToolTip(hover_text(text))


class ElidedLabel(TextLabel):
    """A label of one line, shortened to its width; empty where not even the text ``least`` has room."""

    def __init__(self, parent: QWidget, elide: Qt.TextElideMode, least: str) -> None:
        super().__init__(parent)
        self._elide, self._least = elide, least
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def setText(self, text: str) -> None:
        metrics, room = self.fontMetrics(), self.width()
        enough = room >= metrics.horizontalAdvance(self._least)
        super().setText(metrics.elidedText(text, self._elide, room) if enough else "")
        self.whole = text

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.setText(self.whole)


def hover_text(text: str) -> str:
    """Return text for a hover, in which Qt takes nothing for markup but ``Markup``."""
    harmless = isinstance(text, Markup) or ("<" not in text and "&lt;" not in text)
    return text if harmless else tag("span", lines(text.split("\n")))


def text_label(
    text: str,
    parent: QWidget,
    *,
    wrap: bool = False,
    faint: bool = False,
    heading: bool = False,
    bold: bool = False,
    selectable: bool = False,
    elide: Qt.TextElideMode = Qt.TextElideMode.ElideNone,
    least: str = "",
) -> TextLabel:
    """Return a label; ``faint`` and ``heading`` are looks of the style sheet, ``selectable`` text can be copied.

    With ``elide`` it is an ElidedLabel, shortened at that place.
    """
    label = TextLabel(parent) if elide is Qt.TextElideMode.ElideNone else ElidedLabel(parent, elide, least)
    label.setText(text)
    label.setWordWrap(wrap)
    if bold:
        label.setFont(sized(label.font(), 1.0, bold=True))
    for name, on in (("faint", faint), ("heading", heading)):
        if on:
            label.setProperty(name, True)
    if selectable:
        label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return label


def set_tone(label: QLabel, tone: Tone | None) -> None:
    """Give a label the colour that the style sheet has for a tone; None: that of other text."""
    name = None if tone is None else tone.value
    if label.property("tone") != name:
        label.setProperty("tone", name)
        label.style().unpolish(label)  # a label is dressed by its properties only when it is polished
        label.style().polish(label)


def show_toned(label: QLabel, words: str, tone: Tone) -> None:
    """Show words in the colour of a tone, after its mark; "" empties the label."""
    marked = f"{MARKS[tone]} {words}" if words else ""
    label.setText(Markup(marked) if isinstance(words, Markup) else marked)
    set_tone(label, tone)


def push_button(
    text: str,
    hover: str,
    parent: QWidget,
    clicked: Callable[..., object] | SignalInstance | None = None,
    given: object = None,
    *,
    checkable: bool = False,
    primary: bool = False,
) -> QPushButton:
    """Return a button; ``clicked`` is the slot or signal it is connected to, ``primary`` a look of the style sheet.

    It is called, or emitted, with what is ``given``.
    """
    button = QPushButton(text, parent)
    button.setToolTip(hover)
    button.setCheckable(checkable)
    if primary:
        button.setProperty("primary", True)
    if clicked is not None and given is not None:
        clicked = partial(call_with, clicked.emit if isinstance(clicked, SignalInstance) else clicked, given)
    if clicked is not None:
        button.clicked.connect(clicked)
    return button


def call_with(act: Callable[[Any], object], given: Any, _: bool = False) -> None:
    """Do something with what is given; the last is what buttons and actions add, whether they are checked."""
    act(given)


def combo_box(name: str, hover: str, parent: QWidget, items: Iterable[tuple[str, object]] = ()) -> QComboBox:
    """Return a list to choose from; each item is its words and what is stored for it."""
    box = QComboBox(parent)
    box.setAccessibleName(name)
    box.setToolTip(hover)
    for words, stored in items:
        box.addItem(words, stored)
    return box


def line_edit(name: str, hover: str, parent: QWidget, placeholder: str = "") -> QLineEdit:
    """Return a field for text; ``placeholder`` is shown while it is empty."""
    line = QLineEdit(parent)
    line.setAccessibleName(name)
    line.setToolTip(hover)
    line.setPlaceholderText(placeholder)
    return line


Margins = tuple[int, int, int, int]  # left, top, right, bottom


def vertical(parent: QWidget, margins: Margins = (0, 0, 0, 0), spacing: int | None = None) -> QVBoxLayout:
    """Return a layout of widgets below each other."""
    layout = QVBoxLayout(parent)
    _space(layout, margins, spacing)
    return layout


def horizontal(parent: QWidget, margins: Margins = (0, 0, 0, 0), spacing: int | None = None) -> QHBoxLayout:
    """Return a layout of widgets side by side."""
    layout = QHBoxLayout(parent)
    _space(layout, margins, spacing)
    return layout


def _space(layout: QLayout, margins: Margins, spacing: int | None) -> None:
    layout.setContentsMargins(*margins)
    if spacing is not None:
        layout.setSpacing(spacing)


def scrolled(name: str, page: QWidget) -> QWidget:
    """Return the content of a page that scrolls on a low screen."""
    around = vertical(page)
    scroll = QScrollArea(page)
    scroll.setWidgetResizable(True)
    scroll.setAccessibleName(name)
    inner = QWidget(scroll)
    scroll.setWidget(inner)
    around.addWidget(scroll)
    return inner


def keep_place(widget: QWidget, on: bool = True) -> None:
    """Let a widget keep its place in the layout while it is hidden."""
    policy = widget.sizePolicy()
    policy.setRetainSizeWhenHidden(on)
    widget.setSizePolicy(policy)


class FoldButton(QToolButton):
    """A button that unfolds more of a panel, with an arrow."""

    def __init__(self, words: str, hover: str, parent: QWidget) -> None:
        super().__init__(parent)
        self.setProperty("fold", True)
        self.setCheckable(True)
        self.setText(words)
        self.setToolTip(hover)
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.setArrowType(Qt.ArrowType.RightArrow)
        self.toggled.connect(self._turn)

    @Slot(bool)
    def _turn(self, shown: bool) -> None:
        self.setArrowType(Qt.ArrowType.DownArrow if shown else Qt.ArrowType.RightArrow)


class FlowLayout(QLayout):
    """Keeps every widget at its own size; its height follows from its width."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._items: list[QLayoutItem] = []
        self.setContentsMargins(QMargins(0, 0, 0, 0))
        self.setSpacing(6)

    def addItem(self, item: QLayoutItem) -> None:
        self._items.append(item)

    def count(self) -> int:
        return len(self._items)

    def itemAt(self, index: int) -> QLayoutItem | None:
        return self._items[index] if 0 <= index < len(self._items) else None

    def takeAt(self, index: int) -> QLayoutItem | None:
        return self._items.pop(index) if 0 <= index < len(self._items) else None

    def expandingDirections(self) -> Qt.Orientation:
        return Qt.Orientation(0)

    def hasHeightForWidth(self) -> bool:
        return True

    def heightForWidth(self, width: int) -> int:
        return self._place(QRect(0, 0, width, 0), move=False)

    def setGeometry(self, rect: QRect) -> None:
        super().setGeometry(rect)
        self._place(rect, move=True)

    def sizeHint(self) -> QSize:
        """Return the size of everything in one line."""
        sizes = [item.sizeHint() for item in self._items if not item.isEmpty()]
        width = sum(size.width() for size in sizes) + self.spacing() * max(0, len(sizes) - 1)
        return QSize(width, max((size.height() for size in sizes), default=0))

    def minimumSize(self) -> QSize:
        size = QSize()
        for item in self._items:
            size = size.expandedTo(item.minimumSize())
        return size

    def _place(self, rect: QRect, *, move: bool) -> int:
        x, y, line = rect.x(), rect.y(), 0
        for item in self._items:
            if item.isEmpty():
                continue
            size = item.sizeHint()
            if x > rect.x() and x + size.width() > rect.x() + rect.width():
                x, y, line = rect.x(), y + line + self.spacing(), 0
            if move:
                item.setGeometry(QRect(x, y, min(size.width(), rect.width()), size.height()))
            x += size.width() + self.spacing()
            line = max(line, size.height())
        return y + line - rect.y()


def clear_layout(layout: QLayout) -> None:
    """Remove every item of a layout; widgets are hidden at once and deleted by the event loop.

    They keep their parent: a layout shows its widgets later, and one without a parent would appear as a window of its
    own and take the keyboard.
    """
    while (item := layout.takeAt(0)) is not None:
        if (widget := item.widget()) is not None:
            widget.hide()
            widget.deleteLater()


class Sheet(QFrame):
    """Lies over the window, at its right side where a subclass does not ``place`` it; hidden until it is opened."""

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._before: QWidget | None = None  # what had the focus
        self.setProperty("card", True)
        self.setAccessibleName(name)
        self.hide()

    def head(self, title: str, hover: str) -> tuple[QVBoxLayout, QPushButton]:
        """Add title and Close button; return the sheet's layout and the button."""
        column = vertical(self, (18, 14, 18, 14))
        top = QHBoxLayout()
        words = QLabel(title, self)
        words.setFont(sized(self.font(), 1.5, bold=True))
        close = push_button("Close", hover, self, self.hide)
        top.addWidget(words, 1)
        top.addWidget(close)
        column.addLayout(top)
        return column, close

    def place(self) -> None:
        """Fill the right side of the window."""
        parent = self.parentWidget()
        if parent is not None:
            width = min(parent.width() - 40, self.fontMetrics().horizontalAdvance("M") * 42)
            self.setGeometry(parent.width() - width - 4, 4, width, parent.height() - 8)

    def open(self) -> None:
        self.open_at(None)

    def toggle(self) -> None:
        if self.isVisible():
            self.hide()
        else:
            self.open()

    def open_at(self, first: QWidget | None) -> None:
        """Show the sheet with the focus in a field."""
        if self.isHidden():
            self._before = self.window().focusWidget()
        self.place()
        self.show()
        self.raise_()
        if first is not None:
            first.setFocus()

    def hideEvent(self, event: QHideEvent) -> None:
        """Return the keyboard focus."""
        super().hideEvent(event)
        focused, before = self.window().focusWidget(), self._before
        self._before = None
        if focused is None or not self.isAncestorOf(focused) or before is None:
            return
        if isValid(before) and before.isVisible():  # a row's button may have been deleted
            before.setFocus()
