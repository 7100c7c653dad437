"""The stream of a running digitizer in its ring, and its sample rate by the computer's clock."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Channel, Role, Setup
from instrument.devices import CaptureSettings, Ring


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
