"""A ring of counts in shared memory: a device's process fills it, ahead of the process that reads it."""

import contextlib
import os
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from instrument.devices import DigitizerError, Ring

_HEADER_BYTES = 64
_READ, _BLOCKS, _BEATS = _COUNTERS = range(3)
RingKey = tuple[str, int, int, int]  # name, capacity, channels, ahead: with which another process attaches a ring
_FILES = Path("/dev/shm")  # shared memory on Linux


class SharedRing(Ring):
    """A ring that a device's process fills up to ``ahead`` samples beyond those that this process has read.

    A block is announced over a pipe, whose system calls also order the memory accesses of the two processes.  It is
    read by committing the ``space`` in which it lies already (``fetch``): its samples are never copied.  Three counters
    in front of the samples tell the device's process how much was read, and this one that the other is alive.
    """

    def __init__(self, memory: SharedMemory, capacity: int, channels: int, ahead: int) -> None:
        self._memory = memory
        self.ahead = ahead
        self.key: RingKey = (memory.name, capacity, channels, ahead)
        self._counters = np.ndarray(len(_COUNTERS), np.int64, memory.buf)
        super().__init__(
            capacity, channels, np.ndarray((capacity + ahead, channels), np.int16, memory.buf, _HEADER_BYTES)
        )

    @classmethod
    def create(cls, capacity: int, channels: int, ahead: int) -> "SharedRing":
        """Return a new ring.  Raises DigitizerError if the system has not enough shared memory."""
        size = _HEADER_BYTES + 2 * (capacity + ahead) * channels
        try:
            memory = SharedMemory(create=True, size=size)
            try:
                _reserve(memory.name, size)
            except OSError:
                memory.close()
                memory.unlink()
                raise
        except OSError as error:
            raise DigitizerError(
                f"{size / 1e6:.0f} MB of shared memory cannot be had ({error.strerror})",
                f"clear {_FILES}, or choose a lower rate",
            ) from error
        return cls(memory, capacity, channels, ahead)

    @classmethod
    def attach(cls, name: str, capacity: int, channels: int, ahead: int) -> "SharedRing":
        """Return the ring that another process created."""
        return cls(SharedMemory(name), capacity, channels, ahead)

    def unlink(self) -> None:
        """Free the memory as soon as both processes have closed it or ended."""
        with contextlib.suppress(FileNotFoundError):
            self._memory.unlink()

    def close(self) -> None:
        """Detach the memory from this process, unless somebody still has a view of it."""
        for array in ("_counters", "_counts"):
            self.__dict__.pop(array, None)
        with contextlib.suppress(BufferError):
            self._memory.close()

    __del__ = close

    def room(self, at: int) -> int:
        """Return how many samples may be written from ``at`` on without replacing what readers may still copy."""
        return self.ahead - (at - int(self._counters[_READ]))

    def fetch(self, at: int, out: NDArray[np.int16]) -> None:
        """Fill ``out``, shape (n, channels), with samples ``at`` ... of a block, unless they lie there already."""
        block = self.view(at, out.shape[0])
        if block.ctypes.data != out.ctypes.data:
            out[:] = block

    def mark_read(self, up_to: int, blocks: int) -> None:
        """Mark all samples before ``up_to``, and ``blocks`` blocks in all, as read."""
        self._counters[_READ] = up_to
        self._counters[_BLOCKS] = blocks

    @property
    def blocks_read(self) -> int:
        """Get how many blocks have been read."""
        return int(self._counters[_BLOCKS])

    @property
    def beats(self) -> int:
        """Get the writer's heartbeats so far."""
        return int(self._counters[_BEATS])

    def beat(self) -> None:
        """Count a heartbeat of the writer."""
        self._counters[_BEATS] += 1


def _reserve(name: str, size: int) -> None:
    """Allocate the memory now; otherwise Linux kills a process that touches memory which is not available."""
    file = _FILES / name.lstrip("/")
    if not (hasattr(os, "posix_fallocate") and file.exists()):
        return
    with file.open("r+b") as memory:
        os.posix_fallocate(memory.fileno(), 0, size)
