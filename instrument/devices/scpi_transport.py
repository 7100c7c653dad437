"""The interface of a link that carries SCPI commands to an oscilloscope: socket, USB or VISA."""

import time
from collections.abc import Callable
from typing import Protocol

from instrument.devices.digitizer import DigitizerError

MAX_PREFIX_BYTES = 64
MAX_LINE_BYTES = 1 << 16
ANSWER_S, BLOCK_S = 5.0, 10.0  # timeouts of an answer of one line, and of a block's beginning or a pause in it
SLOWEST_BYTES_PER_S = 50e3  # rate of GPIB through an adapter; a block at a lower rate counts as stalled
REMEDY = "check its connection, and that no other program uses it; then re-arm"


class Cancelled(Exception):
    """The operator cancelled a transfer; the link remains usable."""


class Stalled(DigitizerError):
    """A block stopped arriving; ``received`` holds its bytes so far."""

    def __init__(self, what: str, remedy: str, received: bytes = b"") -> None:
        super().__init__(what, remedy)
        self.received = received


class Deadline:
    """The time by which an exchange must be finished."""

    def __init__(self, seconds: float) -> None:
        self._end_s = time.monotonic() + seconds

    def allow_for(self, size_bytes: int) -> None:
        """Extend the deadline by the time that a block of this size may take."""
        self._end_s += size_bytes / SLOWEST_BYTES_PER_S

    def check(self, name: str, command: str) -> float:
        """Return the remaining time in s.  Raises DigitizerError after the deadline."""
        left_s = self._end_s - time.monotonic()
        if left_s <= 0.0:
            raise DigitizerError(f"{name} does not answer {command} in time", REMEDY)
        return left_s


def never() -> bool:
    """Return False, for an exchange that is never cancelled."""
    return False


class ScpiTransport(Protocol):
    """A link that carries commands and answers.  Every method raises DigitizerError."""

    def write(self, command: str) -> None:
        """Send a command without an answer."""

    def query(self, command: str, timeout_s: float = ANSWER_S) -> str:
        """Send a command and return its answer, stripped; ``timeout_s`` is for the whole exchange."""

    def query_block(
        self, command: str, max_bytes: int, cancelled: Callable[[], bool] = never, timeout_s: float = BLOCK_S
    ) -> bytes:
        """Send a command and return the bytes of the IEEE 488.2 definite block in its answer.

        Refuses a block of more than ``max_bytes``; raises Cancelled once ``cancelled()`` is True.  Raises Stalled, with
        the bytes received, if the block's beginning or a pause takes longer than ``timeout_s``, or if the whole block
        is slower than SLOWEST_BYTES_PER_S.
        """

    def close(self) -> None:
        """Release the instrument; harmless if already closed."""


def block_start(received: bytes | bytearray, name: str, max_bytes: int) -> tuple[int, int] | None:
    """Return (offset, number) of the bytes of a definite block, or None while its header is incomplete.

    IEEE 488.2, 8.7.9: ``#``, a digit n > 0, and n digits that give the number of bytes.  Refuses a block larger than
    requested, so that a damaged header cannot exhaust the memory.
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
    size = int(number)
    if size > max_bytes:
        raise DigitizerError(f"{name} announced {size} bytes where at most {max_bytes} were requested", "re-arm")
    return at + 2 + digits, size
