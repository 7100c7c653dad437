"""A shot while its samples are received: one thread fills it, another writes it to disk."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.shot import DELIVERED, RATE_CONTRADICTED, Channel, Gap, Recording, Role, Setup
from instrument.devices import CaptureSettings
from instrument.files import ENDED_EARLY
from instrument.trigger import middle_of_step

_LEVEL_REACH_S = 50e-6  # distance from the step at which the light switch's two levels are measured
_ENOUGH = 0.9  # of the samples after the trigger: a shot with fewer counts as cut short


@dataclass(slots=True)
class GrowingShot:
    """Counts of one shot, in memory allocated at its trigger, shape (samples of the settings, channels)."""

    settings: CaptureSettings
    channels: tuple[Channel, ...]
    setup: Setup
    source: str
    started_at: str
    trigger_sample: int
    counts: NDArray[np.int16]
    unseen_loss_s: float = 0.0  # a loss shorter than this may go unnoticed
    doubtful_rate_hz: float | None = None  # the rate by the computer's clock, where it contradicts the stated one
    filled: int = 0
    written: int = 0  # of them, already on disk
    gaps: list[Gap] = field(default_factory=list)
    ended_early: str | None = None
    complete: bool = False
    grown: threading.Event = field(default_factory=threading.Event)

    @property
    def room(self) -> int:
        """Get the number of samples still missing."""
        return int(self.counts.shape[0]) - self.filled

    def append(self, counts: NDArray[np.int16]) -> None:
        """Append samples of shape (n, channels), at most ``room`` of them."""
        taken = min(self.room, counts.shape[0])
        self.counts[self.filled : self.filled + taken] = counts[:taken]
        self.filled += taken
        self.grown.set()

    def lost(self, samples_lost: int | None) -> None:
        """Note that samples were lost before the next one."""
        if self.filled > 0:
            self.gaps.append(Gap(self.filled, samples_lost))

    def finish(self, reason: str | None = None) -> None:
        """End the shot; ``reason`` says why samples are missing.  Nothing is added after this."""
        after = self.settings.samples - self.settings.pre_trigger_samples
        if reason is not None and self.filled - self.trigger_sample < _ENOUGH * after:
            self.ended_early = reason
        for column, channel in enumerate(self.channels):
            if channel.role is Role.SWITCH:
                reach = max(32, round(_LEVEL_REACH_S * self.settings.sample_rate_hz))
                seen = self.counts[: self.filled, column]
                self.trigger_sample = middle_of_step(seen, self.trigger_sample, reach)
        self.complete = True
        self.grown.set()

    @property
    def extra(self) -> Mapping[str, Any]:
        """Get the metadata of the capture that are saved with the shot."""
        own: dict[str, Any] = {
            "lmm:capture": {
                "source": self.source,
                "samples": self.settings.samples,
                "pre_trigger_samples": self.settings.pre_trigger_samples,
            }
        }
        if self.unseen_loss_s:
            own["lmm:capture"]["unseen_loss_s"] = self.unseen_loss_s
        if self.doubtful_rate_hz is not None:
            own[DELIVERED] = self.doubtful_rate_hz
        if self.ended_early is not None:
            own[ENDED_EARLY] = self.ended_early
        return {"global": own}

    def recording(self, name: str) -> Recording:
        """Return the shot as a recording in memory; it shares the shot's counts, read-only."""
        counts = self.counts[: self.filled]
        counts.flags.writeable = False
        causes = (("gap", self.gaps), ("cut_short", self.ended_early), (RATE_CONTRADICTED, self.doubtful_rate_hz))
        flags = [flag for flag, cause in causes if cause]
        return Recording(
            name=name,
            counts=counts,
            sample_rate_hz=self.settings.sample_rate_hz,
            channels=self.channels,
            setup=self.setup,
            trigger_sample=self.trigger_sample if self.trigger_sample < self.filled else None,
            gaps=tuple(self.gaps),
            started_at=self.started_at,
            flags=tuple(flags),
            extra=self.extra,
        )
