"""Take a layout's widgets out of the window."""

from PySide6.QtWidgets import QLayout


def clear_layout(layout: QLayout) -> None:
    """Remove every item of a layout; its widgets are hidden at once and deleted when the event loop comes round.

    They keep their parent: a layout shows a widget it was given not at once but later, and one that had lost its parent
    before then would appear as a small window of its own and take the keyboard from the main window.
    """
    while (item := layout.takeAt(0)) is not None:
        if (widget := item.widget()) is not None:
            widget.hide()
            widget.deleteLater()
