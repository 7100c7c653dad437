"""What the SCPI driver asks of a link to an oscilloscope, whatever carries it."""

import time
from collections.abc import Callable
from typing import Protocol

from instrument.devices.digitizer import DigitizerError

MAX_PREFIX_BYTES = 64
MAX_LINE_BYTES = 1 << 16
SLOWEST_BYTES_PER_S = 50e3  # GPIB through an adapter; a block that comes slower than this counts as stalled
REMEDY = "check its connection, and that no other program uses it; then re-arm"


class Cancelled(Exception):
    """The operator stopped a transfer under way; the link is clean again."""


class Stalled(DigitizerError):
    """A block that stopped coming; ``received`` are its bytes so far."""

    def __init__(self, what: str, remedy: str, received: bytes = b"") -> None:
        super().__init__(what, remedy)
        self.received = received


class Deadline:
    """When one exchange must be over, however much or little comes in the meantime."""

    def __init__(self, seconds: float) -> None:
        self._end_s = time.monotonic() + seconds

    @property
    def left_s(self) -> float:
        """Get the time left in s, 0 once it has passed."""
        return max(0.0, self._end_s - time.monotonic())

    def allow_for(self, size_bytes: int) -> None:
        """Move it for a block whose size is known now."""
        self._end_s += size_bytes / SLOWEST_BYTES_PER_S

    def check(self, name: str, command: str) -> None:
        """Raise DigitizerError once it has passed."""
        if self.left_s == 0.0:
            raise DigitizerError(f"{name} does not answer {command} in time", REMEDY)


def never() -> bool:
    """Say that nobody cancels."""
    return False


class ScpiTransport(Protocol):
    """A link that carries commands and answers.  Every method raises DigitizerError."""

    def write(self, command: str) -> None:
        """Send a command that has no answer."""

    def query(self, command: str, timeout_s: float = 5.0) -> str:
        """Send a command and return its answer, stripped; ``timeout_s`` is for the whole of it."""

    def query_block(
        self, command: str, max_bytes: int, cancelled: Callable[[], bool] = never, timeout_s: float = 10.0
    ) -> bytes:
        """Send a command and return the bytes of its IEEE 488.2 definite block, whatever stands before it.

        Refuses a block of more than ``max_bytes``; Cancelled when ``cancelled`` says so between two pieces.
        ``timeout_s`` is for its beginning and for each pause, and the whole comes at SLOWEST_BYTES_PER_S at least:
        else Stalled, with what came of it.
        """

    def close(self) -> None:
        """Let go of the instrument; harmless when already closed."""


def block_start(received: bytes | bytearray, name: str) -> tuple[int, int] | None:
    """Return (where the bytes begin, how many there are) of a definite block; None while the head is not complete.

    IEEE 488.2, 8.7.9: ``#``, a digit n > 0, n digits that give the number of bytes.
    """
    at = received.find(b"#", 0, MAX_PREFIX_BYTES)
    if at < 0:
        if len(received) >= MAX_PREFIX_BYTES:
            raise DigitizerError(f"{name} answered no data block but {bytes(received[:24])!r}", "re-arm")
        return None
    if len(received) < at + 2:
        return None
    digits = received[at + 1] - ord("0")
    if not 1 <= digits <= 9:
        raise DigitizerError(f"{name} sent a damaged data block head {bytes(received[at : at + 12])!r}", "re-arm")
    if len(received) < at + 2 + digits:
        return None
    number = bytes(received[at + 2 : at + 2 + digits])
    if not number.isdigit():
        raise DigitizerError(f"{name} sent a damaged data block head {bytes(received[at : at + 12])!r}", "re-arm")
    return at + 2 + digits, int(number)


def check_size(size: int, max_bytes: int, name: str) -> None:
    """Refuse a block larger than what was asked for: a damaged head must not take the memory."""
    if size > max_bytes:
        raise DigitizerError(f"{name} announced {size} bytes where at most {max_bytes} were asked for", "re-arm")
