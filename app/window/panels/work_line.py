"""The status line: messages, progress of the work with Cancel, buttons."""

import math

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QProgressBar, QPushButton, QWidget

from app.session import Job, Jobs
from app.window.panels.notice import NoticeLine
from app.window.theme import Colours
from app.window.widgets import push_button


def _remaining(job: Job) -> str:
    """Return the estimated remaining time of a job, "" while it is not known."""
    left_s = job.remaining_s()
    if left_s is None:
        return ""
    return f", {math.ceil(left_s)} s left" if left_s < 90 else f", {math.ceil(left_s / 60)} min left"


class WorkLine(QWidget):
    """Messages, progress, and the buttons for settings and keys."""

    cancel_wanted = Signal()
    settings_wanted = Signal()
    keys_wanted = Signal()
    setup_wanted = Signal()

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        self.notices = NoticeLine(colours, self)
        self.progress = QProgressBar(self)
        self.progress.setRange(0, 1000)
        self.progress.setMaximumWidth(
            self.fontMetrics().horizontalAdvance("M first start: compiling the simulated bench (+12)")
        )
        self.progress.setAccessibleName("Work under way")
        self._cancel = push_button("Cancel", "Cancel all background work", self)
        policy = self._cancel.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self._cancel.setSizePolicy(policy)
        for widget in (self.progress, self._cancel):  # without work the messages use their room
            widget.hide()
        settings = push_button("Settings", "Mass, air, wavelength, bandwidth, trigger, folders  (F2)", self)
        setup = QPushButton("Set-up", self)
        setup.setToolTip("Find devices, permission, check the signals before arming  (F3)")
        setup.clicked.connect(self.setup_wanted)
        keys = push_button("Keys", "All keys on one sheet  (F1)", self)
        row.addWidget(self.notices, 1)
        row.addWidget(self.progress, 1)
        for widget in (self._cancel, setup, settings, keys):
            row.addWidget(widget)
        self._cancel.clicked.connect(self.cancel_wanted)
        settings.clicked.connect(self.settings_wanted)
        keys.clicked.connect(self.keys_wanted)

    def show_work(self, jobs: Jobs, rig_doing: str | None, rig_share: float | None) -> None:
        """Show the job that runs, else what the rig does."""
        job = jobs.current
        busy = job is not None or rig_doing is not None
        if self.progress.isHidden() == busy:
            self.progress.setVisible(busy)
        if self._cancel.isHidden() == (job is not None):
            self._cancel.setVisible(job is not None)
        if job is not None:
            waiting = jobs.open_jobs - 1
            more = f" (+{waiting})" if waiting > 0 else ""
            doing = f"{job.name}: {job.what}" if job.what else job.name
            self._show(doing, f"{more}{_remaining(job)}", job.fraction)
        elif rig_doing is not None:
            self._show(rig_doing, "", rig_share or 0.0)

    def _show(self, doing: str, left: str, share: float) -> None:
        """Show what is done and what is left of it, which is never cut."""
        metrics = self.fontMetrics()
        room = self.progress.width() - metrics.horizontalAdvance("M") - metrics.horizontalAdvance(left)
        words = f"{doing}{left}"
        fitting = f"{metrics.elidedText(doing, Qt.TextElideMode.ElideRight, room)}{left}"
        if self.progress.format() != fitting:
            self.progress.setFormat(fitting)
            self.progress.setToolTip(words)
        self.progress.setValue(round(1000 * share))
