"""Bytes counted against the clock: a device that drops data silently falls behind, and stays behind.

A late delivery makes the count fall behind only for a while, since what was queued still arrives; so the smallest lag
within a window is what the device itself is behind.  It may creep with the crystals (``drift``); a step is a loss.
"""

from collections import deque


class ByteClock:
    """Compares bytes received with ``bytes_per_s`` times the time elapsed; state is carried from chunk to chunk."""

    def __init__(
        self, bytes_per_s: float, *, window_s: float = 0.3, tolerance_s: float = 0.004, drift: float = 300e-6
    ) -> None:
        self._rate = bytes_per_s
        self._window_s = window_s
        self._tolerance_s = tolerance_s
        self._drift = drift
        self._recent: deque[tuple[float, float]] = deque()
        self._start_s: float | None = None
        self._received = 0
        self._level_s: float | None = None  # the lag that counts as none
        self._judged_s = 0.0

    def count(self, received_bytes: int, now_s: float) -> int:
        """Add a chunk that arrived at ``now_s``; return how many bytes the device is found to have lost, mostly 0.

        The figure is good to about the tolerance times the rate, and is told up to one window after the loss.
        """
        if self._start_s is None:
            self._start_s = self._judged_s = now_s
            return 0  # the first chunk only starts the clock: how long it took to fill is not known
        self._received += received_bytes
        self._recent.append((now_s, now_s - self._start_s - self._received / self._rate))
        while self._recent[0][0] < now_s - self._window_s:
            self._recent.popleft()
        if now_s - self._start_s < self._window_s or len(self._recent) < 4:
            return 0
        lag_s = min(lag for _, lag in self._recent)
        if self._level_s is None:
            self._level_s, self._judged_s = lag_s, now_s
            return 0
        creep_s = self._drift * (now_s - self._judged_s)
        behind_s = lag_s - self._level_s
        self._judged_s = now_s
        if behind_s > self._tolerance_s + creep_s:
            self._level_s = lag_s
            return round(behind_s * self._rate)
        self._level_s += max(-creep_s, min(creep_s, behind_s)) if behind_s > -self._tolerance_s else behind_s
        return 0
