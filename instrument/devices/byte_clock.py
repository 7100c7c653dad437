"""Bytes counted against the clock: a device that drops data silently falls behind, and stays behind.

A late delivery makes the count fall behind only for a while, since what was queued still arrives; so the smallest lag
within a window is what the device itself is behind.  It may creep with the crystals; a step is a loss.  On a busy
computer every delivery may be some milliseconds late for a while, hence two windows: a large step is told soon, a
small one only when it has lasted.
"""

from collections import deque

DRIFT = 300e-6  # of two crystals against each other
SOON_S, SOON_STEP_S = 0.3, 0.03
LASTING_S, LASTING_STEP_S = 2.0, 0.004


class ByteClock:
    """Compares bytes received with ``bytes_per_s`` times the time elapsed; state is carried from chunk to chunk."""

    def __init__(self, bytes_per_s: float) -> None:
        self._rate = bytes_per_s
        self._recent: deque[tuple[float, float]] = deque()  # (time, lag) in s
        self._start_s: float | None = None
        self._received = 0
        self._level_s: float | None = None  # the lag that counts as none
        self._judged_s = 0.0

    def count(self, received_bytes: int, now_s: float) -> int:
        """Add a chunk that arrived at ``now_s``; return how many bytes the device is found to have lost, mostly 0.

        A loss of more than 30 ms of data is told 0.3 s after it, one of more than 4 ms 2 s after it.
        """
        if self._start_s is None:
            self._start_s = self._judged_s = now_s
            return 0  # the first chunk only starts the clock: how long it took to fill is not known
        self._received += received_bytes
        self._recent.append((now_s, now_s - self._start_s - self._received / self._rate))
        while self._recent[0][0] < now_s - LASTING_S:
            self._recent.popleft()
        if now_s - self._start_s < SOON_S or len(self._recent) < 4:
            return 0
        soon_s = min(lag for at, lag in self._recent if at >= now_s - SOON_S)
        if self._level_s is None:
            self._level_s, self._judged_s = soon_s, now_s
            return 0
        creep_s = DRIFT * (now_s - self._judged_s)
        self._judged_s = now_s
        lasting = now_s - self._recent[0][0] > 0.9 * LASTING_S
        lasting_s = min(lag for _, lag in self._recent) if lasting else self._level_s
        for lag_s, step_s in ((soon_s, SOON_STEP_S), (lasting_s, LASTING_STEP_S)):
            if lag_s - self._level_s > step_s + creep_s:
                lost = round((lag_s - self._level_s) * self._rate)
                self._level_s = lag_s
                self._recent.clear()
                return lost
        behind_s = soon_s - self._level_s
        self._level_s += behind_s if behind_s < -LASTING_STEP_S else max(-creep_s, min(creep_s, behind_s))
        return 0
