"""Links that carry SCPI commands to an oscilloscope: their interface, and those over a socket and over VISA.

The link over USB is in ``usbtmc``.  VISA (VXI-11, HiSLIP, GPIB) needs pyvisa, which is an optional extra.
"""

import importlib
import socket
import time
from collections.abc import Callable
from typing import Any, Protocol

from instrument.devices.digitizer import DigitizerError
from instrument.files import error_words

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


PORTS = (5025, 5555)  # Keysight and Siglent; Rigol
_SOCKET_REMEDY = "check its network address, and that no other program is connected"
_SOCKET_PIECE_BYTES = 1 << 18
_LOOK_S = 0.1  # time between checks for a cancellation


class SocketTransport:
    """A connection to ``host``; without a ``port`` the usual ports are tried."""

    def __init__(self, host: str, port: int | None = None, timeout_s: float = 3.0) -> None:
        self.name = f"oscilloscope at {host}" if port is None else f"oscilloscope at {host}:{port}"
        self._socket: socket.socket | None = None
        self._received = bytearray()
        self._timeout_s = timeout_s
        problem: OSError | None = None
        for candidate in (port,) if port is not None else PORTS:
            try:
                self._address = (host, candidate)
                self._connect()
                return
            except OSError as error:
                problem = error
        raise DigitizerError(f"{self.name} does not answer ({problem})", _SOCKET_REMEDY) from problem

    def write(self, command: str) -> None:
        try:
            if self._socket is None:
                self._connect()
            assert self._socket is not None
            self._socket.settimeout(self._timeout_s)
            self._socket.sendall(command.encode("ascii") + b"\n")
        except OSError as error:
            self.close()
            raise DigitizerError(f"{self.name}: connection lost ({error})", _SOCKET_REMEDY) from error

    def query(self, command: str, timeout_s: float = ANSWER_S) -> str:
        """Send a command and return its answer, one line; line ends left by an earlier block are skipped."""
        deadline = Deadline(timeout_s)
        self.write(command)
        while True:
            line, end, rest = self._received.lstrip(b"\r\n").partition(b"\n")
            if end:
                self._received = rest
                return line.decode("ascii", "replace").strip()
            if len(self._received) > MAX_LINE_BYTES:
                self.close()
                raise DigitizerError(f"{self.name} answered {command} without an end", "re-arm")
            self._receive(deadline, timeout_s, command, never)

    def query_block(
        self, command: str, max_bytes: int, cancelled: Callable[[], bool] = never, timeout_s: float = BLOCK_S
    ) -> bytes:
        deadline = Deadline(timeout_s)
        self.write(command)
        while (start := self._start(max_bytes)) is None:
            self._receive(deadline, timeout_s, command, cancelled)
        first, size = start
        deadline.allow_for(size)
        while len(self._received) < first + size:
            so_far = len(self._received)
            received = self._received  # kept, as losing the connection replaces the buffer
            try:
                self._receive(deadline, timeout_s, command, cancelled)
            except DigitizerError as error:
                raise Stalled(error.what, error.remedy, bytes(received[first:so_far])) from None
        block = bytes(memoryview(self._received)[first : first + size])
        del self._received[: first + size]
        return block

    def close(self) -> None:
        """Close the connection; the next command reopens it."""
        held, self._socket = self._socket, None
        self._received = bytearray()
        if held is not None:
            held.close()

    def _connect(self) -> None:
        self._received = bytearray()
        self._socket = socket.create_connection(self._address, timeout=self._timeout_s)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def _start(self, max_bytes: int) -> tuple[int, int] | None:
        try:
            return block_start(self._received, self.name, max_bytes)
        except DigitizerError:
            self.close()  # the remainder of this answer would be mistaken for the next one
            raise

    def _receive(self, deadline: Deadline, pause_s: float, command: str, cancelled: Callable[[], bool]) -> None:
        """Append the next bytes to those received.  Raises DigitizerError, Cancelled."""
        pause = Deadline(pause_s)
        while True:
            if cancelled():
                self.close()
                raise Cancelled
            try:
                left_s = min(deadline.check(self.name, command), pause.check(self.name, command))
            except DigitizerError:
                self.close()
                raise
            if self._socket is None:
                raise DigitizerError(f"{self.name} is closed", "re-arm")
            try:
                self._socket.settimeout(min(left_s, _LOOK_S))
                piece = self._socket.recv(_SOCKET_PIECE_BYTES)
            except TimeoutError:
                continue
            except OSError as error:
                self.close()
                raise DigitizerError(f"{self.name}: connection lost ({error})", _SOCKET_REMEDY) from error
            if not piece:
                self.close()
                raise DigitizerError(f"{self.name} closed the connection", _SOCKET_REMEDY)
            self._received += piece
            return


