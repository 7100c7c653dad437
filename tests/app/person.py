"""A person at the window: finds things by what a screen reader says of them, presses mouse and keys, looks.

Nothing of the program is called.  What is on the screen is read from Qt's accessibility tree, so that whatever this
person finds and reads, a screen reader finds and reads too; a thing without a name cannot be pressed here.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QAccessible, QAccessibleInterface, QGuiApplication, QKeySequence, QWindow
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QScrollArea

Role = QAccessible.Role
NO_KEYS = Qt.KeyboardModifier.NoModifier
LONGEST_S = 60.0
_MAX_TABS = 80  # to something that lies further down in a sheet
_HAND_MS = 60  # between two movements of a quick hand


class NotOnScreen(AssertionError):
    """What was looked for in vain."""


@dataclass(frozen=True, slots=True)
class Thing:
    """Something on the screen as a screen reader tells of it; ``place`` in the screen's own units."""

    role: Role
    name: str
    description: str
    value: str
    place: QRect
    enabled: bool
    in_view: bool = True  # not scrolled out of sight


class Person:
    """One pair of eyes and hands; pictures of the whole screen go to a folder, numbered."""

    def __init__(self, pictures: Path) -> None:
        QAccessible.setActive(True)
        self.pictures = pictures
        pictures.mkdir(parents=True, exist_ok=True)
        self._taken = 0

    # eyes ---------------------------------------------------------------------------------------------------------

    def things(self) -> Iterator[Thing]:
        """Yield everything that can be seen now, windows in front first."""
        windows = [widget for widget in QApplication.topLevelWidgets() if widget.isVisible()]
        for widget in sorted(windows, key=lambda w: (not _in_front(w), not w.isActiveWindow())):
            root = QAccessible.queryAccessibleInterface(widget)
            if root is not None:
                yield from _walk(root)

    def find(self, name: str, role: Role | None = None) -> Thing | None:
        """Return the first thing in view of this name, or None."""
        fit = (t for t in self.things() if t.name == name and (role is None or t.role == role))
        return next(fit, None)

    def see(self, name: str, role: Role | None = None, longest_s: float = LONGEST_S) -> Thing:
        """Wait until a thing of this name is in view and can be used.  Raises NotOnScreen."""
        found: list[Thing] = []

        def there() -> bool:
            thing = self.find(name, role)
            if thing is not None and thing.enabled:
                found.append(thing)
            return bool(found)

        self.wait(f"{name!r} to press", there, longest_s)
        return found[-1]

    def reads(self, words: str) -> bool:
        """Return whether these words stand anywhere on the screen."""
        return any(words in text for t in self.things() for text in (t.name, t.description, t.value))

    def wait_to_read(self, words: str, longest_s: float = LONGEST_S) -> None:
        """Wait until these words stand on the screen.  Raises NotOnScreen."""
        self.wait(f"{words!r} to read", lambda: self.reads(words), longest_s)

    def wait(self, what: str, until: Callable[[], bool], longest_s: float = LONGEST_S) -> None:
        """Wait until something is so.  Raises NotOnScreen."""
        end = time.monotonic() + longest_s
        while not until():
            if time.monotonic() > end:
                self.picture("in-vain")
                raise NotOnScreen(f"waited {longest_s:g} s in vain for {what}")
            QTest.qWait(120)

    def picture(self, name: str) -> Path:
        """Take a picture of the whole screen."""
        self._taken += 1
        path = self.pictures / f"{self._taken:02d}-{name}.png"
        QTest.qWait(150)
        QGuiApplication.primaryScreen().grabWindow(0).save(str(path))
        return path

    # hands --------------------------------------------------------------------------------------------------------

    def click(self, name: str, role: Role | None = None, keys: Qt.KeyboardModifier = NO_KEYS) -> None:
        """Press the left button in the middle of the thing of this name; one out of view is gone to by Tab first."""
        for _ in range(_MAX_TABS):
            thing = self.see(name, role)
            if thing.in_view:
                break
            self.press("Tab")
        self.click_at(thing.place.center(), keys)

    def click_at(self, where: QPoint, keys: Qt.KeyboardModifier = NO_KEYS, twice: bool = False) -> None:
        """Press the left button at a place of the screen."""
        window = self._window_at(where)
        spot = window.mapFromGlobal(where)
        QTest.mouseMove(window, spot)
        QTest.qWait(_HAND_MS)
        press = QTest.mouseDClick if twice else QTest.mouseClick
        press(window, Qt.MouseButton.LeftButton, keys, spot)
        QTest.qWait(_HAND_MS)

    def right_click_at(self, where: QPoint) -> None:
        """Press the right button at a place of the screen."""
        window = self._window_at(where)
        QTest.mouseClick(window, Qt.MouseButton.RightButton, NO_KEYS, window.mapFromGlobal(where))
        QTest.qWait(_HAND_MS)

    def point_at(self, where: QPoint) -> None:
        """Rest the mouse at a place of the screen until a tooltip would show."""
        window = self._window_at(where)
        for step in (QPoint(-3, 0), QPoint(0, 0)):
            QTest.mouseMove(window, window.mapFromGlobal(where + step))
            QTest.qWait(_HAND_MS)
        QTest.qWait(1000)

    def press(self, keys: str, times: int = 1) -> None:
        """Press keys by their names: "Ctrl+T", "Space", "Return"."""
        for _ in range(times):
            (stroke,) = QKeySequence(keys)
            QTest.keyClick(self._window_of_keys(), stroke.key(), stroke.keyboardModifiers())
            QTest.qWait(_HAND_MS)

    def type(self, text: str) -> None:
        """Type a text letter by letter."""
        for letter in text:
            QTest.keyClick(self._window_of_keys(), letter)
        QTest.qWait(_HAND_MS)

    def choose(self, box: str, item: str) -> None:
        """Open a box of choices, known by its label or by what it shows, and click on one."""
        self.click(box, Role.ComboBox)
        self.wait(f"the choice {item!r}", lambda: self.find(item, Role.ListItem) is not None)
        QTest.qWait(QApplication.doubleClickInterval() + 50)  # Qt takes a faster click for the one that opened the box
        self.click(item, Role.ListItem)

    def answer(self, title: str, path: Path) -> None:
        """Type a path into the question for a file of this title, and press Enter."""
        self.bring_to_front(title)
        QTest.qWait(200)
        self.press("Ctrl+A")
        self.type(str(path))
        self.picture("question")
        self.press("Return")
        self.wait("the question to close", lambda: _titled(title) is None)
        self.bring_to_front("Levimass")

    def bring_to_front(self, title: str) -> None:
        """Do what a window manager does for a new window: a virtual screen has none."""
        self.wait(f"the window {title!r}", lambda: _titled(title) is not None)
        window = _titled(title)
        assert window is not None
        window.requestActivate()
        self.wait(f"{title!r} in front", lambda: QGuiApplication.focusWindow() is window)

    def _window_at(self, where: QPoint) -> QWindow:
        there = [w for w in QGuiApplication.topLevelWindows() if w.isVisible() and w.geometry().contains(where)]
        if not there:
            raise NotOnScreen(f"there is no window at {where.x()}, {where.y()}")
        return max(there, key=lambda w: (w.type() == Qt.WindowType.Popup, w.isActive()))

    def _window_of_keys(self) -> QWindow:
        windows = [w for w in QGuiApplication.topLevelWindows() if w.isVisible()]
        popups = [w for w in windows if w.type() == Qt.WindowType.Popup]
        focused = QGuiApplication.focusWindow()
        if not popups and focused is None:
            raise NotOnScreen("no window has the keyboard")
        return popups[-1] if popups else focused


