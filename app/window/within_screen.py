"""A window that fits the screen it opens on with its title bar: the buttons at its lower edge can be reached."""

from PySide6.QtCore import QRect, QSize
from PySide6.QtWidgets import QMainWindow, QStyle

USUAL = QSize(1480, 920)
TITLE_PX = 40  # of the title bar before the system has drawn one; most are lower


def first_size(window: QMainWindow) -> QSize:
    """Return the size of a window that was never shown: the usual one, or what its screen leaves for it."""
    title = max(TITLE_PX, window.style().pixelMetric(QStyle.PixelMetric.PM_TitleBarHeight))
    border = 2 * window.style().pixelMetric(QStyle.PixelMetric.PM_MdiSubWindowFrameWidth)
    room = window.screen().availableSize() - QSize(border, title + border)
    return USUAL.boundedTo(room)


def placed(inner: QRect, frame: QRect, room: QRect) -> QRect:
    """Return where a window's inside belongs so that its frame lies within ``room``; as it is where it does."""
    if room.contains(frame):
        return inner
    wider, higher = frame.width() - inner.width(), frame.height() - inner.height()
    size = inner.size().boundedTo(room.size() - QSize(wider, higher))
    left = min(max(frame.left(), room.left()), room.right() + 1 - size.width() - wider)
    top = min(max(frame.top(), room.top()), room.bottom() + 1 - size.height() - higher)
    return QRect(left + inner.left() - frame.left(), top + inner.top() - frame.top(), size.width(), size.height())


def keep_within_screen(window: QMainWindow) -> None:
    """Move and shrink a shown window until its frame lies on its screen; maximised it does already."""
    if window.isMaximized() or window.isFullScreen() or not window.isVisible():
        return
    inner = window.geometry()
    wanted = placed(inner, window.frameGeometry(), window.screen().availableGeometry())
    if wanted != inner:
        window.setGeometry(wanted)
