"""The ring buffer of a running digitizer's newest samples, allocated once."""

import numpy as np
from numpy.typing import NDArray


class Overwritten(Exception):
    """The requested samples have been replaced by newer ones."""


class Ring:
    """A ring of int16 counts, shape (capacity, channels): one thread writes, any thread copies out.

    Samples are numbered from 0 over the life of the ring.  The writer lets a digitizer fill the ring in place
    (``space``, then ``commit``); readers get copies, never of a sample that is being replaced.

    ``memory`` None: memory of this process.  A longer one has room for samples that are not written yet in this sense,
    but that another process may already be filling in (``instrument.process``).
    """

    def __init__(self, capacity: int, channels: int, memory: NDArray[np.int16] | None = None) -> None:
        self.capacity = capacity  # samples per channel that the ring holds for its readers
        self.channels = channels
        self.total = 0  # samples written so far: the newest sample's number plus one
        self._counts = np.zeros((capacity, channels), np.int16) if memory is None else memory
        self._claimed = 0  # end of the part that the writer may be changing now

    @property
    def oldest(self) -> int:
        """Get the number of the oldest sample that can still be copied."""
        return max(0, self._claimed - self.capacity)

    def suits(self, capacity: int, channels: int) -> bool:
        """Return whether the ring holds that much, and not four times as much."""
        return self.channels == channels and capacity <= self.capacity <= 4 * capacity

    def space(self, most: int) -> NDArray[np.int16]:
        """Return a contiguous view of at most ``most`` samples to be filled next; its old samples are lost."""
        view = self.view(self.total, most)
        self._claimed = self.total + view.shape[0]
        return view

    def view(self, at: int, most: int) -> NDArray[np.int16]:
        """Return the memory of samples ``at`` ..., as many as follow without a wrap, at most ``most``."""
        start = at % self._counts.shape[0]
        return self._counts[start : start + most]

    def commit(self, samples: int) -> None:
        """Count the first ``samples`` of the last ``space`` as written."""
        if not 0 <= samples <= self._claimed - self.total:
            raise ValueError(f"{samples} samples do not fit the {self._claimed - self.total} that were claimed")
        self.total += samples
        self._claimed = self.total

    def copy_into(self, start: int, out: NDArray[np.int16]) -> None:
        """Fill ``out``, shape (n, channels), with samples ``start`` ... ``start + n - 1``.

        Raises Overwritten if the writer has replaced some of them, ValueError for samples not written yet.
        """
        length = out.shape[0]
        if start < 0 or start + length > self.total:
            raise ValueError(f"samples {start} to {start + length} of {self.total}")
        if start < self.oldest:
            raise Overwritten
        before_wrap = self.view(start, length)
        first = before_wrap.shape[0]
        out[:first] = before_wrap
        out[first:] = self._counts[: length - first]
        if start < self.oldest:  # the writer replaced some during the copy
            raise Overwritten
