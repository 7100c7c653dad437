"""The immutable snapshot of the running instrument that the screen polls."""

from dataclasses import dataclass, field
from pathlib import Path

from analysis.fitted import fit_pending
from analysis.shot import Shot
from instrument.capture.acquisition import State
from instrument.devices import CaptureSettings
from instrument.live import ChannelSignal, LiveView
from instrument.trigger import Level


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
class CapturedShot:
    """One captured shot and the settings it was taken with: waiting for its analysis, then with its readings or fit.

    ``shot`` is None while it waits, and afterwards if it was not analysed.
    """

    number: int  # counts captures from 1, those of one rig over all its sources
    name: str
    path: Path | None  # of the .sigmf-meta; None while it is only in memory
    settings: CaptureSettings
    shot: Shot | None = None
    problem: str | None = None  # why it was not saved or not analysed
    waits: bool = False  # for its analysis
    fitted_later: bool = False  # True: this completes a shot that the rig reported earlier without its fit

    @property
    def awaits_fit(self) -> bool:
        """Get whether the shot has its readings but not its fit yet."""
        return self.shot is not None and fit_pending(self.shot)


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
    shots: int = 0  # captured since the start
    captured: tuple[CapturedShot, ...] = ()  # all that wait for their analysis, and the newest others
    save_failed: bool = False  # True: the fault is that a shot could not be saved
    unsaved: tuple[str, ...] = field(default=())  # names of shots that are only in memory: save_pending

    @property
    def waiting(self) -> tuple[CapturedShot, ...]:
        """Get the shots captured and not analysed yet, oldest first."""
        return tuple(shot for shot in self.captured if shot.waits)

    @property
    def finished(self) -> tuple[CapturedShot, ...]:
        """Get the newest shots that wait for no analysis, the one with the latest news last."""
        return tuple(shot for shot in self.captured if not shot.waits)
