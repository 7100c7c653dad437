"""Save and restore the window's geometry, splitters and columns, as text in the settings; fit it to the screen."""

from PySide6.QtCore import QByteArray, QRect, QSize
from PySide6.QtWidgets import QMainWindow, QSplitter, QStyle

from app.window.layout import Layout


def taken(window: QMainWindow, panels: Layout) -> str:
    """Return the state of the window as text, a word per part."""
    parts = [window.saveGeometry(), *(splitter.saveState() for splitter in _splitters(panels))]
    parts.append(panels.table.table.horizontalHeader().saveState())
    return " ".join(bytes(part.toBase64().data()).decode("ascii") for part in parts)


def restore(window: QMainWindow, panels: Layout, words: str) -> None:
    """Restore a state; invalid text changes nothing.  Qt keeps the window on an existing screen."""
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


USUAL = QSize(1480, 920)
TITLE_PX = 40  # assumed height of the title bar before the system has drawn it


def first_size(window: QMainWindow) -> QSize:
    """Return the size for the first start: the usual one, or what fits on the screen."""
    title = max(TITLE_PX, window.style().pixelMetric(QStyle.PixelMetric.PM_TitleBarHeight))
    border = 2 * window.style().pixelMetric(QStyle.PixelMetric.PM_MdiSubWindowFrameWidth)
    room = window.screen().availableSize() - QSize(border, title + border)
    return USUAL.boundedTo(room)


def placed(inner: QRect, frame: QRect, room: QRect) -> QRect:
    """Return the inner rectangle of a window moved and shrunk so that its frame lies within ``room``."""
    if room.contains(frame):
        return inner
    wider, higher = frame.width() - inner.width(), frame.height() - inner.height()
    size = inner.size().boundedTo(room.size() - QSize(wider, higher))
    left = min(max(frame.left(), room.left()), room.right() + 1 - size.width() - wider)
    top = min(max(frame.top(), room.top()), room.bottom() + 1 - size.height() - higher)
    return QRect(left + inner.left() - frame.left(), top + inner.top() - frame.top(), size.width(), size.height())


def keep_within_screen(window: QMainWindow) -> None:
    """Move and shrink a shown window so that its frame is on the screen."""
    if window.isMaximized() or window.isFullScreen() or not window.isVisible():
        return
    inner = window.geometry()
    wanted = placed(inner, window.frameGeometry(), window.screen().availableGeometry())
    if wanted != inner:
        window.setGeometry(wanted)
