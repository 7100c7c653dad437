"""What the screen shows of a running stream: the live curves and the signal of each channel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.reading import SiteFloor
from analysis.shot import Role

Floats = NDArray[np.float64]

MOST_BINS = 1000


@dataclass(frozen=True, slots=True)
class ChannelSignal:
    """The signal of one channel over the last few milliseconds."""

    role: Role
    amplitude_v: float  # of the beat (rms times root two); of the switch: its level
    clipped_fraction: float
    frequency_hz: float | None  # of the strongest line; None if no line exceeds the noise
    snr_db: float | None  # power of that line over the power of everything else


@dataclass(frozen=True, slots=True)
class LiveView:
    """A sliding window of the running stream; arrays are read-only.

    The three curves share ``time_s`` and hold the least and the greatest value of each bin in turn: shape (2 k,), k at
    most ``MOST_BINS``; a NaN marks a gap.  ``raw_v`` are the newest samples in V, shape (n, channels), at
    ``raw_time_s``.
    """

    time_s: Floats
    beat_frequency_hz: Floats
    velocity_m_per_s: Floats
    force_n: Floats
    raw_time_s: Floats
    raw_v: NDArray[np.float32]
    problem: str | None = None  # why nothing can be shown
    skipped: int = 0  # samples left out on the screen; recordings have them
    floor: SiteFloor | None = None  # motion of the site while the block was last at rest


def empty_view() -> LiveView:
    """Return a view without samples."""
    none = np.empty(0)
    none.flags.writeable = False
    return LiveView(none, none, none, none, none, np.empty((0, 0), np.float32))
