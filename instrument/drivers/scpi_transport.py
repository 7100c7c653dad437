"""What the SCPI driver asks of a link to an oscilloscope, whatever carries it."""

from collections.abc import Callable
from typing import Protocol

from instrument.digitizer import DigitizerError

MAX_PREFIX_BYTES = 64
MAX_LINE_BYTES = 1 << 16


class Cancelled(Exception):
    """The operator stopped a transfer under way; the link is clean again."""


def never() -> bool:
    """Say that nobody cancels."""
    return False


class ScpiTransport(Protocol):
    """A link that carries commands and answers.  Every method raises DigitizerError."""

    def write(self, command: str) -> None:
        """Send a command that has no answer."""

    def query(self, command: str, timeout_s: float = 5.0) -> str:
        """Send a command and return its answer, stripped."""

    def query_block(
        self, command: str, max_bytes: int, cancelled: Callable[[], bool] = never, timeout_s: float = 10.0
    ) -> bytes:
        """Send a command and return the bytes of its IEEE 488.2 definite block, whatever stands before it.

        Refuses a block of more than ``max_bytes``; Cancelled when ``cancelled`` says so between two pieces.
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
