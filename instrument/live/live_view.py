"""The live curves of a running stream's last seconds and the signal of each channel, for the screen."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.reading import SiteFloor
from analysis.shot import Floats, Role

if TYPE_CHECKING:
    from analysis.signal import LiveChunk  # slow to import


MAX_BINS = 1000


@dataclass(frozen=True, slots=True)
class ChannelSignal:
    """The signal of one channel over the last few milliseconds."""

    role: Role
    amplitude_v: float  # of the beat (rms times root two); of the switch: its level
    range_v: float  # largest amplitude that the converter resolves
    clipped_fraction: float
    frequency_hz: float | None  # of the strongest line; None if no line exceeds the noise
    snr_db: float | None  # power of that line over the power of everything else


@dataclass(frozen=True, slots=True)
class LiveView:
    """A sliding window of the running stream; arrays are read-only.

    The three curves share ``time_s`` and hold the least and the greatest value of each bin in turn: shape (2 k,), k at
    most ``MAX_BINS``; a NaN marks a gap.  ``raw_v`` are the newest samples in V, shape (n, channels), at
    ``raw_time_s``.
    """

    time_s: Floats
    beat_frequency_hz: Floats
    velocity_m_per_s: Floats
    force_n: Floats
    raw_time_s: Floats
    raw_v: NDArray[np.float32]
    problem: str | None = None  # why nothing can be shown
    skipped: int = 0  # samples left out on the screen; recordings contain them
    floor: SiteFloor | None = None  # motion of the site while the block was last at rest


def empty_view() -> LiveView:
    """Return a view without samples."""
    none = np.empty(0)
    none.flags.writeable = False
    return LiveView(none, none, none, none, none, np.empty((0, 0), np.float32))


class LiveWindow:
    """The newest ``length`` points of the live curves."""

    def __init__(self, length: int) -> None:
        self.length = length
        self.bin_points = -(-length // MAX_BINS)
        self.clear()

    def clear(self) -> None:
        self._values = np.empty((4, 0))
        self._dropped = 0  # points before the first one kept, so that bins keep their places

    def add(self, chunk: "LiveChunk") -> None:
        """Append a chunk's points."""
        new = np.stack((chunk.time_s, chunk.beat_frequency_hz, chunk.velocity_m_per_s, chunk.force_n))
        values = np.concatenate((self._values, new), axis=1)
        surplus = max(0, values.shape[1] - self.length)
        self._values = values[:, surplus:]
        self._dropped += surplus

    def curves(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return time, beat frequency, velocity and force, reduced as LiveView says."""
        begin = -self._dropped % self.bin_points
        bins = max(0, (self._values.shape[1] - begin) // self.bin_points)
        kept = self._values[:, begin : begin + bins * self.bin_points].reshape(4, bins, self.bin_points)
        pairs = np.stack((kept.min(axis=2), kept.max(axis=2)), axis=2).reshape(4, 2 * bins)
        pairs.flags.writeable = False
        return pairs[0], pairs[1], pairs[2], pairs[3]

    def view(self, raw_time_s: Floats, raw_v: NDArray[np.float32], problem: str | None, skipped: int) -> LiveView:
        raw_time_s.flags.writeable = False
        raw_v.flags.writeable = False
        return LiveView(*self.curves(), raw_time_s, raw_v, problem, skipped)
