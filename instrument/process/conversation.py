"""The parent's talk with the child that owns a device: orders go out, answers and blocks come back, its end is seen."""

import multiprocessing
import threading
import time
from collections.abc import Callable

from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.process.child import OPENED, STARTED, Opener, serve
from instrument.process.messages import About, Answer, Came, Fault, Order

STARTS_S = 60.0  # on a busy machine; nothing is asked of the device until then
_LOOK_S = 0.1
ENDS_S = 5.0  # to close the device; a driver gives a request of it 1 s
_ANEW = "arm again: it is started anew"


class Conversation:
    """One child, from its start to its end.

    Used from one thread at a time, but for ``send``.  A child that dies or does not answer ends the conversation
    (``over``) and is told as a DigitizerError.
    """

    def __init__(self, opener: Opener, give_up: Callable[[], bool], opens_s: float) -> None:
        """Start the child and wait until it has opened the digitizer, which may take ``opens_s`` from its start on.

        ``give_up`` as in ``ask``.  Raises DigitizerError.
        """
        context = multiprocessing.get_context("spawn")
        theirs, self._orders = context.Pipe(duplex=False)
        self._answers, said = context.Pipe(duplex=False)
        self._process = context.Process(target=serve, args=(opener, theirs, said), name="levimass digitizer")
        self._process.daemon = True
        self._sending = threading.Lock()
        self._serial = OPENED
        self._about: About | None = None
        self.over = False
        try:
            self._process.start()
        except (OSError, ValueError) as error:
            raise DigitizerError(f"the digitizer's process did not start: {error}", "close other programs") from error
        theirs.close()  # with the child's copies alone, its end is seen as the pipe's
        said.close()
        self.child_id = self._process.pid
        try:
            self._wait_for(STARTED, STARTS_S, give_up, None)
            self._wait_for(OPENED, opens_s, give_up, None)
        except DigitizerError:
            self.end()
            raise

    @property
    def about(self) -> About:
        """Get what the device said of itself last.  Raises DigitizerError where it could not say it."""
        about = self._about
        assert about is not None
        if about.fault is not None:
            raise error_of(about.fault)
        return about

    def send(self, kind: str, settings: CaptureSettings | None = None, ring: tuple[str, int, int] | None = None) -> int:
        """Give an order and return its number; from any thread."""
        with self._sending:
            if self.over:
                raise DigitizerError("the digitizer's process is gone", _ANEW)
            self._serial += 1
            try:
                self._orders.send(Order(kind, self._serial, settings, ring))
            except OSError as error:
                raise DigitizerError("the digitizer's process is gone", _ANEW) from error
            return self._serial

    def ask(
        self,
        kind: str,
        limit_s: float,
        settings: CaptureSettings | None = None,
        ring: tuple[str, int, int] | None = None,
        *,
        give_up: Callable[[], bool] = lambda: False,
        patience_s: float | None = None,
    ) -> Answer | None:
        """Give an order and return its answer.  Raises DigitizerError: what went wrong there, or that nothing came.

        Once ``give_up`` says so None is returned; with ``patience_s`` the child has that long, and then is ended.
        """
        return self._wait_for(self.send(kind, settings, ring), limit_s, give_up, patience_s)

    def hear(self, timeout_s: float) -> Answer | Came | None:
        """Return the next message, None where none comes in time.  Raises DigitizerError where the child is gone."""
        if self.over:
            raise DigitizerError("the digitizer's process is gone", _ANEW)
        try:
            if not self._answers.poll(timeout_s):
                return None
            message: Answer | Came = self._answers.recv()
        except (EOFError, OSError):
            code = self.end(1.0)
            how = f"killed by signal {-code}" if code is not None and code < 0 else f"status {code}"
            raise DigitizerError(f"the digitizer's process ended by itself ({how})", _ANEW) from None
        self._about = message.about or self._about
        return message

    def end(self, patience_s: float | None = None) -> int | None:
        """End the child, by force where it takes longer, and return its exit code; harmless when it has ended."""
        if self.over:
            return None
        patience_s = ENDS_S if patience_s is None else patience_s
        with self._sending:
            self.over = True
        self._process.join(patience_s)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(ENDS_S)
        code = self._process.exitcode
        self._process.close()
        self._orders.close()
        self._answers.close()
        return code

    def hangs(self) -> DigitizerError:
        """End a child that does not answer, and return what is to be said of it."""
        self.end(0.0)
        return DigitizerError("the digitizer does not answer", "arm again; if it stays silent, re-plug it first")

    def _wait_for(
        self, serial: int, limit_s: float, give_up: Callable[[], bool], patience_s: float | None
    ) -> Answer | None:
        end = time.monotonic() + limit_s
        given_up = False
        while True:
            if not given_up and give_up():
                if patience_s is None:
                    return None
                given_up, end = True, min(end, time.monotonic() + patience_s)
            message = self.hear(min(_LOOK_S, limit_s))
            if isinstance(message, Answer) and message.serial == serial:
                if message.fault is not None:
                    raise error_of(message.fault)
                return message
            if message is None and time.monotonic() > end:
                if not given_up:
                    raise self.hangs()
                self.end(0.0)
                raise DigitizerError("the arming was given up", _ANEW)


def error_of(fault: Fault) -> DigitizerError:
    """Return a fault that travelled as the error it was."""
    return DigitizerError(fault.what, fault.remedy)
