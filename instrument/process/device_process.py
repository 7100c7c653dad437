"""The parent's end of a device's process: starts it, sends orders, receives answers and blocks, notices its end."""

import threading
import time
from collections.abc import Callable

from instrument.background import ProcessEnded, WorkerProcess
from instrument.devices import CaptureSettings, DigitizerError
from instrument.process.child import OPENED, STARTED, Answer, BlockReady, DeviceState, Opener, Order, serve
from instrument.process.shared_ring import RingKey

START_S = 60.0  # to start the process on a busy machine
_LOOK_S = 0.1
END_S = 5.0  # to close the device; a driver allows 1 s for a request
_REMEDY = "arm again: it is started anew"


class DeviceProcess:
    """One child process, from its start to its end.

    Used from one thread at a time, except ``send``.  A child that dies or does not answer raises a DigitizerError, and
    ``over`` is True from then on.
    """

    def __init__(self, opener: Opener, give_up: Callable[[], bool], open_s: float) -> None:
        """Start the child and wait up to ``open_s`` until it has opened the digitizer.

        ``give_up`` as in ``answer_to``.  Raises DigitizerError.
        """
        self._sending = threading.Lock()  # orders are sent in the order of their numbers
        self._serial = OPENED
        self._device: DeviceState | DigitizerError | None = None
        try:
            self._process = WorkerProcess("digitizer", serve, opener)
        except (OSError, ValueError) as error:
            raise DigitizerError(f"the digitizer's process did not start: {error}", "close other programs") from error
        try:
            self.answer_to(STARTED, START_S, give_up)
            self.answer_to(OPENED, open_s, give_up)
        except DigitizerError:
            self.end()
            raise

    @property
    def over(self) -> bool:
        """Get whether the child has been ended."""
        return self._process.over

    @property
    def device(self) -> DeviceState:
        """Get the state that the device last reported.  Raises DigitizerError if it could not be read."""
        device = self._device
        assert device is not None
        if isinstance(device, DigitizerError):
            raise device.with_traceback(None)  # may be raised repeatedly
        return device

    def send(
        self,
        kind: str,
        settings: CaptureSettings | None = None,
        ring: RingKey | None = None,
        at: int = 0,
    ) -> int:
        """Send an order and return its serial number; from any thread."""
        with self._sending:
            self._serial += 1
            try:
                self._process.send(Order(kind, self._serial, settings, ring, at))
            except ProcessEnded as error:
                raise DigitizerError("the digitizer's process is gone", _REMEDY) from error
            return self._serial

    def answer_to(
        self,
        serial: int,
        limit_s: float,
        give_up: Callable[[], bool] = lambda: False,
        patience_s: float | None = None,
    ) -> Answer | None:
        """Return the answer to the order ``serial``.  Raises DigitizerError for a fault of the device or for no answer.

        Returns None once ``give_up()`` is True; with ``patience_s`` the child then has that long before it is ended.
        """
        end = time.monotonic() + limit_s
        given_up = False
        while True:
            if not given_up and give_up():
                if patience_s is None:
                    return None
                given_up, end = True, min(end, time.monotonic() + patience_s)
            message = self.receive(min(_LOOK_S, limit_s))
            if isinstance(message, Answer) and message.serial == serial:
                if message.fault is not None:
                    raise message.fault
                return message
            if message is None and time.monotonic() > end:
                if not given_up:
                    raise self.end_silent()
                self.end(0.0)
                raise DigitizerError("the arming was given up", _REMEDY)

    def receive(self, timeout_s: float) -> Answer | BlockReady | None:
        """Return the next message, None if none comes in time.  Raises DigitizerError if the child is gone."""
        if self.over:
            raise DigitizerError("the digitizer's process is gone", _REMEDY)
        try:
            message: Answer | BlockReady | None = self._process.receive(timeout_s)
        except ProcessEnded as how:
            raise DigitizerError(f"the digitizer's process ended by itself ({how})", _REMEDY) from None
        if message is not None:
            self._device = message.device or self._device
        return message

    def end(self, patience_s: float | None = None) -> None:
        """End the child, by force after ``patience_s`` (None: ``END_S``); harmless when it has ended."""
        self._process.end(END_S if patience_s is None else patience_s)

    def end_silent(self) -> DigitizerError:
        """End a child that does not answer, and return the error to raise."""
        self.end(0.0)
        return DigitizerError("the digitizer does not answer", "arm again; if it stays silent, re-plug it first")
