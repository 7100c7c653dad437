"""Limit the computing time of a fit.

Compilation time is not counted (a minute or two at a first start), nor is time taken by other programs: the limit
applies to the smaller of elapsed time and processor time.
"""

import contextvars
import threading
import time
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numpy as np

from analysis.shot import AnalysisError, Cancelled, Floats, Stop

Result = TypeVar("Result")

FIT_SECONDS = 20.0  # per shot; a usual fit takes 1 s
_CHECK_INTERVAL_S = 0.02  # interval between checks of the time


class FitTime:
    """The stop condition of a fit: cancelled by the caller, or out of time."""

    def __init__(self, seconds: float, cancelled: Stop | None = None) -> None:
        """Allow ``seconds`` from now, at least 1 s."""
        self.seconds = max(seconds, 1.0)
        self._cancelled = cancelled
        self._worked = _compiling().uncompiled
        self._begun = self._worked()
        self.over = False

    def __call__(self) -> bool:
        """Return whether the time is over.  Raises Cancelled if the caller cancelled."""
        if self._cancelled is not None and self._cancelled():
            raise Cancelled
        self.over = self.over or float((self._worked() - self._begun).min()) > self.seconds
        return self.over

    @property
    def words(self) -> str:
        return f"no end of the fit after {self.seconds:g} s: the model does not come near, or a unit is wrong"


def _now() -> Floats:
    """Return elapsed and processor time in s, shape (2,)."""
    return np.array([time.monotonic(), time.process_time()])


@cache
def _compiling() -> Any:
    """Return a clock that excludes compilation in any thread; numba is already loaded when a fit runs."""
    from numba.core import event

    class Compiling(event.Listener):  # type: ignore[misc]
        def __init__(self) -> None:
            self._lock = threading.Lock()
            self._open, self._since, self._sum = 0, np.zeros(2), np.zeros(2)

        def on_start(self, event: Any) -> None:
            with self._lock:
                if self._open == 0:
                    self._since = _now()
                self._open += 1

        def on_end(self, event: Any) -> None:
            with self._lock:
                if self._open == 1:
                    self._sum = self._sum + _now() - self._since
                self._open = max(0, self._open - 1)

        def uncompiled(self) -> Floats:
            """Return the time not spent on compilation, from an arbitrary zero."""
            with self._lock:
                return np.asarray((self._since if self._open else _now()) - self._sum)

    counting = Compiling()
    event.register("numba:compile", counting)  # type: ignore[no-untyped-call]
    return counting


def run_with_time_limit(
    work: Callable[[], Result], seconds: float, cancelled: Stop | None = None, words: str | None = None
) -> Result:
    """Return the result of ``work``, or raise its exception; AnalysisError with ``words`` after ``seconds``.

    The work runs in a separate thread, because a kernel cannot be interrupted.  A thread that does not end is
    abandoned: it holds no lock, ends with the process, and its result is dropped.  Raises Cancelled.
    """
    left = FitTime(seconds, cancelled)
    result: list[Result] = []
    raised: list[BaseException] = []

    def run() -> None:
        try:
            result.append(work())
        except BaseException as error:  # raised again in the caller's thread
            raised.append(error)

    context = contextvars.copy_context()  # includes numpy's handling of overflows
    thread = threading.Thread(target=context.run, args=(run,), name="levimass fit", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_CHECK_INTERVAL_S)
        if thread.is_alive() and left():
            raise AnalysisError(words or left.words)
    if raised:
        raise raised[0]
    return result[0]
