"""How long a diagnosis may take; steps that were left out when the time was over are listed."""

from collections.abc import Callable
from typing import TypeVar

from analysis.fitted import FitTime
from analysis.shot import Cancelled, Stop

SECONDS = 60.0  # of two cores: a usual diagnosis takes a few
_FOR_SEARCHING = 0.85  # of it; what was found by then is judged
Result = TypeVar("Result")


class Limit:
    """The time of a diagnosis from now on, and the steps that were left out when it was over.

    Calling it returns whether work that may be left out is to stop; it raises Cancelled where the caller wants to stop.
    Compiling and the time that other programs take are not counted.
    """

    def __init__(self, seconds: float, cancelled: Stop) -> None:
        self.seconds = seconds
        self._time, self._cancelled = FitTime(_FOR_SEARCHING * seconds, cancelled), cancelled
        self._left_out: list[str] = []

    def __call__(self) -> bool:
        """Return whether the time is over.  Raises Cancelled."""
        return self._time()

    @property
    def left_out(self) -> tuple[str, ...]:
        """Get what was left out, in words."""
        return tuple(dict.fromkeys(self._left_out))

    def within(self, what: str, work: Callable[[], Result], otherwise: Result) -> Result:
        """Return the result of ``work``; where the time is over before it ends ``otherwise``, and note ``what``.

        ``work`` calls this limit to learn whether to stop, and raises Cancelled where it does.
        """
        if self():
            self._left_out.append(what)
            return otherwise
        try:
            return work()
        except Cancelled:
            if self._cancelled() or not self._time.over:
                raise
            self._left_out.append(what)
            return otherwise
