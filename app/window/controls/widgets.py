"""Widgets shared by the panels: labels, buttons, fields, a flow layout, a sheet."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, TypeVar

from PySide6.QtCore import QMargins, QRect, QSize, Qt, SignalInstance, Slot
from PySide6.QtGui import QHideEvent, QResizeEvent
from PySide6.QtWidgets import (
    QBoxLayout,
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

from app.window.controls.theme import MARKS, Tone, sized
from app.words import Markup, lines, tag


class TextLabel(QLabel):
    """A label that renders only ``Markup`` as rich text; all other text, such as a shot's name, is shown literally."""

    whole = ""  # the full text, even if the label shows a shortened one

    def setText(self, text: str) -> None:
        self.whole = text
        self.setTextFormat(Qt.TextFormat.RichText if isinstance(text, Markup) else Qt.TextFormat.PlainText)
        super().setText(text)

    def setToolTip(self, text: str) -> None:
        super().setToolTip(hover_text(text))


class ElidedLabel(TextLabel):
    """A label of one line that shortens its text to its width; empty if not even its property "least" fits."""

    def __init__(self, parent: QWidget, elide: Qt.TextElideMode) -> None:
        super().__init__(parent)
        self._elide = elide
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def setText(self, text: str) -> None:
        metrics, room = self.fontMetrics(), self.width()
        enough = room >= metrics.horizontalAdvance(self.property("least") or "")
        super().setText(metrics.elidedText(text, self._elide, room) if enough else "")
        self.whole = text

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.setText(self.whole)


def hover_text(text: str) -> str:
    """Return a tooltip text in which Qt renders only ``Markup`` as rich text."""
    harmless = isinstance(text, Markup) or ("<" not in text and "&lt;" not in text)
    return text if harmless else tag("span", lines(text.split("\n")))


def text_label(
    text: str,
    parent: QWidget,
    *,
    wrap: bool = False,
    elide: Qt.TextElideMode = Qt.TextElideMode.ElideNone,
    faint: bool = False,
    bold: bool = False,
    size: float = 1.0,
    selectable: bool = False,
) -> TextLabel:
    """Return a label; ``faint`` is a style of the style sheet, ``selectable`` text can be copied.

    ``size`` is relative to the parent's font.  With ``elide`` the label has one line, which is shortened to its width.
    """
    label = TextLabel(parent) if elide is Qt.TextElideMode.ElideNone else ElidedLabel(parent, elide)
    label.setText(text)
    label.setWordWrap(wrap)
    if bold or size != 1.0:
        label.setFont(sized(label.font(), size, bold))
    if faint:
        label.setProperty("faint", True)
    if selectable:
        label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return label


def heading_label(text: str, parent: QWidget, *, wrap: bool = False) -> TextLabel:
    """Return a label in the style sheet's style of a heading."""
    label = text_label(text, parent, wrap=wrap)
    label.setProperty("heading", True)
    return label


def set_tone(label: QLabel, tone: Tone | None) -> None:
    """Give a label the style sheet's colour for a tone; None: the normal text colour."""
    name = None if tone is None else tone.value
    if label.property("tone") != name:
        label.setProperty("tone", name)
        label.style().unpolish(label)  # the style sheet reads properties only when the label is polished
        label.style().polish(label)


def show_toned(label: QLabel, words: str, tone: Tone) -> None:
    """Show a text in a tone's colour, after the tone's mark; "" empties the label."""
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
    command: str = "",
    checkable: bool = False,
    primary: bool = False,
) -> QPushButton:
    """Return a button; ``clicked`` is the slot or signal that it calls or emits, with ``given`` as its argument.

    ``command`` is the action of the ``Command`` that it triggers; ``primary`` is a style of the style sheet.
    """
    button = QPushButton(text, parent)
    button.setToolTip(hover)
    button.setCheckable(checkable)
    button.setProperty("command", command)
    if primary:
        button.setProperty("primary", True)
    if clicked is not None and given is not None:
        clicked = partial(call_with, clicked.emit if isinstance(clicked, SignalInstance) else clicked, given)
    if clicked is not None:
        button.clicked.connect(clicked)
    return button


def call_with(act: Callable[[Any], object], given: Any, _: bool = False) -> None:
    """Call ``act(given)``; the last argument is the checked state that buttons and actions pass, and is ignored."""
    act(given)


def combo_box(name: str, hover: str, parent: QWidget, items: Iterable[tuple[str, object]] = ()) -> QComboBox:
    """Return a drop-down list; each item is (displayed text, stored value)."""
    box = QComboBox(parent)
    box.setAccessibleName(name)
    box.setToolTip(hover)
    fill_box(box, items)
    return box


def fill_box(box: QComboBox, items: Iterable[tuple[str, object]], chosen: object = None) -> None:
    """Replace the items of a drop-down list; the item with the stored value ``chosen`` is selected, else the first."""
    box.clear()
    for words, stored in items:
        box.addItem(words, stored)
    box.setCurrentIndex(max(0, box.findData(chosen)))


