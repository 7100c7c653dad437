"""The captured shots of this session: whether saved or only in memory, and their analysis."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from analysis.shot import Shot
from instrument.capture.analysis_thread import AnalysisThread, Done, ShotAnalysis
from instrument.capture.recorder import Recorded, save_elsewhere
from instrument.capture.snapshot import CapturedShot
from instrument.files import RecordingError, SomeShotsNotSaved

SHOTS_IN_SNAPSHOT = 16  # analysed shots kept, the newest ones; a reader that needs more must keep them


class CapturedShots:
    """Follows each captured shot; ``recorded`` and ``analysed`` are called from the capture thread only.

    ``numbers`` gives each shot its number.
    """

    def __init__(self, analysis: ShotAnalysis | None, analysed: Done, numbers: Iterator[int]) -> None:
        self.analysis = None if analysis is None else AnalysisThread(analysis, analysed)
        self.shown: tuple[CapturedShot, ...] = ()  # all that wait, and the newest others, by the latest news
        self.taken = 0
        self._numbers = numbers
        self._unsaved: dict[str, Recorded] = {}
        self._saving = threading.Lock()

    @property
    def unsaved(self) -> tuple[str, ...]:
        """Get the names of the shots that are only in memory."""
        return tuple(self._unsaved)

    def recorded(self, recorded: Recorded) -> int | None:
        """Take a shot from the recorder; return its number if its analysis was queued, else None."""
        self.taken += 1
        number, shot, recording = next(self._numbers), recorded.shot, recorded.recording
        path = None if recording.path is None else Path(recording.path)
        if recorded.problem is not None:
            with self._saving:
                self._unsaved[recording.name] = recorded
        captured = CapturedShot(number, recording.name, path, shot.settings, problem=recorded.problem, waits=True)
        if self.analysis is None or shot.aborted or recording.samples == 0:
            self._show(_analysed(captured, None, shot.ended_early))
            return None
        self._show(captured)
        if not self.analysis.submit(number, recording):
            self._show(_analysed(captured, None, "not analysed: too many shots are waiting"))
            return None
        return number

    def analysed(self, number: int, shot: Shot | None, problem: str | None) -> None:
        """Take the result of the analysis of shot ``number``: its readings, then its fit, or both at once."""
        captured = next((one for one in self.shown if one.number == number), None)
        if captured is not None and (captured.waits or captured.awaits_fit):
            self._show(_analysed(captured, shot, problem))

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

    def _show(self, captured: CapturedShot) -> None:
        others = [one for one in self.shown if one.number != captured.number]
        done = [one.number for one in (*others, captured) if not one.waits]
        self.shown = tuple(one for one in (*others, captured) if one.number not in done[:-SHOTS_IN_SNAPSHOT])


def _analysed(captured: CapturedShot, shot: Shot | None, problem: str | None) -> CapturedShot:
    """Return the shot with a result of its analysis; ``problem`` is added to why it was not saved."""
    problems = "; ".join(one for one in (captured.problem, problem) if one)
    return replace(captured, shot=shot, problem=problems or None, waits=False)
