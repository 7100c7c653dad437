"""One uninterrupted run of a digitizer: from an ``arm`` to its end, in the ring."""

from dataclasses import dataclass, field

from analysis.shot.recording import Channel, Role, Setup
from instrument.capture.ring import Ring
from instrument.devices.digitizer import CaptureSettings


@dataclass(slots=True)
class Stream:
    """Where the samples of this run lie in the ring, and what is known of them; ``gaps`` only grows."""

    ring: Ring
    start: int  # ring number of its first sample
    settings: CaptureSettings
    channels: tuple[Channel, ...]
    setup: Setup
    source: str
    unseen_loss_s: float = 0.0
    gaps: list[tuple[int, int | None]] = field(default_factory=list)  # (ring number, samples lost before it)
    lost: int = 0
    losses: int = 0
    doubtful_rate_hz: float | None = None  # samples a second by the computer's clock, where that is not the rate

    def column(self, role: Role) -> int | None:
        """Return the channel index that carries ``role``, or None."""
        for index, channel in enumerate(self.channels):
            if channel.role is role:
                return index
        return None

    def note_loss(self, at: int, samples: int | None) -> None:
        """Note that samples were lost before ring number ``at``."""
        self.gaps.append((at, samples))
        self.lost += samples or 0
        self.losses += 1
        oldest = self.ring.oldest
        if len(self.gaps) > 64 and self.gaps[0][0] < oldest:
            self.gaps = [gap for gap in self.gaps if gap[0] >= oldest]
