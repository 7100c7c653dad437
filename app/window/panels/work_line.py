"""The status line: messages that stay until dismissed, their list, progress of jobs, and buttons."""

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime

from PySide6.QtCore import Qt, QTimer, Signal, Slot
from PySide6.QtGui import QColor, QGuiApplication
from PySide6.QtWidgets import QFrame, QListWidget, QListWidgetItem, QProgressBar, QWidget

from app.session import Job, Jobs
from app.window.controls.theme import MARKS, Colours, Themed, Tone
from app.window.controls.widgets import (
    Sheet,
    added,
    horizontal,
    hover_text,
    keep_place,
    push_button,
    set_tone,
    text_label,
)

KEPT = 20
LISTED = 200  # most messages in the list
AGED_EVERY_MS = 20_000


@dataclass(slots=True, eq=False)
class Notice:
    """A message with its tone and, optionally, a button's label and action."""

    words: str
    tone: Tone
    label: str = ""
    do: Callable[[], object] | None = None
    declined: Callable[[], object] | None = None  # called if the message is dismissed
    shown_s: float = 0.0  # monotonic time at which it was last shown


class NoticeLine(QFrame):
    """Shows the newest message, its age and the number of others; its height is fixed."""

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._notices: list[Notice] = []
        self.history: deque[tuple[datetime, Notice]] = deque(maxlen=LISTED)
        row = horizontal(self, (12, 0, 4, 0))
        self._words = text_label("", self, elide=Qt.TextElideMode.ElideRight, selectable=True, bold=True)
        self._words.setAccessibleName("Newest message")
        self._do = push_button("Do it", "Do what the message offers", self, self._done)
        self._close = push_button("Dismiss", "Dismiss this message", self, self.next)
        self.all = push_button("All …", "All messages of this run, with their times", self, command="toggle:messages")
        self.all.setAccessibleName("All messages")
        row.addWidget(self._words, 1)
        for button in (self.all, self._do, self._close):
            row.addWidget(button)
        self.setFixedHeight(self._close.sizeHint().height() + 2)
        self._ageing = QTimer(self)
        self._ageing.timeout.connect(self._refresh)
        self._ageing.start(AGED_EVERY_MS)
        self._refresh()

    @property
    def words(self) -> str:
        return self._notices[-1].words if self._notices else ""

    def say(
        self,
        words: str,
        tone: Tone,
        label: str = "",
        do: Callable[[], object] | None = None,
        declined: Callable[[], object] | None = None,
    ) -> None:
        """Show a message, with a button if it has a ``label``; a repetition of the newest message is shown once."""
        newest = self._notices[-1] if self._notices else None
        if newest is None or (newest.words, newest.tone) != (words, tone):
            notice = Notice(words, tone, label, do, declined)
            self._notices.append(notice)
            del self._notices[:-KEPT]
            self.history.append((datetime.now(), notice))
            self.changed.emit()
        self._notices[-1].shown_s = time.monotonic()
        self._refresh()

    def _age(self) -> str:
        """Return the age of the newest message, "" below one minute."""
        minutes = int((time.monotonic() - self._notices[-1].shown_s) / 60)
        if minutes < 1:
            return ""
        return f"   ({minutes} min ago)" if minutes < 60 else f"   ({minutes // 60} h ago)"

    @Slot()
    def _done(self) -> None:
        notice = self._notices.pop()
        self._refresh()
        if notice.do is not None:
            notice.do()

    @Slot()
    def next(self) -> None:
        if self._notices:
            notice = self._notices.pop()
            if notice.declined is not None:
                notice.declined()
        self._refresh()

    @Slot()
    def _refresh(self) -> None:
        self._close.setVisible(bool(self._notices))
        self._do.setVisible(bool(self._notices and self._notices[-1].label))
        if not self._notices:
            self._words.setText("")
            self._words.setToolTip("")
            self._words.setAccessibleDescription("")
            return
        newest = self._notices[-1]
        self._do.setText(newest.label)
        self._do.setAccessibleName(newest.label or "Do what the message offers")
        more = f"   ({len(self._notices) - 1} more)" if len(self._notices) > 1 else ""
        whole = f"{MARKS[newest.tone]} {newest.words}{more}{self._age()}"
        self._words.setText(whole)
        self._words.setToolTip("\n".join(notice.words for notice in reversed(self._notices)))
        self._words.setAccessibleDescription(whole)
        set_tone(self._words, newest.tone)


