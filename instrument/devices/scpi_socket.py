"""SCPI over a TCP socket (the raw "socket" port of the instrument)."""

import contextlib
import socket
from collections.abc import Callable

from instrument.devices.digitizer import DigitizerError
from instrument.devices.scpi_transport import (
    ANSWER_S,
    BLOCK_S,
    MAX_LINE_BYTES,
    Cancelled,
    Deadline,
    Stalled,
    block_start,
    never,
)

PORTS = (5025, 5555)  # Keysight and Siglent; Rigol
_REMEDY = "check its network address, and that no other program is connected"
_PIECE = 1 << 18
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
        raise DigitizerError(f"{self.name} does not answer ({problem})", _REMEDY) from problem

    def write(self, command: str) -> None:
        try:
            if self._socket is None:
                self._connect()
            assert self._socket is not None
            self._socket.settimeout(self._timeout_s)
            self._socket.sendall(command.encode("ascii") + b"\n")
        except OSError as error:
            self.close()
            raise DigitizerError(f"{self.name}: connection lost ({error})", _REMEDY) from error

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
            self._receive_or_cancel(deadline, timeout_s, command, never)

    def query_block(
        self, command: str, max_bytes: int, cancelled: Callable[[], bool] = never, timeout_s: float = BLOCK_S
    ) -> bytes:
        deadline = Deadline(timeout_s)
        self.write(command)
        while (start := self._start(max_bytes)) is None:
            self._receive_or_cancel(deadline, timeout_s, command, cancelled)
        first, size = start
        deadline.allow_for(size)
        while len(self._received) < first + size:
            so_far = len(self._received)
            received = self._received  # kept, as losing the connection replaces the buffer
            try:
                self._receive_or_cancel(deadline, timeout_s, command, cancelled)
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

    def _receive_or_cancel(
        self, deadline: Deadline, pause_s: float, command: str, cancelled: Callable[[], bool]
    ) -> None:
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
            with contextlib.suppress(TimeoutError):
                self._receive(min(left_s, _LOOK_S))
                return

    def _receive(self, wait_s: float) -> None:
        if self._socket is None:
            raise DigitizerError(f"{self.name} is closed", "re-arm")
        try:
            self._socket.settimeout(wait_s)
            piece = self._socket.recv(_PIECE)
        except TimeoutError:
            raise
        except OSError as error:
            self.close()
            raise DigitizerError(f"{self.name}: connection lost ({error})", _REMEDY) from error
        if not piece:
            self.close()
            raise DigitizerError(f"{self.name} closed the connection", _REMEDY)
        self._received += piece
