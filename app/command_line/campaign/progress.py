"""How far a campaign is."""

import sys
import time


class Progress:
    """A line on a terminal that counts shots; on anything else silence, as logs have no use for it."""

    def __init__(self, total: int, already: int) -> None:
        self._total, self._already, self._done = total, already, 0
        self._shown = sys.stderr.isatty()
        self._bare = getattr(sys.stderr, "bare", sys.stderr)  # this line alone moves the cursor
        self._started = time.monotonic()
        if already and self._shown:
            self.say(f"levimass: {already} shots were done before and are not done again")

    def step(self) -> None:
        """Count one shot."""
        self._done += 1
        if self._shown:
            spent = time.monotonic() - self._started
            left = spent / self._done * (self._total - self._done)
            self._bare.write(f"\r{self._done}/{self._total} shots, {left:.0f} s to go \x1b[K")

    def say(self, line: str) -> None:
        """Print a line without disturbing the count."""
        if self._shown:
            self._bare.write("\r\x1b[K")
        sys.stderr.write(line + "\n")

    def end(self) -> None:
        """Leave the terminal on a fresh line."""
        if self._shown and self._total:
            sys.stderr.write("\n")
