"""Shots analysed in a process of their own."""

from collections.abc import Callable
from functools import partial

from analysis.pipeline import fitted, read
from analysis.shot.recording import Recording
from analysis.shot.shot import AnalysisSettings, Progress, Shot
from instrument.files.open_recording import analysed_while_hashed
from instrument.process.work import WorkApart


class AnalysisApart(WorkApart):
    """Analyses recordings in a child, one at a time: up to the readings, then the fit."""

    def read(
        self, recording: Recording, settings: AnalysisSettings, progress: Progress, cancelled: Callable[[], bool]
    ) -> Shot:
        """Read a recording as ``analysis.pipeline.read`` does; from one thread at a time.

        A recording that is only in memory is read here, as it would be long on its way.  Raises AnalysisError,
        Cancelled.
        """
        if recording.path is None:
            return read(recording, settings, progress=progress, cancelled=cancelled)
        shot: Shot = self.run(partial(_read, recording.path, settings), progress, cancelled)
        return shot

    def fit(self, shot: Shot, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
        """Fit a shot as ``analysis.pipeline.fitted`` does; from one thread at a time.  Raises as ``read``."""
        whole: Shot = self.run(partial(fitted, shot), progress, cancelled)
        return whole


def _read(path: str, settings: AnalysisSettings, *, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
    return analysed_while_hashed(path, partial(read, settings=settings, progress=progress, cancelled=cancelled))
