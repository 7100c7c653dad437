"""What becomes of a shot once its samples are in: saved or kept in memory, analysed, and shown to whoever asks."""

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from analysis.fitted.fitted_shot import awaits_fit
from analysis.shot.shot import Shot
from instrument.capture.analyst import Analyse, Analyst, Fit
from instrument.capture.recorder import Recorded, save_elsewhere
from instrument.devices.digitizer import CaptureSettings
from instrument.files.recording_error import PartlySaved, RecordingError
from instrument.live.snapshot import FinishedShot, WaitingShot

KEPT = 16  # newest shots that a snapshot carries; whoever wants more keeps them
ABORTED = "aborted"

Waiting = tuple[str, Path | None, CaptureSettings, str | None]  # (name, path, settings, why it was not saved)


class FinishedShots:
    """The shots of this session after their capture.  ``recorded`` and ``analysed`` belong to the capture thread."""

    def __init__(
        self,
        analyse: Analyse | None,
        analysed: Callable[[int, Shot | None, str | None], None],
        queue_length: int,
        fit: Fit,
    ) -> None:
        self.analyst = None if analyse is None else Analyst(analyse, analysed, queue_length, fit)
        self.newest: tuple[FinishedShot, ...] = ()
        self.taken = 0
        self._settled = 0
        self._waiting: dict[int, Waiting] = {}
        self._read: dict[int, int] = {}  # by the numbers of shots that await their fit, the indices they are told by
        self._unsaved: dict[str, Recorded] = {}
        self._saving = threading.Lock()

    @property
    def analysing(self) -> int:
        """Get the number of shots captured and not analysed yet."""
        return len(self._waiting)

    @property
    def waiting(self) -> tuple[WaitingShot, ...]:
        """Get the shots captured and not analysed yet, oldest first."""
        return tuple(WaitingShot(number, name, path) for number, (name, path, _, _) in list(self._waiting.items()))

    @property
    def unsaved(self) -> tuple[str, ...]:
        """Get the names of the shots that are only in memory."""
        return tuple(self._unsaved)

    def recorded(self, recorded: Recorded) -> int | None:
        """Take a shot from the recorder; return its number where its analysis was begun, else None."""
        self.taken += 1
        shot, recording = recorded.shot, recorded.recording
        path = None if recording.path is None else Path(recording.path)
        if recorded.problem is not None:
            with self._saving:
                self._unsaved[recording.name] = recorded
        waiting: Waiting = (recording.name, path, shot.settings, recorded.problem)
        if self.analyst is None or shot.ended_early == ABORTED or recording.samples == 0:
            self._settle(waiting, None, shot.ended_early)
            return None
        self._waiting[self.taken] = waiting
        if not self.analyst.submit(self.taken, recording):
            self._settle(self._waiting.pop(self.taken), None, "not analysed: too many shots are waiting")
            return None
        return self.taken

    def analysed(self, number: int, shot: Shot | None, problem: str | None) -> None:
        """Take what the analysis made of shot ``number``: its readings, then its fit, or both at once."""
        waiting = self._waiting.pop(number, None)
        if waiting is not None:
            self._settle(waiting, shot, problem)
            if shot is not None and awaits_fit(shot):
                self._read[number] = self._settled
        elif (index := self._read.pop(number, None)) is not None:
            self.newest = tuple(
                replace(done, shot=shot, fitted_later=True) if done.index == index else done for done in self.newest
            )

    def save_pending(self, folder: Path) -> list[Path]:
        """Save the shots that are only in memory; PartlySaved at the first that cannot be saved."""
        saved: dict[str, Path] = {}
        with self._saving:
            for name, recorded in list(self._unsaved.items()):
                try:
                    saved[name] = save_elsewhere(recorded.recording, folder)
                except RecordingError as error:
                    raise PartlySaved(error, saved) from error
                del self._unsaved[name]
                if recorded.partial is not None:
                    recorded.partial.abandon()
        return list(saved.values())

    def _settle(self, waiting: Waiting, shot: Shot | None, problem: str | None) -> None:
        name, path, settings, unsaved = waiting
        self._settled += 1
        problems = "; ".join(p for p in (unsaved, problem) if p)
        done = FinishedShot(self._settled, name, path, settings, shot, problems or None)
        self.newest = (*self.newest, done)[-KEPT:]
