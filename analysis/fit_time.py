"""How long a fit may take: what its search asks at every step, so that no file can keep it for ever.

Compiling is not counted: at a first start it takes a minute or two, and is nobody's data's doing.
"""

import threading
import time
from functools import cache
from typing import Any

from analysis.shot import Cancelled, Stop

SECONDS = 20.0  # a shot; a usual fit takes one


class FitTime:
    """Says when a fit has to stop: asked by whoever waits for it, or out of its time."""

    def __init__(self, seconds: float, cancelled: Stop | None = None) -> None:
        """Begin: ``seconds`` from now on, at least one."""
        self.seconds = max(seconds, 1.0)
        self._cancelled = cancelled
        self._compiled = _compiling().seconds
        self._begun, self._before = time.monotonic(), self._compiled()
        self.over = False

    def __call__(self) -> bool:
        """Return whether to stop; raises Cancelled where that was asked for."""
        if self._cancelled is not None and self._cancelled():
            raise Cancelled
        spent = time.monotonic() - self._begun - (self._compiled() - self._before)
        self.over = self.over or spent > self.seconds
        return self.over

    @property
    def words(self) -> str:
        """Get what is said of a fit that was stopped."""
        return f"no end of the fit after {self.seconds:g} s: the model does not come near, or a unit is wrong"


@cache
def _compiling() -> Any:
    """Return what counts the seconds that numba compiles, in whichever thread; numba is long loaded where one fits."""
    from numba.core import event

    class Compiling(event.Listener):  # type: ignore[misc]
        def __init__(self) -> None:
            self._lock = threading.Lock()
            self._open, self._since, self._sum = 0, 0.0, 0.0

        def on_start(self, event: Any) -> None:
            with self._lock:
                if self._open == 0:
                    self._since = time.monotonic()
                self._open += 1

        def on_end(self, event: Any) -> None:
            with self._lock:
                self._open = max(0, self._open - 1)
                if self._open == 0:
                    self._sum += time.monotonic() - self._since

        def seconds(self) -> float:
            with self._lock:
                return self._sum + (time.monotonic() - self._since if self._open else 0.0)

    counting = Compiling()
    event.register("numba:compile", counting)  # type: ignore[no-untyped-call]
    return counting
