"""How many samples a second a running stream brings, by the computer's clock: a wrong rate makes every speed wrong."""

from dataclasses import dataclass

LEAST_S = 1.0  # of stream
LATE_S = 0.3  # by which a device and its driver may be late or early
OFF = 5e-4  # of the rate: what neither a crystal nor the computer's clock is off by


@dataclass(slots=True)
class DeliveredRate:
    """Counts what a stream of ``stated_hz`` brings; ``doubtful_hz`` is what came instead, None while that agrees."""

    stated_hz: float
    doubtful_hz: float | None = None
    _begun_s: float | None = None
    _samples: int = 0

    def add(self, samples: int, lost: int | None, now_s: float, *, waits: bool) -> None:
        """Take a block that came at ``now_s``, so many samples lost before it (None: nobody knows, it begins anew).

        Where more ``waits`` to be fetched nothing is said: the computer is late then, not the device.
        """
        if lost is None or self._begun_s is None or now_s < self._begun_s:
            self._begun_s, self._samples = now_s, 0
            return
        self._samples += samples + lost
        passed_s = now_s - self._begun_s
        if waits or passed_s < LEAST_S:
            return
        off_s = abs(self._samples / self.stated_hz - passed_s)
        self.doubtful_hz = self._samples / passed_s if off_s > LATE_S + OFF * passed_s else None