class NoticeList(Themed, Sheet):
    """The list of all messages of this run, newest first."""

    def __init__(self, notices: NoticeLine, parent: QWidget | None = None) -> None:
        super().__init__("Messages", parent)
        self._notices = notices
        column, _ = self.head("Messages", "Close the list  (F6 or Esc)")
        self.list = QListWidget(self)
        self.list.setAccessibleName("Messages, newest first")
        self.list.setWordWrap(True)
        self.list.setSelectionMode(QListWidget.SelectionMode.ExtendedSelection)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        column.addWidget(self.list, 1)
        self.copy = added(column, push_button("Copy", "Copy the selected messages, or all", self, self._copy))
        notices.changed.connect(self._refresh)

    def open(self) -> None:
        self._refresh(True)
        self.open_at(self.list)

    def apply_colours(self, colours: Colours) -> None:
        super().apply_colours(colours)
        self._refresh()

    @Slot()
    def _refresh(self, opening: bool = False) -> None:
        if self.isHidden() and not opening:
            return
        self.list.clear()
        for at, notice in reversed(self._notices.history):
            item = QListWidgetItem(f"{at:%H:%M:%S}  {MARKS[notice.tone]} {notice.words}")
            item.setForeground(QColor(self.colours.signs[notice.tone]))
            self.list.addItem(item)
        if not self._notices.history:
            self.list.addItem("No message yet.")

    @Slot()
    def _copy(self) -> None:
        items = self.list.selectedItems() or [self.list.item(row) for row in range(self.list.count())]
        QGuiApplication.clipboard().setText("\n".join(item.text() for item in items))


def _remaining(job: Job) -> str:
    """Return the estimated remaining time of a job, "" while it is unknown."""
    left_s = job.remaining_s()
    if left_s is None:
        return ""
    return f", {math.ceil(left_s)} s left" if left_s < 90 else f", {math.ceil(left_s / 60)} min left"


class WorkLine(QWidget):
    """The status line: messages, progress, and the buttons for set-up, settings and keys."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        row = horizontal(self)
        self.notices = NoticeLine(self)
        self.progress = QProgressBar(self)
        self.progress.setRange(0, 1000)
        self.progress.setMaximumWidth(
            self.fontMetrics().horizontalAdvance("M first start: compiling the simulated bench (+12)")
        )
        self.progress.setAccessibleName("Work under way")
        self.cancel = push_button("Cancel", "Cancel all background work", self)
        keep_place(self.cancel)
        for widget in (self.progress, self.cancel):  # without jobs the messages get their space
            widget.hide()
        hover = "Mass, air, wavelength, bandwidth, trigger, folders"
        self.settings = push_button("Settings", hover, self, command="toggle_settings")
        hover = "Find devices, permission, check the signals before arming"
        self.setup = push_button("Set-up", hover, self, command="toggle_setup")
        self.keys = push_button("Keys", "All keys on one sheet", self, command="toggle:keys")
        row.addWidget(self.notices, 1)
        row.addWidget(self.progress, 1)
        for widget in (self.cancel, self.setup, self.settings, self.keys):
            row.addWidget(widget)

    def show_work(self, jobs: Jobs, rig_doing: str | None, rig_share: float | None) -> None:
        """Show the running job, else the rig's activity."""
        job = jobs.current
        self.progress.setVisible(job is not None or rig_doing is not None)
        self.cancel.setVisible(job is not None)
        if job is not None:
            waiting = jobs.open_jobs - 1
            more = f" (+{waiting})" if waiting > 0 else ""
            doing = f"{job.name}: {job.what}" if job.what else job.name
            self._show(doing, f"{more}{_remaining(job)}", job.fraction)
        elif rig_doing is not None:
            self._show(rig_doing, "", rig_share or 0.0)

    def _show(self, doing: str, left: str, share: float) -> None:
        """Show the job and its remaining time; only the job's name is shortened."""
        metrics = self.fontMetrics()
        room = self.progress.width() - metrics.horizontalAdvance("M") - metrics.horizontalAdvance(left)
        words = f"{doing}{left}"
        fitting = f"{metrics.elidedText(doing, Qt.TextElideMode.ElideRight, room)}{left}"
        if self.progress.format() != fitting:
            self.progress.setFormat(fitting)
            self.progress.setToolTip(hover_text(words))
        self.progress.setValue(round(1000 * share))
