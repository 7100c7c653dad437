"""Saving beside the screen: a disk that is busy with recordings may keep whoever waits for it for a quarter second."""

import threading
from collections.abc import Callable


class Saver:
    """Does the newest of what it is given, in a thread of its own; what it replaces need not be done any more."""

    def __init__(self) -> None:
        self._wake = threading.Condition()
        self._newest: Callable[[], None] | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="levimass saver", daemon=True)
        self._thread.start()

    def submit(self, save: Callable[[], None]) -> None:
        """Do this soon; returns at once.  ``save`` raises nothing."""
        with self._wake:
            self._newest = save
            self._wake.notify()

    def close(self, timeout_s: float = 10.0) -> bool:
        """Do what waits, end the thread; return whether it ended."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        while True:
            with self._wake:
                while self._newest is None and not self._closing:
                    self._wake.wait()
                save, self._newest = self._newest, None
            if save is None:
                return
            save()
