"""Measures the motion of the site from the velocity of the running stream while the block is at rest."""

import numpy as np
from numpy.typing import NDArray

from analysis.reading import LEAST_S, PlannedShot, SiteFloor, read_site
from analysis.signal import LiveChunk
from instrument.devices import CaptureSettings

Floats = NDArray[np.float64]
KEPT_S = 4.0  # of rest: enough to resolve motors a tenth of a hertz from the mains
EVERY_S = 1.0  # of stream between two readings
AT_REST_M_PER_S = 2e-3  # a hand that holds the block moves it more slowly, one that pushes it faster
_AVERAGED = 4  # points of the live curve that make one sample
_SWITCH_S = 2.6e-3  # from light switch to plate at a usual speed


class RestWatch:
    """Collects rest from a live curve of ``rate_hz``; ``floor`` is the newest reading, None before the first one."""

    def __init__(self, rate_hz: float, planned: PlannedShot) -> None:
        self._rate_hz, self._planned = rate_hz / _AVERAGED, planned
        self._kept = np.empty(0)
        self._left = np.empty(0)
        self._due = 0
        self.floor: SiteFloor | None = None

    def add(self, chunk: LiveChunk) -> None:
        """Add a chunk's velocity; a motion or a gap discards what was collected, but not the last floor."""
        velocity = np.concatenate((self._left, chunk.velocity_m_per_s))
        whole = velocity.size - velocity.size % _AVERAGED
        self._left = velocity[whole:]
        means = velocity[:whole].reshape(-1, _AVERAGED).mean(axis=1)
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
    """Return the lengths of the two flights in a shot of these settings, at a usual speed."""
    usual = PlannedShot()
    before = settings.pre_trigger_samples / settings.sample_rate_hz + _SWITCH_S
    after = settings.samples / settings.sample_rate_hz - before - usual.contact_s
    least = 2e-3
    return PlannedShot(before_s=max(before, least), after_s=max(after, least))
