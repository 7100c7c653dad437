"""A ring of counts in shared memory: one process writes, the other copies out and reports how far it has read."""

import contextlib
import os
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from instrument.devices import DigitizerError

_HEADER_BYTES = 64
_READ, _BLOCKS, _BEATS = _COUNTERS = range(3)
_FILES = Path("/dev/shm")  # shared memory on Linux


class SharedRing:
    """A ring of int16 counts, shape (capacity, channels), and three counters; samples are numbered from 0 on.

    The writer fills views (``room``, ``view``), the reader copies out and marks as read (``copy_into``, ``mark_read``).
    Blocks are announced over a pipe, whose system calls also order the memory accesses of the two processes.
    """

    def __init__(self, memory: SharedMemory, capacity: int, channels: int) -> None:
        self._memory = memory
        self.name = memory.name  # by which another process attaches it
        self.capacity = capacity
        self.channels = channels
        self._counters = np.ndarray(len(_COUNTERS), np.int64, memory.buf)
        self._counts: NDArray[np.int16] = np.ndarray((capacity, channels), np.int16, memory.buf, _HEADER_BYTES)

    @classmethod
    def create(cls, capacity: int, channels: int) -> "SharedRing":
        """Return a new ring.  Raises DigitizerError if the system has not enough shared memory."""
        size = _HEADER_BYTES + 2 * capacity * channels
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
        return cls(memory, capacity, channels)

    @classmethod
    def attach(cls, name: str, capacity: int, channels: int) -> "SharedRing":
        """Return the ring that another process created."""
        return cls(SharedMemory(name), capacity, channels)

    def unlink(self) -> None:
        """Free the memory as soon as both processes have closed it or ended."""
        with contextlib.suppress(FileNotFoundError):
            self._memory.unlink()

    def close(self) -> None:
        """Detach the memory from this process."""
        del self._counters, self._counts
        self._memory.close()

    def view(self, at: int, most: int) -> NDArray[np.int16]:
        """Return samples ``at`` ..., as many as follow without a wrap, at most ``most``; the writer fills them."""
        start = at % self.capacity
        return self._counts[start : start + most]

    def room(self, at: int) -> int:
        """Return how many samples may be written from ``at`` on without replacing unread ones."""
        return self.capacity - (at - int(self._counters[_READ]))

    def copy_into(self, at: int, out: NDArray[np.int16]) -> None:
        """Fill ``out``, shape (n, channels), with samples ``at`` ...; a block never wraps."""
        start = at % self.capacity
        out[:] = self._counts[start : start + out.shape[0]]

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
