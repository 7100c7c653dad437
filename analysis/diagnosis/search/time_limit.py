"""Time limit of a diagnosis, with a list of the steps left out after it."""

from collections.abc import Callable
from typing import TypeVar

from analysis.fitted import FitTime
from analysis.shot import Cancelled, Stop

SECONDS = 60.0  # on two cores; a usual diagnosis takes a few
_FOR_SEARCHING = 0.85  # share of the limit after which searching stops; what was found by then is judged
Result = TypeVar("Result")


class Limit:
    """The time limit of a diagnosis, counted from its creation, and the steps left out after it.

    Calling it returns whether optional work must stop, and raises Cancelled where the caller wants to stop.
    Compilation and the time that other programs take are not counted.
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
        """Get the steps left out, in words."""
        return tuple(dict.fromkeys(self._left_out))

    def within(self, what: str, work: Callable[[], Result], otherwise: Result) -> Result:
        """Return the result of ``work``; if time runs out first, note ``what`` as left out and return ``otherwise``.

        ``work`` must call this limit to learn whether to stop, and raise Cancelled if so.
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
