"""Waiting for work no longer than it may take: what a search cannot be asked to stop, as a kernel that goes on alone.

The work runs in a thread of its own, which is left behind where it does not end: it holds no lock, ends with the
process, and what it would have returned is dropped.
"""

import contextvars
import threading
from collections.abc import Callable
from typing import TypeVar

from analysis.fitted.fit_time import FitTime
from analysis.shot.shot import AnalysisError, Stop

Made = TypeVar("Made")
_LOOK_S = 0.02


def waited_for(
    work: Callable[[], Made], seconds: float, cancelled: Stop | None = None, words: str | None = None
) -> Made:
    """Return what ``work`` returns, or raise what it raises; after ``seconds`` AnalysisError.

    Raises Cancelled, too; ``FitTime`` says how the seconds count.  ``words`` stand for its own.
    """
    left = FitTime(seconds, cancelled)
    made: list[Made] = []
    raised: list[BaseException] = []

    def run() -> None:
        try:
            made.append(work())
        except BaseException as error:  # handed on to whoever waits
            raised.append(error)

    context = contextvars.copy_context()  # numpy's way with overflows goes along
    thread = threading.Thread(target=context.run, args=(run,), name="levimass fit", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_LOOK_S)
        if thread.is_alive() and left():
            raise AnalysisError(words or left.words)
    if raised:
        raise raised[0]
    return made[0]
