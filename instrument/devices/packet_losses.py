"""Find lost USB packets from a steady beat: its phase steps at the packet boundary where samples are missing.

A loss of a few packets is too short for the byte clock but changes the phase.  Each packet yields one phasor.  The
second difference of the phasors' phases is zero for a steady beat, (+a, -a) where the phase steps by a between two
packets, and (e, -2e, e) at a packet that is disturbed but not lost.  Cost: 2 float32 multiplications per sample.
"""

import math

import numpy as np
from numpy.typing import NDArray

_FREQUENCY_SAMPLES = 1 << 14
_LEAST_STEP_RAD = 0.12
_SIGMAS = 10.0
_COHERENT = 0.25  # least share of a packet's power in the beat for its phase to be tested


class PacketLossFinder:
    """Finds the packets before which samples were lost, from the counts of one channel that carries a steady beat.

    The first 16,384 samples serve only to find the beat's frequency; a loss among them is not detected.
    """

    def __init__(self, packet_samples: int) -> None:
        self._n = packet_samples
        self._table: NDArray[np.float32] | None = None
        self._phases: NDArray[np.float64]  # this and the next two: of the beat at the table's frequency
        self._coherent: NDArray[np.bool_]
        self._sigma: float  # noise of the second differences in rad; 0.0: not yet known
        self._first = np.empty(0)  # samples from which the beat's frequency is found

    def forget(self) -> None:
        """Discard the phases, because the next packets do not continue the previous ones."""
        self._phases = np.empty(0)
        self._coherent = np.empty(0, bool)

    def find(self, counts: NDArray[np.uint8] | NDArray[np.int16]) -> list[int]:
        """Return the packets (index into ``counts`` // packet samples) before which samples were lost.

        ``counts`` holds whole packets (any multiple of packet_samples) and continues the previous call's.  A loss in
        the last two packets is found by the next call, with a negative index (-1: before this call's last packet).
        """
        packets = counts.size // self._n
        if packets == 0:
            return []
        if self._table is None and not self._lock(counts):
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
            self._table = None  # the beat's frequency has changed and must be found again
        bend = np.angle(np.exp(1j * np.diff(phases, 2)))  # bend[i] is centred on packet i + 1
        judged = coherent[:-2] & coherent[1:-1] & coherent[2:]
        if self._sigma == 0.0 and np.count_nonzero(judged) >= 16:
            self._sigma = 1.4826 * float(np.median(np.abs(bend[judged])))
        limit = max(_LEAST_STEP_RAD, _SIGMAS * self._sigma)
        seams, reaches_end = _steps(bend, judged, limit) if self._sigma else ([], False)
        if reaches_end:
            self.forget()
        else:  # the last four packets contain every undecided step
            self._phases, self._coherent = phases[-4:], coherent[-4:]
        return [seam - kept for seam in seams]

    def _lock(self, counts: NDArray[np.uint8] | NDArray[np.int16]) -> bool:
        """Find the beat's frequency in the first samples; return False if they are too few or show no clear beat."""
        length = _FREQUENCY_SAMPLES
        self._first = np.concatenate((self._first, counts[:length].astype(np.float64)))[-length:]
        if self._first.size < length:
            return False
        first, self._first = self._first, np.empty(0)
        spectrum = np.abs(np.fft.rfft((first - first.mean()) * np.hanning(length)))
        spectrum[:8] = 0.0
        peak = int(np.argmax(spectrum[:-2]))
        if spectrum[peak] <= 20 * float(np.median(spectrum)):
            return False
        angle = 2 * math.pi * peak / length * np.arange(self._n)  # error: half a bin, 1/128 cycle per packet
        self._table = np.stack((np.cos(angle), np.sin(angle), np.ones(self._n)), axis=1).astype(np.float32)
        self._sigma = 0.0
        self.forget()
        return True


def _steps(bend: NDArray[np.float64], judged: NDArray[np.bool_], limit: float) -> tuple[list[int], bool]:
    """Return the packets before which the phase steps, and whether the last step reaches the end.

    ``bend[i]`` is centred on packet i + 1, so a step before packet m appears in bend[m - 2] and bend[m - 1].
    """
    beyond = judged & (np.abs(bend) > limit)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], beyond, [False]))))
    found = []
    for begin, end in edges.reshape(-1, 2).tolist():
        group = bend[begin:end]
        if end == bend.size and group.size < 3:
            break  # cannot be decided without the next packets
        disturbed = group.size == 3 and abs(group.sum()) < limit and abs(group[0] - group[2]) < limit
        if group.size >= 2 and not disturbed:
            found.append(begin + 2)
        if end == bend.size:
            return found, True
    return found, False
