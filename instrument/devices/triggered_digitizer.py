"""A digitizer that takes one shot per ``arm`` on a hardware trigger; a thread waits for the shot and fetches it."""

import queue
import threading
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Role, Setup
from instrument.background import start_thread
from instrument.devices.digitizer import Block, CaptureSettings, Digitizer, DigitizerError
from instrument.devices.source_options import assumed_rig

Input = TypeVar("Input", int, str)  # type of a channel's name on the device


@dataclass(frozen=True, slots=True)
class HardwareTrigger:
    """The hardware trigger: a channel (3, on a card "2"), a named input, or None for the instrument's own setting."""

    source: int | str | None = None
    slope: str = "rising"
    level_v: float | None = None  # None: as set on the instrument


@dataclass(frozen=True, slots=True)
class Piece:
    """Fetched counts (int16, shape (n, channels)) and the trigger's index relative to them, which may be outside.

    A piece without counts reports that the trigger fired.
    """

    counts: NDArray[np.int16]
    trigger_sample: int | None
    last: bool


Pieces = queue.SimpleQueue[Piece | DigitizerError | None]  # None: the shot was abandoned


class TriggeredDigitizer(Digitizer, Generic[Input]):
    """A digitizer with one shot per ``arm``; ``_take_shot`` runs in a thread, so that ``read_into`` keeps its timeout.

    ``roles`` are the roles of the device's channels; ``what`` is the device's name in messages.
    """

    _ends_within_s = 15.0  # a thread that takes longer to abandon its shot is left running

    def __init__(self, what: str, roles: Mapping[Input, Role], setup: Setup | None) -> None:
        if Role.MEASUREMENT not in roles.values() or len(set(roles.values())) != len(roles):
            raise DigitizerError(f"one channel of the {what}, and only one, must carry the measuring beat")
        self._roles: dict[Input, Role] = dict(roles)
        self._setup = setup or assumed_rig()
        self._cancel = threading.Event()
        self._lock = threading.Lock()
        self._worker: threading.Thread | None = None
        self._blocks: Pieces = queue.SimpleQueue()
        self._piece: Piece | None = None  # the piece being read
        self._armed = False

    @property
    def setup(self) -> Setup:
        return self._setup

    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        if self._piece is None:
            if not self._armed:
                return Block(0, ended=True)
            try:
                item = self._blocks.get(timeout=timeout_s)
            except queue.Empty:
                return Block(0)
            if item is None or isinstance(item, DigitizerError):
                self._armed = False
                if item is not None:
                    raise item
                return Block(0, ended=True)
            self._piece = item
        piece = self._piece
        if not piece.counts.shape[0]:
            self._piece = None
            return Block(0, fired=True)
        count = min(piece.counts.shape[0], buffer.shape[0])
        buffer[:count] = piece.counts[:count]
        at = piece.trigger_sample
        last = count == piece.counts.shape[0]
        within = at if at is not None and 0 <= at < count else None
        block = Block(count, ended=last and piece.last, trigger_sample=within)
        self._piece = None if last else Piece(piece.counts[count:], None if at is None else at - count, piece.last)
        self._armed = self._armed and not block.ended
        return block

    def stop(self) -> None:
        self._cancel.set()
        with self._lock:
            worker, self._worker = self._worker, None
            if worker is not None:
                worker.join(timeout=self._ends_within_s)

    def _begin(self, settings: CaptureSettings) -> None:
        """Start the thread that takes the shot; the previous thread must have been stopped."""
        self._cancel.clear()
        self._blocks = queue.SimpleQueue()
        self._piece = None
        self._armed = True
        self._worker = start_thread("shot", self._work, settings, self._blocks)

    def _work(self, settings: CaptureSettings, out: Pieces) -> None:
        try:
            self._take_shot(settings, out)
        except DigitizerError as error:
            out.put(error)
        except Exception as error:  # passed on to the reader
            out.put(self._described(error))

    @abstractmethod
    def _take_shot(self, settings: CaptureSettings, out: Pieces) -> None:
        """Wait for the trigger and put the pieces of the shot into ``out``; None once ``_cancel`` is set."""

    @abstractmethod
    def _described(self, error: Exception) -> DigitizerError:
        """Return an error of another kind as a DigitizerError."""