_VISA_PIECE_BYTES = 1 << 20


class VisaTransport:
    """A pyvisa session for a resource name such as ``TCPIP0::192.168.1.5::INSTR``."""

    def __init__(self, resource: str, manager: Any = None) -> None:
        self.name = f"oscilloscope {resource}"
        if manager is None:
            try:
                pyvisa = importlib.import_module("pyvisa")
            except ImportError as error:
                raise DigitizerError(
                    f"{resource} needs pyvisa, which is not installed", "pip install 'levimass[visa]'"
                ) from error
            manager = self._manager(pyvisa)
        try:
            self._session = manager.open_resource(resource)
            # the default chunk of 20 KiB is slow for deep memory; messages over a socket end with a line end
            self._session.chunk_size = _VISA_PIECE_BYTES
            self._session.write_termination = "\n"
            self._session.read_termination = "\n" if resource.upper().endswith("::SOCKET") else None
        except Exception as error:  # pyvisa's backends raise many kinds of errors
            raise DigitizerError(
                f"{self.name} cannot be opened ({error_words(error)})", "check the resource name"
            ) from error

    def write(self, command: str) -> None:
        self._guard(self._session.write, command)

    def query(self, command: str, timeout_s: float = ANSWER_S) -> str:
        self.write(command)
        self._session.timeout = round(1000 * timeout_s)
        answer = str(self._guard(self._session.read))
        if len(answer) > MAX_LINE_BYTES:
            raise DigitizerError(f"{self.name} answered {command} without an end", "re-arm")
        return answer.strip()

    def query_block(
        self, command: str, max_bytes: int, cancelled: Callable[[], bool] = never, timeout_s: float = BLOCK_S
    ) -> bytes:
        deadline = Deadline(timeout_s)
        self.write(command)
        self._session.timeout = round(1000 * timeout_s)
        received = bytearray()
        start = None
        while start is None:
            deadline.check(self.name, command)
            received += self._guard(self._session.read_bytes, 1)
            start = block_start(received, self.name, max_bytes)
        first, size = start
        deadline.allow_for(size)
        while len(received) < first + size:
            if cancelled():
                self._guard(self._session.clear)
                raise Cancelled
            try:
                deadline.check(self.name, command)
                left = first + size - len(received)
                received += self._guard(self._session.read_bytes, min(_VISA_PIECE_BYTES, left))
            except DigitizerError as error:
                raise Stalled(error.what, error.remedy, bytes(received[first:])) from error
        self._guard(self._session.read_bytes, 1)  # the line end after the block
        return bytes(received[first:])

    def close(self) -> None:
        self._guard(self._session.close)

    def _guard(self, call: Callable[..., Any], *arguments: object) -> Any:
        try:
            return call(*arguments)
        except Exception as error:
            raise DigitizerError(f"{self.name}: {error_words(error)}", "check the link and re-arm") from error

    @staticmethod
    def _manager(pyvisa: Any) -> Any:
        try:
            return pyvisa.ResourceManager()
        except Exception:  # no maker's VISA library is installed, so the Python one is used
            try:
                return pyvisa.ResourceManager("@py")
            except Exception as error:
                raise DigitizerError("pyvisa finds no VISA library", "pip install 'levimass[visa]'") from error
