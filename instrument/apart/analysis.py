"""Shots analysed in a process of their own."""

from collections.abc import Callable
from functools import partial

from analysis.pipeline import analyse
from analysis.recording import Recording
from analysis.shot import AnalysisSettings, Progress, Shot
from instrument.apart.work import WorkApart
from instrument.open_recording import analysed_while_hashed


class AnalysisApart(WorkApart):
    """Analyses recordings in a child, one at a time."""

    def analyse(
        self, recording: Recording, settings: AnalysisSettings, progress: Progress, cancelled: Callable[[], bool]
    ) -> Shot:
        """Analyse a recording as ``analysis.pipeline.analyse`` does; from one thread at a time.

        A recording that is only in memory is analysed here, as it would be long on its way.  Raises AnalysisError,
        Cancelled.
        """
        if recording.path is None:
            return analyse(recording, settings, progress=progress, cancelled=cancelled)
        shot: Shot = self.run(partial(_analyse, recording.path, settings), progress, cancelled)
        return shot


def _analyse(path: str, settings: AnalysisSettings, *, progress: Progress, cancelled: Callable[[], bool]) -> Shot:
    return analysed_while_hashed(path, partial(analyse, settings=settings, progress=progress, cancelled=cancelled))