def _titled(title: str) -> QWindow | None:
    return next((w for w in QGuiApplication.topLevelWindows() if w.title() == title and w.isVisible()), None)


def _in_front(widget: object) -> bool:
    return widget in (QApplication.activePopupWidget(), QApplication.activeModalWidget())


def _label(box: QAccessibleInterface) -> str:
    """Return what stands beside a box of choices, whose own name is the present choice."""
    if box.role() is not Role.ComboBox:
        return ""
    labels = (other for other, how in box.relations() if how == QAccessible.RelationFlag.Label)
    return next((label.text(QAccessible.Text.Name) for label in labels), "")


def _walk(thing: QAccessibleInterface, seen_through: QRect | None = None) -> Iterator[Thing]:
    """Yield a thing and all within it; ``seen_through`` is the part of the screen that areas around it scroll in."""
    state = thing.state()
    if not thing.isValid() or state.invisible:
        return
    text = QAccessible.Text
    yield Thing(
        thing.role(),
        _label(thing) or thing.text(text.Name),
        thing.text(text.Description),
        thing.text(text.Value),
        thing.rect(),
        not state.disabled,
        seen_through is None or seen_through.contains(thing.rect().center()),
    )
    if isinstance(area := thing.object(), QScrollArea):
        port = area.viewport()
        rect = QRect(port.mapToGlobal(QPoint(0, 0)), port.size())
        seen_through = rect if seen_through is None else rect.intersected(seen_through)
    for index in range(thing.childCount()):
        child = thing.child(index)
        if child is not None:
            yield from _walk(child, seen_through)
