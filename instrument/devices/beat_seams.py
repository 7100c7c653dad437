"""Seams in a steady beat: where whole USB packets vanished, the rest beat's phase steps at a packet boundary.

The clock does not see a loss of a few packets, the phase does.  One phasor a packet: its second difference is zero
while the beat is steady, and reads (+a, -a) where the phase steps by a between two packets; a packet that is itself
disturbed reads (e, -2e, e) and is no loss.  Cost: one float32 matrix product, 2 multiplications a sample.
"""

import math

import numpy as np
from numpy.typing import NDArray

_FIRST_LOOK = 1 << 14
_FLOOR_RAD = 0.12
_SIGMAS = 10.0
_COHERENT = 0.25  # share of a packet's power that must be in the beat for its phase to be judged


class BeatSeams:
    """Finds the packets before which samples were lost, from the counts of one channel that carries a steady beat.

    The first 16,384 samples only tell the beat's frequency; a loss among them is not seen.
    """

    def __init__(self, packet_samples: int) -> None:
        self._n = packet_samples
        self._table: NDArray[np.float32] | None = None
        self._phases = np.empty(0)
        self._coherent = np.empty(0, bool)
        self._sigma = 0.0
        self._looked_at = np.empty(0)

    def forget(self) -> None:
        """Start afresh: what comes next does not continue what came."""
        self._phases = np.empty(0)
        self._coherent = np.empty(0, bool)

    def find(self, counts: NDArray[np.uint8] | NDArray[np.int16]) -> list[int]:
        """Return the packets (index into ``counts`` // packet samples) that do not continue the one before.

        ``counts`` holds whole packets (any multiple of packet_samples) and continues the last call's.  A step in
        the last two packets is only told by the next call, with a negative index (-1: before the last call's last one).
        """
        packets = counts.size // self._n
        if packets == 0:
            return []
        if self._table is None and not self._lock(counts):
            self.forget()
            return []
        assert self._table is not None
        values = counts[: packets * self._n].reshape(packets, self._n).astype(np.float32)
        sums = values @ self._table
        mean = sums[:, 2] / self._n
        phasors = (sums[:, 0] - mean * self._table[:, 0].sum()) + 1j * (sums[:, 1] - mean * self._table[:, 1].sum())
        power = np.einsum("ij,ij->i", values, values) - self._n * mean.astype(np.float64) ** 2
        share = 2 * np.abs(phasors) ** 2 / (self._n * np.maximum(power, 1e-9))
        kept = self._phases.size
        phases = np.concatenate((self._phases, np.angle(phasors)))
        coherent = np.concatenate((self._coherent, share > _COHERENT))
        if np.count_nonzero(coherent) < coherent.size // 2:
            self._table = None  # the beat went elsewhere: look for it again
        bend = np.angle(np.exp(1j * np.diff(phases, 2)))  # bend[i] is centred on packet i + 1
        judged = coherent[:-2] & coherent[1:-1] & coherent[2:]
        if self._sigma == 0.0 and np.count_nonzero(judged) >= 16:
            self._sigma = 1.4826 * float(np.median(np.abs(bend[judged])))
        limit = max(_FLOOR_RAD, _SIGMAS * self._sigma)
        seams, reaches_end = _steps(bend, judged, limit) if self._sigma else ([], False)
        if reaches_end:
            self.forget()
        else:  # four packets hold every step that is not yet decided
            self._phases, self._coherent = phases[-4:], coherent[-4:]
        return [seam - kept for seam in seams]

    def _lock(self, counts: NDArray[np.uint8] | NDArray[np.int16]) -> bool:
        """Find the beat's frequency in the first samples; False while they are few or hold no clear one."""
        self._looked_at = np.concatenate((self._looked_at, counts[:_FIRST_LOOK].astype(np.float64)))[-_FIRST_LOOK:]
        if self._looked_at.size < _FIRST_LOOK:
            return False
        looked_at, self._looked_at = self._looked_at, np.empty(0)
        window = np.hanning(_FIRST_LOOK)
        spectrum = np.abs(np.fft.rfft((looked_at - looked_at.mean()) * window))
        spectrum[:8] = 0.0
        peak = int(np.argmax(spectrum[:-2]))
        if peak < 8 or spectrum[peak] < 20 * float(np.median(spectrum)):
            return False
        left, middle, right = np.log(spectrum[peak - 1 : peak + 2] + 1e-12)
        bend = left - 2 * middle + right
        at = peak + (0.5 * (left - right) / bend if bend < 0 else 0.0)
        angle = 2 * math.pi * at / _FIRST_LOOK * np.arange(self._n)
        self._table = np.stack((np.cos(angle), -np.sin(angle), np.ones(self._n)), axis=1).astype(np.float32)
        self._sigma = 0.0
        self.forget()
        return True


def _steps(bend: NDArray[np.float64], judged: NDArray[np.bool_], limit: float) -> tuple[list[int], bool]:
    """Return the packets before which the phase steps, and whether the last step runs into the end.

    ``bend[i]`` is centred on packet i + 1, so a step before packet m shows in bend m - 2 and m - 1.
    """
    beyond = judged & (np.abs(bend) > limit)
    found = []
    i = 0
    while i < bend.size:
        if not beyond[i]:
            i += 1
            continue
        end = i
        while end < bend.size and beyond[end]:
            end += 1
        group = bend[i:end]
        if end == bend.size and group.size < 3:
            break  # decided by what follows
        disturbed = group.size == 3 and abs(group.sum()) < limit and abs(group[0] - group[2]) < limit
        if group.size >= 2 and not disturbed:
            found.append(i + 2)
        if end == bend.size:
            return found, True
        i = end
    return found, False
