"""The immutable snapshot of the running instrument that the screen polls."""

from dataclasses import dataclass, field
from pathlib import Path

from analysis.shot import Shot
from instrument.capture.acquisition import State
from instrument.devices import CaptureSettings
from instrument.live import ChannelSignal, LiveView
from instrument.trigger import Level

KEPT_IN_MEMORY = "the shot is kept in memory: save it to another folder"  # the remedy for a shot that was not saved


@dataclass(frozen=True, slots=True)
class SignalLine:
    """The signals before arming: beats, clipping, light switch, disk space."""

    channels: tuple[ChannelSignal, ...] = ()
    switch_level: Level = Level.UNKNOWN
    switch_toggles: int = 0
    switch_thresholds_v: tuple[float | None, float | None] = (None, None)  # low, high; as they are now, set or learned
    disk_free_bytes: int | None = None
    folder: Path | None = None
    folder_problem: str | None = None
    samples_lost: int = 0  # since the last arming, as the device counts them
    losses: int = 0  # number of losses
    samples_read: int = 0  # per channel, of the running stream


@dataclass(frozen=True, slots=True)
class FinishedShot:
    """One captured shot and the settings it was taken with; ``shot`` is None if it was not analysed.

    A shot may first appear with its readings and later, under the same index, with its fit.
    """

    index: int  # counts finished shots from 1
    name: str
    path: Path | None  # of the .sigmf-meta; None while it is only in memory
    settings: CaptureSettings
    shot: Shot | None
    problem: str | None = None  # why it was not saved or not analysed
    fitted_later: bool = False  # True: this completes a shot reported earlier without its fit


@dataclass(frozen=True, slots=True)
class WaitingShot:
    """A captured shot that is not analysed yet; ``number`` counts captures from 1."""

    number: int
    name: str
    path: Path | None  # of the .sigmf-meta; None where it is only in memory


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The instrument at one moment."""

    state: State
    since_s: float  # by the monotonic clock
    automatic: bool
    message: str
    remedy: str
    signal: SignalLine
    live: LiveView
    doing: str | None = None  # the step in progress
    progress: float | None = None  # of that step, 0 to 1
    waiting: tuple[WaitingShot, ...] = ()  # shots captured and not analysed yet, oldest first
    shots: int = 0  # captured since the start
    finished: tuple[FinishedShot, ...] = ()  # the newest ones, by rising index
    unsaved: tuple[str, ...] = field(default=())  # names of shots that are only in memory: save_pending
