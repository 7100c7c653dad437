"""What the screen pulls: one immutable picture of the running instrument."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.reading.site import SiteFloor
from analysis.shot.recording import Role
from analysis.shot.shot import Shot
from instrument.capture.acquisition import State
from instrument.capture.trigger import Level
from instrument.devices.digitizer import CaptureSettings

Floats = NDArray[np.float64]


KEPT_IN_MEMORY = "the shot is kept in memory: save it to another folder"  # the remedy while it is unsaved


@dataclass(frozen=True, slots=True)
class ChannelSignal:
    """One channel as it looks now, over the last few milliseconds."""

    role: Role
    amplitude_v: float  # of the beat (rms times root two); of the switch: its level
    clipped_fraction: float
    frequency_hz: float | None  # of the strongest line; None where nothing stands out of the noise
    snr_db: float | None  # that line against everything else


@dataclass(frozen=True, slots=True)
class SignalLine:
    """The answers before arming: is the beat there, not clipped, does the switch toggle, is there room."""

    channels: tuple[ChannelSignal, ...] = ()
    switch_level: Level = Level.UNKNOWN
    switch_toggles: int = 0
    switch_thresholds_v: tuple[float | None, float | None] = (None, None)  # low, high; as they are now, set or learned
    disk_free_bytes: int | None = None
    folder: Path | None = None
    folder_problem: str | None = None
    samples_lost: int = 0  # since the last arm; the device's own count
    losses: int = 0  # how many times
    samples_read: int = 0  # a channel, of the running stream


@dataclass(frozen=True, slots=True)
class LiveView:
    """A sliding window of the running stream; arrays are read-only.

    The three curves share ``time_s`` and are already reduced to the least and the greatest value of each bin, in
    turn, so shape (2 k,) with k at most ``MOST_BINS``; NaN parts stretches at a gap.  ``raw_v`` is the newest stretch
    of samples in V, shape (n, channels), at ``raw_time_s``.
    """

    time_s: Floats
    beat_frequency_hz: Floats
    velocity_m_per_s: Floats
    force_n: Floats
    raw_time_s: Floats
    raw_v: NDArray[np.float32]
    rest_frequency_hz: float | None = None
    problem: str | None = None  # why nothing can be shown
    skipped: int = 0  # samples passed over for the screen's sake; recordings never miss them
    floor: SiteFloor | None = None  # of the site, from when the block last was at rest


MOST_BINS = 1000


def empty_view() -> LiveView:
    """Return a view of nothing."""
    none = np.empty(0)
    none.flags.writeable = False
    return LiveView(none, none, none, none, none, np.empty((0, 0), np.float32))


@dataclass(frozen=True, slots=True)
class FinishedShot:
    """One captured shot, with the settings it was taken with; ``shot`` is None until it is read, or not at all.

    It may come awaiting its fit first, and later, under the same index, with it.
    """

    index: int  # rises by one a shot, from 1
    name: str
    path: Path | None  # of the .sigmf-meta; None while it is only in memory
    settings: CaptureSettings
    shot: Shot | None
    problem: str | None = None  # why it was not saved or not analysed
    fitted_later: bool = False  # whether the shot was there before, awaiting its fit


@dataclass(frozen=True, slots=True)
class WaitingShot:
    """A shot that was captured and is not analysed yet; ``number`` rises by one a capture, from 1."""

    number: int
    name: str
    path: Path | None  # of the .sigmf-meta; None where it is only in memory


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The instrument at one moment.  Times are those of the monotonic clock, in s."""

    state: State
    since_s: float
    deadline_s: float | None
    automatic: bool
    message: str
    remedy: str
    source: str
    signal: SignalLine
    live: LiveView
    doing: str | None = None  # what is in progress
    progress: float | None = None  # of it, 0 to 1
    analysing: int = 0  # shots captured and not analysed yet
    waiting: tuple[WaitingShot, ...] = ()  # those shots, oldest first
    shots: int = 0  # captured since the start
    finished: tuple[FinishedShot, ...] = ()  # the newest ones, by rising index
    unsaved: tuple[str, ...] = field(default=())  # names of shots that are only in memory: save_pending