def line_edit(name: str, hover: str, parent: QWidget, placeholder: str = "") -> QLineEdit:
    """Return a text field; ``placeholder`` is shown while it is empty."""
    line = QLineEdit(parent)
    line.setAccessibleName(name)
    line.setToolTip(hover)
    line.setPlaceholderText(placeholder)
    return line


AnyWidget = TypeVar("AnyWidget", bound=QWidget)
Margins = tuple[int, int, int, int]  # left, top, right, bottom


def vertical(parent: QWidget, margins: Margins = (0, 0, 0, 0), spacing: int | None = None) -> QVBoxLayout:
    layout = QVBoxLayout(parent)
    _space(layout, margins, spacing)
    return layout


def horizontal(parent: QWidget, margins: Margins = (0, 0, 0, 0), spacing: int | None = None) -> QHBoxLayout:
    layout = QHBoxLayout(parent)
    _space(layout, margins, spacing)
    return layout


def _space(layout: QLayout, margins: Margins, spacing: int | None) -> None:
    layout.setContentsMargins(*margins)
    if spacing is not None:
        layout.setSpacing(spacing)


def added(layout: QBoxLayout, widget: AnyWidget, stretch: int = 0) -> AnyWidget:
    """Add a widget to a layout and return it."""
    layout.addWidget(widget, stretch)
    return widget


def add_row(column: QBoxLayout, wide: QWidget, *others: QWidget) -> None:
    """Add widgets to a column side by side; the first of them takes the spare width."""
    row = QHBoxLayout()
    row.addWidget(wide, 1)
    for widget in others:
        row.addWidget(widget)
    column.addLayout(row)


def scrolled(name: str, page: QWidget) -> QWidget:
    """Fill a page with a scroll area and return the area's content widget."""
    around = vertical(page)
    scroll = QScrollArea(page)
    scroll.setWidgetResizable(True)
    scroll.setAccessibleName(name)
    inner = QWidget(scroll)
    scroll.setWidget(inner)
    around.addWidget(scroll)
    return inner


def keep_place(widget: QWidget, on: bool = True) -> None:
    """Let a widget keep its space in the layout while it is hidden."""
    policy = widget.sizePolicy()
    policy.setRetainSizeWhenHidden(on)
    widget.setSizePolicy(policy)


class FoldButton(QToolButton):
    """A button with an arrow that shows or hides part of a panel."""

    def __init__(self, words: str, hover: str, parent: QWidget) -> None:
        super().__init__(parent)
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
    """A layout that places widgets of their preferred size in lines, like words in a text."""

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
        """Return the size of all widgets in one line."""
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
    """Remove all items of a layout; widgets are hidden at once and deleted by the event loop.

    The widgets keep their parent, because the layout may still show them once: a widget without a parent would open
    as a separate window and take the keyboard focus.
    """
    while (item := layout.takeAt(0)) is not None:
        if (widget := item.widget()) is not None:
            widget.hide()
            widget.deleteLater()


class Sheet(QFrame):
    """A panel over the window, hidden until opened; at the right side unless a subclass overrides ``place``."""

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._before: QWidget | None = None  # the widget that had the focus before
        self.setProperty("card", True)
        self.setAccessibleName(name)
        self.hide()

    def head(self, title: str, hover: str) -> tuple[QVBoxLayout, QPushButton]:
        """Add title and Close button; return the sheet's layout and the button."""
        column = vertical(self, (18, 14, 18, 14))
        close = push_button("Close", hover, self, self.hide)
        add_row(column, text_label(title, self, bold=True, size=1.5), close)
        return column, close

    def place(self) -> None:
        """Fill the right side of the window."""
        parent = self.parentWidget()
        if parent is not None:
            width = min(parent.width() - 40, self.fontMetrics().horizontalAdvance("M") * 42)
            self.setGeometry(parent.width() - width - 4, 4, width, parent.height() - 8)

    def open(self) -> None:
        self.open_at(None)

    @Slot()
    def toggle(self) -> None:
        if self.isVisible():
            self.hide()
        else:
            self.open()

    def open_at(self, first: QWidget | None) -> None:
        """Show the sheet and set the focus to ``first``."""
        if self.isHidden():
            self._before = self.window().focusWidget()
        self.place()
        self.show()
        self.raise_()
        if first is not None:
            first.setFocus()

    def hideEvent(self, event: QHideEvent) -> None:
        """Return the keyboard focus to the widget that had it before."""
        super().hideEvent(event)
        focused, before = self.window().focusWidget(), self._before
        self._before = None
        if focused is None or not self.isAncestorOf(focused) or before is None:
            return
        if isValid(before) and before.isVisible():  # the button of a table row may have been deleted
            before.setFocus()
