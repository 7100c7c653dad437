"""A campaign under way in a thread of the test, and how far its journal is."""

import threading
import time
from pathlib import Path

from app.command_line.campaign.journal import JOURNAL
from app.command_line.cli import main

_COMES_S, _ENDS_S = 120.0, 150.0  # on a machine that does other things beside


def in_journal(out: Path) -> int:
    """Return how many shots are in the journal of the folder ``out``."""
    journal = out / JOURNAL
    return len(journal.read_bytes().splitlines()) if journal.exists() else 0


class Call(threading.Thread):
    """A campaign under way."""

    def __init__(self, *arguments: str) -> None:
        super().__init__(daemon=True)
        self._arguments, self.status = list(arguments), -1
        self.start()

    def run(self) -> None:
        self.status = main(self._arguments)

    def ended(self) -> int:
        """Wait for the end and return the exit status."""
        self.join(_ENDS_S)
        assert not self.is_alive(), "it hangs"
        return self.status

    def has_come_to(self, out: Path, lines: int) -> None:
        """Wait until so many shots are in the journal of ``out``."""
        end = time.monotonic() + _COMES_S
        while in_journal(out) < lines:
            assert time.monotonic() < end and self.is_alive(), "no shot was analysed"
            time.sleep(0.02)
