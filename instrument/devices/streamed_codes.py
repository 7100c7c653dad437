"""Convert the bytes of a two-channel 8-bit streamer to counts, and cut the stream where samples were lost.

Losses are found by the byte clock, and by the phase of a steady beat.
"""

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from instrument.devices.bulk_stream import Chunk
from instrument.devices.digitizer import Block

PACKET_BYTES = 512
SETTLING_PACKETS = 8  # discarded packets (2048 samples per channel) in which the input settles
_UNDECIDED_PACKETS = 2  # last packets for which only later packets decide whether samples were lost before them
_SAME_LOSS_S = 2.5  # longest delay between detection of one loss by the beat and by the clock


class StreamedCodes:
    """The stream from chunks received (``accept``) to samples delivered (``deliver``).

    ``reference_column`` is the channel (0 or 1) with the rest beat, whose phase reveals lost packets.  If None, only
    the byte clock does, later and for larger losses only.
    """

    def __init__(self, bytes_per_s: float, reference_column: int | None) -> None:
        self._column = reference_column
        self._clock = ByteClock(bytes_per_s)
        self._seams = PacketLossFinder(PACKET_BYTES // 2)
        self._ready: deque[tuple[NDArray[np.uint8], bool]] = deque()
        self._undecided = np.empty(0, np.uint8)
        self._part = np.empty(0, np.uint8)  # an incomplete packet
        self._lost = False  # True: samples are missing before the undecided packets
        self._settling = SETTLING_PACKETS * PACKET_BYTES
        self._loss_seen_s = -math.inf

    @property
    def ready(self) -> bool:
        """Get whether ``deliver`` has samples."""
        return bool(self._ready)

    def accept(self, chunk: Chunk) -> None:
        """Add a chunk's bytes and find the losses in them."""
        lost = chunk.lost_before
        behind = self._clock.count(chunk.codes.size, chunk.received_s)
        if behind and chunk.received_s - self._loss_seen_s > _SAME_LOSS_S:
            lost = True
        if lost:
            self._loss_seen_s = chunk.received_s
            self.flush()
            self._lost = True
        codes = np.concatenate((self._part, chunk.codes)) if self._part.size else chunk.codes
        if self._settling:
            skipped = min(self._settling, codes.size)
            self._settling -= skipped
            codes = codes[skipped:]
        whole = codes.size // PACKET_BYTES * PACKET_BYTES
        self._part, codes = codes[whole:], codes[:whole]
        seams = [] if self._column is None else self._seams.find(codes[self._column :: 2])
        if seams:
            self._loss_seen_s = chunk.received_s
        cuts = [seam * PACKET_BYTES + self._undecided.size for seam in seams]
        joined = np.concatenate((self._undecided, codes)) if self._undecided.size else codes
        settled = max(0, joined.size - _UNDECIDED_PACKETS * PACKET_BYTES)
        start = 0
        for cut in (*cuts, settled):
            if start < cut <= settled:
                self._ready.append((joined[start:cut], self._lost))
                self._lost = False
                start = cut
            self._lost = self._lost or cut in cuts
        self._undecided = joined[settled:]

    def flush(self) -> None:
        """Make the undecided packets ready, whole samples only, because the stream does not continue after them."""
        rest = np.concatenate((self._undecided, self._part))
        rest = rest[: rest.size // 2 * 2]
        if rest.size:
            self._ready.append((rest, self._lost))
            self._lost = False
        self._undecided = self._part = np.empty(0, np.uint8)
        self._seams.forget()

    def deliver(self, buffer: NDArray[np.int16]) -> Block:
        """Fill ``buffer`` (shape (n, 2)) from the front with codes minus 128; stop before the next loss."""
        filled = 0
        lost_before = bool(self._ready) and self._ready[0][1]
        while self._ready and filled < buffer.shape[0]:
            codes, lost = self._ready[0]
            if lost and filled:
                break
            count = min(codes.size // 2, buffer.shape[0] - filled)
            pairs = codes[: 2 * count].reshape(count, 2)
            np.subtract(pairs, 128, out=buffer[filled : filled + count], dtype=np.int16)
            filled += count
            self._ready.popleft()
            if 2 * count < codes.size:
                self._ready.appendleft((codes[2 * count :], False))
        return Block(filled, lost_before=None if lost_before else 0)


DRIFT = 300e-6  # largest relative deviation of two crystals' frequencies
SHORT_WINDOW_S, SHORT_STEP_S = 0.3, 0.03
LONG_WINDOW_S, LONG_STEP_S = 2.0, 0.004


class ByteClock:
    """Compares the bytes received with ``bytes_per_s`` times the time elapsed."""

    def __init__(self, bytes_per_s: float) -> None:
        self._rate = bytes_per_s
        self._recent: deque[tuple[float, float]] = deque()  # (time, lag) in s
        self._received: int | None = None  # bytes since the first chunk
        self._level_s: float | None = None  # the lag without a loss
        self._judged_s: float

    def count(self, received_bytes: int, now_s: float) -> int:
        """Count a chunk that arrived at ``now_s``; return the number of lost bytes detected, usually 0.

        A loss of more than 30 ms of data is detected after 0.3 s, a loss of more than 4 ms after 2 s.
        """
        if self._received is None:
            self._received = 0
            return 0  # the first chunk only starts the clock, as the time to fill it is unknown
        self._received += received_bytes
        self._recent.append((now_s, now_s - self._received / self._rate))
        while self._recent[0][0] < now_s - LONG_WINDOW_S:
            self._recent.popleft()
        if len(self._recent) < 4:
            return 0
        soon_s = min(lag for at, lag in self._recent if at >= now_s - SHORT_WINDOW_S)
        if self._level_s is None:
            self._level_s, self._judged_s = soon_s, now_s
            return 0
        creep_s = DRIFT * (now_s - self._judged_s)
        self._judged_s = now_s
        lasting_s = min(lag for _, lag in self._recent)
        for lag_s, step_s in ((soon_s, SHORT_STEP_S), (lasting_s, LONG_STEP_S)):
            if lag_s - self._level_s > step_s + creep_s:
                lost = round((lag_s - self._level_s) * self._rate)
                self._level_s = lag_s
                return lost
        behind_s = soon_s - self._level_s
        self._level_s += behind_s if behind_s < -LONG_STEP_S else max(-creep_s, min(creep_s, behind_s))
        return 0


_FREQUENCY_SAMPLES = 1 << 14
_MIN_STEP_RAD = 0.12
_SIGMAS = 10.0
_COHERENT = 0.25  # least share of a packet's power in the beat for its phase to be tested


class PacketLossFinder:
    """Finds the packets before which samples were lost, from the counts of one channel that carries a steady beat.

    A loss of a few packets is too short for the byte clock, but the beat's phase steps at the packet boundary.  Each
    packet yields one phasor.  The second difference of the phasors' phases is zero for a steady beat, (+a, -a) where
    the phase steps by a between two packets, and (e, -2e, e) at a packet that is disturbed but not lost.  Cost: 2
    float32 multiplications per sample.
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
        limit = max(_MIN_STEP_RAD, _SIGMAS * self._sigma)
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
