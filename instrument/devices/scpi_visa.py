"""SCPI over any link supported by pyvisa (VXI-11, HiSLIP, GPIB); pyvisa is an optional extra."""

import importlib
from collections.abc import Callable
from functools import partial
from typing import Any

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

_PIECE = 1 << 20


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
            self._session.chunk_size = _PIECE
            self._session.write_termination = "\n"
            self._session.read_termination = "\n" if resource.upper().endswith("::SOCKET") else None
        except Exception as error:  # pyvisa's backends raise many kinds of errors
            raise DigitizerError(f"{self.name} cannot be opened ({_line(error)})", "check the resource name") from error

    def write(self, command: str) -> None:
        self._guard(lambda: self._session.write(command))

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
            received += self._guard(lambda: self._session.read_bytes(1))
            start = block_start(received, self.name, max_bytes)
        first, size = start
        deadline.allow_for(size)
        while len(received) < first + size:
            if cancelled():
                self._guard(self._session.clear)
                raise Cancelled
            try:
                deadline.check(self.name, command)
                received += self._guard(partial(self._session.read_bytes, min(_PIECE, first + size - len(received))))
            except DigitizerError as error:
                raise Stalled(error.what, error.remedy, bytes(received[first:])) from error
        self._guard(lambda: self._session.read_bytes(1))  # the line end after the block
        return bytes(received[first:])

    def close(self) -> None:
        self._guard(self._session.close)

    def _guard(self, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except Exception as error:
            raise DigitizerError(f"{self.name}: {_line(error)}", "check the link and re-arm") from error

    @staticmethod
    def _manager(pyvisa: Any) -> Any:
        try:
            return pyvisa.ResourceManager()
        except Exception:  # no maker's VISA library is installed, so the Python one is used
            try:
                return pyvisa.ResourceManager("@py")
            except Exception as error:
                raise DigitizerError("pyvisa finds no VISA library", "pip install 'levimass[visa]'") from error


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
