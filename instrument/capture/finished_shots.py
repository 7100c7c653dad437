"""The captured shots of this session: whether saved or only in memory, and their analysis."""

import threading
from dataclasses import replace
from pathlib import Path

from analysis.fitted import fit_pending
from analysis.shot import Shot
from instrument.capture.analysis_thread import AnalysisThread, Done, ShotAnalysis
from instrument.capture.recorder import Recorded, save_elsewhere
from instrument.capture.snapshot import FinishedShot, WaitingShot
from instrument.files import RecordingError, SomeShotsNotSaved

SHOTS_IN_SNAPSHOT = 16  # the newest ones; a reader that needs more must keep them
ABORTED = "aborted"


class FinishedShots:
    """Follows each captured shot; ``recorded`` and ``analysed`` are called from the capture thread only."""

    def __init__(self, analysis: ShotAnalysis | None, analysed: Done) -> None:
        self.analysis = None if analysis is None else AnalysisThread(analysis, analysed)
        self.newest: tuple[FinishedShot, ...] = ()
        self.taken = 0
        self._finished = 0
        self._waiting: dict[int, FinishedShot] = {}  # without index and shot; ``problem``: why it was not saved
        self._awaiting_fit: dict[int, int] = {}  # number of the shot: index of its FinishedShot
        self._unsaved: dict[str, Recorded] = {}
        self._saving = threading.Lock()

    @property
    def waiting(self) -> tuple[WaitingShot, ...]:
        """Get the shots captured and not analysed yet, oldest first."""
        return tuple(WaitingShot(number, shot.name, shot.path) for number, shot in list(self._waiting.items()))

    @property
    def unsaved(self) -> tuple[str, ...]:
        """Get the names of the shots that are only in memory."""
        return tuple(self._unsaved)

    def recorded(self, recorded: Recorded) -> int | None:
        """Take a shot from the recorder; return its number if its analysis was queued, else None."""
        self.taken += 1
        shot, recording = recorded.shot, recorded.recording
        path = None if recording.path is None else Path(recording.path)
        if recorded.problem is not None:
            with self._saving:
                self._unsaved[recording.name] = recorded
        waiting = FinishedShot(0, recording.name, path, shot.settings, None, recorded.problem)
        if self.analysis is None or shot.ended_early == ABORTED or recording.samples == 0:
            self._finish(waiting, None, shot.ended_early)
            return None
        self._waiting[self.taken] = waiting
        if not self.analysis.submit(self.taken, recording):
            self._finish(self._waiting.pop(self.taken), None, "not analysed: too many shots are waiting")
            return None
        return self.taken

    def analysed(self, number: int, shot: Shot | None, problem: str | None) -> None:
        """Take the result of the analysis of shot ``number``: its readings, then its fit, or both at once."""
        waiting = self._waiting.pop(number, None)
        if waiting is not None:
            self._finish(waiting, shot, problem)
            if shot is not None and fit_pending(shot):
                self._awaiting_fit[number] = self._finished
        elif (index := self._awaiting_fit.pop(number, None)) is not None:
            self.newest = tuple(replace(done, shot=shot) if done.index == index else done for done in self.newest)

    def save_pending(self, folder: Path) -> list[Path]:
        """Save the shots that are only in memory.  Raises SomeShotsNotSaved at the first that cannot be saved."""
        saved: dict[str, Path] = {}
        with self._saving:
            for name, recorded in list(self._unsaved.items()):
                try:
                    saved[name] = save_elsewhere(recorded.recording, folder)
                except RecordingError as error:
                    raise SomeShotsNotSaved(error, saved) from error
                del self._unsaved[name]
                if recorded.partial is not None:
                    recorded.partial.abandon()
        return list(saved.values())

    def _finish(self, waiting: FinishedShot, shot: Shot | None, problem: str | None) -> None:
        self._finished += 1
        problems = "; ".join(p for p in (waiting.problem, problem) if p)
        done = replace(waiting, index=self._finished, shot=shot, problem=problems or None)
        self.newest = (*self.newest, done)[-SHOTS_IN_SNAPSHOT:]
