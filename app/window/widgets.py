"""Labels and buttons, made with the properties that many of them share."""

from collections.abc import Callable

from PySide6.QtCore import Qt, SignalInstance
from PySide6.QtWidgets import QLabel, QPushButton, QWidget


def text_label(
    text: str,
    parent: QWidget,
    *,
    wrap: bool = False,
    faint: bool = False,
    heading: bool = False,
    selectable: bool = False,
) -> QLabel:
    """Return a label; ``faint`` and ``heading`` are looks of the style sheet, ``selectable`` text can be copied."""
    label = QLabel(text, parent)
    label.setWordWrap(wrap)
    for name, on in (("faint", faint), ("heading", heading)):
        if on:
            label.setProperty(name, True)
    if selectable:
        label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return label


def push_button(
    text: str,
    hover: str,
    parent: QWidget,
    clicked: Callable[[], object] | SignalInstance | None = None,
    *,
    checkable: bool = False,
    primary: bool = False,
) -> QPushButton:
    """Return a button; ``clicked`` is the slot or signal it is connected to, ``primary`` a look of the style sheet."""
    button = QPushButton(text, parent)
    button.setToolTip(hover)
    button.setCheckable(checkable)
    if primary:
        button.setProperty("primary", True)
    if clicked is not None:
        button.clicked.connect(clicked)
    return button
