"""Counts in memory that two processes see: one writes them, the other copies them out and says how far it got."""

import contextlib
import os
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from instrument.devices.digitizer import DigitizerError

_HEADER_BYTES = 64
_TAKEN, _BLOCKS, _TURNS = range(3)
_FILES = Path("/dev/shm")  # where Linux keeps such memory


class SharedRing:
    """A ring of int16 counts, shape (capacity, channels), and three counters; samples are numbered from 0 on.

    The writer gets views (``room``, ``view``), the reader copies out and gives free (``copy_into``, ``give_free``).
    The blocks themselves are announced over a pipe, whose system calls also order what is written before them.
    """

    def __init__(self, memory: SharedMemory, capacity: int, channels: int) -> None:
        self._memory = memory
        self.capacity = capacity
        self.channels = channels
        self._counters = np.ndarray(3, np.int64, memory.buf)
        self._counts: NDArray[np.int16] = np.ndarray((capacity, channels), np.int16, memory.buf, _HEADER_BYTES)

    @classmethod
    def create(cls, capacity: int, channels: int) -> "SharedRing":
        """Return new memory.  Raises DigitizerError where the system has not that much."""
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
        """Return the memory that another process made."""
        return cls(SharedMemory(name), capacity, channels)

    @property
    def name(self) -> str:
        """Get the name another process attaches by."""
        return self._memory.name

    def unlink(self) -> None:
        """Let the memory go as soon as both processes are done with it, however they end."""
        with contextlib.suppress(FileNotFoundError):
            self._memory.unlink()

    def close(self) -> None:
        """Let go of it in this process."""
        del self._counters, self._counts
        self._memory.close()

    def view(self, at: int, most: int) -> NDArray[np.int16]:
        """Return samples ``at`` ..., as many as follow without a wrap, at most ``most``; the writer fills them."""
        start = at % self.capacity
        return self._counts[start : start + most]

    def room(self, at: int) -> int:
        """Return how many samples may be written from ``at`` on before the reader's."""
        return self.capacity - (at - int(self._counters[_TAKEN]))

    def copy_into(self, at: int, out: NDArray[np.int16]) -> None:
        """Fill ``out``, shape (n, channels), with samples ``at`` ...; a block never wraps."""
        start = at % self.capacity
        out[:] = self._counts[start : start + out.shape[0]]

    def give_free(self, up_to: int, blocks: int) -> None:
        """Say that all samples before ``up_to``, and so many blocks, have been taken."""
        self._counters[_TAKEN] = up_to
        self._counters[_BLOCKS] = blocks

    @property
    def blocks_taken(self) -> int:
        """Get how many blocks have been taken."""
        return int(self._counters[_BLOCKS])

    @property
    def turns(self) -> int:
        """Get how often the writer has come round."""
        return int(self._counters[_TURNS])

    def turn(self) -> None:
        """Say that the writer is alive."""
        self._counters[_TURNS] += 1


def _reserve(name: str, size: int) -> None:
    """Make sure that the memory is there: where it is not, Linux kills who touches it instead of refusing it."""
    file = _FILES / name.lstrip("/")
    if not (hasattr(os, "posix_fallocate") and file.exists()):
        return
    handle = os.open(file, os.O_RDWR)
    try:
        os.posix_fallocate(handle, 0, size)
    finally:
        os.close(handle)
