"""How a person left the window: its place, whether maximised, how its parts share it; kept as text in the settings."""

from PySide6.QtCore import QByteArray
from PySide6.QtWidgets import QMainWindow, QSplitter

from app.window.layout import Layout


def taken(window: QMainWindow, panels: Layout) -> str:
    """Return the state as one word a part."""
    parts = [window.saveGeometry(), *(splitter.saveState() for splitter in _splitters(panels))]
    parts.append(panels.table.table.horizontalHeader().saveState())
    return " ".join(bytes(part.toBase64().data()).decode("ascii") for part in parts)


def restore(window: QMainWindow, panels: Layout, words: str) -> None:
    """Bring a state back; what is not one changes nothing.  Qt keeps the window on a screen that there is."""
    splitters = _splitters(panels)
    parts = [QByteArray.fromBase64(word.encode("ascii", "replace")) for word in words.split()]
    if len(parts) != len(splitters) + 2:
        return
    window.restoreGeometry(parts[0])
    for splitter, part in zip(splitters, parts[1:-1], strict=True):
        splitter.restoreState(part)
    panels.table.table.horizontalHeader().restoreState(parts[-1])


def _splitters(panels: Layout) -> tuple[QSplitter, QSplitter]:
    return panels.across, panels.down
