"""How long a fit may take: what its search asks at every step, so that no file can keep it for ever.

Compiling is not counted: at a first start it takes a minute or two, and is nobody's data's doing.  Nor is what other
programs take of the processor: the lesser counts of the time that passed and of the processor's.
"""

import threading
import time
from functools import cache
from typing import Any

from analysis.shot.shot import Cancelled, Stop

SECONDS = 20.0  # a shot; a usual fit takes one
_Times = tuple[float, float]  # that passed, and of the processor, in s


class FitTime:
    """Says when a fit has to stop: asked by whoever waits for it, or out of its time."""

    def __init__(self, seconds: float, cancelled: Stop | None = None) -> None:
        """Begin: ``seconds`` from now on, at least one."""
        self.seconds = max(seconds, 1.0)
        self._cancelled = cancelled
        self._worked = _compiling().beside
        self._begun = self._worked()
        self.over = False

    def __call__(self) -> bool:
        """Return whether to stop; raises Cancelled where that was asked for."""
        if self._cancelled is not None and self._cancelled():
            raise Cancelled
        spent = min(now - begun for now, begun in zip(self._worked(), self._begun, strict=True))
        self.over = self.over or spent > self.seconds
        return self.over

    @property
    def words(self) -> str:
        """Get what is said of a fit that was stopped."""
        return f"no end of the fit after {self.seconds:g} s: the model does not come near, or a unit is wrong"


def _now() -> _Times:
    return time.monotonic(), time.process_time()


def _less(one: _Times, other: _Times) -> _Times:
    return one[0] - other[0], one[1] - other[1]


@cache
def _compiling() -> Any:
    """Return what tells the time beside compiling, in whichever thread; numba is long loaded where one fits."""
    from numba.core import event

    class Compiling(event.Listener):  # type: ignore[misc]
        def __init__(self) -> None:
            self._lock = threading.Lock()
            self._open, self._since, self._sum = 0, (0.0, 0.0), (0.0, 0.0)

        def on_start(self, event: Any) -> None:
            with self._lock:
                if self._open == 0:
                    self._since = _now()
                self._open += 1

        def on_end(self, event: Any) -> None:
            with self._lock:
                if self._open == 1:
                    self._sum = _less(self._sum, _less(self._since, _now()))
                self._open = max(0, self._open - 1)

        def beside(self) -> _Times:
            """Return the time that was not spent with compiling, since some moment."""
            with self._lock:
                return _less(self._since if self._open else _now(), self._sum)

    counting = Compiling()
    event.register("numba:compile", counting)  # type: ignore[no-untyped-call]
    return counting
