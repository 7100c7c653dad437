"""The program's log file, with the traceback of every uncaught exception in any thread."""

import logging
import sys
import threading
from collections import deque
from logging.handlers import RotatingFileHandler
from pathlib import Path
from types import TracebackType

_LOG = logging.getLogger("levimass")
_MAX_BYTES = 1_000_000
NAME = "levimass.log"


class ProgramLog:
    """Writes the log to ``folder``; uncaught exceptions are also collected for the window."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._problems: deque[str] = deque(maxlen=100)
        self._handler: logging.Handler | None = None

    def install(self) -> None:
        """Open the log file and install hooks for uncaught exceptions."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._handler = RotatingFileHandler(
                self.folder / NAME, maxBytes=_MAX_BYTES, backupCount=3, encoding="utf-8", errors="backslashreplace"
            )
        except OSError as error:
            self._problems.append(f"no log file is written: {error}")
        else:
            self._handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
            _LOG.addHandler(self._handler)
            _LOG.setLevel(logging.INFO)
            _LOG.propagate = False
        sys.excepthook = self._uncaught
        threading.excepthook = lambda what: self._uncaught(what.exc_type, what.exc_value, what.exc_traceback)

    def close(self) -> None:
        """Close the log file and restore Python's own hooks."""
        sys.excepthook, threading.excepthook = sys.__excepthook__, threading.__excepthook__
        if self._handler is not None:
            _LOG.removeHandler(self._handler)
            self._handler.close()

    def take_problems(self) -> list[str]:
        """Return the uncaught exceptions since the last call, one line each."""
        return [self._problems.popleft() for _ in range(len(self._problems))]

    def _uncaught(self, kind: type[BaseException], error: BaseException | None, trace: TracebackType | None) -> None:
        if issubclass(kind, SystemExit | KeyboardInterrupt):
            return
        shown = error if error is not None else kind()
        _LOG.error("not caught", exc_info=(kind, shown, trace))
        sys.__excepthook__(kind, shown, trace)
        cause = " ".join(str(shown).split())
        self._problems.append(f"a fault of the program: {kind.__name__}: {cause} (see the log: Help, Log folder)")


def note(words: str) -> None:
    _LOG.info("%s", " ".join(words.split()))
