"""The first window fits its screen with its title bar; one restored from a larger screen is brought back."""

import pytest
from PySide6.QtCore import QRect, QSize
from PySide6.QtWidgets import QMainWindow

from app.window.panels.layout import USUAL, first_size, keep_within_screen, placed

ROOM = QRect(0, 0, 1366, 738)


@pytest.mark.parametrize(
    ("frame", "wanted"),
    [
        (QRect(100, 50, 900, 600), QRect(100, 50, 900, 600)),
        (QRect(0, 0, 1366, 775), QRect(0, 0, 1366, 738)),  # as it opened: its lower buttons were off the screen
        (QRect(900, 300, 900, 600), QRect(466, 138, 900, 600)),
        (QRect(-50, -20, 2000, 900), QRect(0, 0, 1366, 738)),
    ],
)
def test_the_frame_lies_on_the_screen(frame, wanted):
    inside = frame.adjusted(2, 37, -2, -2)
    assert placed(inside, frame, ROOM).adjusted(-2, -37, 2, 2) == wanted


def test_the_first_size_leaves_room_for_a_title_bar(qtbot, monkeypatch):
    window = QMainWindow()
    qtbot.addWidget(window)

    class Screen:
        def availableSize(self):
            return self.size

    screen = Screen()
    monkeypatch.setattr(window, "screen", lambda: screen)
    for room in (QSize(1366, 768), QSize(960, 540)):
        screen.size = room
        size = first_size(window)
        assert size.height() <= room.height() - 40 and size.width() <= room.width()
    screen.size = QSize(2560, 1440)
    assert first_size(window) == USUAL


def test_a_window_beyond_the_edge_comes_back(qtbot):
    window = QMainWindow()
    qtbot.addWidget(window)
    room = window.screen().availableGeometry()
    window.setGeometry(room.right() - 50, room.bottom() - 50, 400, 300)
    window.show()
    keep_within_screen(window)
    assert room.contains(window.frameGeometry())
