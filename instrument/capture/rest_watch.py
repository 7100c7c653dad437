"""The floor of the site while nobody moves the block: velocity of the running stream, gathered as long as it rests."""

import numpy as np
from numpy.typing import NDArray

from analysis.reading.site import LEAST_S, PlannedShot, SiteFloor, read_site
from analysis.signal.stream import LiveChunk
from instrument.devices.digitizer import CaptureSettings

Floats = NDArray[np.float64]
KEPT_S = 4.0  # of rest: motors a tenth of a hertz beside the mains are told from it
EVERY_S = 1.0  # of stream, a new reading
AT_REST_M_PER_S = 2e-3  # a hand that holds moves by less, one that pushes by more
_JOINED = 4  # points of the live curves a sample
_SWITCH_S = 2.6e-3  # from light switch to plate at a usual speed


class RestWatch:
    """Gathers from a live curve of ``rate_hz``; ``floor`` is the newest reading, None until there was enough rest."""

    def __init__(self, rate_hz: float, planned: PlannedShot) -> None:
        self._rate_hz, self._planned = rate_hz / _JOINED, planned
        self._kept = np.empty(0)
        self._left = np.empty(0)
        self._due = 0
        self.floor: SiteFloor | None = None

    def add(self, chunk: LiveChunk) -> None:
        """Take a chunk's velocity; what is not at rest, or a gap, begins anew and leaves the last floor standing."""
        velocity = np.concatenate((self._left, chunk.velocity_m_per_s))
        whole = velocity.size - velocity.size % _JOINED
        self._left = velocity[whole:]
        means = velocity[:whole].reshape(-1, _JOINED).mean(axis=1)
        moved = np.flatnonzero(~(np.abs(means) < AT_REST_M_PER_S))
        if moved.size:
            self._kept = np.empty(0)
            means = means[moved[-1] + 1 :]
        self._due -= means.size
        self._kept = np.concatenate((self._kept, means))[-round(KEPT_S * self._rate_hz) :]
        if self._due <= 0 and self._kept.size >= LEAST_S * self._rate_hz:
            self._due = round(EVERY_S * self._rate_hz)
            self.floor = read_site(self._kept, self._rate_hz, self._planned)


def planned_shot(settings: CaptureSettings) -> PlannedShot:
    """Return the flights that a shot of these settings will hold, at a usual speed."""
    usual = PlannedShot()
    before = settings.pre_trigger_samples / settings.sample_rate_hz + _SWITCH_S
    after = settings.samples / settings.sample_rate_hz - before - usual.contact_s
    least = 2e-3
    return PlannedShot(before_s=max(before, least), after_s=max(after, least))
