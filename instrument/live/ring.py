"""The ring buffer of a running digitizer's newest samples, allocated once, and the stream in it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Channel, Role, Setup
from instrument.devices import CaptureSettings


class Overwritten(Exception):
    """The requested samples have been replaced by newer ones."""


class Ring:
    """A ring of int16 counts, shape (capacity, channels): one thread writes, any thread copies out.

    Samples are numbered from 0 over the life of the ring.  The writer lets a digitizer fill the ring in place
    (``space``, then ``commit``); readers get copies, never of a sample that is being replaced.
    """

    def __init__(self, capacity: int, channels: int) -> None:
        self.capacity = capacity  # samples per channel that the ring holds
        self.channels = channels
        self.total = 0  # samples written so far: the newest sample's number plus one
        self._counts = np.zeros((capacity, channels), np.int16)
        self._claimed = 0  # end of the part that the writer may be changing now

    @property
    def oldest(self) -> int:
        """Get the number of the oldest sample that can still be copied."""
        return max(0, self._claimed - self.capacity)

    def space(self, most: int) -> NDArray[np.int16]:
        """Return a contiguous view of at most ``most`` samples to be filled next; its old samples are lost."""
        start = self.total % self.capacity
        length = min(most, self.capacity - start)
        self._claimed = self.total + length
        return self._counts[start : start + length]

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
        at = start % self.capacity
        first = min(length, self.capacity - at)
        out[:first] = self._counts[at : at + first]
        out[first:] = self._counts[: length - first]
        if start < self.oldest:  # the writer replaced some during the copy
            raise Overwritten


@dataclass(slots=True)
class Stream:
    """The samples of one run of a digitizer: their place in the ring, settings, channels and losses."""

    ring: Ring
    start: int  # ring number of its first sample
    settings: CaptureSettings
    channels: tuple[Channel, ...]
    setup: Setup
    source: str
    unseen_loss_s: float = 0.0
    gaps: list[tuple[int, int | None]] = field(default_factory=list)  # in the ring: (number, samples lost before it)
    lost: int = 0
    losses: int = 0
    doubtful_rate_hz: float | None = None  # the rate by the computer's clock, where it contradicts the stated one

    def column(self, role: Role) -> int | None:
        """Return the channel index that carries ``role``, or None."""
        return next((index for index, channel in enumerate(self.channels) if channel.role is role), None)

    def newest(self, most: int) -> tuple[NDArray[np.int16], int]:
        """Return a copy of at most ``most`` newest samples, and the ring number of the first.  Raises Overwritten."""
        total = self.ring.total
        counts = np.empty((min(most, total - self.start), self.ring.channels), np.int16)
        first = total - len(counts)
        self.ring.copy_into(first, counts)
        return counts, first

    def note_loss(self, at: int, samples: int | None) -> None:
        """Note that samples were lost before ring number ``at``."""
        oldest = self.ring.oldest
        self.gaps = [*(gap for gap in self.gaps if gap[0] >= oldest), (at, samples)]
        self.lost += samples or 0
        self.losses += 1


MIN_S = 1.0  # of stream before the rate is judged
LATE_S = 0.3  # deviation in time allowed to a device and its driver
RATE_TOLERANCE = 5e-4  # relative; larger than the errors of any crystal and of the computer's clock


@dataclass(slots=True)
class DeliveredRate:
    """Compares a stream's sample rate with the computer's clock.

    ``doubtful_hz`` is the measured rate where it contradicts ``stated_hz``, else None.
    """

    stated_hz: float
    doubtful_hz: float | None = None
    _begun_s: float | None = None
    _samples: int = 0

    def add(self, samples: int, lost: int | None, now_s: float, *, waits: bool) -> None:
        """Count a block received at ``now_s``, ``lost`` samples missing before it (None: unknown; start again).

        ``waits``: more samples are ready to be fetched, so the computer is late, and the rate is not judged.
        """
        if lost is None or self._begun_s is None:
            self._begun_s, self._samples = now_s, 0
            return
        self._samples += samples + lost
        passed_s = now_s - self._begun_s
        if waits or passed_s < MIN_S:
            return
        off_s = abs(self._samples / self.stated_hz - passed_s)
        self.doubtful_hz = self._samples / passed_s if off_s > LATE_S + RATE_TOLERANCE * passed_s else None
